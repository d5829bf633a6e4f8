//! The static map: steady response against command, as a polynomial with its dead zone, hysteresis and limit.
//!
//! [`SteadyPoints`] takes the plateaus of any record, or the bins of a ramp; [`fit_static_map`] fits them.
//!
//! # Which degree
//! All polynomials of degree 1 to 5, with and without a limit, are fitted. Of two candidates the one with the lesser
//! `n ln(sum of squares) + penalty(parameters)` is better; the penalty is what an F-test at 0.5 % asks of each parameter
//! in turn, `n ln(1 + F / (n - k))`. Akaike's criterion, which asks for less, adds a degree too many in one
//! record of six. Standard errors are scaled by what the best one leaves, and intervals are Student's t.
//!
//! The F-test compares polynomials with each other, and few levels leave it no degrees of freedom to see a curve by. So where its choice
//! misses levels by more than their own scatter, and no drift between visits of one level explains that, the degree is the one that
//! predicts each level best from the others (`lack_of_fit`).
//!
//! # What is what
//! - *Dead zone*: the command at which the polynomial crosses zero, where this is consistent with the highest command at
//!   which the motor stands still and the lowest at which it runs. A motor that starts with a jump has a polynomial that
//!   crosses elsewhere; its dead zone is only bracketed by the two.
//! - *Hysteresis*: the width in command between levels reached from below and from above. A motor that warms up
//!   along the record looks alike; a second pass upwards tells the two apart. On a ramp a lag looks alike too (`ramp`).
//! - *Limit*: the command beyond which the response rises no more; or falls, which is named apart since no inverse has it.

pub(crate) mod error;
mod lack_of_fit;
mod points;
mod ramp;
mod shape;

use std::fmt;

use nalgebra::{DMatrix, DVector};
use rotorlead_numerics::least_squares::Solution;
use rotorlead_numerics::sample::moving_mean;
use rotorlead_numerics::statistics::t_quantile;
use rotorlead_plant::MapPolynomial;
use serde::Serialize;

pub use error::StaticMapError;
pub use points::{SteadyPoint, SteadyPoints, SteadySource};

use crate::estimate::Estimate;
use crate::lag::steps::{Direction, SAME_LEVEL};
use shape::MapTerms;

/// The highest degree tried. Chosen: thrust goes with the square, and supply and losses bend it once or twice more; higher ones swing
/// between levels.
const MOST_DEGREES: usize = 5;
/// Level of the F-test that a parameter has to pass. Chosen: simulated staircases of four maps get the true degree in at least 95 % of 300
/// repeats each (`tests/known_truth/static_map.rs`); Akaike's criterion adds a degree in one of six.
const LEVEL: f64 = 0.005;
/// Degrees of freedom that the F-test's candidates leave at least. Derived: at two a 95 % interval is 4.3 standard errors to either side; at
/// one it is 12.7.
const LEAST_DOF: usize = 2;
/// Levels that miss the map by so many times their own scatter are not on it. Chosen: up to three times is usual drift, which the intervals
/// hold.
const MOST_EXCESS: f64 = 3.0;
/// A polynomial that misses levels by less than this share of the highest response is as good as they are. Chosen: no design changes by a
/// percent.
const LEAST_MISS: f64 = 0.01;
/// Neighbors on each side over which the points' variances are pooled. Chosen: a pool of 7 has seven times the degrees of freedom of a
/// point; a wider one mixes low and high speeds, whose noise differs.
const POOL_HALF_WIDTH: usize = 3;
/// A response lower than that of the level below by as many standard errors falls. Derived: noise alone does so in 0.13 % (normal, one
/// side).
const FALLS: f64 = 3.0;

/// A static map with its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StaticMapFit {
    /// Coefficients in powers of the command: response units, from the constant on. They describe the middle between
    /// levels reached from below and from above.
    pub coefficients: Vec<Estimate>,
    /// Commands between which they hold.
    pub range: (f64, f64),
    /// Where the motor begins to turn; `None` where the record never shows it at rest.
    pub dead_zone: Option<DeadZone>,
    /// Width between levels reached from below and from above, in command; `None` where one of the two was not seen.
    pub hysteresis: Option<Estimate>,
    /// What happens at the top; `None`: the response rises to the highest command seen.
    pub limit: Option<MapLimit>,
    /// Standard deviation of what is left, in units of the points' own standard errors: far above one, the map is not all.
    pub excess: f64,
    /// What chose the degree.
    #[serde(skip)]
    pub degree_by: DegreeRule,
    /// Steady points used.
    pub points: usize,
    /// What is odd.
    #[serde(skip)]
    pub warnings: Vec<StaticMapWarning>,
    #[serde(skip)]
    shape: MapTerms,
    #[serde(skip)]
    parameters: Vec<f64>,
    #[serde(skip)]
    covariance: DMatrix<f64>,
    #[serde(skip)]
    dof: f64,
}

