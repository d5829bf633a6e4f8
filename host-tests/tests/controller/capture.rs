//! From edges to pulses: frame rates, glitches, missing edges, stuck lines, floods, wrapping time stamps.

use host_tests::cases;
use host_tests::fuzz::{PULSES, fuzz_capture};
use host_tests::line::{LOOP_HZ, Line, TICKS_PER_POLL, TIMER_HZ, decode, decode_with, us};
use proptest::prelude::*;
use rotorlead::capture::{
    Decoder, FILTERED_POLLS, Faults, InputReading, LONGEST_MASK_POLLS, Level, LossReason, PULSES_TO_LIVE, Signal,
    Timing, TimingError,
};
use rotorlead::protocol::{Pulse, PulseProtocol};

fn timing(pulse: Pulse) -> Timing {
    Timing::new(pulse, TIMER_HZ, LOOP_HZ).unwrap()
}

/// A decoder that has seen the line low 100 µs before `origin`.
fn seen_low(pulse: Pulse, origin: u32) -> Decoder {
    let mut decoder = Decoder::new(timing(pulse));
    decoder.edge(origin.wrapping_sub(us(100.0) as u32), Level::Low);
    decoder
}

fn servo() -> Decoder {
    seen_low(PulseProtocol::StandardPwm.at(400), 0)
}

/// 400 Hz, 1.5 ms.
fn servo_pulses(start_us: f64, count: u64) -> Line {
    Line::pulses(us(start_us), us(2500.0), us(1500.0), count)
}

fn widths(signals: &[(u64, Signal)]) -> Vec<u32> {
    signals
        .iter()
        .filter_map(|&(_, signal)| match signal {
            Signal::Pulse { width_ticks, .. } => Some(width_ticks),
            _ => None,
        })
        .collect()
}

fn first_loss(signals: &[(u64, Signal)]) -> Option<(u64, LossReason)> {
    signals.iter().find_map(|&(time, signal)| match signal {
        Signal::Lost(reason) => Some((time, reason)),
        _ => None,
    })
}

/// Every protocol at frame rates that it allows: each pulse is reported once, to the tick, at the first poll that comes a
/// glitch's time after its end, except the two before the input is live.
#[test]
fn frame_rates_from_40_hz_to_4_khz_are_decoded_to_the_tick() {
    let mut tried = Vec::new();
    for frame_hz in [40, 50, 333, 400, 490] {
        tried.push((PulseProtocol::StandardPwm.at(frame_hz), [900.0, 1000.0, 1500.37, 2000.0]));
    }
    for frame_hz in [40, 400, 1000, 2000, 3999, 4000] {
        tried.push((PulseProtocol::OneShot125.at(frame_hz), [115.0, 125.0, 180.5, 230.0]));
    }
    for frame_hz in [40, 600, 1000, 4000] {
        let frame_us = 1e6 / f64::from(frame_hz);
        tried.push((PulseProtocol::RawDuty.at(frame_hz), [0.02, 0.4, 0.65, 0.98].map(|duty| duty * frame_us)));
    }
    for (pulse, pulses_us) in tried {
        for width_us in pulses_us {
            let (period, width) = (u64::from(TIMER_HZ / u32::from(pulse.frame_hz)), us(width_us));
            let line = Line::pulses(us(30.0), period, width, 50);
            let mut decoder = seen_low(pulse, 0);
            let glitch = u64::from(decoder.timing().glitch_ticks());
            let signals = decode(&mut decoder, &line, 0, us(30.0) + 50 * period + 2 * TICKS_PER_POLL);
            let name = format!("{pulse:?}, {width_us} us");

            assert!(widths(&signals).iter().all(|&ticks| u64::from(ticks) == width), "{name}");
            let ends: Vec<u64> = line.edges().chunks(2).skip(2).map(|pulse| pulse[1].0).collect();
            let mut expected: Vec<u64> =
                ends.iter().map(|end| (end + glitch).div_ceil(TICKS_PER_POLL) * TICKS_PER_POLL).collect();
            // The loop is faster than every frame but by a little only: two pulses never end between two polls.
            expected.dedup();
            assert_eq!(expected.len(), ends.len(), "{name}");
            let reported: Vec<u64> =
                signals.iter().filter(|(_, s)| matches!(s, Signal::Pulse { .. })).map(|&(time, _)| time).collect();
            assert_eq!(reported, expected, "{name}");
            for (_, signal) in &signals {
                if let Signal::Pulse { period_ticks, .. } = *signal {
                    assert_eq!(u64::from(period_ticks), period, "{name}");
                }
            }
            assert_eq!(decoder.faults(), Faults::default(), "{name}");
        }
    }
}

