//! The library on a board in memory, with the clocks of the RP2040: lines become captures and words, widths and frames become
//! edges.

use emulator::rp2040::{CYCLES_PER_S, Edge, frames};
use rotorlead::capture::Listening;
use rotorlead::controller::hardware::Edge as Capture;
use rotorlead::controller::{ClockReport, LAMP_STEP_MS, Lamp};
use rotorlead::dshot::{Line, Speed, Word};
use rotorlead::link::BAUD;
use rotorlead::settings::MOTORS;

use super::table::Column;
use super::{Miss, Outcome, Outputs, Play, Target};
use crate::board::{CRYSTAL, facts};
use crate::flash::Flash;
use crate::pins::{INPUT_1, JUMPER, LED, OUTPUT_1, Stamp, ms, stamps};
use crate::rig::{Rig, SharedFlash, saved};

/// The clocks of an RP2040, with stamps of 5 cycles. The library on a host reckons with the cycles of a Cortex-M4, whose tick takes 2050 where
/// that of an RP2040's core takes 5200 (`rotorlead::controller`'s load): a core that is slower by as much has as little time.
const CLOCKS: ClockReport = ClockReport { core_hz: CYCLES_PER_S as u32 / 104 * 41, timer_hz: 25_000_000, ..CRYSTAL };
const CYCLES_PER_COUNT: u64 = 5;
/// When it starts: what came before is not seen.
const START: u64 = CYCLES_PER_S / 5;
/// Start bit, eight bits, stop bit.
const CYCLES_PER_BYTE: u64 = 10 * CYCLES_PER_S / BAUD as u64;

/// The library on a board in memory.
pub struct Mocks;

impl Target for Mocks {
    fn column(&self) -> Column {
        Column::Mocks
    }

    fn play(&self, play: &Play) -> Result<Outcome, Miss> {
        let flash = match &play.settings {
            Some(settings) => saved(&settings.clone().validate().map_err(|error| Miss::Wrong(error.to_string()))?),
            None => SharedFlash::new(Flash::blank()),
        };
        let mut board = Board::start(&flash, play);
        while board.now < play.end {
            board.tick();
        }
        let mut edges = board.edges;
        edges.retain(|edge| edge.cycle <= play.end);
        edges.sort_by_key(|edge| edge.cycle);
        let answers = board.rig.inbox.into_iter().map(|tagged| tagged.message).collect();
        Ok(Outcome { outputs: Outputs::Edges { edges, true_to_cycles: 1.0 }, answers, end: play.end })
    }
}

struct Board<'a> {
    rig: Rig,
    play: &'a Play,
    /// Edges in order, and how many have come; and the same of the rest. Those of pulses are in `stamps`.
    lines: Vec<Edge>,
    edges_seen: usize,
    stamps: Vec<Stamp>,
    stamps_seen: usize,
    thrust_seen: usize,
    requests_seen: usize,
    words: [WordLine; MOTORS],
    now: u64,
    /// Up to when the counter of the outputs has counted.
    counted: u64,
    /// When each output can send its next frame.
    free: [u64; MOTORS],
    is_lit: bool,
    edges: Vec<Edge>,
}

impl<'a> Board<'a> {
    fn start(flash: &SharedFlash, play: &'a Play) -> Self {
        let (mut rig, _) = Rig::starting_on(flash, facts(CLOCKS));
        rig.hardware.board.status.bench_enabled = false;
        let mut lines = play.edges.clone();
        lines.sort_by_key(|edge| edge.cycle);
        let inputs = (INPUT_1..).take(MOTORS);
        let mut stamps: Vec<Stamp> = inputs.flat_map(|pin| stamps(pin, &lines, play.end)).collect();
        stamps.sort_by_key(|stamp| stamp.made);
        Self {
            rig,
            play,
            lines,
            edges_seen: 0,
            stamps,
            stamps_seen: 0,
            thrust_seen: 0,
            requests_seen: 0,
            words: Default::default(),
            now: START,
            counted: START,
            free: [0; MOTORS],
            is_lit: false,
            edges: Vec::new(),
        }
    }

    /// Lets time pass up to the next control tick, and runs it.
    fn tick(&mut self) {
        let tick_rate_hz = self.rig.hardware.board.control.parts_mut().timer.rate_hz;
        let tick = CYCLES_PER_S / u64::from(tick_rate_hz);
        self.now += tick;
        self.count();
        self.stimulate();
        let board = &mut self.rig.hardware.board;
        board.capture.get().now = (self.now / CYCLES_PER_COUNT) as u32;
        let readings = board.inputs.poll();
        board.control.run(readings, true);
        self.send();
        self.rig.serve((tick / CYCLES_PER_BYTE) as usize);
        self.light();
    }

