//! When a frame of the outputs begins.

use super::plan::Frames;

/// What to do with the frame that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameAction {
    /// It ends by itself.
    None,
    /// It ends now: the next pulses begin.
    Restart,
    /// It ends when the counter has come to so many counts.
    EndAt(u32),
}

/// Where the pacer stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// The frame waits for a pulse of the input.
    Waiting,
    /// A pulse came, and the frame is not long enough yet.
    Due,
    /// Its end is set, and the count was this in the last tick.
    Ending(u32),
}

/// Lets the frames of the outputs begin with the input's pulses, so that a new command does not wait for a frame that
/// runs by itself, and the phase between the two does not drift.
///
/// A frame ends when a pulse has come and it has lasted for [`Frames::shortest`], or after [`Frames::longest`] in any case.
/// So frames never come faster than `output.frame_hz`, and a pulse is never cut.
#[derive(Clone, Copy, Debug)]
pub struct FramePacer {
    shortest: u32,
    longest: u32,
    state: State,
}

impl FramePacer {
    /// For these frames.
    #[must_use]
    pub const fn new(frames: &Frames) -> Self {
        Self { shortest: frames.shortest, longest: frames.longest, state: State::Waiting }
    }

    /// One control tick: whether a new pulse came, and where the counter is in its frame.
    #[inline]
    pub fn tick(&mut self, has_new_pulse: bool, count: u32) -> FrameAction {
        if let State::Ending(last) = self.state {
            if count >= last {
                self.state = State::Ending(count);
                return FrameAction::None;
            }
            // It has ended. The new frame waits as long as it may, unless there is a newer pulse already.
            self.state = State::Waiting;
            if !has_new_pulse {
                return FrameAction::EndAt(self.longest);
            }
        }
        if has_new_pulse && self.state == State::Waiting {
            self.state = State::Due;
        }
        if self.state != State::Due {
            return FrameAction::None;
        }
        if count >= self.shortest {
            self.state = State::Waiting;
            FrameAction::Restart
        } else {
            self.state = State::Ending(count);
            FrameAction::EndAt(self.shortest)
        }
    }
}
