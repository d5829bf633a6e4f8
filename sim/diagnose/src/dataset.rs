//! A record as the diagnosis compares it: what drove the actuator, what was measured, what is fitted and what is held out.

use serde::Serialize;
use std::f64::consts::TAU;
use std::ops::Range;

use rotorlead_identify::{IdentifyError, response_of, upsampled};
use rotorlead_numerics::sample::{mean, median};
use rotorlead_plant::{Lag, OperatingCurve, Trace};
use rotorlead_records::{Excitation, Experiment, Output, Record as SourceRecord, Role};

use super::auxiliary::{AuxiliaryChannel, auxiliary_channels};
use super::channel::{Channel, Column, channels};
use super::hypothesis::Hypothesis;
use super::log::{Log, Prepared, prepare};
use super::whitening::{NoiseDensity, Whitening};
use super::{DiagnoseError, hum};

/// Commands closer than this are the same nominal command; a 12-bit command is 2.4e-4.
const SAME_NOMINAL: f64 = 1e-6;
/// Rows nearer to each other than this part of the time between two are taken at the same moment.
const SAME_ROW: f64 = 1e-3;
/// Of the periods of a record without a role these many of three are fitted, the rest is held out.
const FITTED_THIRDS: usize = 2;
/// A line from row to row stands in for the commands between where it is off by less than this part of any sinusoid.
const OFF_LINE: f64 = 0.03;

/// What a segment of a record is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Parameters are fitted to it.
    Train,
    /// It is kept out of every fit.
    Holdout,
}

/// What was before a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Before {
    /// The nominal command, for long.
    Rest,
    /// The same periods.
    Periods,
}

/// Whether the response at the begin of a record is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InitialCondition {
    /// It may be anything.
    Free,
    /// It is what was before ([`Before`]).
    Steady,
}

/// Whole periods of a record.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    /// What it is for.
    pub split: Split,
    /// Its rows.
    pub rows: Range<usize>,
    /// Periods in it.
    pub periods: usize,
    /// What makes its residual white.
    pub whitening: Whitening,
}

/// One record, prepared.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// The record's file.
    pub file: String,
    /// Its place among the records.
    pub place: usize,
    /// Which of the nominal commands.
    pub point: usize,
    /// The nominal command, 0..1.
    pub nominal: f64,
    /// What drove it.
    pub excitation: Excitation,
    /// Largest deviation of the command from its mean.
    pub amplitude: f64,
    /// Rows, seconds.
    pub time_s: Vec<f64>,
    /// Times of the applied commands, seconds; several times a row where the command was updated faster than logged.
    pub command_s: Vec<f64>,
    /// The applied commands.
    pub command: Vec<f64>,
    /// How many times a row.
    pub commands_per_row: usize,
    /// The command half a tick before each row, through which a line from row to row goes where several commands are held between
    /// two; empty where there is one in each row, or such a line is too far off.
    pub first_order_hold: Vec<f64>,
    /// The response.
    pub measured: Vec<f64>,
    /// Mean command and response over the whole periods.
    pub mean_command: f64,
    /// Mean response over the whole periods.
    pub mean_response: f64,
    /// What was before the record.
    pub before: Before,
    /// Mains hum, which is no part of `measured` any more; empty where there is none.
    pub hum: Vec<f64>,
    /// Rows per second.
    pub rate_hz: f64,
    /// Rows of a period.
    pub period_rows: usize,
    /// Whether commands and rows are the same in every period, so that a simulation of one may do for the others.
    pub repeats: bool,
    /// Highest frequency that is excited, hertz.
    pub highest_hz: f64,
    /// What is fitted and what is held out, in the order of time; empty for a record that does not repeat.
    pub segments: Vec<Segment>,
    /// What a record that does not repeat has in their place.
    pub log: Option<Log>,
    /// What was measured beside the response of a record that does not repeat.
    pub channels: Vec<Channel>,
    /// The same of one that repeats.
    pub auxiliary_channels: Vec<AuxiliaryChannel>,
}

