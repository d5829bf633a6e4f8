//! How well a model that is given explains records, one by one.
//!
//! Multisines are judged in frequency: the unsmoothed response at each excited line against the model behind the
//! record's holds and compensator. All other records are judged in time: the model runs on the command that the ESC got.
//!
//! | record | plant | rows | free |
//! |---|---|---|---|
//! | multisine | linear around `nominal` | lines of the whole periods | nothing |
//! | multisine, with effects | simulated around `nominal` | its lines | nothing |
//! | square, step, chirp | linear around `nominal` | all | offset and initial state ([`align`]) |
//! | staircase | following the level | from the first settled level to where the motor stops | an offset, without a static map |
//! | free | following the level | all | an offset, without a static map |
//!
//! The ceiling is what the true model would score: noise alone is then left. It takes the noise as the records show it,
//! from what does not repeat (multisine: [`Spectrum`]; square: from period to period) or from the scatter of settled
//! levels (step, staircase).

use num_complex::Complex64;

use super::effects::{Rates, simulated_periods};
use super::fit_percent::{percent_when_left, spread};
use super::steps::Run;
use super::{FitLine, HoldChain, IdentifyError, Spectrum, SpectrumOptions, align, fit_percent, run_actuator, spectra};
use crate::plant::{Actuator, EscTiming, Law, Model, OperatingCurve, PlantError};
use crate::record::{Excitation, Experiment, Output, Record, Role};

/// A level has settled after this many time constants: e^-7 of the step, a thousandth, is left.
const SETTLED_TIME_CONSTANTS: f64 = 7.0;

/// In which domain a record is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// % fit of the model.
    pub fit_percent: f64,
    /// % fit that noise leaves to the true model; `None` where the record does not show its noise.
    pub ceiling_percent: Option<f64>,
    /// Where both are computed.
    pub domain: Domain,
}

/// Judges `model` on every record of `experiment`, in the experiment's order.
///
/// A compensated record is driven by its `esc_command`; in time that is the command held from row to row.
///
/// # Errors
/// [`IdentifyError::OtherOutput`] when the model was identified on the other response, [`IdentifyError::NotInModel`] when a
/// record's nominal command is outside the model's points, [`IdentifyError::Plant`] when the model cannot be simulated,
/// [`IdentifyError::NoEscCommand`] for a compensated record without that column, and what is wrong with a record itself.
pub fn validate(experiment: &Experiment, model: &Model) -> Result<Vec<RecordValidation>, IdentifyError> {
    if let Some(provenance) = &model.provenance
        && provenance.output != experiment.output
    {
        let (model, experiment) = (spectra::column(provenance.output), spectra::column(experiment.output));
        return Err(IdentifyError::OtherOutput { model, experiment });
    }
    experiment.records.iter().map(|record| Judge { experiment, model, record }.validation()).collect()
}

/// % fit and its ceiling.
type Score = (f64, Option<f64>);

/// One record and what it is judged with.
struct Judge<'a> {
    experiment: &'a Experiment,
    model: &'a Model,
    record: &'a Record,
}

