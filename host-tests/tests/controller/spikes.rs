//! Pulses beneath spikes on the STM32F405: the timer's filters and its interrupt as its manual says, and the decoder behind them.

use host_tests::board::TestCapture;
use host_tests::line::{LOOP_HZ, TICKS_PER_POLL, TIMER_HZ, us};
use host_tests::spikes::{RATES_KHZ, WIDTHS_US, on_line, toggles};
use rotorlead::capture::{InputReading, Listening, Timing};
use rotorlead::controller::Inputs;
use rotorlead::controller::hardware::Edge;
use rotorlead::protocol::{Pulse, PulseProtocol};

/// Counts from sample to sample of the usual filter and of the long one, and samples in a row: `src/board/capture.rs`.
const USUAL_COUNTS: u64 = 2;
const LONG_COUNTS: u64 = 32;
const SAMPLES: u64 = 8;

/// A line as edges: when, and the level from then on.
type Edges = Vec<(u64, bool)>;

/// What a filter of the timer makes of a line up to `end`: its output changes at the last of so many samples in a row.
fn filtered(line: &[(u64, bool)], counts: u64, end: u64) -> Edges {
    let mut output = false;
    let mut in_row = 0;
    let mut edges = Vec::new();
    let ends = line.iter().skip(1).map(|edge| edge.0).chain([end]);
    for (&(from, level), to) in line.iter().zip(ends) {
        let first = from.div_ceil(counts);
        let samples = to.div_ceil(counts) - first;
        if samples == 0 {
            continue;
        }
        if level == output {
            in_row = 0;
        } else if in_row + samples < SAMPLES {
            in_row += samples;
        } else {
            edges.push(((first + SAMPLES - in_row - 1) * counts, level));
            (output, in_row) = (level, 0);
        }
    }
    edges
}

fn level_at(line: &[(u64, bool)], time: u64) -> bool {
    let before = line.partition_point(|edge| edge.0 <= time);
    before > 0 && line[before - 1].1
}

/// The interrupt of the first input, and what the controller makes of it.
struct Input<'a> {
    capture: TestCapture,
    inputs: Inputs<TestCapture>,
    line: &'a [(u64, bool)],
    filters: [Edges; 2],
    /// What was captured up to here is taken, or dropped.
    seen: u64,
    random: u64,
}

impl<'a> Input<'a> {
    fn new(timing: Timing, line: &'a [(u64, bool)], end: u64) -> Self {
        let capture = TestCapture::default();
        let inputs = Inputs::new(capture.clone(), Some(timing));
        let filters = [USUAL_COUNTS, LONG_COUNTS].map(|counts| filtered(line, counts, end));
        Self { capture, inputs, line, filters, seen: 0, random: 7 }
    }

    fn listening(&self) -> Listening {
        self.capture.get().listening[0]
    }

    /// The next edge that the hardware captures.
    fn next(&self, after: u64) -> Option<u64> {
        let edges = match self.listening() {
            Listening::Off => return None,
            Listening::All => &self.filters[0],
            Listening::LongLevels => &self.filters[1],
        };
        edges.get(edges.partition_point(|edge| edge.0 <= after)).map(|edge| edge.0)
    }

    /// From an edge to its interrupt: 0.4 to 3.7 µs (3.3 at most in `docs/firmware.md`), mostly short.
    fn latency(&mut self) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let share = (self.random >> 40) as f64 / f64::from(1 << 24);
        us(0.4 + 3.3 * share.powi(8))
    }

    /// One control tick up to `now`: its interrupts, and what it reads.
    fn tick(&mut self, now: u64) -> (u32, InputReading) {
        let mut interrupts = 0;
        while let Some(edge) = self.next(self.seen) {
            let served = edge + self.latency();
            if served >= now {
                break;
            }
            // All that came until then is in one stamp, the last.
            let (mut last, mut overcapture) = (edge, false);
            while let Some(next) = self.next(last).filter(|next| *next <= served) {
                (last, overcapture) = (next, true);
            }
            // The pin itself is read, behind no filter, and some reads of registers after the stamp.
            let is_high = level_at(self.line, served + us(READS_US));
            self.capture.get().edges[0] = Some(Edge { timestamp: last as u32, is_high, overcapture });
            self.inputs.capture();
            self.seen = last;
            interrupts += 1;
        }
        self.capture.get().now = now as u32;
        let before = self.listening();
        let [reading, ..] = self.inputs.poll();
        if before == Listening::Off && self.listening() != Listening::Off {
            self.seen = now;
        }
        (interrupts, reading)
    }
}

/// What came of a line.
#[derive(Debug, Default)]
struct Outcome {
    accepted: u64,
    /// Of those, the widths that no pulse has.
    wrong: u64,
    lost: bool,
    worst_us: f64,
    most_interrupts: u32,
    /// Longest time from one accepted pulse to the next, in frames.
    longest_gap: f64,
}

