//! Just enough of the Thumb and Thumb-2 instruction sets to know what a function calls and how deep its stack grows
//! (ARM DDI 0403E, the encodings are named there).

/// What one instruction means for calls and the stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing of either kind.
    None,
    /// Calls, or jumps to, this address. A jump within the function is no call.
    Goes(u32),
    /// Calls, or jumps to, an address in a register.
    GoesSomewhere,
    /// Takes this many bytes of stack.
    Pushes(u32),
    /// Takes an amount of stack that depends on a register.
    PushesSomething,
    /// Loads the word at an address into a register.
    Loads(u32, u32),
    /// Adds a register to the stack pointer: how a core without wide immediates takes a large frame.
    AddsToStack(u32),
}

/// Length in bytes and effect of the instruction at `address` that starts with these halfwords.
pub fn decode(address: u32, first: u16, second: u16) -> (u32, Effect) {
    if first >> 11 < 0b11101 { (2, narrow(address, first)) } else { (4, wide(address, first, second)) }
}

fn narrow(address: u32, code: u16) -> Effect {
    let code = u32::from(code);
    let jump = |offset: i32| Effect::Goes(address.wrapping_add(4).wrapping_add_signed(offset));
    match code >> 8 {
        // PUSH (T1): registers and the link register.
        0xB4 | 0xB5 => Effect::Pushes(4 * (code & 0x1FF).count_ones()),
        // SUB (SP minus immediate, T1).
        0xB0 if code & 0x80 != 0 => Effect::Pushes(4 * (code & 0x7F)),
        // B (T1) under a condition; 0xDE and 0xDF are UDF and SVC.
        0xD0..=0xDD => jump(2 * i32::from(code as u8 as i8)),
        // B (T2).
        0xE0..=0xE7 => jump(sign_extend(code & 0x7FF, 11) * 2),
        // BX and BLX of anything but the link register.
        0x47 if code & 0x78 != 14 << 3 => Effect::GoesSomewhere,
        // LDR (literal, T1).
        0x48..=0x4F => Effect::Loads(code >> 8 & 7, ((address + 4) & !3) + 4 * (code & 0xFF)),
        // ADD of a register to the stack pointer. ADD and MOV to the program counter are jumps through a table of the function's
        // own: LLVM calls and leaves through a register by BLX and BX alone.
        0x44 if code & 0x87 == 0x85 => Effect::AddsToStack(code >> 3 & 0xF),
        // MOV to the stack pointer: only frame pointers do that, on the way out.
        _ => Effect::None,
    }
}

fn wide(address: u32, first: u16, second: u16) -> Effect {
    let (first, second) = (u32::from(first), u32::from(second));
    const SP: u32 = 13;
    match first {
        // STMDB SP! (PUSH.W).
        0xE92D => return Effect::Pushes(4 * second.count_ones()),
        // STR with a new SP (PUSH.W of one register).
        0xF84D if second & 0xF00 == 0xD00 => return Effect::Pushes(second & 0xFF),
        // STRD with a new SP below the old.
        0xE96D => return Effect::Pushes(4 * (second & 0xFF)),
        // VPUSH.
        _ if first & 0xFFBF == 0xED2D => return Effect::Pushes(4 * (second & 0xFF)),
        // SUB SP, SP, register.
        0xEBAD if second >> 8 & 0xF == SP => return Effect::PushesSomething,
        _ => {}
    }
    let immediate = (first & 0x400) << 1 | (second & 0x7000) >> 4 | second & 0xFF;
    let to_sp = second & 0x8F00 == SP << 8;
    match first & 0xFBFF {
        // SUB SP, SP, modified immediate (T3), and 12 bits (SUBW, T4).
        0xF1AD if to_sp => return Effect::Pushes(expand_immediate(immediate)),
        0xF2AD if to_sp => return Effect::Pushes(immediate),
        _ => {}
    }
    if first & 0xF800 == 0xF000 && second & 0x8000 != 0 {
        let sign = first >> 10 & 1;
        let (j1, j2) = (second >> 13 & 1, second >> 11 & 1);
        let low = second & 0x7FF;
        let offset = match second & 0x5000 {
            // B (T3) under a condition; conditions 14 and 15 are other instructions.
            0 if first & 0x380 == 0x380 => return Effect::None,
            0 => sign_extend(sign << 19 | j2 << 18 | j1 << 17 | (first & 0x3F) << 11 | low, 20),
            // BLX to ARM code, which this core has not.
            0x4000 => return Effect::None,
            // B (T4) and BL.
            _ => {
                let (i1, i2) = (!(j1 ^ sign) & 1, !(j2 ^ sign) & 1);
                sign_extend(sign << 23 | i1 << 22 | i2 << 21 | (first & 0x3FF) << 11 | low, 24)
            }
        };
        return Effect::Goes(address.wrapping_add(4).wrapping_add_signed(2 * offset));
    }
    // LDR to the program counter from anything but the stack.
    if first & 0xFF70 == 0xF850 && second >> 12 == 15 && first & 0xF != SP {
        return Effect::GoesSomewhere;
    }
    Effect::None
}

