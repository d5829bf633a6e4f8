//! What to fly on a motor: nothing, the lead or an inverse, for a force around which no loop is closed and for a rate loop.
//!
//! Both are simulated with the default vehicle, its motors lags of the model's time constants and dead time and of one gain: what is
//! compared is what the lag costs. `docs/judgement.md` has the rules.

use num_complex::Complex64;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use rotorlead::design::LeadParameters;
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{
    Chain, CompensatorError, DesignOptions, InverseOptions, Latency, bandwidths, chain_phases, design, design_inverse,
};
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;
use rotorlead_plant::{CompensatorDesign, Model, Point};
use serde::Serialize;

use crate::airframe::{Actuators, Airframe, Hover};
use crate::benefit::{Benefit, Ratios};
use crate::lateral::RISE;
use crate::motor_control::{MotorControl, MotorControlKind};
use crate::response::PointResponse;
use crate::roll::{RollAxis, peak_deg};
use crate::rotor::Rotor;
use crate::study::{Performance, Refused, Row};
use crate::tuning::{TuningRule, tuned};
use crate::{TICK_HZ, VehicleError};

/// Thrust over command of every motor, newtons: about that of the default vehicle's. Derived: the mean of Table 1 is 11.9. Loops are tuned
/// to it, so that it only scales what noise does to the command.
const GAIN_N: f64 = 12.0;
/// Commands of a flight over that of hover, the lowest and the highest. Derived: the ends of the default vehicle's range over its hover,
/// 0.40 and 0.65 over 0.50.
const OF_HOVER: (f64, f64) = (0.8, 1.3);
/// From a gyro's sample to the ESC's new command, seconds. Chosen: the first of the default vehicle's, a period of 1 kHz and a frame of an
/// ESC; more favors a compensator.
const LATENCY_S: f64 = 0.002;
/// Commands that an ESC takes.
const COMMANDS: (f64, f64) = (0.0, 1.0);
/// The step of the command whose rise is compared: of the size that a controller asks for all the time. Chosen: the amplitude of the
/// paper's experiments; a larger one meets the limits sooner.
const STEP: f64 = 0.05;
/// How long a step is simulated, in time constants of the motor. Chosen: beyond the 2.3, `ln 10`, in which the bare motor rises to 90 %;
/// what is slower than it is not recommended.
const STEP_TIME_CONSTANTS: f64 = 4.0;
/// How long the vehicle is simulated after a gust, seconds: its angle is largest long before. Chosen: ten times the inverse of a bandwidth
/// of 10 rad/s; the peak comes within a few of these.
const GUST_S: f64 = 1.0;
/// One of so many ticks of a step is drawn. Chosen: a point every 2 ms, five to the rise of the fastest inverse, 11 ms; fewer show corners.
const DRAWN_EVERY: usize = 10;
/// From where to where a response is drawn, rad/s, and at how many points. Chosen: from a tenth of a slow motor's pole to beyond the
/// fastest inverse, at 50 points a decade; fewer show corners.
const DRAWN_RAD_S: (f64, f64) = (1.0, 1000.0);
const DRAWN_POINTS: usize = 150;
/// A force that rises in more than this part of the time of the bare motor is not worth a compensator. Chosen: what noise and peaks cost
/// has to gain a fifth; the lead of `docs/vehicle.md` takes 0.60, its inverses 0.10 and less.
const WORTH_RISING: f64 = 0.8;

/// What to fly, by purpose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recommendation {
    /// For forces around which no loop is closed: tilted rotors, tethers, contact.
    pub force: Choice,
    /// For the rate loop of a multirotor.
    pub rate_loop: Choice,
    /// What was compared, the bare motor first.
    #[serde(skip)]
    pub candidates: Vec<Candidate>,
    /// Compensators that cannot be designed from the model, and why.
    pub refused: Vec<Refused>,
}

/// One of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// What to put before the ESC.
    #[serde(flatten)]
    pub actuator: MotorControlKind,
    /// What it gains, or why there is nothing.
    pub why: String,
}

/// For what a motor is to be faster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A force around which no loop is closed.
    Force,
    /// The rate loop of a multirotor.
    RateLoop,
}

impl Purpose {
    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Force => Self::RateLoop,
            Self::RateLoop => Self::Force,
        }
    }

    /// What it is called in a sentence.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Force => "a force",
            Self::RateLoop => "a rate loop",
        }
    }
}

