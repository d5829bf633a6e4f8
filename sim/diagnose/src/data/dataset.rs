//! A record as the diagnosis compares it: what drove the actuator, what was measured, what is fitted and what is held out.

use serde::Serialize;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::rows::columns::response_column;
use rotorlead_identify::simulation::periodic::{commands_per_row, upsampled};
use rotorlead_numerics::sample::{mean, median};
use rotorlead_plant::{Lag, OperatingCurve};
use rotorlead_records::{Excitation, Experiment, Output, Record, Role, SAME_NOMINAL};

use super::auxiliary::{AuxiliaryChannel, auxiliary_channels};
use super::columns::{Channel, Column, channels};
use super::plateaus::cut::{Prepared, prepare};
use super::plateaus::groups::LogGroups;
use super::split::Split;
use crate::DiagnoseError;
use crate::noise::hum;
use crate::noise::whitening::Whitening;

/// Rows nearer to each other than this part of the time between two are taken at the same moment. Chosen: above the digits of stamps, and
/// far below a row; a response moves by a thousandth of what it does from row to row.
const SAME_ROW: f64 = 1e-3;
/// Of the periods of a record without a role these many of three are fitted, the rest is held out. Chosen: two of the usual three. Less
/// leaves one period, which does not show its noise.
const FITTED_THIRDS: usize = 2;
/// A line from row to row stands in for the commands between where it is off by less than this part of any sinusoid. Chosen: derivatives,
/// and so standard errors, may be off by as much; residuals are those of all commands. Lower costs time at slow rows.
const OFF_LINE: f64 = 0.03;

/// What was before a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Before {
    /// The nominal command, for long.
    Rest,
    /// The same periods.
    Periods,
}

/// Whole periods of a record.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// What it is for.
    pub split: Split,
    /// Its rows.
    pub rows: Range<usize>,
    /// Periods in it.
    pub periods: usize,
}

/// One record, prepared. Rows are shared with its copies.
#[derive(Clone, Debug)]
pub(crate) struct PreparedRecord {
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
    pub time_s: Arc<[f64]>,
    /// Times of the applied commands, seconds; several times a row where the command was updated faster than logged.
    pub command_s: Arc<[f64]>,
    /// The applied commands.
    pub command: Arc<[f64]>,
    /// How many times a row.
    pub commands_per_row: usize,
    /// The command half a tick before each row, through which a line from row to row goes where several commands are held between
    /// two; empty where there is one in each row, or such a line is too far off.
    pub first_order_hold: Arc<[f64]>,
    /// The response.
    pub measured: Arc<[f64]>,
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
    pub log: Option<Arc<LogGroups>>,
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
pub(crate) struct Dataset {
    /// The nominal commands, increasing.
    pub nominals: Vec<f64>,
    /// The records.
    pub records: Vec<PreparedRecord>,
    /// Those that are not compared.
    pub left_out: Vec<LeftOut>,
    /// A model over a range of levels, which staircases and the like follow, with the numbers at each nominal command.
    pub curve: Option<(OperatingCurve, Vec<Lag>)>,
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
        let mut sources: Vec<(&Record, Option<Prepared>)> = Vec::new();
        for source in &experiment.records {
            if source.excitation == Excitation::Steady {
                let reason = "a table of steady points shows no motion";
                left_out.push(LeftOut { file: source.file.clone(), reason });
                continue;
            }
            if source.excitation == Excitation::Flight {
                let reason = "in flight the command answers the response: effects of the ESC are looked for on a stand";
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
        let mut times = Vec::new();
        for (place, (source, prepared)) in sources.into_iter().enumerate() {
            let point = nominals.iter().position(|nominal| (nominal - source.nominal).abs() < SAME_NOMINAL);
            let point = point.unwrap_or_default();
            let mut record = match prepared {
                Some(prepared) => PreparedRecord::from_log(source, experiment.output, prepared, point)?,
                None => PreparedRecord::new(experiment, source, point)?,
            };
            record.place = place;
            record.split(source.role, kept_back);
            record.share_times(&mut times);
            records.push(record);
        }
        if records.is_empty() {
            // One of each: the motors of a vehicle are left out for the same reason.
            let reason = left_out.first().map(|left_out| left_out.reason);
            return Err(DiagnoseError::NothingToCompare { experiment: experiment.name.clone(), reason });
        }
        Ok(Self {
            nominals,
            records,
            left_out,
            curve: None,
            esc_frame_hz: experiment.esc_frame_hz,
            output: experiment.output,
        })
    }

    /// Whether the readings of logs stand still on most of their levels, by their resolution.
    pub fn stands_still(&self) -> bool {
        let logs = self.records.iter().filter_map(|record| record.log.as_ref());
        let still: Vec<bool> = logs
            .flat_map(|log| log.groups.iter().filter_map(|group| group.plateau.as_ref()))
            .map(|plateau| plateau.common_std > 0.0)
            .collect();
        2 * still.iter().filter(|still| **still).count() > still.len()
    }
}

impl Dataset {
    /// Whether any record does not repeat.
    pub fn has_logs(&self) -> bool {
        self.records.iter().any(|record| record.log.is_some())
    }