    /// What the world outside has done up to now.
    fn stimulate(&mut self) {
        let Self { rig, play, now, .. } = self;
        let now = *now;
        while let Some(edge) = self.lines.get(self.edges_seen).filter(|edge| edge.cycle < now) {
            self.edges_seen += 1;
            let board = &mut rig.hardware.board;
            if edge.pin == JUMPER {
                board.status.bench_enabled = !edge.is_high;
                continue;
            }
            if edge.cycle < START {
                continue;
            }
            let motor = usize::from(edge.pin - INPUT_1);
            if let Some(line) = board.control.parts_mut().input_frames.line {
                let word = self.words[motor].edge(edge, line.speed);
                board.control.parts_mut().input_frames.words[motor].extend(word);
            }
        }
        while let Some(stamp) = self.stamps.get(self.stamps_seen).filter(|stamp| stamp.made < now) {
            self.stamps_seen += 1;
            let board = &mut rig.hardware.board;
            let motor = usize::from(stamp.edge.pin - INPUT_1);
            let has_pulses = board.control.parts_mut().input_frames.line.is_none();
            if has_pulses && stamp.made >= START && board.capture.get().listening[motor] != Listening::Off {
                let timestamp = (stamp.edge.cycle / CYCLES_PER_COUNT) as u32;
                board.capture.get().edges[motor] =
                    Some(Capture { timestamp, is_high: stamp.edge.is_high, overcapture: false });
                board.inputs.capture();
            }
        }
        let parts = rig.hardware.board.control.parts_mut();
        if let Some(Line { speed, .. }) = parts.input_frames.line {
            for (line, words) in self.words.iter_mut().zip(&mut parts.input_frames.words) {
                words.extend(line.pause(now, speed));
            }
        }
        while let Some((_, count)) = play.thrust.get(self.thrust_seen).filter(|(cycle, _)| *cycle < now) {
            self.thrust_seen += 1;
            parts.thrust.reading = *count;
        }
        while let Some((_, request)) = play.requests.get(self.requests_seen).filter(|(cycle, _)| *cycle < now) {
            self.requests_seen += 1;
            rig.send(request);
        }
    }

    /// Lets the counter of the outputs go on up to now, and notes the pulses that begin.
    fn count(&mut self) {
        let outputs = &mut self.rig.hardware.board.control.parts_mut().outputs;
        if outputs.line.is_some() {
            self.counted = self.now;
            return;
        }
        let cycles = CYCLES_PER_COUNT * u64::from(outputs.frames.0);
        let counts = (self.now - self.counted) / cycles;
        let before = outputs.time;
        outputs.advance(counts as u32);
        for (time, widths) in std::mem::take(&mut outputs.pulses) {
            let rise = self.counted + (time - before) * cycles;
            for (pin, width) in (OUTPUT_1..).zip(widths).filter(|(_, width)| *width > 0) {
                let fall = rise + u64::from(width) * cycles;
                self.edges.extend([(rise, true), (fall, false)].map(|(cycle, is_high)| Edge { cycle, pin, is_high }));
            }
        }
        self.counted += counts * cycles;
    }

    /// Notes the frames that the tick has sent, each behind the one before.
    fn send(&mut self) {
        let outputs = &mut self.rig.hardware.board.control.parts_mut().outputs;
        let Some(Line { speed, .. }) = outputs.line else { return };
        for (motor, sent) in outputs.sent.iter_mut().enumerate() {
            for frame in sent.drain(..) {
                let start = self.free[motor].max(self.now);
                // 16 bits, and a gap of 12.
                self.free[motor] = start + 28 * CYCLES_PER_S / u64::from(speed.bits_per_s());
                let edges = frames(OUTPUT_1 + motor as u8, speed.bits_per_s(), [(start, frame.to_bits())]);
                self.edges.extend(edges.into_iter().skip(1));
            }
        }
    }

    fn light(&mut self) {
        let milliseconds = (self.now / ms(1.0)) as u32;
        let board = &mut self.rig.hardware.board;
        let (is_bench_enabled, clocks) = (board.status.bench_enabled, board.status.facts.clocks);
        let lamp = Lamp::select(board.tick_mut(), is_bench_enabled, clocks.tells_pulses_apart());
        let is_lit = lamp.is_on(milliseconds / LAMP_STEP_MS * LAMP_STEP_MS);
        if is_lit != self.is_lit {
            self.is_lit = is_lit;
            self.edges.push(Edge { cycle: self.now, pin: LED, is_high: is_lit });
        }
    }
}

/// Collects the bits of a line: what is high for longer than between a zero's pulse and a one's is a one, and a low of about a
/// bit ends a word.
#[derive(Default)]
struct WordLine {
    word: u32,
    rise: u64,
    fall: u64,
}

impl WordLine {
    fn edge(&mut self, edge: &Edge, speed: Speed) -> Option<Word> {
        if edge.is_high {
            let word = self.pause(edge.cycle, speed);
            self.rise = edge.cycle;
            return word;
        }
        if self.rise > self.fall {
            self.fall = edge.cycle;
            // A one is in front of the bits. The register holds 32.
            let is_one = (self.fall - self.rise) * u64::from(speed.bits_per_s()) * 16 > 9 * CYCLES_PER_S;
            self.word = self.word.max(1) << 1 | u32::from(is_one);
        }
        None
    }

    /// The word that is over, where the line is low for long enough at `now`.
    fn pause(&mut self, now: u64, speed: Speed) -> Option<Word> {
        let is_over =
            self.fall >= self.rise && (now - self.fall) * u64::from(speed.bits_per_s()) * 8 > 7 * CYCLES_PER_S;
        if self.word == 0 || !is_over {
            return None;
        }
        Some(Word::new(std::mem::take(&mut self.word)))
    }
}
