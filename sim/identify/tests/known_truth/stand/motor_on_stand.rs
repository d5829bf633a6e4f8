//! A motor measured through a stand: its lag with and without the stand divided out.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_identify::frequency_response::hold::HoldChain;
use rotorlead_identify::lag::multisine::{IdentifyWarning, PeriodicOptions, identify_periodic};
use rotorlead_identify::stand::{StandModel, StandRoot};
use rotorlead_records::{Excitation, Experiment, Output, Record};

use super::transfer_function::truth;

const RATE_HZ: f64 = 1000.0;
const ROWS: usize = 10_000;
const PERIODS: usize = 4;
const TAU_S: f64 = 0.02;

/// The true stand as a file would have it.
fn model() -> StandModel {
    let roots = |all: &[Complex64]| {
        all.iter()
            .filter(|root| root.im > 0.0)
            .map(|root| StandRoot {
                frequency_hz: root.norm() / TAU,
                frequency_hz_std: None,
                damping: -root.re / root.norm(),
                damping_std: None,
            })
            .collect()
    };
    let truth = truth();
    StandModel {
        format: 1,
        gain: 1.0,
        gain_std: None,
        usable_hz: Some(50.0),
        usable_hz_std: None,
        top_hz: 300.0,
        poles: roots(&truth.poles),
        zeros: roots(&truth.zeros),
        records: Vec::new(),
    }
}

/// A multisine of 120 lines to 60 Hz, held from row to row, through a lag and the stand.
fn experiment() -> Experiment {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let stand = truth();
    let holds = HoldChain::new(RATE_HZ, None, None).unwrap();
    let motor = |omega: f64| 7.0 / Complex64::new(1.0, omega * TAU_S) * stand.response(omega);
    let (mut command, mut thrust) = (vec![0.5; ROWS], vec![3.5; ROWS]);
    for k in 0..120u32 {
        let bin = f64::from(1 + 5 * k);
        // Schroeder's phases.
        let phase = -PI * f64::from(k * k) / 120.0;
        let omega = TAU * bin * RATE_HZ / ROWS as f64;
        let seen: Complex64 = holds.images(omega).iter().map(|i| i.weight * motor(i.omega_rad_s)).sum();
        for row in 0..ROWS {
            let wave = Complex64::cis(phase + omega * row as f64 / RATE_HZ) * 0.004;
            command[row] += wave.re;
            thrust[row] += (wave * seen).re;
        }
    }
    let noise = |y: &f64| -> f64 {
        let n: f64 = StandardNormal.sample(&mut rng);
        y + 0.002 * n
    };
    let thrust: Vec<f64> = thrust.repeat(PERIODS).iter().map(noise).collect();
    let record = Record {
        file: String::from("motor.csv"),
        nominal: 0.5,
        excitation: Excitation::Multisine,
        period_s: Some(10.0),
        amplitude: None,
        compensated: false,
        compensator: None,
        role: None,
        time_s: (0..PERIODS * ROWS).map(|k| k as f64 / RATE_HZ).collect(),
        command: command.repeat(PERIODS),
        thrust_n: Some(thrust),
        rpm: None,
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: rotorlead_records::Setpoints::default(),
    };
    Experiment {
        name: String::from("motor on a stand"),
        output: Output::ThrustN,
        sample_rate_hz: Some(RATE_HZ),
        esc_frame_hz: None,
        command_rate_hz: None,
        records: vec![record],
    }
}

#[test]
fn the_stand_is_divided_out_of_the_motor() {
    let experiment = experiment();
    let stand = model();
    let with = identify_periodic(&experiment, &PeriodicOptions { stand: Some(&stand), ..Default::default() }).unwrap();
    let found = &with.nominals[0];
    let tau = found.fit.time_constant_s;
    assert!((tau.value - TAU_S).abs() < 4.0 * tau.std && tau.std < 1e-4, "{tau:?}");
    assert!((found.fit.gain.value - 7.0).abs() < 4.0 * found.fit.gain.std, "{:?}", found.fit.gain);
    assert!(found.fit.delay_s.is_none(), "{:?}", found.fit);
    assert!(found.fit.model_p_value > 1e-4, "{:?}", found.fit);
    // 59.6 Hz is the last line: those above 50 Hz are reported, in number.
    let beyond = found.warnings.iter().find_map(|warning| match warning {
        IdentifyWarning::BeyondStand { count, lines, usable_hz, .. } => Some((*count, *lines, *usable_hz)),
        _ => None,
    });
    assert_eq!(beyond, Some((20, 120, 50.0)));

    // As if there were no stand, its phase is taken for a dead time and its gain for the motor's.
    let without = identify_periodic(&experiment, &PeriodicOptions::default()).unwrap();
    let fit = &without.nominals[0].fit;
    assert!((fit.time_constant_s.value / TAU_S - 1.0).abs() > 0.02 && fit.model_p_value < 1e-6, "{fit:?}");
}
