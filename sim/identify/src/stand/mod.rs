//! The stand between a motor and its thrust sensor (section 3.1 and Fig. 3 of the paper).
//!
//! A stand is a structure with resonances. The force sensor is not where the motor is, so the transfer function from thrust to
//! reading may have zeros in the right half plane, and it passes thrust unaltered only up to its first resonances: the paper's
//! passes 50 Hz and is described by a transfer function of order eight. It is identified from blows, a shaker's chirp or noise, or a
//! multisine, put in where the motor sits: the column `command` is then the force in newtons.

pub(crate) mod error;
mod impact;
mod model;
mod pass_band;
mod response;
pub mod transfer_function;

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use rotorlead_records::Experiment;

use crate::error::IdentifyError;
use crate::estimate::Estimate;
use crate::frequency_response::FrequencyResponse;
use crate::goodness_of_fit::MODEL_LEVEL;
use crate::goodness_of_fit::times_noise;
use crate::rows::clipping;
pub use error::StandError;
pub use model::{StandModel, StandRoot};
use transfer_function::{OrderScore, ParametricFit, Root, select_order};

/// How a stand is identified.
#[derive(Clone, Debug, PartialEq)]
pub struct StandOptions {
    /// Lowest and highest frequency of the fit, hertz. The top ends at 0.45 times the row rate at most.
    pub band_hz: (f64, f64),
    /// Numbers of poles that are tried, within 1 to 16.
    pub poles: RangeInclusive<usize>,
}

/// Chosen: the paper's stand passes 50 Hz and is of order 8, so the band reaches six times as far and the search half again as many poles.
impl Default for StandOptions {
    fn default() -> Self {
        Self { band_hz: (1.0, 300.0), poles: 1..=12 }
    }
}

/// A stand, and how sure it is.
#[derive(Clone, Debug, PartialEq)]
pub struct StandIdentification {
    /// The frequency response that was fitted.
    pub response: FrequencyResponse,
    /// The transfer function with its uncertainty.
    pub fit: ParametricFit,
    /// The orders that it was chosen from.
    pub scores: Vec<OrderScore>,
    /// End of the usable range in hertz: the lowest frequency at which the response is 3 dB above or below its static
    /// value; `None` when this is nowhere within the lines.
    pub usable_hz: Option<Estimate>,
    /// The highest line, hertz.
    pub top_hz: f64,
    /// The records used.
    pub records: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<StandWarning>,
}

/// What a user should know about a stand that was identified.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum StandWarning {
    /// The response had not died away at the end.
    #[error("{file}: the stand still rings, or drifts, at the end of the record")]
    #[diagnostic(help("record longer, or every pole looks too damped"))]
    StillRings {
        /// The record.
        file: String,
    },
    /// A column was cut off at its peak.
    #[error(
        "{file}: {column} stands at {at} for {rows} rows in a row at its peak: it was cut off, and the response is not a linear stand's"
    )]
    #[diagnostic(help("hit less hard, or set the sensor to a wider range"))]
    Clipped {
        /// The record.
        file: String,
        /// The column.
        column: &'static str,
        /// The value.
        at: f64,
        /// Rows in a row on it.
        rows: usize,
    },
    /// Roots that the lines say nothing of.
    #[error(
        "{count} of the poles (pairs count once) are beyond {limit_hz:.0} Hz, far above the highest line: they change nothing there and are left out"
    )]
    #[diagnostic(help("ask for fewer with --order"))]
    FarAbove {
        /// How many, a pair as one.
        count: usize,
        /// Where that begins, hertz.
        limit_hz: f64,
    },
    /// The model does not explain the lines to within their noise.
    #[error(
        "the transfer function leaves {} (p = {p_value:.1e}); the standard errors cover noise only",
        times_noise(*reduced_chi_square, 2)
    )]
    ModelTooSimple {
        /// Chi-square of the residual over its expectation.
        reduced_chi_square: f64,
        /// Its tail probability.
        p_value: f64,
    },
    /// Poles that zeros take away again.
    #[error(
        "{count} of {poles} poles (pairs count once) have a zero where they are, within its error: they cancel and mean nothing"
    )]
    #[diagnostic(help("leave --order out, or ask for fewer"))]
    Cancels {
        /// How many, a pair as one.
        count: usize,
        /// Of how many.
        poles: usize,
    },
    /// The static value is not in the band.
    #[error("the static gain, {gain:.3}, is not 1 within its error")]
    #[diagnostic(help("calibrate the force against the sensor"))]
    Gain {
        /// The static gain.
        gain: f64,
    },
}

