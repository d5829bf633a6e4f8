//! What sinusoids of a given size find: the response of the whole simulated chain, with the controller's own filter in
//! front, its loop and the ESC's frames.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix4, Vector4};
use num_complex::Complex64;
use rotorlead::throttle::Command;
use rotorlead_plant::{Actuator, CompensatorDesign, EscTiming, FilterDesign, Law, Model, PlantError};
use serde::Serialize;

use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, MINUS_3_DB};

/// The search begins at this part of the pole. Derived: a lag there is 0.04 dB and 6 degrees behind, far from both bandwidths.
const FIRST_OF_POLE: f64 = 0.1;
/// Factor from one frequency to the next. Chosen: some 33 from a tenth of the pole to ten times it; far coarser, a phase may turn by more
/// than half a turn between two, and finer costs time.
const FACTOR: f64 = 1.15;
/// Halvings of the last bracket. Derived: its middle is then within 15 % / 128 = 0.1 % of the bandwidth.
const HALVINGS: usize = 6;
/// A sinusoid at this part of the pole is as good as at rest. Derived: `1 / sqrt(1 + 0.02^2)` is 2e-4 below one.
const STATIC_OF_POLE: f64 = 0.02;
/// Before the fit: so many time constants, and at least one period. Derived: `e^-12`, 6e-6 of the start, is left.
const LEAD_IN: f64 = 12.0;
/// The fit is over the first whole number of periods that last this many time constants: around a sinusoid whose two halves are not
/// followed alike, the mean settles as slowly as that, and a shorter fit is off by a percent.
const FITTED: f64 = 10.0;
/// Ticks of the loop for which a sinusoid is followed, at most. Chosen: some seconds of work, and at 5 kHz a lag of six seconds at the
/// slowest sinusoid.
const MOST_TICKS: f64 = 2e7;
/// Rows of a period, at least; more are left out. Derived: harmonics below the 39th are not aliased to the fundamental.
const ROWS_PER_PERIOD: f64 = 40.0;

/// One nominal command, driven by sinusoids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep<'a> {
    /// What is driven, with its effects.
    pub model: &'a Model,
    /// The filter, and its loop's rate.
    pub design: &'a CompensatorDesign,
    /// Frames of the ESC per second.
    pub esc_frame_hz: Option<f64>,
    /// Command around which it is driven.
    pub nominal: f64,
    /// Peak deviation of the command ahead of the filter.
    pub amplitude: f64,
    /// Of the lag there, seconds.
    pub time_constant_s: f64,
    /// Voltage of the supply over that of the model: what the rotor gets of a command.
    pub supply: f64,
}

/// Where the response of the chain falls behind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChainBandwidth {
    /// 3 dB under the static value.
    #[serde(rename = "chain_rad_s")]
    pub magnitude: Bandwidth,
    /// A quarter of a turn late: 90 degrees of phase lag.
    #[serde(rename = "chain_phase_rad_s")]
    pub phase: Bandwidth,
}

/// Both bandwidths, and the largest response over the static one on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Swept {
    pub bandwidth: ChainBandwidth,
    pub peak: f64,
}

