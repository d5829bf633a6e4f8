//! Frequency responses of the roll axis at one operating point, and the margins of a loop.

use std::f64::consts::PI;

use num_complex::Complex64;
use rotorlead::design::BANDWIDTH_DROP_DB;
use serde::Serialize;

use crate::airframe::Airframe;
use crate::filters::{GyroLowPass, Pid, PidGains};
use crate::motor_control::MotorControl;
use crate::open_loop::{LoopCurve, OpenLoop};
use crate::rotor::Rotor;
use crate::{TICK_HZ, latency_ticks};

/// Frequencies per response. The loops here have no resonance: their sensitivity changes by less than 1 % from one to the next. Chosen: at
/// 1 kHz they are 2.4 % apart; fewer miss more of a peak, more take time.
const FREQUENCIES: usize = 400;
/// The lowest frequency, rad/s. Chosen: far below the corner of an integral time of 0.3 s, 3.3 rad/s, where the loop gain is so high that
/// nothing changes any more.
const LOWEST_RAD_S: f64 = 0.2;
/// The highest one as a part of the controller's Nyquist frequency. Chosen: at that frequency itself the gyro's filter in a controller of 5
/// kHz is zero and has no phase; what is left out has hardly any noise.
const HIGHEST_PART: f64 = 0.998;

/// What a loop has to keep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// Largest magnitude of the sensitivity; infinite where the loop is not stable, or only conditionally.
    pub max_sensitivity: f64,
    /// Smallest phase margin over all crossovers, degrees.
    pub phase_margin_deg: f64,
    /// Standard deviation of the ESC's command from the gyro's noise.
    pub actuator_noise: f64,
    /// Frequency at which the rate's response to its setpoint is 3 dB under that at rest, rad/s.
    pub bandwidth_rad_s: f64,
}

/// The roll axis at one operating point.
#[derive(Clone, Debug)]
pub struct PointResponse {
    omega_rad_s: Vec<f64>,
    /// From the acceleration that is asked for to the rate.
    plant: Vec<Complex64>,
    /// Of the gyro's low-pass.
    gyro: Vec<Complex64>,
    /// Magnitude from the acceleration that is asked for to the ESC's command.
    to_command: Vec<f64>,
    controller_rate_hz: f64,
    d_low_pass_hz: f64,
    /// rad/s per square root of hertz.
    noise_density: f64,
}

impl PointResponse {
    /// The axis with `actuator` at the hover command `nominal` and with `latency_s`, to
    /// which the dead time of the model is added.
    ///
    /// The chain is: command held for a period of the controller, latency, actuator at 5 kHz, lag of the rotor, and an integrator
    /// for the body. Images of the sampling are left out: at the lowest of them the chain is under a thousandth.
    #[must_use]
    pub fn new(airframe: &Airframe, rotor: &Rotor, actuator: &MotorControl, nominal: f64, latency_s: f64) -> Self {
        let controller = &airframe.controller;
        let (period_s, highest) = (1.0 / controller.rate_hz, HIGHEST_PART * PI * controller.rate_hz);
        let steps = (FREQUENCIES - 1) as f64;
        let omega_rad_s: Vec<f64> =
            (0..FREQUENCIES).map(|index| LOWEST_RAD_S * (highest / LOWEST_RAD_S).powf(index as f64 / steps)).collect();
        let latency_s = latency_ticks(latency_s + rotor.delay_s(nominal)) as f64 / TICK_HZ;
        let low_pass = GyroLowPass::new(controller.gyro_low_pass_hz, TICK_HZ);
        let pole = rotor.pole_rad_s(nominal);
        let roll = &airframe.roll;
        let per_acceleration = roll.inertia_kg_m2 / (f64::from(roll.motors) * roll.arm_m) / rotor.gain_n(nominal);
        let commands = omega_rad_s.iter().map(|&omega| actuator.response(omega, nominal, rotor));
        let commands: Vec<Complex64> = commands.collect();
        let plant = omega_rad_s.iter().zip(&commands).map(|(&omega, command)| {
            let half_turn = 0.5 * omega * period_s;
            let held = Complex64::cis(-half_turn - omega * latency_s) * (half_turn.sin() / half_turn);
            held * command / (Complex64::new(1.0, omega / pole) * Complex64::new(0.0, omega))
        });
        Self {
            plant: plant.collect(),
            gyro: omega_rad_s.iter().map(|&omega| low_pass.response(omega)).collect(),
            to_command: commands.iter().map(|command| command.norm() * per_acceleration).collect(),
            omega_rad_s,
            controller_rate_hz: controller.rate_hz,
            d_low_pass_hz: controller.d_low_pass_hz,
            noise_density: controller.gyro_noise_deg_s_sqrt_hz.to_radians(),
        }
    }

