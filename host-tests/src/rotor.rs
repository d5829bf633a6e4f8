//! A rotor whose ESC says its speed.

use rotorlead::dshot::Reply;

/// Magnets of its motor.
pub const POLES: f64 = 14.0;
/// Scatter of a turn's time, from end to end: the magnets are not alike, and the air is not still.
const UNEVEN: f64 = 0.01;
/// Thrust over the square of the speed, newtons at 1 rpm: 4 N at 11 000.
const NEWTONS: f64 = 3.3e-8;

/// A rotor that follows its command with this lag, in seconds at the speed of a command of 0.5, and with less at higher ones.
#[derive(Clone, Copy, Debug)]
pub struct Rotor {
    /// The lag, seconds.
    pub time_constant_s: f64,
    /// Its speed over that with its propeller.
    pub faster: f64,
    /// Until when its ESC answers, seconds.
    pub answers_until_s: f64,
}

impl Rotor {
    /// One that answers, with its propeller.
    #[must_use]
    pub const fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, faster: 1.0, answers_until_s: f64::INFINITY }
    }

    /// Its lag at a speed.
    #[must_use]
    pub fn time_constant_s(self, rpm: f64) -> f64 {
        self.time_constant_s * (self.rpm(0.5) / rpm.max(1000.0)).sqrt()
    }

    /// Revolutions per minute in steady state at a command.
    #[must_use]
    pub fn rpm(self, command: f64) -> f64 {
        self.faster * (2_000.0 + 18_000.0 * command)
    }

    /// The rotor at rest.
    #[must_use]
    pub const fn at_rest(self) -> TurningRotor {
        TurningRotor { rotor: self, rpm: 0.0, seen_rpm: 0.0, time_s: 0.0, seed: 0x2545_f491_4f6c_dd1d }
    }
}

/// A rotor with its speed.
#[derive(Clone, Debug)]
pub struct TurningRotor {
    rotor: Rotor,
    rpm: f64,
    /// With its scatter.
    seen_rpm: f64,
    time_s: f64,
    seed: u64,
}

impl TurningRotor {
    /// What its ESC says at a time up to which it got this command; `None` where it is silent.
    pub fn run(&mut self, command: f64, time_s: f64) -> Option<Reply> {
        let settled = self.rotor.rpm(command);
        let part = (-(time_s - self.time_s) / self.rotor.time_constant_s(self.rpm)).exp();
        (self.rpm, self.time_s) = (settled + (self.rpm - settled) * part, time_s);
        // Marsaglia, Xorshift RNGs, 2003.
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 7;
        self.seed ^= self.seed << 17;
        self.seen_rpm = self.rpm * (1.0 + UNEVEN * (self.seed as f64 / u64::MAX as f64 - 0.5));
        let period_us = (120e6 / (POLES * f64::max(self.seen_rpm, 1.0))) as u32;
        (time_s < self.rotor.answers_until_s).then(|| Reply::from_period_us(Some(period_us)))
    }

    /// Its thrust by then.
    #[must_use]
    pub fn newtons(&self) -> f64 {
        NEWTONS * self.seen_rpm * self.seen_rpm
    }
}
