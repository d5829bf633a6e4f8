//! Both laws on steps that they have not seen.
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

use rotorlead_numerics::sample::mean;
use rotorlead_records::{Output, Record};
use serde::{Serialize, Serializer};

use super::law::{Bench, LIMITS, LagLaw, LawFit};
use super::plateaus::{Direction, Plateau, SAME_LEVEL};
use super::{Run, StepsError};

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

impl Serialize for Split {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.words())
    }
}

/// All of them.
pub const SPLITS: [Split; 4] = [Split::UpToDown, Split::DownToUp, Split::EvenToOdd, Split::OddToEven];

/// Both laws on one split.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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

/// Both laws on a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawComparison {
    /// The one lag, fitted to all steps.
    pub one_lag: LawFit,
    /// One lag up and another down, fitted to all steps.
    pub per_direction: LawFit,
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
    pub fn fits(self, plateau: &Plateau, level: usize) -> bool {
        let up = plateau.direction != Some(Direction::Down);
        match self {
            Self::UpToDown => up,
            Self::DownToUp => !up,
            Self::EvenToOdd => level.is_multiple_of(2),
            Self::OddToEven => !level.is_multiple_of(2),
        }
    }
}

/// Rows of a run that are compared; further ones take their time and say the same again.
const MOST_ROWS: usize = 30_000;
/// Plateaus that are compared, however long they are.
const FEWEST_PLATEAUS: usize = 12;

/// Fits all laws to the steps of a record's longest run, and to each part of each split: of a long one to those of its first
/// 30 000 rows.
///
/// # Errors
/// [`StepsError`] when the motor runs steadily on no two plateaus in a row, or the fit to all steps does not converge.
pub fn compare_laws(record: &Record, output: Output) -> Result<LawComparison, StepsError> {
    let mut run = Run::of(record, output)?;
    let first = run.rows().start;
    let within = run.plateaus.partition_point(|plateau| plateau.rows.end - first <= MOST_ROWS);
    run.plateaus.truncate(within.max(FEWEST_PLATEAUS));
    let bench = Bench::of(record, &run);
    let all = bench.shows.clone();
    let not_converged = || StepsError::NotConverged { record: record.file.clone(), iterations: LIMITS.iterations };
    let (one_lag, _) = bench.fit(LagLaw::OneLag, &all, false).ok_or_else(not_converged)?;
    let (per_direction, _) = bench.fit(LagLaw::PerDirection, &all, false).ok_or_else(not_converged)?;
    let (speed_dependent, _) = bench.fit(LagLaw::SpeedDependent, &all, false).ok_or_else(not_converged)?;
    let held_out = SPLITS.into_iter().filter_map(|split| bench.held_out(split)).collect();
    Ok(LawComparison {
        one_lag,
        per_direction,
        speed_dependent,
        ceiling_percent: bench.ceiling(&all),
        held_out,
        up_down_difference: bench.up_down_difference(),
    })
}

impl Bench<'_> {
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
        (!squares.is_empty()).then(|| mean(&squares).sqrt())
    }
}
