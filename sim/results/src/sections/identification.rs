//! The lags that were identified.

use rotorlead_answer::{Cell, Column, Figure, Section, Table};
use rotorlead_identify::static_map::StaticMapFit;
use rotorlead_identify::steps::{Branch, HeldOut, LawComparison, Level, StaircaseFit, Step};
use rotorlead_identify::{Estimate, Identification, Lags, power_over_noise};
use rotorlead_plant::Point;
use rotorlead_records::{Experiment, Output};

use super::estimate;
use crate::distortion::distortion_table;
use crate::figures::etfe::responses;
use crate::figures::static_map::static_map;
use crate::figures::steps::{steps, time_constant_curve};
use crate::unit::unit;

/// The lags as a table, the responses that they were fitted to, and the static map.
#[must_use]
pub fn identification_section(identified: &Identification, experiment: &Experiment) -> Section {
    let output = experiment.output;
    let mut figures: Vec<Figure> =
        identified.lags.in_frequency().and_then(|found| responses(found, output)).into_iter().collect();
    if let Some(fit) = identified.lags.in_time() {
        let record = experiment.records.iter().find(|record| record.file == fit.record);
        figures.extend(record.and_then(|record| steps(fit, record)));
        figures.extend(time_constant_curve(fit));
    }
    figures.extend(identified.static_map.as_ref().map(|(points, fit)| static_map(points, fit, output)));
    let text = vec![
        "At each nominal command the actuator is a first-order lag, response = gain / (tau s + 1), with a dead time where the \
         records show one. ± is one standard error, of the noise alone."
            .to_owned(),
    ];
    Section {
        text,
        tables: identification_tables(identified, output),
        figures,
        ..Section::new("identification", "Identified lags")
    }
}

/// The lags, the distortion where the records show it, and the static map.
#[must_use]
pub fn identification_tables(identified: &Identification, output: Output) -> Vec<Table> {
    let mut tables = vec![match &identified.lags {
        Lags::Steps(fit) => levels(fit),
        Lags::Multisines(_) | Lags::Chirps(_) | Lags::None => lags(identified, output),
    }];
    tables.extend(identified.lags.in_time().map(steps_table));
    tables.extend(identified.lags.in_frequency().and_then(distortion_table));
    tables.extend(identified.static_map.as_ref().map(|(_, fit)| coefficients(fit, output)));
    tables
}

/// The lag at each level: by the curve, and by the steps to it in both directions.
fn levels(fit: &StaircaseFit) -> Table {
    let row = |level: &Level| {
        let milliseconds = |tau: Option<f64>| Cell::optional(tau.map(|tau| 1e3 * tau), 1);
        let interval = level.time_constant_s.map(|tau| tau.interval_of_logarithm(0.95));
        let branch = |branch: &Option<Branch>| {
            let tau = branch.and_then(|branch| branch.time_constant_s);
            let tau = tau.map_or_else(|| Cell::unknown("-"), |tau| estimate(tau.value, Some(tau.std), 1e3, 1));
            [tau, Cell::optional(branch.and_then(|branch| branch.fit_percent), 1)]
        };
        let mut row = vec![
            Cell::number(level.command, 3),
            Cell::optional(level.gain.map(|gain| gain.value), gain_decimals(fit.output)),
            milliseconds(level.time_constant_s.map(|tau| tau.value)),
            milliseconds(interval.map(|interval| interval.0)),
            milliseconds(interval.map(|interval| interval.1)),
        ];
        row.extend(branch(&level.up));
        row.extend(branch(&level.down));
        row
    };
    Table {
        name: "table_1".to_owned(),
        caption: "Lag at each level: tau of small motions by the curve through all steps, with its 95 % band; tau of the steps \
                  to this level"
            .to_owned(),
        columns: vec![
            Column::new("u_nom", "level", "duty"),
            Column::new("gain", "gain", unit(fit.output)),
            Column::new("time_constant_ms", "tau", "ms"),
            Column::new("lower", "from", "ms"),
            Column::new("upper", "to", "ms"),
            Column::new("time_constant_up_ms", "tau up", "ms"),
            Column::new("fit_up_percent", "fit", "%"),
            Column::new("time_constant_down_ms", "tau down", "ms"),
            Column::new("fit_down_percent", "fit", "%"),
        ],
        rows: fit.levels.iter().map(row).collect(),
    }
}

/// Decimals of a gain: in newtons it is a few, in revolutions per minute thousands.
fn gain_decimals(output: Output) -> usize {
    if output == Output::Rpm { 0 } else { 3 }
}

/// Every step, with its lag or the reason why it has none.
#[must_use]
pub fn steps_table(fit: &StaircaseFit) -> Table {
    let row = |step: &Step| {
        let tau = step.time_constant_s();
        let interval = tau.map(|tau| tau.interval_of_logarithm(0.95));
        let milliseconds = |value: Option<f64>| Cell::optional(value.map(|value| 1e3 * value), 1);
        vec![
            Cell::number(step.at_s, 2),
            Cell::number(step.from, 3),
            Cell::number(step.to, 3),
            milliseconds(tau.map(|tau| tau.value)),
            milliseconds(interval.map(|interval| interval.0)),
            milliseconds(interval.map(|interval| interval.1)),
            milliseconds(tau.and(step.lag).map(|lag| lag.delay_s)),
            Cell::text(step.fault.map(|fault| fault.to_string()).unwrap_or_default()),
        ]
    };
    Table {
        name: "each_step".to_owned(),
        caption: "Every step, with 95 % intervals that hold what single steps differ by".to_owned(),
        columns: vec![
            Column::new("time_s", "time", "s"),
            Column::new("from", "from", "duty"),
            Column::new("to", "to", "duty"),
            Column::new("time_constant_ms", "tau", "ms"),
            Column::new("lower", "lower", "ms"),
            Column::new("upper", "upper", "ms"),
            Column::new("delay_ms", "delay", "ms"),
            Column::new("left_out", "left out because", ""),
        ],
        rows: fit.steps.iter().map(row).collect(),
    }
}

