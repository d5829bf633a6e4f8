//! The control task: a [`Tick`], and the hardware that it drives.

use super::frames::{FrameClock, FrameInputs};
use super::hardware::ControlHardware;
use super::pacing::{FrameAction, FramePacer, InputPulse};
use super::plan::{FrameRate, InputPlan, OutputPlan, Plan};
use super::supervision::Supervisor;
use super::tick::Tick;
use crate::capture::Reading;
use crate::channel::Channel;
use crate::link::MotorFaults;
use crate::settings::{MOTORS, Validated};
use crate::throttle::{EscCommand, PulseScale};

/// How the outputs get what the tick gives.
enum OutputPath {
    /// As widths, in frames that follow the input's pulses where there is a pacer.
    Pulses { scale: PulseScale, pacer: Option<FramePacer> },
    /// As frames of DShot, one for each that came in, and by the clock for a motor that the host drives.
    Relay(FrameClock),
    /// As frames of DShot at a rate of their own.
    Frames(FrameClock),
}

impl OutputPath {
    /// Sets the outputs up: they are low until the first tick.
    fn start(plan: &OutputPlan, hardware: &mut impl ControlHardware) -> Self {
        match *plan {
            OutputPlan::Pulses { scale, frames } => {
                hardware.set_frames(frames.divider, frames.longest);
                Self::Pulses { scale, pacer: frames.follow_input().then(|| FramePacer::new(&frames)) }
            }
            OutputPlan::Dshot { speed, rate } => {
                hardware.set_output_frames(speed);
                match rate {
                    FrameRate::Relayed => Self::Relay(FrameClock::new(1)),
                    FrameRate::Ticks(ticks) => Self::Frames(FrameClock::new(ticks)),
                }
            }
        }
    }
}

/// Sets the inputs up; `None` where the capture timer has them.
fn start_inputs(plan: &InputPlan, hardware: &mut impl ControlHardware) -> Option<FrameInputs> {
    match *plan {
        InputPlan::Pulses(_) => {
            hardware.set_input_frames(None);
            None
        }
        InputPlan::Dshot { speed, timeout_ticks } => {
            hardware.set_input_frames(Some(speed));
            Some(FrameInputs::new(timeout_ticks))
        }
    }
}

/// What the control task has.
pub struct Control<H> {
    tick: Tick,
    hardware: H,
    inputs: Option<FrameInputs>,
    outputs: OutputPath,
    supervisor: Supervisor,
}

impl<H: ControlHardware> Control<H> {
    /// Sets the rates and starts the ticks; the outputs are low until the first.
    pub fn start(mut hardware: H, tick: Tick, plan: &Plan, loop_rate_hz: u32) -> Self {
        let inputs = start_inputs(&plan.input, &mut hardware);
        let outputs = OutputPath::start(&plan.output, &mut hardware);
        hardware.set_tick_rate(loop_rate_hz);
        hardware.set_watchdog_patient(false);
        hardware.start_ticks();
        Self { tick, hardware, inputs, outputs, supervisor: Supervisor::new(loop_rate_hz) }
    }

    /// One tick: what the inputs have, to what the outputs get. `readings`: of inputs with pulses; those with frames are read
    /// here. `idle_ran`: the lowest priority has run since the last one.
    #[inline]
    pub fn run(&mut self, readings: [Reading; MOTORS], idle_ran: bool) {
        let Self { tick, hardware, inputs, outputs, supervisor } = self;
        let readings = match inputs {
            None => readings,
            Some(inputs) => inputs.read(hardware),
        };
        if tick.is_recording() {
            hardware.start_conversion();
        }
        let commands = tick.run(readings, || hardware.conversion());
        #[cfg(feature = "planted-panic")]
        let _ = {
            use core::hint::black_box;
            let beyond = commands[0].to_bits() > crate::throttle::Command::ONE.to_bits() / 2;
            black_box(commands[black_box(if beyond { MOTORS } else { 0 })])
        };
        match outputs {
            OutputPath::Pulses { scale, pacer } => {
                put_out(*scale, pacer.as_mut(), commands, tick.input_pulse(), hardware);
            }
            OutputPath::Relay(clock) => {
                if let Some(inputs) = inputs {
                    inputs.relay(commands, hardware);
                }
                clock.tick(tick.bench_commands(), hardware);
            }
            OutputPath::Frames(clock) => clock.tick(commands, hardware),
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
    pub fn reconfigure(&mut self, settings: &Validated, channels: &[Channel; MOTORS], plan: &Plan) {
        self.inputs = start_inputs(&plan.input, &mut self.hardware);
        self.outputs = OutputPath::start(&plan.output, &mut self.hardware);
        self.hardware.set_tick_rate(settings.loop_rate_hz);
        self.supervisor.set_rate(settings.loop_rate_hz);
        self.tick.reconfigure(channels, plan.input_scale, settings.loop_rate_hz);
    }

    /// Ticks that missed their deadline, wrapping.
    #[must_use]
    pub const fn missed_deadlines(&self) -> u32 {
        self.supervisor.missed()
    }

    /// What was wrong with the frames of each input since the settings were set; `None` where they have pulses.
    #[must_use]
    pub fn frame_faults(&self) -> Option<[MotorFaults; MOTORS]> {
        self.inputs.as_ref().map(FrameInputs::faults)
    }
}

/// Sets the widths of the next pulses, and ends the frame where it is to follow a pulse of the input. The scale is a copy of its
/// own, which is loaded once and not for each output.
#[inline]
fn put_out(
    scale: PulseScale,
    pacer: Option<&mut FramePacer>,
    commands: [EscCommand; MOTORS],
    input_pulse: InputPulse,
    hardware: &mut impl ControlHardware,
) {
    hardware.set_widths(commands.map(|command| scale.to_width_ticks(command)));
    let Some(pacer) = pacer else { return };
    match pacer.tick(input_pulse, hardware.frame_count()) {
        FrameAction::None => {}
        FrameAction::Restart => hardware.restart_frame(),
        FrameAction::EndAt(counts) => hardware.end_frame_at(counts),
    }
}
