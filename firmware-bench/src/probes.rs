//! The functions that are stepped through.

use core::hint::black_box;

use biquad::Biquad as _;
use dsp_fixedpoint::Q32;
use dsp_process::SplitProcess;
use idsp::iir::DirectForm1Dither;
use rotorlead::biquad::{Coefficients, LimitedCoefficients, LimitedSection, Section};
use rotorlead::compensator::{Filter, LeadFilter};
use rotorlead::controller;
use rotorlead::design::{CurvePoint, InverseDesign};
use rotorlead::inverse::{self, ConditionedInverse};
use rotorlead::settings::Validated;
use rotorlead::throttle::{Command, FRACTION_BITS, Throttle};
use stm32f4xx_hal::pac::{RCC, TIM2};

/// Samples of a block.
const BLOCK: usize = 32;
/// Filters that run side by side, one sample each, as in a control tick.
const MOTORS: usize = 4;
/// Ticks after a step until the output counts as steady: 20 s.
const SETTLING: u32 = 100_000;
/// A step from here to there. No multiples of the step of an output with 16 bits.
const LEVELS: [i32; 2] = [271_828_182, 314_159_265];
/// One in Q2.29.
const ONE: f64 = (1_u64 << FRACTION_BITS) as f64;

/// One filter: its name, its state, its coefficients, its samples, one tick of it, and a block as the crate has it.
macro_rules! filter {
    ($name:ident, $state:ty, $coefficients:ty, $input:ty, $output:ty, $update:expr, $block:expr, $to_bits:expr) => {
        pub mod $name {
            use super::*;

            /// Calls everything once.
            pub fn run(state: $state, coefficients: &$coefficients, from_bits: fn(i32) -> $input) {
                let x = from_bits(LEVELS[0]);
                let mut one = state.clone();
                let _ = black_box(black_box(call as fn(&mut $state, &$coefficients, $input) -> $output)(
                    black_box(&mut one),
                    black_box(coefficients),
                    black_box(x),
                ));
                let mut four = [state.clone(), state.clone(), state.clone(), state];
                let mut outputs = [<$output>::default(); MOTORS];
                black_box(
                    motors as fn(&mut [$state; MOTORS], &$coefficients, &[$input; MOTORS], &mut [$output; MOTORS]),
                )(
                    black_box(&mut four), black_box(coefficients), black_box(&[x; MOTORS]), black_box(&mut outputs)
                );
                let mut outputs = [<$output>::default(); BLOCK];
                black_box(block as fn(&mut $state, &$coefficients, &[$input; BLOCK], &mut [$output; BLOCK]))(
                    black_box(&mut one),
                    black_box(coefficients),
                    black_box(&[x; BLOCK]),
                    black_box(&mut outputs),
                );
                for bytes in [size_of::<$state>(), size_of::<$coefficients>()] {
                    let _ = black_box(black_box(size as fn(usize) -> usize)(bytes));
                }
                let steady = black_box(steady as fn(&mut $state, &$coefficients, $input) -> i32);
                let _ = steady(black_box(&mut one), black_box(coefficients), from_bits(LEVELS[1]));
            }

            /// One sample.
            #[inline(never)]
            pub fn call(state: &mut $state, coefficients: &$coefficients, x: $input) -> $output {
                $update(state, coefficients, x)
            }

            /// One sample of each motor.
            #[inline(never)]
            fn motors(
                states: &mut [$state; MOTORS],
                coefficients: &$coefficients,
                inputs: &[$input; MOTORS],
                outputs: &mut [$output; MOTORS],
            ) {
                for ((state, x), y) in states.iter_mut().zip(inputs).zip(outputs) {
                    *y = $update(state, coefficients, *x);
                }
            }

            /// A block of samples.
            #[inline(never)]
            pub fn block(
                state: &mut $state,
                coefficients: &$coefficients,
                inputs: &[$input; BLOCK],
                outputs: &mut [$output; BLOCK],
            ) {
                $block(state, coefficients, inputs, outputs);
            }

            /// The output long after a step, in Q2.29.
            #[inline(never)]
            fn steady(state: &mut $state, coefficients: &$coefficients, x: $input) -> i32 {
                let mut y = <$output>::default();
                for _ in 0..SETTLING {
                    y = $update(state, coefficients, x);
                }
                $to_bits(y)
            }
        }
    };
}

