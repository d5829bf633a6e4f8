//! Do the bands cover, and how far does the local polynomial method come?
//!
//! Spectra are drawn directly, one complex normal number per bin and period. The lines of a repeat share
//! their pooled variances eleven at a time, so a share of covered lines is judged as if one line in eleven
//! had been drawn, which overstates its scatter: with a thousand repeats of 150 lines one standard deviation
//! is 0.0019, and 0.94 is 4.5 of them from what the estimator has.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::identify::spectra::estimate::{Periods, estimate};
use crate::identify::testing::{experiment, noise, record};
use crate::identify::{Etfe, ResponsePoint, SpectrumOptions, spectra};

/// Bins are 0.1 Hz apart.
const BIN_RAD_S: f64 = TAU * 0.1;
/// Amplitude of the command at each line.
const COMMAND: f64 = 0.004;

fn lag(omega_rad_s: f64) -> Complex64 {
    10.0 / Complex64::new(1.0, 0.1 * omega_rad_s)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Noise {
    White,
    /// First-order drift with its corner at 1.6 Hz, a hundred times the white floor.
    Colored,
    /// White, and mains hum of 30 dB more than a line's noise somewhere from 49.8 to 50.2 Hz.
    Hum,
}

impl Noise {
    fn top_bin(self) -> usize {
        if self == Self::Hum { 599 } else { 299 }
    }

    fn variance(self, bin: usize) -> f64 {
        let scale = 1e-6;
        match self {
            Self::White | Self::Hum => scale,
            Self::Colored => scale * (0.01 + 1.0 / (1.0 + (bin as f64 / 16.0).powi(2))),
        }
    }
}

/// One record: odd lines up to the top bin, every period with fresh noise, hum running on from period to period.
fn draw(rng: &mut ChaCha8Rng, kind: Noise, periods: usize) -> Periods {
    let bins = kind.top_bin() + 12;
    let command: Vec<Complex64> = (0..bins)
        .map(|bin| if bin % 2 == 1 && bin <= kind.top_bin() { Complex64::cis(bin as f64 * bin as f64) * COMMAND } else { Complex64::ZERO })
        .collect();
    let hum_bin = rng.random_range(498.0..502.0);
    let hum_phase = rng.random_range(0.0..TAU);
    let hum = if kind == Noise::Hum { (1000.0 * kind.variance(0)).sqrt() } else { 0.0 };
    let response = (0..periods)
        .map(|p| {
            (0..bins)
                .map(|bin| {
                    let x = PI * (hum_bin - bin as f64);
                    let leak = Complex64::cis(hum_phase + TAU * hum_bin * p as f64 + x) * (x.sin() / x);
                    lag(BIN_RAD_S * bin as f64) * command[bin] + noise(rng) * kind.variance(bin).sqrt() + leak * hum
                })
                .collect()
        })
        .collect();
    Periods { bin_rad_s: BIN_RAD_S, command: vec![command; periods], response, esc_command: None }
}

#[derive(Default, Debug)]
struct Coverage {
    /// By harmonic: discs that cover, and all.
    disc: std::collections::BTreeMap<u32, (u32, u32)>,
    magnitude: u32,
    lines: u32,
    left_out: u32,
}

impl Coverage {
    fn of(kind: Noise, periods: usize, repeats: u64) -> Self {
        let mut found = Self::default();
        for repeat in 0..repeats {
            let mut rng = ChaCha8Rng::seed_from_u64(repeat);
            let drawn = draw(&mut rng, kind, periods);
            let estimated = estimate(&drawn, &SpectrumOptions::default(), "drawn").unwrap();
            let response = FrequencyResponse::from_lines(&estimated.lines, estimated.periods_used);
            found.left_out += estimated.disturbed.len() as u32;
            for (line, drawn) in response.lines.iter().zip(&estimated.lines) {
                let truth = lag(line.omega_rad_s);
                let covers = (line.response - truth).norm() <= response.confidence_radius(line, 0.95);
                let (low, high) = response.magnitude_interval(line, 0.95);
                let count = found.disc.entry(drawn.harmonic).or_default();
                count.0 += u32::from(covers);
                count.1 += 1;
                found.magnitude += u32::from((low..=high).contains(&truth.norm()));
                found.lines += 1;
            }
        }
        found
    }

    fn disc_share(&self) -> f64 {
        f64::from(self.disc.values().map(|(covered, _)| covered).sum::<u32>()) / f64::from(self.lines)
    }

    fn magnitude_share(&self) -> f64 {
        f64::from(self.magnitude) / f64::from(self.lines)
    }

    fn worst_line(&self) -> (f64, u32) {
        let share = self.disc.iter().map(|(harmonic, (covered, all))| (f64::from(*covered) / f64::from(*all), *harmonic));
        share.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    }
}

fn bands_cover(repeats: u64) {
    for kind in [Noise::White, Noise::Colored, Noise::Hum] {
        for periods in [2, 4, 14] {
            let found = Coverage::of(kind, periods, repeats);
            let (disc, magnitude) = (found.disc_share(), found.magnitude_share());
            let (worst, harmonic) = found.worst_line();
            let left_out = f64::from(found.left_out) / repeats as f64;
            println!(
                "{kind:?} {periods}: disc {disc:.4} magnitude {magnitude:.4}, worst {worst:.3} at {harmonic}; {left_out:.2} lines left out"
            );
            assert!((0.94..=0.96).contains(&disc), "{kind:?} {periods}: {disc}");
            assert!((0.94..=0.96).contains(&magnitude), "{kind:?} {periods}: {magnitude}");
        }
    }
}

#[test]
fn bands_of_95_percent_cover_in_94_to_96() {
    bands_cover(1000);
}

#[test]
#[ignore = "ten thousand repeats"]
fn bands_of_95_percent_cover_in_94_to_96_of_many() {
    bands_cover(10_000);
}