#[test]
fn an_input_is_live_after_three_pulses_in_a_row_and_not_before() {
    let mut decoder = servo();
    let signals = decode(&mut decoder, &servo_pulses(500.0, 2), 0, us(90_000.0));
    assert!(signals.iter().all(|&(_, signal)| signal == Signal::Nothing), "two pulses made it live");

    // Two, a frame that is missing, and two: never three in a row. 30 ms are longer than the longest frame.
    let mut decoder = servo();
    let line = servo_pulses(500.0, 2).then(&servo_pulses(40_000.0, 2));
    let signals = decode(&mut decoder, &line, 0, us(60_000.0));
    assert!(signals.iter().all(|&(_, signal)| signal == Signal::Nothing), "a gap was overlooked");

    let mut decoder = servo();
    let signals = decode(&mut decoder, &servo_pulses(500.0, u64::from(PULSES_TO_LIVE)), 0, us(20_000.0));
    assert_eq!(widths(&signals), [us(1500.0) as u32]);
    assert_eq!(signals.last().unwrap().1, Signal::Unchanged);
}

/// Switched on in the middle of a pulse, or of a glitch in one: the first rise may be anything.
#[test]
fn the_first_pulse_after_the_start_does_not_count() {
    for count in [3, 4] {
        let mut decoder = Decoder::new(timing(PulseProtocol::StandardPwm.at(400)));
        let signals = decode(&mut decoder, &servo_pulses(500.0, count), 0, us(20_000.0));
        assert_eq!(widths(&signals).len() as u64, count - 3);
    }
}

#[test]
fn a_silent_line_is_lost_after_the_timeout_with_the_level_that_it_has() {
    // It stays low.
    let mut decoder = servo();
    let line = servo_pulses(500.0, 10);
    let last_fall = line.edges().last().unwrap().0;
    let signals = decode(&mut decoder, &line, 0, us(300_000.0));
    let timeout = u64::from(decoder.timing().timeout_ticks());
    let (time, reason) = first_loss(&signals).unwrap();
    assert_eq!(reason, LossReason::StuckLow);
    assert!(time > last_fall + timeout && time <= last_fall + timeout + TICKS_PER_POLL, "lost at {time}");
    assert!(signals.iter().all(|&(at, s)| matches!(s, Signal::Lost(_)) == (at >= time)), "lost means lost");
    assert_eq!(decoder.faults(), Faults { losses: 1, ..Faults::default() });

    // It stays high.
    let mut decoder = servo();
    let mut line = servo_pulses(500.0, 10);
    line.level(us(25_500.0), Level::High);
    let (_, reason) = first_loss(&decode(&mut decoder, &line, 0, us(300_000.0))).unwrap();
    assert_eq!(reason, LossReason::StuckHigh);

    // It never was anything but high: there was no signal that could be lost.
    let mut line = Line::default();
    line.level(us(10.0), Level::High);
    let signals = decode(&mut servo(), &line, 0, us(1e6));
    assert!(signals.iter().all(|&(_, signal)| signal == Signal::Nothing));
}

#[test]
fn a_lost_input_comes_back_with_the_third_good_pulse() {
    for high_meanwhile in [false, true] {
        let mut decoder = servo();
        let mut line = servo_pulses(500.0, 10);
        if high_meanwhile {
            line.level(us(25_500.0), Level::High);
            line.level(us(380_000.0), Level::Low);
        }
        let back = servo_pulses(400_000.0, 10);
        let third_fall = back.edges()[5].0;
        let signals = decode(&mut decoder, &line.then(&back), 0, us(424_000.0));
        let again = signals
            .iter()
            .find(|(time, signal)| *time > us(400_000.0) && matches!(signal, Signal::Pulse { .. }))
            .unwrap();
        assert!(again.0 > third_fall && again.0 < third_fall + 2 * TICKS_PER_POLL);
        assert!(
            signals
                .iter()
                .filter(|(time, _)| *time > us(200_000.0) && *time < again.0)
                .all(|(_, signal)| matches!(signal, Signal::Lost(_)))
        );
        assert_eq!(signals.last().unwrap().1, Signal::Unchanged);
    }
}

