//! A lag whose time constant depends on the speed, beside one that does not, and how both do on steps that they have not seen.
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
//! then no evidence for or against drag.
//!
//! # Splits
//! [`SPLITS`], fixed before anything was fitted: rows belong to the step that they follow, up to the next one.
//!
//! | split | fitted on | judged on |
//! |---|---|---|
//! | up to down | rows after steps up | rows after steps down |
//! | down to up | rows after steps down | rows after steps up |
//! | even to odd | rows on every other level, from the lowest on | the other levels |
//! | odd to even | the other levels | every other level, from the lowest on |

use nalgebra::{DMatrix, DVector};

use super::plateaus::{Direction, Plateau, SAME_LEVEL, mean_and_std};
use super::response::{Stretch, value};
use super::{Run, StepsError};
use crate::identify::Estimate;
use crate::identify::fit_percent::{percent_when_left, spread};
use crate::identify::least_squares::{Limits, Residuals, Solution, minimize};
use crate::record::{Output, Record};

/// Which law the lag follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LagLaw {
    /// One time constant for all levels.
    OneLag,
    /// `1/tau = b + 2 c W`.
    SpeedDependent,
}

/// A way of cutting a record in two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Fitted on steps up, judged on steps down.
    UpToDown,
    /// Fitted on steps down, judged on steps up.
    DownToUp,
    /// Fitted on every other level from the lowest on, judged on the others.
    EvenToOdd,
    /// The other way round.
    OddToEven,
}

/// All of them.
pub const SPLITS: [Split; 4] = [Split::UpToDown, Split::DownToUp, Split::EvenToOdd, Split::OddToEven];

/// Both laws on one split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// The split.
    pub split: Split,
    /// % fit of the one lag on the rows that it has not seen.
    pub one_lag_percent: f64,
    /// % fit of the lag that depends on the speed.
    pub speed_dependent_percent: f64,
    /// What a perfect model would score there: noise about the plateaus' means is then left.
    pub ceiling_percent: f64,
    /// What the one lag would score had it the mean of every plateau, those that it has not seen included: what is missing
    /// to the ceiling is the dynamics', the rest is the static map's.
    pub one_lag_on_measured_levels_percent: f64,
    /// The same of the lag that depends on the speed.
    pub speed_dependent_on_measured_levels_percent: f64,
}

/// A fitted law.
#[derive(Clone, Debug, PartialEq)]
pub struct LawFit {
    /// The law.
    pub law: LagLaw,
    /// `W` in powers of the command, from the constant on, response units.
    pub map: [f64; 3],
    /// Delay as logged, seconds.
    pub delay_s: Estimate,
    /// Time constant at [`Self::reference`], seconds; use [`Estimate::interval_of_logarithm`].
    pub time_constant_s: Estimate,
    /// `k`: which share of the rate at [`Self::reference`] is drag's. 0 for the one lag.
    pub drag_share: Estimate,
    /// The highest level, response units.
    pub reference: f64,
    /// % fit on the rows that it was fitted to.
    pub fit_percent: f64,
}

/// Both laws on a record.
#[derive(Clone, Debug, PartialEq)]
pub struct LawComparison {
    /// The one lag, fitted to all steps.
    pub one_lag: LawFit,
    /// The lag that depends on the speed, fitted to all steps.
    pub speed_dependent: LawFit,
    /// What a perfect model would score on all steps.
    pub ceiling_percent: f64,
    /// Both on steps that they have not seen; splits that a record has too few steps for are not there.
    pub held_out: Vec<HeldOut>,
    /// RMS over the levels that were reached from both sides of the difference between the two means, relative to the mean
    /// of both; `None` without any. No function of the command has both.
    pub up_down_difference: Option<f64>,
}

impl Split {
    /// What it is fitted on and judged on, in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::UpToDown => "steps up -> steps down",
            Self::DownToUp => "steps down -> steps up",
            Self::EvenToOdd => "even -> odd levels",
            Self::OddToEven => "odd -> even levels",
        }
    }

    /// Whether the rows of a plateau are fitted.
    fn fits(self, plateau: &Plateau, level: usize) -> bool {
        let up = plateau.direction != Some(Direction::Down);
        match self {
            Self::UpToDown => up,
            Self::DownToUp => !up,
            Self::EvenToOdd => level.is_multiple_of(2),
            Self::OddToEven => !level.is_multiple_of(2),
        }
    }
}

impl LawFit {
    /// Time constant of small motions about a steady response, seconds.
    #[must_use]
    pub fn time_constant_at(&self, response: f64) -> f64 {
        let k = self.drag_share.value;
        self.time_constant_s.value / (1.0 - k + k * response / self.reference)
    }
}

