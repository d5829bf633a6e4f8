//! `rotorlead device`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};
use miette::IntoDiagnostic as _;
use rotorlead::compensator::Compensator;
use rotorlead::design::LeadDesign;
use rotorlead::link::LineSet;
use rotorlead::settings::Settings;
use rotorlead::throttle::Command as Duty;
use serde_json::{Value, json};

use super::outcome::{JsonOption, Outcome};
use super::parameters::positive;
use super::progress;
use crate::bench::device::{self, Calibration, DEFAULT_BAUD, DeviceError, Played, Session};
use crate::bench::{Plan, run_through};
use crate::design::compensator_file;
use crate::files::OutputFolder;
use crate::plant::Model;
use crate::record::{Excitation, Experiment, Output};

/// Talks to a controller over its serial port, or to one in the emulator
#[derive(Args, Debug)]
pub struct Device {
    /// A serial port (/dev/ttyUSB0, COM3), or tcp:HOST:PORT
    #[arg(long, value_name = "PORT")]
    port: String,
    /// Baud rate of the serial port
    #[arg(long, value_name = "BAUD", default_value_t = DEFAULT_BAUD)]
    baud: u32,
    /// How long an answer is waited for, seconds
    #[arg(long, value_name = "S", default_value = "1", value_parser = positive)]
    timeout: f64,
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Says what the controller is and how it is
    Info,
    /// Shows the settings in use
    Get {
        /// Only this one
        key: Option<String>,
    },
    /// Changes a setting, until the power goes; motor.*.KEY changes it for every motor
    Set {
        /// Which; `get` shows them all
        key: String,
        /// To what; levels are commands from 0 to 1
        value: String,
    },
    /// Stores the settings in use; every motor must be disarmed
    Save,
    /// Shows what went wrong since the start
    Faults,
    /// Ramps an excitation down
    Stop,
    /// Records a motor while something else drives it
    Record(Record),
    /// Has the controller play multisines on a motor, and records them. Nothing else may drive the motor
    Excite(Excite),
    /// Plays a plan through the controller's filter into a simulated motor, without pulses
    Inject(Inject),
}

/// From counts to newtons.
#[derive(Args, Debug)]
struct Sensor {
    /// Newtons per count of the converter
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    newtons_per_count: f64,
    /// The converter's count without thrust
    #[arg(long, value_name = "COUNT", allow_negative_numbers = true)]
    zero_count: f64,
}

#[derive(Args, Debug)]
struct Record {
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How long
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: f64,
    /// The motor, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// One row in so many control ticks; as in the settings unless given
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=5000))]
    divisor: Option<u16>,
    /// Command around which the motor is run, 0..1; the mean of what is recorded unless given
    #[arg(long, value_name = "U")]
    nominal: Option<f64>,
    #[command(flatten)]
    sensor: Sensor,
}

#[derive(Args, Debug)]
struct Excite {
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Commands around which to play, one record each
    #[arg(long, value_name = "U,U,...", value_delimiter = ',', required = true)]
    nominal: Vec<f64>,
    /// Peak deviation of the command
    #[arg(long, value_name = "U", default_value_t = 0.05)]
    amplitude: f64,
    /// The lines
    #[arg(long, value_enum, default_value_t = Lines::Hz30)]
    lines: Lines,
    /// Periods to keep; one more is played before them
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    periods: u16,
    /// The motor, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// One row in so many control ticks
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=5000))]
    divisor: u16,
    #[command(flatten)]
    sensor: Sensor,
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

#[derive(Args, Debug)]
struct Inject {
    /// The simulated motor
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// What to run; the paper's experiment unless given
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// The motor's path, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Device {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let port = device::open(&self.port, self.baud)?;
        let mut session = Session::new(port, &self.port, Duration::from_secs_f64(self.timeout));
        match &self.action {
            Action::Info => info(&mut session),
            Action::Get { key } => get(&mut session, key.as_deref()),
            Action::Set { key, value } => set(&mut session, key, value),
            Action::Save => {
                session.save()?;
                Ok(Outcome { text: "Saved.\n".into(), json: json!({ "saved": true }) })
            }
            Action::Faults => faults(&mut session),
            Action::Stop => {
                session.stop_excitation()?;
                Ok(Outcome { text: "Stopping.\n".into(), json: json!({ "stopping": true }) })
            }
            Action::Record(options) => options.run(&mut session),
            Action::Excite(options) => options.run(&mut session),
            Action::Inject(options) => options.run(&mut session),
        }
    }
}