/// A record that is not compared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct LeftOut {
    /// Its file.
    pub file: String,
    /// Why.
    #[serde(skip)]
    pub reason: &'static str,
}

/// All that is compared.
#[derive(Clone, Debug)]
pub(super) struct Dataset {
    /// The nominal commands, increasing.
    pub nominals: Vec<f64>,
    /// The records.
    pub records: Vec<Record>,
    /// Those that are not compared.
    pub left_out: Vec<LeftOut>,
    /// A model over a range of levels, which staircases and the like follow, with the numbers at each nominal command.
    pub curve: Option<(OperatingCurve, Vec<Lag>)>,
    /// Whether it is a part, which may not determine all that is searched: values are then tied to where the effect is not.
    pub is_part: bool,
    /// Whether the response at the begin of each record is compared.
    pub initial_condition: InitialCondition,
    /// Rate of the ESC's frames, where the experiment says it.
    pub esc_frame_hz: Option<f64>,
    /// What the response is.
    pub output: Output,
}

impl Dataset {
    /// Prepares the records of an experiment, to be compared with a given model or with one that is found.
    ///
    /// # Errors
    /// [`DiagnoseError`] where no record can be compared, or one is not what it says it is.
    pub fn new(experiment: &Experiment, is_model_given: bool) -> Result<Self, DiagnoseError> {
        // How a speed follows from the command is read off level by level, and is not an effect. That of a given model is judged.
        let has_free_map = !is_model_given && experiment.output == Output::Rpm;
        let mut left_out = Vec::new();
        let mut sources: Vec<(&SourceRecord, Option<Prepared>)> = Vec::new();
        for source in &experiment.records {
            if source.excitation == Excitation::Steady {
                let reason = "a table of steady points shows no motion";
                left_out.push(LeftOut { file: source.file.clone(), reason });
                continue;
            }
            let prepared =
                if source.excitation.is_periodic() { None } else { prepare(source, experiment.output, has_free_map)? };
            if source.excitation.is_periodic() || prepared.is_some() {
                sources.push((source, prepared));
            } else {
                let reason = "the motor runs steadily on no two plateaus in a row";
                left_out.push(LeftOut { file: source.file.clone(), reason });
            }
        }
        let mut nominals: Vec<f64> = Vec::new();
        for (source, _) in &sources {
            if !nominals.iter().any(|nominal| (nominal - source.nominal).abs() < SAME_NOMINAL) {
                nominals.push(source.nominal);
            }
        }
        nominals.sort_by(f64::total_cmp);
        // Where the experiment itself keeps records back, these are what is held out.
        let kept_back = sources.iter().any(|(source, _)| source.role == Some(Role::Validate));
        let mut records = Vec::new();
        for (place, (source, prepared)) in sources.into_iter().enumerate() {
            let point = nominals.iter().position(|nominal| (nominal - source.nominal).abs() < SAME_NOMINAL);
            let point = point.unwrap_or_default();
            let mut record = match prepared {
                Some(prepared) => Record::of_log(source, experiment.output, prepared, point)?,
                None => Record::new(experiment, source, point)?,
            };
            record.place = place;
            record.split(source.role, kept_back);
            records.push(record);
        }
        if records.is_empty() {
            return Err(DiagnoseError::NothingToCompare { experiment: experiment.name.clone() });
        }
        Ok(Self {
            nominals,
            records,
            left_out,
            curve: None,
            is_part: false,
            initial_condition: InitialCondition::Free,
            esc_frame_hz: experiment.esc_frame_hz,
            output: experiment.output,
        })
    }
}

impl Dataset {
    /// The curve that a record over many levels follows, with its numbers at the record's nominal command.
    pub fn curve_of(&self, record: &Record) -> Option<(&OperatingCurve, Lag)> {
        let (curve, given) = self.curve.as_ref()?;
        let is_wide = record.log.is_some() && matches!(record.excitation, Excitation::Staircase | Excitation::Free);
        is_wide.then(|| (curve, given[record.point]))
    }
}

