//! One motor's DShot input: from words to what the control tick reads, and to the frames that are to go on.

use super::{Content, Directions, Frame, Relay, Value};
use crate::capture::{InputReading, PULSES_TO_LIVE};
use crate::throttle::EscCommand;

/// What came on a line between two gaps: its bits, the first the highest, behind a one that says how many there are.
///
/// A line with frames of another speed, or with pulses, has gaps elsewhere, so its words have other lengths. That matters:
/// frames of half the speed, read bit by bit, would be ones throughout, which is a frame of full throttle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word(u32);

impl Word {
    /// From the bits behind a one.
    #[must_use]
    pub const fn new(behind_one: u32) -> Self {
        Self(behind_one)
    }

    /// The 16 bits of a frame, where there are just so many.
    const fn frame_bits(self) -> Option<u16> {
        if self.0 >> 16 == 1 { Some(self.0 as u16) } else { None }
    }
}

impl From<Frame> for Word {
    fn from(frame: Frame) -> Self {
        Self(1 << 16 | frame.to_bits() as u32)
    }
}

/// Whether the last frame is to be believed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Liveness {
    Never,
    Live,
    Lost,
}

/// Calls of [`Receiver::read`] over which frames are counted: a fifth of a second at 5 kHz.
pub const COUNTED_POLLS: u16 = 1024;

/// Frames in so many polls.
#[derive(Clone, Copy)]
struct FrameCount {
    polls: u16,
    frames: u16,
    /// In the last whole window.
    last: u16,
}

impl FrameCount {
    const fn poll(&mut self) {
        self.polls += 1;
        if self.polls >= COUNTED_POLLS {
            *self = Self { polls: 0, frames: 0, last: self.frames };
        }
    }
}

/// Takes the words of one line in, once per control tick, and lets frames out. See [`Relay`] for which.
///
/// A line is live from [`PULSES_TO_LIVE`] valid frames in a row on, and lost when none has come for the timeout. An instruction
/// reads as a stop, since an ESC that follows one gives no throttle.
pub struct Receiver {
    relay: Relay,
    liveness: Liveness,
    timeout_polls: u32,
    /// Polls since the last valid frame, and since the last word of any kind, up to the timeout.
    silent_polls: u32,
    idle_polls: u32,
    /// Valid frames in a row while the line is not live.
    in_row: u8,
    rate: FrameCount,
    /// Of the last valid frame that was not read yet.
    newest: Option<Content>,
    /// Words of another length than a frame's.
    bad_lengths: u32,
    /// Times that words were lost.
    lost_words: u32,
    losses: u32,
}

impl Receiver {
    /// For a line whose last frame is good for so many calls of [`Self::read`].
    #[must_use]
    pub const fn new(relay: Relay, timeout_polls: u32) -> Self {
        Self {
            relay,
            liveness: Liveness::Never,
            timeout_polls,
            silent_polls: timeout_polls,
            idle_polls: timeout_polls,
            in_row: 0,
            rate: FrameCount { polls: 0, frames: 0, last: 0 },
            newest: None,
            bad_lengths: 0,
            lost_words: 0,
            losses: 0,
        }
    }

    /// A word has come. `compensates`: whether some motor does ([`Relay::receive`]).
    pub fn receive(&mut self, word: Word, compensates: bool) {
        self.idle_polls = 0;
        let Some(bits) = word.frame_bits() else {
            self.bad_lengths = self.bad_lengths.wrapping_add(1);
            self.in_row = 0;
            return;
        };
        let Some(content) = self.relay.receive(bits, compensates) else {
            self.in_row = 0;
            return;
        };
        self.silent_polls = 0;
        self.rate.frames = self.rate.frames.saturating_add(1);
        self.newest = Some(content);
        self.in_row = self.in_row.saturating_add(1);
        if self.in_row >= PULSES_TO_LIVE {
            self.liveness = Liveness::Live;
        }
    }

    /// Words were lost before they could be received.
    pub const fn lose_words(&mut self) {
        self.idle_polls = 0;
        self.in_row = 0;
        self.lost_words = self.lost_words.wrapping_add(1);
    }

    /// Once per control tick, after its words: what has become of the input. A pulse's width is the value of a throttle, and for
    /// a stop the one below ([`super::BELOW_THROTTLE`]), as [`Form::Frames`](crate::protocol::Form::Frames) has it.
    pub fn read(&mut self) -> InputReading {
        let newest = self.newest.take();
        self.rate.poll();
        if self.silent_polls >= self.timeout_polls {
            self.lose();
        }
        let is_idle = self.idle_polls >= self.timeout_polls;
        self.silent_polls = self.silent_polls.saturating_add(1);
        self.idle_polls = self.idle_polls.saturating_add(1);
        match self.liveness {
            Liveness::Live => newest.map_or(InputReading::UNCHANGED, |content| InputReading::pulse(width(content))),
            _ if !is_idle => InputReading::UNREADABLE,
            Liveness::Never => InputReading::NOTHING,
            Liveness::Lost => InputReading::LOST,
        }
    }

    /// What was asked of the ESC.
    #[must_use]
    pub const fn directions(&self) -> Directions {
        self.relay.directions()
    }