/// What chooses the degree of a static map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DegreeRule {
    /// An F-test at 0.5 % of each further term.
    FTest,
    /// How well each level is predicted from the others.
    CrossValidation,
}

impl fmt::Display for DegreeRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FTest => "F-test at 0.5 %",
            Self::CrossValidation => "cross-validation over levels",
        })
    }
}

/// Where a motor begins to turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DeadZone {
    /// The highest command at which it stood still.
    pub still: f64,
    /// The lowest command at which it ran.
    pub runs: f64,
    /// Where the response begins; `None` for a motor that starts with a jump, of which the two above are all that is known.
    pub end: Option<Estimate>,
}

/// What happens at the top.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MapLimit {
    /// The response rises no more beyond a command.
    Saturates {
        /// The command.
        command: Estimate,
        /// The response there.
        response: Estimate,
    },
    /// The response falls beyond a level.
    Falls {
        /// The highest command before.
        command: f64,
        /// By how much at the next one, response units.
        by: Estimate,
    },
}

/// What a reader of a static map has to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StaticMapWarning {
    /// The points are a ramp's, and its lag is not known.
    RampLag {
        /// Whether it goes up and down.
        both_ways: bool,
    },
    /// Visits of the same level differ by more than the points' own scatter, and so the fit leaves more than that.
    Excess {
        /// How much more it leaves.
        times: f64,
    },
    /// The polynomial misses levels that are not known to drift.
    NotPolynomial {
        /// Its degree.
        degree: usize,
        /// By how much of the highest response, RMS.
        share: f64,
        /// Whether some level was visited twice, so that drift would show.
        is_revisited: bool,
    },
    /// The polynomial does not rise everywhere.
    NotRising {
        /// From this command on.
        command: f64,
    },
}

impl fmt::Display for StaticMapWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::RampLag { both_ways: true } => f.write_str(
                "the static map is from a ramp, which the response trails by a lag that is not known: commands are moved until both ways \
                 agree, so that it shows no hysteresis. Play a staircase for that",
            ),
            Self::RampLag { both_ways: false } => f.write_str(
                "the static map is from a ramp that goes one way: its commands are off by the ramp's rate times the motor's lag, which is \
                 not known. Ramp up and down, or play a staircase",
            ),
            Self::Excess { times } => write!(
                f,
                "levels miss the static map by {times:.1} times their own scatter, which is in its intervals: something slow, such as heat or the supply, moves them. Repeat the levels in another order"
            ),
            Self::NotPolynomial { degree, share, is_revisited } => write!(
                f,
                "levels miss the static map's polynomial of degree {degree} by {:.1} % of the highest response, which is in its intervals. \
                 {}: use the levels themselves, or record more of them",
                100.0 * share,
                if is_revisited {
                    "Visits of the same level agree, so that the curve is another"
                } else {
                    "No level was visited twice, so that nothing is known of drift"
                }
            ),
            Self::NotRising { command } => write!(
                f,
                "the static map's polynomial does not rise from command {command:.3} on and has no inverse there"
            ),
        }
    }
}

