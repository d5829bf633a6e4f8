//! What a board must give: these traits. `docs/boards.md` says how one is added.
//!
//! Nothing here may block, and nothing but [`RequestHardware`] may take longer than some ten instructions: the control task
//! calls them.

use super::ClockReport;
use crate::capture::Listening;
use crate::dshot::{Frame, Line, Offer, ReplyWindow, Word};
use crate::link::{BrownOut, ResetReason};
use crate::settings::{MOTORS, Settings};

/// One edge of an input, as a timer stamped it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Count of the timer at the edge, wrapping.
    pub timestamp: u32,
    /// Level of the line after the edge, as the interrupt read it: where two edges come closer together than the
    /// interrupt's latency, both read the later level.
    pub is_high: bool,
    /// An edge before this one was stamped and overwritten.
    pub overcapture: bool,
}

/// The timer that stamps the edges of the inputs. It counts 32 bits, at [`ClockReport::timer_hz`].
pub trait CaptureTimer {
    /// Whether edges wait in a queue of bounded length for the control tick, in place of an interrupt for each: then no line can take
    /// more time than its queue holds, and none is switched off.
    const IS_QUEUED: bool = false;
    /// The count now.
    fn now(&self) -> u32;
    /// What has been captured since the last call, at most one edge of each input.
    fn take(&mut self) -> [Option<Edge>; MOTORS];
    /// Which edges of each input interrupt. What an input captured while it was off is dropped.
    fn listen(&mut self, inputs: [Listening; MOTORS]);
}

/// The outputs: pulses, and on a board that speaks DShot frames.
pub trait OutputHardware {
    /// Pulses from now on. Sets their timer: its divider, from 1, and the length of its frames, counts, from 2 to 2^16. All outputs
    /// are low until the next widths.
    fn set_frames(&mut self, divider: u32, counts: u32);
    /// Widths of the pulses from the next frame on, in counts; 0 is a line that stays low. A pulse that runs is not cut.
    fn set_widths(&mut self, counts: [u32; MOTORS]);
    /// Counts since the frame began.
    fn frame_count(&self) -> u32;
    /// Begins a frame, with the widths that were set last.
    fn restart_frame(&mut self);
    /// Lets this frame, and those after it, last for so many counts. Where it has lasted for longer already it ends now.
    fn end_frame_at(&mut self, counts: u32);

    /// Frames of DShot from now on: this and what follows is called only where [`BoardFacts::speaks_dshot`]. All outputs are low until
    /// the next frame; on a bidirectional line, pulled up, and the board drives them only for its frames.
    fn set_line(&mut self, _line: Line) {}
    /// Whether an output takes a frame now: the last one has begun.
    fn can_send(&self, _motor: usize) -> bool {
        false
    }
    /// Sends a frame, once the one before it is over.
    fn send(&mut self, _motor: usize, _frame: Frame) {}
    /// What a bidirectional output was behind its oldest frame for which that was not asked yet. A board holds 2 of each output.
    fn take_reply(&mut self, _motor: usize) -> Option<ReplyWindow> {
        None
    }
}

/// Inputs that may have frames of DShot. A board that does not speak it has [`NoInputFrames`].
pub trait InputFrameHardware {
    /// The inputs have frames of DShot, which come as words, or (`None`) pulses, whose edges come to the [`CaptureTimer`]. This and
    /// what follows is called with a line only where [`BoardFacts::speaks_dshot`].
    ///
    /// A bidirectional line is pulled up, and driven by the board only for a reply.
    fn set_line(&mut self, line: Option<Line>);
    /// The oldest word of an input that was not taken yet. A board holds 4 of each input, or more.
    fn take_word(&mut self, motor: usize) -> Option<Word>;
    /// Whether words of an input were lost since the last call, since it held too many.
    fn take_words_lost(&mut self, motor: usize) -> bool;
    /// A bidirectional input answers each frame with this from now on, 25 to 35 µs after the frame's end. It starts no reply
    /// where the line is low meanwhile, or where that was no frame of 16 bits.
    fn offer_reply(&mut self, motor: usize, offer: Offer);
    /// Whether the last offer has gone out.
    fn is_offer_taken(&self, motor: usize) -> bool;
}

