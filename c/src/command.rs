//! Commands as C has them.

/// A command: 0 is the bottom of the pulse range and 1 its top. A structure, so that no number is taken for one in silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Command {
    /// In steps of 2^-29: 0 to 536870912. Beyond these the nearer end is meant.
    pub q29: i32,
}

impl From<Command> for rotorlead::throttle::Command {
    fn from(command: Command) -> Self {
        Self::saturating_from_bits(command.q29)
    }
}

impl From<rotorlead::throttle::Command> for Command {
    fn from(command: rotorlead::throttle::Command) -> Self {
        Self { q29: command.to_bits() }
    }
}

impl Command {
    pub(crate) const ZERO: Self = Self { q29: 0 };
    pub(crate) const ONE: Self = Self { q29: rotorlead::throttle::Command::ONE.to_bits() };

    /// The command nearest to a number, where that is one: a division by 0 asks for no full throttle.
    pub(crate) fn from_finite(value: f32) -> Option<Self> {
        value.is_finite().then(|| rotorlead::throttle::Command::saturating_from_f32(value).into())
    }
}

/// The command nearest to a number, 0 to 1. Beyond these it is the nearer end, and 0 for an infinity and NaN.
#[unsafe(no_mangle)]
pub extern "C" fn rotorlead_command_from_float(value: f32) -> Command {
    Command::from_finite(value).unwrap_or(Command::ZERO)
}

/// The number nearest to a command, 0 to 1.
#[unsafe(no_mangle)]
pub extern "C" fn rotorlead_command_to_float(command: Command) -> f32 {
    rotorlead::throttle::Command::from(command).to_f32()
}
