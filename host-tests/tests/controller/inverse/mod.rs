//! The conditioned inverse against its claims: exact steady output, limits, bumpless switching, precision.

mod acceptance;
mod response;

use host_tests::{any_inverse, cases, pole_at, settling_s};
use proptest::prelude::*;
use rotorlead::design::{CurvePoint, InverseDesign, ReferenceModel};
use rotorlead::inverse::{ConditionedInverse, Limits, OUTPUT_BITS, TABLE_POINTS};
use rotorlead::throttle::Command;

/// One step of the output, 2^-16.
const STEP: f64 = 1.0 / (1_u32 << OUTPUT_BITS) as f64;

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
    fn settling_s(&self) -> f64 {
        let slew_per_tick = f64::from(self.limits.slew().per_tick()) / f64::from(Command::ONE.to_bits());
        settling_s(&self.design, &self.curve, slew_per_tick)
    }

    fn settling_ticks(&self) -> u32 {
        (self.settling_s() * self.design.loop_rate_hz()) as u32
    }
}

/// Accepted designs with limits of the output.
fn any_case() -> impl Strategy<Value = Case> {
    let range = (0.0..0.5_f64, 0.5..=1.0_f64, any::<[bool; 2]>());
    let slew_per_s = prop_oneof![Just(0.0), (4_f64.ln()..500_f64.ln()).prop_map(f64::exp)];
    (any_inverse(), range, slew_per_s).prop_filter_map(
        "refused",
        |((design, curve), (low, high, [from_0, to_1]), slew_per_s)| {
            let (low, high) = (if from_0 { 0.0 } else { low }, if to_1 { 1.0 } else { high });
            let limits = design.limits(command(low), command(high), slew_per_s).ok()?;
            Some(Case { design, curve, limits })
        },
    )
}

/// Those in which a step of the reference moves the output of the next tick by at most twice its size: `g A <= 2`.
fn calm_case() -> impl Strategy<Value = Case> {
    any_case().prop_filter("lively", |case| {
        let coefficients = case.design.coefficients();
        let highest = coefficients.gains().into_iter().max().map_or(0.0, f64::from);
        let (g, a) = (highest / 2.0_f64.powi(22), f64::from(coefficients.a()) / 2.0_f64.powi(30));
        g * a <= 2.0
    })
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
        let slew = f64::from(case.limits.slew().per_tick()) / f64::from(Command::ONE.to_bits());
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
        for _ in 0..ticks / 8 {
            prop_assert_eq!(inverse.update(coefficients, command(reference)), want);
            let deviation = f64::from(inverse.rotor_state().to_bits() - want.to_bits());
            // Towards an end of the range the rotor creeps under a limited command.
            let at_end = want == case.limits.min() || want == case.limits.max();
            prop_assert!(at_end || deviation.abs() <= case.design.rounding_error(), "{deviation} steps of 2^-29");
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
    fn it_is_within_8_steps_of_the_unrounded_recurrence(case in calm_case(), references in any_references()) {
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
                prop_assert!((output.to_bits() - last.to_bits()).abs() <= case.limits.slew().per_tick());
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
