//! A lag whose time constant depends on the speed, and one that does not.
//!
//! # Equations
//! A motor against the propeller's drag has `dw/dt = a u - b w - c w^2 - e`. With the steady response `W(u)` put in place
//! of `a u - e`, so that the static map may have a shape of its own,
//!
//! `dw/dt = b (W - w) + c (W^2 - w^2)`, `W = p_0 + p_1 u + p_2 u^2`, all of it `delay` later,
//!
//! whose time constant about a level is `tau(W) = 1 / (b + 2 c W)`: the faster, the shorter. It is fitted as
//! `1/tau(W) = lambda (1 - k + k W/R)`, where `R` is the highest level, `lambda` the rate there and `k` the share of it that
//! is drag's: 0 is the one lag, 1 a motor with nothing but drag. Between two changes the solution is closed
//! ([`super::response`]), so the whole run is simulated exactly, from its first row on, with nothing reset between steps.
//!
//! All parameters are fitted together by least squares. What they miss is much the same all over a plateau, as it is the static
//! map's more than the noise's. Covariances therefore count the residuals of a plateau as one observation (the sandwich
//! `U (sum_plateaus g g') U` with `g = J' r` of a plateau: Liang and Zeger 1986); else intervals would be several times too
//! short. `k` is tied to its physical range by the mean and the standard deviation
//! of a uniform density over it, 0.5 +- 0.29, since steps in one direction or on a few levels say little of it. The tie is weighed against residuals in units of
//! `sqrt(sum_plateaus (sum r)^2 / rows)`, their standard deviation if they were white with the same sums: what the map misses is
//! then no evidence for or against drag. Few plateaus have as many sums as the fit has parameters, and so none left: the unit is
//! never below the noise of the rows, `s sqrt(1 + 2 sum_l rho_l)` with its correlation `rho_l` from row to row.
//!
//! Intervals need two plateaus more than there are parameters. With fewer, nothing tells what the map misses from what the
//! parameters have taken, and errors are infinite.

use nalgebra::{DMatrix, DVector};
use rotorlead_numerics::least_squares::{Limits, Residuals, Solution, minimize};
use rotorlead_records::Record;
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

use super::Run;
use super::plateaus::{Direction, Plateau, SAME_LEVEL, State};
use super::response::{Segment, value};
use super::uncertainty::correlation;
use crate::estimate::Estimate;
use crate::goodness_of_fit::{percent_when_left, spread};

/// Which law the lag follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LagLaw {
    /// One time constant for all levels.
    OneLag,
    /// One for steps up and another for steps down.
    PerDirection,
    /// `1/tau = b + 2 c W`.
    SpeedDependent,
}

impl LagLaw {
    /// What is known beforehand of what it has beyond the one lag: mean and standard deviation.
    fn known(self) -> Option<(f64, f64)> {
        match self {
            Self::OneLag => None,
            Self::PerDirection => Some(RATIO_KNOWN),
            Self::SpeedDependent => Some(DRAG_KNOWN),
        }
    }
}

/// A fitted law.
#[derive(Clone, Debug, PartialEq)]
pub struct LawFit {
    /// The law.
    pub law: LagLaw,
    /// `W` in powers of the command, from the constant on, response units.
    pub map: [f64; 3],
    /// Plateaus that it was fitted to.
    pub plateaus: usize,
    /// Delay as logged, seconds; this and all other errors are infinite with too few plateaus ([`Self::fewest_plateaus`]).
    pub delay_s: Estimate,
    /// Time constant at [`Self::reference`], seconds; use [`Estimate::interval_of_logarithm`].
    pub time_constant_s: Estimate,
    /// `k`: which share of the rate at [`Self::reference`] is drag's. 0 but for the lag that depends on the speed.
    pub drag_share: Estimate,
    /// Logarithm of the time constant down over that up. 0 but for one lag per direction.
    pub log_down_over_up: Estimate,
    /// The highest level, response units.
    pub reference: f64,
    /// Covariance of the logarithms of the time constant up and of the ratio.
    up_with_ratio: f64,
    /// % fit on the rows that it was fitted to.
    pub fit_percent: f64,
}

