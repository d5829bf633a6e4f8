//! The fixed-point section against its claims: exact steady output, no overflow, response after rounding, precision.

use host_tests::{DirectForm, TABLE_1, any_design, any_parameters, cases, multisine, paper_design};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rotorlead::biquad::{COEFFICIENT_BITS, Coefficients, Section};
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LARGEST_DEVIATION_DB, LeadDesign};
use rotorlead::throttle::{Command, FRACTION_BITS, Throttle};

/// One step of the output, 2^-29.
const STEP: f64 = 1.0 / (1_u64 << FRACTION_BITS) as f64;

fn any_command() -> impl Strategy<Value = Command> {
    prop_oneof![
        4 => (0..=1_i32 << FRACTION_BITS).prop_map(Command::saturating_from_bits),
        1 => Just(Command::ZERO),
        1 => Just(Command::ONE),
    ]
}

/// Ticks after which a constant input must have been reached. The drift at rest is `c` per step of deviation and
/// tick, so the last step takes up to `1 / c`; what is before it is quicker. The linear part takes some 30 time
/// constants of the slower pole.
fn settling_ticks(design: &LeadDesign) -> u64 {
    let drift = (1_u64 << COEFFICIENT_BITS) as f64 / f64::from(design.coefficients().c());
    let time_constant = 1.0 / (1.0 - design.check().pole_radii[0]);
    (10.0 * drift + 30.0 * time_constant) as u64
}