const COMMANDS_US: [f64; 3] = [0.25, 0.6, 0.8];
/// From reading a stamp to reading the level of its line: of a lone edge two registers, of which one takes some 12 cycles of 168 MHz.
const READS_US: f64 = 0.2;

fn play(pulse: Pulse, sent: u64, spikes: &[u64]) -> Outcome {
    let (low_us, high_us) = pulse.protocol.range_us().unwrap();
    let (low_us, span_us) = (f64::from(low_us), f64::from(high_us - low_us));
    let period = u64::from(TIMER_HZ / u32::from(pulse.frame_hz));
    let width = |n: u64| us(low_us + span_us * COMMANDS_US[(n % 3) as usize]);
    let start = us(100.0);
    let line: Vec<u64> = (0..sent).flat_map(|n| [start + n * period, start + n * period + width(n)]).collect();
    let line = on_line(&line, spikes);
    let end = start + sent * period;
    let timing = Timing::new(pulse, TIMER_HZ, LOOP_HZ).unwrap();
    let mut input = Input::new(timing, &line, end);
    let mut outcome = Outcome::default();
    let mut last = 0;
    for now in (TICKS_PER_POLL..end).step_by(TICKS_PER_POLL as usize) {
        let (interrupts, reading) = input.tick(now);
        outcome.most_interrupts = outcome.most_interrupts.max(interrupts);
        outcome.lost |= outcome.accepted > 0 && !reading.is_live();
        let Some(width_ticks) = reading.width_ticks() else { continue };
        outcome.accepted += 1;
        outcome.longest_gap = outcome.longest_gap.max((now - last) as f64 / period as f64);
        last = now;
        let off = (0..3).map(|n| width(n).abs_diff(width_ticks.into())).min().unwrap();
        let off_us = off as f64 / us(1.0) as f64;
        if off_us > 0.1 * span_us {
            outcome.wrong += 1;
        } else {
            outcome.worst_us = outcome.worst_us.max(off_us);
        }
    }
    assert!(outcome.most_interrupts <= timing.edges_per_poll() + 1, "{outcome:?}");
    outcome
}

#[test]
fn spikes_under_two_microseconds_cost_a_pulse_now_and_then_and_never_the_input() {
    for pulse in
        [PulseProtocol::StandardPwm.at(50), PulseProtocol::StandardPwm.at(400), PulseProtocol::OneShot125.at(2000)]
    {
        for rate_khz in RATES_KHZ {
            for (seed, width_us) in (1..).zip(WIDTHS_US) {
                // So few pulses are good for the 100 ms of the timeout that chance loses the input now and then.
                if pulse.frame_hz == 50 && rate_khz > 50.0 {
                    continue;
                }
                let sent = 300;
                let end = u64::from(TIMER_HZ / u32::from(pulse.frame_hz)) * sent;
                let spikes = toggles(us(1000.0) as f64 / rate_khz, us(width_us), end, seed);
                let outcome = play(pulse, sent, &spikes);
                let Outcome { accepted, worst_us, longest_gap, .. } = outcome;
                let name = format!("{pulse:?}, spikes of {width_us} us at {rate_khz} kHz");
                println!("{name}: {accepted} of {sent}, {worst_us:.2} us off, {longest_gap} frames apart at most");
                assert!(!outcome.lost && outcome.wrong == 0, "{name}: {outcome:?}");
                // Most are lost where the pin is read within a spike: one edge in five with 1.9 us at 100 kHz.
                assert!(accepted > sent * 3 / 5 && longest_gap < 10.0, "{name}: {outcome:?}");
                // The long filter takes 3.05 us in a row, to 0.38 us: a spike in them begins them anew.
                assert!(worst_us < 2.0 * (3.05 + 0.38 + width_us), "{name}: {outcome:?}");
            }
        }
    }
}

/// The load of a line that is no signal: at most so many interrupts in a tick ([`play`] holds that), and few on average.
#[test]
fn an_oscillating_line_costs_a_bounded_number_of_interrupts() {
    for half_us in [0.1, 0.25, 0.5, 1.0, 2.0, 2.8, 3.2, 5.0, 10.0] {
        let oscillation: Vec<u64> = (1..).map(|n| us(half_us * f64::from(n))).take_while(|at| *at < us(2e6)).collect();
        let line = on_line(&oscillation, &[]);
        let end = us(2e6);
        let timing = Timing::new(PulseProtocol::StandardPwm.at(400), TIMER_HZ, LOOP_HZ).unwrap();
        let most = timing.edges_per_poll() + 1;
        let mut input = Input::new(timing, &line, end);
        let ticks = (TICKS_PER_POLL..end).step_by(TICKS_PER_POLL as usize);
        let interrupts: Vec<u32> = ticks.map(|now| input.tick(now).0).collect();
        let total: u32 = interrupts.iter().sum();
        println!("{half_us} us high and low: {total} interrupts in {} ticks", interrupts.len());
        assert!(interrupts.iter().all(|count| *count <= most), "{half_us} us");
        assert!(total < 40 * most, "{half_us} us: {total} interrupts in {} ticks", interrupts.len());
    }
}
