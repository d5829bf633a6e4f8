//! Identification from chirps and random commands: one first-order lag per nominal command.
//!
//! Neither repeats, and a motor has not settled when it begins. The local polynomial method
//! ([`LocalPolynomial`]) takes both into account and gives a frequency response with its noise; the lag is fitted to that
//! ([`fit_first_order`]) as it is to the lines of a multisine. One line per window of the method is taken: those of one
//! window share their noise, and the fit takes lines for independent.
//!
//! What does not repeat cannot be tested for a controller that acts on the response, so only records whose command is
//! known to be played are taken: a chirp or a random one, and not a `free` record.
//!
//! Rows need not be even: `rows::even`.

use rotorlead_numerics::sample::median;
use rotorlead_records::{Experiment, Record, Role, SAME_NOMINAL};

use crate::error::IdentifyError;
use crate::frequency_response::hold::HoldChain;
use crate::frequency_response::{FrequencyResponse, LocalPolynomial, LocalPolynomialOptions, ResponseLine};
use crate::goodness_of_fit::fit_percent;
use crate::lag::first_order::{FirstOrderOptions, FitLine, fit_first_order};
use crate::lag::multisine::IdentifyWarning;
use crate::lag::multisine::{NominalIdentification, PeriodicIdentification, plausibility};
use crate::rows::clipping;
use crate::rows::clipping::ClippingLimit;
use crate::rows::columns;
use crate::rows::even::{EvenRows, HIGHEST_OF_UNEVEN_RATE};
use crate::stand::StandModel;

/// The highest line that is used, as a share of the row rate: above, the sensor's own filter shows. Chosen: a tenth below half the row
/// rate, where a filter against aliasing has to be closed.
const HIGHEST_OF_ROW_RATE: f64 = 0.45;

/// Lines whose command has less than this share of its largest power are beyond the chirp: 30 dB, of which the sweep itself
/// takes 25, `10 log10(30 / 0.1)`, where it is exponential from 0.1 to 30 Hz. The other 5 dB are chosen, for the ripple of the sweep.
const LEAST_EXCITED: f64 = 1e-3;

/// Lines at which noise makes this many times as much of the response as it usually does of a command of their power: the command
/// is hardly told from the run-up there. They would weigh nothing in the fit, and be all of its % fit. Chosen: a line of a hundredth of the
/// usual weight is no loss.
const MOST_CONFUSED: f64 = 100.0;

/// Lags from chirps.
#[derive(Clone, Debug, PartialEq)]
pub struct ChirpIdentification {
    /// By increasing nominal command. They have no multisine records and no distortion.
    pub lags: PeriodicIdentification,
    /// The records that they were fitted to.
    pub files: Vec<String>,
    /// The frequency response of each.
    pub responses: Vec<ChirpResponse>,
}

/// The frequency response of a chirp, as its rows show it: holds, and a stand, are in it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChirpResponse {
    /// The record.
    pub file: String,
    /// At one line per window of the local polynomial method, where the chirp was.
    pub response: FrequencyResponse,
    /// Coherence of command and response at each line, 0..1.
    pub coherence: Vec<f64>,
}

/// Whether a lag can be fitted to a record as to a chirp: one of a random command too.
#[must_use]
pub fn is_chirp_to_fit(record: &Record) -> bool {
    record.excitation.is_broadband() && record.role != Some(Role::Validate) && !record.compensated
}

/// Identifies a first-order lag at every nominal command of `experiment` that has a chirp without a compensator, roles of
/// `validate` aside. `stand` is divided out.
///
/// # Errors
/// [`IdentifyError::NoFitRecord`] without a chirp to fit, [`IdentifyError::GainMayBeZero`] when no response follows its
/// command; whatever [`LocalPolynomial::from_record`] and [`fit_first_order`] find wrong.
pub fn identify_chirps(
    experiment: &Experiment,
    options: &FirstOrderOptions,
    stand: Option<&StandModel>,
) -> Result<ChirpIdentification, IdentifyError> {
    let mut records: Vec<&Record> = experiment.records.iter().filter(|record| is_chirp_to_fit(record)).collect();
    records.sort_by(|a, b| a.nominal.total_cmp(&b.nominal));
    let (mut nominals, mut files, mut responses) = (Vec::new(), Vec::new(), Vec::new());
    for group in records.chunk_by(|a, b| b.nominal - a.nominal < SAME_NOMINAL) {
        let (nominal, of_records) = identify_nominal(experiment, group, options, stand)?;
        nominals.push(nominal);
        responses.extend(of_records);
        files.extend(group.iter().map(|record| record.file.clone()));
    }
    if nominals.is_empty() {
        return Err(IdentifyError::NoFitRecord { name: experiment.name.clone() });
    }
    Ok(ChirpIdentification { lags: PeriodicIdentification { nominals, warnings: Vec::new() }, files, responses })
}

