//! The names of the parameters, the same in errors, on the command line and in the documentation.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A parameter of [`Settings`](super::Settings).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Key {
    /// [`Settings::loop_rate_hz`](super::Settings::loop_rate_hz)
    LoopRateHz,
    /// [`Settings::compensator`](super::Settings::compensator)
    Compensator,
    /// [`Lead::omega_z_rad_s`](super::Lead::omega_z_rad_s)
    OmegaZRadS,
    /// [`Lead::omega_f_rad_s`](super::Lead::omega_f_rad_s)
    OmegaFRadS,
    /// [`Lead::damping`](super::Lead::damping)
    Damping,
    /// [`Inverse::natural_rad_s`](super::Inverse::natural_rad_s)
    InverseNaturalRadS,
    /// [`Inverse::damping`](super::Inverse::damping)
    InverseDamping,
    /// [`Inverse::compensate_from`](super::Inverse::compensate_from)
    InverseCompensateFrom,
    /// [`Inverse::compensate_to`](super::Inverse::compensate_to)
    InverseCompensateTo,
    /// The protocol of [`Settings::input`](super::Settings::input)
    InputProtocol,
    /// The frame rate of [`Settings::input`](super::Settings::input)
    InputFrameHz,
    /// The protocol of [`Settings::output`](super::Settings::output)
    OutputProtocol,
    /// The frame rate of [`Settings::output`](super::Settings::output)
    OutputFrameHz,
    /// [`Settings::slew_per_s`](super::Settings::slew_per_s)
    OutputSlewPerS,
    /// [`Settings::stop`](super::Settings::stop)
    Stop,
    /// [`Settings::no_signal`](super::Settings::no_signal)
    NoSignal,
    /// [`Settings::stop_pulses_ms`](super::Settings::stop_pulses_ms)
    StopPulsesMs,
    /// [`Settings::resume`](super::Settings::resume)
    Resume,
    /// [`MotorSettings::compensate`](super::MotorSettings::compensate)
    Compensate,
    /// [`MotorSettings::disarming`](super::MotorSettings::disarming)
    Disarming,
    /// [`MotorSettings::arming`](super::MotorSettings::arming)
    Arming,
    /// [`MotorSettings::idle`](super::MotorSettings::idle)
    Idle,
    /// [`MotorSettings::max`](super::MotorSettings::max)
    Max,
    /// [`MotorSettings::hold_ms`](super::MotorSettings::hold_ms)
    HoldMs,
    /// [`MotorSettings::curve`](super::MotorSettings::curve)
    TimeConstantS,
    /// [`Settings::speeds`](super::Settings::speeds)
    Erpm,
    /// [`ExcitationLimits::max_duration_s`](super::ExcitationLimits::max_duration_s)
    ExcitationMaxDurationS,
    /// [`ExcitationLimits::max_command`](super::ExcitationLimits::max_command)
    ExcitationMaxCommand,
    /// [`ExcitationLimits::max_amplitude`](super::ExcitationLimits::max_amplitude)
    ExcitationMaxAmplitude,
    /// [`ExcitationLimits::arm_ms`](super::ExcitationLimits::arm_ms)
    ExcitationArmMs,
    /// [`ExcitationLimits::ramp_ms`](super::ExcitationLimits::ramp_ms)
    ExcitationRampMs,
    /// [`Settings::recorder_divisor`](super::Settings::recorder_divisor)
    RecorderDivisor,
}

impl Key {
    /// Every key, in the order of the settings.
    pub const ALL: [Self; 32] = [
        Self::LoopRateHz,
        Self::Compensator,
        Self::OmegaZRadS,
        Self::OmegaFRadS,
        Self::Damping,
        Self::InverseNaturalRadS,
        Self::InverseDamping,
        Self::InverseCompensateFrom,
        Self::InverseCompensateTo,
        Self::InputProtocol,
        Self::InputFrameHz,
        Self::OutputProtocol,
        Self::OutputFrameHz,
        Self::OutputSlewPerS,
        Self::Stop,
        Self::NoSignal,
        Self::StopPulsesMs,
        Self::Resume,
        Self::Compensate,
        Self::Disarming,
        Self::Arming,
        Self::Idle,
        Self::Max,
        Self::HoldMs,
        Self::TimeConstantS,
        Self::Erpm,
        Self::ExcitationMaxDurationS,
        Self::ExcitationMaxCommand,
        Self::ExcitationMaxAmplitude,
        Self::ExcitationArmMs,
        Self::ExcitationRampMs,
        Self::RecorderDivisor,
    ];

    /// Its name, without the motor.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LoopRateHz => "loop_rate_hz",
            Self::Compensator => "compensator",
            Self::OmegaZRadS => "omega_z_rad_s",
            Self::OmegaFRadS => "omega_f_rad_s",
            Self::Damping => "damping",
            Self::InverseNaturalRadS => "inverse.natural_rad_s",
            Self::InverseDamping => "inverse.damping",
            Self::InverseCompensateFrom => "inverse.compensate_from",
            Self::InverseCompensateTo => "inverse.compensate_to",
            Self::InputProtocol => "input.protocol",
            Self::InputFrameHz => "input.frame_hz",
            Self::OutputProtocol => "output.protocol",
            Self::OutputFrameHz => "output.frame_hz",
            Self::OutputSlewPerS => "output.slew_per_s",
            Self::Stop => "stop",
            Self::NoSignal => "no_signal",
            Self::StopPulsesMs => "stop_pulses_ms",
            Self::Resume => "resume",
            Self::Compensate => "compensate",
            Self::Disarming => "disarming",
            Self::Arming => "arming",
            Self::Idle => "idle",
            Self::Max => "max",
            Self::HoldMs => "hold_ms",
            Self::TimeConstantS => "time_constant_s",
            Self::Erpm => "erpm",
            Self::ExcitationMaxDurationS => "excitation.max_duration_s",
            Self::ExcitationMaxCommand => "excitation.max_command",
            Self::ExcitationMaxAmplitude => "excitation.max_amplitude",
            Self::ExcitationArmMs => "excitation.arm_ms",
            Self::ExcitationRampMs => "excitation.ramp_ms",
            Self::RecorderDivisor => "recorder_divisor",
        }
    }

    /// Whether each motor has one.
    #[must_use]
    pub const fn is_of_a_motor(self) -> bool {
        matches!(
            self,
            Self::Compensate
                | Self::Disarming
                | Self::Arming
                | Self::Idle
                | Self::Max
                | Self::HoldMs
                | Self::TimeConstantS
                | Self::Erpm
        )
    }
}

/// A key, and the motor whose it is: `damping`, `motor.2.idle`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SettingId {
    /// The parameter.
    pub key: Key,
    /// The motor, from 0; `None` for parameters of the whole controller.
    pub motor: Option<u8>,
}

impl fmt::Display for SettingId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(motor) = self.motor {
            write!(f, "motor.{motor}.")?;
        }
        f.write_str(self.key.name())
    }
}
