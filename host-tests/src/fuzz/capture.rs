//! Any bytes as the life of one input.

use rotorlead::capture::{Decoder, Faults, Level, Signal, Timing};
use rotorlead::channel::{Channel, ChannelSettings, Input, State};
use rotorlead::protocol::{Pulse, PulseProtocol};
use rotorlead::throttle::{Command, EscCommand, PulseScale};

use crate::line::{LOOP_HZ, Line, TICKS_PER_POLL, TIMER_HZ, us};
use crate::paper_design;

/// The pulses that the first byte chooses from.
pub const PULSES: [Pulse; 6] = [
    PulseProtocol::StandardPwm.at(400),
    PulseProtocol::OneShot125.at(2000),
    Pulse::PAPER,
    PulseProtocol::RawDuty.at(40),
    PulseProtocol::RawDuty.at(4000),
    PulseProtocol::RawDuty.at(1000),
];

/// Any bytes as the life of an input: protocol, start of the timer, then events of three bytes.
///
/// The first byte of an event says what happens, the other two when: `0` a rise and `1` a fall after that many timer
/// ticks times 4, `2` polls (with edges left out meanwhile), `3` an overcapture, `4` a full queue, `5` a stamp from anywhere.
/// Claims: pulses are within the limits, the signal follows its order (no loss before life, no life without
/// [`rotorlead::capture::PULSES_TO_LIVE`] pulses' time), counters only grow, a silent input is lost after the timeout, and
/// behind a channel the output is stop unless the decoder gave pulses.
pub fn fuzz_capture(data: &[u8]) {
    let [choice, origin, events @ ..] = data else { return };
    let pulse = PULSES[usize::from(*choice) % PULSES.len()];
    let timing = Timing::new(pulse, TIMER_HZ, LOOP_HZ).expect("all of these pulses suit this timer");
    let scale = pulse.scale(TIMER_HZ).expect("all of these pulses suit this timer");
    let mut life = Life {
        decoder: Decoder::new(timing),
        channel: Channel::new(&ChannelSettings::default(), coefficients()).expect("defaults are in order"),
        scale,
        now: u32::from(*origin) << 24,
        next_poll: (u32::from(*origin) << 24).wrapping_add(TICKS_PER_POLL as u32),
        faults: Faults::default(),
        was_live: false,
        seen_disarmed: false,
    };
    for event in events.chunks_exact(3) {
        let argument = u16::from_le_bytes([event[1], event[2]]);
        match event[0] % 6 {
            kind @ (0 | 1) => {
                life.advance(u32::from(argument) * 4);
                life.decoder.edge(life.now, if kind == 0 { Level::High } else { Level::Low });
            }
            2 => life.advance(u32::from(argument) * TICKS_PER_POLL as u32 / 64),
            3 => life.decoder.overcapture(),
            4 => life.decoder.overrun(),
            _ => life.decoder.edge(life.now.wrapping_add(u32::from(argument) << 16), Level::High),
        }
    }
    // The line falls silent: the input is lost after the timeout, and the output is stop after the hold time.
    let quiet_ticks = timing.timeout_ticks() / TICKS_PER_POLL as u32 + 2;
    for _ in 0..quiet_ticks {
        life.poll();
    }
    // A last stamp from the future may look young for as long as it lies ahead.
    if !events.chunks_exact(3).any(|event| event[0] % 6 == 5) {
        assert!(matches!(life.poll().0, Signal::Nothing | Signal::Lost(_)), "a silent input is live");
        for _ in 0..ChannelSettings::default().hold_ticks {
            life.poll();
        }
        assert!(life.poll().1 <= Command::ZERO, "a silent input leaves the motor running");
    }
}

fn coefficients() -> rotorlead::biquad::Coefficients {
    static COEFFICIENTS: std::sync::OnceLock<rotorlead::biquad::Coefficients> = std::sync::OnceLock::new();
    *COEFFICIENTS.get_or_init(|| *paper_design().coefficients())
}

struct Life {
    decoder: Decoder,
    channel: Channel,
    scale: PulseScale,
    now: u32,
    next_poll: u32,
    faults: Faults,
    was_live: bool,
    seen_disarmed: bool,
}

impl Life {
    /// Time goes on, with the polls that fall due.
    fn advance(&mut self, ticks: u32) {
        let end = self.now.wrapping_add(ticks);
        while end.wrapping_sub(self.next_poll).cast_signed() >= 0 {
            self.now = self.next_poll;
            self.tick();
        }
        self.now = end;
    }

    fn poll(&mut self) -> (Signal, EscCommand) {
        self.now = self.next_poll;
        self.tick()
    }

