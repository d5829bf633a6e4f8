//! The roll axis in time: rate and attitude loop, and on each side of the axis a motor with its actuator.

use std::collections::VecDeque;

use crate::airframe::Airframe;
use crate::filters::{GyroLowPass, Pid};
use crate::motor_control::{MotorControl, MotorControlState};
use crate::rotor::Rotor;
use crate::tuning::Gains;
use crate::{TICK_HZ, latency_ticks};

/// What a settled response stays within, as a part of the step. Standard: the 2 % criterion (Ogata, Modern Control Engineering, section
/// 5-3).
const SETTLED_PART: f64 = 0.02;
/// How long a response is simulated, seconds. Chosen: more than twice the longest settling time of `docs/vehicle.md`, 1.8 s; what takes
/// longer counts as not settling.
const DURATION_S: f64 = 4.0;

/// The axis, ready to be simulated.
#[derive(Clone, Copy, Debug)]
pub struct RollAxis<'a> {
    /// The vehicle.
    pub airframe: &'a Airframe,
    /// Its motors.
    pub rotor: &'a Rotor,
    /// What stands before each ESC.
    pub actuator: &'a MotorControl,
    /// Hover command.
    pub nominal: f64,
    /// From the gyro's sample to the ESC's new command, seconds.
    pub latency_s: f64,
    /// The controller's gains.
    pub gains: Gains,
}

/// Angle and rate at every tick of 5 kHz.
#[derive(Clone, Debug, Default)]
pub struct RollTrajectory {
    /// Roll angle, radians.
    pub angle_rad: Vec<f64>,
    /// Roll rate, rad/s.
    pub rate_rad_s: Vec<f64>,
}

/// One side of the axis.
struct Side {
    running: MotorControlState,
    /// State of its rotors.
    v: f64,
}

impl RollAxis<'_> {
    /// The motion from rest for `duration_s`. `rate_setpoint` gives the rate setpoint, rad/s, at a time and an angle;
    /// `disturbance` the disturbance torque, N m, at a time.
    #[must_use]
    pub fn motion(
        &self,
        duration_s: f64,
        rate_setpoint: impl Fn(f64, f64) -> f64,
        disturbance: impl Fn(f64) -> f64,
    ) -> RollTrajectory {
        let (controller, roll) = (&self.airframe.controller, &self.airframe.roll);
        let range = (self.airframe.actuators.min, self.airframe.actuators.max);
        let tick_s = 1.0 / TICK_HZ;
        let per_control = (TICK_HZ / controller.rate_hz).round() as usize;
        let hover_n = self.rotor.thrust_n(self.nominal);
        let (least_n, most_n) = (self.rotor.thrust_n(range.0), self.rotor.thrust_n(range.1));
        let thrust_per_acceleration = roll.inertia_kg_m2 / (f64::from(roll.motors) * roll.arm_m);
        let arm_sum_m = 0.5 * f64::from(roll.motors) * roll.arm_m;

        let latency_s = self.latency_s + self.rotor.delay_s(self.nominal);
        let mut pid = Pid::new(self.gains.rate(), controller.d_low_pass_hz, controller.rate_hz);
        let mut low_pass = GyroLowPass::new(controller.gyro_low_pass_hz, TICK_HZ);
        let side = || Side { running: self.actuator.started(self.nominal), v: self.nominal };
        let mut sides = [side(), side()];
        let mut waiting: VecDeque<[f64; 2]> = vec![[self.nominal; 2]; latency_ticks(latency_s)].into();
        let mut commands = [self.nominal; 2];
        let (mut angle, mut rate, mut is_saturated) = (0.0, 0.0, false);
        let mut motion = RollTrajectory::default();
        for tick in 0..(duration_s * TICK_HZ).round() as usize {
            let time_s = tick as f64 * tick_s;
            let measured = low_pass.update(rate);
            if tick.is_multiple_of(per_control) {
                let acceleration = pid.update(rate_setpoint(time_s, angle) - measured, is_saturated);
                let thrusts = [1.0, -1.0].map(|sign| hover_n + sign * acceleration * thrust_per_acceleration);
                is_saturated = thrusts.iter().any(|thrust| !(least_n..=most_n).contains(thrust));
                commands = thrusts.map(|thrust| self.rotor.command_for(thrust, range));
            }
            waiting.push_back(commands);
            let arrived = waiting.pop_front().unwrap_or(commands);
            let torque = |sides: &[Side; 2]| {
                arm_sum_m * (self.rotor.thrust_n(sides[0].v) - self.rotor.thrust_n(sides[1].v)) + disturbance(time_s)
            };
            let before = torque(&sides);
            for (side, input) in sides.iter_mut().zip(arrived) {
                let output = side.running.update(input, side.v);
                side.v = self.rotor.advanced(side.v, output, tick_s);
            }
            let acceleration = 0.5 * (before + torque(&sides)) / roll.inertia_kg_m2;
            angle += tick_s * (rate + 0.5 * acceleration * tick_s);
            rate += acceleration * tick_s;
            motion.angle_rad.push(angle);
            motion.rate_rad_s.push(rate);
        }
        motion
    }

    /// The response for `duration_s` to the airframe's step of the disturbance torque, the attitude setpoint being level.
    #[must_use]
    pub fn disturbed(&self, duration_s: f64) -> RollTrajectory {
        let attitude_p = self.gains.attitude_p_1_s;
        self.motion(duration_s, |_, angle| -attitude_p * angle, |_| self.airframe.roll.disturbance_n_m)
    }

    /// Settling time of the airframe's step of the attitude setpoint, seconds: from then on the angle stays within 2 % of the step;
    /// `None` where it does not within the simulated time.
    #[must_use]
    pub fn settling_s(&self) -> Option<f64> {
        let (attitude_p, step_rad) = (self.gains.attitude_p_1_s, self.airframe.roll.step_deg.to_radians());
        let motion = self.motion(DURATION_S, |_, angle| attitude_p * (step_rad - angle), |_| 0.0);
        settling_s(&motion.angle_rad, step_rad, SETTLED_PART * step_rad)
    }
}