/// Roots at more than this many times the highest line hardly change the response there, and the lines say nothing of where they are.
/// Derived: one changes it by a hundredth, `|1 - 1 / (1 + j / 100)|`, a pair by twice that at most.
const FAR_ABOVE: f64 = 100.0;

/// How sure it has to be that the static gain is not zero. Chosen: an unrelated response passes once in 100 000, and a gain of 4.4
/// standard errors is accepted.
const SURE: f64 = 1.0 - 1e-5;

impl StandIdentification {
    /// Poles that the lines say something of, by frequency, a pair as one.
    pub fn poles(&self) -> impl Iterator<Item = &Root> {
        within(&self.fit.poles, TAU * self.top_hz)
    }

    /// Zeros that the lines say something of, by frequency, a pair as one.
    pub fn zeros(&self) -> impl Iterator<Item = &Root> {
        within(&self.fit.zeros, TAU * self.top_hz)
    }

    /// The stand as its file has it.
    #[must_use]
    pub fn model(&self) -> StandModel {
        StandModel {
            format: 1,
            gain: self.fit.gain.value,
            gain_std: known(self.fit.gain.std),
            usable_hz: self.usable_hz.map(|usable| usable.value),
            usable_hz_std: self.usable_hz.and_then(|usable| known(usable.std)),
            top_hz: self.top_hz,
            poles: self.poles().map(StandRoot::from_root).collect(),
            zeros: self.zeros().map(StandRoot::from_root).collect(),
            records: self.records.clone(),
        }
    }
}

/// Those of `roots` that are not far above `top_rad_s`.
fn within(roots: &[Root], top_rad_s: f64) -> impl Iterator<Item = &Root> + Clone {
    roots.iter().filter(move |root| root.frequency_rad_s.value <= FAR_ABOVE * top_rad_s)
}

/// A standard error, where it is one.
fn known(std: f64) -> Option<f64> {
    std.is_finite().then_some(std)
}

/// Identifies a stand from an experiment whose command is a force ([`Experiment::read_force_input`]).
///
/// All records are blows (`excitation = "free"`, the force concentrated in a short time), or the first one that is not is used:
/// a multisine by its periods, a chirp or noise by the local polynomial method.
///
/// # Errors
/// [`StandError`], and what [`select_order`] and the spectra find wrong.
pub fn identify_stand(experiment: &Experiment, options: &StandOptions) -> Result<StandIdentification, IdentifyError> {
    let measured = response::measure(experiment, options.band_hz)?;
    let identified = fit_stand(measured.response, options)?;
    let ringing = measured.ringing.into_iter().map(|file| StandWarning::StillRings { file });
    let clipped = measured.records.iter().flat_map(|file| {
        let records = experiment.records.iter().filter(move |record| record.file == *file);
        records.flat_map(|record| {
            let response = record.response(experiment.output).unwrap_or_default();
            let columns = [("the force", record.command.as_slice()), ("the response", response)];
            columns.into_iter().filter_map(|(column, values)| {
                let (at, rows) = clipping::cut_peak(values)?;
                Some(StandWarning::Clipped { file: record.file.clone(), column, at, rows })
            })
        })
    });
    Ok(StandIdentification {
        warnings: clipped.chain(ringing).chain(identified.warnings).collect(),
        records: measured.records,
        ..identified
    })
}

