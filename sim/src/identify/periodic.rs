//! Identification from periodic records: one first-order lag per nominal command.
//!
//! At each nominal command the multisine records are transformed ([`Spectrum`]), a lag is fitted to
//! all their lines at once ([`fit_first_order`]), each record's ETFE is smoothed relative to that
//! lag, and the lag is compared with the frequency response and run on the square waves.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::feedback::FeedbackTest;
use super::saturation::{self, Limit};
use super::stand::StandModel;
use super::{
    Distortion, Etfe, FirstOrderFit, FirstOrderOptions, FitLine, HoldChain, IdentifyError, NoiseSource, RobustResponse,
    STRONG_DISTORTION_DB, Spectrum, SpectrumOptions, align, fit_first_order, fit_percent, run_actuator, spectra,
};
use crate::plant::{Actuator, EscTiming, OperatingPoint, Point};
use crate::record::{Excitation, Experiment, Record, Role};

/// Nominal commands closer than this are the same; a 12-bit command is 2.4e-4.
const SAME_NOMINAL: f64 = 1e-6;

/// Below this tail probability the residual says that a first-order lag is not the whole truth.
const MODEL_LEVEL: f64 = 1e-3;

/// How periodic records are identified.
#[derive(Clone, Copy)]
pub struct PeriodicOptions<'a> {
    /// How spectra are taken.
    pub spectrum: SpectrumOptions,
    /// How the lag is fitted.
    pub fit: FirstOrderOptions,
    /// Half width of the ETFE's Hann window in lines.
    pub smoothing_half_width: usize,
    /// Response of the compensator at a frequency in rad/s, for compensated records without an
    /// `esc_command` column. With the column the ratio of the two commands is used.
    pub compensator: Option<&'a dyn Fn(f64) -> Complex64>,
    /// The stand that the thrust passed on its way to the sensor; it is divided out.
    pub stand: Option<&'a StandModel>,
    /// Multisine records that are not in the experiment since their rows are not in memory, with their spectra
    /// ([`Spectrum::of_long`]).
    pub long: &'a [(Record, Spectrum)],
}

impl Default for PeriodicOptions<'_> {
    fn default() -> Self {
        Self {
            spectrum: SpectrumOptions::default(),
            fit: FirstOrderOptions::default(),
            smoothing_half_width: 4,
            compensator: None,
            stand: None,
            long: &[],
        }
    }
}

/// All that was identified.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicIdentification {
    /// By increasing nominal command.
    pub nominals: Vec<NominalIdentification>,
    /// What concerns no single nominal command.
    pub warnings: Vec<IdentifyWarning>,
}

impl PeriodicIdentification {
    /// The points of a [`crate::plant::Model`].
    #[must_use]
    pub fn points(&self) -> Vec<Point> {
        self.nominals.iter().map(NominalIdentification::point).collect()
    }

    /// The files of the records that lags were fitted to; all others are held out.
    pub fn fitted_files(&self) -> impl Iterator<Item = &str> {
        let responses = self.nominals.iter().flat_map(|nominal| &nominal.responses);
        responses.filter(|response| response.used_in_fit).map(|response| response.spectrum.file.as_str())
    }
}

/// What was identified at one nominal command.
#[derive(Clone, Debug, PartialEq)]
pub struct NominalIdentification {
    /// The nominal command, 0..1.
    pub nominal: f64,
    /// The lag, from the records in [`Self::responses`] with `used_in_fit`.
    pub fit: FirstOrderFit,
    /// The multisine records.
    pub responses: Vec<RecordResponse>,
    /// Noise, even and odd distortion of the fitted records together; `None` when they cannot tell.
    pub distortion: Option<Distortion>,
    /// The response over the fitted records, when they are realizations of the same lines.
    pub robust: Option<RobustResponse>,
    /// % fit of the frequency response at the unsmoothed lines: of validation records where there
    /// are any, of the fitted ones otherwise.
    pub fit_frequency_percent: Option<f64>,
    /// % fit on each uncompensated square wave.
    pub squares: Vec<SquareValidation>,
    /// What the user should know.
    pub warnings: Vec<IdentifyWarning>,
}

