//! The slew limit of a lead: the limited section against its equations in 128 bits, against the rotor that it reckons with, and
//! against a plain limiter.

use host_tests::{any_design, cases, lead_settling_ticks, paper_design};
use proptest::prelude::*;
use rotorlead::biquad::{LimitedCoefficients, LimitedSection, Section};
use rotorlead::compensator::{Compensator, Filter, LeadFilter};
use rotorlead::controller::{self, FilterError};
use rotorlead::design::{DesignError, LeadDesign, slew_limit};
use rotorlead::inverse::SlewLimit;
use rotorlead::settings::Settings;
use rotorlead::throttle::{Command, FRACTION_BITS};

const ONE: i32 = 1 << FRACTION_BITS;

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

/// Accepted leads with slew limits from some steps of 2^-16 per tick to the whole range.
fn any_limited() -> impl Strategy<Value = LeadDesign> {
    (any_design(), -15.0..0.0_f64)
        .prop_filter_map("refused", |(design, slew)| design.with_slew(slew.exp2() * design.loop_rate_hz()).ok())
}

fn any_command() -> impl Strategy<Value = Command> {
    prop_oneof![
        4 => (0..=ONE).prop_map(Command::saturating_from_bits),
        1 => Just(Command::ZERO),
        1 => Just(Command::ONE),
    ]
}

/// Ranges of the output: the full one, any, and a single output.
fn any_range() -> impl Strategy<Value = (Command, Command)> {
    prop_oneof![
        2 => Just((Command::ZERO, Command::ONE)),
        3 => (any_command(), any_command()).prop_map(|(a, b)| (a.min(b), a.max(b))),
        1 => any_command().prop_map(|only| (only, only)),
    ]
}

/// Commands that are held, each for some ticks.
fn any_inputs() -> impl Strategy<Value = Vec<Command>> {
    proptest::collection::vec((any_command(), prop_oneof![Just(1_usize), 1..200_usize]), 1..40)
        .prop_map(|parts| parts.into_iter().flat_map(|(command, ticks)| vec![command; ticks]).collect())
}

/// The limited section as `docs/fixed-point.md` has it, in 128 bits, and with its bounds.
struct Equations {
    /// `k, c, g0, g1` in 2^-32, and `r` in 2^-31.
    coefficients: [i128; 4],
    retained: i128,
    min: i128,
    max: i128,
    slew: i128,
    y: i128,
    x: i128,
    dx: i128,
    /// The accumulator, in 2^-61.
    sum: i128,
}

impl Equations {
    fn new(filter: &LeadFilter, (min, max): (Command, Command), level: Command) -> Self {
        let LeadFilter { coefficients, slew } = filter;
        let [k, c, g0, g1] = [coefficients.k(), coefficients.c(), coefficients.g0(), coefficients.g1()].map(i128::from);
        let [min, max, level] = [min, max, level].map(|command| i128::from(command.to_bits()));
        let one = 1_i128 << 32;
        let rate = ((c << 31) + (c + g0) / 2).div_euclid(c + g0);
        Self {
            coefficients: [k, c, g0, g1],
            retained: ((-k - rate) << 31) / (one + k),
            min,
            max,
            slew: slew.per_tick().into(),
            y: level.clamp(min, max),
            x: level,
            dx: 0,
            sum: 1 << 31,
        }
    }

    /// The next output, and whether a limit changed it.
    fn update(&mut self, input: Command) -> (i128, bool) {
        let [k, c, g0, g1] = self.coefficients;
        let x = i128::from(input.to_bits());
        let dx = x - self.x;
        self.sum += k * (self.sum >> 32) + c * (x - self.y) + g0 * dx + g1 * self.dx;
        (self.x, self.dx) = (x, dx);
        let change = self.sum >> 32;
        assert!(change.abs() < 5 * i128::from(ONE) / 2, "the output is to change by {change}");
        let wanted = self.y + change;
        let y = wanted.clamp(self.y - self.slew, self.y + self.slew).clamp(self.min, self.max);
        if y != wanted {
            let cut_off = wanted - y;
            self.sum += self.retained * 2 * (cut_off - cut_off.signum());
        }
        assert!(self.sum.abs() < 4 << 61, "the accumulator overflows");
        self.y = y;
        (y, y != wanted)
    }
}

