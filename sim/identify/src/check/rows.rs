//! The rows of one record against what its experiment says.

use miette::Diagnostic;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::Point;
use rotorlead_records::{Excitation, Experiment, Finding, NOMINAL_TOLERANCE, Record, Severity, Topic};

use super::RecordFault;
use super::period::check_period;
use super::repeats::check_repeats;
use super::units::{check_command_unit, check_response_unit, check_time_unit};
use crate::error::IdentifyError;
use crate::lag::multisine::IdentifyWarning;
use crate::lag::multisine::plausibility;
use crate::rows::clipping;
use crate::rows::clipping::ClippingLimit;
use crate::rows::even;
use crate::rows::gaps::{rows_after_gaps, usual_interval_s};

/// Rows a second below which no motor's lag is seen. Chosen: a slow motor of 0.125 s then has its five rows ([`ROWS_PER_LAG`]); slower rows
/// serve none.
const SLOWEST_HZ: f64 = 40.0;
/// Rows in a time constant, at least. Chosen: then the pole is at a sixteenth of half the row rate, `1 / (5 pi)`.
const ROWS_PER_LAG: f64 = 5.0;
/// Periods below which the noise is hardly known. Derived: of two, one is left where the first carries a transient, and one shows no
/// spread.
const FEWEST_PERIODS: usize = 3;
/// An amplitude is the stated one within this share. Chosen: rows that miss a peak lose less; a slip, such as peak to peak, is a
/// factor of two.
const SAME_AMPLITUDE: f64 = 0.2;
/// Correlation from which on a response goes against its command. Chosen: the command then explains a quarter of the response's power,
/// which noise of many rows never has by chance.
const AGAINST: f64 = -0.5;
/// The lag of a usual motor, seconds. Chosen: the middle of 0.02 to 0.2; it only serves a correlation and a gain to a factor of two.
const USUAL_LAG_S: f64 = 0.1;

/// What speaks against a record, as a warning each; `is_force` where its command is a force.
#[must_use]
pub fn check_record(experiment: &Experiment, record: &Record, is_force: bool) -> Vec<Finding> {
    let file = || record.file.clone();
    let mut found = Vec::new();
    let mut add = |topic, row, fault: &dyn Diagnostic| {
        found.push(Finding::new(Severity::Warning, topic, Some(&record.file), fault).at_row(row));
    };
    // Steady points are as far apart as it took to reach them.
    let is_steady = record.excitation == Excitation::Steady;
    let wrong_time = check_time_unit(record, experiment.sample_rate_hz).filter(|_| !is_steady);
    if let Some(fault) = &wrong_time {
        add(Topic::TimeUnit, None, fault);
    }
    if !is_steady {
        sampling(record, wrong_time.is_none(), &mut add);
    }
    if record.is_constant() {
        add(Topic::Command, None, &IdentifyError::ConstantCommand { file: file() });
    }
    let wrong_command = check_command_unit(record, experiment.output).filter(|_| !is_force);
    if !is_force {
        if let Some(fault) = &wrong_command {
            add(Topic::CommandUnit, fault.row(), fault);
        } else {
            command(record, &mut add);
        }
    }
    if record.excitation == Excitation::Multisine
        && let Ok(periods) = record.periods()
        && periods.count < FEWEST_PERIODS
    {
        add(Topic::Periods, None, &RecordFault::FewPeriods { file: file(), periods: periods.count });
    }
    let Some(response) = record.response(experiment.output) else { return found };
    let column = experiment.output.column();
    if response.windows(2).all(|pair| pair[0] == pair[1]) {
        add(Topic::Response, None, &IdentifyError::ConstantResponse { file: file() });
        return found;
    }
    if let Some(fault) = check_repeats(record, response, column) {
        add(Topic::Response, None, &fault);
    }
    // Neither a gain nor a lag is known from numbers in other units.
    let is_known = !is_force && wrong_time.is_none() && wrong_command.is_none();
    if is_known && let Some(follows) = Follows::from_record(record, response) {
        if let Some(fault) = check_response_unit(record, experiment.output, response, follows.gain()) {
            add(Topic::ResponseUnit, None, &fault);
        }
        let correlation = follows.correlation;
        if correlation < AGAINST {
            add(Topic::Sign, None, &RecordFault::ReversedSign { file: file(), column, correlation });
        }
    }
    for warning in unfitted(record, response, column) {
        found.push(Finding::new(Severity::Warning, warning.topic(), Some(&record.file), &warning));
    }
    found
}

/// Whether rows are too few for the lags that were found.
#[must_use]
pub fn check_rate(record: &Record, points: &[Point]) -> Option<Finding> {
    let rate_hz = 1.0 / usual_interval_s(&record.time_s)?;
    let near = |point: &&Point| (point.nominal - record.nominal).abs();
    let point = points.iter().min_by(|a, b| near(a).total_cmp(&near(b)))?;
    let time_constant_s = point.time_constant_s;
    let rows_per_lag = rate_hz * time_constant_s;
    let needed_hz = (ROWS_PER_LAG / time_constant_s).ceil();
    let file = record.file.clone();
    (rows_per_lag < ROWS_PER_LAG).then(|| {
        let fault = RecordFault::FewRowsPerLag { file, rate_hz, time_constant_s, rows_per_lag, needed_hz };
        Finding::new(Severity::Warning, Topic::Sampling, Some(&record.file), &fault)
    })
}