impl NominalIdentification {
    /// Mean % fit over the square waves.
    #[must_use]
    pub fn fit_square_percent(&self) -> Option<f64> {
        let count = self.squares.len() as f64;
        (count > 0.0).then(|| self.squares.iter().map(|s| s.fit_percent).sum::<f64>() / count)
    }

    /// The point of the model.
    #[must_use]
    pub fn point(&self) -> Point {
        let fit = &self.fit;
        Point {
            gain_std: Some(fit.gain.std),
            time_constant_s_std: Some(fit.time_constant_s.std),
            delay_s_std: fit.delay_s.map(|d| d.std),
            fit_frequency_percent: self.fit_frequency_percent,
            fit_square_percent: self.fit_square_percent(),
            ..Point::new(self.nominal, fit.lag())
        }
    }
}

/// The frequency response of one multisine record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordResponse {
    /// Whether a compensator was in front of the ESC; the response then includes it.
    pub compensated: bool,
    /// Whether the lag was fitted to it.
    pub used_in_fit: bool,
    /// The lines, their noise, and what was dropped.
    pub spectrum: Spectrum,
    /// Response over command as the rows show it: holds and compensator included.
    pub etfe: Etfe,
    /// The same with the holds divided out: the actuator, and the compensator if there was one.
    pub actuator: Etfe,
}

/// The lag on a square wave.
#[derive(Clone, Debug, PartialEq)]
pub struct SquareValidation {
    /// The record.
    pub file: String,
    /// % fit over the whole record.
    pub fit_percent: f64,
    /// The lag's response, with the offset and initial state of the record; one value per row.
    pub simulated: Vec<f64>,
}

