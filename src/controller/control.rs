//! The control task: a [`Tick`], and the hardware that it drives.

use super::dshot_ports::{FrameClock, FrameInputs};
use super::hardware::{
    ControlHardware, ControlParts, InputFrameHardware, OutputHardware, ThrustConverter, TickTimer, Watchdog,
};
use super::pacing::{FrameAction, FramePacer, InputPulse};
use super::plan::{FrameRate, InputPlan, OutputPlan, Plan};
use super::replies::Replies;
use super::resume::{FlightRecorder, ResumeMemory};
use super::supervision::Supervisor;
use super::tick::Tick;
use crate::capture::InputReading;
use crate::channel::Channel;
use crate::dshot::Line;
use crate::link::{MotorFaults, NO_TURN, Sensed};
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
    fn start(plan: &OutputPlan, hardware: &mut impl OutputHardware) -> Self {
        match *plan {
            OutputPlan::Pulses { scale, frames } => {
                hardware.set_frames(frames.divider, frames.longest);
                Self::Pulses { scale, pacer: frames.follow_input().then(|| FramePacer::new(&frames)) }
            }
            OutputPlan::Dshot { line, rate } => {
                hardware.set_line(line);
                match rate {
                    FrameRate::Relayed(_) => Self::Relay(FrameClock::new(1, line.checksum())),
                    FrameRate::Ticks(ticks) => Self::Frames(FrameClock::new(ticks, line.checksum())),
                }
            }
        }
    }
}

/// Sets the inputs up; `None` where the capture timer has them. `before`: what had them.
fn start_inputs(
    plan: &Plan,
    before: Option<&FrameInputs>,
    hardware: &mut impl InputFrameHardware,
) -> Option<FrameInputs> {
    match plan.input {
        InputPlan::Pulses(_) => {
            hardware.set_line(None);
            None
        }
        InputPlan::Dshot { line, timeout_ticks } => {
            hardware.set_line(Some(line));
            let output = plan.output.line().map(Line::checksum);
            let directions = before.map_or_else(Default::default, FrameInputs::directions);
            Some(FrameInputs::new(timeout_ticks, line.checksum(), output, directions))
        }
    }
}

/// What is to become of the ESCs' replies; `None` where there are none.
fn replies(plan: &Plan, loop_rate_hz: u32) -> Option<Replies> {
    let is_relayed = matches!(plan.input, InputPlan::Dshot { line: Line { is_bidirectional: true, .. }, .. });
    match plan.output {
        OutputPlan::Dshot { line: Line { is_bidirectional: true, .. }, rate } => {
            Some(Replies::new(is_relayed, rate.ticks(), loop_rate_hz))
        }
        _ => None,
    }
}

/// What the control task has.
pub struct Control<H: ControlHardware> {
    tick: Tick,
    parts: ControlParts<H>,
    inputs: Option<FrameInputs>,
    outputs: OutputPath,
    output_plan: OutputPlan,
    replies: Option<Replies>,
    supervisor: Supervisor,
    /// Keeps what a flight needs over a reset.
    recorder: FlightRecorder,
}

impl<H: ControlHardware> Control<H> {
    /// Sets the rates; the outputs are low until the first tick.
    pub fn new(mut parts: ControlParts<H>, tick: Tick, plan: &Plan, loop_rate_hz: u32) -> Self {
        let inputs = start_inputs(plan, None, &mut parts.input_frames);
        let outputs = OutputPath::start(&plan.output, &mut parts.outputs);
        parts.timer.set_rate(loop_rate_hz);
        parts.watchdog.set_long_timeout(false);
        let replies = replies(plan, loop_rate_hz);
        let (supervisor, recorder) = (Supervisor::new(loop_rate_hz), FlightRecorder::new(None));
        let output_plan = plan.output;
        Self { tick, parts, inputs, outputs, output_plan, replies, supervisor, recorder }
    }

    /// Memory that survives a reset, in which it keeps what a flight needs to go on.
    pub(super) fn set_memory(&mut self, memory: Option<&'static ResumeMemory>) {
        self.recorder = FlightRecorder::new(memory);
    }

    /// Starts the ticks, once all is where it stays: on its way there, where interrupts wait, the first ones would be late.
    pub fn start_ticks(&mut self) {
        self.parts.timer.start();
    }

