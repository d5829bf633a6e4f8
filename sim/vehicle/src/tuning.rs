//! The tuning rule: the same margins for each actuator.

use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};
use serde::Serialize;

use crate::filters::PidGains;
use crate::response::{PointResponse, UnitLoop};

/// What every gain set has to keep at each of its operating points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TuningRule {
    /// Largest sensitivity of the rate loop. Chosen: 1.6 alone keeps a gain margin of 2.7 and a phase margin of 36 degrees (`2 asin(1 /
    /// 3.2)`), in the usual range of 1.25 to 2 (Astrom & Murray, Feedback Systems, 2008, section 9.3); lower is slower, higher rings.
    pub max_sensitivity: f64,
    /// Phase margin of the rate loop, degrees. Chosen: the middle of the usual 30 to 60 (the same section); lower rings, higher is slower.
    pub phase_margin_deg: f64,
    /// Largest sensitivity of the attitude loop. Chosen: it alone keeps a phase margin of 42 degrees, `2 asin(1 / 2.8)`, more than the rate
    /// loop within it; higher overshoots a step of the angle.
    pub attitude_max_sensitivity: f64,
    /// Standard deviation of the ESC's command from the gyro's noise. Chosen: two fifths of a usual step of 0.05; where it binds, half or
    /// twice as much noise turns the comparison around (`docs/vehicle.md`).
    pub actuator_noise: f64,
}

impl Default for TuningRule {
    fn default() -> Self {
        Self { max_sensitivity: 1.6, phase_margin_deg: 45.0, attitude_max_sensitivity: 1.4, actuator_noise: 0.02 }
    }
}

/// A gain set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gains {
    /// Proportional gain of the rate loop, 1/s: angular acceleration per rate error.
    pub rate_p_1_s: f64,
    /// Integral time, seconds.
    pub integral_time_s: f64,
    /// Derivative time, seconds.
    pub derivative_time_s: f64,
    /// Gain of the attitude loop, 1/s: rate setpoint per angle error.
    pub attitude_p_1_s: f64,
}

impl Gains {
    /// Those of the rate loop.
    #[must_use]
    pub fn rate(&self) -> PidGains {
        PidGains {
            p_1_s: self.rate_p_1_s,
            integral_time_s: self.integral_time_s,
            derivative_time_s: self.derivative_time_s,
        }
    }
}

/// Gains are searched from here downward, 1/s. Chosen: a loop whose lag is canceled crosses over at as many rad/s, where half a period of 1
/// kHz lags a radian; higher only takes time.
const HIGHEST_GAIN_1_S: f64 = 2000.0;
/// To here. Chosen: a loop that slow takes seconds for a turn, and nothing flies by it; lower only takes time.
const LOWEST_GAIN_1_S: f64 = 1.0;
/// From one gain that is tried to the next. Chosen: 194 steps over the range, `ln 2000 / ln 1.04`; wider ones may pass over a narrow band
/// of gains that keep the rule.
const GAIN_STEP: f64 = 1.04;
/// Derivative times of the first search beside 0: from here, seconds. Chosen: a fifth of the time constant of a D low-pass at 60 Hz, 2.7
/// ms; a shorter one adds hardly any phase.
const SHORTEST_DERIVATIVE_S: f64 = 5e-4;
/// To here. Chosen: longer than the lag of a slow rotor, 0.16 s in Table 1, which a D term cancels at about its own time; longer ones only
/// pass more noise.
const LONGEST_DERIVATIVE_S: f64 = 0.3;
/// How many. Chosen: they are a factor of 1.18 apart, `600^(1 / 39)`, within the peak of the gain over them; more only take time.
const DERIVATIVE_TIMES: usize = 40;
/// Rounds of the search between the neighbors of the best one, and times per round. Derived: a round takes steps of a tenth of the way from
/// one neighbor to the other, 0.7 % of the time after two rounds.
const REFINEMENTS: (usize, usize) = (2, 9);
/// Halvings of a bracket. Derived: 6e-7 of the gain is left of a step of 4 %, `0.04 / 2^16`.
const HALVINGS: usize = 16;