/// An actuator with what it gains and what it costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Which one.
    pub actuator: MotorControlKind,
    /// Bandwidth to -3 dB, the lowest of the operating points; `None` where it is beyond what is searched.
    pub bandwidth_rad_s: Option<f64>,
    /// Where the whole chain lags 90 degrees, the lowest of the operating points.
    pub minus_90_rad_s: Option<f64>,
    /// Rise of a step of 5 % of the command, the slowest of up and down over the range, seconds; `None` where it does not get there.
    pub rise_s: Option<f64>,
    /// Whether such a step meets a limit of the command.
    pub is_limited: bool,
    /// The rate loop, tuned for the range of hover commands.
    pub rate_loop: Row,
    /// Whether dead time takes what is gained from any loop around it, at every operating point.
    pub is_dead_time_limited: bool,
    /// Largest gain on the noise of the command, at 15, 30 or 50 Hz.
    pub noise_gain: f64,
    /// Largest command over the step that asks for it.
    pub step_peak: f64,
    /// The step up at hover, for figures: time in seconds, and how much of it there is.
    pub step: Vec<(f64, f64)>,
    /// Motor and compensator at hover over the static gain, without the pulses' delays, for figures: frequency in rad/s, and response.
    pub response: Vec<(f64, Complex64)>,
}

impl Recommendation {
    /// The choice for a purpose.
    #[must_use]
    pub fn choice(&self, purpose: Purpose) -> &Choice {
        match purpose {
            Purpose::Force => &self.force,
            Purpose::RateLoop => &self.rate_loop,
        }
    }
}

/// What is asked of every compensator that is compared; the default of its kind where nothing is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// Damping ratio of the poles.
    pub damping: Option<f64>,
    /// Most by which the ESC changes its output per second.
    pub slew_per_s: Option<f64>,
    /// Natural frequency of the one inverse that is compared, in place of the usual ones.
    pub natural_rad_s: Option<f64>,
}

/// What to fly on the motor of `model`: nothing where there is a `doubt`.
///
/// # Errors
/// When the model cannot be simulated.
pub fn recommend(model: &Model, doubt: Option<&str>, asked: &Asked) -> Result<Recommendation, VehicleError> {
    let first = model.points.first().map_or(0.0, |point| point.gain);
    let of_other_sign = |point: &&Point| first * point.gain <= 0.0;
    if let Some(&Point { nominal, gain, .. }) = model.points.iter().find(of_other_sign) {
        return Err(VehicleError::FallingThrust { nominal, gain });
    }
    let alike = |point: &Point| Point { gain: GAIN_N, gain_std: None, ..point.clone() };
    let points: Vec<Point> = model.points.iter().map(alike).collect();
    let lags = Model { points, static_map: None, effects: Vec::new(), ..model.clone() };
    let case = MotorInVehicle { airframe: airframe(&lags), rotor: Rotor::new(&lags)?, model: &lags };
    let usual = || Actuators::default().inverse_rad_s.to_vec();
    let inverses = asked.natural_rad_s.map_or_else(usual, |natural| vec![natural]).into_iter();
    let inverses = inverses.map(|omega_f_rad_s| MotorControlKind::Inverse { omega_f_rad_s });
    let (mut designed, mut refused) = (vec![(MotorControlKind::None, None)], Vec::new());
    for kind in std::iter::once(MotorControlKind::Lead).chain(inverses) {
        match case.designed(kind, asked) {
            Ok(design) => designed.push((kind, design)),
            Err(error) => refused.push(Refused { actuator: kind, reason: error.to_string() }),
        }
    }
    let candidate = |(kind, design): (MotorControlKind, Option<CompensatorDesign>)| case.candidate(kind, design);
    let candidates: Vec<Candidate> = designed.into_par_iter().map(candidate).collect();
    let (force, rate_loop) = match doubt {
        Some(why) => {
            let none = Choice { actuator: MotorControlKind::None, why: why.to_owned() };
            (none.clone(), none)
        }
        None => (choose_for_force(&candidates), choose_for_rate_loop(&candidates)),
    };
    Ok(Recommendation { force, rate_loop, candidates, refused })
}

