//! Figures of a comparison of actuators in a vehicle.

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_vehicle::{Airframe, AtLatency, LoopCurve, LoopMargin, MotorControlKind, Row, Study};

use super::bode::{Curve, bode, level, mark};

/// Height of a panel among several, pixels. Chosen: three quarters of a panel alone, 320, so that two are on a screen.
const HEIGHT: u32 = 240;
/// Frequencies of a loop that are drawn, rad/s. Chosen: crossovers are at some tens to hundreds; a decade and more around them is enough, and more
/// lays the curves on each other.
const LOOP_RAD_S: (f64, f64) = (1.0, 1000.0);
/// Lowest phase drawn, degrees. Chosen: as far under -180 as the axis' start, -90 or above, is over it; the gyro's filters turn on.
const LOWEST_PHASE_DEG: f64 = -270.0;

/// Bandwidths and disturbances at each latency, and lateral force where there is some.
pub fn vehicle_figures(study: &Study, airframe: &Airframe) -> Vec<Figure> {
    let loops = study.latencies.first().and_then(|at| rate_loops(at, airframe));
    let latencies = [bandwidths(study, airframe)].into_iter().chain(loops).chain([disturbances(study, airframe)]);
    latencies.chain(force(study)).collect()
}

/// The bare motor, the lead and an inverse have the colors that they have in every figure; others have those that are left.
fn actuator_colors(actuators: impl Iterator<Item = MotorControlKind>) -> Vec<Color> {
    let mut left = [Color::Sky, Color::Purple, Color::Green, Color::Orange].into_iter().cycle();
    let mut of_inverse = std::iter::once(Color::Blue);
    let color = |actuator| match actuator {
        MotorControlKind::None => Some(Color::Gray),
        MotorControlKind::Lead => Some(Color::Vermilion),
        MotorControlKind::Inverse { .. } => of_inverse.next().or_else(|| left.next()),
        MotorControlKind::SpeedFeedback { .. } => left.next(),
    };
    actuators.filter_map(color).collect()
}

fn at_hover(airframe: &Airframe) -> String {
    format!("tuned for {:.2} alone", airframe.hover.command)
}

fn over_range(airframe: &Airframe) -> String {
    let [from, to] = airframe.hover.range;
    format!("one gain set for {from:.2} to {to:.2}, worst")
}

fn bandwidths(study: &Study, airframe: &Airframe) -> Figure {
    let panel = |at: &AtLatency| {
        let names = at.hover.iter().map(|row| row.actuator.name()).collect();
        let points = |rows: &[Row]| {
            let known = rows
                .iter()
                .enumerate()
                .filter_map(|(index, row)| Some((row.performance.as_ref()?.margins.bandwidth_rad_s, index as f64)));
            known.collect()
        };
        let series = vec![
            Series::new(at_hover(airframe), Color::Green, Mark::Discs, points(&at.hover)),
            Series::new(over_range(airframe), Color::Purple, Mark::Rings, points(&at.range)),
        ];
        let y = Axis::names("actuator", names);
        Panel { title: latency(at.latency_s), height: HEIGHT, ..Panel::new(Axis::bandwidth(), y, series) }
    };
    Figure::new(
        FigureKind::VehicleBandwidth,
        "Bandwidth of the rate loop with each actuator",
        "Every controller is tuned to the same margins. A ring left of its disc is what one gain set for all hover commands costs.",
        study.latencies.iter().map(panel).collect(),
    )
}

