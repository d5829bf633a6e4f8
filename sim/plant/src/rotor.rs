//! The rotor where it is no linear lag: what effects do to it, and to what it is fed.

use super::{OperatingCurve, OperatingPoint};

/// What the rotor would do without any effect: the steady response and the time constant of every command.
#[derive(Clone, Debug)]
pub enum RotorBase {
    /// The linear model around one command.
    Linear(OperatingPoint),
    /// The numbers of the command of the moment.
    Level(OperatingCurve),
    /// The numbers of the rotor's own speed `v`, as a command: `dv/dt = (u - v) / tau(v)`, and the steady response of `v`.
    Speed(OperatingCurve),
}

impl RotorBase {
    /// Steady response at `command`, and the gain and time constant there.
    #[must_use]
    pub fn at(&self, command: f64) -> OperatingPoint {
        match self {
            Self::Linear(point) => {
                let response = point.response + point.lag.gain * (command - point.nominal);
                OperatingPoint { nominal: command, response, lag: point.lag }
            }
            Self::Level(curve) | Self::Speed(curve) => curve.clamped_at(command),
        }
    }

    /// Multiplies gains and steady responses, and time constants.
    pub(super) fn scale(&mut self, gain: f64, time_constant: f64) {
        match self {
            Self::Linear(point) => {
                point.lag.gain *= gain;
                point.lag.time_constant_s *= time_constant;
            }
            Self::Level(curve) | Self::Speed(curve) => curve.scale(gain, time_constant),
        }
    }

    /// The command for which the numbers at `command` were found: the nominal one, or that of the model's range next to it.
    /// What an effect adds to the linear model counts from here.
    #[must_use]
    pub fn anchor(&self, command: f64) -> f64 {
        match self {
            Self::Linear(point) => point.nominal,
            Self::Level(curve) | Self::Speed(curve) => {
                let (from, to) = curve.range();
                command.clamp(from, to)
            }
        }
    }

    /// The command at which the supply has the voltage for which the model holds: the nominal command, or none (open
    /// circuit) for a model that spans a range.
    #[must_use]
    pub fn reference_supply_command(&self) -> f64 {
        match self {
            Self::Linear(point) => point.nominal,
            Self::Level(_) | Self::Speed(_) => 0.0,
        }
    }
}

/// What the rotor does in a moment. Effects change it, in their order.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// The command that drives it, 0..1.
    pub drive: f64,
    /// Its speed as the command that would keep it there.
    pub speed: f64,
    /// The command to which the base model's numbers belong; see [`RotorBase::anchor`].
    pub anchor: f64,
    /// One over the time constant.
    pub rate_per_s: f64,
}

/// Voltage and current of the supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Volts.
    pub voltage_v: f64,
    /// Amperes.
    pub current_a: f64,
}

/// An effect on the rotor itself, or on what it is fed. What a kind does not touch it leaves at these defaults.
pub trait RotorEffect: Send {
    /// The effect's own state at rest, where the command is `motion.drive`; sets `motion.drive` to what drives the rotor then.
    fn at_rest(&self, _motion: &mut Motion) -> f64 {
        0.0
    }

    /// How fast the effect's own state moves, per second; sets `motion.drive` to what the supply makes of it.
    fn state_derivative(&self, _own: f64, _motion: &mut Motion) -> f64 {
        0.0
    }

    /// What the static map adds to the command at a `deviation` from the anchor, ahead of the lag.
    fn input_nonlinearity(&self, _deviation: f64) -> f64 {
        0.0
    }

    /// The same behind the lag, at a deviation of the speed.
    fn output_nonlinearity(&self, _deviation: f64) -> f64 {
        0.0
    }

    /// Sets `motion.rate_per_s`.
    fn pace(&self, _motion: &mut Motion) {}

    /// For how long what was shows in the effect's own state, seconds.
    fn memory_s(&self) -> f64 {
        0.0
    }

    /// What the effect knows of the supply.
    fn measured(&self, _own: f64, _motion: &Motion) -> Option<Supply> {
        None
    }
}
