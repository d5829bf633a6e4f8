//! Signs that a record is not what its experiment states, or that a fit to it is inaccurate.
//!
//! A fit weighs lines by what of them does not repeat. What happens once, such as a reading of a thousand newtons or a sensor
//! that stops, is in its numbers all the same, and often in its standard errors too. So the rows are looked at.

use rotorlead_numerics::sample::mean;
use rotorlead_numerics::statistics::f_upper_tail;
use rotorlead_records::{NOMINAL_TOLERANCE, Record};

use super::IdentifyWarning;
use crate::error::{IdentifyError, with_advice};
use crate::estimate::Estimate;
use crate::estimate::MAX_RELATIVE_STD;
use crate::goodness_of_fit::MODEL_LEVEL;
use crate::lag::first_order::{FirstOrderFit, FirstOrderOptions, FitLine, fit_first_order};
use crate::rows::clipping::ClippingLimit;
use crate::rows::ripple::Ripple;
use crate::rows::spikes::without_spikes;
use crate::spectra::Spectrum;

/// A reading is a jump when it is off its neighbors by this share of the range in which nearly all readings are. A motor
/// gets there too, but not there and back within nine rows. Chosen: noise stays well within half the range, and a single smaller
/// outlier among thousands of rows hardly moves a fit.
const JUMP_SHARE: f64 = 0.5;
/// The share of readings on each side that the range leaves out. Chosen: it holds dozens of outliers in thousands of rows, and leaves
/// more than 99.9 % of the range of a sine.
const OUTSIDE: f64 = 0.01;

/// A sensor has stopped when it reads the same for so many rows in a row... Chosen: 50 ms at 1 kHz; noise renews most readings within a
/// few rows.
const FROZEN_ROWS: usize = 50;
/// ...so many times as long as it usually does... Chosen: the runs of a coarse or repeated reading differ by a few times, not by 20.
const FROZEN_TIMES_USUAL: usize = 20;
/// ...and for one in so many rows of the record. Play in a linkage is shorter. Chosen: 0.5 % of the rows changes a fit by about that.
const FROZEN_ONE_IN: usize = 200;

/// Noise that is below this share of the largest line, in amplitude, is rounding. Chosen: above the rounding of a simulation's digits,
/// below a sensor's noise, some 1e-4.
const ROUNDING: f64 = 1e-6;

/// Dead times that are tried where none within the search explains the response, seconds. Chosen: ten times the default search; a motor
/// has none of that length, but with the delay of its log left out, gain and lag are wrong too.
const LONGEST_DELAY_S: f64 = 1.0;
/// A dead time explains it when its reduced chi-square is at most this share of the fit's. Chosen: a decrease by half is six times the
/// scatter of a reduced chi-square over 300 degrees of freedom, 8 %, `sqrt(2 / 300)`.
const EXPLAINS: f64 = 0.5;

/// What the response's rows say against it; `limits` are those that it stands on.
pub(crate) fn check_rows(record: &Record, response: &[f64], limits: &[ClippingLimit]) -> Vec<IdentifyWarning> {
    let file = || record.file.clone();
    let mut found = Vec::new();
    let spikes = jumps(response);
    if let Some(&first) = spikes.first() {
        let at_s = record.time_s.get(first).copied().unwrap_or_default();
        let (clean, is_spike) = without_spikes(response);
        let beat_hz = Ripple::find(&record.time_s, response, &clean, &is_spike).map(|ripple| ripple.frequency_hz);
        found.push(IdentifyWarning::Jumps { file: file(), rows: spikes.len(), at_s, beat_hz });
    }
    if let Some((first, rows)) = frozen(response, limits) {
        let from_s = record.time_s.get(first).copied().unwrap_or_default();
        found.push(IdentifyWarning::Frozen { file: file(), rows, from_s });
    }
    found
}

/// Whether a record is around another command than it says, by its whole periods.
pub(super) fn other_nominal(record: &Record, spectrum: &Spectrum) -> Option<IdentifyWarning> {
    let whole = record.command.get(spectrum.rows_left_out..).unwrap_or_default();
    let mean = mean(whole);
    let other = IdentifyWarning::OtherNominal { file: record.file.clone(), nominal: record.nominal, mean };
    ((mean - record.nominal).abs() > NOMINAL_TOLERANCE).then_some(other)
}

