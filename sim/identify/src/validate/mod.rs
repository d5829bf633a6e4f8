//! How well a model that is given explains records, one by one.
//!
//! Multisines are judged in frequency: the unsmoothed response at each excited line against the model behind the
//! record's holds and compensator. All other records are judged in time: the model runs on the command that the ESC got.
//!
//! | record | plant | rows | free |
//! |---|---|---|---|
//! | multisine | linear around `nominal` | lines of the whole periods | nothing |
//! | multisine, with effects | simulated around `nominal` | its lines | nothing |
//! | square, step, chirp | linear around `nominal` | all | offset and initial state ([`align`](crate::simulation::align)) |
//! | staircase | following the level | from the first level to where the motor stops, but for levels on a limit, spikes, and steps in gaps of the log | initial state; an offset, without a static map |
//! | free | following the level | all | initial state; an offset, without a static map |
//!
//! The ceiling is what the true model would score: noise alone is then left. It takes the noise as the records show it,
//! from what does not repeat (multisine: [`Spectrum`](crate::spectra::Spectrum); square: from period to period) or from the scatter of settled
//! levels (step, staircase).

//!
//! Of a sensor that is slower than the rows, each reading of a step, a staircase or a free record counts once, beside the model at its
//! moment or the model's mean since the reading before, whichever is nearer.
//!
//! Beside the ceiling stands a test whether the record shows the model to be wrong ([`ResidualPower`]).

mod judge;
mod noise;
mod residual_power;
mod slow_readings;
mod table;

pub use residual_power::ResidualPower;
pub use table::{FitBesideCeiling, TableRow, table_2};

use num_complex::Complex64;
use rotorlead_plant::Model;
use rotorlead_records::{Excitation, Experiment, Role};
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

use judge::Judge;

use crate::error::IdentifyError;
use crate::frequency_response::FrequencyResponse;

/// In which domain a record is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Domain {
    /// Frequency response at the excited lines.
    Frequency,
    /// Response at the rows.
    Time,
}

/// How well the model explains one record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordValidation {
    /// The record's file.
    pub file: String,
    /// The command around which it was run, 0..1.
    pub nominal: f64,
    /// What drives it.
    pub excitation: Excitation,
    /// Whether a compensator was in front of the ESC.
    pub compensated: bool,
    /// What it is used for, where it says.
    pub role: Option<Role>,
    /// Whether the model was fitted to it: whether its file is among the records of the model's provenance. `None` where
    /// the model names no records.
    pub fitted: Option<bool>,
    /// % fit of the model.
    pub fit_percent: f64,
    /// % fit that noise leaves to the true model; `None` where the record does not show its noise.
    pub ceiling_percent: Option<f64>,
    /// Whether more than noise is left; `None` where the noise does not show beside it.
    pub residual_power: Option<ResidualPower>,
    /// What was compared.
    pub comparison: Comparison,
}

/// Without what was compared.
impl Serialize for RecordValidation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("RecordValidation", 12)?;
        values.serialize_field("file", &self.file)?;
        values.serialize_field("nominal", &self.nominal)?;
        values.serialize_field("excitation", &self.excitation)?;
        values.serialize_field("compensated", &self.compensated)?;
        values.serialize_field("role", &self.role)?;
        values.serialize_field("held_out", &self.fitted.map(|fitted| !fitted))?;
        values.serialize_field("domain", &self.domain())?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.serialize_field("ceiling_percent", &self.ceiling_percent)?;
        values.serialize_field("left_over_noise", &self.residual_power.map(|power| power.power_ratio))?;
        values.serialize_field("left_over_p_value", &self.residual_power.map(|power| power.p_value))?;
        values.serialize_field("model_error_percent", &self.model_error_percent())?;
        values.end()
    }
}

impl RecordValidation {
    /// Where model and record are compared.
    #[must_use]
    pub fn domain(&self) -> Domain {
        match self.comparison {
            Comparison::Frequency(_) => Domain::Frequency,
            Comparison::Time(_) => Domain::Time,
        }
    }