impl Judge<'_> {
    fn validation(&self) -> Result<RecordValidation, IdentifyError> {
        let record = self.record;
        let ((fit_percent, ceiling_percent), domain) = match record.excitation {
            Excitation::Multisine => (self.in_frequency()?, Domain::Frequency),
            Excitation::Square | Excitation::Step | Excitation::Chirp => (self.around_nominal()?, Domain::Time),
            Excitation::Staircase | Excitation::Free => (self.over_range()?, Domain::Time),
        };
        Ok(RecordValidation {
            file: record.file.clone(),
            nominal: record.nominal,
            excitation: record.excitation,
            compensated: record.compensated,
            role: record.role,
            fit_percent,
            ceiling_percent,
            domain,
        })
    }

    fn in_frequency(&self) -> Result<Score, IdentifyError> {
        let lag =
            OperatingCurve::around_without_effects(self.model, self.record.nominal).map_err(|e| self.refused(e))?.lag;
        let spectrum = Spectrum::of(self.experiment, self.record, &SpectrumOptions::default())?;
        let holds =
            HoldChain::new(spectrum.row_rate_hz, self.experiment.command_rate_hz, self.experiment.esc_frame_hz)?;
        if !self.model.effects.is_empty() {
            return self.with_effects(&spectrum);
        }
        let (mut measured, mut expected, mut noise) = (Vec::new(), Vec::new(), 0.0);
        for line in &spectrum.lines {
            let filter = if self.record.compensated {
                line.esc_command.ok_or_else(|| self.no_esc_command())? / line.command
            } else {
                Complex64::ONE
            };
            let line = FitLine::new(line, &holds).behind(filter);
            expected.push(line.seen(|omega_rad_s| lag.frequency_response(omega_rad_s)));
            measured.push(line.response);
            noise += line.variance;
        }
        let percent = fit_percent(&measured, &expected).ok_or_else(|| self.constant_response())?;
        Ok((percent, Some(percent_when_left(noise, spread(&measured)))))
    }

    /// Effects may have no frequency response: the record is simulated, and its lines are the expected ones.
    fn with_effects(&self, spectrum: &Spectrum) -> Result<Score, IdentifyError> {
        let record = self.record;
        let (_, length) = spectra::period(record, spectrum.row_rate_hz)?;
        let actuator = self.actuator(Law::LinearAround(record.nominal))?;
        let rates = Rates { row_hz: spectrum.row_rate_hz, command_hz: self.experiment.command_rate_hz };
        let response = simulated_periods(actuator, self.command()?, length, spectrum.periods, rates)
            .map_err(|e| self.refused(e))?;
        // Through the same estimate, which takes drift out of both alike.
        let mut simulated = record.clone();
        let rows = response.len();
        for column in [&mut simulated.time_s, &mut simulated.command] {
            column.truncate(rows);
        }
        if let Some(esc_command) = &mut simulated.esc_command {
            esc_command.truncate(rows);
        }
        match self.experiment.output {
            Output::ThrustN => simulated.thrust_n = Some(response),
            Output::Rpm => simulated.rpm = Some(response),
        }
        let simulated = Spectrum::of(self.experiment, &simulated, &SpectrumOptions::default())?;
        let of =
            |harmonic: u32| simulated.lines.iter().find(|line| line.harmonic == harmonic).map(|line| line.response);
        let both = spectrum.lines.iter().filter_map(|line| Some((line.response, of(line.harmonic)?)));
        let (measured, expected): (Vec<Complex64>, Vec<Complex64>) = both.unzip();
        let noise = spectrum.lines.iter().map(|line| line.variance).sum();
        let percent = fit_percent(&measured, &expected).ok_or_else(|| self.constant_response())?;
        Ok((percent, Some(percent_when_left(noise, spread(&measured)))))
    }

    fn around_nominal(&self) -> Result<Score, IdentifyError> {
        let record = self.record;
        let measured = spectra::response_of(record, self.experiment.output)?;
        let command = self.command()?;
        let nominal = record.nominal;
        let tau_s = OperatingCurve::around_without_effects(self.model, nominal)
            .map_err(|e| self.refused(e))?
            .lag
            .time_constant_s;
        let mut actuator = self.actuator(Law::LinearAround(nominal))?;
        let model = run_actuator(&mut actuator, &record.time_s, command, 0);
        let simulated = align(&record.time_s, measured, &model, tau_s);
        let percent = fit_percent(measured, &simulated).ok_or_else(|| self.constant_response())?;
        let noise = match record.excitation {
            Excitation::Square => self.noise_between_periods(measured, &simulated)?,
            Excitation::Step => Run::of(record, self.experiment.output).ok().and_then(|run| {
                let time_constant_s = |_: f64| tau_s;
                Some(settled_variance(&run, &record.time_s, time_constant_s)? * measured.len() as f64)
            }),
            _ => None,
        };
        Ok((percent, noise.map(|noise| percent_when_left(noise, spread(measured)))))
    }

    fn over_range(&self) -> Result<Score, IdentifyError> {
        let (record, output) = (self.record, self.experiment.output);
        let raw = spectra::response_of(record, output)?;
        let command = self.command()?;
        let run = (record.excitation == Excitation::Staircase).then(|| Run::of(record, output)).transpose()?;
        let rows = run.as_ref().map_or(0..raw.len(), |run| run.rows());
        let kept: Vec<usize> = rows.clone().filter(|&row| run.as_ref().is_none_or(|run| !run.spike[row])).collect();
        let mut actuator = self.actuator(Law::FollowingLevel(command[rows.start]))?;
        let model = run_actuator(&mut actuator, &record.time_s, command, rows.start);
        let measured: Vec<f64> = kept.iter().map(|&row| raw[row]).collect();
        let mut simulated: Vec<f64> = kept.iter().map(|&row| model[row]).collect();
        if self.model.static_map.is_none() {
            // The integral of the gain has no zero of its own.
            let offset = measured.iter().zip(&simulated).map(|(y, m)| y - m).sum::<f64>() / measured.len() as f64;
            simulated.iter_mut().for_each(|m| *m += offset);
        }
        let percent = fit_percent(&measured, &simulated).ok_or_else(|| self.constant_response())?;
        let curve = OperatingCurve::without_effects(self.model).map_err(|e| self.refused(e))?;
        let time_constant_s = |command: f64| curve.clamped_at(command).lag.time_constant_s;
        let variance = run.and_then(|run| settled_variance(&run, &record.time_s, time_constant_s));
        Ok((percent, variance.map(|variance| percent_when_left(variance * measured.len() as f64, spread(&measured)))))
    }

    /// What the ESC got.
    fn command(&self) -> Result<&[f64], IdentifyError> {
        let record = self.record;
        let command = if record.compensated {
            let column = record.esc_command.as_deref().filter(|column| column.len() == record.time_s.len());
            column.ok_or_else(|| self.no_esc_command())?
        } else {
            &record.command
        };
        let constant = || IdentifyError::ConstantCommand { file: record.file.clone() };
        if command.windows(2).any(|pair| pair[0] != pair[1]) { Ok(command) } else { Err(constant()) }
    }

    fn actuator(&self, law: Law) -> Result<Actuator, IdentifyError> {
        let timing = EscTiming { frame_hz: self.experiment.esc_frame_hz, frame_phase: 0.0 };
        Actuator::new(self.model, law, timing).map_err(|e| self.refused(e))
    }

    /// Power, summed over the rows, of what the residual does not repeat from period to period; `None` with fewer than
    /// two whole periods. What the model gets wrong repeats and cancels, as does a response that the period has settled to;
    /// drift counts as noise.
    fn noise_between_periods(&self, measured: &[f64], simulated: &[f64]) -> Result<Option<f64>, IdentifyError> {
        let row_rate_hz = spectra::row_rate_hz(self.record, self.experiment.sample_rate_hz)?;
        let (_, length) = spectra::period(self.record, row_rate_hz)?;
        let residual: Vec<f64> = measured.iter().zip(simulated).map(|(y, m)| y - m).collect();
        let periods: Vec<&[f64]> = residual.chunks_exact(length).collect();
        if periods.len() < 2 {
            return Ok(None);
        }
        let count = periods.len() as f64;
        let variance = |row: usize| {
            let mean = periods.iter().map(|period| period[row]).sum::<f64>() / count;
            periods.iter().map(|period| (period[row] - mean).powi(2)).sum::<f64>() / (count - 1.0)
        };
        Ok(Some((0..length).map(variance).sum::<f64>() / length as f64 * measured.len() as f64))
    }

    fn refused(&self, error: PlantError) -> IdentifyError {
        match error {
            PlantError::Range(source) => IdentifyError::NotInModel { file: self.record.file.clone(), source },
            other => IdentifyError::Plant(other),
        }
    }

    fn no_esc_command(&self) -> IdentifyError {
        IdentifyError::NoEscCommand { file: self.record.file.clone() }
    }

    fn constant_response(&self) -> IdentifyError {
        IdentifyError::ConstantResponse { file: self.record.file.clone() }
    }
}

/// Mean variance of the response about its level on the plateaus of `run` that are long enough to settle at
/// `time_constant_s` of their command; `None` without any.
fn settled_variance(run: &Run, time_s: &[f64], time_constant_s: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut sum, mut rows) = (0.0, 0);
    for plateau in &run.plateaus {
        let settled = plateau.settled();
        let waited_s = time_s[settled.start] - time_s[plateau.rows.start];
        if waited_s >= SETTLED_TIME_CONSTANTS * time_constant_s(plateau.command) {
            sum += plateau.std * plateau.std * settled.len() as f64;
            rows += settled.len();
        }
    }
    (rows > 0).then(|| sum / rows as f64)
}