    /// One tick: what the inputs have, to what the outputs get. `readings`: of inputs with pulses; those with frames are read
    /// here. `idle_ran`: the lowest priority has run since the last one.
    #[inline]
    pub fn run(&mut self, readings: [InputReading; MOTORS], idle_ran: bool) {
        let Self { tick, parts, inputs, outputs, replies, supervisor, recorder, .. } = self;
        let readings = match inputs {
            None => readings,
            Some(inputs) => inputs.read(tick.compensates(), &mut parts.input_frames),
        };
        if let Some(replies) = replies {
            let are_live = inputs.as_ref().map_or([false; MOTORS], FrameInputs::are_live);
            replies.tick(are_live, &mut parts.outputs, &mut parts.input_frames);
        }
        if tick.is_recording() {
            parts.thrust.start();
        }
        let replies = replies.as_ref();
        let commands = tick.run(readings, |motor| Sensed {
            adc: parts.thrust.read(),
            turn_us: replies.map_or(NO_TURN, |replies| replies.turn_us(motor)),
        });
        if let Some(replies) = replies {
            tick.correct(|motor| replies.turn_us(motor));
        }
        #[cfg(feature = "planted-panic")]
        planted_panic(commands);
        match outputs {
            OutputPath::Pulses { scale, pacer } => {
                put_out(*scale, pacer.as_mut(), commands, tick.input_pulse(), &mut parts.outputs);
            }
            OutputPath::Relay(clock) => {
                if let Some(inputs) = inputs {
                    inputs.relay(commands, &mut parts.outputs);
                }
                clock.tick(tick.bench_commands(), &mut parts.outputs);
            }
            OutputPath::Frames(clock) => clock.tick(commands, &mut parts.outputs),
        }
        if supervisor.tick(idle_ran, tick.input_pulse() == InputPulse::New) {
            do_chores(tick, supervisor, recorder, &mut parts.watchdog);
        }
        if parts.timer.is_due() && supervisor.late(tick.ticks()) {
            tick.stop_excitation();
        }
    }

    /// The motors.
    pub const fn tick_mut(&mut self) -> &mut Tick {
        &mut self.tick
    }

    /// What it drives.
    pub const fn parts_mut(&mut self) -> &mut ControlParts<H> {
        &mut self.parts
    }

    /// Other settings. Every motor is at rest; the outputs are low until the next tick.
    pub fn reconfigure(&mut self, settings: &Validated, channels: &[Channel; MOTORS], plan: &Plan) {
        self.inputs = start_inputs(plan, self.inputs.as_ref(), &mut self.parts.input_frames);
        self.outputs = OutputPath::start(&plan.output, &mut self.parts.outputs);
        self.output_plan = plan.output;
        self.replies = replies(plan, settings.loop_rate_hz);
        self.parts.timer.set_rate(settings.loop_rate_hz);
        self.supervisor.set_rate(settings.loop_rate_hz);
        self.tick.reconfigure(channels, plan.input_scale, settings.loop_rate_hz);
    }

    /// Ticks that missed their deadline, wrapping.
    #[must_use]
    pub const fn missed_deadlines(&self) -> u32 {
        self.supervisor.missed()
    }

    /// The flash will stall the core (`true`), or has done so (`false`).
    pub fn flash_stalls(&mut self, stalls: bool) {
        self.parts.watchdog.set_long_timeout(stalls);
        if let Some(replies) = &mut self.replies {
            replies.withdraw(&mut self.parts.input_frames);
        }
    }

    /// Frames of DShot that come in a second at each input; 0 where they have pulses.
    #[must_use]
    pub fn input_frames(&self, loop_rate_hz: u32) -> [u32; MOTORS] {
        self.inputs.as_ref().map_or([0; MOTORS], |inputs| inputs.rates(loop_rate_hz))
    }

    /// Pulses or frames in a second at an output whose input has so many.
    #[must_use]
    pub const fn output_hz(&self, input_hz: u32, loop_rate_hz: u32) -> u32 {
        self.output_plan.frame_hz(input_hz, loop_rate_hz)
    }

    /// Times that the lowest priority was away for 20 s while a flight controller turned a motor, wrapping.
    #[must_use]
    pub const fn idle_hangs(&self) -> u32 {
        self.supervisor.idle_hangs()
    }

    /// Puts in what was wrong at each motor since the settings were set: at inputs that have frames, and with the replies of ESCs.
    pub fn count_faults(&self, faults: &mut [MotorFaults; MOTORS]) {
        if let Some(inputs) = &self.inputs {
            *faults = inputs.faults();
        }
        if let Some(replies) = &self.replies {
            replies.count(faults);
        }
    }
}

/// What need not be done in every tick: keeps what the flight needs after a reset, and feeds the watchdog.
#[inline(never)]
fn do_chores(tick: &Tick, supervisor: &mut Supervisor, recorder: &mut FlightRecorder, watchdog: &mut impl Watchdog) {
    if recorder.step(tick.ticks(), tick.motors()) {
        let is_rested = tick.not_rested().is_none();
        supervisor.review(tick.ticks(), tick.is_flown(), is_rested);
    }
    if supervisor.done() {
        watchdog.feed();
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
    hardware: &mut impl OutputHardware,
) {
    hardware.set_widths(commands.map(|command| scale.to_width_ticks(command)));
    let Some(pacer) = pacer else { return };
    match pacer.tick(input_pulse, hardware.frame_count()) {
        FrameAction::None => {}
        FrameAction::Restart => hardware.restart_frame(),
        FrameAction::EndAt(counts) => hardware.end_frame_at(counts),
    }
}

/// An index beyond the end where the first command is above one half.
#[cfg(feature = "planted-panic")]
fn planted_panic(commands: [EscCommand; MOTORS]) {
    use core::hint::black_box;
    let beyond = commands[0].to_bits() > crate::throttle::Command::ONE.to_bits() / 2;
    black_box(commands[black_box(if beyond { MOTORS } else { 0 })]);
}
