//! Options as they are typed, on a command line or into a form.

use super::{ColumnChoice, ImportOptions};
use crate::files::{AcceptedRange, did_you_mean};
use crate::{Excitation, Output};

/// Poles that a motor may have. Chosen: twice those of the largest motors of multicopters, 42 and more of which have their name from it.
const MOST_POLES: u8 = 100;

/// What [`ImportOptions::set`] takes: the options of `rotorlead import` that say what is in a log.
pub const IMPORT_OPTIONS: [&str; 13] = [
    "column",
    "tare",
    "excitation",
    "period",
    "nominal",
    "amplitude",
    "seconds",
    "pulse-us",
    "motor-poles",
    "rate",
    "motor",
    "log",
    "response",
];

impl ImportOptions {
    /// Takes an option of `rotorlead import`, named without its dashes, with its value as it is typed there. `column` adds a choice.
    ///
    /// # Errors
    /// Where there is no such option, or the value is none of it, in a sentence with what to do.
    pub fn set(&mut self, option: &str, value: &str) -> Result<(), String> {
        match option {
            "column" => self.columns.push(value.parse::<ColumnChoice>()?),
            "tare" => self.tare = true,
            "excitation" => self.excitation = Some(named(value, &Excitation::ALL, Excitation::name)?),
            "period" => self.period_s = Some(AcceptedRange::DURATION_S.parse(value)?),
            "nominal" => self.nominal = Some(AcceptedRange::DUTY.parse(value)?),
            "amplitude" => self.amplitude = Some(AcceptedRange::AMPLITUDE.parse(value)?),
            "seconds" => self.seconds = Some(import_seconds(value)?),
            "pulse-us" => self.esc_signal_us = Some(AcceptedRange::PULSE_US.parse_pair(value)?),
            "motor-poles" => self.motor_poles = Some(motor_poles(value)?),
            "rate" => self.rate_hz = Some(AcceptedRange::SAMPLE_RATE_HZ.parse(value)?),
            "motor" => self.motor = Some(counted(value)?),
            "log" => self.log = Some(counted(value)?),
            "response" => self.output = Some(named(value, &[Output::ThrustN, Output::Rpm], Output::option)?),
            other => {
                let meant = did_you_mean(other, IMPORT_OPTIONS.into_iter());
                return Err(format!("there is no option `{other}`; {}", meant.unwrap_or_default()));
            }
        }
        Ok(())
    }
}

/// One of these by its name.
fn named<T: Copy>(value: &str, all: &[T], name: impl Fn(T) -> &'static str) -> Result<T, String> {
    let found = all.iter().copied().find(|one| name(*one) == value);
    found.ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|one| name(*one)).collect();
        format!("`{value}` is none of {}", names.join(", "))
    })
}

fn counted(value: &str) -> Result<usize, String> {
    value.parse().ok().filter(|count| *count > 0).ok_or_else(|| format!("`{value}` is no number from 1 on"))
}

/// A number of magnets, of which each second one is a north pole.
///
/// # Errors
/// Where it is none, in a sentence with what to do.
pub fn motor_poles<N: From<u8>>(text: &str) -> Result<N, String> {
    let poles = text.parse().ok().filter(|poles| (2..=MOST_POLES).contains(poles) && poles.is_multiple_of(2));
    poles.map(N::from).ok_or_else(|| {
        format!(
            "`{text}` is no number of poles, even from 2 to {MOST_POLES}: count the rotor's magnets, 14 in most motors"
        )
    })
}

/// `FROM..TO`, seconds after a first row.
///
/// # Errors
/// Where it is no such part, in a sentence.
pub fn import_seconds(text: &str) -> Result<(f64, f64), String> {
    match AcceptedRange::TIME_S.parse_pair(text)? {
        (from, _) if from < 0.0 => Err(String::from("nothing is before the first row, which is at 0 seconds")),
        range => Ok(range),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_is_taken_as_it_is_typed_and_others_are_refused() {
        let values = ["time=t:ms", "", "chirp", "2", "0.5", "0.05", "1..3", "1000..2000", "14", "100", "2", "1", "rpm"];
        let mut options = ImportOptions::default();
        for (option, value) in IMPORT_OPTIONS.iter().zip(values) {
            let before = options.clone();
            options.set(option, value).unwrap();
            assert_ne!(options, before, "{option}");
        }
        assert_eq!((options.motor_poles, options.seconds), (Some(14), Some((1.0, 3.0))));
        for (option, value) in
            [("motor", "0"), ("motor-poles", "7"), ("seconds", "-1..2"), ("excitation", "steps"), ("colum", "a=b:c")]
        {
            assert!(options.set(option, value).unwrap_err().contains('`') || option == "seconds", "{option}");
        }
    }
}