/// What a design is asked for; `None` for what is not designed.
#[must_use]
pub fn design_options(kind: MotorControlKind, asked: &Asked) -> Option<KindOptions> {
    let Asked { damping, slew_per_s, .. } = *asked;
    match kind {
        MotorControlKind::None | MotorControlKind::SpeedFeedback { .. } => None,
        MotorControlKind::Lead => {
            let default = DesignOptions::default();
            let damping = damping.unwrap_or(default.damping);
            Some(KindOptions::Lead(DesignOptions { damping, slew_per_s, ..default }))
        }
        MotorControlKind::Inverse { omega_f_rad_s } => {
            let default = InverseOptions::default();
            Some(KindOptions::Inverse(InverseOptions {
                omega_f_rad_s: Some(omega_f_rad_s),
                damping: damping.unwrap_or(default.damping),
                slew_per_s,
                ..default
            }))
        }
    }
}

/// The default vehicle, which hovers in the middle of the model's commands.
fn airframe(model: &Model) -> Airframe {
    let commands = || model.points.iter().map(|point| point.nominal);
    let (first, last) = (commands().fold(f64::INFINITY, f64::min), commands().fold(0.0, f64::max));
    let command = 0.5 * (first + last);
    let range = [(OF_HOVER.0 * command).max(first), (OF_HOVER.1 * command).min(last)];
    Airframe { hover: Hover { command, range }, ..Airframe::default() }
}

/// A motor in the vehicle.
struct MotorInVehicle<'a> {
    airframe: Airframe,
    rotor: Rotor,
    model: &'a Model,
}

