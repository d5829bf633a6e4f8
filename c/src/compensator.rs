//! The compensator of one motor, in memory of the caller's.

use rotorlead::compensator::Compensator as Inner;

use crate::pointer::{out, shared};
use crate::{Command, Status};

/// Words of a compensator.
pub const COMPENSATOR_WORDS: usize = 92;

/// The compensator of one motor. It holds its design and its state, and no pointer: it may be copied, and one design serves as
/// many motors as there are copies. It is for the functions of this header alone. Zeroed, it is one without a design.
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

    /// The compensator in the caller's memory.
    ///
    /// # Safety
    /// As of [`out`], and the caller has not written to it.
    unsafe fn inner<'a>(this: *mut Self) -> Result<&'a mut Inner, Status> {
        // SAFETY: as of this function. Any bits are a word.
        if unsafe { *shared(this.cast::<u32>())? } != SEAL {
            return Err(Status::NotDesigned);
        }
        // SAFETY: the seal is written together with the rest, and no function of this crate writes one without the other.
        Ok(&mut unsafe { out(this.cast::<Sealed>())?.assume_init_mut() }.inner)
    }
}

/// One control tick: takes the command of the mixer and gives that for the ESC, within the limits of the design. Call it once per
/// tick, at the rate of the design.
///
/// Where it fails the output is 0. With a command that is infinite or NaN it goes on as with 0.
///
/// # Safety
/// `compensator` is NULL, or points to one that no one else uses meanwhile, which a function of this header or nobody has
/// written. `output` is NULL or points to a float.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_step_float(compensator: *mut Compensator, command: f32, output: *mut f32) -> Status {
    // SAFETY: as of this function.
    let (inner, output) = match unsafe { (Compensator::inner(compensator), out(output)) } {
        (_, Err(status)) => return status,
        (Err(status), Ok(output)) => {
            output.write(0.0);
            return status;
        }
        (Ok(inner), Ok(output)) => (inner, output),
    };
    let finite = Command::from_finite(command).ok_or(Status::CommandNotFinite);
    output.write(inner.update(finite.unwrap_or(Command::ZERO).into()).to_f32());
    finite.map(drop).into()
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
    // SAFETY: as of this function.
    let (inner, output) = match unsafe { (Compensator::inner(compensator), out(output)) } {
        (_, Err(status)) => return status,
        (Err(status), Ok(output)) => {
            output.write(Command { q29: 0 });
            return status;
        }
        (Ok(inner), Ok(output)) => (inner, output),
    };
    #[cfg(feature = "planted-panic")]
    core::hint::black_box([command.q29][core::hint::black_box(usize::from(command.q29 > 1 << 28))]);
    output.write(inner.update(command.into()).into());
    Status::Ok
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

/// Switches the filter into the path of the command (`true`, as it begins) or leaves it out (`false`), from the next tick on and
/// without a jump of the output.
///
/// # Safety
/// As of `rotorlead_step_float`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_set_enabled(compensator: *mut Compensator, enabled: bool) -> Status {
    // SAFETY: as of this function.
    unsafe { Compensator::inner(compensator) }.map(|inner| inner.set_enabled(enabled)).into()
}