#[test]
fn one_dropped_pulse_is_no_loss_at_the_slowest_frame_rate() {
    for frame_hz in [40, 50] {
        let line = Line::pulses(us(500.0), u64::from(TIMER_HZ / frame_hz), us(1500.0), 30);
        let mut decoder = servo();
        let signals = decode(&mut decoder, &line.without_edge(20).without_edge(20), 0, us(29e6 / f64::from(frame_hz)));
        assert_eq!(first_loss(&signals), None);
        assert_eq!(decoder.faults(), Faults::default(), "a missing pulse is no fault of the edges");
    }
}

#[test]
fn levels_shorter_than_a_glitch_change_nothing() {
    let clean = decode(&mut servo(), &servo_pulses(500.0, 20), 0, us(50_000.0));
    let good = servo_pulses(500.0, 20);
    // In a pulse, near its rise, just before its fall, in a gap, just before a rise, just after a fall.
    for at_us in [10_700.0, 10_502.1, 11_997.0, 12_100.0, 12_997.0, 12_002.1] {
        let mut decoder = servo();
        let line = good.clone().with_glitch(us(at_us), us(1.9));
        let signals = decode(&mut decoder, &line, 0, us(50_000.0));
        assert_eq!(widths(&signals), widths(&clean), "glitch at {at_us} us");
        assert_eq!(decoder.faults(), Faults { glitches: 1, ..Faults::default() }, "glitch at {at_us} us");
    }
}

/// An edge that rings is where the ringing ends.
#[test]
fn an_edge_that_rings_moves_by_the_ringing_at_most() {
    let mut decoder = servo();
    let line = servo_pulses(500.0, 20).with_glitch(us(10_501.9), us(1.9)).with_glitch(us(17_001.9), us(1.9));
    let signals = decode(&mut decoder, &line, 0, us(50_000.0));
    let moved: Vec<i64> = widths(&signals).iter().map(|&width| i64::from(width) - us(1500.0) as i64).collect();
    let ringing = 2 * us(1.9) as i64;
    assert_eq!(moved.iter().copied().filter(|&late| late != 0).collect::<Vec<_>>(), [-ringing, ringing]);
    assert_eq!(moved.len(), 18);
}

/// A gap that is longer than a glitch cuts a pulse. Its parts are too short, or come too soon after one another.
#[test]
fn a_pulse_that_is_cut_gives_at_most_one_of_its_parts() {
    for cut_us in (20..1480).step_by(20) {
        let mut decoder = servo();
        let line = servo_pulses(500.0, 20).with_glitch(us(10_500.0 + f64::from(cut_us)), us(3.0));
        let signals = decode(&mut decoder, &line, 0, us(50_000.0));
        let odd: Vec<u32> = widths(&signals).into_iter().filter(|&width| width != us(1500.0) as u32).collect();
        assert!(odd.len() <= 1, "cut at {cut_us} us: {odd:?}");
        // 19 good pulses, less the two that make the input live; the next one may be too close to the second part.
        assert!(widths(&signals).len() >= 16, "cut at {cut_us} us");
        let faults = decoder.faults();
        assert!(faults.out_of_range + faults.too_soon >= 1, "cut at {cut_us} us: {faults:?}");
        assert_eq!(first_loss(&signals), None);
    }
}

#[test]
fn a_missing_edge_costs_its_pulse_and_no_wrong_width_is_reported() {
    for edge in 8..36 {
        let mut decoder = servo();
        let signals = decode(&mut decoder, &servo_pulses(500.0, 20).without_edge(edge), 0, us(50_000.0));
        let widths = widths(&signals);
        assert!(widths.iter().all(|&width| width == us(1500.0) as u32), "edge {edge}: {widths:?}");
        assert!(widths.len() >= 16, "edge {edge} cost {} pulses", 18 - widths.len());
        assert_eq!(decoder.faults().missing_edges, 1, "edge {edge}");
        assert_eq!(first_loss(&signals), None);
    }
}

