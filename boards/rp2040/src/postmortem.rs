//! What happens when the firmware cannot go on: the outputs go low at the pin, the reason is stored where a reset does not
//! reach it, and the controller restarts.
//!
//! [`Record`] says what is stored, in RAM that start-up does not clear.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m_rt::exception;
use rotorlead::controller::Record;
use rotorlead::link::ResetReason;
use rp2040_hal::pac::{VREG_AND_CHIP_RESET, WATCHDOG};

use crate::pins::Pins;

#[unsafe(link_section = ".uninit.postmortem")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// Why we are here. To be called once, first thing, with interrupts off; forgets the record.
pub fn take(watchdog: &WATCHDOG, chip: &VREG_AND_CHIP_RESET) -> ResetReason {
    let place = addr_of_mut!(RECORD);
    // SAFETY: interrupts are off, so nothing else has it; any bits are a `Record`, and after a loss of power they are
    // arbitrary but readable.
    let record = unsafe { place.cast::<Record>().read_volatile() };
    // SAFETY: as above.
    unsafe { place.cast::<u32>().write_volatile(0) };
    if let Some(reason) = record.reason() {
        return reason;
    }
    // The watchdog's reason stays until the chip is reset as a whole.
    let bitten = watchdog.reason().read();
    let from = chip.chip_reset().read();
    if bitten.timer().bit() {
        ResetReason::Watchdog
    } else if bitten.force().bit() {
        ResetReason::Software
    } else if from.had_run().bit() {
        ResetReason::Pin
    } else if from.had_por().bit() {
        // A fall of the supply that was too short for the chip to lose its power looks the same.
        ResetReason::PowerOn
    } else {
        ResetReason::Software
    }
}

/// Outputs low first of all; then the record, and a reset.
fn end(record: Record) -> ! {
    cortex_m::interrupt::disable();
    crate::outputs::connect_low(&Pins::steal());
    // SAFETY: interrupts are off and this does not return, so nothing else has it.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(record) };
    crate::watchdog::reset()
}

#[panic_handler]
#[inline(never)]
fn panic(info: &PanicInfo<'_>) -> ! {
    let (line, file) = info.location().map_or((0, ""), |location| (location.line(), location.file()));
    end(Record::panic(line, file))
}

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end(Record::stray_interrupt(number))
}

// A stack that ran over is no place to push anything: the handler starts on a fresh one, with the old pointer in r0.
core::arch::global_asm!(
    ".syntax unified",
    ".section .text.HardFault, \"ax\", %progbits",
    ".global HardFault",
    ".type HardFault, %function",
    ".thumb_func",
    "HardFault:",
    "mrs r0, MSP",
    "ldr r1, =_stack_start",
    "msr MSP, r1",
    "ldr r1, ={entry}",
    "bx r1",
    ".size HardFault, . - HardFault",
    entry = sym hard_fault,
);

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Words that the core pushes on an exception, of which the seventh is the program counter.
const FRAME_WORDS: usize = 8;
const PROGRAM_COUNTER: usize = 6;

unsafe extern "C" fn hard_fault(stack_pointer: *const u32) -> ! {
    let address = stack_pointer as usize;
    let low = &raw const _stack_end as usize;
    let high = &raw const _stack_start as usize;
    let readable = address >= low && address <= high - 4 * FRAME_WORDS && address.is_multiple_of(4);
    // SAFETY: the frame lies within the stack.
    let program_counter = if readable { unsafe { stack_pointer.add(PROGRAM_COUNTER).read_volatile() } } else { 0 };
    // This core does not say what the fault was.
    end(Record::fault(program_counter, 0))
}