/// Fits the static map.
///
/// # Errors
/// [`StaticMapError`] with fewer than four levels, or when no candidate can be determined.
pub fn fit_static_map(steady: &SteadyPoints) -> Result<StaticMapFit, StaticMapError> {
    let mut points = steady.running.clone();
    points.sort_by(|a, b| a.command.total_cmp(&b.command));
    let falls = cut_where_it_falls(&mut points);
    let mut levels: Vec<f64> = Vec::new();
    for point in &points {
        if levels.last().is_none_or(|&last| point.command - last > SAME_LEVEL) {
            levels.push(point.command);
        }
    }
    // Derived: a line through three levels leaves one degree of freedom, whose 95 % interval is 12.7 standard errors to either side.
    if levels.len() < 4 {
        return Err(StaticMapError::TooFewLevels { levels: levels.len() });
    }
    let first = points[0].response;
    if points.iter().all(|point| point.response == first) {
        return Err(StaticMapError::Still { response: first });
    }
    let (low, high) = (levels[0], levels[levels.len() - 1]);
    let std = pooled_std(&points);
    let seen = |direction| points.iter().filter(|p| p.direction == direction).count();
    // The first level of all counts as reached from below, so one more is needed there.
    let both_ways = seen(Direction::Up) >= 2 && seen(Direction::Down) >= 1;
    let of_unknown_lag = steady.source == SteadySource::RampOfUnknownLag;
    let hysteresis = both_ways && !of_unknown_lag;
    let terms = |degree, limit| MapTerms {
        degree,
        hysteresis,
        limit,
        center: 0.5 * (low + high),
        half_range: 0.5 * (high - low),
    };
    // A response that falls has been cut off; there is no limit below.
    let limits: &[bool] = if falls.is_some() { &[false] } else { &[false, true] };
    let most_degrees = MOST_DEGREES.min(levels.len() - 2);
    let shapes = || limits.iter().flat_map(|&limit| (1..=most_degrees).map(move |degree| terms(degree, limit)));
    let mut best: Option<(f64, MapTerms, Solution)> = None;
    for shape in shapes() {
        let Some(solution) = shape::fit(shape, &points, &std, LEAST_DOF) else { continue };
        let n = points.len() as f64;
        let criterion =
            n * solution.sum_of_squares.max(f64::MIN_POSITIVE).ln() + penalty(points.len(), shape.parameter_count());
        if best.as_ref().is_none_or(|b| criterion < b.0) {
            best = Some((criterion, shape, solution));
        }
    }
    let (_, mut shape, mut solution) = best.ok_or(StaticMapError::NoFit)?;
    let mut degree_by = DegreeRule::FTest;
    let excess = |shape: &MapTerms, solution: &Solution| {
        (solution.sum_of_squares / (points.len() - shape.parameter_count()) as f64).sqrt()
    };
    let same = steady.same_level();
    let visits = lack_of_fit::excess_between_visits(&shape, &solution.parameters, (&points, &std), same);
    let drifts = visits.is_some_and(|visits| visits > MOST_EXCESS);
    if steady.source != SteadySource::Averages
        && !drifts
        && excess(&shape, &solution) > MOST_EXCESS
        && let Some((chosen, fitted)) = lack_of_fit::cross_validated(shapes(), (&points, &std), same)
        && fitted.sum_of_squares < solution.sum_of_squares
    {
        (shape, solution, degree_by) = (chosen, fitted, DegreeRule::CrossValidation);
    }
    let unit = solution.unit_covariance.as_ref().ok_or(StaticMapError::NoFit)?;
    let dof = (points.len() - shape.parameter_count()) as f64;
    let variance = solution.sum_of_squares / dof;
    // Visits to a level have the error of its readings' resolution in common, which leaves no difference between them.
    let common = points.iter().zip(&std).map(|(point, std)| (point.common_std / std).powi(2)).sum::<f64>();
    let known = common / levels.len() as f64;
    let mut fit = StaticMapFit {
        coefficients: Vec::new(),
        range: (low, high),
        dead_zone: None,
        hysteresis: None,
        limit: falls,
        excess: variance.sqrt(),
        degree_by,
        points: points.len(),
        warnings: Vec::from_iter(of_unknown_lag.then_some(StaticMapWarning::RampLag { both_ways })),
        shape,
        covariance: unit * variance.max(known),
        parameters: solution.parameters,
        dof,
    };
    fit.describe(steady);
    if steady.source != SteadySource::Averages && fit.excess > MOST_EXCESS {
        let share = fit.miss_share(&points);
        if drifts {
            fit.warnings.push(StaticMapWarning::Excess { times: fit.excess });
        } else if share > LEAST_MISS {
            let (degree, is_revisited) = (fit.degree(), visits.is_some());
            fit.warnings.push(StaticMapWarning::NotPolynomial { degree, share, is_revisited });
        }
    }
    Ok(fit)
}

/// What the F-test asks of `parameters` parameters, as a difference of `n ln(sum of squares)`.
fn penalty(n: usize, parameters: usize) -> f64 {
    (1..=parameters)
        .map(|k| {
            let dof = n.saturating_sub(k).max(1) as f64;
            let t = t_quantile(1.0 - 0.5 * LEVEL, dof);
            n as f64 * (1.0 + t * t / dof).ln()
        })
        .sum()
}

