//! How much of a control tick an excitation takes, before it is started.
//!
//! Each tick sums some of an excitation's lines ([`Lines::per_tick`](crate::excitation::Lines::per_tick)), and a line costs
//! what a channel does, so that many lines on a slow clock leave no time for the link, and
//! then the dead-man's switch ends the excitation. One that would is refused.
//!
//! The costs are cycles of a Cortex-M4, estimated from instructions that were counted in an emulator (see
//! `docs/firmware.md`), with interrupt entry and return. `cargo xtask bench --firmware` counts them again and fails where
//! one is above what stands here. A core without a product of 64 bits takes many times as long for a line, so it has costs of
//! its own: those of a Cortex-M0+, counted in an emulator (`host-tests/tests/rp2040/load.rs`).

use crate::link::{BYTES_PER_S, RECORD_SAMPLE_BYTES};

/// A control tick of four armed motors with new pulses and with inverses of which the slew limits each; 1476 were counted. With leads it is
/// some 280 less.
pub const TICK_CYCLES: u32 = 1500;
/// A control tick of an excitation that is recorded, without its lines: it interpolates between their sums. 2024 were counted.
pub const EXCITATION_TICK_CYCLES: u32 = 2050;
/// A line of the excitation that is summed in the tick; 30.2 were counted.
pub const LINE_CYCLES: u32 = 31;
/// An interrupt for one byte of the link, either way.
pub const BYTE_CYCLES: u32 = 100;
/// Of that, until the received byte is taken from the UART, which can then hold the next one.
pub const BYTE_TAKEN_CYCLES: u32 = 45;
/// A capture interrupt with an edge of each input.
pub const CAPTURE_CYCLES: u32 = 545;

/// Bytes of a keep-alive's frame, and of its answer's: an envelope of 7 bytes, its COBS byte and two zeros.
const KEEP_ALIVE_BYTES: u32 = 10;

/// Costs of an excitation on a core.
struct Costs {
    excitation_tick_cycles: u32,
    line_cycles: u32,
    byte_cycles: u32,
}

/// Of the core that this is compiled for: without a product of 64 bits a tick of four inverses, a line, and a byte take 5162, 174
/// and 220 cycles.
const COSTS: Costs = if cfg!(narrow_multiplier) {
    Costs { excitation_tick_cycles: 5200, line_cycles: 190, byte_cycles: 220 }
} else {
    Costs { excitation_tick_cycles: EXCITATION_TICK_CYCLES, line_cycles: LINE_CYCLES, byte_cycles: BYTE_CYCLES }
};

/// How much of each control tick a recorded excitation that sums so many lines in it takes at most, in percent, rounded up: the
/// tick itself, and interrupts for a keep-alive, its answer, and a sample of the recorder, at most what the line carries.
#[must_use]
pub fn percent(lines: usize, loop_rate_hz: u32, core_hz: u32) -> u32 {
    let rate = u64::from(loop_rate_hz.max(1));
    let line_bytes = u64::from(BYTES_PER_S) / rate + 1;
    let received = u64::from(KEEP_ALIVE_BYTES).min(line_bytes);
    let sent = u64::from(KEEP_ALIVE_BYTES + RECORD_SAMPLE_BYTES).min(line_bytes);
    let lines = (lines as u64).saturating_mul(u64::from(COSTS.line_cycles));
    let cycles = lines
        .saturating_add(u64::from(COSTS.excitation_tick_cycles) + (received + sent) * u64::from(COSTS.byte_cycles));
    let percent = cycles.saturating_mul(100 * rate).div_ceil(u64::from(core_hz.max(1)));
    u32::try_from(percent).unwrap_or(u32::MAX)
}
