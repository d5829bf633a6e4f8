//! The tables of an identification.

use std::f64::consts::TAU;

use rotorlead_answer::{Audience, CellValue, ColumnSpec, Table, Unit, build_table};
use rotorlead_identify::frequency_response::ResponseLine;
use rotorlead_identify::goodness_of_fit::power_over_noise;
use rotorlead_identify::identification::{Identification, Lags};
use rotorlead_identify::lag::chirp::{ChirpIdentification, ChirpResponse};
use rotorlead_identify::lag::multisine::PeriodicIdentification;
use rotorlead_identify::lag::steps::{Branch, Level, StaircaseFit, Step};
use rotorlead_numerics::sample::median;
use rotorlead_plant::Point;
use rotorlead_records::{Excitation, Experiment, Output, Role};

use crate::unit::unit;

/// Below the lags.
const STANDARD_ERRORS: &str =
    "A lag is gain / (tau s + 1), with the dead time where there is one; +- is one standard error, of the noise alone.";
const SECONDS: Unit = Unit::plain("s");

/// The lags: of each nominal command, or of each level of steps, whose points are for programs.
pub(super) fn lags(identified: &Identification, experiment: &Experiment) -> Vec<Table> {
    let points = points_table(&identified.model.points, experiment.output, identified.lags.in_frequency());
    match &identified.lags {
        Lags::Steps(fit) => vec![Table { weight: Audience::Programs, ..points }, levels(fit)],
        Lags::Multisines(found) => {
            vec![Table { notes: vec![STANDARD_ERRORS.to_owned(), held_out(experiment, found)], ..points }]
        }
        Lags::Chirps(found) => {
            vec![Table { notes: [vec![STANDARD_ERRORS.to_owned()], fitted_chirps(found)].concat(), ..points }]
        }
        Lags::Flights(found) => vec![Table { notes: vec![super::flight::basis_of_errors(found)], ..points }],
        Lags::None => vec![Table { weight: Audience::Programs, ..points }],
    }
}

/// The points of a model, with how well the lags of `fitted` explain their lines.
#[must_use]
pub fn points_table(points: &[Point], output: Output, fitted: Option<&PeriodicIdentification>) -> Table {
    let points: Vec<(usize, &Point)> = points.iter().enumerate().collect();
    type Row<'a> = (usize, &'a Point);
    let mut columns = vec![
        ColumnSpec::new("nominal", "u_nom", Unit::DUTY, 3, |(_, point): &Row| point.nominal),
        ColumnSpec::new("gain", "gain", Unit::plain(unit(output)), 4, |(_, point): &Row| {
            CellValue::Estimate(point.gain, point.gain_std)
        }),
        ColumnSpec::new("time_constant_s", "tau", Unit::MILLISECONDS, 2, |(_, point): &Row| {
            CellValue::Estimate(point.time_constant_s, point.time_constant_s_std)
        }),
        ColumnSpec::new("pole_rad_s", "1/tau", Unit::RAD_S, 3, |(_, point): &Row| 1.0 / point.time_constant_s)
            .in_detail(),
        ColumnSpec::new("delay_s", "dead time", Unit::MILLISECONDS, 2, |(_, point): &Row| {
            CellValue::Estimate(point.delay_s, point.delay_s_std)
        }),
        ColumnSpec::new("time_constant_up_s", "tau upward", Unit::MILLISECONDS, 2, |(_, point): &Row| {
            point.time_constant_up_s
        }),
        ColumnSpec::new("time_constant_down_s", "tau downward", Unit::MILLISECONDS, 2, |(_, point): &Row| {
            point.time_constant_down_s
        }),
        ColumnSpec::new("fit_frequency_percent", "fit in frequency", Unit::PERCENT, 2, |(_, point): &Row| {
            point.fit_frequency_percent
        }),
        ColumnSpec::new("fit_square_percent", "fit on squares", Unit::PERCENT, 2, |(_, point): &Row| {
            point.fit_square_percent
        }),
        ColumnSpec::new("fit_step_percent", "fit on steps", Unit::PERCENT, 2, |(_, point): &Row| {
            point.fit_step_percent
        }),
    ];
    if let Some(found) = fitted {
        columns.push(ColumnSpec::new("reduced_chi_square", "chi2 per dof", Unit::NONE, 2, |(index, _): &Row| {
            found.nominals.get(*index).and_then(|one| power_over_noise(one.fit.reduced_chi_square))
        }));
    }
    Table { key: Some("points"), ..build_table("points", "Lag at each nominal command", &columns, &points) }
}

/// Which records each fit is of.
fn held_out(experiment: &Experiment, found: &PeriodicIdentification) -> String {
    let judged = |excitation: Excitation, role: Option<Role>| {
        let records = experiment.records.iter();
        records.filter(|record| record.excitation == excitation && (role.is_none() || record.role == role)).count()
    };
    let squares = judged(Excitation::Square, None);
    let multisines = judged(Excitation::Multisine, Some(Role::Validate));
    let (fitted, all) = (found.fitted_files().count(), experiment.records.len());
    let by_frequency =
        if multisines > 0 { "multisines with role = \"validate\"" } else { "the fitted records themselves" };
    let of_squares = if squares > 0 { "; that on squares is of records that are always held out" } else { "" };
    format!("Fitted: {fitted} of {all} records. The fit in frequency is of {by_frequency}{of_squares}.")
}