proptest! {
    #![proptest_config(cases(512))]

    #[test]
    fn a_tick_is_the_equations_bit_for_bit(
        design in any_limited(),
        range in any_range(),
        level in any_command(),
        inputs in any_inputs(),
    ) {
        let filter = design.filter();
        let mut expected = Equations::new(&filter, range, level);
        let coefficients = LimitedCoefficients::from(filter.coefficients);
        let mut section = LimitedSection::at_rest(range.0, range.1, filter.slew, level);
        for &input in &inputs {
            let last = expected.y;
            let (y, _) = expected.update(input);
            prop_assert_eq!(i128::from(section.update(&coefficients, input).to_bits()), y);
            prop_assert!((y - last).abs() <= expected.slew && (expected.min..=expected.max).contains(&y));
        }
    }

    /// What the section would put out, from a rotor with the pole of the lead's zero that got its outputs: nothing else is in its
    /// state, so nothing can wind up. `H(z) = b0 (1 + z^-1) (1 - (1 - d) z^-1) / D(z)`, and `D(z)` over the last factor is a part
    /// of the last output and a part of what such a rotor makes of the ones before.
    #[test]
    fn its_state_is_that_of_a_rotor_that_got_its_outputs(
        design in any_limited(),
        range in any_range(),
        level in any_command(),
        inputs in any_inputs(),
    ) {
        let filter = design.filter();
        let part = |bits: i32| f64::from(bits) / 2.0_f64.powi(32);
        let (k, c, b0) = (part(filter.coefficients.k()), part(filter.coefficients.c()),
            part(filter.coefficients.c()) + part(filter.coefficients.g0()));
        let rate = c / (2.0 * b0);
        let of_last = c - k - rate;
        let (min, max) = (range.0.to_f64(), range.1.to_f64());
        let slew = f64::from(filter.slew.per_tick()) / f64::from(ONE);
        // Rounding, and the step by which what is cut off is reduced, each summed by the rotor.
        let tolerance = 8.0 / f64::from(ONE) * (1.0 + 1.0 / rate);

        let mut compensator = Compensator::new(filter, range.0, range.1);
        let level = level.clamp_to(range.0, range.1);
        compensator.reset(level);
        let [mut rotor, mut last, mut before, mut last_input] = [level.to_f64(); 4];
        for &input in &inputs {
            rotor += rate * (before - rotor);
            let change = b0 * (input.to_f64() + last_input) - of_last * last - (2.0 * b0 - of_last) * rotor;
            let expected = (last + change.clamp(-slew, slew)).clamp(min, max);
            let output = compensator.update(input).to_f64();
            prop_assert!((output - expected).abs() < tolerance, "{output} for {expected} within {tolerance}");
            (before, last, last_input) = (last, output, input.to_f64());
        }
    }

    /// With every slew, range and command: within the range the command, beyond it the end.
    #[test]
    fn the_steady_output_is_the_input_to_the_last_bit_and_stays(
        design in any_limited().prop_filter("long", |design| lead_settling_ticks(design) < 400_000),
        range in any_range(),
        history in any_inputs(),
        level in any_command(),
    ) {
        let filter = design.filter();
        let mut compensator = Compensator::new(filter, range.0, range.1);
        for &input in &history {
            compensator.update(input);
        }
        let neighbor = Command::saturating_from_bits(if level.to_bits() > 0 { level.to_bits() - 1 } else { 1 });
        for input in [level, neighbor, range.1, range.0] {
            for _ in 0..lead_settling_ticks(&design) {
                compensator.update(input);
            }
            for _ in 0..1000 {
                prop_assert_eq!(compensator.update(input), input.clamp_to(range.0, range.1));
            }
        }
    }

    /// Without a slew limit it is the section and a clamp behind it.
    #[test]
    fn without_a_slew_limit_not_a_bit_changes(
        design in any_design(),
        range in any_range(),
        level in any_command(),
        inputs in any_inputs(),
    ) {
        let filter = design.with_slew(0.0).unwrap().filter();
        prop_assert_eq!(Filter::from(filter), Filter::from(*design.coefficients()));
        let mut compensator = Compensator::new(filter, range.0, range.1);
        compensator.reset(level);
        let mut section = Section::at_level(level);
        for &input in &inputs {
            let expected = section.update(design.coefficients(), input).clamp_to(range.0, range.1);
            prop_assert_eq!(compensator.update(input), expected);
        }
    }

    /// The tick of a switch moves the output by no more than the tick before it. Then it moves by the slew, and by what the offset
    /// loses that the switch left, which is at most the slew and the last change of the command.
    #[test]
    fn switched_in_and_restarted_it_exceeds_the_slew_by_what_the_offset_loses(
        design in any_limited(),
        levels in proptest::collection::vec(any_command(), 2..20),
        bypassed in 2..100_usize,
        ramp in 1..100_i32,
    ) {
        let filter = design.filter();
        let (slew, damping) = (filter.slew.per_tick(), -i64::from(filter.coefficients.k()));
        let mut compensator = Compensator::new(filter, Command::ZERO, Command::ONE);
        let mut last = compensator.output().to_bits();
        for level in levels {
            compensator.set_enabled(false);
            let (from, to) = (last, level.to_bits());
            let mut change = 0;
            for tick in 0..bypassed as i32 {
                let at = i64::from(from) + i64::from(to - from) * i64::from(tick.min(ramp)) / i64::from(ramp);
                let output = compensator.update(Command::saturating_from_bits(at as i32)).to_bits();
                (change, last) = (output - last, output);
            }
            compensator.set_enabled(true);
            let output = compensator.update(level).to_bits();
            prop_assert!((output - last).abs() <= change.abs());
            // Its target is a slew away at most from the output before.
            let offset = i64::from(slew) + i64::from(change.abs());
            let most = i64::from(slew) + ((offset * damping) >> 33) + 1;
            last = output;
            for _ in 0..100 {
                let output = compensator.update(level).to_bits();
                prop_assert!(i64::from((output - last).abs()) <= most, "{} of {most}", output - last);
                last = output;
            }
        }
    }
}

