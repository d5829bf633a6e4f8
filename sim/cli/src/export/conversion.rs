//! `rotorlead export --convert`: a value of Betaflight's `thrust_linear` in the law of other releases.

use clap::Args;
use rotorlead_export::{FirmwareRelease, ThrustLinear};

use super::super::UsageError;
use super::super::outcome::Outcome;

/// What to convert, in place of a model's parameters.
#[derive(Args, Clone, Copy, Debug)]
pub struct Conversion {
    /// Print what a value of Betaflight's thrust_linear is in the law of the releases that have the other one: it has one law up to
    /// 2025.12 and another from 2026.6 on. Takes no model
    #[arg(
        long,
        value_name = "thrust_linear=VALUE",
        value_parser = thrust_linear,
        conflicts_with_all = ["model", "model_option", "target", "records", "step_rate", "at", "output_range", "motors", "compensator", "out"]
    )]
    convert: Option<u8>,
    /// The release that the value to convert is of, such as 2025.12
    #[arg(long, value_name = "RELEASE")]
    from: Option<FirmwareRelease>,
}

fn thrust_linear(text: &str) -> Result<u8, String> {
    let value = text.strip_prefix("thrust_linear=").and_then(|value| value.parse().ok());
    value.ok_or_else(|| String::from("write it as thrust_linear=VALUE with a whole number, as in thrust_linear=120"))
}

impl Conversion {
    /// The converted value, where one is asked for.
    pub fn run(self) -> Option<miette::Result<Outcome>> {
        let (value, from) = match (self.convert, self.from) {
            (Some(value), Some(from)) => (value, from),
            (None, None) => return None,
            // Not left to the parser: it asks for no option that goes without `--for`.
            (None, Some(_)) => {
                return Some(Err(
                    UsageError::new("--from goes with --convert", "add --convert thrust_linear=VALUE").into()
                ));
            }
            (Some(_), None) => {
                return Some(Err(
                    UsageError::new("--convert goes with --from", "add --from RELEASE, such as 2025.12").into()
                ));
            }
        };
        Some(match ThrustLinear::convert(f64::from(value), from) {
            Ok(found) => Ok(Outcome::new(text(value, from, &found), &found)),
            Err(why) => Err(miette::miette!(
                help = "identify the motor on a staircase, and export its own value: `rotorlead export MODEL --for betaflight`",
                "{why}"
            )),
        })
    }
}

fn text(value: u8, from: FirmwareRelease, found: &ThrustLinear) -> String {
    format!(
        "# thrust_linear = {value} of releases {} is {:.0} of releases {}, by least squares of the motor output ({:.1} before it is rounded)\n\
         # the two laws then differ by {:.1} % rms and by at most {:.1} % of the full output; {:.1} has the same output at half thrust\n\
         # Betaflight does not convert it: an update keeps the number, and with it another curve\n\
         set thrust_linear = {:.0}\n",
        from.releases(),
        found.value,
        found.releases,
        found.least_squares,
        found.rms_error_percent,
        found.worst_error_percent,
        found.same_at_half_thrust,
        found.value,
    )
}
