//! When a frame of the outputs begins.

use super::plan::Frames;

/// What the inputs have for the frames in a control tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputPulse {
    /// No input is live: there is nothing to wait for.
    None,
    /// Pulses come, and no new one has.
    Awaited,
    /// A new pulse at the first live input.
    New,
}

/// What to do with the frame that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameAction {
    /// Its end stays as it is set.
    None,
    /// It ends now: the next pulses begin.
    Restart,
    /// It ends when the counter has come to so many counts.
    EndAt(u32),
}

/// How the frame that runs ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// At its shortest, and so do those after it: no input is live.
    Free,
    /// With a pulse of the input, or at its longest.
    Waiting,
    /// At its shortest: a pulse has come. The count was this in the last tick.
    Ending(u32),
}

/// Lets the frames of the outputs begin with the input's pulses, so that a new command does not wait for a frame that
/// runs by itself, and the phase between the two does not drift.
///
/// While pulses come a frame ends when one has come and it has lasted for [`Frames::shortest`], or after [`Frames::longest`]
/// in any case. Without a live input frames come at `output.frame_hz`. So they never come faster than that, and a pulse is
/// never cut.
#[derive(Clone, Copy, Debug)]
pub struct FramePacer {
    shortest: u32,
    longest: u32,
    /// From this count on a frame is left to end by itself.
    latest_restart: u32,
    state: State,
}

impl FramePacer {
    /// For these frames, of which the first lasts for the longest.
    #[must_use]
    pub const fn new(frames: &Frames) -> Self {
        let Frames { shortest, longest, restart_margin, .. } = *frames;
        Self { shortest, longest, latest_restart: longest.saturating_sub(restart_margin), state: State::Waiting }
    }

    /// One control tick: what the inputs have, and where the counter is in its frame.
    #[inline]
    pub fn tick(&mut self, pulse: InputPulse, count: u32) -> FrameAction {
        let (state, action) = match (pulse, self.state) {
            (InputPulse::None, State::Free) => return FrameAction::None,
            (InputPulse::None, _) => (State::Free, FrameAction::EndAt(self.shortest)),
            // Still the frame of the pulse before: it goes on to its end.
            (_, State::Ending(last)) if count >= last => (State::Ending(count), FrameAction::None),
            (InputPulse::Awaited, State::Waiting) => return FrameAction::None,
            (InputPulse::Awaited, _) => (State::Waiting, FrameAction::EndAt(self.longest)),
            (InputPulse::New, _) if count < self.shortest => (State::Ending(count), FrameAction::EndAt(self.shortest)),
            (InputPulse::New, State::Waiting) if count < self.latest_restart => (State::Waiting, FrameAction::Restart),
            // It ends by itself before long, and might do so just before it is restarted.
            (InputPulse::New, _) => return FrameAction::None,
        };
        self.state = state;
        action
    }
}
