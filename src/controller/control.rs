//! The control task: a [`Tick`], and the hardware that it drives.

use super::hardware::ControlHardware;
use super::pacing::{FrameAction, FramePacer};
use super::plan::Plan;
use super::supervision::Supervisor;
use super::tick::Tick;
use crate::capture::Reading;
use crate::channel::Channel;
use crate::settings::{MOTORS, Validated};
use crate::throttle::PulseScale;

/// What the control task has.
pub struct Control<H> {
    tick: Tick,
    hardware: H,
    output_scale: PulseScale,
    /// Where frames follow the input's pulses.
    pacer: Option<FramePacer>,
    supervisor: Supervisor,
}

impl<H: ControlHardware> Control<H> {
    /// Sets the rates and starts the ticks; the outputs are low until the first.
    pub fn start(mut hardware: H, tick: Tick, plan: &Plan, loop_rate_hz: u32) -> Self {
        hardware.set_frames(plan.frames.divider, plan.frames.longest);
        hardware.set_tick_rate(loop_rate_hz);
        hardware.set_watchdog_patient(false);
        hardware.start_ticks();
        Self {
            tick,
            hardware,
            output_scale: plan.output_scale,
            pacer: pacer(plan),
            supervisor: Supervisor::new(loop_rate_hz),
        }
    }

    /// One tick: what the inputs have, to the widths of the next pulses. `idle_ran`: the lowest priority has run since the
    /// last one.
    #[inline]
    pub fn run(&mut self, readings: [Reading; MOTORS], idle_ran: bool) {
        let Self { tick, hardware, output_scale, pacer, supervisor } = self;
        if tick.is_recording() {
            hardware.start_conversion();
        }
        let outputs = tick.run(readings, || hardware.conversion());
        #[cfg(feature = "planted-panic")]
        let _ = {
            use core::hint::black_box;
            let beyond = outputs[0].to_bits() > crate::throttle::Command::ONE.to_bits() / 2;
            black_box(outputs[black_box(if beyond { MOTORS } else { 0 })])
        };
        // A copy of its own, which is loaded once and not for each output.
        let scale = *output_scale;
        hardware.set_widths(outputs.map(|output| scale.to_width_ticks(output)));
        if let Some(pacer) = pacer {
            match pacer.tick(tick.input_pulse(), hardware.frame_count()) {
                FrameAction::None => {}
                FrameAction::Restart => hardware.restart_frame(),
                FrameAction::EndAt(counts) => hardware.end_frame_at(counts),
            }
        }
        if supervisor.tick(idle_ran) {
            hardware.feed_watchdog();
        }
        if hardware.is_tick_due() && supervisor.late(tick.ticks()) {
            tick.stop_excitation();
        }
    }

    /// The motors.
    pub const fn tick_mut(&mut self) -> &mut Tick {
        &mut self.tick
    }

    /// The hardware.
    pub const fn hardware_mut(&mut self) -> &mut H {
        &mut self.hardware
    }

    /// Other settings. Every motor is at rest; the outputs are low until the next tick.
    pub fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS], plan: &Plan) {
        self.hardware.set_frames(plan.frames.divider, plan.frames.longest);
        self.hardware.set_tick_rate(settings.loop_rate_hz);
        self.output_scale = plan.output_scale;
        self.pacer = pacer(plan);
        self.supervisor.set_rate(settings.loop_rate_hz);
        self.tick.reconfigure(channels, plan.input_scale, settings.loop_rate_hz);
    }

    /// Ticks that missed their deadline, wrapping.
    #[must_use]
    pub const fn missed_deadlines(&self) -> u32 {
        self.supervisor.missed()
    }
}

fn pacer(plan: &Plan) -> Option<FramePacer> {
    plan.frames.follow_input().then(|| FramePacer::new(&plan.frames))
}
