//! What the conditioned inverse makes of a simulated rotor: rise, overshoot and bandwidth at every operating point.

use host_tests::{EscFrames, TABLE_1, cases, gain_at, paper_curve, pole_at};
use proptest::prelude::*;
use rotorlead::design::{CurvePoint, InverseDesign, ReferenceModel};
use rotorlead::excitation::{Multisine, ODD_LINES_45_HZ};
use rotorlead::inverse::ConditionedInverse;
use rotorlead::throttle::Command;

use super::command;

/// Slew limits of ESCs, units of the command per second: none, and 16, 6 and 2 % per millisecond.
pub(super) const SLEWS_PER_S: [f64; 4] = [0.0, 160.0, 60.0, 20.0];

/// The inverse at 5 kHz of a rotor whose time constants are `tau_factor` times those of Table 1.
pub(super) fn paper_inverse(omega_f_rad_s: f64, tau_factor: f64) -> InverseDesign {
    let curve: Vec<_> =
        paper_curve().iter().map(|point| CurvePoint { tau_s: tau_factor * point.tau_s, ..*point }).collect();
    let reference = ReferenceModel { omega_f_rad_s, damping: 0.5_f64.sqrt() };
    InverseDesign::new(reference, 5000.0, &curve).expect("a design")
}

/// How often the ESC takes over a command: at every tick, and at the paper's 600 Hz.
const ESC_FRAMES_HZ: [f64; 2] = [5000.0, 600.0];

/// A simulated response to a step: rise time 10 to 90 % and overshoot over the step.
pub(super) struct Response {
    pub rise_s: f64,
    pub overshoot: f64,
}

/// The response of the rotor of Table 1, in units of the command, behind an ESC with frames, to a `drive` that gives the command of
/// each tick.
fn response(from: f64, to: f64, seconds: f64, frame_hz: f64, mut drive: impl FnMut() -> f64) -> Response {
    let (curve, rate) = (paper_curve(), 5000.0);
    let mut esc = EscFrames::new(frame_hz, from);
    let (mut v, mut peak) = (from, 0.0_f64);
    let (mut at_10, mut at_90) = (None, None);
    for tick in 0..(seconds * rate) as u32 {
        v += (esc.hold(drive()) - v) * (1.0 - (-pole_at(&curve, v) / rate).exp());
        let part = (v - from) / (to - from);
        let seconds = f64::from(tick + 1) / rate;
        at_10 = at_10.or((part >= 0.1).then_some(seconds));
        at_90 = at_90.or((part >= 0.9).then_some(seconds));
        peak = peak.max(part);
    }
    let rise_s = at_90.zip(at_10).map_or(f64::INFINITY, |(end, begin)| end - begin);
    Response { rise_s, overshoot: peak - 1.0 }
}

pub(super) fn inverse_response(from: f64, to: f64, slew_per_s: f64, frame_hz: f64) -> Response {
    let design = paper_inverse(94.2156, 1.0);
    let limits = design.limits(command(0.05), Command::ONE, slew_per_s).expect("limits");
    let mut inverse = ConditionedInverse::at_rest(limits, command(from));
    response(from, to, 2.0, frame_hz, || inverse.update(design.coefficients(), command(to)).to_f64())
}

/// The rise when the command runs to its limit and never brakes.
pub(super) fn physical_bound_s(from: f64, to: f64, slew_per_s: f64, frame_hz: f64) -> f64 {
    let slew = if slew_per_s == 0.0 { 1.0 } else { slew_per_s / 5000.0 };
    let (mut u, limit) = (from, if to > from { 1.0 } else { 0.05 });
    response(from, to, 2.0, frame_hz, || {
        u += (limit - u).clamp(-slew, slew);
        u
    })
    .rise_s
}

