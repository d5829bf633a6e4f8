//! What drives an actuator: commands, when they take effect, and how to get from one to the next.

/// Commands and the moments at which they take effect.
#[derive(Clone, Copy, Debug)]
pub struct CommandSignal<'a> {
    /// When each command takes effect, seconds, increasing. The first is where the clock of the rows starts too.
    pub time_s: &'a [f64],
    /// The commands, 0..1; each holds until the next, the last one for ever.
    pub command: &'a [f64],
}

/// How a command gets from one of a drive to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// It holds.
    ZeroOrderHold,
    /// On a straight line.
    FirstOrderHold,
}
