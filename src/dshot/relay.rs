//! From the frames of a flight controller to those of an ESC.
//!
//! The flight controller keeps the time: each valid frame makes one go out, and none goes out without one, since an ESC takes the
//! end of its frames for the end of the flight. The filter runs at a rate of its own; a frame of throttle carries its newest output.
//! Instructions that may pass do as they came, each of their repeats, since an ESC counts these; a stop goes out for the others. Where the motor's channel gives no pulse there
//! is no frame either.

use super::instructions::{Directions, Instructions};
use super::{Checksum, Content, Frame, Value};
use crate::throttle::EscCommand;

/// Frames that may wait for an output that is slower than the input: an instruction is repeated 6 to 10 times.
pub const QUEUED: usize = 16;

/// What came in, and what became of it, wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames with a right checksum.
    pub valid: u32,
    /// Frames with a wrong one.
    pub bad_checksums: u32,
    /// Instructions that found the queue full.
    pub dropped: u32,
    /// Instructions that may not pass, and throttles whose direction the ESC was not told.
    pub refused: u32,
}

/// A frame that is due.
#[derive(Clone, Copy)]
enum Due {
    /// As it came.
    Instruction(Frame),
    /// With the newest output, and the sender's wish for a report.
    Throttle { reports: bool },
}

/// One motor's frames, from one line to the other.
pub struct Relay {
    input: Checksum,
    /// `None` where the outputs have no frames.
    output: Option<Checksum>,
    instructions: Instructions,
    /// A ring: `waiting` of them from `first` on.
    due: [Due; QUEUED],
    first: usize,
    waiting: usize,
    counts: Counts,
}

impl Relay {
    /// Between lines with these checksums; without one of the output nothing goes out. `directions`: what was asked of the ESC before.
    #[must_use]
    pub const fn new(input: Checksum, output: Option<Checksum>, directions: Directions) -> Self {
        let due = [Due::Throttle { reports: false }; QUEUED];
        Self {
            input,
            output,
            instructions: Instructions::new(output.is_some(), directions),
            due,
            first: 0,
            waiting: 0,
            counts: Counts { valid: 0, bad_checksums: 0, dropped: 0, refused: 0 },
        }
    }

    /// Takes a frame in: what it says to the filter, or `None` for one that is damaged, which makes nothing go out. `compensates`:
    /// whether some motor does.
    pub fn receive(&mut self, bits: u16, compensates: bool) -> Option<Content> {
        let Ok(frame) = Frame::from_bits(bits, self.input) else {
            self.counts.bad_checksums = self.counts.bad_checksums.wrapping_add(1);
            return None;
        };
        self.counts.valid = self.counts.valid.wrapping_add(1);
        let content = frame.value().content();
        let passes = match content {
            Content::Instruction(number) => self.instructions.take(number, compensates),
            Content::Throttle(_) => self.instructions.take_throttle(compensates),
        };
        // Without frames at the outputs an instruction is not missed, but a throttle is.
        let is_missed = self.output.is_some() || matches!(content, Content::Throttle(_));
        if !passes && is_missed {
            self.counts.refused = self.counts.refused.wrapping_add(1);
        }
        match content {
            Content::Throttle(_) if passes => {
                self.push_throttle(frame.reports());
                return Some(content);
            }
            Content::Instruction(_) if passes => self.push(Due::Instruction(frame)),
            _ => self.push(Due::Instruction(Frame::new(Value::STOP, frame.reports(), self.input))),
        }
        Some(if passes { content } else { Content::Instruction(0) })
    }

    /// What goes out next, once the output is free, where `newest` is what the channel gave last. Where that is no pulse nothing
    /// may go out, not even an instruction, since an ESC arms on stops: the frame is gone.
    pub fn next(&mut self, newest: EscCommand) -> Option<Frame> {
        if self.waiting == 0 {
            return None;
        }
        let due = self.due.get(self.first).copied()?;
        self.first = (self.first + 1) % QUEUED;
        self.waiting -= 1;
        let (command, output) = (newest.command()?, self.output?);
        Some(match due {
            Due::Instruction(frame) => Frame::new(frame.value(), frame.reports(), output),
            Due::Throttle { reports } => Frame::new(Value::from_command(command), reports, output),
        })
    }

