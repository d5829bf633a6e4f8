//! The pins of an RP2040 that runs the image: what a flight controller puts on its inputs, and what comes out.
//!
//! Time is in cycles of 125 MHz since the core was started.

use std::path::PathBuf;

pub use emulator::rp2040::pulses;
use emulator::rp2040::{self, CYCLES_PER_S, Edge, Emulator, Flash as Bytes, Run, Trace};
use rotorlead::dshot::Speed;
use rotorlead::settings::{MOTORS, Settings, Store};
use rotorlead_rp2040::generated::{FLASH_START, SETTINGS_START};
pub use rotorlead_rp2040::generated::{INPUT_1, JUMPER, LED, OUTPUT_1, REGULATOR_MODE};

use crate::flash::Flash;

/// Bytes of a sector of the flash.
const SECTOR: usize = 4096;

/// The image that `cargo xtask test` has built.
///
/// # Panics
/// When it has not.
#[must_use]
pub fn image() -> PathBuf {
    crate::emulator::named("ROTORLEAD_RP2040_IMAGE")
}

/// The same with a panic in its control task, which strikes when the first output goes above one half.
///
/// # Panics
/// When `cargo xtask test` has not named it.
#[must_use]
pub fn panicking_image() -> PathBuf {
    crate::emulator::named("ROTORLEAD_PANICKING_RP2040_IMAGE")
}

/// Cycles in so many microseconds.
#[must_use]
pub fn us(us: f64) -> u64 {
    (us * CYCLES_PER_S as f64 / 1e6).round() as u64
}

/// Cycles in so many milliseconds.
#[must_use]
pub fn ms(ms: f64) -> u64 {
    us(1e3 * ms)
}

/// The flash of a controller on which somebody has set these.
///
/// # Panics
/// When they are not valid.
#[must_use]
pub fn stored(settings: &Settings) -> Bytes {
    let settings = settings.clone().validate().unwrap_or_else(|error| panic!("{error}"));
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&settings).unwrap_or_else(|error| panic!("{error:?}"));
    Bytes { offset: SETTINGS_START - FLASH_START, bytes: store.into_flash().bytes }
}

/// A stamp of an edge at an input with pulses.
#[derive(Clone, Copy, Debug)]
pub struct Stamp {
    /// The edge, in one of the cycles at which the line is looked at.
    pub edge: Edge,
    /// When the stamp was made.
    pub made: u64,
}

/// What the state machine of an input (`boards/rp2040/src/inputs.rs`) makes of its line up to `end`.
///
/// # Panics
/// When the edges are not in order.
#[must_use]
pub fn stamps(pin: u8, line: &[Edge], end: u64) -> Vec<Stamp> {
    const AT_REST: u64 = 5;
    const FIRST: u64 = 13;
    const APART: u64 = 10;
    const NEEDED: u64 = 26;
    const OLD_IN_ROW: u32 = 32;
    assert!(line.is_sorted_by_key(|edge| edge.cycle));
    let edges: Vec<Edge> = line.iter().copied().filter(|edge| edge.pin == pin).collect();
    let before = |cycle| edges.partition_point(|edge| edge.cycle <= cycle);
    let level_at = |cycle| before(cycle).checked_sub(1).is_some_and(|edge: usize| edges[edge].is_high);
    let mut stamps = Vec::new();
    let (mut now, mut is_high) = (AT_REST - 1, false);
    while now < end {
        if level_at(now) == is_high {
            let Some(next) = edges.get(before(now)) else { break };
            now += (next.cycle - now).div_ceil(AT_REST) * AT_REST;
            continue;
        }
        let (mut at, mut needed, mut in_row) = (now + FIRST, NEEDED, 0);
        loop {
            (needed, in_row) = if level_at(at) == is_high { (needed, in_row + 1) } else { (needed - 1, 0) };
            if needed == 0 || in_row == OLD_IN_ROW {
                break;
            }
            at += APART;
        }
        if needed == 0 {
            is_high = !is_high;
            let cycle = at - FIRST - (NEEDED - 1) * APART;
            stamps.push(Stamp { edge: Edge { cycle, pin, is_high }, made: at });
        }
        // The next look is a whole number of looks behind the first one.
        now += (at - now).div_ceil(AT_REST) * AT_REST;
    }
    stamps
}

/// A pulse at a pin: when it began, and how long it was, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// Its rise.
    pub rise: u64,
    /// From there to its fall.
    pub width: u64,
}