/// Takes off the levels at the top at which the response falls.
fn cut_where_it_falls(points: &mut Vec<SteadyPoint>) -> Option<MapLimit> {
    let up: Vec<SteadyPoint> = points.iter().copied().filter(|p| p.direction == Direction::Up).collect();
    let highest = up.iter().max_by(|a, b| a.response.total_cmp(&b.response))?;
    let next = up.iter().find(|p| p.command > highest.command + SAME_LEVEL)?;
    let std = next.std.hypot(highest.std);
    let by = highest.response - next.response;
    // A level that is a little lower by noise alone is on a flat top. Chosen: a fall of a thousandth changes no design.
    if by <= FALLS * std || by < 1e-3 * highest.response.abs() {
        return None;
    }
    let command = highest.command;
    points.retain(|p| p.command <= command + SAME_LEVEL);
    Some(MapLimit::Falls { command, by: Estimate::normal(by, std) })
}

/// Standard errors from variances that are pooled over neighbors: each has but a few degrees of freedom.
fn pooled_std(points: &[SteadyPoint]) -> Vec<f64> {
    let variances: Vec<f64> = points.iter().map(|p| p.std * p.std).collect();
    let pooled = moving_mean(&variances, POOL_HALF_WIDTH);
    // A sensor that reads the same all the time has still its resolution. Chosen: below the digits of any log, above a double's rounding.
    let highest = points.iter().map(|p| p.response.abs()).fold(f64::MIN_POSITIVE, f64::max);
    pooled.iter().map(|v| v.sqrt().max(1e-9 * highest)).collect()
}

impl StaticMapFit {
    /// The map as a model holds it.
    #[must_use]
    pub fn polynomial(&self) -> MapPolynomial {
        let (limit, limit_std) = match self.limit {
            Some(MapLimit::Saturates { command, .. }) => (Some(command.value), Some(command.std)),
            Some(MapLimit::Falls { command, .. }) => (Some(command), None),
            None => (None, None),
        };
        MapPolynomial {
            range: self.range.into(),
            coefficients: self.coefficients.iter().map(|c| c.value).collect(),
            coefficients_std: self.coefficients.iter().map(|c| c.std).collect(),
            dead_zone: self.dead_zone.map(|zone| zone.end.map_or(zone.runs, |end| end.value)),
            dead_zone_std: self.dead_zone.and_then(|zone| zone.end).map(|end| end.std),
            hysteresis: self.hysteresis.map(|width| width.value),
            hysteresis_std: self.hysteresis.map(|width| width.std),
            limit,
            limit_std,
        }
    }