    fn tick(&mut self) -> (Signal, EscCommand) {
        self.next_poll = self.now.wrapping_add(TICKS_PER_POLL as u32);
        let signal = self.decoder.poll(self.now);
        let timing = *self.decoder.timing();
        match signal {
            Signal::Nothing => assert!(!self.was_live, "a lost input forgot that it was live"),
            Signal::Pulse { width_ticks, period_ticks } => {
                let (min, max) = timing.width_range_ticks();
                assert!((min..=max).contains(&width_ticks), "a pulse of {width_ticks}");
                assert!(period_ticks >= timing.period_range_ticks().0, "a frame of {period_ticks}");
                self.was_live = true;
            }
            Signal::Unchanged | Signal::Lost(_) => assert!(self.was_live, "{signal:?} before the first pulse"),
        }
        let (now, before) = (self.decoder.faults(), self.faults);
        for (now, before) in [
            (now.glitches, before.glitches),
            (now.missing_edges, before.missing_edges),
            (now.out_of_range, before.out_of_range),
            (now.too_soon, before.too_soon),
            (now.floods, before.floods),
            (now.losses, before.losses),
        ] {
            assert!(now >= before, "a counter went back");
        }
        self.faults = now;

        let input = Input::from_reading(signal.into(), &self.scale);
        let output = self.channel.tick(input);
        let threshold = ChannelSettings::default().disarming_threshold;
        if let Input::Command(command) = input
            && command < threshold
        {
            self.seen_disarmed = true;
            assert_eq!(output, Command::ZERO, "a disarmed command does not stop the motor");
        }
        if !self.seen_disarmed {
            assert_eq!(output, EscCommand::NO_PULSE, "a pulse goes out before a disarmed command was seen");
        }
        if self.channel.state() == State::Lost {
            assert!(output <= Command::ZERO, "a motor turns after the loss");
        }
        (signal, output)
    }
}

/// Bytes of lives that a line may well have, to start a fuzzer from: a good input of each protocol, glitches, a stuck line,
/// missing edges, a flood.
#[must_use]
pub fn capture_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let pwm = |width_us: f64| Line::pulses(us(500.0), us(2500.0), us(width_us), 12);
    let mut corpus = vec![
        ("servo", encode(0, 0, &pwm(1500.0))),
        ("servo_disarmed_then_armed", encode(0, 0, &pwm(1000.0).then(&shifted(&pwm(1500.0), us(30_000.0))))),
        ("oneshot", encode(1, 0, &Line::pulses(us(100.0), us(500.0), us(180.0), 40))),
        ("paper", encode(2, 0, &Line::pulses(us(100.0), us(1e6 / 600.0), us(800.0), 20))),
        ("duty_4khz", encode(4, 0, &Line::pulses(us(100.0), us(250.0), us(120.0), 40))),
        ("wrap", encode(0, 255, &Line::pulses(us(500.0), us(2500.0), us(1500.0), 90))),
        ("glitches", {
            let line = pwm(1500.0).with_glitch(us(3200.0), us(0.5)).with_glitch(us(6000.0), us(1.0));
            encode(0, 0, &line.with_glitch(us(7500.0), us(1.5)))
        }),
        ("missing_edges", encode(0, 0, &pwm(1500.0).without_edge(15).without_edge(8))),
        ("out_of_range", encode(0, 0, &pwm(1500.0).then(&shifted(&pwm(2400.0), us(30_000.0))))),
    ];
    let mut flood = encode(0, 0, &pwm(1500.0));
    for n in 0..40 {
        flood.extend([n % 2, 50, 0]);
    }
    corpus.push(("flood", flood));
    let mut lost = encode(0, 0, &pwm(1000.0));
    lost.extend([2, 0, 255, 2, 0, 255, 4, 0, 0, 3, 0, 0, 5, 12, 200]);
    corpus.push(("lost", lost));
    corpus
}

fn shifted(line: &Line, by: u64) -> Line {
    let mut moved = Line::default();
    for &(time, level) in line.edges() {
        moved.level(time + by, level);
    }
    moved
}

/// A line as events of [`fuzz_capture`]. Times are rounded to 4 timer ticks; longer waits become polls first.
fn encode(protocol: u8, origin: u8, line: &Line) -> Vec<u8> {
    let mut bytes = vec![protocol, origin];
    let mut now = 0;
    let push = |bytes: &mut Vec<u8>, kind: u8, argument: u64| {
        let [low, high] = u16::try_from(argument).expect("at most 65535 by construction").to_le_bytes();
        bytes.extend([kind, low, high]);
    };
    for &(time, level) in line.edges() {
        let polls = (time - now).saturating_sub(us(100.0)) / TICKS_PER_POLL;
        if polls > 0 {
            push(&mut bytes, 2, polls * 64);
            now += polls * TICKS_PER_POLL;
        }
        let wait = (time - now) / 4;
        push(&mut bytes, u8::from(level == Level::Low), wait);
        now += wait * 4;
    }
    bytes
}
