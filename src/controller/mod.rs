//! The whole controller, but for the hardware: what happens in a control tick, and what answers the host.
//!
//! ```text
//! capture interrupt --> Inputs --readings-> Control (Tick) --> pulses             highest priorities
//!                                           |  ^  |
//!                    samples, outputs of    |  |  |  commands to be injected,
//!                    injected commands      v  |  v  and short calls under a lock
//! bytes of the link <------------------ Server (RequestHandler) <-------- bytes of the link    lowest priority
//! ```
//!
//! [`Control`] belongs to the control task, and [`Inputs`] is shared with the capture interrupt. [`RequestHandler`] belongs
//! to the lowest priority, where requests are decoded and designs computed; it reaches the tick's state through
//! [`ControlAccess::tick`], for as long as it takes to copy a few hundred bytes, and streams of samples through queues. [`Server`]
//! is a request handler with the link around it. [`start`] makes all of them. What a board must give is in [`hardware`].

mod clock;
mod control;
mod control_access;
mod dshot_ports;
mod filters;
pub mod hardware;
mod inputs;
mod lamp;
pub mod load;
mod pacing;
mod plan;
mod postmortem;
mod replies;
mod request_handler;
mod resume;
mod server;
mod start;
mod supervision;
mod tick;

pub use clock::{ClockReport, check_crystal, check_timer};
pub use control::Control;
pub use control_access::{ControlAccess, ControlHandle, Counts, FrameRates};
pub use filters::{FilterError, filters};
pub use hardware::BoardFacts;
pub use inputs::Inputs;
pub use lamp::{LAMP_STEP_MS, Lamp};
pub use pacing::{FrameAction, FramePacer, InputPulse};
pub use plan::{FrameRate, Frames, InputPlan, OutputPlan, Plan, longest_pulse_ticks};
pub use postmortem::Record;
pub use request_handler::{HandlerQueues, RequestHandler};
pub use resume::{CRASH_LOOP_MS, ResumeMemory, ResumeSource};
pub use server::Server;
pub use start::{Ends, Queues, Started, start};
pub use supervision::Supervisor;
pub use tick::{INJECT_QUEUE, Motor, MotorQueues, Outputs, RECORD_QUEUE, Tick};

use crate::channel::{Channel, ChannelSettings, ExcitationLimits, LONGEST_RAMP_TICKS};
use crate::compensator::{Filter, SpeedCorrection};
use crate::settings::{CompensatorKind, DEAD_MAN_MS, MOTORS, Validated};
use crate::throttle::Command;

/// Control ticks in so many milliseconds.
const fn ticks(milliseconds: u32, loop_rate_hz: u32) -> u32 {
    // Loop rates are at most 10 kHz and times at most 600 s.
    (milliseconds as u64 * loop_rate_hz as u64 / 1000) as u32
}

/// The limits of one motor's channel.
#[must_use]
pub fn channel_settings(settings: &Validated, motor: usize) -> ChannelSettings {
    let rate = settings.loop_rate_hz;
    let motor = settings.motors.get(motor).copied().unwrap_or_default();
    let levels = settings.levels(&motor);
    let excitation = &settings.excitation;
    let ramp_ticks = ticks(u32::from(excitation.ramp_ms), rate).max(1);
    // No ramp stands still: of commands so low that a step per tick is too much or too little, this is the more.
    let max_command = excitation.max_command.cast_unsigned();
    let per_tick = (max_command / ramp_ticks).max(max_command.div_ceil(LONGEST_RAMP_TICKS)).max(1);
    ChannelSettings {
        stop: Command::saturating_from_bits(settings.stop),
        disarming_threshold: Command::saturating_from_bits(levels.disarming),
        arming_threshold: Command::saturating_from_bits(levels.arming),
        idle: Command::saturating_from_bits(levels.idle),
        max: Command::saturating_from_bits(motor.max),
        hold_ticks: ticks(u32::from(motor.hold_ms), rate),
        stop_pulse_ticks: ticks(u32::from(settings.stop_pulses_ms), rate),
        no_signal: settings.no_signal,
        excitation: ExcitationLimits {
            max_command: Command::saturating_from_bits(excitation.max_command),
            max_amplitude: Command::saturating_from_bits(excitation.max_amplitude),
            max_ticks: ticks(1000 * u32::from(excitation.max_duration_s), rate),
            dead_man_ticks: ticks(DEAD_MAN_MS, rate).max(1),
            arm_ticks: ticks(u32::from(excitation.arm_ms), rate),
            ramp_per_tick: Command::saturating_from_bits(per_tick.cast_signed()),
        },
    }
}

/// One channel for each motor; `None` when the limits of one contradict each other, which they do not once validated.
#[must_use]
pub fn channels(settings: &Validated, filters: [Filter; MOTORS]) -> Option<[Channel; MOTORS]> {
    let channel = |motor, filter| {
        let mut channel = Channel::new(&channel_settings(settings, motor), filter).ok()?;
        channel.set_enabled(settings.motors.get(motor)?.compensate);
        if let (CompensatorKind::Rpm, Some(speeds)) = (settings.compensator, settings.speeds.get(motor)?) {
            channel.set_correction(SpeedCorrection::new(speeds, settings.loop_rate_hz));
        }
        Some(channel)
    };
    let [a, b, c, d] = filters;
    Some([channel(0, a)?, channel(1, b)?, channel(2, c)?, channel(3, d)?])
}
