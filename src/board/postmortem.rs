//! What happens when the firmware cannot go on: the outputs go low at the pin, the reason is stored where a reset does not
//! reach it, and the controller restarts.
//!
//! [`Record`] says what is stored, in RAM that start-up does not clear. There, too, lies what a flight needs to go on:
//! [`ResumeMemory`].

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::{DCB, SCB};
use cortex_m_rt::exception;
use rotorlead::controller::{Record, ResumeMemory, ResumeSource};
use rotorlead::link::ResetReason;
use stm32f4xx_hal::pac::RCC;

#[unsafe(link_section = ".uninit.postmortem")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// Why we are here. To be called once, first thing, with interrupts off; forgets the record.
pub fn take(rcc: &RCC) -> ResetReason {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    let place = addr_of_mut!(RECORD);
    // SAFETY: interrupts are off, so nothing else has it; any bits are a `Record`, and after a loss of power they are
    // arbitrary but readable.
    let record = unsafe { place.cast::<Record>().read_volatile() };
    // SAFETY: as above.
    unsafe { place.cast::<u32>().write_volatile(0) };
    if let Some(reason) = record.reason() {
        return reason;
    }
    // The first start after power came sets both.
    if flags.porrstf().bit() {
        ResetReason::PowerOn
    } else if flags.borrstf().bit() {
        ResetReason::BrownOut
    } else if flags.wdgrstf().bit() || flags.wwdgrstf().bit() {
        ResetReason::Watchdog
    } else if flags.sftrstf().bit() {
        ResetReason::Software
    } else {
        ResetReason::Pin
    }
}

#[unsafe(link_section = ".uninit.resume")]
static RESUME: MaybeUninit<ResumeMemory> = MaybeUninit::uninit();

/// What a flight needs to go on, and whether somebody debugs this core: the bit stays over every reset but that of power
/// (ARMv7-M, C1.6.2).
pub fn resume_source() -> ResumeSource {
    let mut place = RESUME.as_ptr();
    // SAFETY: there is no instruction. For the compiler there may be one that has written the memory: it may not take for
    // granted that nothing stands there yet.
    unsafe { core::arch::asm!("/* {place} */", place = inout(reg) place, options(nostack, preserves_flags)) };
    // SAFETY: aligned, never moved, written through its atomics alone, and any bits are one.
    let memory = unsafe { &*place };
    ResumeSource { memory, is_debugged: DCB::is_debugger_attached }
}

/// Outputs low first of all; then the record, and a reset.
fn end(record: Record) -> ! {
    cortex_m::interrupt::disable();
    super::outputs_low();
    // SAFETY: interrupts are off and this does not return, so nothing else has it.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(record) };
    SCB::sys_reset()
}

/// The supply has fallen below the threshold of the voltage detector.
pub fn supply_low() -> ! {
    end(Record::supply_low())
}

#[panic_handler]
#[inline(never)]
fn panic(info: &PanicInfo<'_>) -> ! {
    let (line, file) = info.location().map_or((0, ""), |location| (location.line(), location.file()));
    end(Record::panic(line, file))
}

// The crystal died: RCC has gone over to the internal oscillator by itself.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    end(Record::crystal_lost())
}

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end(Record::stray_interrupt(number))
}

// A stack that ran over is no place to push anything: the handler starts on a fresh one, with the old pointer in r0.
core::arch::global_asm!(
    ".syntax unified",
    ".section .HardFault.user, \"ax\", %progbits",
    ".global HardFault",
    ".type HardFault, %function",
    ".thumb_func",
    "HardFault:",
    "mrs r0, MSP",
    "ldr r1, =_stack_start",
    "msr MSP, r1",
    "b {entry}",
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
    // SAFETY: a read without side effects of a register that always exists.
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    end(Record::fault(program_counter, status))
}