/// Identifies a stand from its frequency response.
///
/// # Errors
/// Those of [`select_order`]; [`StandError::NoResponse`] where the static gain may be zero.
pub fn fit_stand(response: FrequencyResponse, options: &StandOptions) -> Result<StandIdentification, IdentifyError> {
    let selection = select_order(&response, options.poles.clone())?;
    check_order(&selection.fit, &response, options)?;
    let fit = selection.fit;
    let (low, high) = fit.gain.interval(SURE);
    if !(low > 0.0 || high < 0.0) {
        return Err(StandError::NoResponse { gain: fit.gain.value, std: fit.gain.std }.into());
    }
    let top_rad_s = response.lines.last().map_or(0.0, |line| line.omega_rad_s);
    let mut warnings = Vec::new();
    if fit.residual.power_p_value < MODEL_LEVEL {
        let (reduced_chi_square, p_value) = (fit.residual.reduced_chi_square, fit.residual.power_p_value);
        warnings.push(StandWarning::ModelTooSimple { reduced_chi_square, p_value });
    }
    let (near, near_zeros) = (within(&fit.poles, top_rad_s), || within(&fit.zeros, top_rad_s));
    // A zero up there is what the numerator has beyond those that there are.
    let far = fit.poles.len() - near.clone().count();
    if far > 0 {
        warnings.push(StandWarning::FarAbove { count: far, limit_hz: FAR_ABOVE * top_rad_s / TAU });
    }
    let count = near.filter(|pole| near_zeros().any(|zero| coincide(pole, zero))).count();
    if count > 0 {
        warnings.push(StandWarning::Cancels { count, poles: fit.poles.len() });
    }
    // Chosen: a hammer's calibration is good to some percent; beyond, it is wrong.
    if fit.gain.excludes(1.0) && (fit.gain.value - 1.0).abs() > 0.05 {
        warnings.push(StandWarning::Gain { gain: fit.gain.value });
    }
    Ok(StandIdentification {
        usable_hz: pass_band::usable_hz(&fit, top_rad_s),
        top_hz: top_rad_s / TAU,
        scores: selection.scores,
        records: Vec::new(),
        response,
        fit,
        warnings,
    })
}

/// Whether a pole and a zero are one within the errors of their distance, two standard ones: some 95 %.
fn coincide(pole: &Root, zero: &Root) -> bool {
    let near = |a: Estimate, b: Estimate| (a.value - b.value).abs() < 2.0 * a.std.hypot(b.std);
    // A real root's damping is one or minus one, exactly.
    let same_damping =
        if pole.is_pair() { near(pole.damping, zero.damping) } else { pole.damping.value == zero.damping.value };
    pole.is_pair() == zero.is_pair() && near(pole.frequency_rad_s, zero.frequency_rad_s) && same_damping
}

/// Refuses an order that was asked for and fits worse than a lower one.
///
/// A structure with more poles can do all that one with fewer can. Where the search ends with more left than of the best
/// lower order, the lines do not determine the additional poles: near-cancelling pairs leave it in a valley without
/// floor, and the numbers that it ends at mean nothing.
fn check_order(fit: &ParametricFit, response: &FrequencyResponse, options: &StandOptions) -> Result<(), IdentifyError> {
    let poles = *options.poles.start();
    let is_chosen = options.poles.end() > options.poles.start();
    if is_chosen || poles < 2 || fit.residual.power_p_value >= MODEL_LEVEL {
        return Ok(());
    }
    let Ok(lower) = select_order(response, 1..=poles - 1) else {
        return Ok(());
    };
    let (residual_ratio, fewer_residual_ratio) =
        (fit.residual.reduced_chi_square, lower.fit.residual.reduced_chi_square);
    if residual_ratio > fewer_residual_ratio {
        return Err(StandError::OrderTooHigh {
            poles,
            residual_ratio,
            fewer: lower.fit.structure.poles,
            fewer_residual_ratio,
        }
        .into());
    }
    Ok(())
}
