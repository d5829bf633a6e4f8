//! The conditioned inverse against its claims: exact steady output, limits, precision, and what it makes of a rotor.

use host_tests::{TABLE_1, cases};
use proptest::prelude::*;
use rotorlead::design::{CurvePoint, InverseDesign, ReferenceModel};
use rotorlead::inverse::{ConditionedInverse, Limits, OUTPUT_BITS, TABLE_POINTS};
use rotorlead::throttle::Command;

/// One step of the output, 2^-16.
const STEP: f64 = 1.0 / (1_u32 << OUTPUT_BITS) as f64;
/// Slew limits of ESCs, units of the command per second: none, and 16, 6 and 2 % per millisecond.
const SLEWS_PER_S: [f64; 4] = [0.0, 160.0, 60.0, 20.0];

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

/// A design with what it was made from.
#[derive(Clone, Debug)]
struct Case {
    design: InverseDesign,
    curve: Vec<CurvePoint>,
    limits: Limits,
}

impl Case {
    /// Seconds after which the output rests on a constant input.
    fn settling_s(&self) -> f64 {
        let slowest_s = self.curve.iter().map(|point| point.tau_s).fold(0.0, f64::max);
        let reference = self.design.reference();
        let slew_per_tick = f64::from(self.limits.slew_per_tick()) / f64::from(Command::ONE.to_bits());
        8.0 * slowest_s
            + 30.0 * reference.damping.max(1.0) / reference.damping.min(1.0) / reference.omega_f_rad_s
            + 4.0 / (slew_per_tick * self.design.loop_rate_hz())
    }

    fn settling_ticks(&self) -> u32 {
        (self.settling_s() * self.design.loop_rate_hz()) as u32
    }
}

/// Accepted designs from a slow loop with the fastest reference model to a fast one, with curves of 1 to 9 points.
fn any_case() -> impl Strategy<Value = Case> {
    cases_within((200.0, 10_000.0), 4000.0)
}

/// Those of the controller's loop rates, and of natural frequencies that a motor is asked for.
fn usual_case() -> impl Strategy<Value = Case> {
    cases_within((1000.0, 10_000.0), 200.0)
}

fn cases_within(loop_rates_hz: (f64, f64), fastest_rad_s: f64) -> impl Strategy<Value = Case> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let reference = (log(loop_rates_hz.0, loop_rates_hz.1), log(10.0, fastest_rad_s), 0.3..2.0_f64);
    let curve = (proptest::collection::vec(0.5..1.6_f64, 1..=9), log(0.5, 40.0));
    let range = (0.0..0.5_f64, 0.5..=1.0_f64, any::<[bool; 2]>());
    let slew_per_s = prop_oneof![Just(0.0), log(1.0, 500.0)];
    (reference, curve, range, slew_per_s).prop_filter_map(
        "refused",
        |((loop_rate_hz, omega_f_rad_s, damping), (ratios, slowest), (low, high, [from_0, to_1]), slew_per_s)| {
            let last = (ratios.len() - 1).max(1) as f64;
            let mut tau_s = slowest / omega_f_rad_s;
            let mut curve = Vec::new();
            for (i, ratio) in ratios.iter().enumerate() {
                tau_s *= ratio;
                curve.push(CurvePoint { command: i as f64 / last, tau_s });
            }
            let design = InverseDesign::new(ReferenceModel { omega_f_rad_s, damping }, loop_rate_hz, &curve).ok()?;
            let (low, high) = (if from_0 { 0.0 } else { low }, if to_1 { 1.0 } else { high });
            let limits = design.limits(command(low), command(high), slew_per_s).ok()?;
            Some(Case { design, curve, limits })
        },
    )
}

/// The rotor of the paper's Table 1. Outside of it the curve is assumed: 2.6 rad/s at 0 and 24 rad/s at 1.
fn paper_curve() -> Vec<CurvePoint> {
    let ends = [(0.0, 2.6), (1.0, 24.0)];
    let mut poles: Vec<_> = TABLE_1.iter().map(|&(command, _, pole)| (command, pole)).chain(ends).collect();
    poles.sort_by(|a, b| a.0.total_cmp(&b.0));
    poles.into_iter().map(|(command, pole)| CurvePoint { command, tau_s: 1.0 / pole }).collect()
}

fn paper_inverse() -> InverseDesign {
    let reference = ReferenceModel { omega_f_rad_s: 94.2156, damping: 0.5_f64.sqrt() };
    InverseDesign::new(reference, 5000.0, &paper_curve()).expect("a design")
}