/// Degrees of freedom are null where there are no intervals.
impl Serialize for LawFit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("LawFit", 13)?;
        values.serialize_field("map", &self.map)?;
        values.serialize_field("plateaus", &self.plateaus)?;
        let dof = self.has_intervals().then_some(self.time_constant_s.dof);
        values.serialize_field("degrees_of_freedom", &dof)?;
        values.serialize_field("delay_s", &self.delay_s.value)?;
        values.serialize_field("delay_s_std", &self.delay_s.std)?;
        values.serialize_field("time_constant_s", &self.time_constant_s.value)?;
        values.serialize_field("time_constant_s_std", &self.time_constant_s.std)?;
        values.serialize_field("reference", &self.reference)?;
        values.serialize_field("drag_share", &self.drag_share.value)?;
        values.serialize_field("drag_share_std", &self.drag_share.std)?;
        values.serialize_field("time_constant_down_s", &self.time_constant_down_s().value)?;
        values.serialize_field("time_constant_down_s_std", &self.time_constant_down_s().std)?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.end()
    }
}

impl LawFit {
    /// How many plateaus it takes for intervals.
    #[must_use]
    pub fn fewest_plateaus(&self) -> usize {
        match self.law {
            LagLaw::OneLag => EXTRA + SPARE,
            LagLaw::PerDirection | LagLaw::SpeedDependent => EXTRA + 1 + SPARE,
        }
    }

    /// Whether there are enough of them.
    #[must_use]
    pub fn has_intervals(&self) -> bool {
        self.plateaus >= self.fewest_plateaus()
    }

    /// Time constant of steps down, seconds.
    #[must_use]
    pub fn time_constant_down_s(&self) -> Estimate {
        let ratio = self.log_down_over_up;
        let value = self.time_constant_s.value * ratio.value.exp();
        let up = self.time_constant_s.std / self.time_constant_s.value;
        let variance = up * up + ratio.std * ratio.std + 2.0 * self.up_with_ratio;
        Estimate { value, std: value * variance.max(0.0).sqrt(), dof: ratio.dof }
    }

    /// Time constant of small motions about a steady response, seconds.
    #[must_use]
    pub fn time_constant_at(&self, response: f64) -> f64 {
        let k = self.drag_share.value;
        self.time_constant_s.value / (1.0 - k + k * response / self.reference)
    }
}

/// Indices of the parameters: delay, logarithm of the rate at the highest level, the map at the lowest, middle and highest
/// command in units of the highest level, and what a law has beyond the one lag: the share of drag, or the logarithm of the
/// time constant down over that up.
const DELAY: usize = 0;
const RATE: usize = 1;
const MAP: usize = 2;
const EXTRA: usize = 5;
/// Plateaus beyond the number of parameters that intervals need.
const SPARE: usize = 2;
/// Mean and standard deviation of what is known of the share of drag beforehand, and of the logarithm of the time constant
/// down over that up.
const DRAG_KNOWN: (f64, f64) = (0.5, 0.29);
const RATIO_KNOWN: (f64, f64) = (0.0, 0.5);
/// As in the fit of single steps: rows that a change passes leave a search zigzagging.
pub(super) const LIMITS: Limits = Limits { iterations: 200, decrease: 1e-7 };
/// Delays beyond this are not searched, seconds.
const MAX_DELAY_S: f64 = 0.3;
/// Delays and time constants to begin with, seconds.
const STARTS_S: [(f64, f64); 3] = [(0.0, 0.035), (0.025, 0.035), (0.005, 0.09)];

/// A run with what the fits need of it.
pub(super) struct Bench<'a> {
    time_s: &'a [f64],
    y: &'a [f64],
    /// Rows that are neither fitted nor judged.
    nothing: Vec<bool>,
    /// The first one from its settled rows on: what comes before may still be on its way there.
    pub(super) plateaus: Vec<Plateau>,
    /// Whether the motor's own response shows on a plateau, and settles there.
    pub(super) shows: Vec<bool>,
    /// Rank of each plateau's command among the levels.
    pub(super) level: Vec<usize>,
    low: f64,
    high: f64,
    reference: f64,
}