/// The open rate loops, with the places of their margins.
fn rate_loops(at: &AtLatency, airframe: &Airframe) -> Option<Figure> {
    let colors = actuator_colors(at.hover.iter().map(|row| row.actuator));
    let loops: Vec<(String, Color, &LoopCurve)> = at
        .hover
        .iter()
        .zip(colors)
        .filter_map(|(row, color)| Some((row.actuator.name(), color, row.performance.as_ref()?.open.as_ref()?)))
        .collect();
    let curves: Vec<Curve> = loops
        .iter()
        .map(|(name, color, curve)| {
            let drawn =
                curve.response.iter().copied().filter(|(omega, _)| (LOOP_RAD_S.0..=LOOP_RAD_S.1).contains(omega));
            Curve::new(name.clone(), Mark::Line, *color, drawn.collect())
        })
        .collect();
    let mut panels = bode(&curves, "dB", &[("0 dB", 0.0)]);
    for (name, _, curve) in &loops {
        if let Some(LoopMargin { omega_rad_s, value }) = curve.phase_margin_deg {
            mark(&mut panels, name, omega_rad_s, Mark::Discs, &format!("phase margin {value:.1} degrees"));
        }
        if let Some(LoopMargin { omega_rad_s, value }) = curve.gain_margin_db {
            mark(&mut panels, name, omega_rad_s, Mark::Rings, &format!("gain margin {value:.1} dB"));
        }
    }
    let phase = &mut panels[1];
    phase.series.push(level("-180 degrees", -180.0, &curves));
    // Beyond the second turn nothing is controlled.
    for series in &mut phase.series {
        series.points.retain(|(_, degrees)| *degrees > LOWEST_PHASE_DEG);
    }
    let title = format!("Open rate loop with each actuator, {}, {}", latency(at.latency_s), at_hover(airframe));
    (!loops.is_empty()).then(|| {
        Figure::new(
            FigureKind::VehicleLoop,
            title,
            "A disc is where the magnitude is 1: the phase there is above -180 degrees by the phase margin. A ring is where the phase \
             passes -180 degrees: the magnitude there is under 1 by the gain margin.",
            panels,
        )
    })
}

fn disturbances(study: &Study, airframe: &Airframe) -> Figure {
    let panel = |rows: &[Row], title: String| {
        let colors = actuator_colors(rows.iter().map(|row| row.actuator));
        let series = rows.iter().zip(colors).filter_map(|(row, color)| {
            let points = row.performance.as_ref()?.disturbed.clone();
            Some(Series::new(row.actuator.name(), color, Mark::Line, points))
        });
        let axes = (Axis::linear("time", "s"), Axis::linear("roll angle", "degrees"));
        Panel { title, height: HEIGHT, ..Panel::new(axes.0, axes.1, series.collect()) }
    };
    let panels = study.latencies.iter().flat_map(|at| {
        let title = |rows: String| format!("{}, {rows}", latency(at.latency_s));
        [panel(&at.hover, title(at_hover(airframe))), panel(&at.range, title(over_range(airframe)))]
    });
    Figure::new(
        FigureKind::VehicleDisturbance,
        format!("Roll angle after a torque of {} N m", airframe.roll.disturbance_n_m),
        "A lower peak is a stiffer vehicle. What is left after it decays with the integral time.",
        panels.collect(),
    )
}

fn force(study: &Study) -> Option<Figure> {
    let colors = actuator_colors(study.lateral.iter().map(|row| row.actuator));
    let series = study
        .lateral
        .iter()
        .zip(colors)
        .map(|(row, color)| Series::new(row.actuator.name(), color, Mark::Line, row.step.clone()));
    let panel = Panel::new(Axis::linear("time", "s"), Axis::linear("lateral force", "N"), series.collect());
    (!study.lateral.is_empty()).then(|| {
        Figure::new(
            FigureKind::VehicleForce,
            "Step of the lateral force of a hexarotor with tilted rotors",
            "No loop is closed around the force: what is seen is the actuators.",
            vec![panel],
        )
    })
}

fn latency(latency_s: f64) -> String {
    format!("latency {:.1} ms", 1e3 * latency_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_of_the_usual_actuators_have_a_color_in_common() {
        let inverses = [94.0, 150.0, 200.0].map(|omega_f_rad_s| MotorControlKind::Inverse { omega_f_rad_s });
        let others =
            [MotorControlKind::None, MotorControlKind::Lead, MotorControlKind::SpeedFeedback { pole_rad_s: 100.0 }];
        let colors = actuator_colors(others.into_iter().chain(inverses));
        assert_eq!((colors[0], colors[1], colors[3]), (Color::Gray, Color::Vermilion, Color::Blue));
        for (index, color) in colors.iter().enumerate() {
            assert!(!colors[..index].contains(color), "{colors:?}");
        }
    }
}
