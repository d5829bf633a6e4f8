//! A flight: the closed loop, step by step, and its log.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::pilot::Pilot;
use crate::telemetry::reported_rpm;
use crate::vehicle::{GRAVITY, Vehicle};

/// Loops of the controller in a second.
pub const LOOP_RATE_HZ: f64 = 4000.0;
/// Steps of the physics in a loop.
const STEPS: usize = 2;
/// The least command: airmode's idle.
pub const IDLE: f64 = 0.055;
/// Steps of a command, as DShot has them.
const COMMANDS: f64 = 1999.0;
/// Roll, pitch and yaw of each motor.
const MIX: [[f64; 3]; 4] = [[-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]];

/// A log, and what it was made of.
#[derive(Clone, Debug)]
pub struct Flight {
    /// What flew.
    pub vehicle: Vehicle,
    /// Times of the rows, s.
    pub time_s: Vec<f64>,
    /// Commands of the motors, 0..1.
    pub commands: [Vec<f64>; 4],
    /// Speeds as reported, rpm.
    pub rpm: [Vec<f64>; 4],
    /// Supply voltage as logged, V.
    pub voltage_v: Option<Vec<f64>>,
    /// Rates that the pilot asked for, rad/s.
    pub rates: [Vec<f64>; 3],
    /// Throttle, 0..1.
    pub throttle: Vec<f64>,
    /// Mean of the supply voltage itself, V.
    pub mean_voltage_v: f64,
}

/// A standard normal number.
pub fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// One pole at a corner frequency.
#[derive(Clone, Copy, Default)]
struct LowPass(f64);

impl LowPass {
    fn pass(&mut self, value: f64, corner_hz: f64, step_s: f64) -> f64 {
        self.0 += (value - self.0) * (1.0 - (-TAU * corner_hz * step_s).exp());
        self.0
    }
}

/// A gust with a memory, unit RMS (Ornstein and Uhlenbeck).
#[derive(Clone, Copy, Default)]
struct Gust(f64);

impl Gust {
    fn blow(&mut self, memory_s: f64, step_s: f64, rng: &mut ChaCha8Rng) -> f64 {
        let part = step_s / memory_s;
        self.0 += -self.0 * part + (2.0 * part).sqrt() * gaussian(rng);
        self.0
    }
}

/// Filters and sums of one axis.
#[derive(Clone, Copy, Default)]
struct Axis {
    gyro: [LowPass; 2],
    slope: [LowPass; 2],
    before: f64,
    sum: f64,
}

impl Flight {
    /// Flies the vehicle of a seed.
    #[must_use]
    pub fn fly(seed: u64) -> Self {
        Self::with(Vehicle::draw(seed), seed)
    }