impl<'a> Bench<'a> {
    pub(super) fn of(record: &'a Record, run: &'a Run) -> Self {
        let mut levels: Vec<f64> = Vec::new();
        for plateau in &run.plateaus {
            if levels.iter().all(|l| (l - plateau.command).abs() > SAME_LEVEL) {
                levels.push(plateau.command);
            }
        }
        levels.sort_by(f64::total_cmp);
        let mut plateaus = run.plateaus.clone();
        plateaus[0].rows.start = plateaus[0].settled().start;
        let rank = |p: &Plateau| levels.partition_point(|&l| l < p.command - SAME_LEVEL);
        Self {
            time_s: &record.time_s,
            y: &run.clean,
            nothing: run.rows_that_say_nothing(&record.time_s),
            plateaus,
            shows: (0..run.plateaus.len()).map(|k| run.shows(k) && run.plateaus[k].state == State::Running).collect(),
            level: run.plateaus.iter().map(rank).collect(),
            low: levels[0],
            high: levels[levels.len() - 1],
            reference: run.plateaus.iter().map(|p| p.mean).fold(f64::MIN_POSITIVE, f64::max),
        }
    }

    /// Powers of the command of the map through three values at the lowest, middle and highest command.
    fn powers(&self, values: &[f64]) -> [f64; 3] {
        let (half, middle) = (0.5 * (self.high - self.low), 0.5 * (self.high + self.low));
        let (a, b, c) = (values[0] * self.reference, values[1] * self.reference, values[2] * self.reference);
        let (slope, bend) = (0.5 * (c - a) / half, 0.5 * (a + c - 2.0 * b) / (half * half));
        [b - slope * middle + bend * middle * middle, slope - 2.0 * bend * middle, bend]
    }

    /// The response of the run; `false` where it has none. With `measured` the levels are the plateaus' own means.
    fn simulate(&self, law: LagLaw, p: &[f64], measured: bool, out: &mut [f64]) -> bool {
        let map = self.powers(&p[MAP..MAP + 3]);
        let k = if law == LagLaw::SpeedDependent { p[EXTRA] } else { 0.0 };
        let ratio = if law == LagLaw::PerDirection { p[EXTRA].exp() } else { 1.0 };
        let rate = p[RATE].exp();
        let first = self.plateaus[0].rows.start;
        let mut ok = p[DELAY].abs() < MAX_DELAY_S && rate.is_finite();
        let segment = |plateau: &Plateau| {
            let u = plateau.command;
            let level = if measured { plateau.mean } else { map[0] + u * (map[1] + u * map[2]) };
            let slower = if plateau.direction == Some(Direction::Down) { ratio } else { 1.0 };
            let time_constant_s = slower / (rate * (1.0 - k + k * level / self.reference));
            let bend = 0.5 * k * rate / self.reference * time_constant_s;
            Segment { from_s: self.time_s[plateau.rows.start], level, time_constant_s, delay_s: p[DELAY], bend }
        };
        let mut current = segment(&self.plateaus[0]);
        let mut excess = 0.0;
        let mut next = 1;
        for (out, &t) in out.iter_mut().zip(&self.time_s[first..]) {
            while let Some(plateau) = self.plateaus.get(next) {
                let following = segment(plateau);
                let switch = following.from_s + following.delay_s;
                if switch > t {
                    break;
                }
                // A negative delay may put the first change before the run.
                excess = value(&current, excess, switch, &mut ok) - following.level;
                current = following;
                next += 1;
            }
            *out = value(&current, excess, t, &mut ok);
        }
        ok
    }

    /// Rows of the run, each with its plateau.
    fn rows(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.plateaus.iter().enumerate().flat_map(|(k, p)| p.rows.clone().map(move |row| (row, k)))
    }

