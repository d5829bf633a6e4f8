//! The time constant of motors from a flight, in closed loop.
//!
//! In units of the command, `tau(w) dw/dt = v(t - delay) - w`, `y = F(w) + vehicle + noise`: `v` is the command times the slow part of the
//! supply, `ln tau` a parabola in `ln w`, `F` the static map, `vehicle` what the thrust of all motors does to the speed by way of the
//! vehicle and its battery, and `noise` an autoregression whose order has the highest likelihood of samples that it was not fitted to. Any
//! motor `dy/dt = a v - h(y)` is of this kind, with `w = h(y) / a` and `tau = 1 / h'(y)`.
//!
//! All of it is fitted together by the prediction error, motor by motor. The command is known as the ESC got it, so that the fit is consistent
//! in a closed loop where the noise model is rich enough (Ljung, *System Identification*, 2nd ed., chapter 13), and where nothing moves
//! command and noise alike. Gusts do: an estimate by instruments ([`InstrumentalEstimate`]) stands next to the fit, and refuses it where the
//! two differ ([`error::FlightError::Biased`]).
//!
//! The standard errors hold what the noise does, what two halves of the flight differ by, what the motors of the vehicle differ by, and what
//! the model's structure costs, which is known from simulated flights alone. Assumed are a first-order lag, a dead time that does
//! not change, and a log that repeats no report unseen.

pub mod error;
mod fit;
mod instrument;
mod motor;
mod noise;
mod response;
mod series;
mod telemetry;
mod thin;
mod vehicle;

pub use instrument::InstrumentalEstimate;
pub use motor::MotorEstimate;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_numerics::sample::{mean, median};
use rotorlead_plant::{Lag, Point, TimeConstantBand};
use rotorlead_records::{Excitation, Experiment, Record, Role};

use crate::error::IdentifyError;
use crate::estimate::Estimate;
use error::FlightError;
use motor::Motor;
use series::BENDS;

/// What the model's structure costs the logarithm of a time constant. Tuned: on 60 simulated flights (`examples/flights.rs`, seeds 1000 to
/// 1059; the first motor alone, 1000 to 1039) the errors of the fit have the size of this; gusts, the inflow and a telemetry that rounds are
/// not the autoregression that the fit takes them for.
const STRUCTURE: Structure = Structure { noise: 3.0, least: 0.01, least_alone: 0.025, slope: 0.08 };
/// Relative standard error of a time constant above which a flight is refused. Chosen: that of the judgement for a lag that is known well
/// enough.
pub const LARGEST_STD: f64 = 0.1;
/// Intervals of the curve. Chosen: a parabola in logarithms shows no corners on them.
const CURVE_POINTS: usize = 20;
/// Standard errors by which the estimate by instruments may differ. Chosen: 3, as 1 of 400 honest flights is refused by it.
const LARGEST_DIFFERENCE: f64 = 3.0;

struct Structure {
    /// Its standard error over that of the noise alone.
    noise: f64,
    /// The least one, at the median of the command.
    least: f64,
    /// The same of a motor without the others of its vehicle, whose thrust moves the air that it turns in.
    least_alone: f64,
    /// That for each e-fold of the command from there.
    slope: f64,
}

/// The lag of the motors of a vehicle.
#[derive(Clone, Debug)]
pub struct FlightIdentification {
    /// Each motor by itself, in the order of the records.
    pub motors: Vec<MotorEstimate>,
    /// The lag at one level or three, the mean of the motors: the median of the command, and the ends of what all motors flew.
    pub points: Vec<Point>,
    /// The time constant between them, with its 95 % interval; `None` where there is one level.
    pub curve: Option<TimeConstantBand>,
}

/// Whether a record is of a flight that may be fitted.
pub(crate) fn is_flight_to_fit(record: &Record) -> bool {
    record.excitation == Excitation::Flight && record.role != Some(Role::Validate)
}

/// Estimates the lag of the motors of a vehicle from all records of `excitation = "flight"` that may be fitted, one for each motor.
///
/// # Errors
/// [`IdentifyError::NoResponse`] without the experiment's output, and [`FlightError`] where little of the flight can be used, the search finds
/// no lag, the command moved too little, or what moves command and noise alike has moved the estimate.
pub fn identify_flights(experiment: &Experiment) -> Result<FlightIdentification, IdentifyError> {
    let thinned = thin::thinned(experiment);
    let experiment = thinned.as_ref().unwrap_or(experiment);
    let records: Vec<&Record> = experiment.records.iter().filter(|record| is_flight_to_fit(record)).collect();
    let fits: Vec<_> = records.par_iter().map(|record| Motor::fit(experiment, record)).collect();
    // The error is that of the first faulty record, whichever is found first.
    let motors: Vec<Motor> = fits.into_iter().collect::<Result<_, IdentifyError>>()?;
    let points: Vec<Point> = levels(&motors).into_iter().map(|level| point(&motors, level)).collect();
    let found = FlightIdentification {
        curve: curve(&motors, &points),
        motors: motors.iter().map(|motor| motor.estimate.clone()).collect(),
        points,
    };
    found.check(experiment)?;
    Ok(found)
}