/// Rows whose reading jumps away and comes back.
fn jumps(response: &[f64]) -> Vec<usize> {
    if response.is_empty() {
        return Vec::new();
    }
    let outside = (OUTSIDE * response.len() as f64) as usize;
    let mut sorted = response.to_vec();
    let last = sorted.len() - 1 - outside;
    let low = *sorted.select_nth_unstable_by(outside, f64::total_cmp).1;
    let high = *sorted.select_nth_unstable_by(last, f64::total_cmp).1;
    let least = JUMP_SHARE * (high - low);
    // The neighbors are the four to either side: a reading that is so far off them is a quarter of that off one of them, or
    // off the one before. Most records end here.
    if response.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.25 * least) {
        return Vec::new();
    }
    let (clean, spike) = without_spikes(response);
    (0..clean.len()).filter(|&row| spike[row] && (response[row] - clean[row]).abs() > least).collect()
}

/// A sensor that has stopped stands still for this many times as long as it ever does else. Chosen: the longest runs of a coarse sensor,
/// at the turns of the response, differ by less than a factor of 3.
const FROZEN_TIMES_NEXT: usize = 3;

/// The longest run of equal readings, its first row and how many rows, where the sensor has stopped.
fn frozen(response: &[f64], limits: &[ClippingLimit]) -> Option<(usize, usize)> {
    let mut lengths = Vec::new();
    let mut longest = (0, 0);
    let mut first = 0;
    for run in response.chunk_by(|a, b| a == b) {
        lengths.push(run.len());
        if run.len() > longest.1 && limits.iter().all(|limit| limit.at != run[0]) {
            longest = (first, run.len());
        }
        first += run.len();
    }
    lengths.sort_unstable();
    let usual = lengths.get(lengths.len() / 2).copied().unwrap_or(0);
    // A coarse sensor stands still at every turn of the response, and so more than once.
    let next = lengths.iter().rev().nth(1).copied().unwrap_or(0);
    let least = FROZEN_ROWS.max(FROZEN_TIMES_USUAL * usual).max(response.len() / FROZEN_ONE_IN);
    (longest.1 >= least.max(FROZEN_TIMES_NEXT * next)).then_some(longest)
}

/// Whether the gain may as well be zero: then the response does not follow the command, and the lag means nothing.
pub(crate) fn may_be_zero(gain: Estimate) -> bool {
    let (low, high) = gain.interval(1.0 - MODEL_LEVEL);
    !(low > 0.0 || high < 0.0)
}

/// The error for a gain that may be zero, with what `warnings` say of the rows.
pub(crate) fn refusal(nominal: f64, gain: Estimate, warnings: &[IdentifyWarning]) -> IdentifyError {
    let of_rows = |warning: &&IdentifyWarning| {
        matches!(
            warning,
            IdentifyWarning::Jumps { .. } | IdentifyWarning::Frozen { .. } | IdentifyWarning::Saturated { .. }
        )
    };
    let signs = warnings.iter().filter(of_rows).map(|warning| format!(". {}", with_advice(warning))).collect();
    IdentifyError::GainMayBeZero { nominal, gain: gain.value, std: gain.std, signs }
}

/// What a fit says against itself; `limit_s` is the longest dead time that was looked for at first.
pub(crate) fn check_fit(nominal: f64, fit: &FirstOrderFit, limit_s: f64) -> Vec<IdentifyWarning> {
    let mut found = Vec::new();
    if let Some(delay) = fit.delay_s.filter(|delay| delay.value > limit_s) {
        found.push(IdentifyWarning::DelayBeyondSearch { nominal, delay_s: delay.value, limit_s });
    }
    if fit.model_p_value < MODEL_LEVEL {
        found.push(IdentifyWarning::ModelTooSimple { nominal, reduced_chi_square: fit.reduced_chi_square });
    }
    if fit.gain.value < 0.0 {
        found.push(IdentifyWarning::NegativeGain { nominal, gain: fit.gain.value });
    }
    for (what, estimate) in [("gain", fit.gain), ("time constant", fit.time_constant_s)] {
        let relative_std = estimate.std / estimate.value.abs();
        if relative_std > MAX_RELATIVE_STD {
            found.push(IdentifyWarning::Uncertain { nominal, what, relative_std });
        }
    }
    found
}

