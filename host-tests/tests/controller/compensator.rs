//! One motor's filter, a lead or an inverse: bypass, bumpless switching, limits without wind-up, reset.

use std::f64::consts::TAU;

use host_tests::{
    any_design, any_filter, any_inverse, cases, multisine, paper_curve, paper_design, paper_filters, pole_at, settled,
};
use proptest::prelude::*;
use rotorlead::biquad::Section;
use rotorlead::compensator::{CommandRange, Compensator, Filter};
use rotorlead::design::{CurvePoint, DEFAULT_DAMPING, InverseDesign, ReferenceModel};
use rotorlead::inverse::{ConditionedInverse, Limits};
use rotorlead::throttle::{Command, FRACTION_BITS, Throttle};

/// Half a step of an inverse's output, in LSB: what it may be off a constant command.
const HALF_STEP: i32 = 1 << 12;

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

fn any_command() -> impl Strategy<Value = Command> {
    (0..=1_i32 << FRACTION_BITS).prop_map(Command::saturating_from_bits)
}

/// The same to within what the filter rounds its output to.
fn is_near(filter: &Filter, output: Command, command: Command) -> bool {
    let tolerance = if matches!(filter, Filter::Lead(_)) { 0 } else { HALF_STEP };
    (output.to_bits() - command.to_bits()).abs() <= tolerance
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

    /// A lead's does not change by a bit. That of an inverse, whose step is 2^-16, is at most half a step away from the bypass's.
    #[test]
    fn at_a_constant_input_switching_changes_nothing(
        filter in any_filter(),
        level in any_command(),
        switches in proptest::collection::vec(1..50_usize, 1..20),
    ) {
        let mut compensator = Compensator::new(filter.filter, Command::ZERO, Command::ONE);
        compensator.reset(level);
        let mut enabled = true;
        for ticks in switches {
            enabled = !enabled;
            compensator.set_enabled(enabled);
            for _ in 0..ticks {
                let output = compensator.update(level);
                prop_assert!(is_near(&filter.filter, output, level), "{output:?} for {level:?}");
            }
        }
    }

    /// Also where the command leaves the range in which an inverse knows its rotor, or comes back.
    #[test]
    fn in_motion_no_step_at_a_switch_is_larger_than_the_step_before_it(
        filter in any_filter(),
        motion in any_motion(),
        switches in proptest::collection::vec(2..3000_usize, 1..10),
        limits in (0.0..0.3, 0.7..1.0),
    ) {
        let mut compensator = Compensator::new(filter.filter, command(limits.0), command(limits.1));
        compensator.reset(motion[0]);
        let mut outputs = Vec::new();
        let (mut enabled, mut was_in_path) = (true, true);
        for (n, &input) in motion.iter().enumerate() {
            if switches.contains(&n) {
                enabled = !enabled;
                compensator.set_enabled(enabled);
            }
            let is_in_path = enabled && filter.covers(input);
            outputs.push(compensator.update(input).to_bits());
            prop_assert_eq!(compensator.is_enabled(), enabled);
            if is_in_path != was_in_path && n >= 2 {
                let (now, before) = (outputs[n] - outputs[n - 1], outputs[n - 1] - outputs[n - 2]);
                prop_assert!(now.abs() <= before.abs(), "a step of {now} after {before}");
            }
            was_in_path = is_in_path;
        }
    }

    /// The offset of a switch decays, and the output is then that of a filter that was never switched out (or, out of the path,
    /// the input).
    #[test]
    fn a_switch_is_forgotten(filter in any_filter(), level in any_command(), start in any_command(), on in any::<bool>()) {
        let mut compensator = Compensator::new(filter.filter, Command::ZERO, Command::ONE);
        compensator.reset(start);
        compensator.set_enabled(!on);
        for n in 0..200 {
            compensator.update(if n % 2 == 0 { start } else { level });
        }
        compensator.set_enabled(on);
        for _ in 0..filter.settling_ticks {
            compensator.update(level);
        }
        let expected = if on && filter.covers(level) { settled(&filter.filter, level) } else { level };
        for _ in 0..100 {
            prop_assert_eq!(compensator.update(level), expected);
        }
        prop_assert_eq!(compensator.is_enabled(), on);
    }

    /// Where the limits have no multiple of 2^-16 between them, an inverse takes the nearest to the lower one.
    #[test]
    fn the_output_stays_within_its_limits_whatever_happens(
        filter in any_filter(),
        (min, max) in (any_command(), any_command()),
        events in proptest::collection::vec((any::<i32>(), 0..10_u8), 1..2000),
    ) {
        let mut compensator = Compensator::new(filter.filter, min, max);
        let range = if min <= max { min..=max } else { min..=min };
        let step = 2 * HALF_STEP;
        let has_outputs = (range.start().to_bits() + step - 1) / step <= range.end().to_bits() / step;
        for (bits, event) in events {
            match event {
                0 => compensator.set_enabled(bits & 1 == 0),
                1 => compensator.reset(Command::saturating_from_bits(bits)),
                2 => compensator.restart(Command::saturating_from_bits(bits)),
                _ => {}
            }
            let output = compensator.update(Command::saturating_from_bits(bits));
            let is_nearest = !has_outputs && is_near(&filter.filter, output, min);
            prop_assert!(range.contains(&output) || is_nearest, "{output:?} outside {range:?}");
        }
    }

    /// Within its range an inverse in the path is the recurrence alone.
    #[test]
    fn an_inverse_in_the_path_is_the_recurrence_bit_for_bit((design, _) in any_inverse(), slew_per_s in 20.0..500.0_f64,
        levels in proptest::collection::vec((any_command(), 1..300_usize), 2..20), (min, max) in (0.0..0.4, 0.6..1.0)) {
        let (min, max) = (command(min), command(max));
        let Ok(filter) = design.filter(slew_per_s, CommandRange::FULL) else { return Ok(()) };
        let mut compensator = Compensator::new(filter, min, max);
        let mut alone = ConditionedInverse::at_rest(Limits::new(min, max, filter.slew), levels[0].0);
        compensator.reset(levels[0].0);
        for (level, ticks) in levels {
            for _ in 0..ticks {
                prop_assert_eq!(compensator.update(level), alone.update(design.coefficients(), level));
            }
        }
    }

    /// A command that leaves the range gets the bypass, and one that returns the inverse, without a call of `set_enabled`.
    #[test]
    fn outside_its_range_an_inverse_is_bypassed(filter in any_filter(), inside in 0.0..=1.0_f64, outside in any_command()) {
        let Filter::Inverse(inverse) = filter.filter else { return Ok(()) };
        let (lowest, highest) = (inverse.range.lowest, inverse.range.highest);
        let inside = command(lowest.to_f64() + inside * (highest.to_f64() - lowest.to_f64())).clamp_to(lowest, highest);
        let mut compensator = Compensator::new(filter.filter, Command::ZERO, Command::ONE);
        compensator.reset(inside);
        for (level, expected) in [
            (inside, settled(&filter.filter, inside)),
            (outside, if filter.covers(outside) { settled(&filter.filter, outside) } else { outside }),
            (inside, settled(&filter.filter, inside)),
        ] {
            for _ in 0..filter.settling_ticks {
                compensator.update(level);
                prop_assert!(compensator.is_enabled());
            }
            prop_assert_eq!(compensator.update(level), expected);
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
    fn a_fade_does_not_hold_the_output_at_a_limit(filter in any_filter(), motion in any_motion(), swing in 1.0..4.0_f64,
        switch in 2..3000_usize, (min, max) in (0.3..0.45, 0.55..0.7)) {
        let (min, max) = (command(min), command(max));
        let mut compensator = Compensator::new(filter.filter, min, max);
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
    fn there_and_back_between_two_ticks_changes_nothing(filter in any_filter(), motion in any_motion(),
        switches in proptest::collection::vec(2..3000_usize, 1..5), toggles in proptest::collection::vec(2..3000_usize, 1..50)) {
        let mut left_alone = Compensator::new(filter.filter, command(0.2), command(0.8));
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
        filter in any_filter(),
        motion in any_motion(),
        restarts in proptest::collection::vec((2..3000_usize, any_command(), any::<bool>(), any::<bool>()), 1..10),
    ) {
        let mut compensator = Compensator::new(filter.filter, Command::ZERO, Command::ONE);
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
    for filter in paper_filters() {
        let mut compensator = Compensator::new(filter, command(0.1), command(0.9));
        compensator.set_enabled(false);
        compensator.reset(command(0.5));
        for value in [0.5, 0.0, 1.0, 0.3] {
            assert_eq!(compensator.update(command(value)), command(value).clamp_to(command(0.1), command(0.9)));
        }
        assert!(!compensator.is_enabled());
    }
}

#[test]
fn a_reset_is_at_rest_at_its_level_whatever_came_before() {
    for filter in paper_filters() {
        let mut compensator = Compensator::new(filter, Command::ZERO, Command::ONE);
        for &u in multisine(0.5, 0.4, 5000.0).iter().take(1234) {
            compensator.update(command(u));
        }
        compensator.set_enabled(false);
        compensator.update(command(0.1));
        compensator.set_enabled(true);
        compensator.reset(command(0.3));
        for _ in 0..1000 {
            assert_eq!(compensator.update(command(0.3)), settled(&filter, command(0.3)));
        }
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

/// A step that the slew limits for 40 ms: the output leaves the limit when the rotor needs less, and rests on the step.
#[test]
fn a_step_that_the_slew_limits_comes_back_without_delay() {
    let [_, filter] = paper_filters();
    let mut compensator = Compensator::new(filter, Command::ZERO, Command::ONE);
    compensator.reset(command(0.4));
    let slew = command(20.0 / 5000.0).to_bits();
    let (mut last, mut limited) = (command(0.4).to_bits(), 0);
    let curve = paper_curve();
    let (mut rotor, mut peak) = (0.4, 0.0_f64);
    for _ in 0..5000 {
        let output = compensator.update(command(0.7));
        let change = (output.to_bits() - last).abs();
        assert!(change <= slew);
        limited += u32::from(change > slew - 2 * HALF_STEP);
        last = output.to_bits();
        rotor += (output.to_f64() - rotor) * pole_at(&curve, rotor) / 5000.0;
        peak = peak.max(rotor);
    }
    println!("{limited} ticks at the slew, overshoot {:.2} %", (peak - 0.7) / 0.3 * 1e2);
    assert!(limited > 50, "the slew was to limit the step, in {limited} ticks");
    assert!(peak - 0.7 < 0.06 * 0.3, "wound up: {peak}");
    assert_eq!(compensator.output(), settled(&filter, command(0.7)));
}

/// Whenever the compensator is taken out after a step, a leftover that fades too slowly drives the motor past its command.
/// Left in, the motor overshoots by the 4 % of the poles themselves; a fade over 256 ticks would make that 55 %.
#[test]
fn taken_out_after_a_step_it_does_not_drive_the_motor_past_its_command() {
    let (from, to) = (0.4, 0.5);
    let pole = paper_design().lead().omega_z_rad_s;
    let [lead, inverse] = paper_filters();
    // That of the fastest operating point, for which the lead is, and one that depends on the speed.
    let fastest = vec![CurvePoint { command: 0.0, tau_s: 1.0 / pole }];
    for (filter, curve, most) in [(lead, fastest, 0.125), (inverse, paper_curve(), 0.13)] {
        let overshoot = |taken_out_at: usize| {
            let mut compensator = Compensator::new(filter, Command::ZERO, Command::ONE);
            compensator.reset(command(from));
            let (mut motor, mut highest) = (from, from);
            for tick in 0..10_000 {
                if tick == taken_out_at {
                    compensator.set_enabled(false);
                }
                motor += pole_at(&curve, motor) / 5000.0 * (compensator.update(command(to)).to_f64() - motor);
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
        assert!(worst < most, "{worst} at {at}");
    }
}

/// A command that leaves the range of the inverse for less than the rotor's lag: where the inverse returns with the state of a rotor that
/// rests at that command, it brakes one that never got there.
#[test]
fn a_short_way_out_of_its_range_leaves_the_rotor_where_it_is() {
    let curve = paper_curve();
    let reference = ReferenceModel { omega_f_rad_s: 94.2, damping: DEFAULT_DAMPING };
    let design = InverseDesign::new(reference, 5000.0, &curve).unwrap();
    let range = CommandRange { lowest: command(0.35), highest: command(0.70) };
    for (level, outside) in [(0.5, 0.75), (0.65, 0.95), (0.45, 0.1)] {
        for ticks in [1, 20, 100, 300] {
            let mut compensator = Compensator::new(design.filter(0.0, range).unwrap(), command(0.05), Command::ONE);
            compensator.reset(command(level));
            let mut v: f64 = level;
            let (mut least, mut most) = (v, v);
            for tick in 0..5000 {
                let input = if (1000..1000 + ticks).contains(&tick) { outside } else { level };
                let u = compensator.update(command(input)).to_f64();
                v += (u - v) * -(-pole_at(&curve, v) / 5000.0).exp_m1();
                (least, most) = (least.min(v), most.max(v));
            }
            // What it overshoots on its way back is a part of the way.
            let way = (most - level).max(level - least);
            let beyond = if outside > level { level - least } else { most - level };
            assert!(beyond < 0.06 * way + 2e-4, "{level} {outside} {ticks}: {least} to {most}");
        }
    }
}
