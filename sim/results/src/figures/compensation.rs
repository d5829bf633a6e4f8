//! Compensators and compensated responses: the paper's Figs. 8 to 12.

use num_complex::Complex64;
use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_design::redesign::Compensated;
use rotorlead_design::{BandwidthPoint, Chain, bandwidths as bandwidths_of};
use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, MINUS_3_DB};
use rotorlead_identify::lag::multisine::MeasuredBandwidth;
use rotorlead_identify::lag::multisine::{NominalIdentification, RecordResponse};
use rotorlead_plant::{CompensatorDesign, FilterDesign, Model};

use super::bode::{Curve, bode, mark};
use crate::number::at_nominal;

/// The lowest frequency of a model's curve, rad/s. Derived: that of the paper's excitation, 0.1 Hz, `2 pi 0.1`.
const FROM_RAD_S: f64 = 0.63;
/// Highest drawn of a chain without measurement, rad/s. Chosen: ten times the bandwidth of the paper's compensated motor, about 95; beyond,
/// nothing is controlled.
const TO_RAD_S: f64 = 1000.0;
/// Lowest phase drawn of a chain without measurement, degrees. Chosen: twice the -180 at which any loop around it has lost its phase; a
/// dead time turns on without end.
const LOWEST_PHASE_DEG: f64 = -360.0;

/// The color of a compensator's kind, as it is wherever kinds are compared. Without a design it is a lead.
#[must_use]
pub fn color(design: Option<&CompensatorDesign>) -> Color {
    match design.map(|design| &design.kind) {
        Some(FilterDesign::Inverse(_)) => Color::Blue,
        Some(FilterDesign::Lead(_)) | None => Color::Vermilion,
    }
}

