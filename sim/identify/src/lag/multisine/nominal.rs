//! What periodic records tell of an actuator.

use rotorlead_plant::Point;

use super::IdentifyWarning;
use crate::frequency_response::distortion::{Distortion, RobustResponse};
use crate::frequency_response::etfe::Etfe;
use crate::lag::first_order::FirstOrderFit;
use crate::spectra::Spectrum;

/// All that was identified.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicIdentification {
    /// By increasing nominal command.
    pub nominals: Vec<NominalIdentification>,
    /// What concerns no single nominal command.
    pub warnings: Vec<IdentifyWarning>,
}

impl PeriodicIdentification {
    /// The points of a [`rotorlead_plant::Model`].
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