    fn length(&self) -> usize {
        self.plateaus[self.plateaus.len() - 1].rows.end - self.plateaus[0].rows.start
    }

    /// Fits a law to the plateaus that are `used`.
    pub(super) fn fit(&self, law: LagLaw, used: &[bool], measured: bool) -> Option<(LawFit, Vec<f64>)> {
        // The one lag first: what it misses is what the other's prior is weighed against.
        let rough = Problem { bench: self, law: LagLaw::OneLag, used, measured, scale: 0.01 * self.reference };
        let mut best: Option<Solution> = None;
        for (delay_s, tau_s) in STARTS_S {
            let lowest = self.plateaus.iter().map(|p| p.mean).fold(self.reference, f64::min) / self.reference;
            let start = [delay_s, -tau_s.ln(), lowest, 0.5 * (1.0 + lowest) + 0.1, 1.0];
            if let Some(found) = minimize(&rough, &start, LIMITS)
                && best.as_ref().is_none_or(|b| found.sum_of_squares < b.sum_of_squares)
            {
                best = Some(found);
            }
        }
        let rough_solution = best?;
        let scale = rough.scale * self.scatter_of_sums(&rough_solution.residuals, used);
        let problem = Problem { law, scale: scale.max(self.row_noise(used)).max(1e-9 * self.reference), ..rough };
        let mut start = rough_solution.parameters;
        start.extend(law.known().map(|(mean, _)| mean));
        let solution = minimize(&problem, &start, LIMITS)?;
        let p = &solution.parameters;
        let plateaus = used.iter().filter(|&&u| u).count();
        let dof = (plateaus as f64 - p.len() as f64).max(1.0);
        let covariance = self.covariance(&solution, used);
        let estimate = |k: usize| {
            let std = covariance.as_ref().map_or(f64::INFINITY, |c| c[(k, k)].max(0.0).sqrt());
            Estimate { value: p[k], std, dof }
        };
        let rate = estimate(RATE);
        let tau_s = (-rate.value).exp();
        let fit = LawFit {
            law,
            plateaus,
            map: self.powers(&p[MAP..MAP + 3]),
            delay_s: estimate(DELAY),
            time_constant_s: Estimate { value: tau_s, std: tau_s * rate.std, dof },
            drag_share: if law == LagLaw::SpeedDependent { estimate(EXTRA) } else { Estimate::normal(0.0, 0.0) },
            log_down_over_up: if law == LagLaw::PerDirection { estimate(EXTRA) } else { Estimate::normal(0.0, 0.0) },
            // The rate's logarithm is minus that of the time constant.
            up_with_ratio: covariance
                .as_ref()
                .filter(|_| law == LagLaw::PerDirection)
                .map_or(0.0, |c| -c[(RATE, EXTRA)]),
            reference: self.reference,
            fit_percent: self.percent(law, p, measured, used),
        };
        Some((fit, solution.parameters))
    }

    /// The sandwich; `None` where there are too few plateaus for it.
    fn covariance(&self, solution: &Solution, used: &[bool]) -> Option<DMatrix<f64>> {
        let unit = solution.unit_covariance.as_ref()?;
        let parameters = solution.parameters.len();
        let plateaus = used.iter().filter(|&&used| used).count();
        if plateaus < parameters + SPARE {
            return None;
        }
        let mut filling = DMatrix::zeros(parameters, parameters);
        let mut at = 0;
        for (plateau, _) in self.plateaus.iter().zip(used).filter(|(_, used)| **used) {
            let rows = plateau.rows.len();
            let r = DVector::from_column_slice(&solution.residuals[at..at + rows]);
            let g = solution.jacobian.rows(at, rows).tr_mul(&r);
            filling += &g * g.transpose();
            at += rows;
        }
        // So many plateaus, so many parameters that follow them.
        filling *= plateaus as f64 / (plateaus - parameters) as f64;
        // What is known beforehand has unit variance by itself.
        let ties = solution.jacobian.rows(at, TIES);
        filling += ties.tr_mul(&ties);
        Some(unit * filling * unit)
    }