/// Two edges within the time that the interrupt takes: the hardware keeps the second stamp, and the pin reads as before.
#[test]
fn a_glitch_whose_edges_merge_into_one_gives_no_wrong_width() {
    for at_us in [10_600.0, 11_900.0, 12_500.0] {
        let mut decoder = servo();
        let good = servo_pulses(500.0, 20);
        let at = good.edges().partition_point(|&(time, _)| time < us(at_us));
        let mut line = Line::default();
        for (n, &(time, level)) in good.edges().iter().enumerate() {
            if n == at {
                line.level(us(at_us), good.edges()[n - 1].1);
            }
            line.level(time, level);
        }
        let signals = decode(&mut decoder, &line, 0, us(50_000.0));
        assert!(widths(&signals).iter().all(|&width| width == us(1500.0) as u32), "at {at_us} us");
        assert!(widths(&signals).len() >= 17, "at {at_us} us");
        assert_eq!(decoder.faults().missing_edges, 1);
    }
}

#[test]
fn an_overcapture_drops_the_pulse_in_hand_only() {
    let mut decoder = servo();
    decode(&mut decoder, &servo_pulses(500.0, 10), 0, us(25_400.0));
    decoder.edge(us(25_500.0) as u32, Level::High);
    decoder.overcapture();
    decoder.edge(us(26_700.0) as u32, Level::Low);
    assert_eq!(decoder.poll(us(26_800.0) as u32), Signal::Unchanged);
    assert_eq!(decoder.faults().missing_edges, 1);
    decoder.edge(us(28_000.0) as u32, Level::High);
    decoder.edge(us(29_400.0) as u32, Level::Low);
    let expected = Signal::Pulse { width_ticks: us(1400.0) as u32, period_ticks: us(5000.0) as u32 };
    assert_eq!(decoder.poll(us(29_500.0) as u32), expected);
}

#[test]
fn pulses_out_of_range_are_counted_and_keep_no_input_alive() {
    for width_us in [700.0, 795.0, 2205.0, 2450.0] {
        let mut decoder = servo();
        let bad = Line::pulses(us(25_500.0), us(2500.0), us(width_us), 100);
        let signals = decode(&mut decoder, &servo_pulses(500.0, 10).then(&bad), 0, us(275_000.0));
        let last_good = us(500.0 + 9.0 * 2500.0 + 1500.0);
        let (time, reason) = first_loss(&signals).unwrap();
        assert_eq!(reason, LossReason::Implausible, "{width_us} us");
        assert!(time - last_good <= u64::from(decoder.timing().timeout_ticks()) + TICKS_PER_POLL);
        assert!(widths(&signals).iter().all(|&width| width == us(1500.0) as u32));
        assert!(decoder.faults().out_of_range >= 98, "{:?}", decoder.faults());
    }
    // A fifth of the span beyond either end is let pass: another clock, a trim.
    for width_us in [801.0, 2199.0] {
        let mut decoder = servo();
        let signals = decode(&mut decoder, &Line::pulses(us(500.0), us(2500.0), us(width_us), 10), 0, us(26_000.0));
        assert_eq!(widths(&signals).len(), 8, "{width_us} us");
    }
}

