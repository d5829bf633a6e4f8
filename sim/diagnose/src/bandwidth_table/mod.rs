//! The diagnosis from a table of bandwidths alone, such as the paper's Table 3.
//!
//! One number per nominal command and column is little: there is no noise estimate beside it, and a calibration with a number
//! at each nominal command reproduces its column whatever it means. So numbers are calibrated on one column, the other one is
//! only predicted, and every explanation that the fitted column leaves standing is listed with its prediction.

mod case;
mod choose;
mod explanation;
mod extend;
mod free_parameter;
mod likelihood;
mod low_frequency_gain;
mod next;
mod table;

pub use explanation::{Explanation, RuledOut, Scope, Standing};
pub use table::{BandwidthRow, BandwidthTable, Column};

use rayon::prelude::*;
use rotorlead::design::LeadParameters;
use rotorlead_plant::effect::{Kind, Shows};
use rotorlead_plant::{Catalog, Model};

use case::Case;
use likelihood::Likelihood;

use super::{DiagnoseError, Verdict};

/// Effects that leave no more than this share of the chi-square are the whole story.
const WHOLE: f64 = 0.05;
/// Those that leave more than this share are no story at all.
const NONE: f64 = 0.4;

/// How it is done.
#[derive(Clone, Copy, Debug)]
pub struct BandwidthOptions<'a> {
    /// The compensator in front of the compensated actuator.
    pub lead: &'a LeadParameters,
    /// The column that numbers are fitted to; the other one is held out.
    pub fitted: Column,
    /// Relative standard error of a measured bandwidth, above zero, where it is known.
    pub accuracy: Option<f64>,
    /// Name of the explanation to take, in place of the one that the rules choose.
    pub take: Option<&'a str>,
    /// The kinds that may explain the gap.
    pub catalog: &'a Catalog,
}

/// A part of the gap: of the sum of squares of `ln(measured / simulated)` over both columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Bandwidth that the model as it was given has, rad/s.
    pub simulated_rad_s: f64,
    /// Measured over simulated; `None` where nothing was measured.
    pub ratio: Option<f64>,
    /// Its share of the gap, 0..1.
    pub share: f64,
}

/// RMS of `ln(measured / simulated)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandwidthGap {
    /// With the model as it was given.
    pub before: f64,
    /// With the explanation.
    pub after: f64,
}

/// All that was found.
#[derive(Clone, Debug)]
pub struct BandwidthDiagnosis {
    /// In a word: about the held-out column, or the fitted one where nothing is held out.
    pub verdict: Verdict,
    /// The table.
    pub table: BandwidthTable,
    /// The column that numbers were fitted to.
    pub fitted: Column,
    /// Where the gap lies: for each row, without and with compensator.
    pub parts: Vec<[Part; 2]>,
    /// The explanations in the order of the catalog, for one number and then for one at each nominal command.
    pub explanations: Vec<Explanation>,
    /// Kinds that cannot be.
    pub ruled_out: Vec<RuledOut>,
    /// Place of the explanation that was chosen; `None` where the model agrees, or nothing moves it nearer.
    pub chosen: Option<usize>,
    /// Whether it was asked for.
    pub is_asked_for: bool,
    /// Whether there is a row with both bandwidths, so that something is held out.
    pub held_out: bool,
    /// The gap on what was held out, over rows with both bandwidths; where nothing is, on what was fitted.
    pub gap: BandwidthGap,
    /// The same over the fitted column.
    pub fitted_gap: BandwidthGap,
    /// The known relative standard error.
    pub accuracy: Option<f64>,
    /// The experiment that would separate the explanations; `None` where model and measurement agree.
    pub next_experiment: Option<String>,
    /// The model as it was given.
    base: Model,
}

