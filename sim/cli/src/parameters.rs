//! Options that several commands share, and what their values may be.

use clap::{Args, ValueEnum};
use rotorlead_design::Setting;
use rotorlead_records::Role;
use rotorlead_records::files::AcceptedRange;
use rotorlead_results::{DesignRequest, Kind};
use rotorlead_vehicle::Purpose;

use super::UsageError;

/// [`Role`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum RoleArgument {
    /// To be fitted
    Fit,
    /// To be kept out of the fit
    Validate,
}

impl RoleArgument {
    /// What is meant.
    pub const fn role(self) -> Role {
        match self {
            Self::Fit => Role::Fit,
            Self::Validate => Role::Validate,
        }
    }
}

/// The parameters of a design.
#[derive(Args, Clone, Debug)]
pub struct DesignArguments {
    /// What to design: the paper's lead, whose zero is on the fastest pole, or an inverse, whose zero follows the rotor; see
    /// docs/inverse.md
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    /// Highest frequency that a lead is to amplify; 2 pi 100 rad/s, the paper's, unless given
    #[arg(long, value_name = "RAD_S", value_parser = number(AcceptedRange::FREQUENCY_RAD_S), allow_negative_numbers = true)]
    omega_g: Option<f64>,
    /// Damping ratio of the poles; 1/sqrt(2) unless given
    #[arg(long, value_name = "RATIO", value_parser = number(AcceptedRange::DAMPING), allow_negative_numbers = true)]
    damping: Option<f64>,
    /// Rate at which the filter runs; 5000 Hz unless given
    #[arg(long, value_name = "HZ", value_parser = number(AcceptedRange::LOOP_RATE_HZ), allow_negative_numbers = true)]
    loop_rate: Option<f64>,
    /// Frequency at which the sampled lead is to match the continuous one exactly
    #[arg(long, value_name = "RAD_S", value_parser = number(AcceptedRange::FREQUENCY_RAD_S), allow_negative_numbers = true)]
    prewarp: Option<f64>,
    /// Natural frequency of an inverse's reference model; 94.2 rad/s unless given, and 125 with --setting robust
    #[arg(long, value_name = "RAD_S", value_parser = number(AcceptedRange::FREQUENCY_RAD_S), allow_negative_numbers = true)]
    natural: Option<f64>,
    /// Table of an inverse: the time constants as they are, or nine tenths of them; exact where they are known well enough
    /// unless given
    #[arg(long, value_enum)]
    setting: Option<SettingName>,
    /// Most by which the ESC changes its output per second: 20 is 2 % per millisecond; no limit unless given
    #[arg(long, value_name = "PER_S", value_parser = number(AcceptedRange::SLEW_PER_S), allow_negative_numbers = true)]
    slew: Option<f64>,
    /// Lowest and highest command that the ESC gets, for an inverse; 0..1 unless given
    #[arg(long, value_name = "LOW..HIGH", value_parser = range(AcceptedRange::DUTY), allow_negative_numbers = true)]
    output_range: Option<(f64, f64)>,
    /// Commands of the flight controller for which an inverse is in the path; the measured ones and 0.05 beyond unless given
    #[arg(long, value_name = "LOW..HIGH", value_parser = range(AcceptedRange::DUTY), allow_negative_numbers = true)]
    compensate_range: Option<(f64, f64)>,
}

/// For what a compensator is chosen.
#[derive(Args, Clone, Copy, Debug)]
pub struct PurposeOption {
    /// For what a compensator is chosen where no kind is given: a force around which no loop is closed, or a multirotor's rate loop,
    /// whose gains are tuned again with it
    #[arg(long, value_enum, default_value_t = PurposeName::Force)]
    purpose: PurposeName,
}

/// The purposes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PurposeName {
    /// Tilted rotors, tethers, contact
    Force,
    /// A multirotor's rate loop
    RateLoop,
}

impl PurposeOption {
    /// What was given.
    pub fn purpose(self) -> Purpose {
        match self.purpose {
            PurposeName::RateLoop => Purpose::RateLoop,
            PurposeName::Force => Purpose::Force,
        }
    }
}

/// The kinds of compensator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KindName {
    /// The paper's lead
    Lead,
    /// A conditioned inverse
    Inverse,
}

/// The settings of an inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SettingName {
    /// The time constants of the model
    Exact,
    /// Nine tenths of them, and a faster reference model
    Robust,
}

impl DesignArguments {
    /// Whether any was given.
    pub fn is_given(&self) -> bool {
        self.unchecked() != DesignRequest::default()
    }

