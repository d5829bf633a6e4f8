//! From the flash to RAM.
//!
//! Instructions come from RAM, where none waits. The flash is read through a cache of 16 KiB; what that has not costs some 400 ns, 50
//! cycles, for each eight bytes, and a control task cannot bound how often. So the reset copies the whole image with the initialized
//! data (board.x), from a flash that is not needed any more until settings are read.

use cortex_m::peripheral::SCB;
use rp2040_hal::pac::ROSC;

/// What the boot ROM runs first: it lets the flash be read four bits at a time.
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

// Before the copy, and so in the flash: lets the ring oscillator, which is the clock until the crystal runs, drive the core at 14 to
// 96 MHz instead of 1.8 to 12 MHz. The copy takes some 40 ms then, and 350 ms otherwise.
core::arch::global_asm!(
    ".syntax unified",
    ".section .Reset, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, ={divider}",
    "ldr r1, ={value}",
    "str r1, [r0]",
    "bx lr",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
    divider = const ROSC_DIV,
    value = const DIV_PASS + COPY_DIVIDER,
);

/// The register of the ring oscillator's divider, and what makes a value valid (RP2040 datasheet, 2.17.8).
const ROSC_DIV: u32 = 0x4006_0010;
const DIV_PASS: u32 = 0xaa0;
/// The divider while the image is copied, and after a reset: 1.8 to 12 MHz (2.17.4).
const COPY_DIVIDER: u32 = 2;
const RESET_DIVIDER: u32 = 16;

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