/// Fits both laws to all steps of a record, and to each part of each split.
///
/// # Errors
/// [`StepsError`] when the motor runs steadily on no two plateaus in a row, or the fit to all steps does not converge.
pub fn compare_laws(record: &Record, output: Output) -> Result<LawComparison, StepsError> {
    let run = Run::of(record, output)?;
    let bench = Bench::of(record, &run);
    let all = bench.shows.clone();
    let not_converged = || StepsError::NotConverged { record: record.file.clone(), iterations: LIMITS.iterations };
    let (one_lag, _) = bench.fit(LagLaw::OneLag, &all, false).ok_or_else(not_converged)?;
    let (speed_dependent, _) = bench.fit(LagLaw::SpeedDependent, &all, false).ok_or_else(not_converged)?;
    let held_out = SPLITS.into_iter().filter_map(|split| bench.held_out(split)).collect();
    Ok(LawComparison {
        one_lag,
        speed_dependent,
        ceiling_percent: bench.ceiling(&all),
        held_out,
        up_down_difference: bench.up_down_difference(),
    })
}

/// Indices of the parameters: delay, logarithm of the rate at the highest level, the map at the lowest, middle and highest
/// command in units of the highest level, and the share of drag.
const DELAY: usize = 0;
const RATE: usize = 1;
const MAP: usize = 2;
const DRAG: usize = 5;
/// Mean and standard deviation of what is known of the share of drag beforehand.
const DRAG_KNOWN: (f64, f64) = (0.5, 0.29);
/// As in the fit of single steps: rows that a change passes leave a search zigzagging.
const LIMITS: Limits = Limits { iterations: 200, decrease: 1e-7 };
/// Delays beyond this are not searched, seconds.
const MAX_DELAY_S: f64 = 0.3;
/// Delays and time constants to begin with, seconds.
const STARTS_S: [(f64, f64); 3] = [(0.0, 0.035), (0.025, 0.035), (0.005, 0.09)];

/// A run with what the fits need of it.
struct Bench<'a> {
    time_s: &'a [f64],
    y: &'a [f64],
    spike: &'a [bool],
    /// The first one from its settled rows on: what comes before may still be on its way there.
    plateaus: Vec<Plateau>,
    /// Whether the motor's own response shows on a plateau.
    shows: Vec<bool>,
    /// Rank of each plateau's command among the levels.
    level: Vec<usize>,
    low: f64,
    high: f64,
    reference: f64,
}