/// Compares the table with the model, and looks for what explains the difference.
///
/// # Errors
/// [`DiagnoseError`] when the model is impossible, says nothing of a nominal command of the table or has no bandwidth there,
/// and when there is no explanation of the name to take.
pub fn diagnose_bandwidths(
    table: &BandwidthTable,
    model: &Model,
    options: &BandwidthOptions,
) -> Result<BandwidthDiagnosis, DiagnoseError> {
    let case = Case::new(table, model, options.lead, options.fitted)?;
    let squares = |column: Column| case.rows.iter().filter_map(move |row| row.gap(column)).map(|gap| gap * gap);
    let total: f64 = Column::ALL.into_iter().flat_map(squares).sum();
    let before: f64 = squares(options.fitted).sum();
    let count = case.fitted_rows().count();
    let likelihood = Likelihood { accuracy: options.accuracy, count, before };
    let all = Column::ALL.map(|column| squares(column).count()).iter().sum();
    let agrees = likelihood.agrees(total, all) && likelihood.agrees(before, count);

    let (mut explanations, mut ruled_out) = (Vec::new(), Vec::new());
    if !agrees || options.take.is_some() {
        let kinds = kinds(options.catalog);
        let found: Vec<_> = kinds.par_iter().map(|kind| explanation::explanations(&case, &likelihood, kind)).collect();
        for found in found {
            match found {
                Ok(found) => explanations.extend(found),
                Err(reason) => ruled_out.push(reason),
            }
        }
    }
    // One number for all comes first, in the table as in the choice.
    explanations.sort_by_key(|one| one.scope == Scope::Each);
    let chosen = choose::choose(&mut explanations, &likelihood, options.take);
    if let (Some(name), None) = (options.take, chosen) {
        let known = explanations.iter().map(Explanation::name).collect();
        return Err(DiagnoseError::NoSuchExplanation { name: name.to_owned(), known });
    }
    let chosen_one = chosen.map(|place| &explanations[place]);

    let rms = |sum: f64, count: usize| (sum / count.max(1) as f64).sqrt();
    let held_out_rows = case.held_out_rows().count();
    let held_out_before: f64 =
        case.held_out_rows().filter_map(|(_, row)| row.gap(options.fitted.other())).map(|gap| gap * gap).sum();
    let fitted_before = rms(before, count);
    let fitted_gap =
        BandwidthGap { before: fitted_before, after: chosen_one.map_or(fitted_before, |one| one.fitted_rms) };
    let gap = if held_out_rows > 0 {
        let before = rms(held_out_before, held_out_rows);
        // A bandwidth that is gone is no prediction.
        BandwidthGap { before, after: chosen_one.map_or(before, |one| one.held_out_rms.unwrap_or(f64::INFINITY)) }
    } else {
        fitted_gap
    };
    let verdict = match chosen_one {
        _ if agrees => Verdict::Agrees,
        Some(one) => evaluated(&likelihood, one, gap, held_out_rows),
        None => Verdict::Unknown,
    };
    let parts = case.rows.iter().map(|row| {
        Column::ALL.map(|column| Part {
            simulated_rad_s: row.simulated[column as usize],
            ratio: row.gap(column).map(f64::exp),
            share: if total > 0.0 { row.gap(column).map_or(0.0, |gap| gap * gap) / total } else { 0.0 },
        })
    });
    Ok(BandwidthDiagnosis {
        verdict,
        parts: parts.collect(),
        next_experiment: (!agrees).then(|| next::next_experiment(&case, &explanations)),
        table: table.clone(),
        fitted: options.fitted,
        explanations,
        ruled_out,
        chosen,
        is_asked_for: options.take.is_some(),
        held_out: held_out_rows > 0,
        gap,
        fitted_gap,
        accuracy: options.accuracy,
        base: model.clone(),
    })
}

impl BandwidthDiagnosis {
    /// The explanation that was chosen, where the held-out column does not speak against it, or where it was asked for.
    #[must_use]
    pub fn named(&self) -> Option<&Explanation> {
        let stands = matches!(self.verdict, Verdict::Named | Verdict::PartlyNamed) || self.is_asked_for;
        self.chosen.filter(|_| stands).map(|place| &self.explanations[place])
    }

    /// Kinds that the fitted column cannot tell from the one that is named, in the order of the explanations.
    #[must_use]
    pub fn alternatives(&self) -> Vec<&'static Kind> {
        let mut kinds: Vec<&'static Kind> = Vec::new();
        let named = self.named().map(|one| one.kind);
        for one in self.explanations.iter().filter(|one| one.standing == Standing::Alternative) {
            if Some(one.kind) != named && !kinds.contains(&one.kind) {
                kinds.push(one.kind);
            }
        }
        kinds
    }

    /// The model with what is named; as it was given where nothing is.
    ///
    /// # Errors
    /// [`DiagnoseError::NotInAModel`] where a model has no form for it.
    pub fn model(&self) -> Result<Model, DiagnoseError> {
        self.named().map_or_else(|| Ok(self.base.clone()), |one| extend::extended(&self.base, &self.table, one))
    }
}

/// What of the catalog shows around single commands, and behind the numbers of the lag what is as simple: another static gain.
fn kinds(catalog: &Catalog) -> Vec<&'static Kind> {
    let shown = |kind: &&Kind| kind.shows != Shows::OverLevels;
    let mut kinds: Vec<&'static Kind> = catalog.kinds().filter(shown).collect();
    let place = kinds.partition_point(|kind| kind.site == rotorlead_plant::effect::Site::Base);
    kinds.insert(place, &low_frequency_gain::KIND);
    kinds
}

/// What the held-out column says of an explanation; the fitted one, where nothing is held out and there are fewer numbers than
/// data.
fn evaluated(likelihood: &Likelihood, one: &Explanation, gap: BandwidthGap, held_out: usize) -> Verdict {
    if held_out == 0 && one.scope == Scope::Each {
        return Verdict::Unknown;
    }
    let left = (gap.after / gap.before).powi(2);
    let (count, numbers) = if held_out > 0 { (held_out, 0) } else { (likelihood.count, one.numbers) };
    let is_noise = likelihood.is_noise(gap.after.powi(2) * count as f64, count, numbers).unwrap_or(false);
    match left {
        _ if is_noise => Verdict::Named,
        left if left < WHOLE => Verdict::Named,
        left if left < NONE => Verdict::PartlyNamed,
        _ => Verdict::Unknown,
    }
}
