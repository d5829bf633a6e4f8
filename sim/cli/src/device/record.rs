//! `rotorlead device record`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::Diagnostic;
use rotorlead::settings::Settings;
use rotorlead_device::{
    Calibration, DeviceError, Header, Keeper as _, Recorded, Recording, Sensors, Session, bench_frame_hz,
    is_compensated,
};
use rotorlead_numerics::sample::mean;
use rotorlead_plant::bench::file_stem;
use rotorlead_records::Excitation;
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::import::motor_poles;
use serde_json::json;
use thiserror::Error;

use super::folder::ExperimentFolder;
use crate::UsageError;
use crate::outcome::Outcome;
use crate::parameters::{RoleArgument, number};
use crate::progress;

/// What measures the response.
#[derive(Args, Clone, Debug)]
#[group(required = true, multiple = true)]
pub(super) struct Sensor {
    /// Thrust sensor: newtons per count of the converter
    #[arg(long, value_name = "N", value_parser = number(AcceptedRange::NUMBER), allow_negative_numbers = true, requires = "zero_count")]
    newtons_per_count: Option<f64>,
    /// Thrust sensor: the converter's count without thrust
    #[arg(long, value_name = "COUNT", value_parser = number(AcceptedRange::NUMBER), allow_negative_numbers = true, requires = "newtons_per_count")]
    zero_count: Option<f64>,
    /// Speed, from the replies of an ESC with bidirectional DShot: magnets of the motor
    #[arg(long, value_name = "N", value_parser = motor_poles::<u8>)]
    motor_poles: Option<u8>,
}

impl Sensor {
    /// For a controller with these settings.
    pub(super) fn sensors(&self, settings: &Settings) -> Result<Sensors, DeviceError> {
        let sensors = self.unchecked();
        sensors.check(settings)?;
        Ok(sensors)
    }

    /// As given.
    pub(super) fn unchecked(&self) -> Sensors {
        let thrust = self.newtons_per_count.zip(self.zero_count);
        let thrust = thrust.map(|(newtons_per_count, zero)| Calibration { zero, newtons_per_count });
        Sensors { thrust, motor_poles: self.motor_poles, most_rpm: None }
    }
}

#[derive(Args, Debug)]
pub(super) struct Record {
    /// The experiment's folder: it is made, or the record is added to the experiment that is there
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// How long
    #[arg(long, value_name = "S", value_parser = number(AcceptedRange::DURATION_S))]
    seconds: f64,
    /// The motor, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// One row in so many control ticks; as in the settings unless given
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=5000))]
    divisor: Option<u16>,
    /// What drives the motor meanwhile; `rotorlead identify` takes all but free
    #[arg(long, value_enum, default_value_t = ExcitationArgument::Free)]
    excitation: ExcitationArgument,
    /// Command around which the motor is run, 0..1; the mean of what is recorded unless given
    #[arg(long, value_name = "U", value_parser = number(AcceptedRange::DUTY), required_if_eq_any([("excitation", "multisine"), ("excitation", "square"), ("excitation", "triangle")]))]
    nominal: Option<f64>,
    /// Peak deviation of the command from it; the largest that is recorded unless given
    #[arg(long, value_name = "U", value_parser = number(AcceptedRange::AMPLITUDE))]
    amplitude: Option<f64>,
    /// Period of a multisine, a square wave or a triangle
    #[arg(long = "period", alias = "period-s", value_name = "S", value_parser = number(AcceptedRange::DURATION_S), required_if_eq_any([("excitation", "multisine"), ("excitation", "square"), ("excitation", "triangle")]))]
    period_s: Option<f64>,
    /// What the record is for; the tools choose unless given
    #[arg(long, value_enum)]
    role: Option<RoleArgument>,
    #[command(flatten)]
    sensor: Sensor,
}

/// [`Excitation`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ExcitationArgument {
    /// A periodic sum of sinusoids around --nominal
    Multisine,
    /// A periodic square wave around --nominal
    Square,
    /// A periodic triangle around --nominal
    Triangle,
    /// One step
    Step,
    /// Several plateaus, one after the other
    Staircase,
    /// Anything else
    Free,
}

/// What is said of a record that nothing can be identified from yet.
const FREE: &str =
    "This record is `free`: before `rotorlead identify` takes it, its [[record]] in experiment.toml must say
what was played: excitation = \"multisine\" or \"square\" with period_s, \"step\" or \"staircase\".
Or record with --excitation.
";

/// A recording that ended early.
#[derive(Debug, Error, Diagnostic)]
#[error("{cause}; of {wanted} rows, {rows} had arrived")]
#[diagnostic(help("{help}"))]
struct RecordingInterrupted {
    cause: DeviceError,
    rows: usize,
    wanted: usize,
    help: String,
}