/// The polynomial of the static map.
fn coefficients(fit: &StaticMapFit, output: Output) -> Table {
    let decimals = if output == Output::Rpm { 1 } else { 4 };
    let row = |(power, coefficient): (usize, &Estimate)| {
        let (low, high) = coefficient.interval(0.95);
        let numbers = [coefficient.value, low, high].map(|value| Cell::number(value, decimals));
        std::iter::once(Cell::text(format!("u^{power}"))).chain(numbers).collect()
    };
    Table {
        name: "static_map".to_owned(),
        caption: format!(
            "Static map over commands {:.3} to {:.3}: degree {} by F-test at 0.5 %, {} steady points, 95 % intervals",
            fit.range.0,
            fit.range.1,
            fit.degree(),
            fit.points
        ),
        columns: vec![
            Column::new("term", "term", ""),
            Column::new("coefficient", "coefficient", unit(output)),
            Column::new("lower", "from", unit(output)),
            Column::new("upper", "to", unit(output)),
        ],
        rows: fit.coefficients.iter().enumerate().map(row).collect(),
    }
}

/// Both laws of a lag on steps: those that they were fitted to, and those that they have not seen.
#[must_use]
pub fn laws_table(found: &LawComparison) -> Table {
    let all = vec![
        Cell::text("all -> all"),
        Cell::number(found.one_lag.fit_percent, 2),
        Cell::number(found.speed_dependent.fit_percent, 2),
        Cell::number(found.ceiling_percent, 2),
        Cell::text("-"),
        Cell::text("-"),
    ];
    let row = |split: &HeldOut| {
        let numbers = [
            split.one_lag_percent,
            split.speed_dependent_percent,
            split.ceiling_percent,
            split.one_lag_on_measured_levels_percent,
            split.speed_dependent_on_measured_levels_percent,
        ];
        let numbers = numbers.map(|percent| Cell::number(percent, 2));
        std::iter::once(Cell::text(split.split.words())).chain(numbers).collect()
    };
    Table {
        name: "laws".to_owned(),
        caption: "Fit of the whole run, one quadratic static map, no step adjusted by itself".to_owned(),
        columns: vec![
            Column::new("split", "fitted on -> judged on", ""),
            Column::new("one_lag_percent", "one lag", "%"),
            Column::new("speed_dependent_percent", "speed-dep.", "%"),
            Column::new("ceiling_percent", "ceiling", "%"),
            Column::new("one_lag_on_measured_levels_percent", "one lag, measured levels", "%"),
            Column::new("speed_dependent_on_measured_levels_percent", "speed-dep., measured levels", "%"),
        ],
        rows: std::iter::once(all).chain(found.held_out.iter().map(row)).collect(),
    }
}

fn lags(identified: &Identification, output: Output) -> Table {
    let points = &identified.model.points;
    let both_ways = points.iter().any(|point| point.time_constant_up_s.is_some());
    let mut columns = vec![
        Column::new("u_nom", "u_nom", "duty"),
        Column::new("gain", "gain", unit(output)),
        Column::new("time_constant_ms", "tau", "ms"),
        Column::new("pole_rad_s", "1/tau", "rad/s"),
        Column::new("delay_ms", "dead time", "ms"),
    ];
    if both_ways {
        columns.push(Column::new("time_constant_up_ms", "tau upward", "ms"));
        columns.push(Column::new("time_constant_down_ms", "tau downward", "ms"));
    }
    columns.push(Column::new("fit_frequency_percent", "fit in frequency", "%"));
    columns.push(Column::new("fit_square_percent", "fit on squares", "%"));
    if identified.lags.in_frequency().is_some() {
        columns.push(Column::new("reduced_chi_square", "chi2 per dof", ""));
    }
    let row = |(index, point): (usize, &Point)| {
        let delay = match point.delay_s_std {
            Some(std) => estimate(point.delay_s, Some(std), 1e3, 2),
            None if point.delay_s == 0.0 => Cell::unknown("-"),
            None => Cell::number(1e3 * point.delay_s, 2),
        };
        let mut row = vec![
            Cell::number(point.nominal, 3),
            estimate(point.gain, point.gain_std, 1.0, 4),
            estimate(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
            Cell::number(1.0 / point.time_constant_s, 3),
            delay,
        ];
        if both_ways {
            for tau in [point.time_constant_up_s, point.time_constant_down_s] {
                row.push(Cell::optional(tau.map(|tau| 1e3 * tau), 2));
            }
        }
        row.push(Cell::optional(point.fit_frequency_percent, 2));
        row.push(Cell::optional(point.fit_square_percent, 2));
        if let Some(found) = identified.lags.in_frequency() {
            let nominal = found.nominals.get(index);
            row.push(Cell::optional(nominal.and_then(|one| power_over_noise(one.fit.reduced_chi_square)), 2));
        }
        row
    };
    Table {
        name: "table_1".to_owned(),
        caption: "Lag at each nominal command".to_owned(),
        columns,
        rows: points.iter().enumerate().map(row).collect(),
    }
}
