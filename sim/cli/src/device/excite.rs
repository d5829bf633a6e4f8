//! `rotorlead device excite`

use std::cell::RefCell;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use rotorlead::link::LineSet;
use rotorlead_device::{Header, Kept, Sensors, Series, Session, Signal, bench_frame_hz, excite};
use rotorlead_records::files::AcceptedRange;
use serde_json::json;

use super::folder::ExperimentFolder;
use super::record::Sensor;
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
    nominal: Vec<f64>,
    /// The motor, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// The speed that the motor may not reach, revolutions per minute; all stops beyond it
    #[arg(long, value_name = "RPM", value_parser = number(AcceptedRange::NUMBER), requires = "motor_poles")]
    most_rpm: Option<f64>,
    #[command(flatten)]
    played: PlayedArguments,
    #[command(flatten)]
    sensor: Sensor,
}

/// What is played around each command.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct PlayedArguments {
    /// Peak deviation of the command
    #[arg(long, value_name = "U", default_value = "0.05", value_parser = number(AcceptedRange::AMPLITUDE))]
    amplitude: f64,
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
    /// The same for the controller.
    pub(super) fn signal(self) -> Signal {
        let Self { amplitude, lines, periods, divisor } = self;
        Signal { lines: lines.set(), amplitude, periods, divisor }
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

impl Excite {
    pub(super) fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        let sensors = Sensors { most_rpm: self.most_rpm, ..self.sensor.sensors(&settings)? };
        let series = Series { motor: self.motor, signal: self.played.signal(), sensors, role: None };
        // No input is live: output frames come at their own rate.
        let frame_hz = bench_frame_hz(&settings);
        let header = Header::new(&settings, self.motor, series.signal.divisor, frame_hz, sensors.output())?;
        let mut folder = ExperimentFolder::new(&self.out, header)?;
        let bar = PlayBar::default();
        let Kept { files, rows } =
            excite(session, &settings, &series, &self.nominal, &mut folder, &|rows, total| bar.show(rows, total))?;
        let text = format!("{} records, {rows} rows\nWritten to {}\n", files.len(), self.out.display());
        Ok(Outcome::new(text, &json!({ "records": files, "rows": rows })))
    }
}

/// A bar for each record that is played.
#[derive(Default)]
pub(super) struct PlayBar(RefCell<Option<ProgressBar>>);

impl PlayBar {
    /// Shows the rows that are there, of so many.
    pub(super) fn show(&self, rows: usize, total: usize) {
        let mut bar = self.0.borrow_mut();
        let shown = bar.get_or_insert_with(|| progress::bar("playing", 1));
        shown.set_length(total as u64);
        shown.set_position(rows as u64);
        if rows == total {
            shown.finish_and_clear();
            *bar = None;
        }
    }
}
