//! The flight controller's own filters: the gyro's low-pass at 5 kHz and the PID at the controller's rate.

use std::f64::consts::{PI, SQRT_2, TAU};

use num_complex::Complex64;

/// A Butterworth low-pass of second order by Tustin's substitution, prewarped at its cut-off.
#[derive(Clone, Copy, Debug)]
pub struct GyroLowPass {
    rate_hz: f64,
    b: [f64; 3],
    /// Of the outputs before, signs as in the denominator.
    a: [f64; 2],
    state: [f64; 2],
}

impl GyroLowPass {
    /// A low-pass at rest at 0.
    #[must_use]
    pub fn new(cut_off_hz: f64, rate_hz: f64) -> Self {
        let k = (PI * cut_off_hz / rate_hz).tan();
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let b0 = k * k * scale;
        Self {
            rate_hz,
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (k * k - 1.0) * scale, (1.0 - SQRT_2 * k + k * k) * scale],
            state: [0.0; 2],
        }
    }

    /// One sample.
    pub fn update(&mut self, input: f64) -> f64 {
        let output = self.b[0] * input + self.state[0];
        self.state[0] = self.b[1] * input - self.a[0] * output + self.state[1];
        self.state[1] = self.b[2] * input - self.a[1] * output;
        output
    }

    /// Its response.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        let back = Complex64::cis(-omega_rad_s / self.rate_hz);
        let numerator = self.b[0] + back * (self.b[1] + back * self.b[2]);
        numerator / (1.0 + back * (self.a[0] + back * self.a[1]))
    }
}

/// Gains of the rate controller, whose output is an angular acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidGains {
    /// Proportional gain, 1/s.
    pub p_1_s: f64,
    /// Integral time, seconds.
    pub integral_time_s: f64,
    /// Derivative time, seconds.
    pub derivative_time_s: f64,
}

/// The rate controller `p (1 + 1 / (Ti s) + Td s / (1 + s / omega_d))` on the rate error: backward differences, and a D low-pass
/// with the continuous one's pole.
#[derive(Clone, Copy, Debug)]
pub struct Pid {
    gains: PidGains,
    period_s: f64,
    /// What the D low-pass takes of each difference.
    d_part: f64,
    integral: f64,
    derivative: f64,
    last_error: f64,
}

impl Pid {
    /// A controller at rest.
    #[must_use]
    pub fn new(gains: PidGains, d_low_pass_hz: f64, rate_hz: f64) -> Self {
        let d_part = -(-TAU * d_low_pass_hz / rate_hz).exp_m1();
        Self { gains, period_s: 1.0 / rate_hz, d_part, integral: 0.0, derivative: 0.0, last_error: 0.0 }
    }

    /// One tick: takes the rate error, rad/s, returns the angular acceleration that is asked for, rad/s2.
    ///
    /// `saturated` holds the integral: the last output was more than the motors can give.
    pub fn update(&mut self, error: f64, saturated: bool) -> f64 {
        if !saturated {
            self.integral += error * self.period_s / self.gains.integral_time_s;
        }
        let slope = (error - self.last_error) / self.period_s;
        self.derivative += self.d_part * (slope - self.derivative);
        self.last_error = error;
        self.gains.p_1_s * (error + self.integral + self.gains.derivative_time_s * self.derivative)
    }

    /// Its response.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        let back = Complex64::cis(-omega_rad_s * self.period_s);
        let integral = self.period_s / (self.gains.integral_time_s * (1.0 - back));
        let derivative = (1.0 - back) / self.period_s * self.d_part / (1.0 - back * (1.0 - self.d_part));
        self.gains.p_1_s * (1.0 + integral + self.gains.derivative_time_s * derivative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gyro_filter_has_3_db_at_its_cut_off_and_1_at_rest() {
        let filter = GyroLowPass::new(90.0, 5000.0);
        assert!((filter.response(TAU * 90.0).norm() - 0.5_f64.sqrt()).abs() < 1e-9);
        assert!((filter.response(1e-6) - 1.0).norm() < 1e-6);
        // Forty decibels per decade.
        let fall = filter.response(TAU * 450.0).norm();
        assert!((0.03..0.041).contains(&fall), "{fall}");
    }

    /// The response to a sine, by its fundamental over whole periods.
    fn seen(mut update: impl FnMut(f64) -> f64, omega_rad_s: f64, rate_hz: f64) -> Complex64 {
        let (mut input, mut output) = (Complex64::ZERO, Complex64::ZERO);
        for tick in 0..40_000 {
            let turn = Complex64::cis(omega_rad_s * f64::from(tick) / rate_hz);
            let y = update(turn.im);
            if tick >= 20_000 {
                input += turn.im * turn.conj();
                output += y * turn.conj();
            }
        }
        output / input
    }

    #[test]
    fn responses_are_those_of_the_code_that_runs() {
        let omega = TAU * 20.0;
        let filter = GyroLowPass::new(90.0, 5000.0);
        let mut running = filter;
        let found = seen(|x| running.update(x), omega, 5000.0);
        assert!((found / filter.response(omega) - 1.0).norm() < 1e-6, "{found}");
        let gains = PidGains { p_1_s: 40.0, integral_time_s: 0.3, derivative_time_s: 0.01 };
        let pid = Pid::new(gains, 60.0, 1000.0);
        let mut running = pid;
        let found = seen(|x| running.update(x, false), omega, 1000.0);
        // The integral of a sine from rest has an offset, which whole periods take out.
        assert!((found / pid.response(omega) - 1.0).norm() < 1e-6, "{found}");
    }

    #[test]
    fn a_held_integral_does_not_wind_up() {
        let gains = PidGains { p_1_s: 1.0, integral_time_s: 0.1, derivative_time_s: 0.0 };
        let mut pid = Pid::new(gains, 60.0, 1000.0);
        let held = (0..1000).map(|_| pid.update(1.0, true)).last().unwrap();
        assert_eq!(held, 1.0);
        assert!((0..100).map(|_| pid.update(1.0, false)).last().unwrap() > 1.9);
    }
}
