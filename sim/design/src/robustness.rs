//! What is left of a bandwidth where the actuator is not as its model says.

use rotorlead_plant::effect::{parameter_error, second_pole, supply_sag, transport_delay};
use rotorlead_plant::{CompensatorDesign, Effect, Model, PlantError};
use serde::Serialize;

use super::redesign::sweep::Sweep;
use super::steps::steps_at;
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;

/// Amplitude of the sinusoids: small signals, which meet no limit. Chosen: a tenth of the steps; smaller ones come near the rounding of the
/// command, larger ones near its limits.
const AMPLITUDE: f64 = 0.005;
/// Size of the steps. Standard: the amplitude of the paper's experiments.
const STEP: f64 = 0.05;
/// How far the sinusoids are searched for a bandwidth, in natural frequencies. Chosen: the deviations raise a bandwidth by a fifth
/// at most (`docs/inverse.md`); farther costs time.
const SEARCHED: f64 = 2.5;

/// One way in which an actuator differs from its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// In a few words.
    pub name: &'static str,
    /// The effect that it is, with its parameters; `None` for the model itself.
    effect: Option<(&'static str, &'static [(&'static str, f64)])>,
    /// Voltage of the supply over that of the model.
    supply: f64,
}

impl Deviation {
    const fn by(name: &'static str, effect: &'static str, parameters: &'static [(&'static str, f64)]) -> Self {
        Self { name, effect: Some((effect, parameters)), supply: 1.0 }
    }

    const fn supply(name: &'static str, supply: f64) -> Self {
        Self { name, effect: None, supply }
    }
}

/// Time constants that are off, a lower voltage, a supply that loses a tenth by its resistance at a speed of 0.5, delays, and a second
/// lag. Chosen: from what an interval allows to beyond it, and delays up to the longest of a real log (26 ms, `docs/diagnosis-method.md`).
pub const DEVIATIONS: [Deviation; 12] = [
    Deviation::supply("as the model", 1.0),
    Deviation::by("tau -20 %", parameter_error::ID, &[("gain_error", 0.0), ("time_constant_error", -0.2)]),
    Deviation::by("tau -10 %", parameter_error::ID, &[("gain_error", 0.0), ("time_constant_error", -0.1)]),
    Deviation::by("tau +10 %", parameter_error::ID, &[("gain_error", 0.0), ("time_constant_error", 0.1)]),
    Deviation::by("tau +20 %", parameter_error::ID, &[("gain_error", 0.0), ("time_constant_error", 0.2)]),
    Deviation::by("tau +40 %", parameter_error::ID, &[("gain_error", 0.0), ("time_constant_error", 0.4)]),
    Deviation::supply("voltage -10 %", 0.9),
    Deviation::by(
        "resistive sag 10 %",
        supply_sag::ID,
        &[("polarization_drop", 0.0), ("polarization_s", 1.0), ("resistive_drop", 0.1), ("square_part", 0.0)],
    ),
    Deviation::by("delay 3 ms", transport_delay::ID, &[("delay_s", 0.003)]),
    Deviation::by("delay 10 ms", transport_delay::ID, &[("delay_s", 0.010)]),
    Deviation::by("delay 26 ms", transport_delay::ID, &[("delay_s", 0.026)]),
    Deviation::by("second pole 5 ms", second_pole::ID, &[("time_constant_s", 0.005)]),
];

/// What a compensator does on an actuator that differs: the worst and the best over the points of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Robustness {
    /// The lowest bandwidth.
    #[serde(rename = "lowest_rad_s")]
    pub lowest: Bandwidth,
    /// The highest bandwidth.
    #[serde(rename = "highest_rad_s")]
    pub highest: Bandwidth,
    /// The lowest frequency at which the response is 90 degrees late.
    #[serde(rename = "lowest_phase_rad_s")]
    pub lowest_phase_crossing: Bandwidth,
    /// The largest response over that at rest, dB.
    pub peak_db: f64,
    /// The largest overshoot of steps by 0.05 up and down, as a part of the step.
    pub overshoot: f64,
}

