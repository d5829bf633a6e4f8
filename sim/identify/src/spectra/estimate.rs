//! From the Fourier coefficients of each period to lines with their noise.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::off_curve::off_the_curve;
use super::{
    DisturbanceSign, DisturbedLine, NoiseSource, RemovedSinusoid, SpectralLine, SpectrumOptions, UnexcitedLine,
};
use crate::error::IdentifyError;
use crate::spectra::noise::sinusoid::Sinusoid;
use crate::spectra::period_statistics::{mean, sample_variance, variance_of_mean};
use crate::spectra::transient::TransientTest;
use crate::spectra::{noise, transient};

/// What the computer leaves of a response that repeats exactly, relative to the largest line. Chosen: above a transform's rounding, below
/// 1e-12, and below the noise of a line of any sensor.
const ROUNDING: f64 = 1e-10;

/// Sinusoids of their own frequency that are looked for in a record. Chosen: the mains hum with three of its harmonics. The search ends
/// before where no line stands out; what is beyond is left out line by line.
const MOST_SINUSOIDS: usize = 4;
/// A sinusoid of two periods takes what a line knows of its noise up to this many bins away. Derived: to the first zero of its leakage,
/// `sin(pi x) / (pi x)`.
const TAKEN_BINS: f64 = 1.0;
/// Lines to either side whose mean replaces it. Chosen: as many as [`SpectrumOptions::pool_half_width`] takes by default; more reach
/// farther over a density that is not level.
const REFILL_LINES: usize = 5;

/// Fourier coefficients by period and bin; bin 0 is the mean, the last bin is not used. Bins more than [`noise_bins`] above
/// the highest excited one may be left out.
pub(crate) struct Periods {
    /// Distance of two bins, `2 pi / period`.
    pub bin_rad_s: f64,
    pub command: Vec<Vec<Complex64>>,
    pub response: Vec<Vec<Complex64>>,
    pub esc_command: Option<Vec<Vec<Complex64>>>,
}

/// What [`estimate`] finds.
pub(crate) struct Estimated {
    pub lines: Vec<SpectralLine>,
    pub unexcited: Vec<UnexcitedLine>,
    pub disturbed: Vec<DisturbedLine>,
    pub removed: Vec<RemovedSinusoid>,
    pub transient: TransientTest,
    pub periods_used: usize,
    pub noise: NoiseSource,
}

/// The noise of the means over periods at some bins.
struct LineNoise {
    variance: Vec<f64>,
    dof: f64,
    pooled: usize,
    stands_out: Vec<bool>,
    source: NoiseSource,
}