/// Inputs that have nothing but pulses.
#[derive(Clone, Copy, Debug)]
pub struct NoInputFrames;

impl InputFrameHardware for NoInputFrames {
    fn set_line(&mut self, _: Option<Line>) {}
    fn take_word(&mut self, _: usize) -> Option<Word> {
        None
    }
    fn take_words_lost(&mut self, _: usize) -> bool {
        false
    }
    fn offer_reply(&mut self, _: usize, _: Offer) {}
    fn is_offer_taken(&self, _: usize) -> bool {
        false
    }
}

/// The timer that runs the control task.
pub trait TickTimer {
    /// Runs it at `rate_hz`, 1 or more, from the next tick on.
    fn set_rate(&mut self, rate_hz: u32);
    /// Starts the ticks.
    fn start(&mut self);
    /// Whether the next tick has become due while this one runs.
    fn is_due(&self) -> bool;
}

/// The converter of the thrust sensor.
pub trait ThrustConverter {
    /// Begins a conversion.
    fn start(&mut self);
    /// The result of the last conversion that has ended. Does not wait.
    fn read(&mut self) -> u16;
}

/// The watchdog.
pub trait Watchdog {
    /// Begins its time anew.
    fn feed(&mut self);
    /// Sets its time: some control ticks, or (`true`) the seconds that the erasing of flash takes.
    fn set_long_timeout(&mut self, patient: bool);
}

/// A board, by the types of what the control task drives.
pub trait ControlHardware {
    /// The outputs.
    type Outputs: OutputHardware;
    /// Frames at the inputs.
    type InputFrames: InputFrameHardware;
    /// The ticks.
    type Timer: TickTimer;
    /// The thrust sensor.
    type Thrust: ThrustConverter;
    /// The watchdog.
    type Watchdog: Watchdog;
}

/// What the control task of a board drives.
pub struct ControlParts<H: ControlHardware> {
    /// The outputs.
    pub outputs: H::Outputs,
    /// Frames at the inputs.
    pub input_frames: H::InputFrames,
    /// The ticks.
    pub timer: H::Timer,
    /// The thrust sensor.
    pub thrust: H::Thrust,
    /// The watchdog.
    pub watchdog: H::Watchdog,
}

/// What only the board knows, and does not change.
#[derive(Clone, Copy, Debug)]
pub struct BoardFacts {
    /// The clocks.
    pub clocks: ClockReport,
    /// Why it started.
    pub reset: ResetReason,
    /// The supply voltage at which the chip resets.
    pub brown_out: BrownOut,
    /// Whether its pins can have frames of DShot.
    pub speaks_dshot: bool,
    /// Whether it calls a boot loader where [`Server::is_leaving`](super::Server::is_leaving).
    pub has_boot_loader: bool,
}

impl BoardFacts {
    /// Whether the pins can do what settings ask for.
    #[must_use]
    pub const fn suits(&self, settings: &Settings) -> bool {
        let has_frames = settings.input.protocol.dshot().is_some() || settings.output.protocol.dshot().is_some();
        self.speaks_dshot || !has_frames
    }
}

/// What the answers to the host need, from the lowest priority.
pub trait RequestHardware {
    /// What only the board knows.
    fn facts(&self) -> BoardFacts;
    /// Whether somebody at the board has allowed excitation and injection, by a jumper that is fitted now.
    fn is_bench_enabled(&mut self) -> bool;
    /// Bytes of the link that were lost, wrapping.
    fn link_overruns(&self) -> u32;
    /// Waits until the watchdog has taken a new time over and was fed by it.
    fn wait_for_watchdog(&mut self);
}
