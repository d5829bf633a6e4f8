//! Multisines around several commands, one record each.

use std::cell::Cell;

use miette::Diagnostic;
use rotorlead::link::LineSet;
use rotorlead::settings::Settings;
use rotorlead_plant::CompensatorDesign;
use rotorlead_plant::bench::file_stem;
use rotorlead_records::{Excitation, Experiment, Output, Record, Role};
use thiserror::Error;

use super::{DeviceError, Played, Sensors, Session, compensator, play};

/// What the records of a controller's motor have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The experiment without records.
    pub experiment: Experiment,
    /// The compensator of the motor, which those name that were recorded with it.
    pub compensator: CompensatorDesign,
}

impl Header {
    /// Of a motor of a controller with these settings, one row in `divisor` ticks, whose output frames come at `esc_frame_hz` and whose
    /// response is `output`.
    ///
    /// # Errors
    /// [`DeviceError::Setting`], where the settings make no compensator.
    pub fn new(
        settings: &Settings,
        motor: u8,
        divisor: u16,
        esc_frame_hz: f64,
        output: Output,
    ) -> Result<Self, DeviceError> {
        let loop_rate_hz = f64::from(settings.loop_rate_hz);
        let experiment = Experiment {
            name: "recorded by the controller".into(),
            output,
            sample_rate_hz: Some(loop_rate_hz / f64::from(divisor)),
            esc_frame_hz: Some(esc_frame_hz),
            command_rate_hz: (divisor > 1).then_some(loop_rate_hz),
            records: Vec::new(),
        };
        Ok(Self { experiment, compensator: compensator(settings, motor)? })
    }
}

/// Frames per second that an ESC gets while no flight controller sends any: those of DShot come with control ticks.
#[must_use]
pub fn bench_frame_hz(settings: &Settings) -> f64 {
    let own = f64::from(settings.output.frame_hz);
    let ticks = settings.clone().validate().ok().and_then(|settings| settings.bench_frame_ticks());
    ticks.map_or(own, |ticks| f64::from(settings.loop_rate_hz) / f64::from(ticks))
}

/// Where the records of one motor go, and what is made of them.
pub trait Keeper {
    /// What the user calls it.
    fn place(&self) -> String;

    /// Adds a record, which has no name yet, under the first free one that starts with `stem`, and gives the name.
    ///
    /// # Errors
    /// When it cannot be kept; then what was there is there still.
    fn add(&mut self, stem: &str, record: Record) -> miette::Result<String>;

    /// All that is kept there.
    ///
    /// # Errors
    /// When it cannot be read.
    fn experiment(&self) -> miette::Result<Experiment>;

    /// By which two results can be seen to rest on the same records, as [`Experiment::checksum`].
    fn checksum(&self) -> Option<String>;

    /// Keeps a file with the records, complete or not at all.
    ///
    /// # Errors
    /// When it cannot be kept.
    fn write(&mut self, name: &str, text: &str) -> miette::Result<()>;
}

/// `stem.csv`, or `stem_2.csv` where that is taken, and so on; `extension` has its dot.
#[must_use]
pub fn free_name(stem: &str, extension: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = |n: u32| if n == 1 { format!("{stem}{extension}") } else { format!("{stem}_{n}{extension}") };
    (1..).map(numbered).find(|name| !is_taken(name)).unwrap_or_default()
}

/// What is played on a motor around each command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Series {
    /// The motor, from 0.
    pub motor: u8,
    /// What is played around a command.
    pub signal: Signal,
    /// What measures the response.
    pub sensors: Sensors,
    /// What the records are for; the tools choose where none is given.
    pub role: Option<Role>,
}

/// A multisine around any command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// The lines.
    pub lines: LineSet,
    /// Peak deviation of the command.
    pub amplitude: f64,
    /// Periods that are kept; one more is played before them.
    pub periods: u16,
    /// One row in so many ticks.
    pub divisor: u16,
}

impl Signal {
    /// How long a motor turns for one record, seconds.
    #[must_use]
    pub fn seconds(&self, settings: &Settings) -> f64 {
        let around_s = (f64::from(settings.excitation.arm_ms) + 2.0 * f64::from(settings.excitation.ramp_ms)) / 1000.0;
        around_s + (f64::from(self.periods) + 1.0) * f64::from(self.lines.lines().period_s())
    }
}

/// Records that were kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Their names.
    pub files: Vec<String>,
    /// Their rows in all.
    pub rows: usize,
}

/// A series of records that ended early.
#[derive(Debug, Error, Diagnostic)]
#[error("{cause}; at --nominal {nominal}, after {rows} of {total} rows, which are not kept")]
#[diagnostic(help("{help}"))]
struct Broken {
    cause: DeviceError,
    nominal: f64,
    rows: usize,
    total: usize,
    help: String,
}

/// Has the controller play around each of the commands, and keeps the records. `progress` gets the rows of a record that are there, and
/// those that there will be.
///
/// # Errors
/// Those of [`play`] and of the keeper; the records before are kept.
pub fn excite(
    session: &mut Session,
    settings: &Settings,
    series: &Series,
    nominals: &[f64],
    keeper: &mut dyn Keeper,
    progress: &dyn Fn(usize, usize),
) -> miette::Result<Kept> {
    let mut kept = Kept::default();
    for (index, &nominal) in nominals.iter().enumerate() {
        let done = Cell::new((0, 0));
        let watch = |rows, total| {
            progress(rows, total);
            done.set((rows, total));
        };
        let record = series.record(session, settings, nominal, &watch).map_err(|cause| Broken {
            help: remedy(&cause, &nominals[index..], index, &keeper.place()),
            cause,
            nominal,
            rows: done.get().0,
            total: done.get().1,
        })?;
        kept.rows += record.time_s.len();
        kept.files.push(keeper.add(&file_stem(nominal, Excitation::Multisine), record)?);
    }
    Ok(kept)
}

impl Series {
    /// Plays and records around one command. The record has no name yet.
    fn record(
        &self,
        session: &mut Session,
        settings: &Settings,
        nominal: f64,
        progress: &dyn Fn(usize, usize),
    ) -> Result<Record, DeviceError> {
        let Signal { lines, amplitude, periods, divisor } = self.signal;
        let played = Played { motor: self.motor, lines, nominal, amplitude, periods, divisor };
        let excited = play(session, settings, &played, &self.sensors, progress)?;
        let record = excited.to_record(&played, settings, String::new(), &self.sensors)?;
        Ok(Record { role: self.role, ..record })
    }
}

/// What to do after the first of the commands that are left failed, where `index` records are kept.
fn remedy(cause: &DeviceError, left: &[f64], index: usize, place: &str) -> String {
    let own = cause.own_help();
    if index == 0 {
        return format!("{own}; nothing was written");
    }
    let left: Vec<String> = left.iter().map(ToString::to_string).collect();
    format!(
        "{own}; `{place}` holds the {index} records before: go on with the same command and --nominal {}",
        left.join(",")
    )
}
