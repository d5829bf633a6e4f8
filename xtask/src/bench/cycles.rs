//! An estimate of what an instruction costs on a Cortex-M4.
//!
//! The numbers are those of the core's technical reference manual (ARM DDI 0439, 3.3), with its upper ends where it gives a
//! range:
//!
//! | instructions | cycles |
//! |---|---|
//! | data processing, multiplications of all widths | 1 |
//! | division | 12 |
//! | load; load right after another load | 2; 1 |
//! | store with an immediate offset; with a register | 1; 2 |
//! | two or more registers | 1 each, and 1 |
//! | skipped, or a branch that is not taken | 1 |
//! | every jump, and an instruction barrier | 3 more, to fill the pipeline again |
//! | floating point; division; multiplication and addition in one | 1; 14; 3 |
//! | entry of an interrupt and return | 12 and 12 |
//!
//! Memory is taken to answer at once. The flash does so as long as its cache hits; a miss costs up to 5 cycles more at
//! 168 MHz. So these are estimates, and no more.

/// Cycles to fill the pipeline after a jump.
const REFILL: u32 = 3;
/// Cycles from an interrupt's request to its first instruction.
pub const ENTRY: u32 = 12;
/// Cycles of an interrupt that are not its instructions': entry and return.
pub const INTERRUPT: u32 = ENTRY + 12;

/// What an instruction does to the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// Nothing; so many cycles.
    Computes(u32),
    /// Loads one register.
    Loads,
    /// Stores one register.
    Stores { register_offset: bool },
    /// Loads or stores so many registers.
    Moves(u32),
    /// Waits for the pipeline to drain.
    Barrier,
}

/// Adds up the instructions of a path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Cycles so far.
    pub cycles: u32,
    after_load: bool,
}

impl Estimate {
    /// Adds one instruction: whether its condition held, and whether the next one was another than the one behind it.
    pub fn add(&mut self, first: u16, second: u16, executed: bool, jumped: bool) {
        let class = if executed { class(first, second) } else { Class::Computes(1) };
        self.cycles += match class {
            Class::Computes(cycles) => cycles,
            Class::Loads if self.after_load => 1,
            Class::Loads => 2,
            Class::Stores { register_offset } => 1 + u32::from(register_offset),
            Class::Moves(registers) => 1 + registers,
            Class::Barrier => 1 + REFILL,
        };
        if jumped {
            self.cycles += REFILL;
        }
        self.after_load = class == Class::Loads;
    }
}

/// Bytes of the instruction that starts with this halfword.
pub const fn length(first: u16) -> u32 {
    if first >> 11 < 0b11101 { 2 } else { 4 }
}

fn class(first: u16, second: u16) -> Class {
    if length(first) == 2 { narrow(first) } else { wide(first, second) }
}

fn narrow(code: u16) -> Class {
    let loads_or_stores = |loads: bool, register_offset| {
        if loads { Class::Loads } else { Class::Stores { register_offset } }
    };
    let registers = |mask: u16| Class::Moves((code & mask).count_ones());
    match code >> 8 {
        // LDR of a literal.
        0x48..=0x4F => Class::Loads,
        // The third to the eighth of these load: LDRSB, LDR, LDRH, LDRB, LDRSH.
        0x50..=0x5F => loads_or_stores(code >> 9 & 7 >= 3, true),
        0x60..=0x9F => loads_or_stores(code & 0x800 != 0, false),
        // PUSH and POP.
        0xB4 | 0xB5 | 0xBC | 0xBD => registers(0x1FF),
        // STM and LDM.
        0xC0..=0xCF => registers(0xFF),
        _ => Class::Computes(1),
    }
}

fn wide(first: u16, second: u16) -> Class {
    match first >> 8 {
        0xE8 | 0xE9 if first & 0x40 == 0 => Class::Moves(second.count_ones()),
        // TBB and TBH load the distance of the jump, and LDREX and STREX one register.
        0xE8 if first & 0xFFF0 == 0xE8D0 => Class::Loads,
        0xE8 if first & 0xFF80 == 0xE800 || first & 0xFFF0 == 0xE8C0 => Class::Computes(2),
        // LDRD and STRD.
        0xE8 | 0xE9 => Class::Moves(2),
        // VLDR and VSTR with bit 24, VLDM, VSTM and moves of two registers without; doubles are pairs.
        0xED if first & 0x20 == 0 => {
            if first & 0x10 != 0 {
                Class::Loads
            } else {
                Class::Stores { register_offset: false }
            }
        }
        0xEC | 0xED if first & 0xFFE0 != 0xEC40 => Class::Moves(u32::from(second & 0xFF)),
        0xEE if second & 0x10 == 0 => match first & 0xB0 {
            // VMLA, VMLS, VNMLA, VNMLS, and the fused forms.
            0x00 | 0x10 | 0x90 | 0xA0 => Class::Computes(3),
            // VDIV.
            0x80 => Class::Computes(14),
            // VSQRT among the forms with one operand.
            0xB0 if first & 0xF == 1 && second & 0xC0 == 0xC0 => Class::Computes(14),
            _ => Class::Computes(1),
        },
        // DSB, DMB and ISB.
        0xF3 if first == 0xF3BF && second & 0xFFF0 == 0x8F60 => Class::Barrier,
        0xF8 | 0xF9 if first & 0x10 != 0 => Class::Loads,
        // Without an immediate of 12 bits (0x80) or 8 (0x800) the offset is a register.
        0xF8 | 0xF9 => Class::Stores { register_offset: first & 0x80 == 0 && second & 0x800 == 0 },
        // SDIV and UDIV.
        0xFB if matches!(first & 0xFFF0, 0xFB90 | 0xFBB0) => Class::Computes(12),
        _ => Class::Computes(1),
    }
}

