//! What is measured of a motor on the vehicle or on a stand.

use rotorlead::dshot::LONGEST_TURN_US;
use rotorlead::settings::Settings;
use rotorlead_records::Output;

use super::DeviceError;

/// From the converter's counts to newtons: `(count - zero) * newtons_per_count`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The count without thrust.
    pub zero: f64,
    /// Newtons per count; negative when the sensor is turned around.
    pub newtons_per_count: f64,
}

impl Calibration {
    pub(super) fn thrust_n(self, count: i32) -> f64 {
        (f64::from(count) - self.zero) * self.newtons_per_count
    }
}

/// What measures the response of a motor, one or both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Of a thrust stand, where the motor is on one.
    pub thrust: Option<Calibration>,
    /// Magnets of the motor, where its speed is to be taken from the replies of its ESC (bidirectional DShot).
    pub motor_poles: Option<u8>,
    /// The highest speed that the motor may reach while the controller excites it, revolutions per minute.
    pub most_rpm: Option<f64>,
}

impl Sensors {
    /// The response of a record: the thrust where it is measured, else the speed.
    #[must_use]
    pub const fn output(&self) -> Output {
        if self.thrust.is_some() { Output::ThrustN } else { Output::Rpm }
    }

    /// Whether a controller with these settings can have them.
    ///
    /// # Errors
    /// [`DeviceError::Option`], where the speed is wanted of ESCs that are not asked for it.
    pub fn check(&self, settings: &Settings) -> Result<(), DeviceError> {
        if self.motor_poles.is_none() || settings.output.protocol.is_bidirectional() {
            return Ok(());
        }
        Err(DeviceError::Option {
            message: "--motor-poles takes the speed from the ESC's replies, and output.protocol has none".to_owned(),
            help: "`rotorlead device set output.protocol dshot300_bidirectional` where board and ESC speak it, or measure the thrust",
        })
    }
}

/// Revolutions per minute, of a rotor whose electrical turns take so long: `60e6 / (turn_us motor_poles / 2)`, 0 where it stands;
/// `None` where no reply says it.
pub(super) fn rpm(turn_us: i32, motor_poles: u8) -> Option<f64> {
    if turn_us <= 0 {
        return None;
    }
    let stands = turn_us >= i32::from(LONGEST_TURN_US);
    Some(if stands { 0.0 } else { 120e6 / (f64::from(turn_us) * f64::from(motor_poles)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_of_fourteen_poles_is_a_seventh_of_a_revolution() {
        assert_eq!(rpm(1000, 14), Some(60e6 / 7000.0));
        assert_eq!(rpm(1000, 2), Some(60_000.0));
        assert_eq!(rpm(65_408, 14), Some(0.0));
        // No reply, and one that no motor gives.
        assert_eq!((rpm(-1, 14), rpm(0, 14)), (None, None));
    }
}
