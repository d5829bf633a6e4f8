//! DShot at the inputs and the outputs: frames instead of pulses.

use super::hardware::{InputFrameHardware, OutputHardware};
use crate::capture::InputReading;
use crate::dshot::{Checksum, Directions, Frame, Receiver, Relay, Value};
use crate::link::MotorFaults;
use crate::settings::MOTORS;
use crate::throttle::EscCommand;

/// Words of an input that a control tick takes: as many as a board holds. Those of the fastest line at the slowest loop are 20,
/// and a flight controller sends no more than one in 125 µs.
const WORDS_PER_TICK: usize = 8;

/// What the four lines say.
pub struct FrameInputs([Receiver; MOTORS]);

impl FrameInputs {
    /// Of lines whose last frame is good for so many ticks, with frames of these checksums in and, where there are any, out.
    /// `directions`: what was asked of the ESCs before.
    pub fn new(
        timeout_ticks: u32,
        input: Checksum,
        output: Option<Checksum>,
        directions: [Directions; MOTORS],
    ) -> Self {
        Self(directions.map(|directions| Receiver::new(Relay::new(input, output, directions), timeout_ticks)))
    }

    /// What was asked of the ESCs.
    pub fn directions(&self) -> [Directions; MOTORS] {
        self.0.each_ref().map(Receiver::directions)
    }

    /// Which lines are live.
    pub fn are_live(&self) -> [bool; MOTORS] {
        self.0.each_ref().map(Receiver::is_live)
    }

    /// Once per control tick: takes the words that have come, and says what has become of each input. `compensates`: whether some
    /// motor does.
    pub fn read(&mut self, compensates: bool, hardware: &mut impl InputFrameHardware) -> [InputReading; MOTORS] {
        let mut readings = [InputReading::NOTHING; MOTORS];
        for (motor, (receiver, reading)) in self.0.iter_mut().zip(&mut readings).enumerate() {
            for _ in 0..WORDS_PER_TICK {
                let Some(word) = hardware.take_word(motor) else { break };
                receiver.receive(word, compensates);
            }
            if hardware.take_words_lost(motor) {
                receiver.lose_words();
            }
            *reading = receiver.read();
        }
        readings
    }

    /// Lets a frame out for each that came in, as far as the outputs take them; without `outputs` of DShot they are gone.
    pub fn relay(&mut self, outputs: [EscCommand; MOTORS], hardware: &mut impl OutputHardware) {
        for (motor, (receiver, output)) in self.0.iter_mut().zip(outputs).enumerate() {
            for _ in 0..WORDS_PER_TICK {
                if !hardware.can_send(motor) {
                    break;
                }
                let Some(frame) = receiver.next(output) else { break };
                hardware.send(motor, frame);
            }
        }
    }

    /// Valid frames in a second at each input.
    pub fn rates(&self, loop_rate_hz: u32) -> [u32; MOTORS] {
        self.0.each_ref().map(|receiver| receiver.frame_hz(loop_rate_hz))
    }

    /// What was wrong at each input.
    pub fn faults(&self) -> [MotorFaults; MOTORS] {
        self.0.each_ref().map(|receiver| MotorFaults {
            bad_frames: receiver.bad_frames(),
            dropped_frames: receiver.dropped_frames(),
            refused_frames: receiver.refused_frames(),
            lost: receiver.losses(),
            ..MotorFaults::default()
        })
    }
}

/// Frames for inputs with pulses: one in so many ticks.
pub struct FrameClock {
    checksum: Checksum,
    ticks_per_frame: u32,
    ticks_left: u32,
}

impl FrameClock {
    /// The first frame goes out with the next tick.
    pub const fn new(ticks_per_frame: u32, checksum: Checksum) -> Self {
        Self { checksum, ticks_per_frame, ticks_left: 1 }
    }

    /// One control tick. No pulse is no frame.
    pub fn tick(&mut self, outputs: [EscCommand; MOTORS], hardware: &mut impl OutputHardware) {
        self.ticks_left = self.ticks_left.saturating_sub(1);
        if self.ticks_left > 0 {
            return;
        }
        self.ticks_left = self.ticks_per_frame;
        for (motor, output) in outputs.into_iter().enumerate() {
            if let Some(command) = output.command()
                && hardware.can_send(motor)
            {
                hardware.send(motor, Frame::new(Value::from_command(command), false, self.checksum));
            }
        }
    }
}
