//! Samples per second of the section beside other filters, on the same input and in the same run.
//!
//! Run by `cargo xtask bench`. Times depend on the machine and its load; so every round runs every filter once, and what
//! is reported is the median over the rounds of the ratio to this crate's section. Accuracy is that against `f64` with
//! the unrounded coefficients, and what is left over at a constant input.

use std::hint::black_box;
use std::time::Instant;

use biquad::Biquad as _;
use dsp_fixedpoint::Q32;
use dsp_process::SplitProcess;
use host_tests::{DirectForm, multisine, paper_design};
use rotorlead::biquad::Section;
use rotorlead::throttle::{Command, FRACTION_BITS};

/// Odd, so that the median is one of the rounds.
const ROUNDS: usize = 21;
/// One in Q2.29.
const ONE: f64 = (1_u64 << FRACTION_BITS) as f64;

/// From commands to outputs in Q2.29, from rest at the first input.
type Run = Box<dyn Fn(&[i32], &mut [i32])>;

/// A filter under test.
struct Candidate {
    name: &'static str,
    /// Bytes of coefficients and state.
    bytes: usize,
    run: Run,
}

/// The incremental form with error feedback: `y0 = 2 y1 - y2 + small terms`, the sum preloaded with `{2 y1 - y2 : e}`.
/// The other form that reaches the floor, for comparison with the one chosen.
#[derive(Clone, Copy)]
struct Incremental {
    /// `b0, b1, b2, -(a1 + 2), 1 - a2` in Q0.32. `b1` is set to what makes the static gain 1.
    coefficients: [i32; 5],
    x: [i32; 2],
    y: [i32; 2],
    remainder: u32,
}

impl Incremental {
    fn update(&mut self, x: i32) -> i32 {
        let [b0, b1, b2, a1, a2] = self.coefficients;
        let product = |a: i32, b: i32| i64::from(a) * i64::from(b);
        let preload = self.y[0].wrapping_mul(2).wrapping_sub(self.y[1]);
        let sum = (i64::from(preload) << 32 | i64::from(self.remainder))
            .wrapping_add(product(b0, x))
            .wrapping_add(product(b1, self.x[0]))
            .wrapping_add(product(b2, self.x[1]))
            .wrapping_add(product(a1, self.y[0]))
            .wrapping_add(product(a2, self.y[1]));
        self.remainder = sum as u32;
        self.x = [x, self.x[0]];
        self.y = [(sum >> 32) as i32, self.y[0]];
        self.y[0]
    }
}

/// Every filter, with the textbook coefficients `b0, b1, b2, a1, a2` of the paper's design.
fn candidates() -> Vec<Candidate> {
    let design = paper_design();
    let [b0, b1, b2, a1, a2] = DirectForm::tustin(design.lead(), design.loop_rate_hz(), None, 0.0).coefficients();
    let coefficients = *design.coefficients();

    let small = |value: f64| (value * 4_294_967_296.0).round() as i32;
    let (i0, i2, ia1, ia2) = (small(b0), small(b2), small(-(a1 + 2.0)), small(1.0 - a2));
    let incremental = [i0, -(ia1 + ia2) - i0 - i2, i2, ia1, ia2];

    let dither = idsp::iir::Biquad::<Q32<FRACTION>> {
        ba: [b0, b1, b2, -a1, -a2].map(|value| Q32::from_bits((value * ONE).round() as i32)),
    };
    let plain = dither.clone();
    let float =
        biquad::Coefficients::<f32> { a1: a1 as f32, a2: a2 as f32, b0: b0 as f32, b1: b1 as f32, b2: b2 as f32 };
    let double = biquad::Coefficients::<f64> { a1, a2, b0, b1, b2 };

    vec![
        Candidate {
            name: "rotorlead",
            bytes: size_of_val(&coefficients) + size_of::<Section>(),
            run: Box::new(move |input, output| {
                let mut section = Section::at_level(Command::saturating_from_bits(input[0]));
                for (x, y) in input.iter().zip(output) {
                    *y = section.update(&coefficients, Command::saturating_from_bits(*x)).to_bits();
                }
            }),
        },
        Candidate {
            name: "incremental form",
            bytes: size_of::<Incremental>(),
            run: Box::new(move |input, output| {
                let mut section =
                    Incremental { coefficients: incremental, x: [input[0]; 2], y: [input[0]; 2], remainder: 1 << 31 };
                for (x, y) in input.iter().zip(output) {
                    *y = section.update(*x);
                }
            }),
        },
        Candidate {
            name: "idsp DF1 dither",
            bytes: size_of_val(&dither) + size_of::<idsp::iir::DirectForm1Dither>(),
            run: Box::new(move |input, output| {
                let mut state = idsp::iir::DirectForm1Dither::default();
                state.xy.x = [input[0]; 2];
                state.xy.set_y(input[0]);
                for (x, y) in input.iter().zip(output) {
                    *y = dither.process(&mut state, *x);
                }
            }),
        },
        Candidate {
            name: "idsp DF1",
            bytes: size_of_val(&plain) + size_of::<idsp::iir::DirectForm1<i32>>(),
            run: Box::new(move |input, output| {
                let mut state = idsp::iir::DirectForm1::<i32> { x: [input[0]; 2], ..Default::default() };
                state.set_y(input[0]);
                for (x, y) in input.iter().zip(output) {
                    *y = plain.process(&mut state, *x);
                }
            }),
        },
        Candidate {
            name: "biquad f32 DF1",
            bytes: size_of::<biquad::DirectForm1<f32>>(),
            run: Box::new(move |input, output| {
                let mut filter = biquad::DirectForm1::<f32>::new(float);
                let offset = input[0];
                for (x, y) in input.iter().zip(output) {
                    *y = offset + (filter.run((x - offset) as f32 / ONE as f32) * ONE as f32) as i32;
                }
            }),
        },
        Candidate {
            name: "biquad f64 DF2T",
            bytes: size_of::<biquad::DirectForm2Transposed<f64>>(),
            run: Box::new(move |input, output| {
                let mut filter = biquad::DirectForm2Transposed::<f64>::new(double);
                let offset = input[0];
                for (x, y) in input.iter().zip(output) {
                    *y = offset + (filter.run(f64::from(x - offset) / ONE) * ONE).round_ties_even() as i32;
                }
            }),
        },
    ]
}