/// When a response, one value per tick, last comes within `band` of `target`.
fn settling_s(response: &[f64], target: f64, band: f64) -> Option<f64> {
    let outside = response.iter().rposition(|value| (value - target).abs() > band);
    match outside {
        Some(last) if last + 1 == response.len() => None,
        Some(last) => Some((last + 1) as f64 / TICK_HZ),
        None => Some(0.0),
    }
}

/// The largest magnitude of an angle, degrees.
#[must_use]
pub fn peak_deg(motion: &RollTrajectory) -> f64 {
    motion.angle_rad.iter().fold(0.0, |most: f64, angle| most.max(angle.abs())).to_degrees()
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;
    use rotorlead_plant::testing::table_1;

    use super::*;
    use crate::motor_control::designed;
    use crate::response::PointResponse;
    use crate::tuning::{TuningRule, tuned};

    /// Every actuator of the default vehicle at hover, with its gains.
    fn each(check: impl Fn(&RollAxis<'_>)) {
        let (airframe, rotor) = (Airframe::default(), Rotor::new(&table_1()).unwrap());
        for actuator in designed(&airframe, &table_1(), &rotor).unwrap().iter().map(|one| one.as_ref().unwrap()) {
            let (nominal, latency_s) = (0.5, 0.002);
            let point = PointResponse::new(&airframe, &rotor, actuator, nominal, latency_s);
            let gains = tuned(&[point], 0.3, true, &TuningRule::default()).unwrap();
            check(&RollAxis { airframe: &airframe, rotor: &rotor, actuator, nominal, latency_s, gains });
        }
    }

    #[test]
    fn the_simulated_bandwidth_is_the_predicted_one() {
        each(|axis| {
            let point = PointResponse::new(axis.airframe, axis.rotor, axis.actuator, axis.nominal, axis.latency_s);
            let omega = point.margins(axis.gains.rate()).bandwidth_rad_s;
            let amplitude = 1e-3;
            let motion = axis.motion(3.0, |time_s, _| amplitude * (omega * time_s).sin(), |_| 0.0);
            let settled = 5000;
            let line: Complex64 = motion.rate_rad_s[settled..]
                .iter()
                .enumerate()
                // The rate after a tick is that at its end.
                .map(|(k, rate)| rate * Complex64::cis(-omega * (settled + k + 1) as f64 / TICK_HZ))
                .sum();
            let gain = line.norm() * 2.0 / (motion.rate_rad_s.len() - settled) as f64 / amplitude;
            let level_db = 20.0 * gain.log10();
            assert!((level_db + 3.0).abs() < 0.15, "{:?}: {level_db} dB at {omega} rad/s", axis.actuator.kind);
        });
    }

    /// At rest the integral holds the disturbance: `p / Ti` times the integral of the rate error, which is that of the angle times the
    /// attitude gain. So the angle's integral is `d / J * Ti / (p attitude_p)`, whatever the actuator does on the way.
    #[test]
    fn the_integral_of_the_disturbed_angle_is_what_the_gains_say() {
        each(|axis| {
            let (roll, gains) = (&axis.airframe.roll, &axis.gains);
            let attitude_p = gains.attitude_p_1_s;
            let motion = axis.motion(8.0, |_, angle| -attitude_p * angle, |_| 0.1 * roll.disturbance_n_m);
            let found = motion.angle_rad.iter().sum::<f64>() / TICK_HZ;
            let torque = 0.1 * roll.disturbance_n_m / roll.inertia_kg_m2;
            let expected = torque * gains.integral_time_s / (gains.rate_p_1_s * attitude_p);
            assert!((found / expected - 1.0).abs() < 0.01, "{:?}: {found} is not {expected}", axis.actuator.kind);
        });
    }

    #[test]
    fn a_simulation_repeats_bit_for_bit_and_rests_without_a_disturbance() {
        each(|axis| {
            assert_eq!(axis.disturbed(DURATION_S).angle_rad, axis.disturbed(DURATION_S).angle_rad);
            let motion = axis.motion(0.5, |_, angle| -axis.gains.attitude_p_1_s * angle, |_| 0.0);
            // The step of the inverse's output is 2^-16.
            assert!(peak_deg(&motion) < 1e-3, "{:?}: {}", axis.actuator.kind, peak_deg(&motion));
        });
    }

    #[test]
    fn settling_is_the_last_entry_into_the_band() {
        let response = [0.0, 0.5, 1.2, 0.97, 0.9, 0.98, 1.0, 1.0];
        assert_eq!(settling_s(&response, 1.0, 0.05), Some(5.0 / TICK_HZ));
        assert_eq!(settling_s(&response[..5], 1.0, 0.05), None);
    }
}
