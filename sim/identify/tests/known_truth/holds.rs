//! What the fits assume of holds and rows, against what the bench does.

use std::f64::consts::TAU;

use rotorlead_identify::frequency_response::hold::HoldChain;
use rotorlead_plant::bench::{Plan, Prediction};
use rotorlead_plant::{Lag, Model, Point};

fn motor(lag: Lag) -> Model {
    Model {
        time_constant_curve: None,
        format: 1,
        points: vec![Point::new(0.5, lag)],
        static_map: None,
        effects: Vec::new(),
        provenance: None,
    }
}

/// Largest relative deviation of the chain's images from the exact response at the rows, over the lines to 45 Hz.
fn worst(loop_rate_hz: u32, sample_rate_hz: u32, esc_frame_hz: Option<f64>, lag: Lag) -> f64 {
    let model = motor(lag);
    let plan = Plan { loop_rate_hz, sample_rate_hz, esc_frame_hz, ..Plan::paper(&model) };
    let exact = Prediction::new(&plan, &model, 0.5, None).unwrap();
    let chain = HoldChain::new(f64::from(sample_rate_hz), Some(f64::from(loop_rate_hz)), esc_frame_hz).unwrap();
    (0..225)
        .map(|k| TAU * 0.1 * (2.0 * f64::from(k) + 1.0))
        .map(|omega| {
            let seen: num_complex::Complex64 =
                chain.images(omega).iter().map(|i| i.weight * lag.frequency_response(i.omega_rad_s)).sum();
            (seen / exact.response_at_rows(omega) - 1.0).norm()
        })
        .fold(0.0, f64::max)
}

/// The chain keeps sixteen images to either side and the exact response all of them.
#[test]
fn the_images_of_the_fit_are_what_the_rows_of_the_bench_show() {
    for (loop_rate_hz, sample_rate_hz, esc_frame_hz, bound) in [
        (5000, 1000, Some(600.0), 1e-4),
        (5000, 5000, Some(600.0), 1e-5),
        (5000, 1000, None, 1e-4),
        (1000, 1000, None, 4e-4),
        (5000, 1000, Some(490.0), 1e-4),
    ] {
        for time_constant_s in [0.1593, 0.0708] {
            for delay_s in [0.0, 0.0043] {
                let off =
                    worst(loop_rate_hz, sample_rate_hz, esc_frame_hz, Lag { gain: 10.0, time_constant_s, delay_s });
                println!(
                    "{loop_rate_hz} {sample_rate_hz} {esc_frame_hz:?}, tau {time_constant_s}, delay {delay_s}: {off:.1e}"
                );
                assert!(off < bound, "{loop_rate_hz} {sample_rate_hz} {esc_frame_hz:?}: {off:e}");
            }
        }
    }
}