impl Record {
    fn new(experiment: &Experiment, source: &SourceRecord, point: usize) -> Result<Self, DiagnoseError> {
        let file = || source.file.clone();
        let measured = response_of(source, experiment.output)?;
        let command = applied(source)?;
        let rate_hz = source.sample_rate_hz()?;
        let periods = source.periods()?;
        let rows = periods.samples * periods.count;
        let (mean_command, mean_response) = (mean(&command[..rows]), mean(&measured[..rows]));
        let amplitude = command[..rows].iter().fold(0.0_f64, |most, u| most.max((u - mean_command).abs()));
        if command[..rows].iter().all(|u| *u == command[0]) {
            return Err(IdentifyError::ConstantCommand { file: file() }.into());
        }
        if measured[..rows].iter().all(|y| *y == measured[0]) {
            return Err(IdentifyError::ConstantResponse { file: file() }.into());
        }
        let mut record = Self {
            file: file(),
            place: 0,
            point,
            nominal: source.nominal,
            excitation: source.excitation,
            amplitude,
            time_s: source.time_s.clone(),
            command_s: source.time_s.clone(),
            command: command.to_vec(),
            commands_per_row: 1,
            first_order_hold: Vec::new(),
            measured: measured.to_vec(),
            mean_command,
            mean_response,
            before: Before::Rest,
            hum: Vec::new(),
            rate_hz,
            period_rows: periods.samples,
            repeats: repeats(command, &source.time_s, periods.samples),
            highest_hz: 0.0,
            segments: Vec::new(),
            log: None,
            channels: Vec::new(),
            auxiliary_channels: auxiliary_channels(source, experiment.output, periods.samples, rate_hz),
        };
        let lines = Whitening::unit(periods.samples).spectrum(&command[..periods.samples]);
        let most = lines.iter().skip(1).map(|line| line.norm()).fold(0.0, f64::max);
        let highest = lines.iter().rposition(|line| line.norm() > 0.1 * most).unwrap_or(1);
        record.highest_hz = highest as f64 * rate_hz / periods.samples as f64;
        if source.excitation == Excitation::Multisine
            && let Some(command_rate_hz) = experiment.command_rate_hz
        {
            record.upsample_command((command_rate_hz / rate_hz).round() as usize);
            if record.is_straight(command_rate_hz, experiment.esc_frame_hz.is_some()) {
                record.interpolate_command();
            }
        }
        Ok(record)
    }