filter!(
    rotorlead_section,
    Section,
    Coefficients,
    Command,
    Throttle,
    |section: &mut Section, coefficients: &Coefficients, x| section.update(coefficients, x),
    |section: &mut Section, coefficients: &Coefficients, x: &[Command], y: &mut [Throttle]| {
        section.update_block(coefficients, x, y);
    },
    Throttle::to_bits
);

filter!(
    rotorlead_limited_section,
    LimitedSection,
    LimitedCoefficients,
    Command,
    Command,
    |section: &mut LimitedSection, coefficients: &LimitedCoefficients, x| section.update(coefficients, x),
    |section: &mut LimitedSection, coefficients: &LimitedCoefficients, x: &[Command], y: &mut [Command]| {
        for (x, y) in x.iter().zip(y) {
            *y = section.update(coefficients, *x);
        }
    },
    Command::to_bits
);

filter!(
    rotorlead_inverse,
    ConditionedInverse,
    inverse::Coefficients,
    Command,
    Command,
    |inverse: &mut ConditionedInverse, coefficients: &inverse::Coefficients, x| inverse.update(coefficients, x),
    |inverse: &mut ConditionedInverse, coefficients: &inverse::Coefficients, x: &[Command], y: &mut [Command]| {
        for (x, y) in x.iter().zip(y) {
            *y = inverse.update(coefficients, *x);
        }
    },
    Command::to_bits
);

/// Coefficients of idsp, with as many bits after the binary point as the samples.
type IdspBiquad = idsp::iir::Biquad<Q32<{ FRACTION_BITS as i8 }>>;
filter!(
    idsp_dither,
    DirectForm1Dither,
    IdspBiquad,
    i32,
    i32,
    |state: &mut DirectForm1Dither, biquad: &IdspBiquad, x| biquad.process(state, x),
    |state: &mut DirectForm1Dither, biquad: &IdspBiquad, x: &[i32], y: &mut [i32]| biquad.block(state, x, y),
    |bits: i32| bits
);

/// biquad's filter holds its coefficients.
type FloatBiquad = biquad::DirectForm1<f32>;
filter!(
    biquad_f32,
    FloatBiquad,
    (),
    f32,
    f32,
    |filter: &mut FloatBiquad, (): &(), x| filter.run(x),
    |filter: &mut FloatBiquad, (): &(), x: &[f32], y: &mut [f32]| {
        for (x, y) in x.iter().zip(y) {
            *y = filter.run(*x);
        }
    },
    |y: f32| (y * ONE as f32) as i32
);

/// Time constants of the paper's motors, and the commands at which they were measured.
const PAPER_CURVE: [CurvePoint; 6] = [
    CurvePoint { command: 0.40, tau_s: 1.0 / 6.2758 },
    CurvePoint { command: 0.45, tau_s: 1.0 / 7.3524 },
    CurvePoint { command: 0.50, tau_s: 1.0 / 9.2889 },
    CurvePoint { command: 0.55, tau_s: 1.0 / 9.9130 },
    CurvePoint { command: 0.60, tau_s: 1.0 / 11.7439 },
    CurvePoint { command: 0.65, tau_s: 1.0 / 14.1275 },
];

/// Size of a state or of its coefficients, for whoever looks at the argument.
#[inline(never)]
fn size(bytes: usize) -> usize {
    bytes
}

