//! The compensator of one motor, in memory of the caller's.

use rotorlead::compensator::Compensator as Inner;

use crate::pointer::{out, shared};
use crate::{Command, Status, rotorlead_command_to_float};

/// Words of a compensator.
pub const COMPENSATOR_WORDS: usize = 102;

/// The compensator of one motor. It holds its design and its state, and no pointer: it may be copied, and one design serves as
/// many motors as there are copies. It is for the functions of this header alone. Zeroed, it is one without a design. Whatever else
/// writes to it, a step stays within it and gives 0 to 1.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Compensator {
    /// Nothing for the caller.
    pub words: [u32; COMPENSATOR_WORDS],
}

/// What a compensator's memory holds.
#[derive(Clone, Copy)]
#[repr(C)]
struct Sealed {
    /// [`SEAL`] where there is a design.
    seal: u32,
    inner: Inner,
}

/// "lead" in bytes: neither memory that is zeroed nor one that is all ones has it.
const SEAL: u32 = u32::from_le_bytes(*b"lead");

const _: () = assert!(size_of::<Sealed>() <= size_of::<Compensator>(), "COMPENSATOR_WORDS is too small");
const _: () = assert!(align_of::<Sealed>() <= align_of::<Compensator>(), "a compensator needs larger words");

impl Compensator {
    /// Puts a new compensator into the caller's memory.
    ///
    /// # Safety
    /// As of [`out`].
    pub(crate) unsafe fn write(to: *mut Self, inner: Inner) -> Result<(), Status> {
        // SAFETY: as of this function. What it holds is no larger and needs no more alignment.
        unsafe { out(to.cast::<Sealed>()) }?.write(Sealed { seal: SEAL, inner });
        Ok(())
    }

    /// The compensator in the caller's memory, which may have been written to by others.
    ///
    /// # Safety
    /// As of [`out`].
    unsafe fn inner<'a>(this: *mut Self) -> Result<&'a mut Inner, Status> {
        // SAFETY: as of this function. Any bits are a word.
        if unsafe { *shared(this.cast::<u32>())? } != SEAL {
            return Err(Status::NotDesigned);
        }
        // SAFETY: as of this function. The pointer is not NULL: it led to the seal.
        let inner = unsafe { &raw mut (*this.cast::<Sealed>()).inner };
        // SAFETY: as of this function. Any bits are a byte.
        if !Inner::is_held_by(|offset| unsafe { *inner.cast::<u8>().add(offset) }) {
            return Err(Status::NotDesigned);
        }
        // SAFETY: as of this function, and its memory holds one.
        Ok(unsafe { &mut *inner })
    }

    /// One tick.
    ///
    /// # Safety
    /// As of [`out`].
    unsafe fn step(this: *mut Self, command: Command) -> Result<Command, Status> {
        // SAFETY: as of this function.
        let output = Command::from(unsafe { Self::inner(this) }?.update(command.into()));
        // Limits that others have written may be any.
        if (0..=Command::ONE.q29).contains(&output.q29) { Ok(output) } else { Err(Status::NotDesigned) }
    }
}

/// One control tick: takes the command of the mixer and gives that for the ESC, within the limits of the design. Call it once per
/// tick, at the rate of the design.
///
/// Where it fails the output is 0. With a command that is infinite or NaN it goes on as with 0.
///
/// # Safety
/// `compensator` is NULL, or points to one that no one else uses meanwhile. `output` is NULL or points to a float.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_step_float(compensator: *mut Compensator, command: f32, output: *mut f32) -> Status {
    // SAFETY: as of this function.
    let output = match unsafe { out(output) } {
        Ok(output) => output,
        Err(status) => return status,
    };
    let finite = Command::from_finite(command).ok_or(Status::CommandNotFinite);
    // SAFETY: as of this function.
    let stepped = unsafe { Compensator::step(compensator, finite.unwrap_or(Command::ZERO)) };
    output.write(rotorlead_command_to_float(stepped.unwrap_or(Command::ZERO)));
    stepped.and(finite).map(drop).into()
}

/// The same with commands as they are in the filter, which saves the conversions.
///
/// # Safety
/// As of `rotorlead_step_float`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_step(
    compensator: *mut Compensator,
    command: Command,
    output: *mut Command,
) -> Status {
    #[cfg(feature = "planted-panic")]
    core::hint::black_box([command.q29][core::hint::black_box(usize::from(command.q29 > 1 << 28))]);
    // SAFETY: as of this function.
    let output = match unsafe { out(output) } {
        Ok(output) => output,
        Err(status) => return status,
    };
    // SAFETY: as of this function.
    let stepped = unsafe { Compensator::step(compensator, command) };
    output.write(stepped.unwrap_or(Command::ZERO));
    stepped.map(drop).into()
}

/// Puts the compensator at rest at a command: as long as that is the command, it is the output. For the tick before the motor
/// starts. The output may jump.
///
/// # Safety
/// As of `rotorlead_step_float`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_reset(compensator: *mut Compensator, level: Command) -> Status {
    // SAFETY: as of this function.
    unsafe { Compensator::inner(compensator) }.map(|inner| inner.reset(level.into())).into()
}

/// Puts the filter at rest at a command while the motor runs, as after an outage of the commands. The output does not jump: it
/// goes there with the time constant of the filter.
///
/// # Safety
/// As of `rotorlead_step_float`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_restart(compensator: *mut Compensator, level: Command) -> Status {
    // SAFETY: as of this function.
    unsafe { Compensator::inner(compensator) }.map(|inner| inner.restart(level.into())).into()
}

/// Switches the filter into the path of the command (any number but 0, as it begins) or leaves it out (0), from the next tick on and
/// without a jump of the output.
///
/// # Safety
/// As of `rotorlead_step_float`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_set_enabled(compensator: *mut Compensator, enabled: i32) -> Status {
    // SAFETY: as of this function.
    unsafe { Compensator::inner(compensator) }.map(|inner| inner.set_enabled(enabled != 0)).into()
}