/// `1 / tau` of a curve at `command`.
fn pole_at(curve: &[CurvePoint], command: f64) -> f64 {
    let pole = |point: &CurvePoint| 1.0 / point.tau_s;
    let upper = curve.iter().position(|point| point.command >= command);
    match upper {
        None => pole(&curve[curve.len() - 1]),
        Some(0) => pole(&curve[0]),
        Some(upper) => {
            let (low, high) = (&curve[upper - 1], &curve[upper]);
            pole(low) + (command - low.command) / (high.command - low.command) * (pole(high) - pole(low))
        }
    }
}

/// The recurrence in `f64`, from its equations: neither the coefficients nor the output are rounded.
struct Exact {
    a: f64,
    b: f64,
    gains: [f64; TABLE_POINTS],
    min: f64,
    max: f64,
    slew: f64,
    v: f64,
    x: f64,
    u: f64,
}

impl Exact {
    fn at_rest(case: &Case, level: Command) -> Self {
        let ReferenceModel { omega_f_rad_s, damping } = *case.design.reference();
        let rate = case.design.loop_rate_hz();
        let decay = (-damping * omega_f_rad_s / rate).exp();
        let squared = 1.0 - damping * damping;
        let angle = omega_f_rad_s * squared.abs().sqrt() / rate;
        let cosine = if squared >= 0.0 { angle.cos() } else { angle.cosh() };
        let a = (1.0 + decay * decay - 2.0 * decay * cosine).sqrt();
        let gains = std::array::from_fn(|i| a / (1.0 - (-pole_at(&case.curve, i as f64 / 32.0) / rate).exp()));
        let (min, max) = (case.limits.min().to_f64(), case.limits.max().to_f64());
        let slew = f64::from(case.limits.slew_per_tick()) / f64::from(Command::ONE.to_bits());
        let level = rounded(level.to_f64()).clamp(min, max);
        Self { a, b: 1.0 - decay * decay, gains, min, max, slew, v: level, x: 0.0, u: level }
    }

    fn update(&mut self, input: Command) -> f64 {
        let reference = rounded(input.to_f64()).clamp(self.min, self.max);
        let index = ((32.0 * self.v) as usize).min(TABLE_POINTS - 2);
        let part = 32.0 * self.v - index as f64;
        let (low, high) = (self.gains[index], self.gains[index + 1]);
        let x = self.x + self.a * (reference - self.v) - self.b * self.x;
        let wanted = self.v + (low + part * (high - low)) * x;
        self.u = wanted.clamp(self.min.max(self.u - self.slew), self.max.min(self.u + self.slew));
        self.x = x + (self.u - wanted) * (1.0 / low + part * (1.0 / high - 1.0 / low));
        self.v = (self.v + self.a * self.x).clamp(self.min, self.max);
        self.u
    }
}

/// To the step of the output.
fn rounded(value: f64) -> f64 {
    (value / STEP + 0.5).floor() * STEP
}

proptest! {
    #![proptest_config(cases(8000))]

    /// The reference is confined and rounded as documented, and reached from another one in the middle of its response.
    #[test]
    fn the_steady_output_is_the_reference_to_the_last_bit_and_stays(
        case in any_case(),
        [start, detour, reference] in [0.0..=1.0_f64, 0.0..=1.0, 0.0..=1.0],
        detour_part in 0.0..0.1_f64,
    ) {
        let coefficients = case.design.coefficients();
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(start));
        let ticks = case.settling_ticks();
        for _ in 0..(detour_part * f64::from(ticks)) as u32 {
            inverse.update(coefficients, command(detour));
        }
        for _ in 0..ticks {
            inverse.update(coefficients, command(reference));
        }
        let want = command(rounded(command(reference).to_f64())).clamp_to(case.limits.min(), case.limits.max());
        for _ in 0..ticks / 4 {
            prop_assert_eq!(inverse.update(coefficients, command(reference)), want);
        }
    }
}

