//! From the flash to RAM.
//!
//! Instructions come from RAM, where none waits. The flash is read through a cache of 16 KiB; what that has not costs some 400 ns, 50
//! cycles, for each eight bytes, and a control task cannot bound how often. So the reset copies the whole image with the initialized
//! data (board.x), from a flash that is not needed any more until settings are read.

use cortex_m::peripheral::{MPU, SCB};
use rp2040_hal::pac::ROSC;

use crate::clocks::SYSTEM_PLL;

/// What the boot ROM runs first: it lets the flash be read four bits at a time. For other chips see "Flashing" in
/// `docs/board-rp2040.md`.
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

// Before the copy, and so in the flash: a fast clock for it. The crystal runs on over a reset by the watchdog, and then the system PLL
// gives 125 MHz within some 0.1 ms. Otherwise, or where the PLL does not lock, the ring oscillator drives the core at 14 to 96 MHz instead
// of 1.8 to 12 MHz. The copy takes some 10 ms, 15 to 40 ms, and 350 ms. All waits end.
core::arch::global_asm!(
    ".syntax unified",
    ".section .Reset, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "push {{r4, lr}}",
    "ldr r0, ={ring_div}",
    "ldr r1, ={ring_value}",
    "str r1, [r0]",
    // The crystal's highest bit: it is stable.
    "ldr r0, ={crystal_status}",
    "ldr r1, [r0]",
    "cmp r1, #0",
    "bpl 1f",
    // The PLL out of its reset.
    "ldr r0, ={resets_clear}",
    "ldr r2, ={resets_pll}",
    "str r2, [r0]",
    "ldr r0, ={resets_done}",
    "bl 2f",
    "beq 1f",
    // Reference divider 1, the multiplier, power on, and the wait for the lock.
    "ldr r4, ={pll}",
    "movs r1, #1",
    "str r1, [r4]",
    "movs r1, #{multiplier}",
    "str r1, [r4, #8]",
    "ldr r0, ={pll_power_clear}",
    "movs r1, #{pll_power_core}",
    "str r1, [r0]",
    "movs r2, #1",
    "lsls r2, r2, #31",
    "movs r0, r4",
    "bl 2f",
    "beq 1f",
    "ldr r1, ={post_dividers}",
    "str r1, [r4, #12]",
    "ldr r0, ={pll_power_clear}",
    "movs r1, #{pll_power_post}",
    "str r1, [r0]",
    // The core over to it.
    "ldr r0, ={clk_sys_ctrl}",
    "movs r1, #1",
    "str r1, [r0]",
    "ldr r0, ={clk_sys_selected}",
    "movs r2, #2",
    "bl 2f",
    "1: pop {{r4, pc}}",
    // Waits until the word at r0 has a bit of r2; the flag Z where it does not come.
    "2: ldr r3, ={patience}",
    "3: ldr r1, [r0]",
    "tst r1, r2",
    "bne 4f",
    "subs r3, #1",
    "bne 3b",
    "4: bx lr",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
    ring_div = const ROSC_DIV,
    ring_value = const DIV_PASS + COPY_DIVIDER,
    crystal_status = const XOSC_STATUS,
    resets_clear = const RESETS + CLEAR_ALIAS,
    resets_done = const RESETS + 8,
    resets_pll = const 1 << 12,
    pll = const PLL_SYS,
    multiplier = const SYSTEM_PLL.0,
    pll_power_clear = const PLL_SYS + 4 + CLEAR_ALIAS,
    pll_power_core = const 1 << 5 | 1,
    pll_power_post = const 1 << 3,
    post_dividers = const (SYSTEM_PLL.1 as u32) << 16 | (SYSTEM_PLL.2 as u32) << 12,
    clk_sys_ctrl = const CLOCKS + 0x3c,
    clk_sys_selected = const CLOCKS + 0x44,
    patience = const PATIENCE,
);

/// The register of the ring oscillator's divider, and what makes a value valid (RP2040 datasheet, 2.17.8).
const ROSC_DIV: u32 = 0x4006_0010;
const DIV_PASS: u32 = 0xaa0;
/// The divider while the image is copied, and after a reset: 1.8 to 12 MHz (2.17.4).
const COPY_DIVIDER: u32 = 2;
const RESET_DIVIDER: u32 = 16;
/// The other registers that are written before the copy (2.15.7, 2.14.3, 2.16.7, 2.18.4), and where a peripheral's bits are cleared
/// (2.1.2).
const CLOCKS: u32 = 0x4000_8000;
const RESETS: u32 = 0x4000_c000;
const XOSC_STATUS: u32 = 0x4002_4004;
const PLL_SYS: u32 = 0x4002_8000;
const CLEAR_ALIAS: u32 = 0x3000;
/// Reads of a status before the wait for it ends: 8 cycles each, 1 ms at 80 MHz. A PLL locks within 0.1 ms.
const PATIENCE: u32 = 10_000;

/// Gives the ring oscillator the rate back that it has after a reset.
pub fn slow_ring_oscillator(oscillator: &ROSC) {
    // SAFETY: a divider that the datasheet names.
    oscillator.div().write(|w| unsafe { w.bits(DIV_PASS + RESET_DIVIDER) });
}

/// Vectors of an ARMv6-M core with its 32 interrupts.
const VECTORS: usize = 16 + 32;

/// The vector table, aligned as the core wants it: a power of two that is not below its length.
#[repr(align(256))]
struct Vectors([usize; VECTORS]);

#[unsafe(link_section = ".data.vectors")]
static mut RAM_VECTORS: Vectors = Vectors([0; VECTORS]);

unsafe extern "C" {
    static __vector_table: [usize; VECTORS];
}

/// Lets exceptions be entered without a look into the flash. Once, with interrupts off.
pub fn move_vectors(scb: &mut SCB) {
    // SAFETY: nothing else touches the table, and it is complete before the core looks at it. The addresses are those of the core.
    unsafe {
        let table = &raw mut RAM_VECTORS;
        (&raw mut (*table).0).write_volatile(__vector_table);
        cortex_m::asm::dsb();
        scb.vtor.write(table.expose_provenance() as u32);
    }
}

unsafe extern "C" {
    static _stack_end: u32;
}

/// 16 MiB below the stack, as a power of two: what lies between the flash's registers and RAM.
const GUARD_LOG2: u32 = 24;
/// Bits of the core's memory protection (ARMv6-M, B3.5): the address is that of region 0; nothing may be executed there; the region is
/// on; and elsewhere all is as without. Neither reads nor writes are allowed where nothing says so.
const REGION_0: u32 = 1 << 4;
const NEVER_EXECUTE: u32 = 1 << 28;
const ENABLE: u32 = 1;
const DEFAULT_ELSEWHERE: u32 = 1 << 2;

/// Makes a stack that has grown out of RAM fault: what the bus makes of the addresses below, the datasheet does not say.
pub fn guard_stack(mpu: &mut MPU) {
    // SAFETY: only forbids what no code does.
    unsafe {
        mpu.rbar.write((&raw const _stack_end as u32 - (1 << GUARD_LOG2)) | REGION_0);
        mpu.rasr.write(NEVER_EXECUTE | (GUARD_LOG2 - 1) << 1 | ENABLE);
        mpu.ctrl.write(DEFAULT_ELSEWHERE | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
