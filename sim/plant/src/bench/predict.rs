//! What an estimate from a run of the bench should find.

use nalgebra::Complex;

use super::run::check_compensator;
use super::{BenchError, Plan};
use crate::{
    CompensatorDesign, Lag, Model, OperatingCurve, SAME_MOMENT_FRAMES, frames_per_pattern, hold_response_at_phase,
};

/// The longest pattern of ticks, frames and rows, in ticks, that [`Prediction::response_at_rows`] follows. Chosen: 20 s at 5 kHz, twice a
/// period of the multisines; longer patterns look like none to them, and time goes with the length.
const LONGEST_PATTERN_TICKS: f64 = 1e5;

/// The noise-free response of the sampled, quantised system around one nominal command, in two forms.
///
/// [`Prediction::response`] is the mean response of the continuous output:
///
/// ```text
/// H(e^(j omega T))  x  hold of loop and ESC frame  x  gain e^(-j omega delay) / (1 + j omega time_constant)
/// ```
///
/// with `H` the compensator with its rounded coefficients, for small signals around the nominal command (1 without one), the mean response of the holds
/// ([`hold_response`](crate::hold_response)) and the plant of paper eq. (1).
///
/// [`Prediction::response_at_rows`] is what the transfer function estimate from a periodic record in steady state
/// finds: the same, plus the images of the holds that the rows fold onto the line. On the paper's bench with rows at
/// 1 kHz the two differ by 4e-4 at 29.9 Hz and 1e-3 at 44.9 Hz, and by less at lower ones; most
/// of it comes from 3 kHz, the first multiple of both frames and rows.
///
/// Both hold while no command is clipped. They leave out the rounding of commands and of the section's state, 2^-29.
#[derive(Clone, Debug)]
pub struct Prediction {
    compensator: Option<CompensatorDesign>,
    nominal: f64,
    command_rate_hz: f64,
    ticks_per_row: f64,
    esc_frame_hz: Option<f64>,
    esc_frame_phase: f64,
    lag: Lag,
}

impl Prediction {
    /// The prediction for the records of `plan` around `nominal`, on the actuator of `model`, with the compensator that
    /// the plan names.
    ///
    /// # Errors
    /// [`BenchError`] when plan, model and compensator do not go together, or the model has no points around `nominal`.
    pub fn new(
        plan: &Plan,
        model: &Model,
        nominal: f64,
        compensator: Option<&CompensatorDesign>,
    ) -> Result<Self, BenchError> {
        plan.check()?;
        check_compensator(plan, compensator)?;
        Ok(Self {
            compensator: compensator.cloned(),
            nominal,
            command_rate_hz: f64::from(plan.loop_rate_hz),
            ticks_per_row: f64::from(plan.loop_rate_hz) / f64::from(plan.sample_rate_hz),
            esc_frame_hz: plan.esc_frame_hz,
            esc_frame_phase: plan.esc_frame_phase,
            lag: OperatingCurve::around(model, nominal)?.lag,
        })
    }

    /// Mean response at `omega_rad_s`: newtons (or revolutions per minute) per unit of command.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex<f64> {
        self.compensator_response(omega_rad_s)
            * hold_response_at_phase(self.command_rate_hz, self.esc_frame_hz, self.esc_frame_phase, omega_rad_s)
            * self.lag.frequency_response(omega_rad_s)
    }

    /// Response at `omega_rad_s` as the rows see it, in the same unit.
    ///
    /// Ticks, frames and rows repeat as a pattern of `P` seconds. So in steady state `x(t + P) = e^(j omega P) x(t)`,
    /// which gives the state `x` of the lag at the first frame; from there it is followed in closed form from frame
    /// to frame. The response is the mean of `y(t) e^(-j omega t)` over the rows of a pattern. A pattern of more than
    /// 100 000 ticks is taken for none: rows then see no image at a fixed phase, and this is
    /// [`Prediction::response`].
    #[must_use]
    pub fn response_at_rows(&self, omega_rad_s: f64) -> Complex<f64> {
        let ticks_per_frame = self.esc_frame_hz.map_or(1.0, |frame_hz| self.command_rate_hz / frame_hz);
        let mut frames = frames_per_pattern(ticks_per_frame);
        // Until whole rows fit in: rows are whole numbers of ticks, so that is at most ticks_per_row times as many.
        let pattern = (ticks_per_frame * frames).round();
        let repeats = (1..).map(f64::from).find(|n| pattern * n % self.ticks_per_row == 0.0).unwrap_or(1.0);
        frames *= repeats;
        let ticks = pattern * repeats;
        if ticks > LONGEST_PATTERN_TICKS {
            return self.response(omega_rad_s);
        }

        let turned = |time_s: f64| Complex::from_polar(1.0, omega_rad_s * time_s);
        let tick_s = 1.0 / self.command_rate_hz;
        let frame_s = ticks_per_frame * tick_s;
        let pattern_s = ticks * tick_s;
        let tau_s = self.lag.time_constant_s;
        let first_s = self.esc_frame_phase * frame_s;
        // What each frame takes over: the command of the last tick before it starts.
        let levels: Vec<Complex<f64>> = (0..frames as u32)
            .map(|n| {
                let tick = ((f64::from(n) + self.esc_frame_phase + SAME_MOMENT_FRAMES) * ticks_per_frame).floor();
                turned(tick * tick_s)
            })
            .collect();
        let decay = (-frame_s / tau_s).exp();
        let from_rest = levels.iter().fold(Complex::new(0.0, 0.0), |state, level| level + (state - level) * decay);
        let mut state = from_rest / (turned(pattern_s) - (-pattern_s / tau_s).exp());
        let states: Vec<Complex<f64>> = levels
            .iter()
            .map(|level| {
                let here = state;
                state = level + (here - level) * decay;
                here
            })
            .collect();

        let rows = (ticks / self.ticks_per_row) as u32;
        let row_s = self.ticks_per_row * tick_s;
        let sum: Complex<f64> = (0..rows)
            .map(|row| {
                let time_s = f64::from(row) * row_s;
                let since_first_s = time_s - self.lag.delay_s - first_s;
                let patterns = (since_first_s / pattern_s).floor();
                let within_s = since_first_s - patterns * pattern_s;
                let frame = ((within_s / frame_s) as usize).min(levels.len() - 1);
                let (level, state) = (levels[frame], states[frame]);
                let y = level + (state - level) * (-(within_s - frame as f64 * frame_s) / tau_s).exp();
                y * turned(patterns * pattern_s - time_s)
            })
            .sum();
        self.compensator_response(omega_rad_s) * self.lag.gain * sum / f64::from(rows)
    }

    fn compensator_response(&self, omega_rad_s: f64) -> Complex<f64> {
        self.compensator.as_ref().map_or(Complex::new(1.0, 0.0), |design| design.response(self.nominal, omega_rad_s))
    }
}