    /// Standard deviation in which residuals of one row count when those of a plateau are much the same.
    fn scatter_of_sums(&self, residuals: &[f64], used: &[bool]) -> f64 {
        let (mut squares, mut at, mut rows) = (0.0, 0, 0);
        for (plateau, _) in self.plateaus.iter().zip(used).filter(|(_, used)| **used) {
            let own = &residuals[at..at + plateau.rows.len()];
            squares += own.iter().sum::<f64>().powi(2);
            rows += own.len();
            at += own.len();
        }
        (squares / rows.max(1) as f64).sqrt()
    }

    /// The same of the noise alone, from the settled rows of each plateau.
    fn row_noise(&self, used: &[bool]) -> f64 {
        let (mut squares, mut rows) = (0.0, 0);
        for (plateau, _) in self.plateaus.iter().zip(used).filter(|(_, used)| **used) {
            squares += plateau.std.powi(2) * plateau.rows.len() as f64;
            rows += plateau.rows.len();
        }
        let color = 2.0 * correlation(self.y, &self.plateaus).iter().sum::<f64>() - 1.0;
        (squares / rows.max(1) as f64 * color.max(1.0)).sqrt()
    }

    pub(super) fn percent(&self, law: LagLaw, p: &[f64], measured: bool, judged: &[bool]) -> f64 {
        let mut simulated = vec![0.0; self.length()];
        if !self.simulate(law, p, measured, &mut simulated) {
            return f64::NEG_INFINITY;
        }
        let first = self.plateaus[0].rows.start;
        let mut kept = Vec::new();
        let mut left = 0.0;
        for (row, _) in self.rows().filter(|&(row, k)| judged[k] && !self.nothing[row]) {
            kept.push(self.y[row]);
            left += (self.y[row] - simulated[row - first]).powi(2);
        }
        percent_when_left(left, spread(&kept))
    }

    pub(super) fn ceiling(&self, judged: &[bool]) -> f64 {
        let mut kept = Vec::new();
        let mut left = 0.0;
        for (row, k) in self.rows().filter(|&(row, k)| judged[k] && !self.nothing[row]) {
            kept.push(self.y[row]);
            left += self.plateaus[k].std.powi(2);
        }
        percent_when_left(left, spread(&kept))
    }
}

/// The residuals of a law on the plateaus that are used.
struct Problem<'a> {
    bench: &'a Bench<'a>,
    law: LagLaw,
    used: &'a [bool],
    measured: bool,
    /// Standard deviation of a residual, response units.
    scale: f64,
}

/// Ties the map's values to the highest level by ten times that level: levels that no used row touches, and all of them where
/// they are measured, have to stay somewhere.
const MAP_TIE: f64 = 0.1;
/// The map's three and that of the share of drag.
const TIES: usize = 4;

impl Residuals for Problem<'_> {
    fn count(&self) -> usize {
        let used = self.bench.plateaus.iter().zip(self.used).filter(|(_, used)| **used);
        used.map(|(p, _)| p.rows.len()).sum::<usize>() + TIES
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        let bench = self.bench;
        let mut simulated = vec![0.0; bench.length()];
        let ok = bench.simulate(self.law, p, self.measured, &mut simulated);
        let first = bench.plateaus[0].rows.start;
        let (rows, ties) = out.split_at_mut(out.len() - TIES);
        for (out, (row, _)) in rows.iter_mut().zip(bench.rows().filter(|&(_, k)| self.used[k])) {
            *out = if bench.nothing[row] { 0.0 } else { (simulated[row - first] - bench.y[row]) / self.scale };
        }
        for (tie, value) in ties.iter_mut().zip(&p[MAP..MAP + 3]) {
            *tie = MAP_TIE * (value - 0.5);
        }
        ties[3] = self.law.known().map_or(0.0, |(mean, std)| (p[EXTRA] - mean) / std);
        ok
    }

    fn typical(&self, index: usize) -> f64 {
        if index == DELAY { 0.01 } else { 1.0 }
    }
}
