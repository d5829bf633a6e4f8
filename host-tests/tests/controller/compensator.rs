//! One motor's filter: bypass, bumpless switching, limits without wind-up, reset.

use std::f64::consts::TAU;

use host_tests::{any_design, cases, multisine, paper_design};
use proptest::prelude::*;
use rotorlead::biquad::Section;
use rotorlead::compensator::Compensator;
use rotorlead::throttle::{Command, FRACTION_BITS, Throttle};

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

fn any_command() -> impl Strategy<Value = Command> {
    (0..=1_i32 << FRACTION_BITS).prop_map(Command::saturating_from_bits)
}

/// A smooth command that stays within [0.1, 0.9]: two sinusoids of random size and period.
fn any_motion() -> impl Strategy<Value = Vec<Command>> {
    (0.0..0.2_f64, 0.0..0.2_f64, 20.0..2000.0_f64, 20.0..2000.0_f64, 0.0..6.0_f64).prop_map(|(a, b, p, q, phase)| {
        (0..3000)
            .map(|n| command(0.5 + a * (TAU * n as f64 / p + phase).sin() + b * (TAU * n as f64 / q).cos()))
            .collect()
    })
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn at_a_constant_input_switching_changes_no_output_bit(
        design in any_design(),
        level in any_command(),
        switches in proptest::collection::vec(1..50_usize, 1..20),
    ) {
        let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
        compensator.reset(level);
        let mut enabled = true;
        for ticks in switches {
            enabled = !enabled;
            compensator.set_enabled(enabled);
            for _ in 0..ticks {
                prop_assert_eq!(compensator.update(level), level);
            }
        }
    }

    #[test]
    fn in_motion_no_step_at_a_switch_is_larger_than_the_step_before_it(
        design in any_design(),
        motion in any_motion(),
        switches in proptest::collection::vec(2..3000_usize, 1..10),
        limits in (0.0..0.3, 0.7..1.0),
    ) {
        let mut compensator = Compensator::new(*design.coefficients(), command(limits.0), command(limits.1));
        compensator.reset(motion[0]);
        let mut outputs = Vec::new();
        let mut enabled = true;
        for (n, &input) in motion.iter().enumerate() {
            let switched = switches.contains(&n);
            if switched {
                enabled = !enabled;
                compensator.set_enabled(enabled);
            }
            outputs.push(compensator.update(input).to_bits());
            if switched {
                let (now, before) = (outputs[n] - outputs[n - 1], outputs[n - 1] - outputs[n - 2]);
                prop_assert!(now.abs() <= before.abs(), "a step of {now} after {before}");
            }
        }
    }

    /// The leftover of a switch is gone after 30 time constants of the slower pole, and the output is that of a filter
    /// that was never switched out (or, out of the path, the input).
    #[test]
    fn a_switch_is_forgotten(design in any_design(), level in any_command(), start in any_command(), on in any::<bool>()) {
        let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
        compensator.reset(start);
        compensator.set_enabled(!on);
        for n in 0..200 {
            compensator.update(if n % 2 == 0 { start } else { level });
        }
        compensator.set_enabled(on);
        let slowest = 1.0 / (1.0 - design.check().pole_radii[0]);
        let drift = 1.0 / design.coefficients().c() as f64 * 2.0_f64.powi(32);
        for _ in 0..(30.0 * slowest + 10.0 * drift) as u64 {
            compensator.update(level);
        }
        for _ in 0..100 {
            prop_assert_eq!(compensator.update(level), level);
        }
    }

    #[test]
    fn the_output_stays_within_its_limits_whatever_happens(
        design in any_design(),
        (min, max) in (any_command(), any_command()),
        events in proptest::collection::vec((any::<i32>(), 0..10_u8), 1..2000),
    ) {
        let mut compensator = Compensator::new(*design.coefficients(), min, max);
        let range = if min <= max { min..=max } else { min..=min };
        for (bits, event) in events {
            match event {
                0 => compensator.set_enabled(bits & 1 == 0),
                1 => compensator.reset(Command::saturating_from_bits(bits)),
                _ => {}
            }
            let output = compensator.update(Command::saturating_from_bits(bits));
            prop_assert!(range.contains(&output), "{output:?} outside {range:?}");
        }
    }

    /// The output leaves the limit on the tick on which the unclamped filter re-enters the range.
    #[test]
    fn limits_do_not_wind_up(design in any_design(), levels in proptest::collection::vec((any_command(), 1..300_usize), 2..20),
        (min, max) in (0.0..0.4, 0.6..1.0)) {
        let (min, max) = (command(min), command(max));
        let mut compensator = Compensator::new(*design.coefficients(), min, max);
        let start = levels[0].0;
        compensator.reset(start);
        let mut unclamped = Section::at_level(start);
        for (level, ticks) in levels {
            for _ in 0..ticks {
                let free = unclamped.update(design.coefficients(), level);
                let output = compensator.update(level);
                prop_assert_eq!(output, free.clamp_to(min, max));
            }
        }
    }

    /// Also while the leftover of a switch fades: once the path has been beyond a limit, and so has taken the leftover
    /// with it, the output leaves that limit no later than the path does.
    #[test]
    fn a_fade_does_not_hold_the_output_at_a_limit(design in any_design(), motion in any_motion(), swing in 1.0..4.0_f64,
        switch in 2..3000_usize, (min, max) in (0.3..0.45, 0.55..0.7)) {
        let (min, max) = (command(min), command(max));
        let mut compensator = Compensator::new(*design.coefficients(), min, max);
        compensator.reset(motion[0]);
        let mut beyond = [false; 2];
        for (n, input) in motion.iter().enumerate() {
            let input = command(0.5 + swing * (input.to_f64() - 0.5));
            if n == switch {
                compensator.set_enabled(false);
            }
            let output = compensator.update(input);
            if n > switch {
                beyond = [beyond[0] || input <= min, beyond[1] || input >= max];
                prop_assert!(!(beyond[0] && input > min && output == min), "held at the lower limit at {n}");
                prop_assert!(!(beyond[1] && input < max && output == max), "held at the upper limit at {n}");
            }
        }
    }

    /// Also while a leftover fades, and whatever is switched how often between two ticks.
    #[test]
    fn there_and_back_between_two_ticks_changes_nothing(design in any_design(), motion in any_motion(),
        switches in proptest::collection::vec(2..3000_usize, 1..5), toggles in proptest::collection::vec(2..3000_usize, 1..50)) {
        let mut left_alone = Compensator::new(*design.coefficients(), command(0.2), command(0.8));
        left_alone.reset(motion[0]);
        let mut toggled = left_alone;
        let mut enabled = true;
        for (n, &input) in motion.iter().enumerate() {
            if switches.contains(&n) {
                enabled = !enabled;
                left_alone.set_enabled(enabled);
                toggled.set_enabled(enabled);
            }
            if toggles.contains(&n) {
                toggled.set_enabled(!enabled);
                toggled.set_enabled(enabled);
            }
            prop_assert_eq!(left_alone.update(input), toggled.update(input));
        }
    }
}