fn info(session: &mut Session) -> miette::Result<Outcome> {
    let info = session.info()?;
    let [major, minor, patch] = info.firmware;
    let mut text = format!(
        "firmware {major}.{minor}.{patch}\nclock {:?}, core {} Hz, timers {} Hz, {} ticks\nstarted by {:?}\nsettings {:?}\n",
        info.clock, info.core_hz, info.timer_hz, info.ticks, info.reset, info.settings
    );
    for (motor, state) in info.motors.iter().enumerate() {
        writeln!(text, "motor {motor}: {state:?}").into_diagnostic()?;
    }
    Ok(Outcome { text, json: serde_json::to_value(info).into_diagnostic()? })
}

fn faults(session: &mut Session) -> miette::Result<Outcome> {
    let json = serde_json::to_value(session.faults()?).into_diagnostic()?;
    let mut text = String::new();
    list("", &json, &mut text);
    Ok(Outcome { text, json })
}

/// One line for each number in `value`.
fn list(name: &str, value: &Value, text: &mut String) {
    let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| list(&below(key), value, text)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, value)| list(&below(&index.to_string()), value, text));
        }
        value => writeln!(text, "{name} = {value}").expect("a string takes all"),
    }
}

fn get(session: &mut Session, key: Option<&str>) -> miette::Result<Outcome> {
    let settings = session.settings()?;
    if let Some(key) = key {
        // The same error as for a `set` of a key that does not exist.
        let known = device::entries(&settings).into_iter().find(|(name, _)| name == key);
        let Some((name, value)) = known else {
            return Err(device::unknown(key).into());
        };
        return Ok(Outcome { text: format!("{value}\n"), json: json!({ name: value }) });
    }
    let mut text = String::new();
    let mut map = serde_json::Map::new();
    for (name, value) in device::entries(&settings) {
        writeln!(text, "{name} = {value}").into_diagnostic()?;
        map.insert(name, Value::String(value));
    }
    Ok(Outcome { text, json: Value::Object(map) })
}

fn set(session: &mut Session, key: &str, value: &str) -> miette::Result<Outcome> {
    let mut settings = session.settings()?;
    device::set(&mut settings, key, value)?;
    // Here rather than by the controller: the reasons are the same, and a design says more.
    let settings = settings.validate().map_err(|error| miette::miette!(help = "nothing was changed", "{error}"))?;
    design(&settings)?;
    let warnings: Vec<String> = session.set_settings(&settings)?.iter().map(|warning| warning.to_string()).collect();
    let mut text = format!("{key} = {value}, until the power goes; `rotorlead device save` stores it\n");
    for warning in &warnings {
        writeln!(text, "warning: {warning}").into_diagnostic()?;
    }
    Ok(Outcome { text, json: json!({ "key": key, "value": value, "warnings": warnings }) })
}

/// The compensator of these settings, as the controller makes it.
fn design(settings: &Settings) -> miette::Result<LeadDesign> {
    LeadDesign::new(settings.lead.into(), f64::from(settings.loop_rate_hz), None)
        .map_err(|error| miette::miette!(help = "change omega_z_rad_s, omega_f_rad_s or damping", "{error}"))
}

/// Whether the compensator is in a motor's path.
fn is_compensated(settings: &Settings, motor: u8) -> bool {
    settings.motors.get(usize::from(motor)).is_some_and(|motor| motor.compensate)
}

impl Sensor {
    fn calibration(&self) -> Calibration {
        Calibration { zero: self.zero_count, newtons_per_count: self.newtons_per_count }
    }
}

/// Writes records of one controller as an experiment.
fn write(
    folder: OutputFolder,
    out: &Path,
    settings: &Settings,
    divisor: u32,
    records: Vec<crate::record::Record>,
) -> miette::Result<Outcome> {
    let loop_rate_hz = f64::from(settings.loop_rate_hz);
    let rows: usize = records.iter().map(|record| record.time_s.len()).sum();
    let files: Vec<String> = records.iter().map(|record| record.file.clone()).collect();
    if records.iter().any(|record| record.compensated) {
        compensator_file(&design(settings)?).write(&folder.building().join("compensator.toml"))?;
    }
    let experiment = Experiment {
        name: "recorded by the controller".into(),
        output: Output::ThrustN,
        sample_rate_hz: Some(loop_rate_hz / f64::from(divisor)),
        esc_frame_hz: Some(f64::from(settings.output.frame_hz)),
        command_rate_hz: (divisor > 1).then_some(loop_rate_hz),
        records,
    };
    experiment.write_into(&folder)?;
    folder.commit()?;
    let text = format!("{} records, {rows} rows\nWritten to {}\n", files.len(), out.display());
    Ok(Outcome { text, json: json!({ "records": files, "rows": rows }) })
}

