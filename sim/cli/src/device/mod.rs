//! `rotorlead device`

mod compensator;
mod excite;
mod folder;
mod inject;
mod record;
mod set;
mod tune;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use clap::{Args, Subcommand};
use miette::IntoDiagnostic as _;
use rotorlead_device::{DEFAULT_BAUD, Said, Session, fault_lines, info_lines, save_chosen};
use rotorlead_records::files::AcceptedRange;
use serde_json::{Value, json};

use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::number;
use rotorlead_answer::words::warning;

/// Talks to a controller over its serial port, or to one in the emulator
#[derive(Args, Debug)]
pub struct Device {
    /// A serial port (/dev/ttyUSB0, COM3), or tcp:HOST:PORT; left out, that of the controller which is plugged in by USB
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Baud rate of the serial port
    #[arg(long, value_name = "BAUD", default_value_t = DEFAULT_BAUD)]
    baud: u32,
    /// How long an answer is waited for, seconds
    #[arg(long, value_name = "S", default_value = "1", value_parser = number(AcceptedRange::DURATION_S))]
    timeout: f64,
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    json: JsonOption,
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
    /// Changes settings, until the power goes: all in one, checked together, or none
    Set(set::Set),
    /// Stores the settings in use, once they are chosen; every motor must be disarmed
    Save,
    /// Shows what went wrong since the start
    Faults,
    /// Ramps an excitation down
    Stop,
    /// Leaves the firmware for the board's boot loader, to flash another; needs the jumper and every motor disarmed
    Bootloader,
    /// Records a motor while something else drives it
    Record(record::Record),
    /// Has the controller play multisines on a motor, and records them. Nothing else may drive the motor
    Excite(excite::Excite),
    /// Measures the motors of a vehicle one after the other, designs their compensator and stores it, with a question before each
    Tune(tune::Tune),
    /// Plays a plan through the controller's filter into a simulated motor, without pulses
    Inject(inject::Inject),
}

impl Action {
    /// Where its own output goes.
    fn out(&self) -> Option<&Path> {
        match self {
            Self::Record(options) => Some(&options.out),
            Self::Excite(options) => Some(&options.out),
            Self::Tune(options) => Some(&options.out),
            Self::Inject(options) => Some(&options.out),
            _ => None,
        }
    }
}

impl Device {
    /// Runs the command and says what came out. Outputs that are not the host's are said, and fail the command all the
    /// same.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.check(self.action.out())?;
        let (outcome, verdict) = self.run()?;
        self.json.say(|| Ok(outcome), verbosity)?;
        verdict
    }

    fn run(&self) -> miette::Result<(Outcome, miette::Result<()>)> {
        let address = self.port.clone().map_or_else(rotorlead_device::find, Ok)?;
        let port = rotorlead_device::open(&address, self.baud)?;
        let mut session = Session::new(port, &address, Duration::from_secs_f64(self.timeout));
        let outcome = match &self.action {
            Action::Info => info(&mut session),
            Action::Get { key } => get(&mut session, key.as_deref()),
            Action::Set(options) => options.run(&mut session),
            Action::Save => save(&mut session),
            Action::Faults => faults(&mut session),
            Action::Stop => {
                session.stop_excitation()?;
                Ok(Outcome::new("Stopping.\n".into(), &json!({ "stopping": true })))
            }
            Action::Bootloader => {
                session.enter_boot_loader()?;
                let text = "The board is gone from this port, and shows itself as a drive: copy the .uf2 file there.\n";
                Ok(Outcome::new(text.into(), &json!({ "bootloader": true })))
            }
            Action::Record(options) => options.run(&mut session),
            Action::Excite(options) => options.run(&mut session),
            Action::Tune(options) => options.run(&mut session),
            Action::Inject(options) => return options.run(&mut session),
        }?;
        Ok((outcome, Ok(())))
    }
}

fn info(session: &mut Session) -> miette::Result<Outcome> {
    let info = session.info()?;
    let line = |said: Said| match said {
        Said::Fact(fact) => format!("{fact}\n"),
        Said::Warning(what) => warning(&what),
    };
    Ok(Outcome::new(info_lines(&info).into_iter().map(line).collect(), &info))
}

fn faults(session: &mut Session) -> miette::Result<Outcome> {
    let faults = session.faults()?;
    Ok(Outcome::new(fault_lines(&faults).iter().map(|line| format!("{line}\n")).collect(), &faults))
}

fn get(session: &mut Session, key: Option<&str>) -> miette::Result<Outcome> {
    let settings = session.settings()?;
    if let Some(key) = key {
        // The same error as for a `set` of a key that does not exist.
        let known = rotorlead_device::entries(&settings).into_iter().find(|(name, _)| name == key);
        let Some((name, value)) = known else {
            return Err(rotorlead_device::unknown(key).into());
        };
        return Ok(Outcome::new(format!("{value}\n"), &json!({ name: value })));
    }
    let mut text = String::new();
    let mut map = serde_json::Map::new();
    for (name, value) in rotorlead_device::entries(&settings) {
        writeln!(text, "{name} = {value}").into_diagnostic()?;
        map.insert(name, Value::String(value));
    }
    Ok(Outcome::new(text, &Value::Object(map)))
}

fn save(session: &mut Session) -> miette::Result<Outcome> {
    save_chosen(session)?;
    Ok(Outcome::new("Saved.\n".into(), &json!({ "saved": true })))
}