/// Gaps, uneven rows and slow ones. Slow rows are none where the times are in another unit.
fn sampling(record: &Record, is_in_seconds: bool, add: &mut impl FnMut(Topic, Option<usize>, &dyn Diagnostic)) {
    let file = || record.file.clone();
    // A chirp is put on even rows where its own are not.
    let needs_every_row = record.excitation == Excitation::Multisine;
    let interval = |row: usize| record.time_s[row] - record.time_s[row - 1];
    let gaps = match record.excitation {
        // Steps are fitted around gaps, and the fit says what they cost.
        Excitation::Step | Excitation::Staircase => Vec::new(),
        Excitation::Chirp | Excitation::Random => even::gaps(&record.time_s),
        _ => rows_after_gaps(&record.time_s),
    };
    if let Some(&longest) = gaps.iter().max_by(|a, b| interval(**a).total_cmp(&interval(**b))) {
        let (row, longest_s) = (longest + 1, interval(longest));
        let fault = RecordFault::Gaps { file: file(), count: gaps.len(), row, longest_s };
        add(Topic::Sampling, fault.row(), &fault);
    } else if needs_every_row && let Err(uneven) = record.sample_rate_hz() {
        add(Topic::Sampling, uneven.row(), &uneven);
    }
    if is_in_seconds
        && let Some(interval_s) = usual_interval_s(&record.time_s)
        && 1.0 / interval_s < SLOWEST_HZ
    {
        add(Topic::Sampling, None, &RecordFault::SlowRows { file: file(), rate_hz: 1.0 / interval_s });
    }
}

/// A command that was cut off, or is not the one that is stated.
fn command(record: &Record, add: &mut impl FnMut(Topic, Option<usize>, &dyn Diagnostic)) {
    let file = || record.file.clone();
    let command = &record.command;
    if matches!(record.excitation, Excitation::Multisine | Excitation::Triangle | Excitation::Chirp) {
        for ClippingLimit { at, rows } in clipping::limits(command) {
            add(Topic::Saturation, None, &RecordFault::CommandCutOff { file: file(), rows, at });
        }
    }
    // A multisine's mean is judged where it is identified.
    if let Some(fault) = check_period(record) {
        add(Topic::Periods, None, &fault);
    } else if matches!(record.excitation, Excitation::Square | Excitation::Triangle)
        && let Ok(periods) = record.periods()
    {
        let whole = &command[..periods.samples * periods.count];
        let mean = mean(whole);
        if (mean - record.nominal).abs() > NOMINAL_TOLERANCE {
            add(Topic::Command, None, &RecordFault::OtherNominal { file: file(), nominal: record.nominal, mean });
        }
    }
    if let Some(stated) = record.amplitude.filter(|_| record.excitation.is_periodic() && !record.is_constant()) {
        let low = command.iter().copied().fold(f64::INFINITY, f64::min);
        let high = command.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let found = (high - low) / 2.0;
        if (found / stated - 1.0).abs() > SAME_AMPLITUDE {
            add(Topic::Command, None, &RecordFault::OtherAmplitude { file: file(), stated, found });
        }
    }
}

/// What the rows of the response say where no fit looks at them.
fn unfitted(record: &Record, response: &[f64], column: &'static str) -> Vec<IdentifyWarning> {
    let saturated =
        |ClippingLimit { at, rows }| IdentifyWarning::Saturated { file: record.file.clone(), column, rows, at };
    match record.excitation {
        Excitation::Square | Excitation::Triangle => {
            // A sensor of few steps without noise stands still on the plateau at either end; one that is cut off, at one.
            let limits = match &clipping::limits(response)[..] {
                [one] => vec![*one],
                _ => Vec::new(),
            };
            let mut found = plausibility::check_rows(record, response, &limits);
            found.extend(limits.into_iter().map(saturated));
            found
        }
        // A motor that stands still reads zero.
        Excitation::Free => {
            clipping::limits(response).into_iter().filter(|limit| limit.at != 0.0).map(saturated).collect()
        }
        _ => Vec::new(),
    }
}

/// How a response follows its command behind the lag of a usual motor.
struct Follows {
    /// Of both, -1 to 1.
    correlation: f64,
    /// Response units per unit of command.
    slope: f64,
}

impl Follows {
    /// `None` where either is constant.
    fn from_record(record: &Record, response: &[f64]) -> Option<Self> {
        let mut level = *record.command.first()?;
        let mut lagged = vec![level];
        for (times, command) in record.time_s.windows(2).zip(&record.command) {
            level += (command - level) * -(-(times[1] - times[0]) / USUAL_LAG_S).exp_m1();
            lagged.push(level);
        }
        let (x_mean, y_mean) = (mean(&lagged), mean(response));
        let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
        for (x, y) in lagged.iter().zip(response) {
            let (x, y) = (x - x_mean, y - y_mean);
            xx += x * x;
            yy += y * y;
            xy += x * y;
        }
        (xx > 0.0 && yy > 0.0).then(|| Self { correlation: xy / (xx * yy).sqrt(), slope: xy / xx })
    }

    /// The static gain, give or take a factor of two for another lag, whatever its sign; `None` where the response hardly
    /// follows.
    fn gain(&self) -> Option<f64> {
        (self.correlation.abs() > -AGAINST).then_some(self.slope.abs())
    }
}