#[test]
fn a_line_that_floods_is_masked_for_longer_and_longer_and_comes_back() {
    let mut decoder = servo();
    // 1 MHz of edges from 26 ms on, for 400 ms; then good pulses again.
    let good = servo_pulses(500.0, 10);
    let mut line = good;
    for n in 0..200_000_u64 {
        line.level(us(26_000.0) + n * us(2.0), if n % 2 == 0 { Level::High } else { Level::Low });
    }
    line = line.then(&servo_pulses(430_000.0, 80));

    let mut edges = line.edges().iter().peekable();
    let (mut most, mut total, mut signals) = (0, 0, Vec::new());
    for poll in 1..=us(630_000.0) / TICKS_PER_POLL {
        let now = poll * TICKS_PER_POLL;
        let mut interrupts = 0;
        while let Some(&(time, level)) = edges.next_if(|&&(time, _)| time < now) {
            if !decoder.is_off() {
                interrupts += 1;
                decoder.edge(time as u32, level);
            }
        }
        most = most.max(interrupts);
        total += if (us(26_000.0)..us(426_000.0)).contains(&now) { interrupts } else { 0 };
        signals.push((now, decoder.poll(now as u32)));
    }
    assert_eq!(most, decoder.timing().edges_per_poll() + 1, "interrupts in one control tick");
    // 2000 ticks of flood: one until the next poll, and pauses of 2, 4 ... 512, 512 polls.
    assert!(decoder.faults().floods <= 14 && total <= 14 * most, "{total} interrupts, {:?}", decoder.faults());
    let (time, reason) = first_loss(&signals).unwrap();
    assert_eq!(reason, LossReason::Flood);
    assert!(time <= us(24_500.0 + 100_000.0) + TICKS_PER_POLL, "the loss was late: {time}");
    let back = signals.iter().find(|(at, s)| *at > time && matches!(s, Signal::Pulse { .. })).unwrap().0;
    let longest_pause = u64::from(LONGEST_MASK_POLLS) * TICKS_PER_POLL;
    assert!(back <= us(430_000.0) + longest_pause + us(4.0 * 2500.0), "back at {back}");
}

/// A single burst masks the input until the next poll, and costs one pulse: no loss.
#[test]
fn a_burst_costs_one_pulse() {
    let mut decoder = servo();
    let mut line = servo_pulses(500.0, 5);
    for n in 0..20 {
        line.level(us(12_500.0 + 5.0 * f64::from(n)), if n % 2 == 0 { Level::High } else { Level::Low });
    }
    let signals = decode(&mut decoder, &line.then(&servo_pulses(13_000.0, 10)), 0, us(37_900.0));
    assert_eq!(decoder.faults().floods, 1);
    assert_eq!(first_loss(&signals), None);
    // Two make the input live; one rose while it was not known whether the line was low.
    assert_eq!(widths(&signals).len(), 15 - 2 - 1);
}

#[test]
fn a_full_queue_counts_as_a_flood() {
    let mut decoder = servo();
    decode(&mut decoder, &servo_pulses(500.0, 10), 0, us(25_400.0));
    decoder.overrun();
    assert!(decoder.is_off());
    assert_eq!(decoder.faults().floods, 1);
    assert_eq!(decoder.poll(us(25_500.0) as u32), Signal::Unchanged);
    assert!(!decoder.is_off());
}

/// 60 s at 84 MHz wrap a 32-bit counter once; 51 s of silence come back to the same stamp.
#[test]
fn time_stamps_wrap_without_a_trace() {
    let line = servo_pulses(500.0, 100);
    let end = us(250_000.0);
    let expected = decode(&mut servo(), &line, 0, end);
    for &(time, _) in line.edges().iter().step_by(7) {
        for offset in [0_u32, 1, 2, 100] {
            let origin = 0_u32.wrapping_sub(time as u32).wrapping_add(offset);
            assert_eq!(
                decode(&mut seen_low(PulseProtocol::StandardPwm.at(400), origin), &line, origin, end),
                expected,
                "wrap at {time} - {offset}"
            );
        }
    }

    // Pulses that are one turn of the counter apart are not taken for neighbors, nor one for a glitch of the other.
    let turn = 1_u64 << 32;
    let first = Line::pulses(us(500.0), us(2500.0), us(1500.0), 2);
    let later = Line::pulses(us(500.0) + turn + us(2500.0) * 2, us(2500.0), us(1500.0), 2);
    let mut decoder = servo();
    let signals = decode(&mut decoder, &first.then(&later), 0, turn + us(20_000.0));
    assert!(signals.iter().all(|&(_, signal)| signal == Signal::Nothing), "a stamp from a turn ago was believed");
    assert_eq!(decoder.faults(), Faults::default());

    // High for a whole turn of the counter and 1.5 ms: not a pulse of 1.5 ms, that two more would make three of.
    let mut line = servo_pulses(500.0, 3);
    line.level(us(10_000.0), Level::High);
    line.level(us(10_000.0) + turn + us(1500.0), Level::Low);
    let line = line.then(&Line::pulses(us(12_500.0) + turn, us(2500.0), us(1500.0), 2));
    let mut decoder = servo();
    let signals = decode(&mut decoder, &line, 0, turn + us(20_000.0));
    assert_eq!(widths(&signals).len(), 1);
    assert_eq!(first_loss(&signals).unwrap().1, LossReason::StuckHigh);
}