/// The level that defines a bandwidth.
fn levels() -> [(&'static str, f64); 1] {
    [("-3 dB", 20.0 * MINUS_3_DB.log10())]
}

/// The compensator: as designed, and as the controller computes it.
#[must_use]
pub fn compensator(design: &CompensatorDesign, model: &Model) -> Figure {
    // Chosen: just below half the loop rate, where a sampled response is real and ends.
    let half = 0.98 * std::f64::consts::PI * design.loop_rate_hz();
    let ends = (FROM_RAD_S, half);
    let rate = format!("in integers, at {} Hz", design.loop_rate_hz());
    let mut curves = Vec::new();
    let caption = match &design.kind {
        FilterDesign::Lead(design) => {
            let lead = design.lead();
            curves.push(Curve::from_model("C(s)", Mark::Line, Color::Vermilion, ends, |omega| lead.response(omega)));
            // Lines of one color would hide each other where they agree.
            curves.push(Curve::from_model(rate, Mark::Dashes, Color::Purple, ends, |omega| design.response(omega)));
            format!(
                "It amplifies from its zero at {:.2} rad/s up to {:.0} rad/s, so that the command moves more than the flight controller \
                 asks for: a step is answered by at most {:.2} times that step.",
                lead.omega_z_rad_s,
                lead.omega_g_rad_s(),
                design.check().step_peak
            )
        }
        FilterDesign::Inverse(_) => {
            for (index, point) in model.points.iter().enumerate() {
                let Some(lead) = design.lead_at(point.nominal) else { continue };
                let (name, color) = (at_nominal(point.nominal), Color::nth(index));
                let continuous = |omega: f64| lead.response(omega);
                let sampled = |omega: f64| design.response(point.nominal, omega);
                curves.push(Curve::from_model(name.clone(), Mark::Line, color, ends, continuous).under(&name));
                let sampled = Curve::from_model(format!("{name}, {rate}"), Mark::Dashes, color, ends, sampled);
                curves.push(sampled.under(&name));
            }
            format!(
                "For small signals around each level it is a lead with its zero on the pole of the rotor there. At the slowest level a \
                 step would be answered by {:.2} times that step; the limits of the command are in its state.",
                design.step_peak()
            )
        }
    };
    Figure::new(FigureKind::Compensator, "Compensator", &caption, bode(&curves, "dB", &[]))
}

/// The model's lags over their static gain, without and with the compensator of `chain`, for small signals.
#[must_use]
pub fn simulated(model: &Model, chain: Chain) -> Figure {
    let curves = model.points.iter().enumerate().flat_map(|(index, point)| {
        let (group, color) = (at_nominal(point.nominal), Color::nth(index));
        let lag = |omega: f64| {
            Complex64::from_polar(1.0, -omega * point.delay_s) / Complex64::new(1.0, omega * point.time_constant_s)
        };
        let ends = (FROM_RAD_S, TO_RAD_S);
        let lead = chain.lead_at(point.nominal);
        let with = |omega: f64| lag(omega) * lead.map_or(Complex64::ONE, |lead| lead.response(omega));
        [
            Curve::from_model(format!("{group}, without"), Mark::Dashes, color, ends, lag).under(&group),
            Curve::from_model(format!("{group}, with"), Mark::Line, color, ends, with).under(&group),
        ]
    });
    let mut panels = bode(&curves.collect::<Vec<_>>(), "dB over the static gain", &levels());
    for found in bandwidths_of(model, chain) {
        for (with, bandwidth, shape) in
            [("without", found.uncompensated, Mark::Rings), ("with", found.compensated, Mark::Discs)]
        {
            let curve = format!("{}, {with}", at_nominal(found.nominal));
            if let Some(omega) = bandwidth.rad_s() {
                mark(&mut panels, &curve, omega, shape, &format!("bandwidth {omega:.1} rad/s"));
            }
        }
    }
    // A dead time turns without end, and nothing is controlled there.
    for phase in panels.iter_mut().skip(1).flat_map(|panel| &mut panel.series) {
        phase.points.retain(|(_, degrees)| *degrees > LOWEST_PHASE_DEG);
    }
    Figure::new(
        FigureKind::SimulatedResponse,
        "Response of the model over its static gain: broken without, full with the compensator",
        "Broken lines are without, full lines with the compensator. The bandwidth is where a curve first passes -3 dB: a ring without, \
         a disc with the compensator, and the same on its phase. A curve that \
         runs along that line has a bandwidth that a tenth of a decibel moves far. The phase has the model's dead time in it, which no \
         compensator takes out.",
        panels,
    )
}

/// Measured responses without and with a compensator, over the static gain; `None` without a compensated record.
#[must_use]
pub fn measured(found: &[NominalIdentification]) -> Option<Figure> {
    let mut curves = Vec::new();
    for (index, (with, after)) in with_compensator(found).enumerate() {
        let without = same(found, with.nominal);
        let (group, color) = (at_nominal(with.nominal), Color::nth(index));
        let plain_of = |one: &NominalIdentification| {
            let response = one.responses.iter().find(|response| !response.compensated)?;
            Some((response.actuator.smoothed().to_vec(), one.fit.gain.value))
        };
        if let Some((points, gain)) = without.and_then(plain_of) {
            let curve = Curve::measured(format!("{group}, without"), Mark::Dashes, color, &points, gain).under(&group);
            curves.push(Curve { bands: Vec::new(), ..curve });
        }
        // Each over the static value that its bandwidth is taken from.
        let (points, gain) = (after.actuator.smoothed(), with.fit.gain.value);
        curves.push(Curve::measured(format!("{group}, with"), Mark::Line, color, points, gain).under(&group));
    }
    (!curves.is_empty()).then(|| {
        Figure::new(
            FigureKind::MeasuredResponse,
            "Measured response over the static gain: broken without, full with the compensator",
            "Broken lines are without, full lines with the compensator and their 95 % band. Where a full line stays above its broken \
             one, the actuator has become faster.",
            bode(&curves, "dB over the static gain", &levels()),
        )
    })
}

/// The compensated response: simulated beside measured; `None` without a compensated record.
#[must_use]
pub fn simulation_and_experiment(found: &[NominalIdentification], design: &CompensatorDesign) -> Option<Figure> {
    let mut curves = Vec::new();
    for (index, (with, after)) in with_compensator(found).enumerate() {
        let fit = &same(found, with.nominal).unwrap_or(with).fit;
        let (gain, measured_gain) = (fit.gain.value, with.fit.gain.value);
        let (group, color) = (at_nominal(with.nominal), Color::nth(index));
        let points = after.actuator.smoothed();
        let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
        let ends = (first.omega_rad_s, last.omega_rad_s);
        let simulated = |omega: f64| fit.response(omega) * design.response(with.nominal, omega) / gain;
        curves.push(
            Curve::measured(format!("{group}, measured"), Mark::Dots, color, points, measured_gain).under(&group),
        );
        curves.push(Curve::from_model(format!("{group}, simulated"), Mark::Line, color, ends, simulated).under(&group));
    }
    (!curves.is_empty()).then(|| {
        Figure::new(
            FigureKind::SimulationAndExperiment,
            "Compensated response: dots measured, lines the identified lags with the compensator",
            "Dots are measured, with their 95 % band; lines are the identified lag behind the compensator. Where they part, the \
             actuator is more than a lag: `rotorlead diagnose` says what is missing.",
            bode(&curves, "dB over the static gain", &levels()),
        )
    })
}

/// The nominal commands that have a compensated record, with its response.
fn with_compensator(
    found: &[NominalIdentification],
) -> impl Iterator<Item = (&NominalIdentification, &RecordResponse)> {
    found.iter().filter_map(|one| Some((one, one.responses.iter().find(|response| response.compensated)?)))
}

/// The identification of records without compensator at the same nominal command.
fn same(found: &[NominalIdentification], nominal: f64) -> Option<&NominalIdentification> {
    let is_plain = |one: &NominalIdentification| one.responses.iter().any(|response| !response.compensated);
    // Chosen: 1e-6 is above the rounding of decimals, and below any step of a command.
    found.iter().find(|one| (one.nominal - nominal).abs() < 1e-6 && is_plain(one))
}

/// Bandwidth against nominal command: predicted, and measured where records say it. `None` where that is one command, of which the
/// table says as much. `color` is that of the compensator.
#[must_use]
pub fn bandwidths(points: &[BandwidthPoint], measured: &[MeasuredBandwidth], color: Color) -> Option<Figure> {
    let predicted = |of: fn(&BandwidthPoint) -> Bandwidth| -> Vec<(f64, f64)> {
        points.iter().filter_map(|point| Some((point.nominal, of(point).rad_s()?))).collect()
    };
    let mut series = vec![
        Series::new("without compensator, predicted", Color::Gray, Mark::Line, predicted(|point| point.uncompensated)),
        Series::new("with compensator, predicted", color, Mark::Line, predicted(|point| point.compensated)),
    ];
    for (name, color, is_compensated) in
        [("without compensator, measured", Color::Gray, false), ("with compensator, measured", color, true)]
    {
        let found = measured.iter().filter(|one| one.compensated == is_compensated);
        let known: Vec<_> = found.filter_map(|one| Some((one, one.bandwidth.bandwidth.rad_s()?))).collect();
        let end = |bandwidth: Bandwidth| bandwidth.rad_s().unwrap_or(f64::INFINITY);
        let notes = known.iter().map(|(one, _)| {
            let (low, high) = (end(one.bandwidth.lower), end(one.bandwidth.upper));
            format!("{}, 95 % interval {low:.2} to {high:.2} rad/s", one.file)
        });
        let points = known.iter().map(|(one, omega)| (one.nominal, *omega)).collect();
        series.push(Series::new(name, color, Mark::Discs, points).with_notes(notes.collect()));
        // Each interval stands upright at its point; between two of them nothing is drawn.
        let interval = |(one, omega): &(&MeasuredBandwidth, f64)| {
            let ends = [one.bandwidth.lower, one.bandwidth.upper].map(|end| end.rad_s().unwrap_or(*omega));
            [(one.nominal, ends[0]), (one.nominal, ends[1]), (one.nominal, f64::NAN)]
        };
        let intervals = known.iter().flat_map(interval).collect();
        series.push(Series::new(format!("{name}, 95 % interval"), color, Mark::Line, intervals).under(name));
    }
    series.retain(|series| !series.points.is_empty());
    let (low, high) = series
        .iter()
        .flat_map(|series| &series.points)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (nominal, _)| (low.min(*nominal), high.max(*nominal)));
    (low < high).then(|| {
        let panel = Panel::new(Axis::nominal(), Axis::bandwidth(), series);
        Figure::new(
            FigureKind::Bandwidth,
            "Bandwidth against nominal command",
            "The zero of a lead is at the fastest pole: the slower a level, the sooner it has fallen by 3 dB, and the less a lead \
             gains. An inverse has a zero for each level.",
            vec![Panel { height: 360, ..panel }],
        )
    })
}

