//! The stand from the records of blows: from CSV files to poles and zeros.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_fourier as fourier;
use rotorlead_identify::stand::{StandOptions, identify_stand};
use rotorlead_records::Experiment;

use super::transfer_function::{check, truth};

const RATE_HZ: f64 = 2000.0;
const ROWS: usize = 4000;

/// One blow of 1 ms, Gaussian so that nothing is left of it at half the row rate, and the response of the stand at the rows,
/// exact in continuous time because the blow is band-limited.
fn blow(noise_n: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let truth = truth();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let peak_n = 20.0 + seed as f64;
    let mut force: Vec<f64> = (0..ROWS)
        .map(|k| {
            let t = (k as f64 / RATE_HZ - 0.05) / 0.7e-3;
            peak_n * (-0.5 * t * t).exp()
        })
        .collect();
    let recorded = force.clone();
    let forward = fourier::real_forward(ROWS);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut force, &mut spectrum).unwrap();
    for (k, bin) in spectrum.iter_mut().enumerate() {
        *bin *= truth.response(TAU * RATE_HZ / ROWS as f64 * k as f64);
    }
    spectrum[ROWS / 2] = Complex64::ZERO;
    let mut thrust = vec![0.0; ROWS];
    fourier::real_inverse(ROWS).process(&mut spectrum, &mut thrust).unwrap();
    for y in &mut thrust {
        let n: f64 = StandardNormal.sample(&mut rng);
        *y = *y / ROWS as f64 + noise_n * n;
    }
    (recorded, thrust)
}

/// An experiment of this many blows.
fn folder(path: &Path, blows: u64, command: &str) {
    let mut manifest = format!(
        "format = 1\nname = \"hammer\"\ncommand = \"{command}\"\noutput = \"thrust_n\"\nsample_rate_hz = 2000\n"
    );
    fs::create_dir(path).unwrap();
    for seed in 1..=blows {
        let (force, thrust) = blow(0.005, seed);
        let mut csv = String::from("time_s,command,thrust_n\n");
        for (k, (u, y)) in force.iter().zip(&thrust).enumerate() {
            writeln!(csv, "{},{u},{y}", k as f64 / RATE_HZ).unwrap();
        }
        fs::write(path.join(format!("blow{seed}.csv")), csv).unwrap();
        write!(manifest, "[[record]]\nfile = \"blow{seed}.csv\"\nnominal = 0\nexcitation = \"free\"\n").unwrap();
    }
    fs::write(path.join("experiment.toml"), manifest).unwrap();
}

#[test]
fn blows_give_the_stand() {
    let scratch = tempfile::tempdir().unwrap();
    for blows in [1, 5] {
        let path = scratch.path().join(format!("hammer{blows}"));
        folder(&path, blows, "force_n");
        let experiment = Experiment::read_force_input(&path).unwrap();
        let found = identify_stand(&experiment, &StandOptions::default()).unwrap();
        assert_eq!(found.fit.structure.poles, 8, "{:?}", found.scores);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        check(&found, &truth());
    }
}