impl MotorInVehicle<'_> {
    /// What `rotorlead design` makes of the model.
    fn designed(&self, kind: MotorControlKind, asked: &Asked) -> Result<Option<CompensatorDesign>, CompensatorError> {
        Ok(match design_options(kind, asked) {
            None => None,
            Some(KindOptions::Lead(options)) => Some(design(self.model, &options)?.into()),
            Some(KindOptions::Inverse(options)) => Some(design_inverse(self.model, &options)?.compensator.into()),
        })
    }

    fn candidate(&self, kind: MotorControlKind, design: Option<CompensatorDesign>) -> Candidate {
        let (bandwidth_rad_s, minus_90_rad_s, is_dead_time_limited) = self.chain_limits(design.as_ref());
        let noise_gain = design
            .as_ref()
            .map_or(1.0, |design| design.command_noise_gain().into_iter().map(|at| at.gain).fold(0.0, f64::max));
        let step_peak = design.as_ref().map_or(1.0, CompensatorDesign::step_peak);
        let within = |range: (f64, f64)| match &design {
            None => MotorControl::bare(range),
            Some(design) => MotorControl::compensated(kind, design.clone(), range),
        };
        let actuator = within((self.airframe.actuators.min, self.airframe.actuators.max));
        // As it is designed: a force may take the whole range of the command.
        let unbounded = within(COMMANDS);
        let steps = self.nominals().map(|nominal| [STEP, -STEP].map(|step| self.step(&unbounded, nominal, step)));
        let slower = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a.max(b));
        let all = || steps.iter().flatten();
        Candidate {
            actuator: kind,
            bandwidth_rad_s,
            minus_90_rad_s,
            rise_s: all().map(|step| step.rise_s).reduce(slower).flatten(),
            is_limited: all().any(|step| step.is_limited),
            rate_loop: self.rate_loop(&actuator),
            is_dead_time_limited,
            noise_gain,
            step_peak,
            response: self.response(&actuator),
            step: steps[1][0].drawn.clone(),
        }
    }

    /// Motor and compensator at hover.
    fn response(&self, actuator: &MotorControl) -> Vec<(f64, Complex64)> {
        let hover = self.airframe.hover.command;
        let at = |index: usize| {
            let (low, high) = DRAWN_RAD_S;
            let omega = low * (high / low).powf(index as f64 / (DRAWN_POINTS - 1) as f64);
            let lag = Complex64::new(1.0, omega / self.rotor.pole_rad_s(hover)).inv();
            let late = Complex64::cis(-omega * self.rotor.delay_s(hover));
            (omega, actuator.response(omega, hover, &self.rotor) * lag * late)
        };
        (0..DRAWN_POINTS).map(at).collect()
    }

    /// The lowest bandwidth of the operating points, the lowest frequency at which the chain lags 90 degrees, and whether dead time
    /// takes what is gained at every point: with `design`, or without one.
    fn chain_limits(&self, design: Option<&CompensatorDesign>) -> (Option<f64>, Option<f64>, bool) {
        // Where none is designed any lead will do: it is left out.
        let left_out = LeadParameters { omega_z_rad_s: 1.0, omega_f_rad_s: 1.0, damping: 1.0 };
        let chain = design.map_or(Chain::Continuous(&left_out), Chain::Designed);
        let points = bandwidths(self.model, chain);
        let phases = chain_phases(self.model, &[], chain, &Latency::standard(TICK_HZ), &points);
        let lowest = points.iter().zip(&phases).map(|(point, phase)| match design {
            Some(_) => (point.compensated, phase.compensated.minus_90),
            None => (point.uncompensated, phase.uncompensated.minus_90),
        });
        let least = |a: Option<f64>, b: Bandwidth| a.into_iter().chain(b.rad_s()).reduce(f64::min);
        let (bandwidth, minus_90) =
            lowest.fold((None, None), |least_of, here| (least(least_of.0, here.0), least(least_of.1, here.1)));
        let is_dead_time_limited =
            design.is_some() && points.iter().zip(&phases).all(|(point, phase)| phase.is_dead_time_limited(point));
        (bandwidth, minus_90, is_dead_time_limited)
    }

    /// The lowest command of the range, that of hover, and the highest.
    fn nominals(&self) -> [f64; 3] {
        let [low, high] = self.airframe.hover.range;
        [low, self.airframe.hover.command, high]
    }

    /// A step of the command from `nominal`.
    fn step(&self, actuator: &MotorControl, nominal: f64, step: f64) -> Step {
        let (low, high) = COMMANDS;
        let ticks = (STEP_TIME_CONSTANTS / self.rotor.pole_rad_s(nominal) * TICK_HZ).ceil() as usize;
        let mut running = actuator.started(nominal);
        let mut v = nominal;
        let mut is_limited = false;
        let mut reached = [None; 2];
        let mut drawn = vec![(0.0, 0.0)];
        for tick in 0..ticks {
            let command = running.update(nominal + step, v);
            is_limited |= command <= low || command >= high;
            v = self.rotor.advanced(v, command, 1.0 / TICK_HZ);
            if tick % DRAWN_EVERY == 0 {
                let late_s = self.rotor.delay_s(nominal);
                drawn.push(((tick + 1) as f64 / TICK_HZ + late_s, (v - nominal) / step));
            }
            for (when, part) in reached.iter_mut().zip([RISE.0, RISE.1]) {
                if (v - nominal) / step >= part {
                    when.get_or_insert(tick);
                }
            }
        }
        let [from, to] = reached;
        Step { rise_s: from.zip(to).map(|(from, to)| (to - from) as f64 / TICK_HZ), is_limited, drawn }
    }

    /// The rate loop, with one gain set for the range of hover commands.
    fn rate_loop(&self, actuator: &MotorControl) -> Row {
        let (airframe, rotor) = (&self.airframe, &self.rotor);
        let nominals = self.nominals();
        let points = nominals.map(|nominal| PointResponse::new(airframe, rotor, actuator, nominal, LATENCY_S));
        let gains = tuned(&points, airframe.controller.integral_time_s, true, &TuningRule::default());
        let of = |gains| {
            let each = nominals.into_iter().zip(&points).map(|(nominal, point)| {
                let axis = RollAxis { airframe, rotor, actuator, nominal, latency_s: LATENCY_S, gains };
                Performance {
                    gains,
                    margins: point.margins(gains.rate()),
                    disturbance_peak_deg: peak_deg(&axis.disturbed(GUST_S)),
                    settling_s: None,
                    disturbed: Vec::new(),
                    open: None,
                }
            });
            each.reduce(Performance::worse)
        };
        Row { actuator: actuator.kind, performance: gains.and_then(of) }
    }
}

/// How a step ends.
struct Step {
    rise_s: Option<f64>,
    is_limited: bool,
    drawn: Vec<(f64, f64)>,
}

/// What lets a force rise soonest without a step that meets a limit anywhere in the range.
fn choose_for_force(candidates: &[Candidate]) -> Choice {
    let none = |why: String| Choice { actuator: MotorControlKind::None, why };
    let Some(bare_s) = candidates.first().and_then(|bare| bare.rise_s) else {
        return none("a step of the bare motor does not rise within its range of commands".to_owned());
    };
    let fast = candidates[1..].iter().filter_map(|one| Some((one, one.rise_s?)));
    let worth = fast.filter(|(one, rise_s)| !one.is_limited && *rise_s < WORTH_RISING * bare_s);
    match worth.min_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((best, rise_s)) => Choice {
            actuator: best.actuator,
            why: format!(
                "a step of {:.0} % rises in {:.0} ms instead of {:.0}",
                100.0 * STEP,
                1e3 * rise_s,
                1e3 * bare_s
            ),
        },
        None => none(format!(
            "no step of {:.0} % rises much sooner than in {:.0} ms without meeting a limit",
            100.0 * STEP,
            1e3 * bare_s
        )),
    }
}

