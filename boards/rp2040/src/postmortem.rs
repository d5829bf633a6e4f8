//! What happens when the firmware cannot go on: the outputs go low at the pin, the reason is stored where a reset does not
//! reach it, and the controller restarts.
//!
//! [`Record`] says what is stored, in RAM that start-up does not clear. There, too, lies what a flight needs to go on:
//! [`ResumeMemory`].

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::exception;
use rotorlead::controller::{Record, ResumeMemory, ResumeSource};
use rotorlead::link::ResetReason;
use rp2040_hal::pac::{RESETS, VREG_AND_CHIP_RESET, WATCHDOG};

use crate::pins::Pins;

#[unsafe(link_section = ".uninit.postmortem")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// Why we are here. To be called once, before anything leaves its reset, with interrupts off; forgets the record.
///
/// The watchdog's register says why it reset the chip last, up to a power-on or a pulse at RUN: behind a reset of the core alone, as
/// debuggers make, of another time. So a cause counts only with the reset that it has made.
pub fn take(watchdog: &WATCHDOG, chip: &VREG_AND_CHIP_RESET, resets: &RESETS) -> ResetReason {
    let place = addr_of_mut!(RECORD);
    // SAFETY: interrupts are off, so nothing else has it; any bits are a `Record`, and after a loss of power they are
    // arbitrary but readable.
    let record = unsafe { place.cast::<Record>().read_volatile() };
    // SAFETY: as above.
    unsafe { place.cast::<u32>().write_volatile(0) };
    let was_running = crate::watchdog::take_was_running(watchdog);
    let by_watchdog = watchdog.reason().read();
    let from = chip.chip_reset().read();
    // The PWM, like most, leaves its reset by this firmware alone.
    let is_of_core_alone = !resets.reset().read().pwm().bit();
    if by_watchdog.bits() == 0 && !is_of_core_alone {
        // What memory says is of another time, too. A fall of the supply that was too short for the chip to lose its power looks like
        // a power-on.
        return if from.had_run().bit() { ResetReason::Pin } else { ResetReason::PowerOn };
    }
    if let Some(reason) = record.reason() {
        return reason;
    }
    let is_bite = by_watchdog.timer().bit() && was_running && !is_of_core_alone && !from.had_psm_restart().bit();
    if is_bite { ResetReason::Watchdog } else { ResetReason::Software }
}

#[unsafe(link_section = ".uninit.resume")]
static RESUME: MaybeUninit<ResumeMemory> = MaybeUninit::uninit();

/// What a flight needs to go on, and whether somebody debugs this core.
pub fn resume_source() -> ResumeSource {
    let mut place = RESUME.as_ptr();
    // SAFETY: there is no instruction. For the compiler there may be one that has written the memory: it may not take for granted
    // that nothing stands there yet.
    unsafe { core::arch::asm!("/* {place} */", place = inout(reg) place, options(nostack, preserves_flags)) };
    // SAFETY: aligned, never moved, written through its atomics alone, and any bits are one.
    let memory = unsafe { &*place };
    ResumeSource { memory, is_debugged }
}

/// Whether a debugger is attached. The core's register that says so cannot be read by its own software on a Cortex-M0+, so a
/// breakpoint is executed: without a debugger it is a fault, which the handler below steps over. With one the core halts here, outputs
/// off, and where the debugger lets it go on no fault has come.
fn is_debugged() -> bool {
    let is_debugged: u32;
    // SAFETY: the handler of faults, or the debugger, goes on behind the breakpoint, and changes no register and no memory but the
    // word that says so. Called at the start, with interrupts off.
    unsafe {
        core::arch::asm!(
            "str {armed}, [{place}]",
            "bkpt #{code}",
            "ldr {armed}, [{place}]",
            code = const PROBE_CODE,
            place = in(reg) PROBE.as_ptr(),
            armed = inout(reg) PROBE_ARMED => is_debugged,
            options(nostack, preserves_flags),
        );
    }
    PROBE.store(0, Ordering::Relaxed);
    is_debugged != 0
}

/// [`PROBE_ARMED`] while the breakpoint is executed that a debugger would stop at; the handler of faults clears it.
static PROBE: AtomicU32 = AtomicU32::new(0);
const PROBE_ARMED: u32 = 0x9B0B_E5A7;
/// Tells this breakpoint from others for who looks at it: an emulator.
const PROBE_CODE: u32 = 0xdb;

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
    "ldr r0, ={probe}",
    "ldr r1, [r0]",
    "ldr r2, ={armed}",
    "cmp r1, r2",
    "bne 1f",
    // The breakpoint that `is_debugged` has executed: on behind its two bytes. The stack is whole.
    "movs r1, #0",
    "str r1, [r0]",
    "ldr r1, [sp, #24]",
    "adds r1, #2",
    "str r1, [sp, #24]",
    "bx lr",
    "1:",
    "mrs r0, MSP",
    "ldr r1, =_stack_start",
    "msr MSP, r1",
    "ldr r1, ={entry}",
    "bx r1",
    ".ltorg",
    ".size HardFault, . - HardFault",
    entry = sym hard_fault,
    probe = sym PROBE,
    armed = const PROBE_ARMED,
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