/// Levels at which the lag is said.
fn levels(motors: &[Motor]) -> Vec<f64> {
    // To a thousandth, which a reader can take in.
    let rounded = |level: f64| (1e3 * level).round() / 1e3;
    let center = median(motors.iter().map(|motor| motor.estimate.nominal)).unwrap_or(0.0);
    let low = motors.iter().map(|motor| motor.series.range.0).fold(0.0, f64::max);
    let high = motors.iter().map(|motor| motor.series.range.1).fold(f64::INFINITY, f64::min);
    match high - low > BENDS[0] * center && low < center && center < high {
        true => [low, center, high].map(rounded).to_vec(),
        false => vec![rounded(center)],
    }
}

/// The least standard error at the median of the command, of the mean of so many motors.
fn least_std(motors: usize) -> f64 {
    if motors > 1 { STRUCTURE.least } else { STRUCTURE.least_alone }
}

/// The mean of the motors at a level, with what they differ by.
fn point(motors: &[Motor], level: f64) -> Point {
    let count = motors.len() as f64;
    let center = median(motors.iter().map(|motor| motor.estimate.nominal)).unwrap_or(level);
    let lags: Vec<(f64, f64)> = motors.iter().map(|motor| motor.log_time_constant(level)).collect();
    let gains: Vec<(f64, f64)> = motors.iter().map(|motor| motor.gain(level)).collect();
    let delays: Vec<f64> = motors.iter().map(|motor| motor.estimate.delay_s).collect();
    let logs: Vec<f64> = lags.iter().map(|(log, _)| *log).collect();
    let time_constant_s = mean(&logs).exp();
    let halves = motors.iter().map(|motor| motor.estimate.halves_difference.powi(2)).sum::<f64>() / (4.0 * count);
    let noise = lags.iter().map(|(_, std)| std * std).sum::<f64>() / count;
    // The structure is the same for all motors of a vehicle, so that their number does not help.
    let slope = STRUCTURE.slope * (level / center).ln();
    let structure = least_std(motors.len()).powi(2) + slope.powi(2);
    let variance = (STRUCTURE.noise.powi(2) * noise).max(halves) + structure + scatter(&logs);
    let values: Vec<f64> = gains.iter().map(|(gain, _)| *gain).collect();
    let gain_variance = gains.iter().map(|(_, std)| std * std).sum::<f64>() / count * STRUCTURE.noise.powi(2);
    let delay_s = mean(&delays);
    let age_s = motors.iter().map(|motor| motor.report_age_std_s()).fold(0.0, f64::max);
    Point {
        time_constant_s_std: Some(time_constant_s * variance.sqrt()),
        gain_std: Some((gain_variance + scatter(&values)).sqrt()),
        delay_s_std: Some((age_s * age_s + scatter(&delays)).sqrt()),
        ..Point::new(level, Lag { gain: mean(&values), time_constant_s, delay_s: delay_s.max(0.0) })
    }
}

/// The curve over the range of the points.
fn curve(motors: &[Motor], points: &[Point]) -> Option<TimeConstantBand> {
    let [first, .., last] = points else { return None };
    let levels = (0..=CURVE_POINTS)
        .map(|k| k as f64 / CURVE_POINTS as f64)
        .map(|part| first.nominal + part * (last.nominal - first.nominal));
    let points: Vec<Point> = levels.map(|level| point(motors, level)).collect();
    let interval = |point: &Point| {
        Estimate::normal(point.time_constant_s, point.time_constant_s_std.unwrap_or(f64::NAN))
            .interval_of_logarithm(0.95)
    };
    Some(TimeConstantBand {
        nominal: points.iter().map(|point| point.nominal).collect(),
        time_constant_s: points.iter().map(|point| point.time_constant_s).collect(),
        low_s: points.iter().map(|point| interval(point).0).collect(),
        high_s: points.iter().map(|point| interval(point).1).collect(),
        down_over_up: None,
    })
}

/// Sample variance; zero of one value.
fn scatter(values: &[f64]) -> f64 {
    let center = mean(values);
    values.iter().map(|value| (value - center).powi(2)).sum::<f64>() / (values.len().max(2) - 1) as f64
}

impl FlightIdentification {
    /// What the standard errors of the time constants hold of the model's structure: how many times the error that the noise makes, and the
    /// least share of the time constant, at the median of the command.
    #[must_use]
    pub fn structural_std(&self) -> (f64, f64) {
        (STRUCTURE.noise, least_std(self.motors.len()))
    }

    /// Refuses what is not known.
    fn check(&self, experiment: &Experiment) -> Result<(), FlightError> {
        let part = |point: &Point| point.time_constant_s_std.unwrap_or(f64::INFINITY) / point.time_constant_s;
        // The ends of the range are known less well than the middle, and a curve says so.
        let center = &self.points[self.points.len() / 2];
        let experiment = experiment.name.clone();
        if part(center) > LARGEST_STD {
            return Err(FlightError::TooLittleMotion {
                experiment,
                known_percent: 100.0 * part(center),
                largest_percent: 100.0 * LARGEST_STD,
            });
        }
        let difference = |motor: &MotorEstimate| {
            let found = motor.instrumental?;
            Some((found.difference / found.difference_std.hypot(part(center)), found))
        };
        let mut differences: Vec<_> = self.motors.iter().filter_map(difference).collect();
        differences.sort_by(|a, b| a.0.total_cmp(&b.0));
        match differences.get(differences.len() / 2) {
            Some((errors, found)) if errors.abs() > LARGEST_DIFFERENCE => Err(FlightError::Biased {
                experiment,
                instruments: found.instruments,
                difference_percent: 100.0 * found.difference.exp_m1(),
                standard_errors: errors.abs(),
            }),
            _ => Ok(()),
        }
    }
}
