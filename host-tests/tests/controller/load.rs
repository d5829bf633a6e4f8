//! Whether an excitation leaves the link the time that its keep-alives need: byte times played against tick times.

use host_tests::board::{CRYSTAL, INTERNAL, INTERNAL_PLL};
use rotorlead::controller::load::{BYTE_CYCLES, BYTE_TAKEN_CYCLES, EXCITATION_TICK_CYCLES, LINE_CYCLES, percent};
use rotorlead::link::{BYTES_PER_S, LineSet, MAX_LOAD_PERCENT, RECORD_SAMPLE_BYTES, Request, encode};

/// What an interrupt for bytes may interrupt.
#[derive(Clone, Copy, PartialEq, Eq)]
enum BytePriority {
    /// The control tick waits for it.
    AboveTick,
    /// It waits for the control tick.
    BelowTick,
}

/// What came of it.
#[derive(Debug, Default)]
struct Outcome {
    /// Keep-alives of which a byte was lost.
    keep_alives_lost: u32,
    /// Ticks that had not ended when the next one was due.
    late_ticks: u32,
    /// Part of the time that is left for the lowest priority.
    idle: f64,
}

const KEEP_ALIVES: u64 = 480;

fn keep_alive_bytes() -> u64 {
    let mut frame = [0; rotorlead::link::FRAME_BYTES];
    encode(7, &Request::KeepAlive, &mut frame).unwrap() as u64
}

/// Plays 480 keep-alives, one every 50 ms, against the ticks of an excitation of so many lines that is recorded. The UART
/// holds one byte while the next one comes in: a byte that ends before the one before it was taken is lost.
fn play(lines: usize, loop_rate_hz: u32, core_hz: u32, priority: BytePriority) -> Outcome {
    let core = u64::from(core_hz);
    let byte = core / u64::from(BYTES_PER_S);
    let period = core / u64::from(loop_rate_hz);
    let work = u64::from(EXCITATION_TICK_CYCLES) + lines as u64 * u64::from(LINE_CYCLES);
    let handler = u64::from(BYTE_CYCLES);
    let frame = keep_alive_bytes();
    let end = KEEP_ALIVES * core / 20;

    // Received bytes, by the cycle at which they are complete. The host's clock is its own, and a byte off the ticks.
    let mut received = (0..KEEP_ALIVES)
        .flat_map(|n| {
            let start = n * (core / 20) + n * 977 % period;
            (1..=frame).map(move |k| (start + k * byte, n))
        })
        .peekable();
    // Bytes to be sent, in thousandths.
    let mut to_send = 0_u64;
    let mut sender_free = 0_u64;
    let (mut next_tick, mut tick_left) = (0, 0_u64);
    let (mut now, mut idle) = (0_u64, 0_u64);
    // A received byte that waits to be taken, and whose it is.
    let mut waiting: Option<u64> = None;
    let mut lost = vec![false; KEEP_ALIVES as usize];
    let mut outcome = Outcome::default();
    while now < end {
        // What has become due.
        while let Some(&(at, whose)) = received.peek()
            && at <= now
        {
            if waiting.is_some() {
                lost[whose as usize] = true;
            }
            waiting = Some(whose);
            to_send += 1000;
            received.next();
        }
        while next_tick <= now {
            if tick_left > 0 {
                outcome.late_ticks += 1;
            }
            tick_left += work;
            next_tick += period;
            to_send += 1000 * u64::from(RECORD_SAMPLE_BYTES);
        }
        let may_send = to_send >= 1000 && sender_free <= now;
        let is_blocked = priority == BytePriority::BelowTick && tick_left > 0;
        if (waiting.is_some() || may_send) && !is_blocked {
            // One byte each way. The received one is taken first.
            let ends = now + handler;
            while let Some(&(at, whose)) = received.peek()
                && at < now + u64::from(BYTE_TAKEN_CYCLES)
                && waiting.is_some()
            {
                lost[whose as usize] = true;
                received.next();
            }
            waiting = None;
            if may_send {
                to_send -= 1000;
                sender_free = now + byte;
            }
            now = ends;
            continue;
        }
        // Until something happens, the tick works, or nobody does.
        let mut until = next_tick;
        if let Some(&(at, _)) = received.peek() {
            until = until.min(at);
        }
        if to_send >= 1000 && sender_free > now {
            until = until.min(sender_free);
        }
        if tick_left > 0 {
            let step = tick_left.min(if is_blocked { tick_left } else { until - now }).max(1);
            // The lower priority sees nothing of what comes meanwhile.
            if is_blocked {
                let ends = now + step;
                while let Some(&(at, whose)) = received.peek()
                    && at <= ends
                {
                    if waiting.is_some() {
                        lost[whose as usize] = true;
                    }
                    waiting = Some(whose);
                    received.next();
                }
            }
            tick_left -= step.min(tick_left);
            now += step;
        } else {
            idle += until - now;
            now = until;
        }
    }
    outcome.keep_alives_lost = lost.iter().filter(|&&lost| lost).count() as u32;
    outcome.idle = idle as f64 / end as f64;
    outcome
}