/// The gain set with the largest integral gain, `p / Ti`, that keeps `rule` at all of `points`, and then the largest attitude gain;
/// `None` where none keeps it. The integral time is given. A slow disturbance leaves an integrated error in proportion to the
/// inverse of the integral gain.
#[must_use]
pub fn tuned(points: &[PointResponse], integral_time_s: f64, has_d: bool, rule: &TuningRule) -> Option<Gains> {
    let largest = |derivative_s: &f64| largest_gain(points, integral_time_s, *derivative_s, rule);
    let mut times: Vec<f64> = vec![0.0];
    if has_d {
        let ratio = LONGEST_DERIVATIVE_S / SHORTEST_DERIVATIVE_S;
        let part = |index: usize| index as f64 / (DERIVATIVE_TIMES - 1) as f64;
        times.extend((0..DERIVATIVE_TIMES).map(|index| SHORTEST_DERIVATIVE_S * ratio.powf(part(index))));
    }
    let (mut best, mut gain) = best_derivative_time(&times, largest)?;
    for _ in 0..if has_d { REFINEMENTS.0 } else { 0 } {
        let index = times.iter().position(|time| *time == best)?;
        let (low, high) = (times[index.saturating_sub(1)], times[(index + 1).min(times.len() - 1)]);
        let steps = REFINEMENTS.1 as f64 + 1.0;
        let mut finer: Vec<f64> =
            (0..=REFINEMENTS.1 + 1).map(|step| low + (high - low) * step as f64 / steps).collect();
        finer.push(best);
        finer.sort_by(f64::total_cmp);
        (best, gain) = best_derivative_time(&finer, largest)?;
        times = finer;
    }
    let loops: Vec<UnitLoop<'_>> = points.iter().map(|point| point.with_times(integral_time_s, best)).collect();
    let keeps = |attitude_1_s: f64| {
        loops.iter().all(|one| one.attitude_sensitivity(gain, attitude_1_s) <= rule.attitude_max_sensitivity)
    };
    // From below: a loop of too high a gain may have a small sensitivity again. Chosen: a tenth of the lowest rate gain, as an outer loop
    // is several times slower.
    let mut low = LOWEST_GAIN_1_S / 10.0;
    if !keeps(low) {
        return None;
    }
    while low < HIGHEST_GAIN_1_S && keeps(low * GAIN_STEP) {
        low *= GAIN_STEP;
    }
    Some(Gains {
        rate_p_1_s: gain,
        integral_time_s,
        derivative_time_s: best,
        attitude_p_1_s: bisected(low, low * GAIN_STEP, keeps),
    })
}

/// The derivative time with the largest gain, the shortest of several, and that gain.
fn best_derivative_time(times: &[f64], gain: impl Fn(&f64) -> Option<f64> + Sync) -> Option<(f64, f64)> {
    let gains: Vec<Option<f64>> = times.par_iter().with_min_len(2).map(&gain).collect();
    let known = times.iter().zip(gains).filter_map(|(time, gain)| Some((*time, gain?)));
    known.reduce(|best, here| if here.1 > best.1 { here } else { best })
}

/// The largest proportional gain that keeps the rule at all points.
fn largest_gain(points: &[PointResponse], integral_s: f64, derivative_s: f64, rule: &TuningRule) -> Option<f64> {
    let loops: Vec<UnitLoop<'_>> = points.iter().map(|point| point.with_times(integral_s, derivative_s)).collect();
    let keeps = |gain: f64| {
        let one =
            |one: &UnitLoop<'_>| one.keeps(gain, rule.max_sensitivity, rule.phase_margin_deg, rule.actuator_noise);
        loops.iter().all(one)
    };
    let mut gain = HIGHEST_GAIN_1_S;
    while !keeps(gain) {
        gain /= GAIN_STEP;
        if gain < LOWEST_GAIN_1_S {
            return None;
        }
    }
    Some(bisected(gain, gain * GAIN_STEP, keeps))
}