    /// Degree of the polynomial.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.shape.degree
    }

    /// The steady response at `command`, in the middle between both directions, response units.
    #[must_use]
    pub fn response(&self, command: f64) -> Estimate {
        let gradient = DVector::from_vec(self.shape.gradient(&self.parameters, command));
        let variance = (gradient.transpose() * &self.covariance * &gradient)[(0, 0)];
        Estimate {
            value: self.shape.response(&self.parameters, command, None),
            std: variance.max(0.0).sqrt(),
            dof: self.dof,
        }
    }

    /// The command that gives this steady response: the inverse of the map, from where it begins to where it is limited.
    /// `None` for a response that it does not reach, or where it does not rise.
    #[must_use]
    pub fn command_for(&self, response: f64) -> Option<f64> {
        let (from, to) = self.rising_range();
        let at = |u: f64| self.shape.response(&self.parameters, u, None);
        if self.first_not_rising().is_some() || !(at(from)..=at(to)).contains(&response) {
            return None;
        }
        let (mut low, mut high) = (from, to);
        // Halves until the commands are neighbors in floating point, some 50 times; 64 are enough for any range.
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if at(middle) < response {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }

    /// Commands for `count` (2 or more) responses that are evenly spaced between the lowest and the highest: a table that
    /// makes the throttle linear. Pairs of the share of that range, 0..1, and the command. `None` of a map that falls.
    #[must_use]
    pub fn linearization(&self, count: usize) -> Option<Vec<(f64, f64)>> {
        let (from, to) = self.rising_range();
        let at = |u: f64| self.shape.response(&self.parameters, u, None);
        let (low, high) = (at(from), at(to));
        (0..count)
            .map(|k| {
                let share = k as f64 / (count.max(2) - 1) as f64;
                // The ends to rounding. A map that falls has its ends the other way round.
                let response = (low + share * (high - low)).max(low).min(high);
                Some((share, self.command_for(response)?))
            })
            .collect()
    }

    /// Commands from the end of the dead zone, or the lowest seen, to the limit.
    fn rising_range(&self) -> (f64, f64) {
        let end = self.dead_zone.and_then(|zone| zone.end).map(|end| end.value);
        let from = end.map_or(self.range.0, |end| end.min(self.range.0));
        let to = match self.limit {
            Some(MapLimit::Saturates { command, .. }) => command.value,
            _ => self.range.1,
        };
        (from, to)
    }

    /// The first command at which the polynomial does not rise.
    fn first_not_rising(&self) -> Option<f64> {
        let (from, to) = self.rising_range();
        // Chosen: a fall over less than 1 / 200 of the range may be missed, of a polynomial that turns four times at most.
        let at = |k: usize| from + (to - from) * k as f64 / 200.0;
        let response = |u: f64| self.shape.response(&self.parameters, u, None);
        (1..=200).find(|&k| response(at(k)) <= response(at(k - 1))).map(at)
    }

    /// Reads dead zone, hysteresis and limit off the parameters.
    fn describe(&mut self, steady: &SteadyPoints) {
        let estimate = |fit: &Self, k: usize| Estimate {
            value: fit.parameters[k],
            std: fit.covariance[(k, k)].max(0.0).sqrt(),
            dof: fit.dof,
        };
        let expansion = self.shape.expansion();
        let n = self.shape.degree + 1;
        let values = &expansion * DVector::from_column_slice(&self.parameters[..n]);
        let covariance = &expansion * self.covariance.view((0, 0), (n, n)) * expansion.transpose();
        self.coefficients = (0..n)
            .map(|k| Estimate { value: values[k], std: covariance[(k, k)].max(0.0).sqrt(), dof: self.dof })
            .collect();
        self.hysteresis = self.shape.hysteresis_index().map(|k| estimate(self, k));
        if let Some(k) = self.shape.limit_index() {
            let command = estimate(self, k);
            self.limit = Some(MapLimit::Saturates { command, response: self.response(command.value) });
        }
        self.dead_zone = steady.still.map(|still| {
            let runs = self.range.0;
            DeadZone { still, runs, end: self.zero_crossing().filter(|end| consistent(*end, still, runs)) }
        });
        if let Some(command) = self.first_not_rising() {
            self.warnings.push(StaticMapWarning::NotRising { command });
        }
    }

    /// RMS by which points miss the map, as a share of the highest response.
    fn miss_share(&self, points: &[SteadyPoint]) -> f64 {
        let miss = |p: &SteadyPoint| self.shape.response(&self.parameters, p.command, Some(p.direction)) - p.response;
        let squares: f64 = points.iter().map(|p| miss(p).powi(2)).sum();
        let highest = points.iter().map(|p| p.response.abs()).fold(f64::MIN_POSITIVE, f64::max);
        (squares / points.len() as f64).sqrt() / highest
    }

    /// The highest command below the lowest level at which the polynomial is zero.
    fn zero_crossing(&self) -> Option<Estimate> {
        let at = |u: f64| self.shape.response(&self.parameters, u, None);
        let grid = |k: usize| self.range.0 * (1.0 - k as f64 / 200.0);
        // The lowest level itself may be a little below zero by noise. Chosen: 200 points bracket the crossing nearest to it, and 60
        // halvings take the bracket to a double's last bit.
        let k = (1..=200).find(|&k| at(grid(k)) <= 0.0)?;
        let (mut low, mut high) = (grid(k), grid(k - 1));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if at(middle) <= 0.0 { low = middle } else { high = middle }
        }
        let u = 0.5 * (low + high);
        // Derived: near the cube root of the rounding unit, 6e-6, rounding and the cubic term balance.
        let slope = (at(u + 1e-5) - at(u - 1e-5)) / 2e-5;
        (slope > 0.0).then(|| Estimate { value: u, std: self.response(u).std / slope, dof: self.dof })
    }
}

/// Whether the end of a dead zone is between the commands that bracket it, but for its error. Chosen: at 99 % a true dead zone is taken for
/// a jump at most once in 100 maps; higher, jumps pass for dead zones.
fn consistent(end: Estimate, still: f64, runs: f64) -> bool {
    let (low, high) = end.interval(0.99);
    high >= still && low <= runs
}