#[test]
fn steps_at_every_operating_point_rise_as_fast_and_overshoot_as_little_as_specified() {
    // At 0.3, the fall from 0.40 to 0.10 at the idle limit decides: the physical bound is 303 ms.
    for (size, rise_ms) in
        [(0.02, 22.0..23.5), (0.05, 22.0..24.5), (0.1, 22.0..49.0), (0.2, 31.0..129.0), (0.3, 50.0..305.0)]
    {
        for frame_hz in ESC_FRAMES_HZ {
            let (mut fastest_ms, mut slowest_ms, mut overshoot) = (f64::INFINITY, 0.0_f64, 0.0_f64);
            for (nominal, _, _) in TABLE_1 {
                for to in [nominal + size, nominal - size] {
                    let response = inverse_response(nominal, to, 0.0, frame_hz);
                    fastest_ms = fastest_ms.min(1e3 * response.rise_s);
                    slowest_ms = slowest_ms.max(1e3 * response.rise_s);
                    overshoot = overshoot.max(response.overshoot);
                }
            }
            println!(
                "step {size}, frames at {frame_hz} Hz: rise {fastest_ms:.1} to {slowest_ms:.1} ms, overshoot {:.2} %",
                100.0 * overshoot
            );
            assert!(rise_ms.contains(&fastest_ms) && rise_ms.contains(&slowest_ms), "{fastest_ms} to {slowest_ms}");
            assert!(overshoot <= 0.06, "{overshoot}");
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn a_limited_step_is_nearly_as_fast_as_the_limits_allow(from in 0.40..0.65_f64, size in -0.3..0.3_f64) {
        for (slew_per_s, frame_hz) in SLEWS_PER_S.into_iter().flat_map(|slew| ESC_FRAMES_HZ.map(|frame| (slew, frame))) {
            let response = inverse_response(from, from + size, slew_per_s, frame_hz);
            let bound_s = physical_bound_s(from, from + size, slew_per_s, frame_hz);
            prop_assert!(response.overshoot <= 0.06, "{}", response.overshoot);
            prop_assert!(bound_s <= 0.025 || response.rise_s <= 1.3 * bound_s, "{} for {bound_s}", response.rise_s);
        }
    }
}

/// Bandwidth at -3 dB, rad/s, and peak, decibels, of `v` over the reference: a multisine up to 45 Hz with the peak `amplitude`
/// around `nominal`, its second period, on a rotor whose time constants are `tau_factor` times those of Table 1, behind an ESC with
/// frames.
pub(super) fn bandwidth(
    design: &InverseDesign,
    nominal: f64,
    amplitude: f64,
    tau_factor: f64,
    frame_hz: f64,
) -> (f64, f64) {
    let (curve, rate) = (paper_curve(), 5000.0);
    let mut multisine = Multisine::new(ODD_LINES_45_HZ, nominal, amplitude, rate).expect("a multisine");
    multisine.start(None);
    let input: Vec<f64> = (0..multisine.ticks_per_period()).map(|_| multisine.update().to_f64()).collect();
    let limits = design.limits(command(0.05), Command::ONE, 0.0).expect("limits");
    let mut inverse = ConditionedInverse::at_rest(limits, command(nominal));
    let mut esc = EscFrames::new(frame_hz, nominal);
    let mut v = nominal;
    let mut output = Vec::new();
    for reference in input.iter().chain(&input) {
        output.push(v);
        let u = esc.hold(inverse.update(design.coefficients(), command(*reference)).to_f64());
        v += (u - v) * (1.0 - (-pole_at(&curve, v) / (tau_factor * rate)).exp());
    }
    let output = &output[input.len()..];
    // Every sixth line below 13 Hz, all above: harmonics of 0.1 Hz.
    let mut peak_db = f64::NEG_INFINITY;
    for harmonic in (1..130).step_by(12).chain((131..260).step_by(2)) {
        let gain_db = 20.0 * gain_at(&input, output, harmonic).log10();
        if gain_db < -3.0 {
            return (std::f64::consts::TAU * 0.1 * harmonic as f64, peak_db);
        }
        peak_db = peak_db.max(gain_db);
    }
    (f64::INFINITY, peak_db)
}

#[test]
fn the_bandwidth_is_that_of_the_reference_model_at_every_operating_point() {
    // The exact table, and a table shortened for a rotor that is known to a tenth.
    for (omega_f_rad_s, table_factor, tau_factors) in [(94.2156, 1.0, &[1.0][..]), (125.0, 0.9, &[0.9, 1.0, 1.1][..])] {
        let design = paper_inverse(omega_f_rad_s, table_factor);
        for (nominal, _, _) in TABLE_1 {
            for (&tau_factor, frame_hz) in tau_factors.iter().flat_map(|tau| ESC_FRAMES_HZ.map(|frame| (tau, frame))) {
                let (bandwidth_rad_s, peak_db) = bandwidth(&design, nominal, 0.02, tau_factor, frame_hz);
                println!(
                    "{omega_f_rad_s} {nominal} {tau_factor}, frames at {frame_hz} Hz: {bandwidth_rad_s:.1} rad/s, peak \
                     {peak_db:.2} dB"
                );
                assert!(bandwidth_rad_s >= 90.0 && peak_db <= 0.3, "{bandwidth_rad_s} {peak_db}");
            }
        }
    }
    // An amplitude of 0.05 asks the slowest operating point for more than the range of the command.
    let (limited_rad_s, _) = bandwidth(&paper_inverse(94.2156, 1.0), 0.40, 0.05, 1.0, 5000.0);
    assert!((70.0..80.0).contains(&limited_rad_s), "{limited_rad_s}");
}
