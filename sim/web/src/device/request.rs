//! What a page asks of a controller.

use rotorlead::link::LineSet;
use rotorlead_device::{Sensors, Signal};
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::import::motor_poles;
use rotorlead_tune::TuneOptions;
use serde::Deserialize;

use crate::fault::Fault;
use crate::request::{KindName, PurposeName};

/// A question to a controller.
#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// What it is and how it is.
    Info,
    /// What went wrong since its start.
    Faults,
    /// Its settings.
    Get,
    /// Changes settings, until the power goes: those of a compensator's file, and others.
    Set {
        /// The text of a `compensator.toml`.
        compensator: Option<String>,
        /// The motor that gets the time constants of an inverse; every one unless given.
        motor: Option<u8>,
        /// Names and values.
        #[serde(default)]
        pairs: Vec<(String, String)>,
    },
    /// Stores the settings in use.
    Save,
    /// Measures motors, designs their compensator, sets and stores it.
    Tune(TuneForm),
}

/// The options of `rotorlead device tune`, as they are typed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TuneForm {
    motors: String,
    nominal: String,
    most_rpm: String,
    motor_poles: String,
    amplitude: String,
    periods: String,
    divisor: String,
    kind: Option<KindName>,
    #[serde(default)]
    purpose: PurposeName,
    #[serde(default)]
    rpm: bool,
    #[serde(default)]
    accept_limits: bool,
}

impl TuneForm {
    /// The same for the library.
    pub fn options(&self) -> Result<TuneOptions, Fault> {
        let sensors = Sensors {
            thrust: None,
            motor_poles: Some(option("--motor-poles", motor_poles(self.motor_poles.trim()))?),
            most_rpm: Some(option("--most-rpm", AcceptedRange::NUMBER.parse(self.most_rpm.trim()))?),
        };
        let signal = Signal {
            lines: LineSet::Odd30Hz,
            amplitude: option("--amplitude", AcceptedRange::AMPLITUDE.parse(self.amplitude.trim()))?,
            periods: option("--periods", count(&self.periods, u16::MAX))?,
            divisor: option("--divisor", count(&self.divisor, 5000))?,
        };
        let options = TuneOptions {
            motors: option("--motors", list(&self.motors, |text| text.parse().map_err(|_| no_motor(text))))?,
            nominal: option("--nominal", list(&self.nominal, |text| AcceptedRange::DUTY.parse(text)))?,
            signal,
            sensors,
            kind: self.kind.map(KindName::kind),
            purpose: self.purpose.purpose(),
            rpm: self.rpm,
            accept_limits: self.accept_limits,
        };
        options.levels().map_err(miette::Report::from)?;
        Ok(options)
    }
}

/// What was typed for an option, or what is wrong with it.
fn option<T>(name: &str, typed: Result<T, String>) -> Result<T, Fault> {
    typed.map_err(|reason| Fault::new(format!("{name}: {reason}"), "correct it; no motor has turned"))
}

fn list<T>(text: &str, one: impl Fn(&str) -> Result<T, String>) -> Result<Vec<T>, String> {
    text.split(',').map(|part| one(part.trim())).collect()
}

fn count(text: &str, most: u16) -> Result<u16, String> {
    let number = text.trim().parse().ok().filter(|number| (1..=most).contains(number));
    number.ok_or_else(|| format!("`{text}` is no whole number from 1 to {most}"))
}

fn no_motor(text: &str) -> String {
    format!("`{text}` is no motor: give their numbers, from 0")
}