    /// Forgets what waits: the line was lost, or the output is to be silent.
    pub const fn clear(&mut self) {
        self.waiting = 0;
    }

    /// What was asked of the ESC.
    #[must_use]
    pub const fn directions(&self) -> Directions {
        self.instructions.directions()
    }

    /// What came in, and what became of it.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// A throttle that waits last gives way: both would carry the newest output. Not so its wish for a report.
    fn push_throttle(&mut self, reports: bool) {
        let last = (self.first + self.waiting + QUEUED - 1) % QUEUED;
        match self.due.get_mut(last) {
            Some(Due::Throttle { reports: wished }) if self.waiting > 0 => {
                *wished |= reports;
            }
            _ => self.push(Due::Throttle { reports }),
        }
    }

    fn push(&mut self, due: Due) {
        if self.output.is_none() {
            return;
        }
        let next = (self.first + self.waiting) % QUEUED;
        match self.due.get_mut(next) {
            Some(free) if self.waiting < QUEUED => {
                *free = due;
                self.waiting += 1;
            }
            _ => self.counts.dropped = self.counts.dropped.wrapping_add(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::throttle::Command;

    const FULL: EscCommand = EscCommand::from_bits(Command::ONE.to_bits());
    const STOP: EscCommand = EscCommand::from_bits(0);

    fn bits(value: u16, reports: bool) -> u16 {
        Frame::new(Value::new(value).unwrap(), reports, Checksum::Normal).to_bits()
    }

    fn relay() -> Relay {
        Relay::new(Checksum::Normal, Some(Checksum::Normal), Directions::default())
    }

    #[test]
    fn each_throttle_carries_the_newest_output_and_the_wish_for_a_report() {
        let mut relay = relay();
        for reports in [false, true] {
            assert_eq!(relay.receive(bits(1047, reports), false), Some(Value::new(1047).unwrap().content()));
            let frame = relay.next(FULL).unwrap();
            assert_eq!((frame.value(), frame.reports()), (Value::MAX, reports));
            assert_eq!(relay.next(FULL), None);
        }
    }

    #[test]
    fn instructions_pass_as_they_came_and_as_often() {
        let mut relay = relay();
        for instruction in 0..15_u16 {
            for repeat in 0..10 {
                let sent = bits(instruction, repeat % 2 == 0);
                assert_eq!(relay.receive(sent, false), Some(Content::Instruction(instruction as u8)));
                // Whatever the filter would have.
                let newest = [STOP, FULL][repeat / 2 % 2];
                assert_eq!(relay.next(newest).map(Frame::to_bits), Some(sent));
            }
        }
        assert_eq!(relay.counts(), Counts { valid: 150, ..Counts::default() });
    }

    #[test]
    fn nothing_goes_out_for_a_damaged_frame_or_without_one() {
        let mut relay = relay();
        assert_eq!(relay.next(FULL), None);
        assert_eq!(relay.receive(bits(1047, false) ^ 0x100, false), None);
        assert_eq!(relay.next(FULL), None);
        assert_eq!(relay.counts(), Counts { bad_checksums: 1, ..Counts::default() });
    }

    #[test]
    fn a_silent_channel_lets_nothing_out_and_a_stopped_one_lets_stops() {
        let mut relay = relay();
        relay.receive(bits(0, false), false);
        assert_eq!(relay.next(EscCommand::NO_PULSE), None);
        relay.receive(bits(1047, true), false);
        assert_eq!(relay.next(EscCommand::NO_PULSE), None);
        assert_eq!(relay.next(FULL), None);
        relay.receive(bits(1047, true), false);
        assert_eq!(relay.next(STOP).map(Frame::to_bits), Some(bits(0, true)));
    }

    #[test]
    fn a_slow_output_loses_old_throttles_and_no_instruction() {
        let mut relay = relay();
        for value in [1000, 1001, 7, 7, 7, 1002, 1003, 1004] {
            relay.receive(bits(value, false), false);
        }
        let out: Vec<u16> = std::iter::from_fn(|| relay.next(EscCommand::from(Command::saturating_from_f64(0.0005))))
            .map(|frame| frame.value().get())
            .collect();
        assert_eq!(out, [48, 7, 7, 7, 48]);
        assert_eq!(relay.counts(), Counts { valid: 8, ..Counts::default() });
        // Round and round, and over the brim.
        for _ in 0..5 {
            for _ in 0..QUEUED + 2 {
                relay.receive(bits(20, false), false);
            }
            assert_eq!(std::iter::from_fn(|| relay.next(STOP)).count(), QUEUED);
        }
        assert_eq!(relay.counts().dropped, 10);
        relay.receive(bits(20, false), false);
        relay.clear();
        assert_eq!(relay.next(STOP), None);
    }

    #[test]
    fn a_wish_for_a_report_is_not_overtaken() {
        let mut relay = relay();
        for reports in [false, true, false] {
            relay.receive(bits(1000, reports), false);
        }
        assert!(relay.next(FULL).unwrap().reports());
        assert_eq!(relay.next(FULL), None);
        relay.receive(bits(1000, false), false);
        assert!(!relay.next(FULL).unwrap().reports(), "it is asked once");
    }

    /// 3D on while a motor compensates, and AM32's settings at any time.
    #[test]
    fn what_may_not_pass_is_a_stop_and_counted() {
        let mut relay = relay();
        for (instruction, compensates) in [(10, true), (36, false)] {
            for _ in 0..5 {
                assert_eq!(relay.receive(bits(instruction, true), compensates), Some(Content::Instruction(0)));
                assert_eq!(relay.next(FULL).map(Frame::to_bits), Some(bits(0, true)));
            }
        }
        assert_eq!(relay.counts().refused, 10);
        relay.receive(bits(10, true), false);
        assert_eq!(relay.next(STOP).map(Frame::to_bits), Some(bits(10, true)));
        // Once the ESC would have taken it, a throttle may mean the other direction.
        for _ in 0..6 {
            relay.receive(bits(10, false), true);
            let _ = relay.next(STOP);
        }
        assert_eq!(relay.receive(bits(500, false), true), Some(Content::Instruction(0)));
        assert_eq!(relay.next(FULL).map(Frame::to_bits), Some(bits(0, false)));
        assert_eq!(relay.counts().refused, 17);
    }

    #[test]
    fn without_frames_at_the_outputs_nothing_waits_and_a_turned_motor_stops() {
        let mut relay = Relay::new(Checksum::Normal, None, Directions::default());
        for _ in 0..2 * QUEUED {
            relay.receive(bits(21, false), false);
        }
        assert_eq!(relay.receive(bits(500, false), false), Some(Content::Instruction(0)));
        assert_eq!(relay.next(FULL), None);
        assert_eq!(relay.counts(), Counts { valid: 2 * QUEUED as u32 + 1, refused: 1, ..Counts::default() });
        for _ in 0..6 {
            relay.receive(bits(20, false), false);
        }
        assert!(matches!(relay.receive(bits(500, false), false), Some(Content::Throttle(_))));
    }

    #[test]
    fn the_two_lines_may_have_checksums_of_their_own() {
        let mut relay = Relay::new(Checksum::Normal, Some(Checksum::Inverted), Directions::default());
        relay.receive(bits(21, true), false);
        let frame = relay.next(STOP).unwrap();
        assert_eq!(Frame::from_bits(frame.to_bits(), Checksum::Inverted), Ok(frame));
        assert!(Frame::from_bits(frame.to_bits(), Checksum::Normal).is_err());
    }
}
