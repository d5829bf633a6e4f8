//! `rotorlead device excite`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::Diagnostic;
use rotorlead::link::LineSet;
use rotorlead::settings::Settings;
use rotorlead_device::{DeviceError, Played, Sensors, Session};
use rotorlead_plant::bench::file_stem;
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::{Excitation, Record, Role};
use serde_json::json;
use thiserror::Error;

use super::folder::ExperimentFolder;
use super::record::Sensor;
use super::{bench_frame_hz, own_help};
use crate::outcome::Outcome;
use crate::parameters::number;
use crate::progress;

#[derive(Args, Debug)]
pub(super) struct Excite {
    /// The experiment's folder: it is made, or the records are added to the experiment that is there
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Commands around which to play, one record each
    #[arg(long, value_name = "U,U,...", value_delimiter = ',', required = true, value_parser = number(AcceptedRange::DUTY))]
    pub(super) nominal: Vec<f64>,
    /// The motor, from 0
    #[arg(long, default_value_t = 0)]
    pub(super) motor: u8,
    /// The speed that the motor may not reach, revolutions per minute; all stops beyond it
    #[arg(long, value_name = "RPM", value_parser = number(AcceptedRange::NUMBER), requires = "motor_poles")]
    pub(super) most_rpm: Option<f64>,
    #[command(flatten)]
    pub(super) played: PlayedArguments,
    #[command(flatten)]
    pub(super) sensor: Sensor,
    /// What the records are for; the tools choose where none is given.
    #[arg(skip)]
    pub(super) role: Option<Role>,
}

/// What is played around each command.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct PlayedArguments {
    /// Peak deviation of the command
    #[arg(long, value_name = "U", default_value = "0.05", value_parser = number(AcceptedRange::AMPLITUDE))]
    pub(super) amplitude: f64,
    /// The lines
    #[arg(long, value_enum, default_value_t = Lines::Hz30)]
    lines: Lines,
    /// Periods to keep; one more is played before them
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    periods: u16,
    /// One row in so many control ticks
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=5000))]
    divisor: u16,
}

impl PlayedArguments {
    /// How long a motor turns for one record, seconds.
    pub(super) fn seconds(self, settings: &Settings) -> f64 {
        let around_s = (f64::from(settings.excitation.arm_ms) + 2.0 * f64::from(settings.excitation.ramp_ms)) / 1000.0;
        around_s + (f64::from(self.periods) + 1.0) * f64::from(self.lines.set().lines().period_s())
    }
}

/// A set of lines that the controller has.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Lines {
    /// 150 lines up to 29.9 Hz, to identify a motor
    #[value(name = "30hz")]
    Hz30,
    /// 225 lines up to 44.9 Hz, to validate a compensated one
    #[value(name = "45hz")]
    Hz45,
}

impl Lines {
    fn set(self) -> LineSet {
        match self {
            Self::Hz30 => LineSet::Odd30Hz,
            Self::Hz45 => LineSet::Odd45Hz,
        }
    }
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

impl Excite {
    pub(super) fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        // No input is live: output frames come at their own rate.
        let frame_hz = bench_frame_hz(&settings);
        let sensors = Sensors { most_rpm: self.most_rpm, ..self.sensor.sensors(&settings)? };
        let divisor = self.played.divisor;
        let folder = ExperimentFolder::new(&self.out, &settings, self.motor, divisor, frame_hz, sensors.output())?;
        let (mut files, mut rows) = (Vec::new(), 0);
        for (index, &nominal) in self.nominal.iter().enumerate() {
            let done = std::cell::Cell::new((0, 0));
            let record = self.record(session, &settings, &sensors, nominal, &done).map_err(|cause| Broken {
                help: self.remedy(&cause, index),
                cause,
                nominal,
                rows: done.get().0,
                total: done.get().1,
            })?;
            rows += record.time_s.len();
            files.push(folder.add(&file_stem(nominal, Excitation::Multisine), record)?);
        }
        let text = format!("{} records, {rows} rows\nWritten to {}\n", files.len(), self.out.display());
        Ok(Outcome::new(text, &json!({ "records": files, "rows": rows })))
    }

    /// Plays and records around one command, and says in `done` how far that is.
    fn record(
        &self,
        session: &mut Session,
        settings: &Settings,
        sensors: &Sensors,
        nominal: f64,
        done: &std::cell::Cell<(usize, usize)>,
    ) -> Result<Record, DeviceError> {
        let lines = self.played.lines.set();
        let PlayedArguments { amplitude, periods, divisor, .. } = self.played;
        let played = Played { motor: self.motor, lines, nominal, amplitude, periods, divisor };
        let bar = progress::bar("playing", 1);
        let excited = rotorlead_device::play(session, settings, &played, sensors, &|rows, total| {
            bar.set_length(total as u64);
            bar.set_position(rows as u64);
            done.set((rows, total));
        })?;
        bar.finish_and_clear();
        // The folder names it.
        let record = excited.to_record(&played, settings, String::new(), sensors)?;
        Ok(Record { role: self.role, ..record })
    }

    /// What to do after the record number `index` failed.
    fn remedy(&self, cause: &DeviceError, index: usize) -> String {
        let own = own_help(cause);
        if index == 0 {
            return format!("{own}; nothing was written");
        }
        let rest: Vec<String> = self.nominal[index..].iter().map(ToString::to_string).collect();
        format!(
            "{own}; `{}` holds the {index} records before: go on with the same command and --nominal {}",
            self.out.display(),
            rest.join(",")
        )
    }
}