/// What a user should know about an identification that succeeded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyWarning {
    /// No multisine record to fit at this nominal command.
    #[error("u_nom {nominal}: no multisine record to fit on; its other records are left out")]
    NothingToFit {
        /// The nominal command.
        nominal: f64,
    },
    /// The first period, or more, was dropped.
    #[error("{file}: a transient in the first {dropped} of {periods} periods (p = {p_value:.1e}), which are left out")]
    TransientDropped {
        /// The record.
        file: String,
        /// Periods dropped.
        dropped: usize,
        /// Periods recorded.
        periods: usize,
        /// Tail probability without transient.
        p_value: f64,
    },
    /// Nothing to compare the first period with.
    #[error("{file}: no other period to test the first for a transient; let the motor run in before recording")]
    TransientUntested {
        /// The record.
        file: String,
    },
    /// Rows outside whole periods.
    #[error("{file}: {rows} rows before the first whole period are left out")]
    RowsLeftOut {
        /// The record.
        file: String,
        /// How many.
        rows: usize,
    },
    /// A sinusoid that is none of the excitation's was subtracted.
    #[error("{file}: a sinusoid of {frequency_hz:.2} Hz and amplitude {amplitude:.3} (mains hum?) is subtracted")]
    SinusoidRemoved {
        /// The record.
        file: String,
        /// Its frequency.
        frequency_hz: f64,
        /// Its amplitude, response units.
        amplitude: f64,
    },
    /// Lines on which something else than the excitation shows.
    #[error(
        "{file}: a disturbance of one frequency, such as mains hum, falls on {count} lines from {first_hz:.1} to {last_hz:.1} Hz; they are left out"
    )]
    LinesDisturbed {
        /// The record.
        file: String,
        /// How many lines.
        count: usize,
        /// The lowest of them.
        first_hz: f64,
        /// The highest of them.
        last_hz: f64,
    },
    /// The noise is known from unexcited lines only.
    #[error("{file}: one period is left; the noise is taken from unexcited lines, with any even-order distortion")]
    NoiseFromUnexcitedLines {
        /// The record.
        file: String,
    },
    /// The lag does not explain the response to within its noise.
    #[error(
        "u_nom {nominal}: a first-order lag leaves {reduced_chi_square:.1} times the noise power; the standard errors cover noise only"
    )]
    ModelTooSimple {
        /// The nominal command.
        nominal: f64,
        /// Chi-square of the residual per degree of freedom.
        reduced_chi_square: f64,
    },
    /// A linear model hides a strong nonlinearity.
    #[error(
        "u_nom {nominal}: nonlinear distortion of {level_db:.1} dB of the linear response ({STRONG_DISTORTION_DB:.0} dB counts as strong): a linear model holds for this amplitude only, and its standard errors do not cover the distortion"
    )]
    StronglyNonlinear {
        /// The nominal command.
        nominal: f64,
        /// The stronger of even and odd distortion relative to the linear response, dB.
        level_db: f64,
    },
    /// Lines on which the stand no longer passes the thrust as it is.
    #[error(
        "u_nom {nominal}: {count} of {lines} fitted lines are above {usable_hz:.1} Hz, where the stand is 3 dB off; what is divided out there is only as good as the stand's model"
    )]
    BeyondStand {
        /// The nominal command.
        nominal: f64,
        /// How many lines are beyond the usable range.
        count: usize,
        /// Lines fitted.
        lines: usize,
        /// Where the usable range ends.
        usable_hz: f64,
    },
    /// A column stands on a limit.
    #[error(
        "{file}: {rows} rows of {column} stand exactly on {at}: it ran into a limit there, which no linear model has; lower the amplitude, or widen the range"
    )]
    Saturated {
        /// The record.
        file: String,
        /// The column.
        column: &'static str,
        /// How many rows.
        rows: usize,
        /// The limit, in the column's unit.
        at: f64,
    },
    /// The command follows the noise of the response.
    #[error(
        "{file}: the command changes from period to period, by {scatter_percent:.2} % of its RMS, and follows the response's noise (p = {p_value:.0e}): a controller acts on the response, which biases gain and lag toward its inverse; open the loop"
    )]
    ClosedLoop {
        /// The record.
        file: String,
        /// RMS of what of the command does not repeat, over that of what does, percent.
        scatter_percent: f64,
        /// Tail probability without a loop.
        p_value: f64,
    },
    /// No line shows the static gain.
    #[error(
        "u_nom {nominal}: the lowest line, {lowest_hz:.2} Hz, is above the pole at {pole_hz:.2} Hz: the static gain is not seen, only its ratio to the time constant; record longer periods"
    )]
    PeriodTooShort {
        /// The nominal command.
        nominal: f64,
        /// The lowest line.
        lowest_hz: f64,
        /// The pole that was found.
        pole_hz: f64,
    },
    /// The compensator of a compensated record is not known.
    #[error("{file}: its compensator's response is unknown, so it is neither smoothed nor fitted; record esc_command")]
    CompensatorUnknown {
        /// The record.
        file: String,
    },
}

/// Identifies a first-order lag at every nominal command of `experiment` that has a multisine.
///
/// Uncompensated multisine records are fitted unless their role is `validate`; compensated ones are
/// fitted only at nominal commands that have no other and where the compensator's response is
/// known. Validation multisines give `fit_frequency_percent`, uncompensated square waves
/// `fit_square_percent`. Other excitations are not touched.
///
/// # Errors
/// [`IdentifyError::NoFitRecord`] without a record to fit; whatever [`Spectrum::of`] and
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
                    Some(Spectrum::of(experiment, record, spectrum_options)?)
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
    for group in spectra.chunk_by_mut(|(a, _), (b, _)| b.nominal - a.nominal < SAME_NOMINAL) {
        match identify_nominal(experiment, group, options)? {
            Some(found) => nominals.push(found),
            None => warnings.push(IdentifyWarning::NothingToFit { nominal: group[0].0.nominal }),
        }
    }
    if nominals.is_empty() {
        return Err(IdentifyError::NoFitRecord { name: experiment.name.clone() });
    }
    Ok(PeriodicIdentification { nominals, warnings })
}

