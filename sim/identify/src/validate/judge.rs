//! One record, the model run on it, and what is left.

use num_complex::Complex64;
use rotorlead_plant::{Actuator, EscTiming, Law, Model, OperatingCurve, PlantError};
use rotorlead_records::{Excitation, Experiment, Output, Record};

use super::noise::{self, LevelNoise, PeriodNoise};
use super::residual_power::ResidualPower;
use super::slow_readings::SlowReadings;
use super::{ComparedLines, ComparedRow, Comparison, RecordValidation};
use crate::error::IdentifyError;
use crate::frequency_response::etfe::Etfe;
use crate::frequency_response::hold::HoldChain;
use crate::frequency_response::{FrequencyResponse, ResponseLine};
use crate::goodness_of_fit::{fit_percent, percent_with_residual, spread};
use crate::lag::first_order::FitLine;
use crate::lag::multisine::SMOOTHING_HALF_WIDTH;
use crate::lag::steps::Run;
use crate::rows::columns;
use crate::simulation::periodic::{Rates, simulated_periods};
use crate::simulation::{align, fit_initial_state, fit_offset_and_initial_state, run_record};
use crate::spectra::{Spectrum, SpectrumOptions};

/// One record and what it is judged with.
pub(super) struct Judge<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) model: &'a Model,
    pub(super) record: &'a Record,
}

/// What comes out of the comparison.
struct Score {
    fit_percent: f64,
    ceiling_percent: Option<f64>,
    residual_power: Option<ResidualPower>,
    comparison: Comparison,
}

