//! Start, stop, repetition, peak and refusals, on the whole periods of both line sets.

use super::*;
use std::vec::Vec;

const RATE_HZ: f64 = 5000.0;

fn playing(lines: Lines<'_>, nominal: f64, amplitude: f64) -> Multisine<'_> {
    let mut multisine = Multisine::new(lines, nominal, amplitude, RATE_HZ).unwrap();
    multisine.start(None);
    multisine
}

fn period(multisine: &mut Multisine) -> Vec<i32> {
    (0..multisine.ticks_per_period())
        .map(|_| multisine.update().to_bits())
        .collect()
}

#[test]
fn it_repeats_bit_for_bit_and_starts_every_period_at_the_nominal_command() {
    for lines in [ODD_LINES_30_HZ, ODD_LINES_45_HZ] {
        // The largest amplitude shows the most bits.
        for (nominal, amplitude) in [(0.5, 0.5), (0.65, 0.05), (0.05, 0.05)] {
            let mut multisine = playing(lines, nominal, amplitude);
            let first = period(&mut multisine);
            assert_eq!(first.len(), 50_000);
            assert_eq!(first[0], Command::saturating_from_f64(nominal).to_bits());
            assert!(first == period(&mut multisine) && first == period(&mut multisine));
        }
    }
}

#[test]
fn the_second_half_mirrors_the_first() {
    let mut multisine = playing(ODD_LINES_30_HZ, 0.5, 0.5);
    let nominal = multisine.nominal().to_bits();
    let samples = period(&mut multisine);
    let (first, second) = samples.split_at(25_000);
    for (a, b) in first.iter().zip(second) {
        // Two roundings to a command, and two sums that are good to 1e-8 of each line.
        assert!((a - nominal + b - nominal).abs() <= 8);
    }
}

#[test]
fn the_peak_is_at_most_the_amplitude_and_within_a_thousandth_of_it() {
    for lines in [ODD_LINES_30_HZ, ODD_LINES_45_HZ] {
        for amplitude in [0.05, 0.5, 0.001] {
            let mut multisine = playing(lines, 0.5, amplitude);
            let bits = amplitude * f64::from(Command::ONE.to_bits());
            let nominal = multisine.nominal().to_bits();
            let samples = period(&mut multisine);
            let peak = samples.iter().map(|x| (x - nominal).abs()).max().unwrap();
            std::println!(
                "{} lines, {amplitude}: peak {:.6}",
                lines.count(),
                f64::from(peak) / bits
            );
            assert!(f64::from(peak) <= bits && f64::from(peak) >= 0.999 * bits - 2.0);
            // Scaled, not cut: a cut top would hold for several samples.
            let held = samples
                .windows(2)
                .filter(|w| w[0] == w[1] && (w[0] - nominal).abs() == peak);
            assert!(held.count() <= 2);
        }
    }
}

#[test]
fn a_number_of_periods_ends_by_itself_at_the_nominal_command() {
    let mut multisine = Multisine::new(ODD_LINES_30_HZ, 0.5, 0.05, RATE_HZ).unwrap();
    let nominal = multisine.nominal();
    assert_eq!(
        (multisine.update(), multisine.activity()),
        (nominal, Activity::Idle)
    );
    multisine.start(NonZeroU32::new(2));
    let first = period(&mut multisine);
    assert_eq!(first, period(&mut multisine));
    assert_eq!(multisine.activity(), Activity::Idle);
    assert!((0..100).all(|_| multisine.update() == nominal));
    // The change into rest is the one that the next period would have begun with.
    assert!((first[49_999] - nominal.to_bits()).abs() < 2 * (first[1] - nominal.to_bits()).abs());
}

#[test]
fn finish_plays_the_period_to_its_end() {
    let mut multisine = playing(ODD_LINES_30_HZ, 0.5, 0.05);
    for _ in 0..60_000 {
        multisine.update();
    }
    multisine.finish();
    let mut left = 0;
    while multisine.activity() != Activity::Idle {
        multisine.update();
        left += 1;
    }
    assert_eq!(left, 40_000);
}

#[test]
fn stop_ends_within_half_a_period_without_a_step_from_anywhere() {
    let reference = period(&mut playing(ODD_LINES_30_HZ, 0.5, 0.5));
    let largest_change = reference
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .max()
        .unwrap();
    let mut longest = 0;
    let mut undisturbed = playing(ODD_LINES_30_HZ, 0.5, 0.5);
    let nominal = undisturbed.nominal().to_bits();
    for at in 0..50_000 {
        let mut multisine = undisturbed.clone();
        let mut last = if at == 0 { nominal } else { reference[at - 1] };
        undisturbed.update();
        if at > 5 && at % 97 != 0 {
            continue;
        }
        multisine.stop();
        let mut ticks = 0;
        while multisine.activity() != Activity::Idle {
            let position = multisine.tick() as usize;
            let next = multisine.update().to_bits();
            assert!((next - last).abs() <= largest_change, "step at {at}");
            assert!(next == reference[position] || next == nominal);
            last = next;
            ticks += 1;
            assert!(ticks <= 25_000, "does not end at {at}");
        }
        assert_eq!(last, nominal);
        assert_eq!(multisine.update().to_bits(), nominal);
        longest = longest.max(ticks);
    }
    std::println!("longest way to a crossing: {longest} ticks");
}

#[test]
fn start_while_it_plays_changes_nothing() {
    let mut disturbed = playing(ODD_LINES_30_HZ, 0.5, 0.05);
    let mut reference = disturbed.clone();
    for tick in 0..1000 {
        if tick % 7 == 0 {
            disturbed.start(NonZeroU32::new(1));
        }
        assert_eq!(disturbed.update(), reference.update());
    }
    assert_eq!(disturbed.activity(), Activity::Running(None));
}

#[test]
fn lines_whose_peak_is_understated_still_stay_within_the_amplitude() {
    // All in phase: the true peak is 100.
    let phases = [0_u32; 100];
    let lines = Lines::odd(10, &phases, 1.0).unwrap();
    let mut multisine = playing(lines, 0.5, 0.5);
    let (one, nominal) = (Command::ONE.to_bits(), multisine.nominal().to_bits());
    for x in period(&mut multisine) {
        assert!((0..=one).contains(&x) && (x - nominal).abs() <= nominal);
    }
}

#[test]
fn other_loop_rates_play_the_same_signal() {
    let reference = period(&mut playing(ODD_LINES_30_HZ, 0.5, 0.5));
    for (rate_hz, every) in [(1000.0, 5), (500.0, 10), (62.5, 80)] {
        let mut multisine = Multisine::new(ODD_LINES_30_HZ, 0.5, 0.5, rate_hz).unwrap();
        multisine.start(None);
        for (i, x) in period(&mut multisine).into_iter().enumerate() {
            assert!(
                (x - reference[i * every]).abs() <= 2,
                "{rate_hz} Hz, sample {i}"
            );
        }
    }
}

#[test]
fn what_cannot_be_played_is_refused_by_name() {
    use ExcitationError::*;
    let new = |nominal, amplitude, rate_hz| {
        Multisine::new(ODD_LINES_30_HZ, nominal, amplitude, rate_hz)
            .map(|_| ())
            .unwrap_err()
    };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(
            new(bad, 0.05, RATE_HZ),
            NotFinite {
                parameter: "nominal"
            }
        );
        assert_eq!(
            new(0.5, bad, RATE_HZ),
            NotFinite {
                parameter: "amplitude"
            }
        );
        assert_eq!(
            new(0.5, 0.05, bad),
            NotFinite {
                parameter: "loop_rate_hz"
            }
        );
    }
    let named = |error| match error {
        OutOfRange { parameter, .. } => parameter,
        other => panic!("{other}"),
    };
    for (nominal, amplitude) in [
        (0.96, 0.05),
        (0.04, 0.05),
        (0.5, 0.51),
        (0.5, 0.0),
        (0.5, -0.1),
    ] {
        assert_eq!(
            named(new(nominal, amplitude, RATE_HZ)),
            "amplitude",
            "{nominal} {amplitude}"
        );
    }
    assert_eq!(named(new(1.1, 0.05, RATE_HZ)), "nominal");
    assert_eq!(named(new(-0.1, 0.05, RATE_HZ)), "nominal");
    assert_eq!(named(new(0.5, 0.05, 1e12)), "loop_rate_hz");
    assert!(matches!(new(0.5, 0.05, 5000.01), PeriodNotWhole { .. }));
    assert!(matches!(new(0.5, 0.05, 59.8), AboveNyquist { .. }));
    assert!(matches!(new(0.5, 0.05, -5000.0), AboveNyquist { .. }));
    // The ends themselves are allowed, and so is the first rate above twice the top line.
    for (nominal, amplitude, rate_hz) in [
        (0.95, 0.05, RATE_HZ),
        (0.05, 0.05, RATE_HZ),
        (0.5, 0.5, RATE_HZ),
        (0.5, 0.05, 59.9),
    ] {
        assert!(Multisine::new(ODD_LINES_30_HZ, nominal, amplitude, rate_hz).is_ok());
    }
    let text = std::format!("{}", new(0.5, 0.05, 59.8));
    assert!(
        text.contains("loop_rate_hz") && text.contains("29.9"),
        "{text}"
    );
}

#[test]
fn lines_out_of_range_are_refused_by_name() {
    let phases = [0_u32; 513];
    for (period_s, count, peak, name) in [
        (0, 1, 1.0, "period_s"),
        (1001, 1, 1.0, "period_s"),
        (10, 0, 1.0, "phases"),
        (10, 513, 1.0, "phases"),
        (10, 1, 0.5, "peak"),
        (10, 1, Lines::PEAK_LIMIT, "peak"),
        (10, 1, f64::NAN, "peak"),
    ] {
        let error = Lines::odd(period_s, &phases[..count], peak).unwrap_err();
        assert!(
            matches!(error, ExcitationError::OutOfRange { parameter, .. } if parameter == name),
            "{error}"
        );
    }
}