fn sign_extend(value: u32, bits: u32) -> i32 {
    (value << (32 - bits)).cast_signed() >> (32 - bits)
}

/// ThumbExpandImm: a byte repeated, or rotated with its highest bit set.
fn expand_immediate(immediate: u32) -> u32 {
    let byte = immediate & 0xFF;
    match immediate >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (byte | 0x80).rotate_right(immediate >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings as GNU as writes them.
    #[test]
    fn stack_instructions_take_what_they_say() {
        let pushes = |first, second| match decode(0, first, second).1 {
            Effect::Pushes(bytes) => bytes,
            other => panic!("{other:?}"),
        };
        assert_eq!(pushes(0xB5F0, 0), 20, "push {{r4-r7, lr}}");
        assert_eq!(pushes(0xB082, 0), 8, "sub sp, #8");
        assert_eq!(pushes(0xE92D, 0x4FF0), 36, "push.w {{r4-r11, lr}}");
        assert_eq!(pushes(0xF84D, 0xBD04), 4, "str r11, [sp, #-4]!");
        assert_eq!(pushes(0xED2D, 0x8B02), 8, "vpush {{d8}}");
        assert_eq!(pushes(0xF5AD, 0x7D00), 512, "sub.w sp, sp, #512");
        assert_eq!(pushes(0xF2AD, 0x4D04), 1028, "subw sp, sp, #1028");
        assert_eq!(decode(0, 0xEBAD, 0x0D0C).1, Effect::PushesSomething, "sub.w sp, sp, ip");
        assert_eq!(decode(0x1000_3F9A, 0x44B5, 0), (2, Effect::AddsToStack(6)), "add sp, r6");
        assert_eq!(decode(0x1001_3B32, 0x4AF6, 0), (2, Effect::Loads(2, 0x1001_3F0C)), "ldr r2, [pc, #984]");
    }

    #[test]
    fn branches_go_where_they_point() {
        assert_eq!(decode(0x0800_0200, 0xF000, 0xF802), (4, Effect::Goes(0x0800_0208)), "bl .+8");
        assert_eq!(decode(0x0800_0200, 0xF7FF, 0xFFFE), (4, Effect::Goes(0x0800_0200)), "bl .");
        assert_eq!(decode(0x0800_0200, 0xF7FF, 0xBFFE), (4, Effect::Goes(0x0800_0200)), "b.w .");
        assert_eq!(decode(0x0800_0200, 0xE7FE, 0), (2, Effect::Goes(0x0800_0200)), "b .");
        assert_eq!(decode(0x0800_0200, 0xD0FE, 0), (2, Effect::Goes(0x0800_0200)), "beq .");
        assert_eq!(decode(0x0800_0200, 0xF43F, 0xAFFE), (4, Effect::Goes(0x0800_0200)), "beq.w .");
        assert_eq!(decode(0, 0x4798, 0), (2, Effect::GoesSomewhere), "blx r3");
        assert_eq!(decode(0, 0x4770, 0), (2, Effect::None), "bx lr");
        assert_eq!(decode(0, 0x468F, 0), (2, Effect::None), "mov pc, r1");
        assert_eq!(decode(0, 0x44AF, 0), (2, Effect::None), "add pc, r5");
        assert_eq!(decode(0, 0xF3BF, 0x8F4F), (4, Effect::None), "dsb sy");
    }
}