#[cfg(test)]
mod tests {
    use super::{Class, Estimate, class};

    /// Encodings as the assembler writes them.
    #[test]
    fn instructions_are_told_apart() {
        let stores = |register_offset| Class::Stores { register_offset };
        for (first, second, expected, text) in [
            (0x1840, 0, Class::Computes(1), "adds r0, r0, r1"),
            (0x4348, 0, Class::Computes(1), "muls r0, r1"),
            (0x6801, 0, Class::Loads, "ldr r1, [r0]"),
            (0x6001, 0, stores(false), "str r1, [r0]"),
            (0x5088, 0, stores(true), "str r0, [r1, r2]"),
            (0x5888, 0, Class::Loads, "ldr r0, [r1, r2]"),
            (0x5688, 0, Class::Loads, "ldrsb r0, [r1, r2]"),
            (0xB5F0, 0, Class::Moves(5), "push {r4-r7, lr}"),
            (0xBDF0, 0, Class::Moves(5), "pop {r4-r7, pc}"),
            (0xE92D, 0x4FF0, Class::Moves(9), "push.w {r4-r11, lr}"),
            (0xE9D0, 0x1202, Class::Moves(2), "ldrd r1, r2, [r0, #8]"),
            (0xE8DF, 0xF002, Class::Loads, "tbb [pc, r2]"),
            (0xE8D0, 0x3F4F, Class::Loads, "ldrexb r3, [r0]"),
            (0xE8C0, 0x1F42, Class::Computes(2), "strexb r2, r1, [r0]"),
            (0xF8D1, 0x0100, Class::Loads, "ldr.w r0, [r1, #256]"),
            (0xF8C1, 0x0100, stores(false), "str.w r0, [r1, #256]"),
            (0xF841, 0x0C08, stores(false), "str r0, [r1, #-8]"),
            (0xF841, 0x0022, stores(true), "str.w r0, [r1, r2, lsl #2]"),
            (0xFBC0, 0x2301, Class::Computes(1), "smlal r2, r3, r0, r1"),
            (0xFBB0, 0xF0F1, Class::Computes(12), "udiv r0, r0, r1"),
            (0xF3BF, 0x8F6F, Class::Barrier, "isb sy"),
            (0xF000, 0xF802, Class::Computes(1), "bl"),
            (0xED90, 0x0A00, Class::Loads, "vldr s0, [r0]"),
            (0xED80, 0x0A00, stores(false), "vstr s0, [r0]"),
            (0xED2D, 0x8B02, Class::Moves(2), "vpush {d8}"),
            (0xEE20, 0x0A20, Class::Computes(1), "vmul.f32 s0, s0, s1"),
            (0xEE00, 0x0A81, Class::Computes(3), "vmla.f32 s0, s1, s2"),
            (0xEE80, 0x0A20, Class::Computes(14), "vdiv.f32 s0, s0, s1"),
            (0xEE30, 0x0A20, Class::Computes(1), "vadd.f32 s0, s0, s1"),
            (0xEE10, 0x0A10, Class::Computes(1), "vmov r0, s0"),
        ] {
            assert_eq!(class(first, second), expected, "{text}");
        }
    }

    #[test]
    fn a_load_after_a_load_is_cheaper_and_a_jump_costs_a_refill() {
        let mut estimate = Estimate::default();
        estimate.add(0x6801, 0, true, false);
        estimate.add(0x6801, 0, true, false);
        assert_eq!(estimate.cycles, 3);
        estimate.add(0xE7FE, 0, true, true);
        assert_eq!(estimate.cycles, 7);
        estimate.add(0xBDF0, 0, false, false);
        assert_eq!(estimate.cycles, 8);
    }
}