    /// Flies a vehicle.
    #[must_use]
    pub fn with(vehicle: Vehicle, seed: u64) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed ^ 0x5EED_F117);
        let loop_s = LOOP_RATE_HZ.recip();
        let step_s = loop_s / STEPS as f64;
        let loops = (vehicle.lasts_s * LOOP_RATE_HZ) as usize;
        let mut log = Self::empty(vehicle);
        let it = log.vehicle.clone();
        let mut pilot = Pilot::new(it.style, it.hover);
        let mut speeds = [0; 4].map(|_: i32| (it.mass * GRAVITY / 4.0 / it.motors[0].thrust).sqrt());
        let delay = (it.dead_time_s / step_s).round() as usize;
        let mut on_the_way: VecDeque<[f64; 4]> = vec![[it.hover; 4]; delay].into();
        let (mut rates, mut climb) = ([0.0; 3], 0.0);
        let mut axes = [Axis::default(); 3];
        let (mut common, mut own) = (Gust::default(), [[Gust::default(); 2]; 4]);
        let mut reported = speeds.map(reported_rpm);
        let mut voltage_v = it.open_voltage_v.0;
        let mut logged_voltage = voltage_v;
        let mut voltage_sum = 0.0;
        // Force and yaw torque of a unit of command, by which the controller is tuned.
        let slope = {
            let at = |u: f64| it.motors[0].steady_speed(u, it.open_voltage_v.0 * 0.97);
            let (low, high) = (at(it.hover - 0.02), at(it.hover + 0.02));
            (it.motors[0].thrust_n(high, 0.0) - it.motors[0].thrust_n(low, 0.0)) / 0.04
        };
        let yaw_slope = slope * it.motors[0].drag / it.motors[0].thrust;
        for count in 0..loops {
            let time_s = count as f64 * loop_s;
            let (asked, throttle) = pilot.fly(time_s, loop_s, climb, rng);
            let mut torque = [0.0; 3];
            for axis in 0..3 {
                let noisy = rates[axis] + it.gyro_noise * gaussian(rng);
                let state = &mut axes[axis];
                let mut rate = noisy;
                for filter in &mut state.gyro {
                    rate = filter.pass(rate, it.filters_hz.0, loop_s);
                }
                let mut change = (rate - state.before) / loop_s;
                state.before = rate;
                for filter in &mut state.slope {
                    change = filter.pass(change, it.filters_hz.1, loop_s);
                }
                let error = asked[axis] - rate;
                let gain = it.inertia[axis] / if axis == 2 { 4.0 * yaw_slope } else { 4.0 * it.arm * slope };
                let crossover = if axis == 2 { 0.5 } else { 1.0 } * it.crossover;
                state.sum = (state.sum + crossover / 6.0 * error * loop_s).clamp(-3.0, 3.0);
                let lead = if axis == 2 { 0.0 } else { 0.6 * it.hover_time_constant_s };
                torque[axis] = gain * crossover * (error + state.sum - lead * change);
            }
            let commands = mix(throttle, torque);
            if count % it.report_every == 0 {
                for motor in 0..4 {
                    if rng.random::<f64>() >= it.lost {
                        reported[motor] = reported_rpm(speeds[motor] * (1.0 + it.jitter * gaussian(rng)));
                    }
                }
            }
            if count % it.log_every == 0 {
                log.push(time_s, commands, reported, asked, throttle, logged_voltage);
            }
            for _ in 0..STEPS {
                on_the_way.push_back(commands);
                let applied = on_the_way.pop_front().unwrap_or(commands);
                let shared = it.gusts.0 * common.blow(0.8, step_s, rng);
                let (mut lift, mut moments) = (0.0, [0.0; 3]);
                let mut current = 0.0;
                for motor in 0..4 {
                    let [roll, pitch, yaw] = MIX[motor];
                    // Slow parts of a gust are as wide as the vehicle, fast ones are each rotor's own.
                    let [slow, fast] = &mut own[motor];
                    let gust = slow.blow(0.3, step_s, rng) + 0.5 * fast.blow(0.06, step_s, rng);
                    let wind = climb + shared + it.gusts.1 * gust + it.arm * (roll * rates[0] + pitch * rates[1]);
                    let its = &it.motors[motor];
                    let speed = speeds[motor];
                    let acceleration = its.acceleration(applied[motor], voltage_v, speed, wind);
                    let thrust = its.thrust_n(speed, wind);
                    lift += thrust;
                    moments[0] += roll * it.arm * thrust;
                    moments[1] += pitch * it.arm * thrust;
                    moments[2] += yaw * (its.drag_nm(speed, wind) + its.inertia * acceleration);
                    current += applied[motor] * its.current_a(applied[motor], voltage_v, speed);
                    speeds[motor] = (speed + acceleration * step_s).max(30.0);
                }
                for ((rate, moment), inertia) in rates.iter_mut().zip(moments).zip(it.inertia) {
                    *rate += (moment / inertia - 0.3 * *rate) * step_s;
                }
                climb += (lift / it.mass - GRAVITY - 0.25 * climb) * step_s;
                let part = time_s / it.lasts_s;
                let open_v = it.open_voltage_v.0 * (1.0 - part) + it.open_voltage_v.1 * part;
                // The leads' inductance and the ESCs' capacitors: half a millisecond.
                voltage_v += (open_v - it.battery_resistance * current - voltage_v) * step_s / 0.0005;
                voltage_sum += voltage_v;
            }
            logged_voltage += (voltage_v - logged_voltage) * loop_s / it.voltage_filter_s.unwrap_or(0.1);
        }
        log.mean_voltage_v = voltage_sum / (loops * STEPS) as f64;
        log
    }

    fn empty(vehicle: Vehicle) -> Self {
        let voltage_v = vehicle.voltage_filter_s.map(|_| Vec::new());
        let (commands, rpm, rates) = Default::default();
        let (time_s, throttle) = Default::default();
        Self { vehicle, time_s, commands, rpm, voltage_v, rates, throttle, mean_voltage_v: 0.0 }
    }

    fn push(&mut self, time_s: f64, commands: [f64; 4], rpm: [f64; 4], rates: [f64; 3], throttle: f64, voltage_v: f64) {
        self.time_s.push(time_s);
        for motor in 0..4 {
            self.commands[motor].push(commands[motor]);
            self.rpm[motor].push(rpm[motor]);
        }
        for (column, rate) in self.rates.iter_mut().zip(rates) {
            column.push(rate);
        }
        self.throttle.push(throttle);
        if let Some(logged) = &mut self.voltage_v {
            logged.push((voltage_v * 100.0).round() / 100.0);
        }
    }
}

/// Commands of the motors with the throttle moved, and the torques made smaller, where they do not fit, as airmode does.
fn mix(throttle: f64, torque: [f64; 3]) -> [f64; 4] {
    let mut parts = MIX.map(|mix| mix.iter().zip(torque).map(|(sign, part)| sign * part).sum::<f64>());
    let (low, high) = parts.iter().fold((0.0_f64, 0.0_f64), |(low, high), part| (low.min(*part), high.max(*part)));
    let room = 1.0 - IDLE;
    let fits = (room / (high - low).max(1e-9)).min(1.0);
    parts.iter_mut().for_each(|part| *part *= fits);
    let throttle = throttle.max(IDLE - low * fits).min(1.0 - high * fits);
    parts.map(|part| ((throttle + part).clamp(IDLE, 1.0) * COMMANDS).round() / COMMANDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_stays_up_and_is_the_same_each_time() {
        for seed in 0..4 {
            let flight = Flight::fly(seed);
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            let throttle = mean(&flight.commands[0]);
            assert!((throttle / flight.vehicle.hover - 1.0).abs() < 0.3, "{seed}: {throttle}");
            assert!(flight.commands.iter().flatten().all(|command| (IDLE..=1.0).contains(command)));
            assert_eq!(flight.rpm, Flight::fly(seed).rpm);
        }
    }
}