/// How long so many blocks take on TIM2, which counts the emulator's instructions.
#[inline(never)]
fn counted(timer: &TIM2, section: &mut Section, coefficients: &Coefficients, blocks: u32) -> u32 {
    let start = timer.cnt().read().bits();
    for _ in 0..blocks {
        let mut outputs = [Throttle::default(); BLOCK];
        rotorlead_section::block(section, coefficients, black_box(&[Command::ZERO; BLOCK]), black_box(&mut outputs));
    }
    timer.cnt().read().bits().wrapping_sub(start)
}

/// Every function of every filter.
pub fn run(timer: &TIM2, clocks: &RCC) {
    let defaults = Validated::default();
    let Ok([Filter::Lead(LeadFilter { coefficients, slew }), ..]) = controller::filters(&defaults) else { return };
    // The textbook's coefficients, with a0 = 1 and y = b x - a y: see `rotorlead::biquad`.
    let part = |bits: i32| f64::from(bits) / 4_294_967_296.0;
    let (k, c, g0, g1) =
        (part(coefficients.k()), part(coefficients.c()), part(coefficients.g0()), part(coefficients.g1()));
    let (b0, b1, b2, a1, a2) = (g0 + c, g1 - g0, -g1, c - 2.0 - k, 1.0 + k);

    let start = Command::saturating_from_bits(LEVELS[0]);
    rotorlead_section::run(Section::at_level(start), &coefficients, Command::saturating_from_bits);

    let far = Command::saturating_from_bits(LEVELS[1]);
    let limited_coefficients = LimitedCoefficients::from(coefficients);
    let mut section = LimitedSection::at_rest(Command::ZERO, Command::ONE, slew, start);
    rotorlead_limited_section::run(section, &limited_coefficients, Command::saturating_from_bits);
    // Once more from rest: the slew limits the first tick of a step.
    let limited =
        black_box(rotorlead_limited_section::call as fn(&mut LimitedSection, &LimitedCoefficients, Command) -> Command);
    let _ = black_box(limited(black_box(&mut section), black_box(&limited_coefficients), black_box(far)));

    let reference = defaults.inverse.reference();
    let Ok(design) = InverseDesign::new(reference, f64::from(defaults.loop_rate_hz), &PAPER_CURVE) else { return };
    let Ok(limits) = design.limits(Command::ZERO, Command::ONE, defaults.slew_per_s) else { return };
    let mut inverse = ConditionedInverse::at_rest(limits, start);
    rotorlead_inverse::run(inverse, design.coefficients(), Command::saturating_from_bits);
    let limited =
        black_box(rotorlead_inverse::call as fn(&mut ConditionedInverse, &inverse::Coefficients, Command) -> Command);
    let _ = black_box(limited(black_box(&mut inverse), black_box(design.coefficients()), black_box(far)));

    let nearest = |value: f64| Q32::from_bits((value * ONE + if value < 0.0 { -0.5 } else { 0.5 }) as i32);
    let dither = IdspBiquad { ba: [b0, b1, b2, -a1, -a2].map(nearest) };
    let mut state = DirectForm1Dither::default();
    state.xy.x = [LEVELS[0]; 2];
    state.xy.set_y(LEVELS[0]);
    idsp_dither::run(state, &dither, |bits| bits);

    let float =
        biquad::Coefficients::<f32> { a1: a1 as f32, a2: a2 as f32, b0: b0 as f32, b1: b1 as f32, b2: b2 as f32 };
    biquad_f32::run(FloatBiquad::new(float), &(), |bits| bits as f32 / ONE as f32);

    clocks.apb1enr().modify(|_, w| w.tim2en().set_bit());
    timer.cr1().modify(|_, w| w.cen().set_bit());
    for blocks in [1, 1, 3, 3] {
        let counted = black_box(counted as fn(&TIM2, &mut Section, &Coefficients, u32) -> u32);
        let _ = black_box(counted(
            timer,
            black_box(&mut Section::at_level(start)),
            black_box(&coefficients),
            black_box(blocks),
        ));
    }
}