/// Finds the excited lines of the record `file`, drops first periods with a transient, and takes means and noise from
/// the others.
pub(crate) fn estimate(periods: &Periods, options: &SpectrumOptions, file: &str) -> Result<Estimated, IdentifyError> {
    let excited = excited_bins(&mean(&periods.command), options.line_threshold);
    let Some((&lowest, &highest)) = excited.first().zip(excited.last()) else {
        return Err(nothing_excited(periods, file));
    };
    let command = at(&periods.command, &excited);
    check_periodic(&command, file)?;

    let count = periods.response.len();
    // All bins of the band. One below the lowest line belongs to it too: with odd lines from the first on it is empty.
    let first_bin = lowest.saturating_sub(1).max(1);
    let band_of = |from: usize| -> Vec<Vec<Complex64>> {
        periods.response[from..].iter().map(|period| period[first_bin..=highest].to_vec()).collect()
    };
    // Hum turns from period to period too. Of two periods the test for a transient would drop the first for it, and what
    // turned would be lost: there it is taken out before. Of more, two are left that show it.
    let two = count == 2;
    let mut band = band_of(0);
    let mut removed = if two { remove_sinusoids(&mut band, first_bin, periods.bin_rad_s) } else { Vec::new() };
    let mut last = periods.response[count - 1].clone();
    last[first_bin..=highest].copy_from_slice(&band[count - 1]);
    let quiet = noise::from_unexcited(&last, &excited, noise_bins(options));
    let response = at(&band, &excited.iter().map(|bin| bin - first_bin).collect::<Vec<_>>());
    let transient = transient::test(&response, quiet.as_ref(), options.transient_level);
    let command = &command[transient.dropped..];
    if two {
        band.drain(..transient.dropped);
    } else {
        band = band_of(transient.dropped);
        removed = remove_sinusoids(&mut band, first_bin, periods.bin_rad_s);
    }
    let in_band = |bins: &[usize]| at(&band, &bins.iter().map(|bin| bin - first_bin).collect::<Vec<_>>());
    let response = in_band(&excited);
    let periods_used = response.len();

    let (mean_command, mean_response) = (mean(command), mean(&response));
    let ratio: Vec<_> = mean_response.iter().zip(&mean_command).map(|(y, u)| y / u).collect();
    let largest = mean_response.iter().map(|y| y.norm()).fold(0.0, f64::max);
    let pool = |sample: &[f64], bins: &[usize]| {
        let rounding = (ROUNDING * largest).powi(2);
        noise::pool(sample, bins, (periods_used - 1) as f64, options.pool_half_width, rounding)
    };
    let noise = if periods_used > 1 {
        // What of a period neither the mean response nor the command's own deviation explains.
        let mut sample = sample_variance(periods_used, excited.len(), |p, k| {
            response[p][k] - mean_response[k] - ratio[k] * (command[p][k] - mean_command[k])
        });
        if two {
            removed.iter().for_each(|s| refill(&mut sample, &excited, s.omega_rad_s / periods.bin_rad_s));
        }
        let pooled = pool(&sample, &excited);
        LineNoise {
            variance: variance_of_mean(&pooled.variance, periods_used),
            dof: 2.0 * (pooled.neighbors * (periods_used - 1)) as f64,
            pooled: pooled.neighbors,
            stands_out: pooled.stands_out,
            source: NoiseSource::BetweenPeriods,
        }
    } else {
        let (variance, bins) = quiet.ok_or_else(|| IdentifyError::NoNoise { file: file.to_owned() })?;
        LineNoise {
            variance,
            dof: 2.0 * bins as f64,
            pooled: bins,
            stands_out: vec![false; excited.len()],
            source: NoiseSource::UnexcitedLines,
        }
    };

    let omega_rad_s = |bin: usize| periods.bin_rad_s * bin as f64;
    let ratio_variance: Vec<_> = noise.variance.iter().zip(&mean_command).map(|(v, u)| v / u.norm_sqr()).collect();
    let off_the_curve = off_the_curve(&ratio, &ratio_variance);
    let sign_of = |k: usize| {
        if noise.stands_out[k] {
            Some(DisturbanceSign::ScattersOverPeriods)
        } else {
            off_the_curve[k].then_some(DisturbanceSign::OffTheCurve)
        }
    };
    let esc_command = periods.esc_command.as_ref().map(|all| mean(&at(&all[transient.dropped..], &excited)));
    let mut lines = Vec::with_capacity(excited.len());
    let mut disturbed = Vec::new();
    for (k, &bin) in excited.iter().enumerate() {
        // A transform of the rows of one period has fewer bins than a u32.
        let (harmonic, omega_rad_s) = (bin as u32, omega_rad_s(bin));
        match sign_of(k) {
            Some(sign) => disturbed.push(DisturbedLine { harmonic, omega_rad_s, sign }),
            None => lines.push(SpectralLine {
                harmonic,
                omega_rad_s,
                command: mean_command[k],
                esc_command: esc_command.as_ref().map(|e| e[k]),
                response: mean_response[k],
                variance: noise.variance[k],
                dof: noise.dof,
                pooled: noise.pooled,
            }),
        }
    }

    let unexcited = if noise.source == NoiseSource::BetweenPeriods {
        let bins: Vec<usize> = (first_bin..highest).filter(|bin| excited.binary_search(bin).is_err()).collect();
        unexcited_lines(&in_band(&bins), &bins, periods.bin_rad_s, pool)
    } else {
        Vec::new()
    };
    Ok(Estimated { lines, unexcited, disturbed, removed, transient, periods_used, noise: noise.source })
}

/// Why the mean command has no line: it does not move, or what it does cancels over periods that are none.
fn nothing_excited(periods: &Periods, file: &str) -> IdentifyError {
    let file = file.to_owned();
    match periods.command.iter().all(|period| excited_bins(period, 1.0).is_empty()) {
        true => IdentifyError::ConstantCommand { file },
        false => IdentifyError::NothingRepeats { file, period_s: TAU / periods.bin_rad_s },
    }
}

