//! Identification from periodic records: one first-order lag per nominal command.
//!
//! At each nominal command the multisine records are transformed ([`Spectrum`]), a lag is fitted to
//! all their lines at once ([`fit_first_order`]), each record's ETFE is smoothed relative to that
//! lag, and the lag is compared with the frequency response and run on the square waves.

mod feedback;
mod measured_bandwidth;
mod multisine_record;
mod nominal;
pub(crate) mod plausibility;
mod warning;

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use rotorlead_plant::{Actuator, EscTiming, OperatingPoint};
use rotorlead_records::{Excitation, Experiment, Record, Role, SAME_NOMINAL};

use crate::error::IdentifyError;
use crate::estimate::Estimate;
use crate::frequency_response::distortion::{Distortion, RobustResponse};
use crate::frequency_response::etfe::Etfe;
use crate::goodness_of_fit::fit_percent;
use crate::lag::first_order::{FirstOrderFit, FirstOrderOptions, FitLine, fit_first_order};
use crate::rows::columns;
use crate::simulation::{align, run_actuator};
use crate::spectra::{NoiseSource, Spectrum, SpectrumOptions};
use crate::stand::StandModel;
pub use measured_bandwidth::MeasuredBandwidth;
use multisine_record::{MultisineRecord, behind_holds, suspicions};
pub use nominal::{NominalIdentification, PeriodicIdentification, RecordResponse, SquareValidation};
pub use warning::IdentifyWarning;

/// Half width of the Hann window that smooths what is drawn, lines. Chosen: it averages `(sum W)^2 / sum W^2 = 6.7` lines; a wider
/// window would hide a resonance.
pub const SMOOTHING_HALF_WIDTH: usize = 4;

/// How periodic records are identified.
#[derive(Clone, Copy)]
pub struct PeriodicOptions<'a> {
    /// How spectra are taken.
    pub spectrum: SpectrumOptions,
    /// How the lag is fitted.
    pub fit: FirstOrderOptions,
    /// Half width of the ETFE's Hann window in lines; by default [`SMOOTHING_HALF_WIDTH`].
    pub smoothing_half_width: usize,
    /// Response of the compensator at a frequency in rad/s, for compensated records without an
    /// `esc_command` column. With the column the ratio of the two commands is used.
    pub compensator: Option<&'a dyn Fn(f64) -> Complex64>,
    /// The stand that the thrust passed on its way to the sensor; it is divided out.
    pub stand: Option<&'a StandModel>,
    /// Multisine records that are not in the experiment since their rows are not in memory, with their spectra
    /// ([`Spectrum::from_long_record`]).
    pub long: &'a [(Record, Spectrum)],
}

impl Default for PeriodicOptions<'_> {
    fn default() -> Self {
        Self {
            spectrum: SpectrumOptions::default(),
            fit: FirstOrderOptions::default(),
            smoothing_half_width: SMOOTHING_HALF_WIDTH,
            compensator: None,
            stand: None,
            long: &[],
        }
    }
}

