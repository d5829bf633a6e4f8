//! The RP2040's image at its pins, in its emulators.

use emulator::rp2040::{Analog, Bytes, Emulator, Run};
use rotorlead::link::{FRAME_BYTES, Message, Receiver, encode};
use rotorlead::settings::MOTORS;

use super::table::Column;
use super::{Miss, Outcome, Outputs, Play, Target};
use crate::pins::{self, LED, OUTPUT_1};

/// The RP2040's image.
pub struct Rp2040(pub Emulator);

impl Target for Rp2040 {
    fn column(&self) -> Column {
        match self.0 {
            Emulator::Node => Column::Rp2040js,
            Emulator::Native => Column::Rp2040Emu,
        }
    }

    fn play(&self, play: &Play) -> Result<Outcome, Miss> {
        if self.0 == Emulator::Native {
            Self::check_native(play)?;
        }
        let mut run = Run::new(pins::image(), play.end);
        run.flash.extend(play.settings.as_ref().map(pins::stored));
        run.inputs.clone_from(&play.edges);
        run.analog = play.thrust.iter().map(|&(cycle, count)| Analog { cycle, input: 0, count }).collect();
        run.uart_in = (1..).zip(&play.requests).map(|(tag, (cycle, request))| bytes(*cycle, tag, request)).collect();
        run.watch = (OUTPUT_1..).take(MOTORS).chain([LED]).collect();
        let trace = self.0.run(&run).map_err(|error| Miss::Wrong(error.to_string()))?;
        if let Some(fault) = trace.faults.first() {
            return Err(Miss::Wrong(format!("{} at {:#x}, cycle {}", fault.what, fault.pc, fault.cycle)));
        }
        if let Some(reset) = trace.resets.first() {
            return Err(Miss::Wrong(format!("a reset at cycle {}", reset.cycle)));
        }
        let mut receiver = Receiver::<Message>::new();
        let answers = trace.uart.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect();
        // The second emulator looks at pins between instructions, and not while an exception is entered.
        let true_to_cycles = if self.0 == Emulator::Node { 1.0 } else { 20.0 };
        Ok(Outcome { outputs: Outputs::Edges { edges: trace.edges, true_to_cycles }, answers, end: trace.cycles })
    }
}

impl Rp2040 {
    /// What rp2040-emu lacks. Without PWM an output never rises, which would prove nothing.
    fn check_native(play: &Play) -> Result<(), Miss> {
        if !play.requests.is_empty() {
            return Err(Miss::Cannot("no receiver"));
        }
        if !play.thrust.is_empty() {
            return Err(Miss::Cannot("no converter"));
        }
        let has_frames = play.settings.as_ref().is_some_and(|settings| settings.output.protocol.dshot().is_some());
        if has_frames { Ok(()) } else { Err(Miss::Cannot("no PWM")) }
    }
}

fn bytes(cycle: u64, tag: u8, request: &rotorlead::link::Request) -> Bytes {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(tag, request, &mut frame).expect("every request fits a frame");
    Bytes { cycle, bytes: frame[..length].to_vec() }
}