    /// The rate loop with a proportional gain of 1 and these times; any other gain only scales it.
    #[must_use]
    pub fn with_times(&self, integral_time_s: f64, derivative_time_s: f64) -> UnitLoop<'_> {
        let gains = PidGains { p_1_s: 1.0, integral_time_s, derivative_time_s };
        let pid = Pid::new(gains, self.d_low_pass_hz, self.controller_rate_hz);
        let controller: Vec<Complex64> = self.omega_rad_s.iter().map(|&omega| pid.response(omega)).collect();
        let forward: Vec<Complex64> = controller.iter().zip(&self.plant).map(|(c, plant)| c * plant).collect();
        let open: Vec<Complex64> = forward.iter().zip(&self.gyro).map(|(f, gyro)| f * gyro).collect();
        let noise = controller.iter().zip(&self.gyro).zip(&self.to_command);
        let noise = noise.map(|((c, gyro), to_command)| (c * gyro).norm() * to_command).collect();
        UnitLoop { point: self, open: OpenLoop::new(open), forward, noise }
    }

    /// The open rate loop with `gains`.
    #[must_use]
    pub fn open(&self, gains: PidGains) -> LoopCurve {
        self.with_times(gains.integral_time_s, gains.derivative_time_s).open.curve(&self.omega_rad_s, gains.p_1_s)
    }

    /// The margins of the rate loop with `gains`.
    #[must_use]
    pub fn margins(&self, gains: PidGains) -> Margins {
        self.with_times(gains.integral_time_s, gains.derivative_time_s).margins(gains.p_1_s)
    }
}

/// A rate loop of proportional gain 1.
#[derive(Clone, Debug)]
pub struct UnitLoop<'a> {
    point: &'a PointResponse,
    /// Controller and plant.
    forward: Vec<Complex64>,
    /// Gyro included.
    open: OpenLoop,
    /// Magnitude from the gyro's noise to the ESC's command with the loop open.
    noise: Vec<f64>,
}

impl UnitLoop<'_> {
    /// The margins with a proportional gain of `p_1_s`.
    #[must_use]
    pub fn margins(&self, p_1_s: f64) -> Margins {
        let omega = &self.point.omega_rad_s;
        let closed: Vec<Complex64> =
            self.forward.iter().zip(&self.open.response).map(|(f, open)| p_1_s * f / (1.0 + p_1_s * open)).collect();
        Margins {
            max_sensitivity: self.open.max_sensitivity(p_1_s),
            phase_margin_deg: self.open.phase_margin_deg(p_1_s),
            actuator_noise: self.actuator_noise(p_1_s),
            bandwidth_rad_s: bandwidth_rad_s(omega, &closed),
        }
    }

    /// Whether the loop keeps a largest sensitivity, a phase margin and a limit of the noise. The cheapest test comes first.
    #[must_use]
    pub fn keeps(&self, p_1_s: f64, max_sensitivity_is: f64, phase_margin_is_deg: f64, noise_is: f64) -> bool {
        self.open.is_stable_from_below(p_1_s)
            && self.open.phase_margin_deg(p_1_s) >= phase_margin_is_deg
            && self.open.max_sensitivity(p_1_s) <= max_sensitivity_is
            && self.actuator_noise(p_1_s) <= noise_is
    }

    /// Largest sensitivity of the attitude loop around this one, with the attitude gain `attitude_1_s`.
    #[must_use]
    pub fn attitude_sensitivity(&self, p_1_s: f64, attitude_1_s: f64) -> f64 {
        let all = self.forward.iter().zip(&self.open.response).zip(&self.point.omega_rad_s);
        let open: Vec<Complex64> =
            all.map(|((f, open), &omega)| p_1_s * f / (1.0 + p_1_s * open) / Complex64::new(0.0, omega)).collect();
        OpenLoop::new(open).max_sensitivity(attitude_1_s)
    }

    fn actuator_noise(&self, p_1_s: f64) -> f64 {
        let density = self.noise.iter().zip(&self.open.response);
        let density: Vec<f64> =
            density.map(|(noise, open)| (p_1_s * noise).powi(2) / (1.0 + p_1_s * open).norm_sqr()).collect();
        let omega = &self.point.omega_rad_s;
        let pieces = omega.windows(2).zip(density.windows(2));
        let pieces = pieces.map(|(omega, density)| 0.5 * (density[0] + density[1]) * (omega[1] - omega[0]));
        self.point.noise_density * (pieces.sum::<f64>() / (2.0 * PI)).sqrt()
    }
}

/// Where the magnitude first falls 3 dB below 1, interpolated in decibels; the last frequency where it does not.
fn bandwidth_rad_s(omega_rad_s: &[f64], closed: &[Complex64]) -> f64 {
    let level_db = |value: &Complex64| 20.0 * value.norm().log10() + BANDWIDTH_DROP_DB;
    let Some(below) = closed.iter().position(|value| level_db(value) < 0.0) else {
        return omega_rad_s[omega_rad_s.len() - 1];
    };
    let Some(above) = below.checked_sub(1) else { return omega_rad_s[0] };
    let (high, low) = (level_db(&closed[above]), level_db(&closed[below]));
    let part = high / (high - low);
    omega_rad_s[above] * (omega_rad_s[below] / omega_rad_s[above]).powf(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<f64> {
        (0..400).map(|index| 0.2 * 15_000_f64.powf(f64::from(index) / 399.0)).collect()
    }

    #[test]
    fn the_bandwidth_is_that_of_a_lag() {
        let omega = grid();
        let lag: Vec<Complex64> = omega.iter().map(|&w| 1.0 / Complex64::new(1.0, w / 50.0)).collect();
        let expected = 50.0 * (10_f64.powf(0.3) - 1.0).sqrt();
        assert!((bandwidth_rad_s(&omega, &lag) / expected - 1.0).abs() < 1e-3);
    }
}