/// Time until a rotor that is as slow as the lead's zero stays within 2 % of a step, milliseconds, and its overshoot in percent of it.
fn settled(mut update: impl FnMut(Command) -> Command, (from, to): (f64, f64)) -> (f64, f64) {
    let pole = paper_design().lead().omega_z_rad_s;
    let (mut rotor, mut settled, mut highest) = (from, 0, 0.0);
    for tick in 0..5000 {
        rotor += (update(command(to)).to_f64() - rotor) * -(-pole / 5000.0_f64).exp_m1();
        let part = (rotor - from) / (to - from);
        if (part - 1.0).abs() > 0.02 {
            settled = tick + 1;
        }
        highest = f64::max(highest, part);
    }
    (f64::from(settled) / 5.0, 100.0 * (highest - 1.0))
}

/// The figures of `docs/fixed-point.md`: the paper's lead with 2 % per millisecond.
#[test]
fn it_settles_sooner_than_with_a_plain_limiter_behind_the_section() {
    let design = paper_design().with_slew(20.0).unwrap();
    let slew = design.filter().slew.per_tick();
    let free = *design.coefficients();
    for (step, limited_ms, plain_ms) in
        [((0.4, 0.5), 68.4, 176.4), ((0.4, 0.7), 67.4, 264.8), ((0.9, 0.2), 126.8, 297.4)]
    {
        let mut compensator = Compensator::new(design.filter(), Command::ZERO, Command::ONE);
        compensator.reset(command(step.0));
        let limited = settled(|input| compensator.update(input), step);
        let mut section = Section::at_level(command(step.0));
        let mut last = command(step.0).to_bits();
        let plain = settled(
            |input| {
                let wanted = section.update(&free, input).to_bits();
                last = wanted.clamp(last - slew, last + slew).clamp(0, ONE);
                Command::saturating_from_bits(last)
            },
            step,
        );
        println!("{step:?}: settled after {:.1} ms, and with a plain limiter after {:.1} ms", limited.0, plain.0);
        println!("  overshoot {:.2} % and {:.2} %", limited.1, plain.1);
        assert!((limited.0 - limited_ms).abs() < 0.5 && (plain.0 - plain_ms).abs() < 0.5, "{limited:?} {plain:?}");
        // That of the poles themselves is 4.3 %.
        assert!(limited.1 < 4.5, "wound up: {limited:?}");
    }
}