/// Identifies a first-order lag at every nominal command of `experiment` that has a multisine.
///
/// Uncompensated multisine records are fitted unless their role is `validate`; compensated ones are
/// fitted only at nominal commands that have no other and where the compensator's response is
/// known. Validation multisines give `fit_frequency_percent`, uncompensated square waves
/// `fit_square_percent`. Other excitations are not touched.
///
/// # Errors
/// [`IdentifyError::NoFitRecord`] without a record to fit, [`IdentifyError::GainMayBeZero`] when no response follows its
/// command; whatever [`Spectrum::from_record`] and
/// [`fit_first_order`] find wrong.
pub fn identify_periodic(
    experiment: &Experiment,
    options: &PeriodicOptions<'_>,
) -> Result<PeriodicIdentification, IdentifyError> {
    let mut records: Vec<(&Record, Option<&Spectrum>)> = experiment
        .records
        .iter()
        .filter(|r| matches!(r.excitation, Excitation::Multisine | Excitation::Square))
        .map(|record| (record, None))
        .chain(options.long.iter().map(|(record, spectrum)| (record, Some(spectrum))))
        .collect();
    records.sort_by(|(a, _), (b, _)| a.nominal.total_cmp(&b.nominal));
    let spectrum_options = &options.spectrum;
    let spectra: Vec<_> = records
        .into_par_iter()
        .map(|(record, spectrum)| {
            let spectrum = match spectrum {
                None if record.excitation == Excitation::Multisine => {
                    Some(Spectrum::from_record(experiment, record, spectrum_options)?)
                }
                spectrum => spectrum.cloned(),
            };
            Ok((record, spectrum))
        })
        .collect();
    // The error is that of the first faulty record, whichever is found first.
    let mut spectra = spectra.into_iter().collect::<Result<Vec<(&Record, Option<Spectrum>)>, IdentifyError>>()?;
    let mut nominals = Vec::new();
    let mut warnings = Vec::new();
    let mut refused = None;
    for group in spectra.chunk_by_mut(|(a, _), (b, _)| b.nominal - a.nominal < SAME_NOMINAL) {
        match identify_nominal(experiment, group, options)? {
            NominalOutcome::Lag(found) => nominals.push(*found),
            NominalOutcome::NothingToFit => {
                warnings.push(IdentifyWarning::NothingToFit { nominal: group[0].0.nominal })
            }
            NominalOutcome::NoGain { gain, warnings: found } => {
                let nominal = group[0].0.nominal;
                refused.get_or_insert_with(|| plausibility::refusal(nominal, gain, &found));
                warnings.extend(found);
                warnings.push(IdentifyWarning::GainMayBeZero { nominal, gain: gain.value, std: gain.std });
            }
        }
    }
    if nominals.is_empty() {
        return Err(refused.unwrap_or_else(|| IdentifyError::NoFitRecord { name: experiment.name.clone() }));
    }
    Ok(PeriodicIdentification { nominals, warnings })
}

/// What comes out at one nominal command.
enum NominalOutcome {
    Lag(Box<NominalIdentification>),
    NothingToFit,
    /// A response that may as well be none of this command, and what speaks against its records.
    NoGain {
        gain: Estimate,
        warnings: Vec<IdentifyWarning>,
    },
}

fn identify_nominal(
    experiment: &Experiment,
    group: &mut [(&Record, Option<Spectrum>)],
    options: &PeriodicOptions<'_>,
) -> Result<NominalOutcome, IdentifyError> {
    let nominal = group[0].0.nominal;
    let mut warnings = Vec::new();
    let transformed = group
        .iter_mut()
        .filter_map(|(record, spectrum)| Some((*record, spectrum.take()?)))
        .map(|(record, spectrum)| behind_holds(experiment, record, spectrum, options, &mut warnings))
        .collect::<Result<Vec<_>, _>>()?;

    let may_fit = |t: &MultisineRecord<'_>, compensated: bool| {
        t.record.role != Some(Role::Validate) && t.record.compensated == compensated && t.filter.is_some()
    };
    let fit_compensated = !transformed.iter().any(|t| may_fit(t, false));
    let is_fitted = |t: &MultisineRecord<'_>| may_fit(t, fit_compensated);
    let lines: Vec<FitLine> =
        transformed.iter().filter(|t| is_fitted(t)).flat_map(MultisineRecord::fit_lines).collect();
    if lines.is_empty() {
        return Ok(NominalOutcome::NothingToFit);
    }
    let fit = fit_first_order(&lines, &options.fit)?;
    let fit = plausibility::with_longer_delay(&fit, &lines, &options.fit).unwrap_or(fit);
    if let Some(usable_hz) = options.stand.and_then(|stand| stand.usable_hz) {
        let count = lines.iter().filter(|line| line.omega_rad_s > TAU * usable_hz).count();
        if count > 0 {
            warnings.push(IdentifyWarning::BeyondStand { nominal, count, lines: lines.len(), usable_hz });
        }
    }
    for t in &transformed {
        warnings.extend(suspicions(t, experiment, &fit));
    }
    let lowest_rad_s = lines.iter().map(|line| line.omega_rad_s).fold(f64::INFINITY, f64::min);
    if lowest_rad_s * fit.time_constant_s.value > 1.0 {
        let (lowest_hz, pole_hz) = (lowest_rad_s / TAU, 1.0 / (TAU * fit.time_constant_s.value));
        warnings.push(IdentifyWarning::PeriodTooShort { nominal, lowest_hz, pole_hz });
    }
    if plausibility::may_be_zero(fit.gain) {
        return Ok(NominalOutcome::NoGain { gain: fit.gain, warnings });
    }
    warnings.extend(plausibility::check_fit(nominal, &fit, options.fit.max_delay_s));
    // Noise that is taken from unexcited lines has even-order distortion in it, which is much to a good fit.
    let between = |t: &MultisineRecord<'_>| t.spectrum.noise == NoiseSource::BetweenPeriods;
    if transformed.iter().filter(|t| is_fitted(t)).all(between) {
        warnings.extend(plausibility::noise_too_large(nominal, &fit, &lines));
    }

    let validation: Vec<FitLine> = transformed
        .iter()
        .filter(|t| t.record.role == Some(Role::Validate) && !t.record.compensated)
        .flat_map(MultisineRecord::fit_lines)
        .collect();
    let judged = if validation.is_empty() { &lines } else { &validation };
    let measured: Vec<_> = judged.iter().map(|line| line.response).collect();
    let model: Vec<_> = judged.iter().map(|line| fit.response_at(line)).collect();

    let responses = transformed
        .iter()
        .map(|t| respond(t, &fit, is_fitted(t), options.smoothing_half_width))
        .collect::<Result<Vec<_>, _>>()?;
    let fitted: Vec<&Spectrum> = responses.iter().filter(|r| r.used_in_fit).map(|r| &r.spectrum).collect();
    let distortion = Distortion::from_spectra(&fitted);
    if let Some(level) = distortion.and_then(|distortion| distortion.strong()) {
        warnings.push(IdentifyWarning::StronglyNonlinear { nominal, level_db: level.relative_db });
    }
    let robust = RobustResponse::from_spectra(&fitted);
    let squares = group
        .iter()
        .map(|(record, _)| *record)
        .filter(|record| record.excitation == Excitation::Square && !record.compensated)
        .map(|record| run_square(experiment, record, &fit))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(NominalOutcome::Lag(Box::new(NominalIdentification {
        nominal,
        fit_frequency_percent: fit_percent(&measured, &model),
        fit,
        distortion,
        robust,
        responses,
        squares,
        warnings,
    })))
}

