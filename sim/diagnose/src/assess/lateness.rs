//! Whose delay it is: how late each step is, beside how far the rows of the log are apart.
//!
//! A log does not say where a delay arises. A logger that stamps what it receives adds the time of its link and its buffers, and that goes
//! with the time between its rows; an ESC adds its frame. How far the moments at which steps have begun scatter about the model says
//! how much of it differs from step to step.

use serde::Serialize;
use std::fmt;

use rotorlead_numerics::sample::{STD_PER_MEDIAN_DEVIATION, median};
use rotorlead_plant::effect::Site;

use crate::data::dataset::PreparedRecord;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;
use crate::noise::plateau_errors::{ComparedRows, mean};

/// Longest frame of an ESC's pulses, seconds. Standard: 50 Hz of servo pulses, the slowest that ESCs take. Digital commands take less than
/// a millisecond.
const LONGEST_FRAME_S: f64 = 0.02;
/// Rows by which a logger stamps late by itself. Chosen: the one in which it waits for the next, and three in its buffers. Lower names a
/// logger's delay the motor's; higher lets an ESC's pass for a logger's.
pub(crate) const LOGGER_ROWS: f64 = 4.0;
/// A step has begun where it has gone this part of the way. Chosen: early enough for the lag to say little of when, 0.36 of it, and above
/// the noise of a small step.
const BEGUN: f64 = 0.3;
/// Lags differ from step to step by this part of the model's. Chosen: those of the paper's motor differ by 2.3 over 0.40 to 0.65, within a
/// step by less. Lower warns of a wait where only lags differ; higher hides one.
const LAGS_DIFFER: f64 = 0.2;
/// From so many times that which stamps and unequal lags make of it, steps differ by more than these. Chosen: the median of ten steps
/// gives a scatter to 40 %, and twice is more than two of these.
const MORE: f64 = 2.0;

/// A step is one where it has this part of the size by which it is compared. Derived: that is its own size, or half of the usual one for
/// smaller steps; a tenth is left for rows that are cut out.
const LEAST_SIZE: f64 = 0.9;

/// A delay beside what the log shows of its own timing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lateness {
    /// The delay of the model, seconds.
    pub delay_s: f64,
    /// Median time between rows, seconds.
    pub row_s: f64,
    /// Standard deviation from step to step by the median of the deviations, seconds.
    pub scatter_s: f64,
    /// What unequal lags make of that, seconds.
    #[serde(skip)]
    of_lags_s: f64,
    /// Steps that show it.
    pub steps: usize,
    /// Steps during which the log stands still, which do not.
    pub stalled_steps: usize,
}

