//! The stand's frequency response from whatever records there are.

use rotorlead_records::{Excitation, Experiment, Record, Role};

use super::{StandError, impact};
use crate::error::IdentifyError;
use crate::frequency_response::{FrequencyResponse, LocalPolynomial, LocalPolynomialOptions};
use crate::rows::columns;
use crate::spectra::{Spectrum, SpectrumOptions};

/// What was measured.
pub(super) struct StandResponse {
    pub(super) response: FrequencyResponse,
    pub(super) records: Vec<String>,
    /// Records whose response had not died away.
    pub(super) ringing: Vec<String>,
}

/// The response from the blows among the records, or from the first record of another kind where there is none.
pub(super) fn measure(experiment: &Experiment, band_hz: (f64, f64)) -> Result<StandResponse, IdentifyError> {
    let usable = |record: &&Record| {
        record.role != Some(Role::Validate)
            && matches!(
                record.excitation,
                Excitation::Free | Excitation::Chirp | Excitation::Random | Excitation::Multisine
            )
    };
    let records: Vec<&Record> = experiment.records.iter().filter(usable).collect();
    let first = *records.first().ok_or_else(|| StandError::NoRecord { name: experiment.name.clone() })?;
    for record in &records {
        let response = columns::response_column(record, experiment.output)?;
        if response.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(IdentifyError::ConstantResponse { file: record.file.clone() });
        }
    }
    let rate_hz = columns::row_rate_hz(first, experiment.sample_rate_hz)?;
    // Chosen: above nine tenths of half the rate, loggers filter or alias.
    let band_hz = (band_hz.0, band_hz.1.min(0.45 * rate_hz));
    let blows: Vec<&Record> =
        records.iter().copied().filter(|r| r.excitation == Excitation::Free && impact::is_blow(r)).collect();
    if !blows.is_empty() {
        let (response, ringing) = impact::response(experiment, &blows, band_hz)?;
        return Ok(StandResponse { response, records: blows.iter().map(|r| r.file.clone()).collect(), ringing });
    }
    let response = if first.excitation == Excitation::Multisine {
        let mut response =
            FrequencyResponse::from_spectrum(&Spectrum::from_record(experiment, first, &SpectrumOptions::default())?);
        let (low, high) = (std::f64::consts::TAU * band_hz.0, std::f64::consts::TAU * band_hz.1);
        response.lines.retain(|line| (low..=high).contains(&line.omega_rad_s));
        response
    } else {
        broadband(experiment, first, band_hz)?
    };
    Ok(StandResponse { response, records: vec![first.file.clone()], ringing: Vec::new() })
}

/// By the local polynomial method. Lines within a window share their noise, so one line per window is kept: the fit takes them
/// for independent.
fn broadband(
    experiment: &Experiment,
    record: &Record,
    band_hz: (f64, f64),
) -> Result<FrequencyResponse, IdentifyError> {
    let options = LocalPolynomialOptions { band_hz, ..LocalPolynomialOptions::default() };
    let mut response = LocalPolynomial::from_record(experiment, record, &options)?.response;
    let width = 2 * options.half_width + 1;
    response.lines = response.lines.into_iter().skip(options.half_width).step_by(width).collect();
    Ok(response)
}
