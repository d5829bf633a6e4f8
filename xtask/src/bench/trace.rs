//! Counts the instructions of a path by executing them one at a time.

use super::cycles::{Estimate, length};
use super::debugger::{Debugger, Registers};
use crate::image::Image;
use crate::run::Result;

/// Longest path that is believed: more is a path that went astray.
const LIMIT: u32 = 20_000;
/// Where the core puts the address to return to when it enters an interrupt, from the stack pointer on.
const STACKED_RETURN: u32 = 0x18;

/// What a path costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions executed. Exact.
    pub instructions: u32,
    /// Cycles, estimated; see [`super::cycles`].
    pub cycles: u32,
}

/// Registers of peripherals that the emulator has not got.
pub trait Hardware {
    /// What a load from this address gives; `None` where the emulator knows.
    fn load(&mut self, address: u32) -> Option<u32>;
}

/// None are missing.
pub struct AsEmulated;

impl Hardware for AsEmulated {
    fn load(&mut self, _address: u32) -> Option<u32> {
        None
    }
}

/// Executes up to the first of the instructions at `until`, which is not executed any more.
pub fn trace(debugger: &mut Debugger, image: &Image, until: &[u32], hardware: &mut dyn Hardware) -> Result<Cost> {
    let mut registers = debugger.registers()?;
    let mut estimate = Estimate::default();
    for instructions in 0..LIMIT {
        let pc = registers.pc();
        if instructions > 0 && until.contains(&pc) {
            return Ok(Cost { instructions, cycles: estimate.cycles });
        }
        let first = image.halfword(pc).ok_or_else(|| format!("there is no code at {pc:#x}"))?;
        let second = image.halfword(pc + 2).unwrap_or(0);
        let executed = registers.executes();
        let replaced = loaded_word(first, second, &registers)
            .filter(|_| executed)
            .and_then(|(target, address)| Some((target, hardware.load(address)?)));
        registers = debugger.step()?;
        estimate.add(first, second, executed, registers.pc() != pc + length(first));
        if let Some((target, value)) = replaced {
            debugger.set_register(target, value)?;
            registers.r[target] = value;
        }
    }
    Err(format!("{LIMIT} instructions did not lead to any of {until:#x?}"))
}

/// The core stands at the first instruction of an interrupt: where it will return to, unless another interrupt comes
/// directly after it.
pub fn interrupted_at(debugger: &mut Debugger) -> Result<u32> {
    let registers = debugger.registers()?;
    Ok(debugger.read(registers.r[13] + STACKED_RETURN)? & !1)
}

/// Register and address of a load of one word; registers of peripherals are read in no other way.
fn loaded_word(first: u16, second: u16, registers: &Registers) -> Option<(usize, u32)> {
    let (code, more) = (u32::from(first), u32::from(second));
    let register = |index: u32| registers.r[index as usize & 15];
    if length(first) == 2 {
        let (target, base) = (code as usize & 7, register(code >> 3 & 7));
        return match code >> 9 {
            // LDR (register, T1).
            0b010_1100 => Some((target, base.wrapping_add(register(code >> 6 & 7)))),
            // LDR (immediate, T1).
            _ if code >> 11 == 0b0_1101 => Some((target, base.wrapping_add((code >> 6 & 31) * 4))),
            _ => None,
        };
    }
    let (target, base) = (more as usize >> 12, register(code));
    if code & 0xF == 15 {
        // A literal.
        return None;
    }
    match code & 0xFFF0 {
        // LDR (immediate, T3).
        0xF8D0 => Some((target, base.wrapping_add(more & 0xFFF))),
        // LDR (register, T2).
        0xF850 if more & 0xFC0 == 0 => Some((target, base.wrapping_add(register(more) << (more >> 4 & 3)))),
        // LDR (immediate, T4): before or after the base has moved, up or down.
        0xF850 if more & 0x800 != 0 => {
            let offset = more & 0xFF;
            let moved = if more & 0x200 != 0 { base.wrapping_add(offset) } else { base.wrapping_sub(offset) };
            Some((target, if more & 0x400 != 0 { moved } else { base }))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Registers, loaded_word};

    /// Encodings as the assembler writes them.
    #[test]
    fn addresses_of_loads_are_those_of_the_core() {
        let mut registers = Registers::default();
        registers.r[1] = 0x4000_0000;
        registers.r[2] = 0x10;
        for (first, second, expected, text) in [
            (0x690B, 0, Some((3, 0x4000_0010)), "ldr r3, [r1, #16]"),
            (0x588B, 0, Some((3, 0x4000_0010)), "ldr r3, [r1, r2]"),
            (0xF8D1, 0x9024, Some((9, 0x4000_0024)), "ldr.w r9, [r1, #36]"),
            (0xF851, 0x9002, Some((9, 0x4000_0010)), "ldr.w r9, [r1, r2]"),
            (0xF851, 0x9022, Some((9, 0x4000_0040)), "ldr.w r9, [r1, r2, lsl #2]"),
            (0xF851, 0x3C08, Some((3, 0x3FFF_FFF8)), "ldr r3, [r1, #-8]"),
            (0xF851, 0x3B04, Some((3, 0x4000_0000)), "ldr r3, [r1], #4"),
            (0xF8DF, 0x3004, None, "ldr.w r3, [pc, #4]"),
            (0x610B, 0, None, "str r3, [r1, #16]"),
            (0xF8C1, 0x9024, None, "str.w r9, [r1, #36]"),
        ] {
            assert_eq!(loaded_word(first, second, &registers), expected, "{text}");
        }
    }
}
