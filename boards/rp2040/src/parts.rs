//! The parts of the board as the library takes them: [`rotorlead::controller::hardware`].

use core::sync::atomic::Ordering;

use rotorlead::controller::hardware::{BoardFacts, ControlHardware, RequestHardware};
use rotorlead::dshot::{Frame, Line, Offer, ReplyWindow, Word};
use rotorlead::settings::MOTORS;
use rotorlead::systick::ControlTimer;

use crate::inputs::InputFrames;
use crate::outputs::Outputs;
use crate::pinout::JUMPER;
use crate::pins::Pins;
use crate::serial;
use crate::thrust_adc::ThrustAdc;
use crate::watchdog::Watchdog;

/// What the control task drives.
pub struct ControlParts {
    /// What the inputs have.
    pub input_frames: InputFrames,
    /// Pulses or frames.
    pub outputs: Outputs,
    /// The ticks.
    pub timer: ControlTimer,
    /// The thrust sensor's converter.
    pub thrust_adc: ThrustAdc,
    /// The watchdog.
    pub watchdog: Watchdog,
}

impl ControlHardware for ControlParts {
    fn set_frames(&mut self, divider: u32, counts: u32) {
        self.outputs.set_frames(divider, counts);
    }

    #[inline]
    fn set_widths(&mut self, counts: [u32; MOTORS]) {
        self.outputs.set(counts);
    }

    #[inline]
    fn frame_count(&self) -> u32 {
        self.outputs.frame_count()
    }

    #[inline]
    fn restart_frame(&mut self) {
        self.outputs.restart_frame();
    }

    #[inline]
    fn end_frame_at(&mut self, counts: u32) {
        self.outputs.end_frame_at(counts);
    }

    fn set_tick_rate(&mut self, rate_hz: u32) {
        self.timer.set_rate(rate_hz);
    }

    fn start_ticks(&mut self) {
        self.timer.start();
    }

    #[inline]
    fn is_tick_due(&self) -> bool {
        self.timer.is_due()
    }

    #[inline]
    fn start_conversion(&mut self) {
        self.thrust_adc.start();
    }

    #[inline]
    fn conversion(&mut self) -> u16 {
        self.thrust_adc.read()
    }

    #[inline]
    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn set_watchdog_patient(&mut self, patient: bool) {
        self.watchdog.set_patient(patient);
    }

    fn set_input_frames(&mut self, line: Option<Line>) {
        self.input_frames.set(line);
    }

    #[inline]
    fn take_word(&mut self, motor: usize) -> Option<Word> {
        self.input_frames.take(motor)
    }

    fn has_lost_words(&mut self, motor: usize) -> bool {
        self.input_frames.has_lost(motor)
    }

    fn set_output_frames(&mut self, line: Line) {
        self.outputs.set_line(line);
    }

    #[inline]
    fn can_send(&self, motor: usize) -> bool {
        self.outputs.can_send(motor)
    }

    #[inline]
    fn send(&mut self, motor: usize, frame: Frame) {
        self.outputs.send(motor, frame);
    }

    #[inline]
    fn take_reply(&mut self, motor: usize) -> Option<ReplyWindow> {
        self.outputs.take_reply(motor)
    }

    #[inline]
    fn offer_reply(&mut self, motor: usize, offer: Offer) {
        self.input_frames.offer(motor, offer);
    }

    #[inline]
    fn is_offer_taken(&self, motor: usize) -> bool {
        self.input_frames.is_offer_taken(motor)
    }
}

/// What the lowest priority asks of the board.
pub struct BoardStatus {
    /// What does not change.
    pub facts: BoardFacts,
    /// The jumper to ground that allows excitation and injection, against the pin's pull-up; and the lamp.
    pub pins: Pins,
}

impl RequestHardware for BoardStatus {
    fn facts(&self) -> BoardFacts {
        self.facts
    }

    fn is_bench_enabled(&mut self) -> bool {
        !self.pins.is_high(JUMPER)
    }

    fn link_overruns(&self) -> u32 {
        serial::LOST.load(Ordering::Relaxed)
    }

    /// The watchdog takes a new time with the feed that sets it.
    fn wait_for_watchdog(&mut self) {}
}