/// `design` on the actuator of `model` that differs by `deviation` beside the effects that it has, by sinusoids and steps through the
/// controller's own filter.
///
/// # Errors
/// [`PlantError`] when the actuator cannot be simulated.
pub fn robustness(
    model: &Model,
    design: &CompensatorDesign,
    deviation: &Deviation,
    esc_frame_hz: Option<f64>,
) -> Result<Robustness, PlantError> {
    let mut differing = model.clone();
    differing.effects.extend(deviation.effect.map(|(kind, parameters)| Effect {
        kind: kind.to_owned(),
        parameters: parameters.iter().map(|&(name, value)| (name.to_owned(), value)).collect(),
        std: [].into(),
    }));
    let mut found = Robustness {
        lowest: Bandwidth::Beyond(f64::INFINITY),
        highest: Bandwidth::At(0.0),
        lowest_phase_crossing: Bandwidth::Beyond(f64::INFINITY),
        peak_db: 0.0,
        overshoot: 0.0,
    };
    for point in &model.points {
        let sweep = Sweep {
            model: &differing,
            design,
            esc_frame_hz,
            nominal: point.nominal,
            amplitude: AMPLITUDE,
            time_constant_s: point.time_constant_s,
            supply: deviation.supply,
        };
        let limit_rad_s = (SEARCHED * design.natural_rad_s()).min(sweep.highest_rad_s());
        let swept = sweep.over_static(limit_rad_s)?;
        found.lowest = lower(found.lowest, swept.bandwidth.magnitude);
        found.lowest_phase_crossing = lower(found.lowest_phase_crossing, swept.bandwidth.phase);
        if swept.bandwidth.magnitude.reached_rad_s() > found.highest.reached_rad_s() {
            found.highest = swept.bandwidth.magnitude;
        }
        found.peak_db = found.peak_db.max(20.0 * swept.peak.log10());
    }
    // Beyond the points the inverse may be bypassed, and no lead is meant.
    let covered = |command: f64| design.lead_at(command).is_some();
    for step in steps_at(deviation.supply, &differing, design, esc_frame_hz, &[STEP])? {
        if covered(step.nominal) && covered(step.nominal + step.step) {
            found.overshoot = found.overshoot.max(step.compensated.overshoot);
        }
    }
    Ok(found)
}

fn lower(one: Bandwidth, other: Bandwidth) -> Bandwidth {
    if other.reached_rad_s() < one.reached_rad_s() { other } else { one }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::table_1;

    use super::super::{DesignOptions, InverseOptions, design, design_inverse};
    use super::*;

    fn robustness_to(design: &CompensatorDesign, name: &str) -> Robustness {
        let deviation = DEVIATIONS.iter().find(|deviation| deviation.name == name).unwrap();
        // Two points are as good as six, and a third of the time.
        let mut model = table_1();
        model.points = vec![model.points[0].clone(), model.points[5].clone()];
        robustness(&model, design, deviation, Some(600.0)).unwrap()
    }

    #[test]
    fn a_table_that_is_too_long_overshoots_and_one_that_is_too_short_is_slow() {
        let inverse = design_inverse(&table_1(), &InverseOptions::default()).unwrap().compensator.into();
        let (as_it_is, short, long) = (
            robustness_to(&inverse, "as the model"),
            robustness_to(&inverse, "tau -20 %"),
            robustness_to(&inverse, "tau +20 %"),
        );
        assert!(
            as_it_is.lowest.reached_rad_s() > 90.0 && as_it_is.peak_db < 0.3 && as_it_is.overshoot < 0.06,
            "{as_it_is:?}"
        );
        // About 4 % and 0.9 % for each percent.
        assert!((0.18..0.32).contains(&short.overshoot) && short.peak_db > 1.0, "{short:?}");
        assert!(
            long.lowest.reached_rad_s() < 0.85 * as_it_is.lowest.reached_rad_s() && long.overshoot < 0.05,
            "{long:?}"
        );
    }

    #[test]
    fn a_delay_changes_no_magnitude_and_costs_phase() {
        let inverse = design_inverse(&table_1(), &InverseOptions::default()).unwrap().compensator.into();
        let (as_it_is, late) = (robustness_to(&inverse, "as the model"), robustness_to(&inverse, "delay 10 ms"));
        assert!((late.lowest.reached_rad_s() / as_it_is.lowest.reached_rad_s() - 1.0).abs() < 0.01, "{late:?}");
        assert!(
            late.lowest_phase_crossing.reached_rad_s() < 0.7 * as_it_is.lowest_phase_crossing.reached_rad_s(),
            "{late:?}"
        );
        let lead = design(&table_1(), &DesignOptions::default()).unwrap().into();
        let lead = robustness_to(&lead, "as the model");
        assert!(lead.lowest.reached_rad_s() < 9.0 && lead.highest.reached_rad_s() > 90.0, "{lead:?}");
    }
}