impl Sweep<'_> {
    /// Both bandwidths, searched up to `limit_rad_s`. `gain` is the static value, response units per unit of command.
    ///
    /// # Errors
    /// [`PlantError`] when the model cannot be simulated at this command.
    pub fn bandwidth(&self, gain: f64, limit_rad_s: f64) -> Result<ChainBandwidth, PlantError> {
        Ok(self.swept(gain, limit_rad_s)?.bandwidth)
    }

    /// The same over the response to the slowest sinusoid, where the static value of the simulated actuator is not known.
    ///
    /// # Errors
    /// As [`Self::bandwidth`].
    pub fn over_static(&self, limit_rad_s: f64) -> Result<Swept, PlantError> {
        let gain = self.response(STATIC_OF_POLE / self.time_constant_s)?.norm();
        self.swept(gain, limit_rad_s)
    }

    fn swept(&self, gain: f64, limit_rad_s: f64) -> Result<Swept, PlantError> {
        let beyond = Bandwidth::Beyond(limit_rad_s);
        let mut found = ChainBandwidth { magnitude: beyond, phase: beyond };
        let mut peak = 1.0_f64;
        let (mut low, mut phase) = (0.0, 0.0);
        let mut omega = (FIRST_OF_POLE / self.time_constant_s).min(limit_rad_s);
        loop {
            let here = self.response(omega)? / gain;
            peak = peak.max(here.norm());
            let late = |response: Complex64, from: f64| {
                let angle = response.arg();
                angle - TAU * ((angle - from) / TAU).round()
            };
            let before = phase;
            phase = late(here, before);
            if found.magnitude == beyond && here.norm() < MINUS_3_DB {
                found.magnitude = self.between(low, omega, |response| (response / gain).norm() < MINUS_3_DB)?;
            }
            if found.phase == beyond && phase < -FRAC_PI_2 {
                found.phase = self.between(low, omega, |response| late(response / gain, before) < -FRAC_PI_2)?;
            }
            if omega >= limit_rad_s || (found.magnitude != beyond && found.phase != beyond) {
                return Ok(Swept { bandwidth: found, peak });
            }
            low = omega;
            omega = (omega * FACTOR).min(limit_rad_s);
        }
    }

    fn between(
        &self,
        mut low: f64,
        mut high: f64,
        is_behind: impl Fn(Complex64) -> bool,
    ) -> Result<Bandwidth, PlantError> {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if is_behind(self.response(middle)?) { high = middle } else { low = middle }
        }
        Ok(Bandwidth::At(0.5 * (low + high)))
    }

    /// Fundamental of the response over that of the command ahead of the filter, by least squares on a constant, a straight
    /// line (what is slower than the sinusoid), cosine and sine.
    fn response(&self, omega_rad_s: f64) -> Result<Complex64, PlantError> {
        let timing = EscTiming { frame_hz: self.esc_frame_hz, frame_phase: 0.0 };
        let law = match self.design.kind {
            FilterDesign::Lead(_) if self.supply == 1.0 => Law::LinearAround(self.nominal),
            _ => Law::FollowingSpeed(self.supply * self.nominal),
        };
        let mut actuator = Actuator::new(self.model, law, timing)?;
        let mut filter = self.design.running(Command::saturating_from_f64(self.nominal));
        let rate_hz = self.design.loop_rate_hz();
        let period_s = TAU / omega_rad_s;
        let from = (period_s.max(LEAD_IN * self.time_constant_s) * rate_hz).ceil() as u64;
        let periods = (FITTED * self.time_constant_s / period_s).ceil();
        let rows = (periods * period_s * rate_hz).ceil() as u64;
        let ticks = (from + rows) as f64;
        if ticks > MOST_TICKS {
            return Err(PlantError::Work { work: "a sinusoid", ticks, most: MOST_TICKS });
        }
        let every = ((period_s * rate_hz / ROWS_PER_PERIOD) as u64).max(1);
        let mut matrix = Matrix4::zeros();
        let mut sides = Vector4::zeros();
        for tick in 0..from + rows {
            let time_s = tick as f64 / rate_hz;
            let angle = omega_rad_s * time_s;
            if tick >= from && (tick - from).is_multiple_of(every) {
                let line = (tick - from) as f64 / rows as f64 - 0.5;
                let row = Vector4::new(1.0, line, angle.cos(), angle.sin());
                matrix += row * row.transpose();
                sides += row * actuator.response();
            }
            let command = Command::saturating_from_f64(self.nominal + self.amplitude * angle.sin());
            actuator.advance(self.supply * filter.update(command).to_f64(), (tick + 1) as f64 / rate_hz);
        }
        let fitted = matrix.cholesky().map_or(Vector4::zeros(), |matrix| matrix.solve(&sides));
        // b sin + a cos = Im (b + j a) e^(j angle), and the command is Im amplitude e^(j angle).
        Ok(Complex64::new(fitted[3], fitted[2]) / self.amplitude)
    }

    /// A sampled chain has no response of its own above half its slower rate.
    pub fn highest_rad_s(&self) -> f64 {
        let rate_hz = self.design.loop_rate_hz();
        PI * self.esc_frame_hz.map_or(rate_hz, |frame_hz| frame_hz.min(rate_hz))
    }
}