/// Bandwidth against nominal command with effects present: of small deviations, and of sinusoids of `amplitude` through the
/// whole chain. `None` as for [`bandwidths`].
#[must_use]
pub fn redesigned(compensated: &Compensated, amplitude: f64) -> Option<Figure> {
    let points = &compensated.points;
    let small: Vec<BandwidthPoint> = points.iter().map(|point| point.small).collect();
    let mut figure = bandwidths(&small, &[], color(Some(&compensated.design)))?;
    let chain = points.iter().filter_map(|point| Some((point.small.nominal, point.chain.magnitude.rad_s()?))).collect();
    let name = format!("with compensator, sinusoids of {amplitude} duty");
    figure.panels[0].series.push(Series::new(name, Color::Green, Mark::Dashes, chain));
    figure.panels[0].series.retain(|series| !series.points.is_empty());
    figure.caption = "Where the broken line of sinusoids through the whole chain falls below that of small deviations, the actuator's \
                      limits take what the compensator asks for."
        .to_owned();
    Some(figure)
}

#[cfg(test)]
mod tests {
    use rotorlead_design::{DesignOptions, InverseOptions, design, design_inverse};

    use super::*;
    use crate::paper::table_1;

    #[test]
    fn a_lead_and_an_inverse_have_a_color_each_beside_the_bare_motor() {
        let model = table_1();
        let lead = CompensatorDesign::from(design(&model, &DesignOptions::default()).unwrap());
        let inverse = CompensatorDesign::from(design_inverse(&model, &InverseOptions::default()).unwrap().compensator);
        let colors = |figure: Figure| -> Vec<Color> {
            figure.panels.iter().flat_map(|panel| &panel.series).map(|series| series.color).collect()
        };
        for (design, color_of_kind) in [(&lead, Color::Vermilion), (&inverse, Color::Blue)] {
            let points = rotorlead_design::bandwidths(&model, Chain::Designed(design));
            let figure = bandwidths(&points, &[], color(Some(design))).unwrap();
            assert_eq!(colors(figure), [Color::Gray, color_of_kind]);
        }
        let of_lead = colors(compensator(&lead, &model));
        assert!(of_lead[0] == Color::Vermilion && !of_lead.contains(&Color::Blue), "{of_lead:?}");
    }
}