/// A multisine record on its way to a [`RecordResponse`].
struct Transformed<'a> {
    record: &'a Record,
    spectrum: Spectrum,
    /// The lines behind the holds.
    lines: Vec<FitLine>,
    /// The compensator at each line, one without; `None` when it is unknown.
    filter: Option<Vec<Complex64>>,
}

impl Transformed<'_> {
    /// The lines behind holds and compensator; none when the compensator is unknown.
    fn fit_lines(&self) -> impl Iterator<Item = FitLine> {
        let filter = self.filter.as_deref().unwrap_or_default();
        self.lines.iter().zip(filter).map(|(line, filter)| line.clone().behind(*filter))
    }
}

fn identify_nominal(
    experiment: &Experiment,
    group: &mut [(&Record, Option<Spectrum>)],
    options: &PeriodicOptions<'_>,
) -> Result<Option<NominalIdentification>, IdentifyError> {
    let nominal = group[0].0.nominal;
    let mut warnings = Vec::new();
    let transformed = group
        .iter_mut()
        .filter_map(|(record, spectrum)| Some((*record, spectrum.take()?)))
        .map(|(record, spectrum)| behind_holds(experiment, record, spectrum, options, &mut warnings))
        .collect::<Result<Vec<_>, _>>()?;

    let may_fit = |t: &Transformed<'_>, compensated: bool| {
        t.record.role != Some(Role::Validate) && t.record.compensated == compensated && t.filter.is_some()
    };
    let fit_compensated = !transformed.iter().any(|t| may_fit(t, false));
    let is_fitted = |t: &Transformed<'_>| may_fit(t, fit_compensated);
    let lines: Vec<FitLine> = transformed.iter().filter(|t| is_fitted(t)).flat_map(Transformed::fit_lines).collect();
    if lines.is_empty() {
        return Ok(None);
    }
    let fit = fit_first_order(&lines, &options.fit)?;
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
    if fit.model_p_value < MODEL_LEVEL {
        warnings.push(IdentifyWarning::ModelTooSimple { nominal, reduced_chi_square: fit.reduced_chi_square });
    }

    let validation: Vec<FitLine> = transformed
        .iter()
        .filter(|t| t.record.role == Some(Role::Validate) && !t.record.compensated)
        .flat_map(Transformed::fit_lines)
        .collect();
    let judged = if validation.is_empty() { &lines } else { &validation };
    let measured: Vec<_> = judged.iter().map(|line| line.response).collect();
    let model: Vec<_> = judged.iter().map(|line| fit.response_at(line)).collect();

    let responses = transformed
        .iter()
        .map(|t| respond(t, &fit, is_fitted(t), options.smoothing_half_width))
        .collect::<Result<Vec<_>, _>>()?;
    let fitted: Vec<&Spectrum> = responses.iter().filter(|r| r.used_in_fit).map(|r| &r.spectrum).collect();
    let distortion = Distortion::of(&fitted);
    if let Some(level) = distortion.and_then(|distortion| distortion.strong()) {
        warnings.push(IdentifyWarning::StronglyNonlinear { nominal, level_db: level.relative_db });
    }
    let robust = RobustResponse::of(&fitted);
    let squares = group
        .iter()
        .map(|(record, _)| *record)
        .filter(|record| record.excitation == Excitation::Square && !record.compensated)
        .map(|record| run_square(experiment, record, &fit))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Some(NominalIdentification {
        nominal,
        fit_frequency_percent: fit_percent(&measured, &model),
        fit,
        distortion,
        robust,
        responses,
        squares,
        warnings,
    }))
}