fn identify_nominal(
    experiment: &Experiment,
    group: &[&Record],
    options: &FirstOrderOptions,
    stand: Option<&StandModel>,
) -> Result<(NominalIdentification, Vec<ChirpResponse>), IdentifyError> {
    let nominal = group[0].nominal;
    let (mut lines, mut responses, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for record in group {
        let even = EvenRows::resample(record, experiment.output, experiment.sample_rate_hz)?;
        let (response, row_rate_hz) = chirp_response(experiment, record, even.as_ref())?;
        lines.extend(fit_lines(experiment, &response.response, row_rate_hz, stand)?);
        responses.push(response);
        warnings.extend(suspicions(experiment, record)?);
    }
    let fit = fit_first_order(&lines, options)?;
    let fit = plausibility::with_longer_delay(&fit, &lines, options).unwrap_or(fit);
    if plausibility::may_be_zero(fit.gain) {
        return Err(plausibility::refusal(nominal, fit.gain, &warnings));
    }
    warnings.extend(plausibility::check_fit(nominal, &fit, options.max_delay_s));
    let measured: Vec<_> = lines.iter().map(|line| line.response).collect();
    let model: Vec<_> = lines.iter().map(|line| fit.response_at(line)).collect();
    let found = NominalIdentification {
        nominal,
        fit_frequency_percent: fit_percent(&measured, &model),
        fit,
        responses: Vec::new(),
        distortion: None,
        robust: None,
        squares: Vec::new(),
        warnings,
    };
    Ok((found, responses))
}

/// One line per window of the local polynomial method, where the chirp was, and the rows per second of the command that they are
/// of: those of the even rows where the record's own are not.
fn chirp_response(
    experiment: &Experiment,
    record: &Record,
    even: Option<&EvenRows>,
) -> Result<(ChirpResponse, f64), IdentifyError> {
    let mut options = LocalPolynomialOptions::default();
    let (rows, highest_hz) = match even {
        Some(even) => (&even.record, HIGHEST_OF_UNEVEN_RATE * even.log_rate_hz),
        None => (record, HIGHEST_OF_ROW_RATE * columns::row_rate_hz(record, experiment.sample_rate_hz)?),
    };
    let row_rate_hz = columns::row_rate_hz(rows, experiment.sample_rate_hz)?;
    options.band_hz.1 = options.band_hz.1.min(highest_hz);
    let found = LocalPolynomial::from_record(experiment, rows, &options)?;
    let width = 2 * options.half_width + 1;
    let least = LEAST_EXCITED * found.command_power.iter().copied().fold(0.0, f64::max);
    let of_windows = (options.half_width..found.response.lines.len()).step_by(width);
    let excited: Vec<usize> = of_windows.filter(|&k| found.command_power[k] >= least).collect();
    // Of the rows of the command alone: what the response's noise happens to be chooses no line.
    let confusion = |k: &usize| found.command_power[*k] * found.response.lines[*k].variance / found.noise_variance[*k];
    let most = MOST_CONFUSED * median(excited.iter().map(confusion)).unwrap_or_default();
    let certain = excited.into_iter().filter(|k| confusion(k).is_nan() || confusion(k) <= most);
    let (lines, coherence) = certain.map(|k| (found.response.lines[k], found.coherence(k))).unzip();
    let response = FrequencyResponse { lines, ..found.response };
    Ok((ChirpResponse { file: record.file.clone(), response, coherence }, row_rate_hz))
}

/// The lines behind the holds and the stand, for a fit.
fn fit_lines(
    experiment: &Experiment,
    response: &FrequencyResponse,
    row_rate_hz: f64,
    stand: Option<&StandModel>,
) -> Result<Vec<FitLine>, IdentifyError> {
    let holds = HoldChain::new(row_rate_hz, experiment.command_rate_hz, experiment.esc_frame_hz)?;
    let line = |line: &ResponseLine| {
        let line = FitLine {
            omega_rad_s: line.omega_rad_s,
            response: line.response,
            variance: line.variance,
            dof: 2.0 * response.degrees_of_freedom,
            // One line per window, with the noise of that window alone.
            pooled: 1.0,
            images: holds.images(line.omega_rad_s),
        };
        match stand {
            Some(stand) => line.through(|omega_rad_s| stand.shape(omega_rad_s)),
            None => line,
        }
    };
    Ok(response.lines.iter().map(line).collect())
}

/// What makes a record unfit for a linear model, and shows in its rows.
fn suspicions(experiment: &Experiment, record: &Record) -> Result<Vec<IdentifyWarning>, IdentifyError> {
    let response = columns::response_column(record, experiment.output)?;
    let limits = clipping::limits(response);
    let column = experiment.output.column();
    let saturated = |&ClippingLimit { at, rows }: &ClippingLimit| IdentifyWarning::Saturated {
        file: record.file.clone(),
        column,
        rows,
        at,
    };
    let mut found: Vec<IdentifyWarning> = limits.iter().map(saturated).collect();
    found.extend(plausibility::check_rows(record, response, &limits));
    Ok(found)
}