    /// The next frame that is to go out ([`Relay::next`]).
    pub fn next(&mut self, newest: EscCommand) -> Option<Frame> {
        self.relay.next(newest)
    }

    /// Valid frames in a second, where [`Self::read`] is called so often: those of the last `COUNTED_POLLS` calls.
    #[must_use]
    pub const fn frame_hz(&self, polls_hz: u32) -> u32 {
        // Of 65535 frames at most, and rates up to 10 kHz.
        (self.rate.last as u64 * polls_hz as u64 / COUNTED_POLLS as u64) as u32
    }

    /// Whether valid frames come.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.liveness == Liveness::Live
    }

    /// Words that are no frames, for their length or for their checksum, wrapping.
    #[must_use]
    pub const fn bad_frames(&self) -> u32 {
        self.bad_lengths.wrapping_add(self.relay.counts().bad_checksums)
    }

    /// Instructions that may not pass, and throttles whose direction the ESC was not told, wrapping.
    #[must_use]
    pub const fn refused_frames(&self) -> u32 {
        self.relay.counts().refused
    }

    /// Instructions that found no room, and calls of [`Self::lose_words`], wrapping.
    #[must_use]
    pub const fn dropped_frames(&self) -> u32 {
        self.lost_words.wrapping_add(self.relay.counts().dropped)
    }

    /// Times that the line was lost, wrapping.
    #[must_use]
    pub const fn losses(&self) -> u32 {
        self.losses
    }

    fn lose(&mut self) {
        self.in_row = 0;
        self.relay.clear();
        if self.liveness == Liveness::Live {
            self.liveness = Liveness::Lost;
            self.losses = self.losses.wrapping_add(1);
        }
    }
}

/// As the width of a pulse.
const fn width(content: Content) -> u32 {
    match content {
        Content::Instruction(_) => super::BELOW_THROTTLE as u32,
        Content::Throttle(command) => Value::from_command(command).get() as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Checksum;
    use super::*;
    use crate::throttle::Command;

    const TIMEOUT: u32 = 10;

    fn receiver() -> Receiver {
        Receiver::new(Relay::new(Checksum::Normal, Some(Checksum::Normal), Directions::default()), TIMEOUT)
    }

    fn word(value: u16) -> Word {
        Frame::new(Value::new(value).unwrap(), false, Checksum::Normal).into()
    }

    fn live() -> Receiver {
        let mut receiver = receiver();
        for _ in 0..PULSES_TO_LIVE {
            receiver.receive(word(0), false);
            let _ = receiver.read();
        }
        receiver
    }

    #[test]
    fn a_line_is_live_after_good_frames_in_a_row_and_lost_without_any() {
        let mut receiver = receiver();
        assert_eq!(receiver.read(), InputReading::NOTHING);
        for _ in 1..PULSES_TO_LIVE {
            receiver.receive(word(1000), false);
            assert_eq!(receiver.read(), InputReading::UNREADABLE, "driven, and not live");
        }
        receiver.receive(word(1000), false);
        assert_eq!(receiver.read(), InputReading::pulse(1000));
        for _ in 1..TIMEOUT {
            assert_eq!(receiver.read(), InputReading::UNCHANGED);
        }
        assert_eq!(receiver.read(), InputReading::LOST);
        assert_eq!(receiver.losses(), 1);
        receiver.receive(word(1000), false);
        assert_eq!(receiver.read(), InputReading::UNREADABLE, "one frame is no flight controller");
    }

    #[test]
    fn damaged_words_are_counted_make_nothing_go_out_and_do_not_keep_a_line_alive() {
        let mut receiver = live();
        while receiver.next(EscCommand::from(Command::ZERO)).is_some() {}
        let good = word(1000);
        let mut bad = 0;
        for poll in 0..TIMEOUT {
            // A bit short, a bit long, and a bit wrong.
            for damaged in [good.0 >> 1, good.0 << 1, good.0 ^ 4] {
                receiver.receive(Word::new(damaged), false);
                bad += 1;
                assert_eq!(receiver.next(EscCommand::from(Command::ONE)), None);
            }
            assert_eq!(receiver.read() == InputReading::UNCHANGED, poll + 1 < TIMEOUT, "poll {poll}");
        }
        assert_eq!(receiver.read(), InputReading::UNREADABLE);
        assert_eq!((receiver.bad_frames(), receiver.losses()), (bad, 1));
    }

    #[test]
    fn stops_and_instructions_read_as_a_stop_and_the_newest_frame_counts() {
        let mut receiver = live();
        for (values, read) in [(&[0_u16][..], 47), (&[1000, 20], 47), (&[20, 48], 48), (&[0, 2047], 2047)] {
            values.iter().for_each(|value| receiver.receive(word(*value), false));
            assert_eq!(receiver.read(), InputReading::pulse(read), "{values:?}");
        }
    }

    #[test]
    fn what_waits_is_gone_with_the_line() {
        let mut receiver = live();
        receiver.receive(word(5), false);
        for _ in 0..=TIMEOUT {
            let _ = receiver.read();
        }
        assert_eq!(receiver.next(EscCommand::from(Command::ZERO)), None);
    }
}