/// The interrupt comes between the reading of the timer and the poll.
#[test]
fn an_edge_that_is_stamped_after_the_poll_is_not_old() {
    let mut decoder = servo();
    decode(&mut decoder, &servo_pulses(500.0, 10), 0, us(25_400.0));
    decoder.edge(us(25_500.0) as u32, Level::High);
    decoder.edge(us(27_000.0) as u32, Level::Low);
    assert_eq!(decoder.poll(us(26_999.0) as u32), Signal::Unchanged);
    assert!(matches!(decoder.poll(us(27_002.0) as u32), Signal::Pulse { .. }));
}

#[test]
fn limits_that_cannot_work_are_refused_with_the_reason() {
    let new = |pulse, timer_hz, poll_hz| Timing::new(pulse, timer_hz, poll_hz).unwrap_err();
    assert_eq!(new(PulseProtocol::StandardPwm.at(400), TIMER_HZ, 99), TimingError::PollRate { poll_hz: 99 });
    for frame_hz in [39, 4001] {
        let error = TimingError::FrameRate { frame_hz: frame_hz.into() };
        assert_eq!(new(PulseProtocol::RawDuty.at(frame_hz), TIMER_HZ, LOOP_HZ), error);
    }
    assert!(matches!(new(PulseProtocol::OneShot125.at(2000), 500_000, LOOP_HZ), TimingError::Pulse(_)));
    let timing = timing(PulseProtocol::StandardPwm.at(400));
    let slowest = timing.period_range_ticks().1;
    assert!(timing.with_timeout_ticks(2 * slowest).is_ok() && timing.with_timeout_ticks(1 << 30).is_ok());
    for ticks in [2 * slowest - 1, (1 << 30) + 1] {
        let error = timing.with_timeout_ticks(ticks).unwrap_err();
        assert!(error.to_string().contains(&ticks.to_string()), "{error}");
    }
}

fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(any::<u8>(), 0..600)
}

/// A line that does anything: edges after 0 to 3 ms (short times are as likely as long ones), of any level.
fn any_line() -> impl Strategy<Value = Line> {
    proptest::collection::vec((0.0..12.4_f64, any::<bool>()), 0..400).prop_map(|steps| {
        let (mut line, mut time) = (Line::default(), 0);
        for (wait, high) in steps {
            time += wait.exp2() as u64 * 42;
            line.level(time, if high { Level::High } else { Level::Low });
        }
        line
    })
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn any_edges_give_pulses_within_the_limits_only(line in any_line(), origin in any::<u32>(), which in 0..PULSES.len()) {
        let mut decoder = Decoder::new(timing(PULSES[which]));
        let (min, max) = decoder.timing().width_range_ticks();
        let shortest = decoder.timing().period_range_ticks().0;
        let end = line.edges().last().map_or(0, |edge| edge.0) + us(110_000.0);
        let signals = decode(&mut decoder, &line, origin, end);
        let mut last = None;
        for &(time, signal) in &signals {
            if let Signal::Pulse { width_ticks, period_ticks } = signal {
                prop_assert!((min..=max).contains(&width_ticks) && period_ticks >= shortest);
                last = Some(time);
            }
            if let (Signal::Unchanged, Some(last)) = (signal, last) {
                prop_assert!(time - last <= u64::from(decoder.timing().timeout_ticks()) + TICKS_PER_POLL);
            }
        }
        let signal = signals.last().unwrap().1;
        prop_assert!(matches!(signal, Signal::Nothing | Signal::Lost(_)), "live after 110 ms of silence");
    }

    #[test]
    fn time_has_no_origin(line in any_line(), origin in any::<u32>()) {
        let end = line.edges().last().map_or(0, |edge| edge.0) + us(1000.0);
        let mut elsewhere = seen_low(PulseProtocol::StandardPwm.at(400), origin);
        prop_assert_eq!(decode(&mut elsewhere, &line, origin, end), decode(&mut servo(), &line, 0, end));
    }

    #[test]
    fn any_bytes_keep_the_claims(data in any_bytes()) {
        fuzz_capture(&data);
    }
}