/// References with the time for which each is held, in parts of the settling time.
fn any_references() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let reference = prop_oneof![4 => 0.0..=1.0_f64, 1 => Just(0.0), 1 => Just(1.0)];
    proptest::collection::vec((reference, (-8.0..0.0_f64).prop_map(f64::exp)), 1..20)
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn it_is_within_8_steps_of_the_unrounded_recurrence(case in usual_case(), references in any_references()) {
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(references[0].0));
        let mut exact = Exact::at_rest(&case, command(references[0].0));
        for (reference, part) in references {
            for _ in 0..(part * case.settling_s() * case.design.loop_rate_hz()) as u32 {
                let got = inverse.update(case.design.coefficients(), command(reference)).to_f64();
                let want = exact.update(command(reference));
                prop_assert!((got - want).abs() <= 8.0 * STEP, "{got} for {want}: {} steps", (got - want).abs() / STEP);
            }
        }
    }

    #[test]
    fn output_and_rotor_stay_within_the_limits(case in any_case(), references in any_references()) {
        let (min, max) = (case.limits.min(), case.limits.max());
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(references[0].0));
        for (reference, part) in references {
            for _ in 0..(part * f64::from(case.settling_ticks())) as u32 {
                let last = inverse.output();
                let output = inverse.update(case.design.coefficients(), command(reference));
                prop_assert!((min..=max).contains(&output) && (min..=max).contains(&inverse.rotor_state()));
                prop_assert!((output.to_bits() - last.to_bits()).abs() <= case.limits.slew_per_tick());
                prop_assert_eq!(output.to_bits() % (1 << 13), 0);
            }
        }
    }

    /// Switched in at whatever state and command: the input at rest passes.
    #[test]
    fn it_switches_in_without_a_jump(case in any_case(), references in any_references(), level in 0.0..=1.0_f64) {
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(references[0].0));
        for (reference, _) in references {
            inverse.update(case.design.coefficients(), command(reference));
        }
        inverse.reset(command(level));
        let want = command(rounded(command(level).to_f64())).clamp_to(case.limits.min(), case.limits.max());
        prop_assert_eq!(inverse.output(), want);
        for _ in 0..100 {
            prop_assert_eq!(inverse.update(case.design.coefficients(), command(level)), want);
        }
    }
}

/// A simulated response to a step: rise time 10 to 90 % and overshoot over the step.
struct Response {
    rise_s: f64,
    overshoot: f64,
}

/// The response of the rotor of Table 1, in units of the command, to a `drive` that gives the command of each tick.
fn response(from: f64, to: f64, seconds: f64, mut drive: impl FnMut() -> f64) -> Response {
    let (curve, rate) = (paper_curve(), 5000.0);
    let (mut v, mut peak) = (from, 0.0_f64);
    let (mut at_10, mut at_90) = (None, None);
    for tick in 0..(seconds * rate) as u32 {
        v += (drive() - v) * (1.0 - (-pole_at(&curve, v) / rate).exp());
        let part = (v - from) / (to - from);
        let seconds = f64::from(tick + 1) / rate;
        at_10 = at_10.or((part >= 0.1).then_some(seconds));
        at_90 = at_90.or((part >= 0.9).then_some(seconds));
        peak = peak.max(part);
    }
    let rise_s = at_90.zip(at_10).map_or(f64::INFINITY, |(end, begin)| end - begin);
    Response { rise_s, overshoot: peak - 1.0 }
}

fn inverse_response(from: f64, to: f64, slew_per_s: f64) -> Response {
    let design = paper_inverse();
    let limits = design.limits(command(0.05), Command::ONE, slew_per_s).expect("limits");
    let mut inverse = ConditionedInverse::at_rest(limits, command(from));
    response(from, to, 2.0, || inverse.update(design.coefficients(), command(to)).to_f64())
}

/// The rise when the command runs to its limit and never brakes.
fn physical_bound_s(from: f64, to: f64, slew_per_s: f64) -> f64 {
    let slew = if slew_per_s == 0.0 { 1.0 } else { slew_per_s / 5000.0 };
    let (mut u, limit) = (from, if to > from { 1.0 } else { 0.05 });
    response(from, to, 2.0, || {
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
        let (mut fastest_ms, mut slowest_ms, mut overshoot) = (f64::INFINITY, 0.0_f64, 0.0_f64);
        for (nominal, _, _) in TABLE_1 {
            for to in [nominal + size, nominal - size] {
                let response = inverse_response(nominal, to, 0.0);
                fastest_ms = fastest_ms.min(1e3 * response.rise_s);
                slowest_ms = slowest_ms.max(1e3 * response.rise_s);
                overshoot = overshoot.max(response.overshoot);
            }
        }
        println!("step {size}: rise {fastest_ms:.1} to {slowest_ms:.1} ms, overshoot {:.2} %", 100.0 * overshoot);
        assert!(rise_ms.contains(&fastest_ms) && rise_ms.contains(&slowest_ms), "{fastest_ms} to {slowest_ms}");
        assert!(overshoot <= 0.06, "{overshoot}");
    }
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn a_limited_step_is_nearly_as_fast_as_the_limits_allow(from in 0.40..0.65_f64, size in -0.3..0.3_f64) {
        for slew_per_s in SLEWS_PER_S {
            let (response, bound_s) =
                (inverse_response(from, from + size, slew_per_s), physical_bound_s(from, from + size, slew_per_s));
            prop_assert!(response.overshoot <= 0.06, "{}", response.overshoot);
            prop_assert!(bound_s <= 0.025 || response.rise_s <= 1.3 * bound_s, "{} for {bound_s}", response.rise_s);
        }
    }
}