impl Record {
    fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        let folder = OutputFolder::create(&self.out)?;
        let divisor = self.divisor.unwrap_or(settings.recorder_divisor);
        let loop_rate_hz = f64::from(settings.loop_rate_hz);
        let rows = (self.seconds * loop_rate_hz / f64::from(divisor)).round().max(2.0) as usize;
        let bar = progress::bar("recording", rows as u64);
        let recording = device::record(session, self.motor, divisor, rows, &|done| bar.set_position(done as u64))?;
        bar.finish_and_clear();
        let compensated = is_compensated(&settings, self.motor);
        let mut record = recording.to_record(
            0,
            rows,
            loop_rate_hz,
            self.sensor.calibration(),
            device::template("record.csv".into(), 0.0, Excitation::Free, compensated),
        );
        let mean = record.command.iter().sum::<f64>() / record.command.len().max(1) as f64;
        record.nominal = self.nominal.unwrap_or(mean);
        write(folder, &self.out, &settings, u32::from(divisor), vec![record])
    }
}

impl Excite {
    fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        let folder = OutputFolder::create(&self.out)?;
        let lines = match self.lines {
            Lines::Hz30 => LineSet::Odd30Hz,
            Lines::Hz45 => LineSet::Odd45Hz,
        };
        let mut records = Vec::new();
        for (index, &nominal) in self.nominal.iter().enumerate() {
            let Self { motor, amplitude, periods, divisor, .. } = *self;
            let played = Played { motor, lines, nominal, amplitude, periods, divisor };
            let bar = progress::bar("playing", 1);
            let excited = device::play(session, &settings, &played, &|done, total| {
                bar.set_length(total as u64);
                bar.set_position(done as u64);
            })?;
            bar.finish_and_clear();
            let file = format!("{:02}_u{:05.0}_multisine.csv", index + 1, nominal * 1e4);
            records.push(excited.to_record(&played, &settings, file, self.sensor.calibration()));
        }
        write(folder, &self.out, &settings, u32::from(self.divisor), records)
    }
}

/// What is played before a record: the stop, so that the path may arm, and a second at `start`, after which the filter
/// is at rest.
fn lead_in(start: Duty, loop_rate_hz: u32) -> Vec<Duty> {
    let ticks = loop_rate_hz as usize;
    let mut commands = vec![Duty::ZERO; ticks / 10];
    commands.resize(commands.len() + ticks, start);
    commands
}

impl Inject {
    fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let settings = session.settings()?;
        let Some(motor) = settings.motors.get(usize::from(self.motor)).copied() else {
            return Err(miette::miette!(help = "count motors from 0", "there is no motor {}", self.motor));
        };
        let model = Model::read(&self.model)?;
        let mut plan = match &self.plan {
            Some(file) => Plan::read(file)?,
            None => Plan::paper(&model),
        };
        let design = design(&settings)?;
        plan.compensator = motor.compensate.then(|| PathBuf::from("compensator.toml"));
        let folder = OutputFolder::create(&self.out)?;
        let bar = progress::bar("injecting", plan.records.len() as u64);
        let (mut samples, mut different) = (0_usize, 0_usize);
        let experiment = run_through(&plan, &model, motor.compensate.then_some(&design), |start, commands| {
            let lead_in = lead_in(start, settings.loop_rate_hz);
            let all = [&lead_in, commands].concat();
            let mut outputs = device::inject(session, self.motor, motor.compensate, &all)?;
            let level = |bits| Duty::saturating_from_bits(bits);
            let mut host = Compensator::new(*design.coefficients(), level(motor.idle), level(motor.max));
            host.set_enabled(motor.compensate);
            host.reset(Duty::ZERO);
            let expected: Vec<Duty> = all.iter().map(|&command| host.update(command)).collect();
            outputs.drain(..lead_in.len());
            samples += commands.len();
            different += expected[lead_in.len()..].iter().zip(&outputs).filter(|(host, output)| host != output).count();
            bar.inc(1);
            Ok::<_, DeviceError>(outputs)
        })?;
        bar.finish_and_clear();
        experiment.write_into(&folder)?;
        if motor.compensate {
            compensator_file(&design).write(&folder.building().join("compensator.toml"))?;
        }
        folder.commit()?;
        let text = format!(
            "{} records, {samples} samples, {different} of them different from the host's filter\nWritten to {}\n",
            experiment.records.len(),
            self.out.display()
        );
        Ok(Outcome {
            text,
            json: json!({ "records": experiment.records.len(), "samples": samples, "different": different }),
        })
    }
}
