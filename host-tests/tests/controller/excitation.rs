//! The controller's multisine, judged by floating point: crest factor, spectrum, and the sum in `f64`.

use std::f64::consts::TAU;

use rotorlead::excitation::{Lines, Multisine, ODD_LINES_30_HZ, ODD_LINES_45_HZ};
use rotorlead_fourier as fourier;
use rotorlead_plant::bench::multisine::flight::{RECIPES, Recipe, find_phases, source, sum_to_f64};

const RATE_HZ: f64 = 5000.0;
const AMPLITUDE: f64 = 0.05;
const NOMINAL: f64 = 0.5;

/// Lowest crest factors that the searches are known to reach, rounded up.
const SETS: [(Lines<'static>, Recipe, f64); 2] =
    [(ODD_LINES_30_HZ, RECIPES[0], 1.40), (ODD_LINES_45_HZ, RECIPES[1], 1.39)];

/// One period of the generator's own output, without the nominal command.
fn period(lines: Lines) -> Vec<f64> {
    let mut multisine = Multisine::new(lines, NOMINAL, AMPLITUDE, RATE_HZ).unwrap();
    multisine.start(None);
    let nominal = multisine.nominal().to_f64();
    (0..multisine.ticks_per_period()).map(|_| multisine.update().to_f64() - nominal).collect()
}

fn rms(samples: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = samples.len() as f64;
    (samples.map(|x| x * x).sum::<f64>() / count).sqrt()
}

#[test]
fn the_crest_factor_of_the_controllers_own_output_is_low() {
    for (lines, _, limit) in SETS {
        let samples = period(lines);
        let peak = samples.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
        let crest_factor = peak / rms(samples.iter().copied());
        println!("{} lines: crest factor {crest_factor:.4}", lines.count());
        assert!(crest_factor <= limit, "{crest_factor}");
    }
}

#[test]
fn one_period_has_the_requested_lines_with_equal_amplitudes_and_nothing_else() {
    for (lines, _, _) in SETS {
        let mut samples = period(lines);
        let count = samples.len();
        let transform = fourier::real_forward(count);
        let mut spectrum = transform.make_output_vec();
        transform.process(&mut samples, &mut spectrum).unwrap();
        let amplitude: Vec<f64> = spectrum.iter().map(|bin| bin.norm() * 2.0 / count as f64).collect();
        let expected = AMPLITUDE / lines.peak();
        let (mut deviation, mut elsewhere) = (0.0_f64, 0.0_f64);
        for (bin, amplitude) in amplitude.iter().enumerate() {
            if bin % 2 == 1 && bin <= lines.top_harmonic() as usize {
                deviation = deviation.max((amplitude / expected - 1.0).abs());
            } else {
                elsewhere = elsewhere.max(amplitude / expected);
            }
        }
        let elsewhere_db = 20.0 * elsewhere.log10();
        println!("{} lines: amplitudes equal to {deviation:.1e}, all else below {elsewhere_db:.1} dB", lines.count());
        assert!(deviation < 2e-8, "{deviation:e}");
        assert!(elsewhere_db < -145.0, "{elsewhere_db}");
    }
}

#[test]
fn the_integers_agree_with_the_sum_in_f64() {
    for (lines, _, _) in SETS {
        let samples = period(lines);
        let count = samples.len();
        let gain = AMPLITUDE / lines.peak();
        // One cosine per tick of the period: index m n mod N is exact.
        let phases: Vec<f64> =
            lines.phases().iter().map(|&phase| TAU * (f64::from(phase) + 0.5) / 4_294_967_296.0).collect();
        let reference = (0..count).map(|n| {
            let sum: f64 = phases
                .iter()
                .enumerate()
                .map(|(k, phase)| {
                    let index = (2 * k + 1) * n % count;
                    (TAU * index as f64 / count as f64 + phase).cos()
                })
                .sum();
            gain * sum
        });
        let errors: Vec<f64> = reference.zip(&samples).map(|(exact, x)| x - exact).collect();
        let worst = errors.iter().fold(0.0_f64, |worst, e| worst.max(e.abs())) * 2.0_f64.powi(29);
        let relative_db = 20.0 * (rms(errors.into_iter()) / rms(samples.into_iter())).log10();
        println!("{} lines: error {relative_db:.1} dB, worst {worst:.2} LSB", lines.count());
        assert!(relative_db < -150.0, "{relative_db}");
        assert!(worst < 1.0, "{worst}");
    }
}

#[test]
fn the_sum_starts_at_zero() {
    for (lines, _, _) in SETS {
        let start = sum_to_f64(lines.sum(0));
        println!("{} lines: {start:.1e} of one line at the start", lines.count());
        assert!(start.abs() < 1e-10, "{start:e}");
    }
}

/// The processor's Fourier transform decides the last digits of a search, so the phases are compared
/// as angles: 1e-6 turn is far below what two different minima differ by.
#[test]
fn the_committed_phases_are_what_their_recipes_give() {
    let mut sets = Vec::new();
    for (lines, recipe, _) in SETS {
        let (_, set) = find_phases(&recipe, |_| ()).unwrap();
        assert_eq!(lines.count(), set.phases.len());
        for (committed, found) in lines.phases().iter().zip(&set.phases) {
            let apart = committed.wrapping_sub(*found) as i32;
            assert!(apart.unsigned_abs() < 4295, "{}: {committed:#x} {found:#x}", recipe.name);
        }
        assert!((set.peak - lines.peak()).abs() < 1e-4, "{} {}", set.peak, lines.peak());
        // With the committed numbers the file is what the example writes, to the last character.
        sets.push((
            recipe,
            rotorlead_plant::bench::multisine::flight::Phases { phases: lines.phases().to_vec(), peak: lines.peak() },
        ));
    }
    let committed = include_str!("../../../src/excitation/phases.rs");
    assert!(source(&sets) == committed, "src/excitation/phases.rs was edited by hand");
}