/// How many lines are summed in a tick.
fn per_tick(set: LineSet, loop_rate_hz: u32) -> usize {
    set.lines().per_tick(loop_rate_hz * set.lines().period_s())
}

/// Every line set on every clock, at some loop rates and at the highest that is accepted: lines in a tick, rate, clock.
fn all() -> impl Iterator<Item = (usize, u32, u32)> {
    let clocks = [CRYSTAL, INTERNAL_PLL, INTERNAL].map(|clocks| clocks.core_hz);
    let sets = [LineSet::Odd30Hz, LineSet::Odd45Hz];
    clocks.into_iter().flat_map(move |core_hz| {
        sets.into_iter().flat_map(move |lines| {
            let rates = [1000, 2000, 3000, 4999, 5000, 7000, 10_000].into_iter();
            let rates = rates.chain(highest_accepted(lines, core_hz));
            rates.map(move |rate| (per_tick(lines, rate), rate, core_hz))
        })
    })
}

/// The highest loop rate at which the lines are accepted on this clock.
fn highest_accepted(lines: LineSet, core_hz: u32) -> Option<u32> {
    (1000..=10_000).rev().find(|&rate| percent(per_tick(lines, rate), rate, core_hz) <= MAX_LOAD_PERCENT)
}

#[test]
fn no_keep_alive_is_lost_during_an_excitation_that_is_accepted() {
    let mut accepted = 0;
    for (lines, loop_rate_hz, core_hz) in all() {
        let percent = percent(lines, loop_rate_hz, core_hz);
        if percent > MAX_LOAD_PERCENT {
            continue;
        }
        let outcome = play(lines, loop_rate_hz, core_hz, BytePriority::AboveTick);
        println!("{lines} lines at {loop_rate_hz} Hz on {} MHz: {percent} %, {outcome:?}", core_hz / 1_000_000);
        assert_eq!((outcome.keep_alives_lost, outcome.late_ticks), (0, 0), "{lines} at {loop_rate_hz} on {core_hz}");
        assert!(outcome.idle > 0.1, "nothing is left for the answers: {outcome:?}");
        accepted += 1;
    }
    assert!(accepted >= 20, "only {accepted} are accepted");
}

/// What the priorities are for, and that this test can fail.
#[test]
fn below_the_tick_an_excitation_starves_the_link() {
    for lines in [LineSet::Odd30Hz, LineSet::Odd45Hz].map(|set| per_tick(set, 4999)) {
        let outcome = play(lines, 4999, 168_000_000, BytePriority::BelowTick);
        let part = f64::from(outcome.keep_alives_lost) / KEEP_ALIVES as f64;
        println!("{lines} lines in a tick: {:.0} % of the keep-alives are lost", 100.0 * part);
        assert!(part > 0.3, "{part}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    assert!(percent(150, 5000, 168_000_000) < 60);
    assert!(percent(225, 10_000, 168_000_000) <= MAX_LOAD_PERCENT);
    assert!(percent(150, 5000, 16_000_000) > MAX_LOAD_PERCENT, "150 lines at 16 MHz cannot run");
    assert!(percent(150, 1000, 16_000_000) <= MAX_LOAD_PERCENT, "they do at 1 kHz");
    assert_eq!(percent(usize::MAX >> 8, u32::MAX, 0), u32::MAX);
    assert!(percent(0, 0, 0) > MAX_LOAD_PERCENT);
}
