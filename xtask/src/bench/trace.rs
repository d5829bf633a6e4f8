//! Counts the instructions of a path by executing them one at a time.

use emulator::{Debugger, Registers};

use super::cycles::{Estimate, length};
use crate::image::Image;
use crate::run::Result;

/// Longest path that is believed: more is a path that went astray.
const LIMIT: u32 = 20_000;
/// The data register of USART3, where it hands over the byte that has come.
const LINK_DATA: u32 = 0x4000_4804;
/// Where the core puts the address to return to when it enters an interrupt, from the stack pointer on.
const STACKED_RETURN: u32 = 0x18;

/// What a path costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions executed. Exact.
    pub instructions: u32,
    /// Cycles, estimated; see [`super::cycles`].
    pub cycles: u32,
    /// What waited meanwhile, though its priority is higher.
    pub locked: Locked,
    /// Cycles until the received byte was taken from the link's UART, estimated; 0 where none was.
    pub byte_taken: u32,
}

/// The longest times for which a path has kept interrupts of its own or of a higher priority waiting, cycles, estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Locked {
    /// The bytes of the link, at priority 5.
    pub bytes: u32,
    /// The captures, at priority 4.
    pub captures: u32,
    /// The control tick, at priority 3.
    pub ticks: u32,
}

impl Locked {
    /// The longer of each.
    pub fn max(self, other: Self) -> Self {
        Self {
            bytes: self.bytes.max(other.bytes),
            captures: self.captures.max(other.captures),
            ticks: self.ticks.max(other.ticks),
        }
    }
}

/// BASEPRI that keeps an interrupt of this priority waiting, or any lower one but 0: RTIC counts priorities upwards, and
/// the core downwards in the upper 4 bits.
const fn basepri_mask(priority: u32) -> u32 {
    (16 - priority) << 4
}

/// The core's masks of interrupts while a path runs.
#[derive(Clone, Copy, Debug, Default)]
struct Masks {
    base_priority: u32,
    all: bool,
    /// Cycles for which each has been masked now.
    now: Locked,
    longest: Locked,
}

impl Masks {
    /// After an instruction that took so many cycles.
    fn add(&mut self, cycles: u32) {
        let Self { base_priority: base, all, now, longest } = self;
        let count = |priority, cycles_now: &mut u32| {
            let masked = *all || (*base != 0 && *base <= basepri_mask(priority));
            *cycles_now = if masked { *cycles_now + cycles } else { 0 };
        };
        count(5, &mut now.bytes);
        count(4, &mut now.captures);
        count(3, &mut now.ticks);
        *longest = longest.max(*now);
    }

    /// What an instruction does to them.
    fn execute(&mut self, first: u16, second: u16, registers: &Registers) {
        match (first, second) {
            // CPSID i and CPSIE i.
            (0xB672, _) => self.all = true,
            (0xB662, _) => self.all = false,
            _ => {}
        }
        if let Some((register, only_up)) = sets_base_priority(first, second) {
            let value = registers.r[register] & 0xFF;
            let is_higher = value != 0 && (self.base_priority == 0 || value < self.base_priority);
            if !only_up || is_higher {
                self.base_priority = value;
            }
        }
    }

    const fn any(&self) -> bool {
        self.all || self.base_priority != 0
    }
}

/// The register that an instruction writes to BASEPRI, and whether only if that masks more (BASEPRI_MAX).
fn sets_base_priority(first: u16, second: u16) -> Option<(usize, bool)> {
    match (first & 0xFFF0, second) {
        (0xF380, 0x8811) => Some((usize::from(first & 15), false)),
        (0xF380, 0x8812) => Some((usize::from(first & 15), true)),
        _ => None,
    }
}

/// The instructions of an image that begin a lock.
pub fn locks(image: &Image) -> Vec<u32> {
    let all = image.functions.iter().flat_map(|function| {
        (function.address..function.address + function.size).step_by(2).filter(|&address| {
            let code = image.halfword(address).zip(image.halfword(address + 2));
            code.is_some_and(|(first, second)| matches!(sets_base_priority(first, second), Some((_, true))))
        })
    });
    all.collect()
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
    trace_until(debugger, image, hardware, |pc, _| until.contains(&pc))
}

/// Executes a lock, from the instruction that begins it to that which ends it.
pub fn trace_lock(debugger: &mut Debugger, image: &Image, hardware: &mut dyn Hardware) -> Result<Cost> {
    trace_until(debugger, image, hardware, |_, is_locked| !is_locked)
}

