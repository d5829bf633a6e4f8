//! What every link between the command and the rotor has in common.

/// A level that holds until a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The level, as a command 0..1.
    pub level: f64,
    /// Up to when it holds, seconds.
    pub until_s: f64,
}

/// One link between command and rotor. It takes a command that is constant in pieces and gives one.
///
/// The caller asks for one piece at a time: "the input is `input` from `from_s` to `until_s`; what is the output at
/// `from_s`, and how long does it stay so?" The next question starts where the answer ended, with the same input or
/// another. So changes fall where they belong, between the ticks of the control loop too, and stages chain without
/// buffers: the piece that one gives is the question to the next.
pub trait CommandStage {
    /// Puts the stage in the state it has when its input has been `level` for ever.
    fn settle(&mut self, level: f64);

    /// The output from `from_s` on, and until when it holds: later than `from_s`, not later than `until_s`.
    ///
    /// The input is `input` over the whole of `from_s..until_s`, seconds, with `from_s < until_s`. `from_s` is where
    /// the last answer ended.
    fn advance(&mut self, from_s: f64, until_s: f64, input: f64) -> Segment;
}
