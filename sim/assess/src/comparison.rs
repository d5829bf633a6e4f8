//! Two models beside each other: two motors, two propellers, before and after.

use miette::Diagnostic;
use rotorlead_numerics::statistics::t_quantile;
use rotorlead_plant::{Model, Point};
use rotorlead_records::Output;
use serde::Serialize;
use thiserror::Error;

/// Probability that all intervals of one quantity hold the truth. Standard: that of every interval here, 95 %.
const PROBABILITY: f64 = 0.95;

/// A number of a lag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LagParameter {
    /// The time constant, seconds.
    TimeConstant,
    /// The gain, response units per unit of command.
    Gain,
    /// The dead time, seconds.
    DeadTime,
}

/// One quantity of two models, `a` and `b`, at the commands that both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Which.
    pub quantity: LagParameter,
    /// By increasing command; at least one.
    pub points: Vec<Difference>,
}

/// What a quantity is at one command in both models, and by how much it changes from `a` to `b`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The command, 0..1.
    pub nominal: f64,
    /// In the first model, with its standard error.
    pub a: (f64, Option<f64>),
    /// In the second.
    pub b: (f64, Option<f64>),
    /// Of a dead time `b - a` in seconds, of any other `b / a - 1`.
    pub change: f64,
    /// Its interval. Those of all commands hold the truth together with 95 %; `None` where a standard error is not known.
    pub interval: Option<(f64, f64)>,
}

/// Why two models are not compared.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum ComparisonError {
    /// The commands of one are apart from those of the other.
    #[error(
        "the models share no command: the lags of the first are of {} to {}, those of the second of {} to {}", a.0, a.1, b.0, b.1
    )]
    #[diagnostic(help("record both motors around the same commands: between two of its own a model is interpolated"))]
    NothingShared {
        /// Lowest and highest command of the first.
        a: (f64, f64),
        /// Of the second.
        b: (f64, f64),
    },
    /// There is no lag.
    #[error("the {which} model has a static map alone, and no lag to compare")]
    #[diagnostic(help("record a multisine or a staircase of it"))]
    NoLag {
        /// Which of both.
        which: &'static str,
    },
    /// A gain is none, or of the wrong sign.
    #[error(
        "the gain of the {which} model at command {nominal} is {gain}, not above zero: no ratio says how it differs"
    )]
    #[diagnostic(help(
        "`rotorlead check` says what is wrong with the records; or remove this [[point]] from the model"
    ))]
    NoGain {
        /// Which of both.
        which: &'static str,
        /// The command.
        nominal: f64,
        /// The gain there.
        gain: f64,
    },
    /// One is of thrust, the other of speed.
    #[error("the first model is of `{}`, the second of `{}`: a gain and a lag of one are not those of the other", a.column(), b.column())]
    #[diagnostic(help("identify both from the same response, with --response where a log has two"))]
    OtherOutput {
        /// Response of the first.
        a: Output,
        /// Of the second.
        b: Output,
    },
}

impl Difference {
    /// Whether the two are known to differ; `None` where no interval is known.
    #[must_use]
    pub fn differs(&self) -> Option<bool> {
        self.interval.map(|(low, high)| low > 0.0 || high < 0.0)
    }
}

impl LagParameter {
    fn read(self, point: &Point) -> (f64, Option<f64>) {
        match self {
            Self::TimeConstant => (point.time_constant_s, point.time_constant_s_std),
            Self::Gain => (point.gain, point.gain_std),
            Self::DeadTime => (point.delay_s, point.delay_s_std),
        }
    }

    /// The value between two points, and its standard error where both have one: points are taken to err independently.
    fn at(self, points: &[Point], nominal: f64) -> (f64, Option<f64>) {
        let index = points.partition_point(|point| point.nominal <= nominal).clamp(1, points.len().max(2) - 1);
        let Some(high) = points.get(index) else { return self.read(&points[0]) };
        let low = &points[index - 1];
        let share = ((nominal - low.nominal) / (high.nominal - low.nominal)).clamp(0.0, 1.0);
        // What is not weighed need not be known.
        if share == 0.0 {
            return self.read(low);
        }
        if share == 1.0 {
            return self.read(high);
        }
        let ((below, below_std), (above, above_std)) = (self.read(low), self.read(high));
        let std = below_std.zip(above_std).map(|(below, above)| f64::hypot((1.0 - share) * below, share * above));
        ((1.0 - share) * below + share * above, std)
    }