/// What lags from chirps are fitted to, and how far the response follows the command in each.
fn fitted_chirps(found: &ChirpIdentification) -> Vec<String> {
    let fitted =
        format!("Fitted by the local polynomial method: {}. The fit is of these records.", found.files.join(", "));
    std::iter::once(fitted).chain(found.responses.iter().filter_map(coherence)).collect()
}

/// The coherence of a chirp over its band, and where it is lowest.
fn coherence(chirp: &ChirpResponse) -> Option<String> {
    let lines = chirp.response.lines.iter().map(|line| line.omega_rad_s / TAU).zip(chirp.coherence.iter().copied());
    let (lowest_hz, lowest) = lines.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let usual = median(chirp.coherence.iter().copied())?;
    let hz = |line: Option<&ResponseLine>| line.map_or(0.0, |line| line.omega_rad_s / TAU);
    let (from_hz, to_hz) = (hz(chirp.response.lines.first()), hz(chirp.response.lines.last()));
    Some(format!(
        "{}: coherence {usual:.3} (median) from {from_hz:.2} to {to_hz:.2} Hz, lowest {lowest:.3} at {lowest_hz:.2} Hz.",
        chirp.file
    ))
}

/// The lag at each level: by the curve, and by the steps to it in both directions.
fn levels(fit: &StaircaseFit) -> Table {
    let interval = |level: &Level| level.time_constant_s.map(|tau| tau.interval_of_logarithm(0.95));
    let of_branch = |branch: &Option<Branch>| {
        branch
            .and_then(|branch| branch.time_constant_s)
            .map_or(CellValue::Unknown("-".into()), |tau| CellValue::Estimate(tau.value, Some(tau.std)))
    };
    let fit_of = |branch: &Option<Branch>| branch.and_then(|branch| branch.fit_percent);
    // In newtons a gain is a few, in revolutions per minute thousands.
    let decimals = if fit.output == Output::Rpm { 0 } else { 3 };
    let columns = [
        ColumnSpec::new("level", "level", Unit::DUTY, 3, |level: &Level| level.command),
        ColumnSpec::new("gain", "gain", Unit::plain(unit(fit.output)), decimals, |level: &Level| {
            level.gain.map(|gain| gain.value)
        }),
        ColumnSpec::new("time_constant_s", "tau", Unit::MILLISECONDS, 1, |level: &Level| {
            level.time_constant_s.map(|tau| tau.value)
        }),
        ColumnSpec::new("lower_s", "from", Unit::MILLISECONDS, 1, move |level: &Level| {
            interval(level).map(|ends| ends.0)
        }),
        ColumnSpec::new("upper_s", "to", Unit::MILLISECONDS, 1, move |level: &Level| {
            interval(level).map(|ends| ends.1)
        }),
        ColumnSpec::new("time_constant_up_s", "tau up", Unit::MILLISECONDS, 1, |level: &Level| of_branch(&level.up)),
        ColumnSpec::new("fit_up_percent", "fit", Unit::PERCENT, 1, |level: &Level| fit_of(&level.up)),
        ColumnSpec::new("time_constant_down_s", "tau down", Unit::MILLISECONDS, 1, |level: &Level| {
            of_branch(&level.down)
        }),
        ColumnSpec::new("fit_down_percent", "fit", Unit::PERCENT, 1, |level: &Level| fit_of(&level.down)),
    ];
    let known = fit.steps.iter().filter(|step| step.time_constant_s().is_some()).count();
    let caption = format!(
        "{}: {known} of {} steps carry a lag. Lag at each level: tau of small motions by the curve through all steps, with its \
         95 % band; tau of the steps to this level",
        fit.record,
        fit.steps.len()
    );
    build_table("levels", caption, &columns, &fit.levels)
}

/// Every step, with its lag or the reason why it has none.
pub(super) fn steps(fit: &StaircaseFit) -> Table {
    let interval = |step: &Step| step.time_constant_s().map(|tau| tau.interval_of_logarithm(0.95));
    let columns = [
        ColumnSpec::new("time_s", "time", SECONDS, 2, |step: &Step| step.at_s),
        ColumnSpec::new("from", "from", Unit::DUTY, 3, |step: &Step| step.from),
        ColumnSpec::new("to", "to", Unit::DUTY, 3, |step: &Step| step.to),
        ColumnSpec::new("time_constant_s", "tau", Unit::MILLISECONDS, 1, |step: &Step| {
            step.time_constant_s().map(|tau| tau.value)
        }),
        ColumnSpec::new("lower_s", "lower", Unit::MILLISECONDS, 1, move |step: &Step| {
            interval(step).map(|ends| ends.0)
        }),
        ColumnSpec::new("upper_s", "upper", Unit::MILLISECONDS, 1, move |step: &Step| {
            interval(step).map(|ends| ends.1)
        }),
        ColumnSpec::new("delay_s", "delay", Unit::MILLISECONDS, 1, |step: &Step| {
            step.time_constant_s().and(step.lag).map(|lag| lag.delay_s)
        }),
        ColumnSpec::words("left_out", "left out because", |step: &Step| {
            step.fault.map(|fault| fault.to_string()).unwrap_or_default()
        }),
    ];
    let caption = "Every step, with 95 % intervals that hold what single steps differ by";
    Table { weight: Audience::Detail, ..build_table("each_step", caption, &columns, &fit.steps) }
}