/// The lines at `bins`, which are not excited, whose noise `pool` knows; disturbed ones are left out.
fn unexcited_lines(
    periods: &[Vec<Complex64>],
    bins: &[usize],
    bin_rad_s: f64,
    pool: impl Fn(&[f64], &[usize]) -> noise::Pooled,
) -> Vec<UnexcitedLine> {
    let count = periods.len();
    let response = mean(periods);
    let pooled = pool(&sample_variance(count, bins.len(), |p, k| periods[p][k] - response[k]), bins);
    let variance = variance_of_mean(&pooled.variance, count);
    (0..bins.len())
        .filter(|&k| !pooled.stands_out[k])
        .map(|k| UnexcitedLine {
            harmonic: bins[k] as u32,
            omega_rad_s: bin_rad_s * bins[k] as f64,
            response: response[k],
            variance: variance[k],
            dof: 2.0 * (pooled.neighbors * (count - 1)) as f64,
        })
        .collect()
}

/// Subtracts what stands out between periods and is a sinusoid, the strongest first.
fn remove_sinusoids(band: &mut [Vec<Complex64>], first_bin: usize, bin_rad_s: f64) -> Vec<RemovedSinusoid> {
    let mut removed = Vec::new();
    let count = band.len();
    if count < 2 {
        return removed;
    }
    let bins: Vec<usize> = (first_bin..first_bin + band[0].len()).collect();
    while removed.len() < MOST_SINUSOIDS {
        let middle = mean(band);
        let sample = sample_variance(count, bins.len(), |p, k| band[p][k] - middle[k]);
        let largest = middle.iter().map(|y| y.norm()).fold(0.0, f64::max);
        let peak = noise::strongest(&sample, &bins, (count - 1) as f64, (ROUNDING * largest).powi(2));
        let Some(sinusoid) = peak.and_then(|peak| Sinusoid::fit(band, first_bin, peak)) else { break };
        sinusoid.subtract_from(band, first_bin);
        removed.push(RemovedSinusoid { omega_rad_s: bin_rad_s * sinusoid.bin, amplitude: sinusoid.amplitude.norm() });
    }
    removed
}

fn at(periods: &[Vec<Complex64>], bins: &[usize]) -> Vec<Vec<Complex64>> {
    periods.iter().map(|spectrum| bins.iter().map(|&bin| spectrum[bin]).collect()).collect()
}

/// Two periods differ by one number per bin, and a sinusoid that was fitted at `bin` has used up what the line next to it
/// knew of the noise: its neighbors say it instead.
fn refill(sample: &mut [f64], excited: &[usize], bin: f64) {
    let distance = |k: usize| (excited[k] as f64 - bin).abs();
    let Some(nearest) = (0..excited.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b))) else { return };
    if distance(nearest) > TAKEN_BINS {
        return;
    }
    let around =
        (nearest.saturating_sub(REFILL_LINES)..sample.len().min(nearest + REFILL_LINES + 1)).filter(|k| *k != nearest);
    let (sum, count) = around.fold((0.0, 0), |(sum, count), k| (sum + sample[k], count + 1));
    if count > 0 {
        sample[nearest] = sum / f64::from(count);
    }
}

/// How many bins tell the noise at a line of a single period: none of them is farther above the highest line.
pub(super) fn noise_bins(options: &SpectrumOptions) -> usize {
    2 * options.pool_half_width + 1
}

/// Bins of the command above the threshold; none when the command does not move. A command of 0..1
/// that moves by less than 1e-9 is taken as constant: that is rounding, not excitation. Chosen: far above the rounding of doubles, 1e-16,
/// and far below the step of a command, 5e-4 of DSHOT.
pub(super) fn excited_bins(command: &[Complex64], threshold: f64) -> Vec<usize> {
    let inner = 1..command.len().saturating_sub(1);
    let peak = inner.clone().map(|k| command[k].norm()).fold(0.0, f64::max);
    if peak.is_nan() || peak <= 1e-9 {
        return Vec::new();
    }
    inner.filter(|&k| command[k].norm() >= threshold * peak).collect()
}

/// The command has no noise, so its periods must agree; a wrong `period_s` shows here. Chosen: the noise of a recorded command stays below
/// 1 % in RMS, a wrong period makes tens of percent.
fn check_periodic(command: &[Vec<Complex64>], file: &str) -> Result<(), IdentifyError> {
    let average = mean(command);
    let power = average.iter().map(Complex64::norm_sqr).sum::<f64>();
    let spread =
        command.iter().flat_map(|period| period.iter().zip(&average).map(|(c, m)| (c - m).norm_sqr())).sum::<f64>()
            / command.len() as f64;
    let relative = (spread / power).sqrt();
    if relative > 0.01 {
        return Err(IdentifyError::NotPeriodic { file: file.to_owned(), percent: 100.0 * relative });
    }
    Ok(())
}