    /// A record that does not repeat.
    fn of_log(source: &SourceRecord, output: Output, prepared: Prepared, point: usize) -> Result<Self, DiagnoseError> {
        let Prepared { rows, blocks, measured, mean_response, log } = prepared;
        let command = &applied(source)?[rows.clone()];
        let time_s = &source.time_s[rows.clone()];
        let mean_command = mean(command);
        // A command that stays is not listed again.
        let changes: Vec<usize> =
            (0..command.len()).filter(|&row| row == 0 || command[row] != command[row - 1]).collect();
        let interval_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0])).expect("a log has rows");
        Ok(Self {
            file: source.file.clone(),
            place: 0,
            point,
            nominal: source.nominal,
            excitation: source.excitation,
            amplitude: log.amplitude(command),
            command_s: changes.iter().map(|&row| time_s[row]).collect(),
            command: changes.iter().map(|&row| command[row]).collect(),
            commands_per_row: 1,
            first_order_hold: Vec::new(),
            mean_command,
            mean_response,
            before: Before::Rest,
            hum: Vec::new(),
            rate_hz: interval_s.recip(),
            period_rows: measured.len(),
            repeats: false,
            highest_hz: 0.0,
            segments: Vec::new(),
            time_s: blocks.means(time_s),
            measured,
            log: Some(log),
            channels: channels(source, output, (rows, &blocks)),
            auxiliary_channels: Vec::new(),
        })
    }

    /// A command that moved between rows: the lines of its period say how.
    fn upsample_command(&mut self, per_row: usize) {
        if per_row < 2 {
            return;
        }
        let period = upsampled(&self.command[..self.period_rows], per_row);
        let count = self.time_s.len() * per_row;
        let (begin_s, rate_hz) = (self.time_s[0], self.rate_hz * per_row as f64);
        self.command = period.iter().copied().cycle().take(count).collect();
        self.command_s = (0..count).map(|tick| begin_s + tick as f64 / rate_hz).collect();
        self.commands_per_row = per_row;
    }

    /// Whether a line from row to row is off by less than [`OFF_LINE`] of the highest sinusoid of the command: by `(w h)^2 / 12`, `h`
    /// the time between rows; and of frames, which take a command over at any age within a tick, by half a tick.
    fn is_straight(&self, command_rate_hz: f64, has_frames: bool) -> bool {
        let turns = |rate_hz: f64| TAU * self.highest_hz / rate_hz;
        let by_frames = if has_frames { 0.5 * turns(command_rate_hz) } else { 0.0 };
        self.commands_per_row > 1 && turns(self.rate_hz).powi(2) / 12.0 < OFF_LINE && by_frames < OFF_LINE
    }

    fn interpolate_command(&mut self) {
        // A command that is held comes half a tick later than a line through it. The period has run before.
        let period = self.period_rows * self.commands_per_row;
        let before = |tick: usize| self.command[tick.checked_sub(1).unwrap_or(period - 1)];
        let rows = (0..self.command.len()).step_by(self.commands_per_row);
        self.first_order_hold = rows.map(|tick| 0.5 * (before(tick) + self.command[tick])).collect();
    }

    /// Whole periods in the record.
    pub fn periods(&self) -> usize {
        self.time_s.len() / self.period_rows
    }

    fn split(&mut self, role: Option<Role>, kept_back: bool) {
        if let Some(log) = &mut self.log {
            log.has_role = kept_back || role.is_some();
            let split = if role == Some(Role::Validate) { Split::Holdout } else { Split::Train };
            log.assign(|_| split);
            self.assign_channels();
            return;
        }
        let periods = self.periods();
        let fitted = match role {
            Some(Role::Fit) => periods,
            Some(Role::Validate) => 0,
            None if kept_back => periods,
            None => (periods * FITTED_THIRDS).div_ceil(3),
        };
        let mut segments = Vec::new();
        for (split, range) in [(Split::Train, 0..fitted), (Split::Holdout, fitted..periods)] {
            if !range.is_empty() {
                let rows = range.start * self.period_rows..range.end * self.period_rows;
                let whitening = Whitening::unit(rows.len());
                segments.push(Segment { split, rows, periods: range.len(), whitening });
            }
        }
        self.segments = segments;
    }

    /// Makes the channels' filters anew for what the rows are for.
    pub fn assign_channels(&mut self) {
        let mut channels = std::mem::take(&mut self.channels);
        channels.iter_mut().for_each(|channel| channel.assign(self));
        self.channels = channels;
    }

    /// Takes noise and errors of a record that does not repeat, and of the columns beside the response, from what a hypothesis
    /// leaves of them.
    pub fn weigh_by(&mut self, all: &Dataset, hypothesis: &Hypothesis) -> Option<()> {
        if let Some(log) = &self.log {
            let difference = hypothesis.difference(all, self)?;
            let free = log.free(&difference, &self.time_s, hypothesis.base[self.point].time_constant_s);
            let left: Vec<f64> = difference.iter().zip(free).map(|(left, free)| left - free).collect();
            self.weigh(&left);
        }
        if !self.channels.is_empty() {
            let trace = hypothesis.trace(all, self)?;
            self.weigh_channels(&trace);
        }
        Some(())
    }

    /// Takes the noise of the channels from what a model leaves of them.
    pub fn weigh_channels(&mut self, trace: &Trace) {
        let mut channels = std::mem::take(&mut self.channels);
        channels.iter_mut().for_each(|channel| channel.weigh(self, trace));
        self.channels = channels;
    }

    /// Takes mains hum out of the measurement: what of it a residual of the whole record shows.
    pub fn take_hum_out(&mut self, residual: &[f64]) {
        let hum = hum::find(residual, self.rate_hz, self.highest_hz);
        self.measured.iter_mut().zip(&hum).for_each(|(measured, hum)| *measured -= hum);
        self.hum = hum;
    }

    /// Takes the noise from a residual of the whole record: from what of it does not repeat.
    pub fn weigh(&mut self, residual: &[f64]) {
        if let Some(log) = &mut self.log {
            let simulated: Vec<f64> = self.measured.iter().zip(residual).map(|(y, left)| y - left).collect();
            log.weigh(residual, &simulated);
            return;
        }
        let rows = 0..self.periods() * self.period_rows;
        let periods = self.periods();
        let Some(density) = NoiseDensity::between_harmonics(&residual[rows], periods, self.rate_hz) else { return };
        for segment in &mut self.segments {
            segment.whitening.set_noise(&density, self.rate_hz);
        }
    }

    /// The same with one period to fit instead of several, and nothing held out.
    pub fn with_one_period_fitted(&self) -> Self {
        let mut shorter = self.clone();
        shorter.segments.retain(|segment| segment.split == Split::Train);
        for segment in shorter.segments.iter_mut().filter(|segment| segment.periods > 1) {
            let rows = segment.rows.start..segment.rows.start + self.period_rows;
            *segment =
                Segment { rows, periods: 1, whitening: segment.whitening.shortened(segment.periods), ..*segment };
        }
        shorter
    }

    /// Which columns it has beside the response.
    pub fn columns(&self) -> impl Iterator<Item = Column> {
        self.channels
            .iter()
            .map(|channel| channel.column)
            .chain(self.auxiliary_channels.iter().map(|auxiliary| auxiliary.column))
    }

    /// Standard deviation of the noise of a row, the largest of the segments; of settled rows where there are none.
    pub fn noise_std(&self) -> f64 {
        let of_segments = self.segments.iter().map(|segment| segment.whitening.row_variance().sqrt());
        let of_groups = self.log.iter().flat_map(|log| &log.groups).map(|group| group.noise);
        of_segments.chain(of_groups).fold(0.0, f64::max)
    }

    /// Up to which row something is compared in this split.
    pub fn end_of(&self, split: Option<Split>) -> usize {
        if let Some(log) = &self.log {
            return if split.is_none_or(|split| log.has(split)) { self.time_s.len() } else { 0 };
        }
        let compared = self.segments.iter().filter(|segment| split.is_none_or(|wanted| segment.split == wanted));
        compared.map(|segment| segment.rows.end).max().unwrap_or(0)
    }
}

/// Whether each period has the commands of the first, at the same times but for [`SAME_ROW`].
fn repeats(command: &[f64], time_s: &[f64], period_rows: usize) -> bool {
    let rows = time_s.len();
    let Some(period_s) = time_s.get(period_rows).map(|end_s| end_s - time_s[0]) else { return false };
    let off_s = SAME_ROW * period_s / period_rows as f64;
    (period_rows..rows).all(|row| {
        let before = row - period_rows;
        command[row] == command[before] && (time_s[row] - time_s[before] - period_s).abs() <= off_s
    })
}

/// The command to the ESC at each row.
fn applied(source: &SourceRecord) -> Result<&[f64], IdentifyError> {
    if source.compensated {
        let file = || source.file.clone();
        source.esc_command.as_deref().ok_or_else(|| IdentifyError::NoEscCommand { file: file() })
    } else {
        Ok(&source.command)
    }
}