fn trace_until(
    debugger: &mut Debugger,
    image: &Image,
    hardware: &mut dyn Hardware,
    ends: impl Fn(u32, bool) -> bool,
) -> Result<Cost> {
    let mut masks = Masks::default();
    let mut registers = debugger.registers()?;
    let mut estimate = Estimate::default();
    let mut byte_taken = 0;
    for instructions in 0..LIMIT {
        let pc = registers.pc();
        if instructions > 0 && ends(pc, masks.any()) {
            return Ok(Cost { instructions, cycles: estimate.cycles, locked: masks.longest, byte_taken });
        }
        let first = image.halfword(pc).ok_or_else(|| format!("there is no code at {pc:#x}"))?;
        let second = image.halfword(pc + 2).unwrap_or(0);
        let executed = registers.executes();
        let loaded = loaded_word(first, second, &registers).filter(|_| executed);
        let replaced = loaded.and_then(|(target, address)| Some((target, hardware.load(address)?)));
        if executed {
            masks.execute(first, second, &registers);
        }
        registers = debugger.step()?;
        let before = estimate.cycles;
        estimate.add(first, second, executed, registers.pc() != pc + length(first));
        masks.add(estimate.cycles - before);
        if loaded.is_some_and(|(_, address)| address == LINK_DATA) {
            byte_taken = estimate.cycles;
        }
        if let Some((target, value)) = replaced {
            debugger.set_register(target, value)?;
            registers.r[target] = value;
        }
    }
    Err(format!("{LIMIT} instructions did not come to an end"))
}

/// The core stands at the first instruction of an interrupt: where it will return to, unless another interrupt comes
/// directly after it.
pub fn interrupted_at(debugger: &mut Debugger) -> Result<u32> {
    let registers = debugger.registers()?;
    Ok(debugger.read(registers.r[13] + STACKED_RETURN)? & !1)
}

/// Register and address of a load of a word or a half; registers of peripherals are read in no other way.
fn loaded_word(first: u16, second: u16, registers: &Registers) -> Option<(usize, u32)> {
    let (code, more) = (u32::from(first), u32::from(second));
    let register = |index: u32| registers.r[index as usize & 15];
    if length(first) == 2 {
        let (target, base) = (code as usize & 7, register(code >> 3 & 7));
        return match code >> 9 {
            // LDR (register, T1).
            0b010_1100 => Some((target, base.wrapping_add(register(code >> 6 & 7)))),
            // LDRH (immediate, T1).
            _ if code >> 11 == 0b1_0001 => Some((target, base.wrapping_add((code >> 6 & 31) * 2))),
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
        // LDR (immediate, T3) and LDRH (immediate, T2).
        0xF8D0 | 0xF8B0 => Some((target, base.wrapping_add(more & 0xFFF))),
        // LDR (register, T2).
        0xF850 if more & 0xFC0 == 0 => Some((target, base.wrapping_add(register(more) << (more >> 4 & 3)))),
        // LDR (immediate, T4) and LDRH (immediate, T3): before or after the base has moved, up or down.
        0xF850 | 0xF830 if more & 0x800 != 0 => {
            let offset = more & 0xFF;
            let moved = if more & 0x200 != 0 { base.wrapping_add(offset) } else { base.wrapping_sub(offset) };
            Some((target, if more & 0x400 != 0 { moved } else { base }))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Locked, Masks, Registers, loaded_word};

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
            (0x8A0B, 0, Some((3, 0x4000_0010)), "ldrh r3, [r1, #16]"),
            (0xF8B1, 0x9024, Some((9, 0x4000_0024)), "ldrh.w r9, [r1, #36]"),
            (0xF831, 0x3C04, Some((3, 0x3FFF_FFFC)), "ldrh r3, [r1, #-4]"),
            (0xF8DF, 0x3004, None, "ldr.w r3, [pc, #4]"),
            (0x610B, 0, None, "str r3, [r1, #16]"),
            (0xF8C1, 0x9024, None, "str.w r9, [r1, #36]"),
        ] {
            assert_eq!(loaded_word(first, second, &registers), expected, "{text}");
        }
    }

    #[test]
    fn a_lock_lasts_from_its_mask_to_the_end_of_it() {
        let mut masks = Masks::default();
        let mut registers = Registers::default();
        let mut execute = |first, second, value| {
            registers.r[3] = value;
            masks.execute(first, second, &registers);
            masks.add(10);
        };
        // MSR BASEPRI_MAX, r3: of the inputs, and inside it of the control task, which masks no more.
        execute(0xF383, 0x8812, 0xC0);
        execute(0xF383, 0x8812, 0xD0);
        execute(0xBF00, 0, 0);
        // MSR BASEPRI, r3.
        execute(0xF383, 0x8811, 0);
        execute(0xF383, 0x8812, 0xD0);
        execute(0xF383, 0x8811, 0);
        // CPSID i and CPSIE i.
        execute(0xB672, 0, 0);
        execute(0xB662, 0, 0);
        assert_eq!(masks.longest, Locked { bytes: 10, captures: 30, ticks: 30 });
        assert!(!masks.any());
    }
}