    fn difference(self, nominal: f64, [a, b]: [(f64, Option<f64>); 2], reach: f64) -> Difference {
        let stds = a.1.zip(b.1);
        let (change, interval) = if self == Self::DeadTime {
            let change = b.0 - a.0;
            (change, stds.map(|(a, b)| f64::hypot(a, b)).map(|std| (change - reach * std, change + reach * std)))
        } else {
            // A time constant's error is closer to normal in the logarithm, and so is that of a ratio.
            let std_of_log = stds.map(|stds| f64::hypot(stds.0 / a.0, stds.1 / b.0));
            let factor = |std: f64| (reach * std).exp();
            let interval = std_of_log.map(|std| (b.0 / a.0 / factor(std) - 1.0, b.0 / a.0 * factor(std) - 1.0));
            (b.0 / a.0 - 1.0, interval)
        };
        Difference { nominal, a, b, change, interval }
    }

    fn compare(self, a: &[Point], b: &[Point], nominals: &[f64]) -> Compared {
        // Bonferroni: the chance that any of them misses is at most the sum of the chances.
        let missed = (1.0 - PROBABILITY) / nominals.len() as f64;
        let reach = t_quantile(1.0 - 0.5 * missed, f64::INFINITY);
        let points =
            nominals.iter().map(|&nominal| self.difference(nominal, [self.at(a, nominal), self.at(b, nominal)], reach));
        Compared { quantity: self, points: points.collect() }
    }
}

