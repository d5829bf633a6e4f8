//! What arms a motor, what disarms it, and how slow it may turn: as chosen, or as the input's protocol has it.

use super::{MotorSettings, Settings, percent};
use crate::dshot::Value;

/// The levels of a motor, as commands in Q2.29: `stop < disarming <= arming <= idle`.
///
/// A pulse is a width that two clocks disagree on by some percent, so a stop is everything near the shortest one, and between
/// arming and disarming there is a gap that noise does not cross. A frame of DShot says stop or throttle itself: the lowest
/// throttle, 48, turns the motor, and everything below it does not. A flight controller's idle is above that (Betaflight's
/// `dshot_idle_value`, 3 to 5.5 %), and its dynamic idle goes down to it: a threshold of the controller's own in between would
/// stop a motor in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Levels {
    /// An armed motor disarms below this.
    pub disarming: i32,
    /// A disarmed motor arms from this on.
    pub arming: i32,
    /// The lowest output while armed.
    pub idle: i32,
}

impl Levels {
    /// Those of pulses: a stop of 1000 µs is still one from a clock that is 4 % off.
    pub const PULSES: Self = Self { disarming: percent(4), arming: percent(5), idle: percent(5) };
    /// Those of frames of DShot: none of the controller's own.
    pub const FRAMES: Self = {
        let lowest = Value::LOWEST_THROTTLE.command().to_bits();
        Self { disarming: lowest, arming: lowest, idle: lowest }
    };

    /// Of a motor whose input has frames, or pulses, and whose ESC stops at `stop`. What is not chosen gives way to what is.
    fn chosen_or_default(motor: &MotorSettings, has_frames: bool, stop: i32) -> Self {
        let default = if has_frames { Self::FRAMES } else { Self::PULSES };
        let disarming = motor.disarming.unwrap_or(default.disarming.max(stop.saturating_add(1)));
        let lowest_arming = if has_frames { disarming } else { default.arming };
        let arming = motor.arming.unwrap_or(default.arming.max(lowest_arming));
        let idle = motor.idle.unwrap_or(default.idle.max(arming));
        Self { disarming, arming, idle }
    }
}

impl Settings {
    /// The levels of a motor of these settings.
    #[must_use]
    pub fn levels(&self, motor: &MotorSettings) -> Levels {
        Levels::chosen_or_default(motor, self.has_frames(), self.stop)
    }
}

impl MotorSettings {
    /// Levels as an older layout stored them: those of pulses were what nobody had chosen.
    pub(super) fn with_levels(self, Levels { disarming, arming, idle }: Levels) -> Self {
        let chosen = |level, default| (level != default).then_some(level);
        Self {
            disarming: chosen(disarming, Levels::PULSES.disarming),
            arming: chosen(arming, Levels::PULSES.arming),
            idle: chosen(idle, Levels::PULSES.idle),
            ..self
        }
    }

    /// Whether any level is chosen.
    pub(super) const fn has_levels(&self) -> bool {
        self.disarming.is_some() || self.arming.is_some() || self.idle.is_some()
    }
}