    /// The residual beside the noise, where the noise is what it seems: not where less is left than noise could
    /// ([`ResidualPower::is_below_noise`]).
    #[must_use]
    pub fn judged_residual(&self) -> Option<ResidualPower> {
        self.residual_power.filter(|power| !power.is_below_noise())
    }

    /// What the model gets wrong, RMS over the RMS of the response about its mean, percent: what is left beyond noise,
    /// `sqrt((100 - fit)^2 - (100 - ceiling)^2)`; zero where the fit is above the ceiling.
    #[must_use]
    pub fn model_error_percent(&self) -> Option<f64> {
        let noise = 100.0 - self.ceiling_percent?;
        Some(((100.0 - self.fit_percent).powi(2) - noise * noise).max(0.0).sqrt())
    }
}

/// Record and model side by side.
#[derive(Clone, Debug, PartialEq)]
pub enum Comparison {
    /// At the excited lines, as in the paper's Fig. 6.
    Frequency(ComparedLines),
    /// At the rows, as in its Fig. 7.
    Time(Vec<ComparedRow>),
}

/// A frequency response beside the model's. Both are of the actuator, and of the compensator where there was one: the
/// holds of loop and ESC are divided out.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedLines {
    /// Response over command at each line, by frequency.
    pub raw: Vec<Complex64>,
    /// The same smoothed, with its noise ([`Etfe`](crate::frequency_response::etfe::Etfe), the model as the reference).
    pub smoothed: FrequencyResponse,
    /// The model there.
    pub model: Vec<Complex64>,
}

/// One row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparedRow {
    /// Time, seconds.
    pub time_s: f64,
    /// The response, response units.
    pub measured: f64,
    /// The model's, with what the record leaves free.
    pub model: f64,
}

/// Judges `model` on every record of `experiment`, in the experiment's order.
///
/// A compensated record is driven by its `esc_command`; in time that is the command held from row to row.
///
/// # Errors
/// [`IdentifyError::OtherOutput`] when the model was identified on the other response, [`IdentifyError::NotInModel`] when a
/// record's nominal command is outside the model's points, [`IdentifyError::Plant`] when the model cannot be simulated,
/// [`IdentifyError::NoEscCommand`] for a compensated record without that column, and what is wrong with a record itself.
///
/// # Examples
///
/// A motor that is slower than its model:
///
/// ```
/// use rotorlead_identify::validate::validate;
/// use rotorlead_plant::Model;
/// use rotorlead_plant::bench::{Plan, run};
///
/// let motor: Model = toml::from_str("
///     format = 1
///     [[point]]
///     nominal = 0.5
///     gain = 10.0
///     time_constant_s = 0.1
/// ")?;
/// let plan = Plan { loop_rate_hz: 500, sample_rate_hz: 500, esc_frame_hz: None, ..Plan::paper(&motor) };
/// let stand = run(&plan, &motor, None, &|_| ())?;
/// let mut faster = motor.clone();
/// faster.points[0].time_constant_s = 0.05;
///
/// let (right, wrong) = (validate(&stand, &motor)?, validate(&stand, &faster)?);
/// assert!(right[0].fit_percent > wrong[0].fit_percent);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn validate(experiment: &Experiment, model: &Model) -> Result<Vec<RecordValidation>, IdentifyError> {
    same_output(experiment, model)?;
    if model.points.is_empty() {
        return Err(IdentifyError::NoPoints);
    }
    experiment.records.iter().map(|record| Judge { experiment, model, record }.validation()).collect()
}

/// Refuses a model that was identified on the other response.
pub fn same_output(experiment: &Experiment, model: &Model) -> Result<(), IdentifyError> {
    match &model.provenance {
        Some(provenance) if provenance.output != experiment.output => {
            let (model, experiment) = (provenance.output.column(), experiment.output.column());
            Err(IdentifyError::OtherOutput { model, experiment })
        }
        _ => Ok(()),
    }
}