/// The whole pulses of a pin.
#[must_use]
pub fn read_pulses(trace: &Trace, pin: u8) -> Vec<Pulse> {
    pulses_in(trace.edges_on(pin))
}

/// The whole pulses in the edges of one pin.
pub fn pulses_in(edges: impl Iterator<Item = Edge>) -> Vec<Pulse> {
    let mut rise = None;
    edges
        .filter_map(|edge| {
            if edge.is_high {
                rise = Some(edge.cycle);
                return None;
            }
            rise.take().map(|rise| Pulse { rise, width: edge.cycle - rise })
        })
        .collect()
}

/// A controller with these settings, until `end`, with its outputs watched.
#[must_use]
pub fn run(settings: &Settings, end: u64) -> Run {
    let mut run = Run::new(image(), end);
    run.flash.push(stored(settings));
    run.watch.extend((OUTPUT_1..).take(MOTORS));
    run
}

/// What came of it.
///
/// # Panics
/// When the emulator does not run, or the core went wrong.
#[must_use]
pub fn trace(emulator: Emulator, run: &Run) -> Trace {
    let trace = emulator.run(run).unwrap_or_else(|error| panic!("{error}"));
    assert!(trace.faults.is_empty(), "{:?}", trace.faults);
    trace
}

/// Cycles of a bit of DShot, to the nearest.
#[must_use]
pub fn bit_cycles(speed: Speed) -> u64 {
    (CYCLES_PER_S + u64::from(speed.bits_per_s()) / 2) / u64::from(speed.bits_per_s())
}

/// A line with frames of DShot ([`rp2040::frames`]).
pub fn frames(pin: u8, speed: Speed, frames: impl IntoIterator<Item = (u64, u16)>) -> Vec<Edge> {
    rp2040::frames(pin, speed.bits_per_s(), frames)
}

/// What a pin has sent as frames of DShot: when each began, and its bits.
///
/// # Panics
/// Where a pulse or a bit has not its length to so many cycles and a part in 500, or a frame not 16 bits.
#[must_use]
pub fn decode_frames(trace: &Trace, pin: u8, speed: Speed, cycles: f64) -> Vec<(u64, u16)> {
    frames_in(trace.edges_on(pin), trace.cycles, speed, cycles).unwrap_or_else(|problem| panic!("{problem}"))
}

/// The frames of DShot in the edges of one pin up to `end`.
///
/// # Errors
/// Where a pulse or a bit has not its length to so many cycles and a part in 500, or a frame not 16 bits.
pub fn frames_in(
    edges: impl Iterator<Item = Edge>,
    end: u64,
    speed: Speed,
    cycles: f64,
) -> Result<Vec<(u64, u16)>, String> {
    let bit = bit_cycles(speed) as f64;
    let near = |length: u64, bits: f64| (length as f64 - bits * bit).abs() <= cycles + bits * bit / 500.0;
    let mut frames: Vec<(u64, Vec<bool>)> = Vec::new();
    let mut last_rise = None;
    for pulse in pulses_in(edges) {
        let is_one = near(pulse.width, 0.75);
        if !is_one && !near(pulse.width, 0.375) {
            return Err(format!("a pulse of {} cycles at {}", pulse.width, pulse.rise));
        }
        match (frames.last_mut(), last_rise.map(|last| pulse.rise - last)) {
            (Some((_, bits)), Some(apart)) if bits.len() < 16 => {
                if !near(apart, 1.0) {
                    return Err(format!("a bit of {apart} cycles at {}", pulse.rise));
                }
                bits.push(is_one);
            }
            (_, apart) => {
                if apart.is_some_and(|apart| apart as f64 <= 3.0 * bit) {
                    return Err(format!("no gap before {}", pulse.rise));
                }
                frames.push((pulse.rise, vec![is_one]));
            }
        }
        last_rise = Some(pulse.rise);
    }
    // The run may have ended within a frame.
    let is_cut = frames.last().is_some_and(|(start, _)| end < start + 16 * bit_cycles(speed));
    frames.truncate(frames.len() - usize::from(is_cut));
    frames
        .into_iter()
        .map(|(start, bits)| match bits.len() {
            16 => Ok((start, bits.iter().fold(0, |word, &bit| word << 1 | u16::from(bit)))),
            short => Err(format!("the frame at {start} has {short} bits")),
        })
        .collect()
}