/// Bits after the binary point as the fixed-point crate counts them.
const FRACTION: i8 = FRACTION_BITS as i8;

/// RMS of the error in the second of two periods, relative to the RMS of the exact output around its mean, in dB.
fn error_db(candidate: &Candidate, period: &[i32]) -> f64 {
    let input: Vec<i32> = period.iter().chain(period).copied().collect();
    let mut output = vec![0; input.len()];
    (candidate.run)(&input, &mut output);
    let design = paper_design();
    let mut exact = DirectForm::tustin(design.lead(), design.loop_rate_hz(), None, f64::from(input[0]) / ONE);
    let exact: Vec<f64> = input.iter().map(|x| exact.update(f64::from(*x) / ONE)).collect();
    let mean = exact[period.len()..].iter().sum::<f64>() / period.len() as f64;
    let (mut error, mut size) = (0.0, 0.0);
    for (got, want) in output.iter().zip(&exact).skip(period.len()) {
        error += (f64::from(*got) / ONE - want).powi(2);
        size += (want - mean).powi(2);
    }
    10.0 * (error / size).log10()
}

/// What is left between output and input a million ticks after a step, in steps of 2^-29.
fn steady_error(candidate: &Candidate) -> i32 {
    let mut input = vec![314_159_265; 1_000_000];
    input[0] = 271_828_182;
    let mut output = vec![0; input.len()];
    (candidate.run)(&input, &mut output);
    output[output.len() - 1] - input[input.len() - 1]
}

fn main() {
    let period: Vec<i32> =
        multisine(0.5, 0.05, 5000.0).iter().map(|&u| Command::saturating_from_f64(u).to_bits()).collect();
    let input: Vec<i32> = period.iter().cycle().take(1_000_000).copied().collect();
    let mut output = vec![0; input.len()];
    let candidates = candidates();

    let mut seconds = vec![Vec::with_capacity(ROUNDS); candidates.len()];
    for _ in 0..ROUNDS {
        for (candidate, seconds) in candidates.iter().zip(&mut seconds) {
            let start = Instant::now();
            (candidate.run)(black_box(&input), black_box(&mut output));
            seconds.push(start.elapsed().as_secs_f64());
        }
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };

    println!("Filters on the host: {} samples of the paper's multisine, {ROUNDS} rounds", input.len());
    println!(
        "{:<18} {:>10} {:>16} {:>6} {:>12} {:>14}",
        "filter", "Msamples/s", "time / rotorlead", "bytes", "error dB", "steady error"
    );
    let reference = seconds[0].clone();
    for (candidate, seconds) in candidates.iter().zip(&seconds) {
        let mut ratios: Vec<f64> = seconds.iter().zip(&reference).map(|(this, ours)| this / ours).collect();
        println!(
            "{:<18} {:>10.0} {:>16.2} {:>6} {:>12.1} {:>14}",
            candidate.name,
            input.len() as f64 / median(&mut seconds.clone()) / 1e6,
            median(&mut ratios),
            candidate.bytes,
            error_db(candidate, &period),
            steady_error(candidate)
        );
    }
}