/// What is better than none by the rule of `rotorlead vehicle`, and has the highest bandwidth.
fn choose_for_rate_loop(candidates: &[Candidate]) -> Choice {
    let Some((bare, others)) = candidates.split_first() else { unreachable!("the bare motor is compared in any case") };
    let better = || others.iter().filter(|one| one.rate_loop.benefit(&bare.rate_loop) == Some(Benefit::Better));
    let kept = better().filter(|one| !one.is_dead_time_limited).map(|one| &one.rate_loop);
    let bandwidth = |row: &&Row| row.performance.as_ref().map_or(0.0, |found| found.margins.bandwidth_rad_s);
    match kept.max_by(|a, b| bandwidth(a).total_cmp(&bandwidth(b))) {
        Some(best) => Choice {
            actuator: best.actuator,
            why: match best.ratios(&bare.rate_loop) {
                Some(Ratios { bandwidth, disturbance_peak, .. }) => format!(
                    "tuned again it has x{bandwidth:.1} the bandwidth, and a gust turns the vehicle x{disturbance_peak:.1} as far"
                ),
                None => "there are gains that keep the margins, where the bare motor has none".to_owned(),
            },
        },
        None => Choice {
            actuator: MotorControlKind::None,
            why: match better().next() {
                Some(lost) => format!(
                    "{} makes the simulated loop better, but where it has its bandwidth dead time alone lags more than a radian at every operating \
                     point, so that all of it rests on a dead time that stays as it is: shorten it first",
                    lost.actuator.name()
                ),
                None => "tuned again, none is better in bandwidth or against gusts without being worse in the other"
                    .to_owned(),
            },
        },
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::{model, table_1};

    use super::*;

    #[test]
    fn the_papers_motor_flies_with_an_inverse() {
        let found = recommend(&table_1(), None, &Asked::default()).unwrap();
        assert_eq!(found.candidates.len() + found.refused.len(), 5);
        // The faster ones take the command to its limit at a step of 5 %.
        assert_eq!(found.force.actuator, MotorControlKind::Inverse { omega_f_rad_s: 94.0 });
        assert!(found.candidates[3].is_limited && !found.candidates[2].is_limited);
        assert_eq!(found.rate_loop.actuator, MotorControlKind::Inverse { omega_f_rad_s: 200.0 });
        // What the README says of them.
        let costs = |one: &Candidate| (one.noise_gain.round(), one.step_peak.round());
        assert_eq!((costs(&found.candidates[2]), costs(&found.candidates[4])), ((10.0, 7.0), (22.0, 15.0)));
        let bandwidths = [0, 1, 2].map(|index| found.candidates[index].bandwidth_rad_s.unwrap().round());
        assert_eq!(bandwidths, [6.0, 8.0, 92.0]);
        let rise_s = |index: usize| found.candidates[index].rise_s.unwrap();
        assert!(rise_s(2) < 0.1 * rise_s(0) && rise_s(2) < 0.025, "{} s", rise_s(2));
        let bare = &found.candidates[0];
        let slowest = 0.8 * 0.5 * (0.4 + 0.65);
        let tau_s = 1.0 / Rotor::new(&table_1()).unwrap().pole_rad_s(slowest);
        assert!((bare.rise_s.unwrap() / (tau_s * 9.0_f64.ln()) - 1.0).abs() < 0.15, "{:?}", bare.rise_s);
    }

    #[test]
    fn nothing_is_flown_on_what_is_no_lag() {
        let found = recommend(&table_1(), Some("it is none"), &Asked::default()).unwrap();
        assert_eq!((found.force.actuator, found.rate_loop.actuator), (MotorControlKind::None, MotorControlKind::None));
    }

    #[test]
    fn the_loop_around_a_motor_that_is_fast_needs_nothing() {
        let fast = model(&[(0.3, 8.0, 0.004, 0.0), (0.6, 8.0, 0.004, 0.0)]);
        let found = recommend(&fast, None, &Asked::default()).unwrap();
        assert_eq!(found.rate_loop.actuator, MotorControlKind::None, "{:?}", found.rate_loop);
        assert_eq!(found.refused.len(), 3, "no inverse makes it slower");
    }
}