fn respond(
    transformed: &MultisineRecord<'_>,
    fit: &FirstOrderFit,
    used_in_fit: bool,
    half_width: usize,
) -> Result<RecordResponse, IdentifyError> {
    let spectrum = &transformed.spectrum;
    let behind_holds: Vec<_> = transformed.lines.iter().map(|l| fit.response_at(l)).collect();
    let (reference, half_width) = match &transformed.filter {
        Some(filter) => (behind_holds.iter().zip(filter).map(|(r, f)| r * f).collect(), half_width),
        None => (vec![Complex64::ONE; behind_holds.len()], 0),
    };
    let etfe = Etfe::new(&spectrum.lines, &reference, half_width)?;
    // What the rows show over what the actuator does: the holds, and the images for this lag.
    let holds: Vec<_> =
        transformed.lines.iter().zip(&behind_holds).map(|(line, seen)| seen / fit.response(line.omega_rad_s)).collect();
    Ok(RecordResponse {
        compensated: transformed.record.compensated,
        used_in_fit,
        spectrum: spectrum.clone(),
        actuator: etfe.divided_by(&holds)?,
        etfe,
    })
}

fn run_square(
    experiment: &Experiment,
    record: &Record,
    fit: &FirstOrderFit,
) -> Result<SquareValidation, IdentifyError> {
    let measured = columns::response_column(record, experiment.output)?;
    let lag = fit.lag();
    // Around the record's nominal command, where the response is the offset that alignment takes out.
    let point = OperatingPoint { nominal: record.nominal, lag, response: 0.0 };
    let timing = EscTiming { frame_hz: experiment.esc_frame_hz, frame_phase: 0.0 };
    let mut actuator = Actuator::linear(point, timing).map_err(IdentifyError::Plant)?;
    let model = run_actuator(&mut actuator, &record.time_s, &record.command, 0);
    let simulated = align(&record.time_s, measured, &model, lag.time_constant_s);
    let fit_percent = fit_percent(measured, &simulated)
        .ok_or_else(|| IdentifyError::ConstantResponse { file: record.file.clone() })?;
    Ok(SquareValidation { file: record.file.clone(), fit_percent, simulated })
}