/// A full step up and back: the output turns within two ticks, as the section's zero at -1 takes the mean of two inputs, however long it
/// was limited.
#[test]
fn a_step_back_is_answered_within_two_ticks() {
    let design = paper_design().with_slew(20.0).unwrap();
    let slew = design.filter().slew.per_tick();
    let mut compensator = Compensator::new(design.filter(), command(0.05), Command::ONE);
    compensator.reset(command(0.05));
    // Some 240 ticks up at the slew, and then at the limit.
    for ticks in [50, 240, 1000] {
        for _ in 0..ticks {
            compensator.update(Command::ONE);
        }
        let top = compensator.update(command(0.05)).to_bits();
        assert_eq!(top - compensator.update(command(0.05)).to_bits(), slew, "after {ticks} ticks");
        for _ in 0..5000 {
            compensator.update(command(0.05));
        }
    }
}

#[test]
fn both_kinds_have_the_slew_limit_of_the_settings() {
    let filters = |slew_per_s: f64| {
        let settings = Settings { slew_per_s, ..Settings::default() }.validate().unwrap();
        controller::filters(&settings)
    };
    for (slew_per_s, expected) in [(20.0, slew_limit(20.0, 5000.0).unwrap()), (0.0, SlewLimit::NONE)] {
        let [Filter::Lead(lead), ..] = filters(slew_per_s).unwrap() else { panic!("the default is a lead") };
        assert_eq!(lead.slew, expected);
    }
    assert_eq!(Settings::default().slew_per_s, 20.0);
    // 2 % per millisecond, in whole steps of 2^-16 per tick of 200 us.
    assert_eq!(slew_limit(20.0, 5000.0).unwrap().per_tick(), 262 << 13);
    let error = filters(0.01).unwrap_err();
    assert!(matches!(error, FilterError::Lead(DesignError::SlewTooSlow { .. })), "{error:?}");
}

/// The paper's lead asks for 6.3 % per millisecond after a step of 10 % (0.1 omega_f^2 / omega_z), which over a tick is 6.1; ESCs do not
/// follow that.
#[test]
fn a_step_asks_for_no_more_than_the_slew() {
    let highest_per_ms = |design: LeadDesign| {
        let mut compensator = Compensator::new(design.filter(), Command::ZERO, Command::ONE);
        compensator.reset(command(0.5));
        let outputs: Vec<f64> = (0..500).map(|_| compensator.update(command(0.6)).to_f64()).collect();
        let from_start: Vec<f64> = std::iter::once(0.5).chain(outputs).collect();
        5.0 * from_start.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
    };
    let free = highest_per_ms(paper_design());
    assert!((free - 0.0613).abs() < 0.0005, "{free}");
    let limited = highest_per_ms(paper_design().with_slew(20.0).unwrap());
    assert!((0.0199..=0.02).contains(&limited), "{limited}");
}