proptest! {
    #![proptest_config(cases(256))]

    /// On either path, and also if the path changes on the same tick, whichever call comes first.
    #[test]
    fn in_motion_no_step_at_a_restart_is_larger_than_the_step_before_it(
        design in any_design(),
        motion in any_motion(),
        restarts in proptest::collection::vec((2..3000_usize, any_command(), any::<bool>(), any::<bool>()), 1..10),
    ) {
        let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
        compensator.reset(motion[0]);
        let mut outputs = Vec::new();
        for (n, &input) in motion.iter().enumerate() {
            let restart = restarts.iter().find(|(at, ..)| *at == n);
            if let Some(&(_, level, enabled, is_restart_first)) = restart {
                if is_restart_first {
                    compensator.restart(level);
                    compensator.set_enabled(enabled);
                } else {
                    compensator.set_enabled(enabled);
                    compensator.restart(level);
                }
                prop_assert_eq!(compensator.is_enabled(), enabled);
            }
            outputs.push(compensator.update(input).to_bits());
            if restart.is_some() {
                let (now, before) = (outputs[n] - outputs[n - 1], outputs[n - 1] - outputs[n - 2]);
                prop_assert!(now.abs() <= before.abs(), "a step of {now} after {before}");
            }
        }
    }
}

#[test]
fn bypass_is_the_input_within_the_limits() {
    let mut compensator = Compensator::new(*paper_design().coefficients(), command(0.1), command(0.9));
    compensator.set_enabled(false);
    compensator.reset(command(0.5));
    for value in [0.5, 0.0, 1.0, 0.3] {
        assert_eq!(compensator.update(command(value)), command(value).clamp_to(command(0.1), command(0.9)));
    }
    assert!(!compensator.is_enabled());
}

#[test]
fn a_reset_is_at_rest_at_its_level_whatever_came_before() {
    let mut compensator = Compensator::new(*paper_design().coefficients(), Command::ZERO, Command::ONE);
    for &u in multisine(0.5, 0.4, 5000.0).iter().take(1234) {
        compensator.update(command(u));
    }
    compensator.set_enabled(false);
    compensator.update(command(0.1));
    compensator.set_enabled(true);
    compensator.reset(command(0.3));
    for _ in 0..1000 {
        assert_eq!(compensator.update(command(0.3)), command(0.3));
    }
}

#[test]
fn a_step_saturates_and_comes_back_from_the_limit_without_delay() {
    // The paper's compensator asks for 3.43 times a step: from 0.65, a step of 0.2 would go to 1.13.
    let design = paper_design();
    let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
    compensator.reset(command(0.65));
    let mut free = Section::at_level(command(0.65));
    let mut at_limit = 0;
    for _ in 0..5000 {
        let (output, unclamped) =
            (compensator.update(command(0.85)), free.update(design.coefficients(), command(0.85)));
        at_limit += u32::from(output == Command::ONE);
        assert_eq!(output == Command::ONE, unclamped >= Throttle::from(Command::ONE));
    }
    assert!(at_limit > 50, "the step was to reach the limit");
    assert_eq!(compensator.output(), command(0.85));
}

/// Whenever the compensator is taken out after a step, a leftover that fades too slowly drives the motor past its command.
/// Left in, the motor overshoots by the 4 % of the poles themselves; a fade over 256 ticks would make that 55 %.
#[test]
fn taken_out_after_a_step_it_does_not_drive_the_motor_past_its_command() {
    let design = paper_design();
    let (from, to) = (0.4, 0.5);
    let pole = design.lead().omega_z_rad_s / design.loop_rate_hz();
    let overshoot = |taken_out_at: usize| {
        let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
        compensator.reset(command(from));
        let (mut motor, mut highest) = (from, from);
        for tick in 0..10_000 {
            if tick == taken_out_at {
                compensator.set_enabled(false);
            }
            motor += pole * (compensator.update(command(to)).to_f64() - motor);
            highest = f64::max(highest, motor);
        }
        (highest - to) / (to - from)
    };
    let left_in = overshoot(usize::MAX);
    let (worst, at) =
        (2..2000).step_by(6).map(|at| (overshoot(at), at)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a });
    println!(
        "overshoot of the motor: {:.1} % left in, {:.1} % taken out {at} ticks after the step",
        left_in * 1e2,
        worst * 1e2
    );
    assert!(worst < 0.125, "{worst} at {at}");
}