impl Record {
    /// Rows to record.
    fn rows(&self, row_rate_hz: f64) -> Result<usize, UsageError> {
        let rows = (self.seconds * row_rate_hz).round();
        // A day at 10 kHz: a slip of the decimal point is to be an error, not a full memory.
        if !(2.0..=8.64e8).contains(&rows) {
            return Err(UsageError::new(
                format!("--seconds {} are {rows} rows at {row_rate_hz} Hz", self.seconds),
                "record two rows at least, and a day at most",
            ));
        }
        if let Some(period_s) = self.period_s {
            let rows_per_period = period_s * row_rate_hz;
            if (rows_per_period - rows_per_period.round()).abs() > 1e-6 * rows_per_period || rows_per_period < 2.0 {
                return Err(UsageError::new(
                    format!("--period {period_s} is {rows_per_period} rows at {row_rate_hz} Hz, no whole number"),
                    "choose a --divisor with which a period has a whole number of rows",
                ));
            }
            if rows < rows_per_period.round() {
                return Err(UsageError::new(
                    format!("--seconds {} are less than one period of {period_s} s", self.seconds),
                    "record one period at least; with two or more the noise can be separated from the response",
                ));
            }
        }
        Ok(rows as usize)
    }

    fn excitation(&self) -> Excitation {
        match self.excitation {
            ExcitationArgument::Multisine => Excitation::Multisine,
            ExcitationArgument::Square => Excitation::Square,
            ExcitationArgument::Triangle => Excitation::Triangle,
            ExcitationArgument::Step => Excitation::Step,
            ExcitationArgument::Staircase => Excitation::Staircase,
            ExcitationArgument::Free => Excitation::Free,
        }
    }

    /// The first `rows` rows as the record that was asked for.
    fn record(
        &self,
        recording: &Recording,
        rows: usize,
        settings: &Settings,
        sensors: &Sensors,
    ) -> Result<rotorlead_records::Record, DeviceError> {
        let excitation = self.excitation();
        let compensated = is_compensated(settings, self.motor);
        let template = rotorlead_device::template(String::new(), 0.0, excitation, compensated);
        let mut record = recording.to_record(0, rows, f64::from(settings.loop_rate_hz), sensors, template)?;
        let mean = mean(&record.command);
        // A mean of equal commands may round out of their range.
        let nominal = self.nominal.unwrap_or(mean.clamp(0.0, 1.0));
        let largest = record.command.iter().fold(0.0, |largest: f64, command| largest.max((command - nominal).abs()));
        record.nominal = nominal;
        record.period_s = self.period_s;
        let found = Some(largest).filter(|&largest| excitation != Excitation::Free && largest > 0.0);
        record.amplitude = self.amplitude.or(found);
        record.role = self.role.map(RoleArgument::role);
        Ok(record)
    }

    pub(super) fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        let divisor = self.divisor.unwrap_or(settings.recorder_divisor);
        let sensors = self.sensor.sensors(&settings)?;
        let rows = self.rows(f64::from(settings.loop_rate_hz) / f64::from(divisor))?;
        // Those of a flight controller, whose pulses the output frames may follow.
        let follows = settings
            .clone()
            .validate()
            .is_ok_and(|settings| settings.output_follows_input() || settings.relays_frames());
        let esc_frame_hz = if follows { f64::from(settings.input.frame_hz) } else { bench_frame_hz(&settings) };
        let header = Header::new(&settings, self.motor, divisor, esc_frame_hz, sensors.output())?;
        let mut folder = ExperimentFolder::new(&self.out, header)?;
        let bar = progress::bar("recording", rows as u64);
        let show = |done| bar.set_position(done as u64);
        let Recorded { recording, mut ended } =
            rotorlead_device::record(session, &settings, self.motor, divisor, rows, &show)?;
        bar.finish_and_clear();
        let mut there = recording.rows().min(rows);
        if let Some(row) = recording.first_without(&sensors).filter(|&row| row < there) {
            (there, ended) = (row, ended.and(Err(recording.no_speed(row))));
        }
        let record = self.record(&recording, there, &settings, &sensors)?;
        let stem = file_stem(record.nominal, record.excitation);
        if let Err(cause) = ended {
            let kept = if there == 0 { "nothing was written".to_owned() } else { self.salvage(&folder, &stem, record) };
            let help = format!("{}; {kept}", cause.own_help());
            return Err(RecordingInterrupted { cause, rows: there, wanted: rows, help }.into());
        }
        let file = folder.add(&stem, record)?;
        let mut text = format!("{file}, {rows} rows\nWritten to {}\n", self.out.display());
        if self.excitation == ExcitationArgument::Free {
            text.push_str(FREE);
        }
        Ok(Outcome::new(text, &json!({ "records": [file], "rows": rows })))
    }

    /// Keeps the rows of a recording that ended early, and says where.
    fn salvage(&self, folder: &ExperimentFolder, stem: &str, mut record: rotorlead_records::Record) -> String {
        // What there is of it need not be what was to be played.
        record.excitation = Excitation::Free;
        record.period_s = None;
        record.role = None;
        let kept = match folder.salvage(stem, record) {
            Ok(path) => format!("the rows that had arrived are in `{}`", path.display()),
            Err(error) => format!("the rows that had arrived are lost: {error}"),
        };
        format!("{kept}; nothing was added to `{}`", self.out.display())
    }
}