impl Judge<'_> {
    pub(super) fn validation(&self) -> Result<RecordValidation, IdentifyError> {
        let record = self.record;
        let score = match record.excitation {
            Excitation::Multisine => self.in_frequency()?,
            Excitation::Square | Excitation::Triangle | Excitation::Step | Excitation::Chirp | Excitation::Random => {
                self.around_nominal()?
            }
            Excitation::Staircase | Excitation::Steady | Excitation::Flight | Excitation::Free => self.over_range()?,
        };
        Ok(RecordValidation {
            file: record.file.clone(),
            nominal: record.nominal,
            excitation: record.excitation,
            compensated: record.compensated,
            role: record.role,
            fitted: self.model.provenance.as_ref().map(|provenance| provenance.records.contains(&record.file)),
            fit_percent: score.fit_percent,
            ceiling_percent: score.ceiling_percent,
            residual_power: score.residual_power,
            comparison: score.comparison,
        })
    }

    fn in_frequency(&self) -> Result<Score, IdentifyError> {
        let lag =
            OperatingCurve::around_without_effects(self.model, self.record.nominal).map_err(|e| self.refused(e))?.lag;
        let mut spectrum = Spectrum::from_record(self.experiment, self.record, &SpectrumOptions::default())?;
        let holds =
            HoldChain::new(spectrum.row_rate_hz, self.experiment.command_rate_hz, self.experiment.esc_frame_hz)?;
        let (mut expected, mut without_holds) = (Vec::new(), Vec::new());
        if self.model.effects.is_empty() {
            for line in &spectrum.lines {
                let filter = if self.record.compensated {
                    line.esc_command.ok_or_else(|| self.no_esc_command())? / line.command
                } else {
                    Complex64::ONE
                };
                without_holds.push(filter * lag.frequency_response(line.omega_rad_s));
                let line = FitLine::new(line, &holds).behind(filter);
                expected.push(line.seen(|omega_rad_s| lag.frequency_response(omega_rad_s)));
            }
        } else {
            expected = self.simulated_lines(&mut spectrum)?;
            // What a simulation shows has the holds in it, and they cannot be taken out again.
            without_holds.clone_from(&expected);
        }
        let measured: Vec<Complex64> = spectrum.lines.iter().map(crate::spectra::SpectralLine::ratio).collect();
        // Both the noise of the response over the command and the fit count each line alike.
        let noise = spectrum.lines.iter().map(crate::spectra::SpectralLine::ratio_variance).sum();
        let percent = fit_percent(&measured, &expected).ok_or_else(|| self.constant_response())?;
        Ok(Score {
            fit_percent: percent,
            ceiling_percent: Some(percent_with_residual(noise, spread(&measured))),
            residual_power: ResidualPower::at_lines(&spectrum.lines, &expected),
            comparison: Comparison::Frequency(compared(&spectrum, &expected, without_holds)?),
        })
    }

    /// Response over command at the lines of a record. Effects may have no frequency response, so the record is simulated;
    /// lines that are not in both are taken out of `spectrum`.
    fn simulated_lines(&self, spectrum: &mut Spectrum) -> Result<Vec<Complex64>, IdentifyError> {
        let record = self.record;
        let (_, length) = columns::period_rows(record, spectrum.row_rate_hz)?;
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
        let simulated = Spectrum::from_record(self.experiment, &simulated, &SpectrumOptions::default())?;
        let of = |harmonic: u32| simulated.lines.iter().find(|line| line.harmonic == harmonic);
        spectrum.lines.retain(|line| of(line.harmonic).is_some());
        Ok(spectrum.lines.iter().filter_map(|line| Some(of(line.harmonic)?.response / line.command)).collect())
    }

    fn around_nominal(&self) -> Result<Score, IdentifyError> {
        let record = self.record;
        let raw = columns::response_column(record, self.experiment.output)?;
        let command = self.command()?;
        let nominal = record.nominal;
        let tau_s = OperatingCurve::around_without_effects(self.model, nominal)
            .map_err(|e| self.refused(e))?
            .lag
            .time_constant_s;
        let mut actuator = self.actuator(Law::LinearAround(nominal))?;
        let momentary = run_record(&mut actuator, record, command, 0);
        // Periods are compared row by row, repeats included.
        let readings = match record.excitation {
            Excitation::Step => SlowReadings::find(record, raw),
            _ => SlowReadings::default(),
        };
        let kept: Vec<usize> = (0..raw.len()).filter(|&row| !readings.repeats(row)).collect();
        let of_kept = |values: &[f64]| kept.iter().map(|&row| values[row]).collect::<Vec<f64>>();
        let (time_s, measured) = (&of_kept(&record.time_s)[..], &of_kept(raw)[..]);
        let aligned = |model: Vec<f64>| {
            let simulated = align(time_s, measured, &of_kept(&model), tau_s);
            (fit_percent(measured, &simulated), simulated, Vec::new())
        };
        let (percent, simulated, _) = readings.better(&record.time_s, momentary, aligned);
        let percent = percent.ok_or_else(|| self.constant_response())?;
        let residual: Vec<f64> = measured.iter().zip(&simulated).map(|(y, m)| y - m).collect();
        let rows = measured.len() as f64;
        let (noise, residual_power) = match record.excitation {
            Excitation::Square | Excitation::Triangle => {
                let row_rate_hz = columns::row_rate_hz(record, self.experiment.sample_rate_hz)?;
                let (_, length) = columns::period_rows(record, row_rate_hz)?;
                let noise =
                    PeriodNoise::estimate(&residual, length).filter(|noise| noise::shows(noise.variance, measured));
                (noise.as_ref().map(|noise| noise.variance * rows), noise.and_then(|noise| noise.residual_power()))
            }
            Excitation::Step => {
                let noise = Run::longest(record, self.experiment.output)
                    .ok()
                    .and_then(|run| LevelNoise::estimate(&run, &record.time_s, |_| tau_s))
                    .filter(|noise| noise::shows(noise.variance, measured));
                let residual_power = noise.as_ref().and_then(|noise| {
                    noise
                        .residual_power(kept.iter().copied().zip(residual.iter().copied()), |row| readings.repeats(row))
                });
                (noise.map(|noise| noise.variance * rows), residual_power)
            }
            _ => (None, None),
        };
        Ok(Score {
            fit_percent: percent,
            ceiling_percent: noise.map(|noise| percent_with_residual(noise, spread(measured))),
            residual_power,
            comparison: Comparison::Time(compared_rows(time_s, measured, &simulated)),
        })
    }

    fn over_range(&self) -> Result<Score, IdentifyError> {
        let (record, output) = (self.record, self.experiment.output);
        let raw = columns::response_column(record, output)?;
        let command = self.command()?;
        let run = (record.excitation == Excitation::Staircase).then(|| Run::longest(record, output)).transpose()?;
        let rows = run.as_ref().map_or(0..raw.len(), |run| run.rows());
        let shown = run.as_ref().map(Run::unclipped_rows);
        let shows = |row: usize| shown.as_ref().is_none_or(|shown| shown[row - rows.start]);
        let nothing = run.as_ref().map(|run| run.rows_without_lag(&record.time_s));
        let readings = SlowReadings::find(record, raw);
        let says = |row: &usize| {
            shows(*row) && !nothing.as_ref().is_some_and(|nothing| nothing[*row]) && !readings.repeats(*row)
        };
        let kept: Vec<usize> = rows.clone().filter(says).collect();
        let mut actuator = self.actuator(Law::FollowingLevel(command[rows.start]))?;
        let momentary = run_record(&mut actuator, record, command, rows.start);
        let of_kept = |values: &[f64]| kept.iter().map(|&row| values[row]).collect::<Vec<f64>>();
        let (time_s, measured) = (of_kept(&record.time_s), of_kept(raw));
        let curve = OperatingCurve::without_effects(self.model).map_err(|e| self.refused(e))?;
        let time_constant_s = |command: f64| curve.clamped_at(command).lag.time_constant_s;
        // The record may begin before the response has settled, and a model must not be judged by what came before.
        let tau_s = time_constant_s(command[rows.start]);
        let aligned = |model: Vec<f64>| {
            let mut simulated = of_kept(&model);
            let (offset, start) = match self.model.static_map {
                Some(_) => (0.0, fit_initial_state(&time_s, &measured, &simulated, tau_s)),
                // The integral of the gain has no zero of its own.
                None => fit_offset_and_initial_state(&time_s, &measured, &simulated, tau_s),
            };
            let free = |t_s: f64| offset + start * (-(t_s - time_s[0]) / tau_s).exp();
            simulated.iter_mut().zip(&time_s).for_each(|(m, &t_s)| *m += free(t_s));
            let left = record.time_s.iter().zip(&model).map(|(&t_s, model)| model + free(t_s)).collect::<Vec<f64>>();
            (fit_percent(&measured, &simulated), simulated, left)
        };
        let (percent, simulated, model) = readings.better(&record.time_s, momentary, aligned);
        let percent = percent.ok_or_else(|| self.constant_response())?;
        let noise = run
            .as_ref()
            .and_then(|run| LevelNoise::estimate(run, &record.time_s, time_constant_s))
            .filter(|noise| noise::shows(noise.variance, raw));
        let residual_power = run.as_ref().zip(noise.as_ref()).and_then(|(run, noise)| {
            let residual = |row: usize| run.clean[row] - model[row];
            noise.residual_power(kept.iter().map(|&row| (row, residual(row))), |row| readings.repeats(row))
        });
        let residual = noise.map(|noise| noise.variance * measured.len() as f64);
        Ok(Score {
            fit_percent: percent,
            ceiling_percent: residual.map(|residual| percent_with_residual(residual, spread(&measured))),
            residual_power,
            comparison: Comparison::Time(compared_rows(&time_s, &measured, &simulated)),
        })
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

/// The lines for a figure: `expected` is the model with the holds, `model` without.
fn compared(
    spectrum: &Spectrum,
    expected: &[Complex64],
    model: Vec<Complex64>,
) -> Result<ComparedLines, IdentifyError> {
    let holds: Vec<Complex64> = expected.iter().zip(&model).map(|(seen, model)| seen / model).collect();
    let etfe = Etfe::new(&spectrum.lines, expected, SMOOTHING_HALF_WIDTH)?.divided_by(&holds)?;
    let line = |point: &crate::frequency_response::etfe::ResponsePoint| ResponseLine {
        omega_rad_s: point.omega_rad_s,
        response: point.response,
        variance: point.variance,
    };
    Ok(ComparedLines {
        raw: etfe.raw().iter().map(|point| point.response).collect(),
        smoothed: FrequencyResponse {
            lines: etfe.smoothed().iter().map(line).collect(),
            ..FrequencyResponse::from_spectrum(spectrum)
        },
        model,
    })
}

fn compared_rows(time_s: &[f64], measured: &[f64], model: &[f64]) -> Vec<ComparedRow> {
    let row = |((&time_s, &measured), &model): ((&f64, &f64), &f64)| ComparedRow { time_s, measured, model };
    time_s.iter().zip(measured).zip(model).map(row).collect()
}
