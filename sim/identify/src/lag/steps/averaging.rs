//! What a reading is that stands in several rows: the response at a moment, or its mean since the reading before.
//!
//! A counter of pulses gives means, and so does a sensor that averages until it is read. The mean over `T` comes `T / 2` later and has
//! corners where the response has none, so that both are fitted, and what they leave decides. Where it does not, two more are looked at: a
//! response that would begin before its command is no mean, and a counter is known on settled levels. What it leaves of a pulse it counts
//! next time, so that its readings change between two numbers while their sum never is more than a pulse off; readings that are rounded
//! one by one stand still, or scatter so that their sum wanders.

use rotorlead_numerics::sample::mean;

use super::fit::{self, LagFit, StepRows};
use super::step::Step;
use super::{Run, StepsError, StepsWarning};

/// Twice the logarithm of the likelihood ratio from which on one of the two is called right. Chosen: odds of 150 to 1, `e^5`; both have the
/// same number of parameters.
const DECIDES: f64 = 10.0;
/// A dead time that is below zero by more than so many standard errors is none. Chosen: one of 700 sound ones is by chance.
const BEFORE_COMMAND: f64 = 3.0;
/// Fewest readings of a settled level that a counter is known by. Chosen: the sum of fewer does not wander.
const FEWEST_READINGS: usize = 8;
/// Fewest levels. Chosen: 8 independent readings between two numbers keep to the sum of a counter half of the time, and those of six levels
/// once in 64 times.
const FEWEST_LEVELS: usize = 6;
/// By how many steps the sum of a counter's readings wanders at most. Derived: by less than one to either side of a line.
const WANDERS: f64 = 2.0;

/// What readings were taken as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaging {
    /// The response at the moment of the row.
    Momentary,
    /// Its mean since the reading before.
    Mean,
    /// The same, as pulses that were counted: by the levels, where the steps do not tell.
    Counted,
    /// The response at the moment of the row, where nothing tells.
    Unknown,
}

impl Averaging {
    fn is_mean(self) -> bool {
        matches!(self, Self::Mean | Self::Counted)
    }

    /// What it means for the lag, of readings so many seconds apart.
    pub(super) fn in_words(self, interval_s: f64) -> String {
        let half_ms = 500.0 * interval_s;
        match self {
            Self::Momentary => String::from("it is of a moment, and no mean, as the steps show"),
            Self::Mean => format!(
                "it is the mean since the one before, as the steps show: the {half_ms:.1} ms that this costs are in neither dead time \
                 nor time constant"
            ),
            Self::Counted => format!(
                "it is the pulses since the one before, as the sums of readings on the levels show: the {half_ms:.1} ms that this costs \
                 are in neither dead time nor time constant"
            ),
            Self::Unknown => format!(
                "the steps do not show whether it is of a moment or the mean since the one before: if it is a mean, the dead time is \
                 {half_ms:.1} ms shorter. Log faster readings"
            ),
        }
    }
}

/// The readings of a record, and what they were taken as.
#[derive(Clone, Copy, Debug)]
pub(super) struct AveragedReadings {
    rows_per_reading: f64,
    interval_s: f64,
    averaging: Averaging,
}

impl AveragedReadings {
    /// Over how long each reading is the mean, seconds; 0 for a momentary value.
    pub(super) fn mean_s(self) -> f64 {
        if self.averaging.is_mean() { self.interval_s } else { 0.0 }
    }

    pub(super) fn warning(self, column: &'static str) -> StepsWarning {
        let Self { rows_per_reading, interval_s, averaging } = self;
        StepsWarning::Repeats { column, rows_per_reading, interval_s, averaging }
    }
}

/// Fits the steps that have no fault, with the readings as what explains them best; the steps with their lags.
pub(super) fn fit(
    data: &StepRows<'_>,
    runs: &[Run],
    steps: &[Step],
    frame_s: f64,
) -> Result<(LagFit, Vec<Step>, Option<AveragedReadings>), StepsError> {
    let with = |mean_s: f64| {
        let mut steps = steps.to_vec();
        fit::fit(&StepRows { mean_s, ..*data }, runs, &mut steps, frame_s).map(|lag| (lag, steps))
    };
    let momentary = with(0.0);
    let Some(readings) = &runs[0].readings else { return momentary.map(|(lag, steps)| (lag, steps, None)) };
    let mean = with(readings.interval_s);
    let averaging = match (&momentary, &mean) {
        (Ok((momentary, _)), Ok((mean, _))) => match momentary.first_chi_square.gain_of(mean.first_chi_square) {
            gain if gain > DECIDES => Averaging::Mean,
            gain if gain < -DECIDES => Averaging::Momentary,
            _ if mean.delay_s.value < -BEFORE_COMMAND * mean.delay_s.std => Averaging::Momentary,
            _ if is_counter(data, runs, readings.step) => Averaging::Counted,
            _ => Averaging::Unknown,
        },
        (Err(_), Ok(_)) => Averaging::Mean,
        _ => Averaging::Unknown,
    };
    let (lag, steps) = if averaging.is_mean() { mean } else { momentary }?;
    let (rows_per_reading, interval_s) = (readings.rows_per_reading, readings.interval_s);
    Ok((lag, steps, Some(AveragedReadings { rows_per_reading, interval_s, averaging })))
}

/// Whether the readings on settled levels are those of a counter that gives multiples of `step`.
fn is_counter(data: &StepRows<'_>, runs: &[Run], step: f64) -> bool {
    let (mut levels, mut changing) = (0, 0);
    for plateau in runs.iter().flat_map(|run| &run.plateaus) {
        let readings: Vec<f64> =
            plateau.settled().filter(|&row| !data.without_reading[row]).map(|row| data.y[row] / step).collect();
        if plateau.limited || readings.len() < FEWEST_READINGS {
            continue;
        }
        let mean = mean(&readings);
        let (mut sum, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
        for reading in &readings {
            sum += reading - mean;
            (low, high) = (low.min(sum), high.max(sum));
        }
        if high - low > WANDERS {
            return false;
        }
        levels += 1;
        changing += usize::from(readings.iter().any(|reading| *reading != readings[0]));
    }
    levels >= FEWEST_LEVELS && 2 * changing > levels
}
