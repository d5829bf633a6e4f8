//! What a pilot asks for: rates about three axes, and a throttle that keeps the vehicle about where it is.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::flight::gaussian;

/// How a flight is flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Style {
    /// Hovering, with hardly a stick moved.
    Hover,
    /// Turning about, with moderate sticks.
    Cruise,
    /// Flips, and punches up to full throttle.
    Freestyle,
    /// Hovering, with chirps of the roll and the pitch rate.
    Chirp,
}

/// A pilot.
#[derive(Clone, Debug)]
pub struct Pilot {
    style: Style,
    hover: f64,
    targets: [f64; 3],
    rates: [f64; 3],
    angles: [f64; 2],
    climb: f64,
    punch_until: f64,
    throttle: f64,
}

impl Pilot {
    /// One who knows the throttle that hovers.
    #[must_use]
    pub fn new(style: Style, hover: f64) -> Self {
        let (targets, rates) = ([0.0; 3], [0.0; 3]);
        Self { style, hover, targets, rates, angles: [0.0; 2], climb: 0.0, punch_until: 0.0, throttle: hover }
    }

    /// Rates in rad/s and throttle at a moment, `step_s` after the last, from what the pilot sees: the climb in m/s.
    pub fn fly(&mut self, time_s: f64, step_s: f64, climb: f64, rng: &mut ChaCha8Rng) -> ([f64; 3], f64) {
        let (reach, per_s, punches_per_s, climbs) = match self.style {
            Style::Hover => (0.25, 0.7, 0.0, 0.5),
            Style::Chirp => (0.2, 0.4, 0.0, 0.4),
            Style::Cruise => (1.6, 1.4, 0.02, 2.0),
            Style::Freestyle => (5.0, 2.0, 0.12, 4.0),
        };
        for axis in 0..3 {
            if rng.random::<f64>() < per_s * step_s {
                let part = if axis == 2 { 0.4 } else { 1.0 };
                self.targets[axis] = part * reach * gaussian(rng);
            }
            // Level in the mean: a rate is held for a moment and then taken back.
            self.targets[axis] -= self.targets[axis] * step_s / 0.25;
            let level = if axis < 2 { -1.5 * self.angles[axis] } else { 0.0 };
            // A stick moves within some 60 ms, and the receiver's steps are smoothed.
            self.rates[axis] += (self.targets[axis] + level - self.rates[axis]) * step_s / 0.06;
        }
        for axis in 0..2 {
            self.angles[axis] += self.rates[axis] * step_s;
        }
        if rng.random::<f64>() < 0.5 * step_s {
            self.climb = climbs * gaussian(rng);
        }
        if rng.random::<f64>() < punches_per_s * step_s {
            self.punch_until = time_s + 0.25 + 0.5 * rng.random::<f64>();
        }
        let wanted = match time_s < self.punch_until {
            true => 0.75 + 0.25 * self.hover,
            false => self.hover * (1.0 + 0.12 * (self.climb - climb)).clamp(0.3, 2.2),
        };
        self.throttle += (wanted - self.throttle) * step_s / 0.08;
        let mut rates = self.rates;
        if self.style == Style::Chirp {
            let (first, second) = (sweep(time_s - 3.0), sweep(time_s - 26.0));
            rates[0] += first;
            rates[1] += second;
        }
        (rates, self.throttle)
    }
}

/// A chirp of 20 s, exponential from 0.3 to 60 Hz, in rad/s.
fn sweep(time_s: f64) -> f64 {
    const LASTS_S: f64 = 20.0;
    const FROM_HZ: f64 = 0.3;
    const TO_HZ: f64 = 60.0;
    if !(0.0..LASTS_S).contains(&time_s) {
        return 0.0;
    }
    let rate = (TO_HZ / FROM_HZ).ln() / LASTS_S;
    2.5 * (std::f64::consts::TAU * FROM_HZ * ((rate * time_s).exp() - 1.0) / rate).sin()
}