impl<'a> Bench<'a> {
    fn of(record: &'a Record, run: &'a Run) -> Self {
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
            spike: &run.spike,
            plateaus,
            shows: (0..run.plateaus.len()).map(|k| run.shows(k)).collect(),
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
        let k = if law == LagLaw::OneLag { 0.0 } else { p[DRAG] };
        let rate = p[RATE].exp();
        let first = self.plateaus[0].rows.start;
        let mut ok = p[DELAY].abs() < MAX_DELAY_S && rate.is_finite();
        // Each stretch with its own bend.
        let stretch = |plateau: &Plateau| {
            let u = plateau.command;
            let level = if measured { plateau.mean } else { map[0] + u * (map[1] + u * map[2]) };
            let relative = 1.0 - k + k * level / self.reference;
            let tau = 1.0 / (rate * relative);
            let bend = 0.5 * k * rate / self.reference * level * tau;
            (Stretch { from_s: self.time_s[plateau.rows.start], level, time_constant_s: tau, delay_s: p[DELAY] }, bend)
        };
        let (mut current, mut bend) = stretch(&self.plateaus[0]);
        let mut excess = 0.0;
        let mut next = 1;
        for (out, &t) in out.iter_mut().zip(&self.time_s[first..]) {
            while let Some(plateau) = self.plateaus.get(next) {
                let (following, its_bend) = stretch(plateau);
                let switch = following.from_s + following.delay_s;
                if switch > t {
                    break;
                }
                // A negative delay may put the first change before the run.
                let before = value(&current, bend, excess, switch, &mut ok);
                excess = before - following.level;
                (current, bend) = (following, its_bend);
                next += 1;
            }
            *out = value(&current, bend, excess, t, &mut ok);
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
    fn fit(&self, law: LagLaw, used: &[bool], measured: bool) -> Option<(LawFit, Vec<f64>)> {
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
        let problem = Problem { law, scale: scale.max(1e-9 * self.reference), ..rough };
        let mut start = rough_solution.parameters;
        if law == LagLaw::SpeedDependent {
            start.push(DRAG_KNOWN.0);
        }
        let solution = minimize(&problem, &start, LIMITS)?;
        let p = &solution.parameters;
        let dof = (used.iter().filter(|&&u| u).count() as f64 - p.len() as f64).max(1.0);
        let covariance = self.covariance(&solution, used);
        let estimate = |k: usize| {
            let std = covariance.as_ref().map_or(f64::INFINITY, |c| c[(k, k)].max(0.0).sqrt());
            Estimate { value: p[k], std, dof }
        };
        let rate = estimate(RATE);
        let tau_s = (-rate.value).exp();
        let fit = LawFit {
            law,
            map: self.powers(&p[MAP..MAP + 3]),
            delay_s: estimate(DELAY),
            time_constant_s: Estimate { value: tau_s, std: tau_s * rate.std, dof },
            drag_share: if law == LagLaw::OneLag { Estimate::normal(0.0, 0.0) } else { estimate(DRAG) },
            reference: self.reference,
            fit_percent: self.percent(law, p, measured, used),
        };
        Some((fit, solution.parameters))
    }

    /// The sandwich; as if residuals were white in units of their sums where there are too few plateaus for it.
    fn covariance(&self, solution: &Solution, used: &[bool]) -> Option<DMatrix<f64>> {
        let unit = solution.unit_covariance.as_ref()?;
        let parameters = solution.parameters.len();
        let plateaus = used.iter().filter(|&&used| used).count();
        if plateaus < parameters + 2 {
            return Some(unit.clone());
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

    fn percent(&self, law: LagLaw, p: &[f64], measured: bool, judged: &[bool]) -> f64 {
        let mut simulated = vec![0.0; self.length()];
        if !self.simulate(law, p, measured, &mut simulated) {
            return f64::NEG_INFINITY;
        }
        let first = self.plateaus[0].rows.start;
        let mut kept = Vec::new();
        let mut left = 0.0;
        for (row, _) in self.rows().filter(|&(row, k)| judged[k] && !self.spike[row]) {
            kept.push(self.y[row]);
            left += (self.y[row] - simulated[row - first]).powi(2);
        }
        percent_when_left(left, spread(&kept))
    }

    fn ceiling(&self, judged: &[bool]) -> f64 {
        let mut kept = Vec::new();
        let mut left = 0.0;
        for (row, k) in self.rows().filter(|&(row, k)| judged[k] && !self.spike[row]) {
            kept.push(self.y[row]);
            left += self.plateaus[k].std.powi(2);
        }
        percent_when_left(left, spread(&kept))
    }

    /// Both laws on a split; `None` where one part has fewer than two plateaus.
    fn held_out(&self, split: Split) -> Option<HeldOut> {
        let fits: Vec<bool> = self.plateaus.iter().zip(&self.level).map(|(p, &level)| split.fits(p, level)).collect();
        let used: Vec<bool> = fits.iter().zip(&self.shows).map(|(&fits, &shows)| fits && shows).collect();
        let judged: Vec<bool> = fits.iter().zip(&self.shows).map(|(&fits, &shows)| !fits && shows).collect();
        if used.iter().filter(|&&u| u).count() < 2 || judged.iter().filter(|&&u| u).count() < 2 {
            return None;
        }
        let score = |law, measured| {
            let (_, p) = self.fit(law, &used, measured)?;
            Some(self.percent(law, &p, measured, &judged))
        };
        Some(HeldOut {
            split,
            one_lag_percent: score(LagLaw::OneLag, false)?,
            speed_dependent_percent: score(LagLaw::SpeedDependent, false)?,
            ceiling_percent: self.ceiling(&judged),
            one_lag_on_measured_levels_percent: score(LagLaw::OneLag, true)?,
            speed_dependent_on_measured_levels_percent: score(LagLaw::SpeedDependent, true)?,
        })
    }

    fn up_down_difference(&self) -> Option<f64> {
        let mut squares = Vec::new();
        for down in self.plateaus.iter().filter(|p| p.direction == Some(Direction::Down)) {
            let same =
                |p: &&Plateau| p.direction != Some(Direction::Down) && (p.command - down.command).abs() <= SAME_LEVEL;
            if let Some(up) = self.plateaus.iter().find(same) {
                squares.push(((up.mean - down.mean) / (0.5 * (up.mean + down.mean))).powi(2));
            }
        }
        (!squares.is_empty()).then(|| mean_and_std(&squares).0.sqrt())
    }
}

/// The misfit of a law on the plateaus that are used.
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
            *out = if bench.spike[row] { 0.0 } else { (simulated[row - first] - bench.y[row]) / self.scale };
        }
        for (tie, value) in ties.iter_mut().zip(&p[MAP..MAP + 3]) {
            *tie = MAP_TIE * (value - 0.5);
        }
        ties[3] = p.get(DRAG).map_or(0.0, |k| (k - DRAG_KNOWN.0) / DRAG_KNOWN.1);
        ok
    }

    fn typical(&self, index: usize) -> f64 {
        if index == DELAY { 0.01 } else { 1.0 }
    }
}