/// Compares the lags of two models at the commands of the first that lie between those of the second; where none does, the other
/// way about. A dead time that neither has is left out.
///
/// # Errors
/// [`ComparisonError`] where there is nothing that can be compared.
pub fn compare(a: &Model, b: &Model) -> Result<Vec<Compared>, ComparisonError> {
    for (model, which) in [(a, "first"), (b, "second")] {
        if model.points.is_empty() {
            return Err(ComparisonError::NoLag { which });
        }
        if let Some(&Point { nominal, gain, .. }) = model.points.iter().find(|point| point.gain <= 0.0) {
            return Err(ComparisonError::NoGain { which, nominal, gain });
        }
    }
    if let (Some(of_a), Some(of_b)) = (&a.provenance, &b.provenance)
        && of_a.output != of_b.output
    {
        return Err(ComparisonError::OtherOutput { a: of_a.output, b: of_b.output });
    }
    let range = |model: &Model| (model.points[0].nominal, model.points[model.points.len() - 1].nominal);
    let within = |model: &Model, (low, high): (f64, f64)| -> Vec<f64> {
        let nominals = model.points.iter().map(|point| point.nominal);
        nominals.filter(|nominal| (low..=high).contains(nominal)).collect()
    };
    let (of_a, of_b) = (range(a), range(b));
    let nominals = Some(within(a, of_b)).filter(|nominals| !nominals.is_empty());
    let nominals = nominals.unwrap_or_else(|| within(b, of_a));
    if nominals.is_empty() {
        return Err(ComparisonError::NothingShared { a: of_a, b: of_b });
    }
    let has_dead_time = [a, b].iter().any(|model| model.points.iter().any(|point| point.delay_s != 0.0));
    let quantities = [LagParameter::TimeConstant, LagParameter::Gain]
        .into_iter()
        .chain(has_dead_time.then_some(LagParameter::DeadTime));
    Ok(quantities.map(|quantity| quantity.compare(&a.points, &b.points, &nominals)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lags with time constants and their standard errors, seconds, from 0.3 on in steps of 0.1.
    fn model(time_constants: &[(f64, Option<f64>)]) -> Model {
        let point = |(index, (tau, std)): (usize, &(f64, Option<f64>))| Point {
            time_constant_s_std: *std,
            ..Point::new(
                0.3 + 0.1 * index as f64,
                rotorlead_plant::Lag { gain: 10.0, time_constant_s: *tau, delay_s: 0.0 },
            )
        };
        Model {
            format: 1,
            points: time_constants.iter().enumerate().map(point).collect(),
            static_map: None,
            time_constant_curve: None,
            effects: Vec::new(),
            provenance: None,
        }
    }

    fn compare_time_constants(a: &Model, b: &Model) -> Vec<Difference> {
        compare(a, b).unwrap().remove(0).points
    }

    #[test]
    fn a_difference_is_told_where_its_interval_leaves_none_out() {
        let a = model(&[(0.1, Some(0.001)), (0.08, Some(0.001))]);
        let b = model(&[(0.09, Some(0.001)), (0.081, Some(0.001))]);
        let found = compare_time_constants(&a, &b);
        assert_eq!(found.iter().map(Difference::differs).collect::<Vec<_>>(), [Some(true), Some(false)]);
        assert!((found[0].change + 0.1).abs() < 1e-12, "{found:?}");
        // Two intervals that hold together are normal ones of 97.5 %, 2.2414 standard errors to either side.
        let (low, high) = found[0].interval.unwrap();
        let reach = 2.2414 * f64::hypot(0.001 / 0.1, 0.001 / 0.09);
        assert!((low - (0.9 * (-reach).exp() - 1.0)).abs() < 1e-6 && (high - (0.9 * reach.exp() - 1.0)).abs() < 1e-6);
        assert_eq!(compare_time_constants(&a, &model(&[(0.05, None), (0.05, None)]))[0].differs(), None);
    }

    #[test]
    fn between_two_points_a_model_is_interpolated_with_its_error() {
        let a = model(&[(0.1, Some(0.01)), (0.08, Some(0.01)), (0.06, None)]);
        assert_eq!(LagParameter::TimeConstant.at(&a.points, 0.4), (0.08, Some(0.01)));
        let (tau, std) = LagParameter::TimeConstant.at(&a.points, 0.35);
        assert!((tau - 0.09).abs() < 1e-12 && (std.unwrap() - 0.01 * 0.5_f64.sqrt()).abs() < 1e-12, "{tau} {std:?}");
        assert_eq!(LagParameter::TimeConstant.at(&a.points, 0.45).1, None);
        let one = model(&[(0.1, Some(0.01))]);
        assert_eq!(LagParameter::TimeConstant.at(&one.points, 0.3), (0.1, Some(0.01)));
        // The one command of the second lies between those of the first.
        let mut between = one;
        between.points[0].nominal = 0.35;
        assert_eq!(compare_time_constants(&a, &between)[0].nominal, 0.35);
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let a = model(&[(0.1, None)]);
        let mut apart = a.clone();
        apart.points[0].nominal = 0.7;
        assert_eq!(compare(&a, &apart), Err(ComparisonError::NothingShared { a: (0.3, 0.3), b: (0.7, 0.7) }));
        let mut turned = a.clone();
        turned.points[0].gain = -3.0;
        let refused = ComparisonError::NoGain { which: "second", nominal: 0.3, gain: -3.0 };
        assert_eq!(compare(&a, &turned), Err(refused));
        assert_eq!(compare(&a, &model(&[])), Err(ComparisonError::NoLag { which: "second" }));
    }

    #[test]
    fn of_two_alike_motors_one_in_twenty_is_called_another_at_most() {
        const RUNS: usize = 4000;
        let uniform = |k: usize| ((k as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0);
        let error = |k: usize| t_quantile(uniform(k).clamp(1e-6, 1.0 - 1e-6), f64::INFINITY);
        let noisy = |k: usize| {
            let taus: Vec<_> = (0..6).map(|point| (0.1 + 0.002 * error(6 * k + point + 1), Some(0.002))).collect();
            model(&taus)
        };
        let is_called = |k: &usize| {
            compare_time_constants(&noisy(2 * k), &noisy(2 * k + 1)).iter().any(|point| point.differs() == Some(true))
        };
        let called = (0..RUNS).filter(is_called).count() as f64 / RUNS as f64;
        // Standard error 0.3 %.
        assert!((0.04..0.06).contains(&called), "{called}");
    }
}