impl Lateness {
    /// That of a hypothesis with a delay in logs. `None` where it has none, or no step shows it.
    pub(crate) fn estimate(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Option<Self> {
        let delay = hypothesis.effects.iter().find(|candidate| candidate.kind.site == Site::Line)?;
        let mut late_s = Vec::new();
        let (mut stalled_steps, mut row_s) = (0, 0.0_f64);
        for record in &likelihood.data.records {
            let Some(log) = &record.log else { continue };
            stalled_steps += log.cut.stalled_steps;
            row_s = row_s.max(record.rate_hz.recip());
            let difference = hypothesis.difference(&likelihood.data, record)?;
            let simulated: Vec<f64> = record.measured.iter().zip(difference).map(|(y, off)| y - off).collect();
            late_s.extend(log.parts.iter().filter_map(|part| late(record, part, &simulated)));
        }
        // A motor that loses step once says nothing of the others.
        let usual_s = median(late_s.iter().copied()).filter(|_| late_s.len() > 1)?;
        let off_s = median(late_s.iter().map(|late_s| (late_s - usual_s).abs()))?;
        Some(Self {
            delay_s: delay.values[0],
            row_s,
            scatter_s: STD_PER_MEDIAN_DEVIATION * off_s,
            of_lags_s: -LAGS_DIFFER * (1.0 - BEGUN).ln() * hypothesis.base[0].time_constant_s,
            steps: late_s.len(),
            stalled_steps,
        })
    }

    /// The delay in rows of the log.
    #[must_use]
    pub fn rows(&self) -> f64 {
        self.delay_s / self.row_s
    }

    /// Scatter of steps whose stamps lie anywhere within a row.
    fn stamp_scatter_s(&self) -> f64 {
        self.row_s / 12_f64.sqrt()
    }
}

/// By how much the measured response has begun later than the simulated one.
fn late(record: &PreparedRecord, part: &ComparedRows, simulated: &[f64]) -> Option<f64> {
    if part.settled.is_empty() || part.before.is_empty() || part.shown < 1.0 {
        return None;
    }
    // A step that is hardly one, or goes the other way, does not show when it begins.
    let step = |values: &[f64]| mean(values, &part.settled) - mean(values, &part.before);
    if step(&record.measured).abs() < LEAST_SIZE * part.size || step(&record.measured) * step(simulated) <= 0.0 {
        return None;
    }
    let begun_s = |values: &[f64]| {
        let (from, to) = (mean(values, &part.before), mean(values, &part.settled));
        let way = |row: usize| (values[row] - from) / (to - from);
        let pair = part.moving.windows(2).find(|pair| way(pair[0].0) < BEGUN && way(pair[1].0) >= BEGUN)?;
        let (first, next) = (pair[0].0, pair[1].0);
        let share = (BEGUN - way(first)) / (way(next) - way(first));
        Some(record.time_s[first] + share * (record.time_s[next] - record.time_s[first]))
    };
    Some(begun_s(&record.measured)? - begun_s(simulated)?)
}

impl fmt::Display for Lateness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |seconds: f64| 1e3 * seconds;
        write!(
            f,
            "Whose delay: {:.1} ms are {:.1} rows of this log, which are {:.1} ms apart. From step to step it varies by {:.1} ms ({} \
             steps); stamps that lie anywhere within a row make {:.1} ms.",
            ms(self.delay_s),
            self.rows(),
            ms(self.row_s),
            ms(self.scatter_s),
            self.steps,
            ms(self.stamp_scatter_s()),
        )?;
        if self.stalled_steps > 0 {
            write!(
                f,
                " The log stands still during {} more steps, as only a logger or its link does.",
                self.stalled_steps
            )?;
        }
        let frame_ms = ms(LONGEST_FRAME_S);
        let is_of_rows = self.rows() <= LOGGER_ROWS;
        if self.rows() < 1.0 {
            f.write_str(" A delay of less than a row may be that of the stamps alone.")?;
        } else if self.delay_s <= LONGEST_FRAME_S && self.stalled_steps == 0 {
            write!(
                f,
                " A logger that waits and buffers is late by some rows, an ESC by its frame, up to {frame_ms:.0} ms of pulses at 50 Hz: \
                 either is possible."
            )?;
        } else if is_of_rows || self.stalled_steps > 0 {
            write!(
                f,
                " A logger that waits and buffers is late by some rows; an ESC by its frame, {frame_ms:.0} ms at most (pulses at 50 Hz) and \
                 less than 1 ms of a digital command. So the logger or its link is the more likely one."
            )?;
        } else {
            write!(
                f,
                " That is more than the few rows of a logger and more than the {frame_ms:.0} ms of an ESC's frame: look for a filter or a \
                 link with a delay of its own."
            )?;
        }
        if self.scatter_s > MORE * self.stamp_scatter_s().hypot(self.of_lags_s) {
            f.write_str(
                " It varies by more than stamps and unequal lags do: something waits for another time at each step.",
            )?;
        }
        write!(
            f,
            " A logger's delay is harmless: leave it out of the model. One of the ESC or the motor makes a lead worthless above {:.0} \
             rad/s, one over the delay. This log alone does not decide it; the same steps at another row rate do.",
            self.delay_s.recip()
        )
    }
}