proptest! {
    #![proptest_config(cases(256))]

    /// From any state that inputs can bring about, and again after a change by one step.
    #[test]
    fn the_steady_output_is_the_input_to_the_last_bit_and_stays(
        design in any_design(),
        history in proptest::collection::vec(any_command(), 1..200),
        level in any_command(),
    ) {
        let coefficients = design.coefficients();
        let mut section = Section::at_level(history[0]);
        for &input in &history {
            section.update(coefficients, input);
        }
        let neighbor = Command::saturating_from_bits(if level.to_bits() > 0 { level.to_bits() - 1 } else { 1 });
        let ticks = settling_ticks(&design);
        for input in [level, neighbor] {
            for _ in 0..ticks {
                section.update(coefficients, input);
            }
            for _ in 0..ticks / 4 {
                prop_assert_eq!(section.update(coefficients, input), Throttle::from(input));
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn a_block_is_as_many_single_samples(
        design in any_design(),
        inputs in proptest::collection::vec(any_command(), 0..100),
        room in 0_usize..100,
    ) {
        let mut one_by_one = Section::at_level(Command::ZERO);
        let mut in_blocks = one_by_one;
        let length = inputs.len().min(room);
        let expected: Vec<Throttle> =
            inputs[..length].iter().map(|&input| one_by_one.update(design.coefficients(), input)).collect();
        let mut outputs = vec![Throttle::MIN; room];
        in_blocks.update_block(design.coefficients(), &inputs, &mut outputs);
        prop_assert_eq!(&outputs[..length], &expected[..]);
        prop_assert!(outputs[length..].iter().all(|&output| output == Throttle::MIN));
        prop_assert_eq!(in_blocks, one_by_one);
    }
}

/// The largest and smallest output that inputs in [0, 1] can bring about, by the input that does: the sign of the
/// impulse response, backwards.
fn extremal_inputs(design: &LeadDesign, ticks: usize) -> Vec<Command> {
    let mut model = DirectForm::tustin(design.lead(), design.loop_rate_hz(), design.prewarp_rad_s(), 0.0);
    let impulse: Vec<f64> = (0..ticks).map(|n| model.update(if n == 0 { 1.0 } else { 0.0 })).collect();
    let highest = impulse.iter().rev().map(|h| if *h > 0.0 { Command::ONE } else { Command::ZERO });
    let lowest = impulse.iter().rev().map(|h| if *h > 0.0 { Command::ZERO } else { Command::ONE });
    highest.chain(lowest).collect()
}

proptest! {
    #![proptest_config(cases(256))]

    /// A wrapped or saturated word would be off by more than 1; rounding is off by some steps of 2^-29. The reference
    /// knows neither. The inputs reach both ends of the range that the design promises.
    #[test]
    fn nothing_overflows_for_any_input_sequence(
        design in any_design(),
        mut inputs in proptest::collection::vec(any_command(), 1..2000),
        bang in proptest::collection::vec(any::<bool>(), 1..2000),
    ) {
        let time_constant = 1.0 / (1.0 - design.check().pole_radii[0]);
        inputs.extend(extremal_inputs(&design, (30.0 * time_constant).min(100_000.0) as usize));
        inputs.extend(bang.iter().map(|&high| if high { Command::ONE } else { Command::ZERO }));
        let level = inputs[0];
        let mut section = Section::at_level(level);
        let mut model =
            DirectForm::tustin(design.lead(), design.loop_rate_hz(), design.prewarp_rad_s(), level.to_f64());
        let (mut lowest, mut highest) = (f64::MAX, f64::MIN);
        for &input in &inputs {
            let (got, want) = (section.update(design.coefficients(), input).to_f64(), model.update(input.to_f64()));
            prop_assert!((got - want).abs() < 0.01, "{got} for {want}");
            (lowest, highest) = (lowest.min(got), highest.max(got));
        }
        let gain = design.check().l1_gain;
        // Rounding adds less than 1000 steps, which the margin of the largest L1 gain covers.
        prop_assert!(highest <= (1.0 + gain) / 2.0 + 1000.0 * STEP && lowest >= (1.0 - gain) / 2.0 - 1000.0 * STEP);
        prop_assert!(highest > (1.0 + gain) / 2.0 - 0.02 && lowest < (1.0 - gain) / 2.0 + 0.02,
            "the extremal inputs gave {lowest}..{highest} with L1 gain {gain}");
    }

    /// Whatever bits stand in the input register, the filter gets a command and its output stays where it should.
    #[test]
    fn full_scale_garbage_is_a_command_at_most(
        design in any_design(),
        garbage in proptest::collection::vec(prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)], 1..3000),
    ) {
        let mut section = Section::at_level(Command::ZERO);
        let bound = (1.0 + design.check().l1_gain) / 2.0 + 1000.0 * STEP;
        for &bits in &garbage {
            let output = section.update(design.coefficients(), Command::saturating_from_bits(bits)).to_f64();
            prop_assert!((1.0 - bound..=bound).contains(&output));
        }
        for _ in 0..settling_ticks(&design) {
            section.update(design.coefficients(), Command::ZERO);
        }
        prop_assert_eq!(section.output(), Throttle::default());
    }

    /// The impulse response of the unrounded textbook section, transformed, against the rounded coefficients.
    #[test]
    fn rounding_moves_the_response_by_no_more_than_stated(design in any_design(), part in 0.0..1.0_f64) {
        let check = design.check();
        prop_assert!(check.worst_deviation_db <= LARGEST_DEVIATION_DB);
        prop_assert!(check.pole_radii[0] < 1.0 && check.pole_radii[1] <= check.pole_radii[0]);
        let omega_rad_s = design.lead().omega_z_rad_s * (50.0_f64).powf(part);
        prop_assume!(omega_rad_s < 2.0 * design.loop_rate_hz());
        let s = design.prewarp_rad_s().map_or(2.0 * design.loop_rate_hz(), |w| w / (w / 2.0 / design.loop_rate_hz()).tan());
        // Tustin is the continuous response at the warped frequency: an identity, which needs no section at all.
        let want = design.lead().response(s * (omega_rad_s / 2.0 / design.loop_rate_hz()).tan());
        let got = design.response(omega_rad_s);
        let deviation_db = 20.0 * (1.0 + (got / want - 1.0).norm()).log10();
        prop_assert!(deviation_db <= check.worst_deviation_db * 1.01 + 1e-9, "{deviation_db} at {omega_rad_s}");
    }
}

#[test]
fn most_designs_in_range_are_accepted() {
    let mut runner = TestRunner::deterministic();
    let accepted = (0..2000)
        .filter(|_| {
            let (lead, rate, prewarp) = any_parameters().new_tree(&mut runner).expect("a value").current();
            LeadDesign::new(lead, rate, prewarp).is_ok()
        })
        .count();
    assert!(accepted > 1000, "{accepted} of 2000");
}

/// The section's own recurrence with its rounded coefficients, in `f64`: what it would give without rounding its sums.
struct Unrounded {
    coefficients: [f64; 4],
    y: f64,
    dy: f64,
    x: [f64; 2],
}

impl Unrounded {
    fn at_level(coefficients: &Coefficients, level: f64) -> Self {
        let value = |bits: i32| f64::from(bits) / (1_u64 << COEFFICIENT_BITS) as f64;
        let coefficients = [coefficients.k(), coefficients.c(), coefficients.g0(), coefficients.g1()].map(value);
        Self { coefficients, y: level, dy: 0.0, x: [level; 2] }
    }

    fn update(&mut self, x: f64) -> f64 {
        let ([k, c, g0, g1], [x1, x2]) = (self.coefficients, self.x);
        self.dy += k * self.dy + c * (x - self.y) + g0 * (x - x1) + g1 * (x1 - x2);
        self.y += self.dy;
        self.x = [x, x1];
        self.y
    }
}

/// RMS of the section's error over the second period of the multisine, relative to the RMS of the exact output around
/// its mean, in decibels.
fn error_db(design: &LeadDesign, inputs: &[Command], mut exact: impl FnMut(f64) -> f64) -> f64 {
    let mut section = Section::at_level(inputs[0]);
    let (mut error, mut output, mut mean) = (0.0, 0.0, 0.0);
    for (n, &input) in inputs.iter().cycle().take(2 * inputs.len()).enumerate() {
        let got = section.update(design.coefficients(), input).to_f64();
        let want = exact(input.to_f64());
        if n >= inputs.len() {
            error += (got - want).powi(2);
            output += want * want;
            mean += want;
        }
    }
    let ticks = inputs.len() as f64;
    10.0 * (error / (output - mean * mean / ticks)).log10()
}

/// Two errors are distinguished: that of the arithmetic, and that of rounding the coefficients, which is a filter with
/// slightly different poles and is bounded by the design's check as well.
#[test]
fn the_error_against_f64_is_under_minus_150_db_on_the_papers_multisine() {
    let u_noms = TABLE_1.map(|(u_nom, _, _)| u_nom);
    // The paper's loop at every operating point, and those of flight controllers.
    let rates_hz = [1000.0, 2000.0, 4000.0, 8000.0].map(|rate_hz| (rate_hz, 0.50));
    for (rate_hz, u_nom) in u_noms.map(|u_nom| (DEFAULT_LOOP_RATE_HZ, u_nom)).into_iter().chain(rates_hz) {
        let design = LeadDesign::new(*paper_design().lead(), rate_hz, None).unwrap();
        let inputs: Vec<Command> =
            multisine(u_nom, 0.05, design.loop_rate_hz()).iter().map(|&u| Command::saturating_from_f64(u)).collect();
        let level = inputs[0].to_f64();
        let mut unrounded = Unrounded::at_level(design.coefficients(), level);
        let arithmetic_db = error_db(&design, &inputs, |u| unrounded.update(u));
        let mut textbook = DirectForm::tustin(design.lead(), design.loop_rate_hz(), None, level);
        let total_db = error_db(&design, &inputs, |u| textbook.update(u));
        println!(
            "{rate_hz} Hz, u_nom {u_nom:.2}: arithmetic {arithmetic_db:.1} dB, with rounded coefficients {total_db:.1} dB"
        );
        assert!(arithmetic_db <= -150.0, "{arithmetic_db} dB");
        // Where the loop is slow the coefficients are so exact that the arithmetic shows.
        let rounded = 10.0_f64.powf(design.check().worst_deviation_db / 20.0) - 1.0;
        assert!(total_db <= 20.0 * (rounded + 10.0_f64.powf(arithmetic_db / 20.0)).log10() + 1.0, "{total_db} dB");
    }
}

#[test]
fn at_rest_the_output_is_off_by_the_rounding_of_the_command_alone() {
    // A section with plain truncation stands thousands of steps off its input; this one stands on it.
    let design = paper_design();
    let mut section = Section::at_level(Command::ZERO);
    for _ in 0..settling_ticks(&design) {
        section.update(design.coefficients(), Command::saturating_from_f64(0.123_456_789));
    }
    assert!((section.output().to_f64() - 0.123_456_789).abs() <= STEP / 2.0);
}

/// The bounds of the proof in `docs/fixed-point.md`, for a range of integers and for coefficients up to their limits, in
/// units of 1/24000 so that nothing is rounded.
#[test]
fn the_energy_falls_as_the_proof_of_the_exact_steady_output_says() {
    const UNIT: i64 = 24_000;
    let mut closest = i64::MIN;
    for q in [12_000, 11_999, 9_000, 4_000, 400, 4] {
        for c in [3 * q / 4, 3 * q / 4 - 1, q / 2, q / 100].into_iter().filter(|&c| c > 0) {
            for (p, s) in (-60..=60_i64).flat_map(|p| (-200..=200_i64).map(move |s| (p, s))) {
                let n = (p - s).abs();
                // Twice the bound B(p, s).
                let bound = c * s * s - 2 * q * p * s - n * (n - 1) * UNIT;
                match (p, s) {
                    (0, 0) => {}
                    (0, -1 | 1) => assert!(bound <= c),
                    (0, _) => assert!(bound < 0, "q {q} c {c}: an excursion may begin with {s}"),
                    (_, 0) => assert!(bound <= 0),
                    _ => {
                        assert!(3 * bound <= -4 * c, "q {q} c {c}: from {p} to {s}");
                        closest = closest.max(3 * bound + 4 * c);
                    }
                }
            }
        }
    }
    assert_eq!(closest, 0, "2 c / 3 is what is lost where p = 1, s = 2 and 4 c = 3 q");
}