    /// Whether any record repeats.
    pub fn has_periodic(&self) -> bool {
        self.records.iter().any(|record| record.log.is_none())
    }

    /// The same with other records.
    pub fn with_records(&self, records: Vec<PreparedRecord>) -> Self {
        Self {
            nominals: self.nominals.clone(),
            records,
            left_out: self.left_out.clone(),
            curve: self.curve.clone(),
            esc_frame_hz: self.esc_frame_hz,
            output: self.output,
        }
    }

    /// The curve that a record over many levels follows, with its numbers at the record's nominal command.
    pub fn operating_curve(&self, record: &PreparedRecord) -> Option<(&OperatingCurve, Lag)> {
        let (curve, given) = self.curve.as_ref()?;
        let is_wide = record.log.is_some() && matches!(record.excitation, Excitation::Staircase | Excitation::Free);
        is_wide.then(|| (curve, given[record.point]))
    }
}

impl PreparedRecord {
    fn new(experiment: &Experiment, source: &Record, point: usize) -> Result<Self, DiagnoseError> {
        let file = || source.file.clone();
        let measured = response_column(source, experiment.output)?;
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
        let time_s: Arc<[f64]> = source.time_s.as_slice().into();
        let mut record = Self {
            file: file(),
            place: 0,
            point,
            nominal: source.nominal,
            excitation: source.excitation,
            amplitude,
            time_s: Arc::clone(&time_s),
            command_s: time_s,
            command: command.into(),
            commands_per_row: 1,
            first_order_hold: Arc::default(),
            measured: measured.into(),
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
        // Chosen: a tenth of the strongest line leaves a square wave its first nine harmonics, and a multisine all lines, which are alike.
        let highest = lines.iter().rposition(|line| line.norm() > 0.1 * most).unwrap_or(1);
        record.highest_hz = highest as f64 * rate_hz / periods.samples as f64;
        if source.excitation == Excitation::Multisine
            && let Some(command_rate_hz) = experiment.command_rate_hz
        {
            record.upsample_command(commands_per_row(command_rate_hz, rate_hz));
            if record.is_straight(command_rate_hz, experiment.esc_frame_hz.is_some()) {
                record.interpolate_command();
            }
        }
        Ok(record)
    }

    /// A record that does not repeat.
    fn from_log(source: &Record, output: Output, prepared: Prepared, point: usize) -> Result<Self, DiagnoseError> {
        let Prepared { rows, blocks, measured, mean_response, log } = prepared;
        let command = &applied(source)?[rows.clone()];
        let time_s = &source.time_s[rows.clone()];
        let mean_command = mean(command);
        // A command that stays is not listed again.
        let (command_s, changes) = source.command_changes(rows.clone()).unwrap_or_else(|| {
            let is_change = |row: &usize| *row == 0 || command[*row] != command[row - 1];
            (0..command.len()).filter(is_change).map(|row| (time_s[row], command[row])).unzip()
        });
        let interval_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0])).expect("a log has rows");
        Ok(Self {
            file: source.file.clone(),
            place: 0,
            point,
            nominal: source.nominal,
            excitation: source.excitation,
            amplitude: log.amplitude(command),
            command_s: command_s.into(),
            command: changes.into(),
            commands_per_row: 1,
            first_order_hold: Arc::default(),
            mean_command,
            mean_response,
            before: Before::Rest,
            hum: Vec::new(),
            rate_hz: interval_s.recip(),
            period_rows: measured.len(),
            repeats: false,
            highest_hz: 0.0,
            segments: Vec::new(),
            time_s: blocks.means(time_s).into(),
            measured: measured.into(),
            log: Some(Arc::new(log)),
            channels: channels(source, output, rows, &blocks),
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

    /// With what is among `known` of its times, which then has the others: many records are taken at the same ones.
    fn share_times(&mut self, known: &mut Vec<Arc<[f64]>>) {
        for times in [&mut self.time_s, &mut self.command_s] {
            match known.iter().find(|known| *known == times) {
                Some(known) => *times = Arc::clone(known),
                None => known.push(Arc::clone(times)),
            }
        }
    }

    /// Whole periods in the record.
    pub fn periods(&self) -> usize {
        self.time_s.len() / self.period_rows
    }

    fn split(&mut self, role: Option<Role>, kept_back: bool) {
        if let Some(log) = &mut self.log {
            let split = if role == Some(Role::Validate) { Split::Holdout } else { Split::Train };
            Arc::make_mut(log).assign(split, kept_back || role.is_some());
            return;
        }
        let periods = self.periods();
        let fitted = match role {
            Some(Role::Fit) => periods,
            Some(Role::Validate) => 0,
            None if kept_back => periods,
            None => (periods * FITTED_THIRDS).div_ceil(3),
        };
        for (split, range) in [(Split::Train, 0..fitted), (Split::Holdout, fitted..periods)] {
            if !range.is_empty() {
                let rows = range.start * self.period_rows..range.end * self.period_rows;
                self.segments.push(Segment { split, rows, periods: range.len() });
            }
        }
    }

    /// Whether something of it is fitted.
    pub fn is_fitted(&self) -> bool {
        match &self.log {
            Some(log) => log.groups.iter().any(|group| group.split == Split::Train && !group.rows.is_empty()),
            None => self.segments_in(Split::Train).next().is_some(),
        }
    }

    /// Its segments of a split, each with its index among all segments.
    pub fn segments_in(&self, split: Split) -> impl Iterator<Item = (usize, &Segment)> {
        self.segments.iter().enumerate().filter(move |(_, segment)| segment.split == split)
    }

    /// The record without the mains hum that the residual of the whole record shows.
    pub fn without_hum(mut self, residual: &[f64]) -> Self {
        let hum = hum::estimate_hum(residual, self.rate_hz, self.highest_hz);
        if !hum.is_empty() {
            self.measured = self.measured.iter().zip(&hum).map(|(measured, hum)| measured - hum).collect();
        }
        Self { hum, ..self }
    }

    /// The same with one period to fit instead of several, and nothing held out.
    pub fn with_one_period_fitted(&self) -> Self {
        let mut shorter = self.clone();
        shorter.segments.retain(|segment| segment.split == Split::Train);
        for segment in &mut shorter.segments {
            (segment.rows.end, segment.periods) = (segment.rows.start + self.period_rows, 1);
        }
        shorter
    }

    /// The same with nothing held out.
    pub fn with_all_fitted(&self) -> Self {
        let mut all = self.clone();
        all.segments.iter_mut().for_each(|segment| segment.split = Split::Train);
        all
    }

    /// Which columns it has beside the response.
    pub fn columns(&self) -> impl Iterator<Item = Column> {
        self.channels
            .iter()
            .map(|channel| channel.column)
            .chain(self.auxiliary_channels.iter().map(|auxiliary| auxiliary.column))
    }

    /// How many rows may be compared.
    pub fn rows(&self) -> usize {
        self.segments.iter().map(|segment| segment.rows.end).max().unwrap_or(self.time_s.len())
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
fn applied(source: &Record) -> Result<&[f64], IdentifyError> {
    if source.compensated {
        let file = || source.file.clone();
        source.esc_command.as_deref().ok_or_else(|| IdentifyError::NoEscCommand { file: file() })
    } else {
        Ok(&source.command)
    }
}