/// The lines of a record's spectrum as the fit takes them, and what there is to say of it.
fn behind_holds<'a>(
    experiment: &Experiment,
    record: &'a Record,
    spectrum: Spectrum,
    options: &PeriodicOptions<'_>,
    warnings: &mut Vec<IdentifyWarning>,
) -> Result<Transformed<'a>, IdentifyError> {
    let holds = holds_of(experiment, spectrum.row_rate_hz)?;
    let file = || record.file.clone();
    if spectrum.rows_left_out > 0 {
        warnings.push(IdentifyWarning::RowsLeftOut { file: file(), rows: spectrum.rows_left_out });
    }
    match spectrum.transient.p_value {
        None => warnings.push(IdentifyWarning::TransientUntested { file: file() }),
        Some(p_value) if spectrum.transient.is_present() => {
            warnings.push(IdentifyWarning::TransientDropped {
                file: file(),
                dropped: spectrum.transient.dropped,
                periods: spectrum.periods,
                p_value,
            });
        }
        Some(_) => {}
    }
    warnings.extend(spectrum.removed.iter().map(|sinusoid| IdentifyWarning::SinusoidRemoved {
        file: file(),
        frequency_hz: sinusoid.omega_rad_s / TAU,
        amplitude: sinusoid.amplitude,
    }));
    if let (Some(first), Some(last)) = (spectrum.disturbed.first(), spectrum.disturbed.last()) {
        warnings.push(IdentifyWarning::LinesDisturbed {
            file: file(),
            count: spectrum.disturbed.len(),
            first_hz: first.omega_rad_s / TAU,
            last_hz: last.omega_rad_s / TAU,
        });
    }
    if spectrum.noise == NoiseSource::UnexcitedLines {
        warnings.push(IdentifyWarning::NoiseFromUnexcitedLines { file: file() });
    }
    let filter = spectrum
        .lines
        .iter()
        .map(|line| {
            if !record.compensated {
                Some(Complex64::ONE)
            } else if let Some(esc_command) = line.esc_command {
                Some(esc_command / line.command)
            } else {
                options.compensator.map(|c| c(line.omega_rad_s))
            }
        })
        .collect::<Option<Vec<_>>>();
    if filter.is_none() {
        warnings.push(IdentifyWarning::CompensatorUnknown { file: file() });
    }
    let on_stand = |line: FitLine| match options.stand {
        Some(stand) => line.through(|omega_rad_s| stand.shape(omega_rad_s)),
        None => line,
    };
    let lines = spectrum.lines.iter().map(|line| on_stand(FitLine::new(line, &holds))).collect();
    Ok(Transformed { record, spectrum, lines, filter })
}

/// What makes a record unfit for a linear, open-loop model, and shows in its rows.
fn suspicions(transformed: &Transformed<'_>, experiment: &Experiment, fit: &FirstOrderFit) -> Vec<IdentifyWarning> {
    let Transformed { record, spectrum, .. } = transformed;
    let file = || record.file.clone();
    let response = record.response(experiment.output).unwrap_or_default();
    let esc_command = record.esc_command.as_deref().unwrap_or_default();
    let columns = [(spectra::column(experiment.output), response), ("esc_command", esc_command)];
    let mut found: Vec<IdentifyWarning> = columns
        .into_iter()
        .flat_map(|(column, values)| saturation::limits(values).into_iter().map(move |limit| (column, limit)))
        .map(|(column, Limit { at, rows })| IdentifyWarning::Saturated { file: file(), column, rows, at })
        .collect();
    let length = (spectrum.period_s * spectrum.row_rate_hz).round() as usize;
    let first = spectrum.rows_left_out + length * spectrum.transient.dropped;
    let command = if record.compensated { esc_command } else { &record.command };
    if let (Some(command), Some(response)) = (command.get(first..), response.get(first..))
        && let Some(test) = FeedbackTest::of(command, response, length, 1.0 / spectrum.row_rate_hz, &fit.lag())
        && test.p_value < MODEL_LEVEL
    {
        let FeedbackTest { scatter_percent, p_value } = test;
        found.push(IdentifyWarning::ClosedLoop { file: file(), scatter_percent, p_value });
    }
    found
}

fn holds_of(experiment: &Experiment, row_rate_hz: f64) -> Result<HoldChain, IdentifyError> {
    HoldChain::new(row_rate_hz, experiment.command_rate_hz, experiment.esc_frame_hz)
}

fn respond(
    transformed: &Transformed<'_>,
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
    let measured = spectra::response_of(record, experiment.output)?;
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