/// The largest value that keeps something, between `low`, which does, and `high`.
fn bisected(mut low: f64, mut high: f64, keeps: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if keeps(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::table_1;

    use super::*;
    use crate::airframe::Airframe;
    use crate::motor_control::{MotorControl, MotorControlKind, designed};
    use crate::rotor::Rotor;

    fn points(kind: MotorControlKind, nominals: &[f64]) -> Vec<PointResponse> {
        let (airframe, rotor) = (Airframe::default(), Rotor::new(&table_1()).unwrap());
        let all = designed(&airframe, &table_1(), &rotor).unwrap();
        let actuator: MotorControl = all.into_iter().map(Result::unwrap).find(|one| one.kind == kind).unwrap();
        nominals.iter().map(|&nominal| PointResponse::new(&airframe, &rotor, &actuator, nominal, 0.002)).collect()
    }

    #[test]
    fn the_gains_keep_the_rule_and_a_few_percent_more_do_not() {
        let rule = TuningRule::default();
        for kind in [MotorControlKind::None, MotorControlKind::Lead, MotorControlKind::Inverse { omega_f_rad_s: 150.0 }]
        {
            let points = points(kind, &[0.4, 0.5, 0.65]);
            let gains = tuned(&points, 0.3, true, &rule).unwrap();
            let worst = |factor: f64| {
                let scaled = PidGains { p_1_s: factor * gains.rate_p_1_s, ..gains.rate() };
                let kept = points.iter().map(|point| point.margins(scaled)).all(|margins| {
                    margins.max_sensitivity <= rule.max_sensitivity
                        && margins.phase_margin_deg >= rule.phase_margin_deg
                        && margins.actuator_noise <= rule.actuator_noise
                });
                let one = |point: &PointResponse| {
                    let unit = point.with_times(gains.integral_time_s, gains.derivative_time_s);
                    unit.attitude_sensitivity(gains.rate_p_1_s, factor * gains.attitude_p_1_s)
                };
                (kept, points.iter().map(one).fold(0.0, f64::max) <= rule.attitude_max_sensitivity)
            };
            assert_eq!(worst(0.999), (true, true), "{kind:?}: {gains:?}");
            assert_eq!(worst(1.02), (false, false), "{kind:?}: {gains:?}");
        }
    }

    /// PI on an integrator with a slow lag: at a phase margin of 45 degrees it needs `atan(w Ti) - atan(w tau) >= 45`, which no
    /// frequency has for an integral time of 0.3 s and the rotor's 0.108 s.
    #[test]
    fn without_a_d_term_the_bare_motor_has_no_gain_set() {
        let rule = TuningRule::default();
        assert_eq!(tuned(&points(MotorControlKind::None, &[0.5]), 0.3, false, &rule), None);
        // Of ten times the integral time there is one: at most atan(w Ti) - atan(w tau) = 70 degrees.
        let gains = tuned(&points(MotorControlKind::None, &[0.5]), 3.0, false, &rule).unwrap();
        assert_eq!(gains.derivative_time_s, 0.0);
        assert!(tuned(&points(MotorControlKind::Lead, &[0.5]), 0.3, false, &rule).is_some());
    }

    #[test]
    fn a_lower_limit_of_the_noise_takes_gain() {
        let points = points(MotorControlKind::None, &[0.5]);
        let gain = |actuator_noise: f64| {
            let rule = TuningRule { actuator_noise, ..TuningRule::default() };
            tuned(&points, 0.3, true, &rule).map(|gains| gains.rate_p_1_s)
        };
        assert!(gain(0.01) < gain(0.02) && gain(0.02) < gain(0.04), "{:?}", [0.01, 0.02, 0.04].map(gain));
    }
}