/// The fit with a dead time beyond those that are looked for, where that explains what no shorter one does: with a wrong
/// dead time gain and lag are wrong too.
pub(crate) fn with_longer_delay(
    fit: &FirstOrderFit,
    lines: &[FitLine],
    options: &FirstOrderOptions,
) -> Option<FirstOrderFit> {
    if fit.model_p_value >= MODEL_LEVEL || options.delay_level == 0.0 {
        return None;
    }
    let wide = FirstOrderOptions { max_delay_s: LONGEST_DELAY_S, ..*options };
    let other = fit_first_order(lines, &wide).ok()?;
    let is_longer = other.delay_s.is_some_and(|delay| delay.value > options.max_delay_s);
    (is_longer && other.reduced_chi_square < EXPLAINS * fit.reduced_chi_square).then_some(other)
}

/// Whether the fit leaves less than noise as large as what differs between the periods would.
pub(super) fn noise_too_large(nominal: f64, fit: &FirstOrderFit, lines: &[FitLine]) -> Option<IdentifyWarning> {
    let reduced_chi_square = fit.reduced_chi_square;
    (small_residual_p_value(fit, lines) < MODEL_LEVEL)
        .then_some(IdentifyWarning::NoiseTooLarge { nominal, reduced_chi_square })
}

/// How likely such noise leaves as little as the fit does. The counterpart of [`FirstOrderFit::model_p_value`]; one where
/// there is no noise to speak of.
fn small_residual_p_value(fit: &FirstOrderFit, lines: &[FitLine]) -> f64 {
    let largest = lines.iter().map(|line| line.response.norm()).fold(0.0, f64::max);
    if lines.iter().all(|line| line.variance.sqrt() < ROUNDING * largest) {
        return 1.0;
    }
    let line_dof = lines.iter().map(|line| line.dof).fold(f64::INFINITY, f64::min);
    let windows = (2.0 * lines.len() as f64 / line_dof).max(1.0);
    f_upper_tail(1.0 / fit.reduced_chi_square, windows * line_dof, fit.residual_dof)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of 1 around 5 and a little noise, which a sensor of this resolution reads.
    fn wave(resolution: f64) -> Vec<f64> {
        let mut state = 1_u64;
        (0..4000)
            .map(|row| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let noise = (state >> 33) as f64 / 2f64.powi(31) - 0.5;
                let y = 5.0 + (7e-3 * f64::from(row)).sin() + 0.1 * noise;
                (y / resolution).round() * resolution
            })
            .collect()
    }

    #[test]
    fn a_sensor_that_stops_is_seen_and_a_coarse_one_is_none() {
        for resolution in [1e-6, 0.01, 0.1, 0.3] {
            assert_eq!(frozen(&wave(resolution), &[]), None, "{resolution}");
        }
        for resolution in [1e-6, 0.01] {
            let mut y = wave(resolution);
            y[2503..].fill(wave(resolution)[2503]);
            let (first, rows) = frozen(&y, &[]).unwrap();
            assert!((first, rows) == (2503, 1497) || first < 2503 && rows > 1497, "{first} {rows}");
            assert_eq!(frozen(&y, &[ClippingLimit { at: y[2503], rows }]), None, "a limit is named as such");
        }
        assert_eq!(frozen(&[], &[]), None);
    }

    #[test]
    fn a_reading_that_jumps_is_seen_and_noise_or_a_slow_row_rate_is_none() {
        for offset in [0.0, -5.0] {
            let mut y: Vec<f64> = wave(1e-6).iter().map(|y| y + offset).collect();
            assert_eq!(jumps(&y), [0_usize; 0]);
            y[1234] += 1000.0;
            y[1235] -= 2.0;
            assert_eq!(jumps(&y), [1234, 1235]);
        }
        let noise_alone: Vec<f64> =
            wave(1e-6).iter().enumerate().map(|(k, y)| y - 5.0 - (7e-3 * k as f64).sin()).collect();
        assert_eq!(jumps(&noise_alone), [0_usize; 0]);
        let few_rows_per_wave: Vec<f64> = (0..400).map(|k| (0.9 * f64::from(k)).sin()).collect();
        assert_eq!(jumps(&few_rows_per_wave), [0_usize; 0]);
        assert_eq!(jumps(&[]), [0_usize; 0]);
    }
}