    /// What was given.
    ///
    /// # Errors
    /// When an option of the other kind was given.
    pub fn request(&self) -> Result<DesignRequest, UsageError> {
        let request = self.unchecked();
        let option = |parameter: &str| match parameter {
            "omega_g_rad_s" => "--omega-g",
            "prewarp_rad_s" => "--prewarp",
            "natural_rad_s" => "--natural",
            "output_range" => "--output-range",
            "compensate_range" => "--compensate-range",
            _ => "--setting",
        };
        match request.foreign() {
            Some(parameter) => Err(UsageError::new(
                format!("{} is no option of this kind of compensator", option(parameter)),
                "leave it out, or change --kind",
            )),
            None => Ok(request),
        }
    }

    fn unchecked(&self) -> DesignRequest {
        DesignRequest {
            kind: self.kind.map(KindName::kind),
            omega_g_rad_s: self.omega_g,
            prewarp_rad_s: self.prewarp,
            natural_rad_s: self.natural,
            setting: self.setting.map(SettingName::setting),
            output_range: self.output_range,
            compensate_range: self.compensate_range,
            damping: self.damping,
            loop_rate_hz: self.loop_rate,
            slew_per_s: self.slew,
        }
    }
}

impl KindName {
    /// The same for a design.
    pub fn kind(self) -> Kind {
        match self {
            Self::Lead => Kind::Lead,
            Self::Inverse => Kind::Inverse,
        }
    }
}

impl SettingName {
    fn setting(self) -> Setting {
        match self {
            Self::Exact => Setting::Exact,
            Self::Robust => Setting::Robust,
        }
    }
}

/// A number of that range: what options accept is stated where it is for the keys of files.
pub fn number(quantity: AcceptedRange) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| quantity.parse(text)
}

/// `LOW..HIGH`, both numbers of that range, the first lower.
pub fn range(quantity: AcceptedRange) -> impl Fn(&str) -> Result<(f64, f64), String> + Clone + Send + Sync + 'static {
    move |text| quantity.parse_pair(text)
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;

    use clap::{Arg, Command};

    use super::*;

    /// Every option of every command with values of this type, and what it accepts of a text.
    fn options_in<T: 'static>(command: &Command) -> Vec<(String, Arg)> {
        let is_of = |argument: &&Arg| argument.get_value_parser().type_id() == TypeId::of::<T>();
        let named = |argument: &Arg| (format!("{} --{}", command.get_name(), argument.get_id()), argument.clone());
        let own = command.get_arguments().filter(is_of).map(named);
        own.chain(command.get_subcommands().flat_map(options_in::<T>)).collect()
    }

    fn accepts(option: &Arg, text: &str) -> bool {
        let value = Arg::new("value").value_parser(option.get_value_parser().clone()).allow_hyphen_values(true);
        Command::new("alone").arg(value).try_get_matches_from(["alone", text]).is_ok()
    }

    #[test]
    fn every_number_of_the_command_line_has_bounds() {
        let command = crate::command_line();
        let (numbers, ranges) = (options_in::<f64>(&command), options_in::<(f64, f64)>(&command));
        assert!(numbers.len() > 20 && ranges.len() > 3, "{numbers:?} {ranges:?}");
        for text in ["1e300", "-1e300", "nan", "inf", "one"] {
            let unbounded: Vec<_> = numbers.iter().filter(|(_, option)| accepts(option, text)).collect();
            assert!(unbounded.is_empty(), "{text}: {unbounded:?}");
            for range in [format!("{text}..0.5"), format!("0.5..{text}")] {
                let unbounded: Vec<_> = ranges.iter().filter(|(_, option)| accepts(option, &range)).collect();
                assert!(unbounded.is_empty(), "{range}: {unbounded:?}");
            }
        }
    }

    #[test]
    fn an_option_has_the_range_of_the_key_that_it_stands_for() {
        let refused = number(AcceptedRange::DURATION_S)("1e6").unwrap_err();
        assert!(refused.starts_with("1000000 is not from 0.0001 to 100000; give a value"), "{refused}");
        assert_eq!(number(AcceptedRange::DURATION_S)("1e5"), Ok(1e5));
        assert_eq!(range(AcceptedRange::DUTY)("0.05..1"), Ok((0.05, 1.0)));
        for wrong in ["1..0", "0.5..0.5", "0..1.5", "0,1", ".."] {
            assert!(range(AcceptedRange::DUTY)(wrong).is_err(), "{wrong}");
        }
    }
}