/// Frames of 16 bits at 600 kbaud, 2000 a second: what a flight controller sends that is set to DShot600.
fn dshot600(frames: u64) -> Line {
    let mut line = Line::default();
    for frame in 0..frames {
        for bit in 0..16 {
            let rise = us(500.0) * frame + us(1.67) * bit;
            line.level(rise, Level::High);
            line.level(rise + us(if bit % 3 == 0 { 1.25 } else { 0.625 }), Level::Low);
        }
    }
    line
}

#[test]
fn a_line_with_another_protocol_is_driven_and_an_open_one_is_not() {
    let timeout = us(100_000.0);
    for (name, line) in [
        ("OneShot125", Line::pulses(us(1000.0), us(500.0), us(187.5), 400)),
        ("raw duty at 600 Hz", Line::pulses(us(1000.0), us(1666.7), us(300.0), 120)),
        ("servo pulses that are too long", Line::pulses(us(1000.0), us(20_000.0), us(3000.0), 10)),
        ("DShot600", dshot600(400)),
        // So long that the pauses are longer than the timeout.
        ("an oscillation", Line::pulses(us(1000.0), us(2.0), us(1.0), 200_000)),
        ("pulses of 5 us every 99 ms", Line::pulses(us(1000.0), us(99_000.0), us(5.0), 3)),
    ] {
        let (first, last) = (line.edges()[0].0, line.edges().last().unwrap().0);
        // Stamps wrap within it, and the time after it is longer than that for which the age of a stamp is right.
        for origin in [0, 0x8000_0000, u32::MAX - 1_000_000] {
            let mut decoder = seen_low(PulseProtocol::StandardPwm.at(400), origin);
            let end = last + (1 << 32);
            let readings = decode_with(&mut decoder, &line, origin, end, Decoder::read);
            for (time, reading) in readings {
                let from = first + us(500.0) + 2 * TICKS_PER_POLL;
                assert_ne!(reading.width_ticks(), Some(0), "{name}");
                if (from..last).contains(&time) {
                    assert_eq!(reading, InputReading::UNREADABLE, "{name} at {time}");
                }
                // The pause of a mask, and the time behind the long filter, to which such a line may be silent.
                let polls = u64::from(LONGEST_MASK_POLLS + FILTERED_POLLS) + 10;
                if time > last + timeout + polls * TICKS_PER_POLL {
                    assert!(!reading.is_driven(), "{name}: {reading:?} at {time}, long after {last}");
                }
            }
        }
    }
    // Spikes that a motor's currents couple into an open lead.
    let mut open = Line::default();
    for n in 0..1000 {
        open = open.with_glitch(us(300.0) * (n + 1), us(0.4));
    }
    let readings =
        decode_with(&mut seen_low(PulseProtocol::StandardPwm.at(400), 0), &open, 0, us(300_000.0), Decoder::read);
    // The edge that showed the line low counts until the timeout.
    let late = readings.iter().filter(|&&(time, _)| time > timeout);
    for (time, reading) in late {
        assert_eq!(*reading, InputReading::NOTHING, "at {time}");
    }
    // A line that is lost and silent.
    let readings = decode_with(&mut servo(), &servo_pulses(500.0, 20), 0, us(400_000.0), Decoder::read);
    let driven = readings.iter().filter(|(time, _)| *time > us(200_000.0));
    assert!(driven.clone().count() > 900);
    driven.for_each(|(_, reading)| assert_eq!(*reading, InputReading::LOST));
}

/// Of a spike that is shorter than the interrupt's latency both edges read low.
#[test]
fn one_spike_on_an_open_line_does_not_drive_it() {
    let mut decoder = servo();
    let quiet = us(500_000.0) as u32;
    assert_eq!(
        (0..quiet).step_by(TICKS_PER_POLL as usize).map(|now| decoder.read(now)).last(),
        Some(InputReading::NOTHING)
    );
    decoder.edge(quiet, Level::Low);
    for poll in 1..2 * FILTERED_POLLS {
        let reading = decoder.read(quiet + u32::from(poll) * TICKS_PER_POLL as u32);
        assert_eq!(reading, InputReading::NOTHING, "at poll {poll} after the spike");
    }
    assert_eq!(decoder.faults().missing_edges, 1, "it is counted");
}
