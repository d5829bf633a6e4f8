//! Options that several commands share, and what their values may be.

use std::path::Path;

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::LeadDesign;
use rotorlead_identify::design::{DesignOptions, design};
use rotorlead_plant::Model;

/// The parameters of a design.
#[derive(Args, Clone, Debug)]
pub struct DesignArguments {
    /// Highest frequency that is to be amplified; 2 pi 100 rad/s, the paper's, unless given
    #[arg(long, value_name = "RAD_S", value_parser = positive, allow_negative_numbers = true)]
    omega_g: Option<f64>,
    /// Damping ratio of the compensator's poles; 1/sqrt(2) unless given
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    damping: Option<f64>,
    /// Rate at which the filter runs; 5000 Hz unless given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    loop_rate: Option<f64>,
    /// Frequency at which the sampled filter is to match the continuous one exactly
    #[arg(long, value_name = "RAD_S", value_parser = positive, allow_negative_numbers = true)]
    prewarp: Option<f64>,
}

impl DesignArguments {
    /// Designs for `model`, which was read from `file`.
    pub fn design(&self, model: &Model, file: &Path) -> miette::Result<LeadDesign> {
        design(model, &self.options())
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", file.display()))
    }

    /// Whether any was given.
    pub fn is_given(&self) -> bool {
        self.omega_g.or(self.damping).or(self.loop_rate).or(self.prewarp).is_some()
    }

    /// What was given, and the paper's values for the rest.
    pub fn options(&self) -> DesignOptions {
        let default = DesignOptions::default();
        DesignOptions {
            omega_g_rad_s: self.omega_g.unwrap_or(default.omega_g_rad_s),
            damping: self.damping.unwrap_or(default.damping),
            loop_rate_hz: self.loop_rate.unwrap_or(default.loop_rate_hz),
            prewarp_rad_s: self.prewarp,
        }
    }
}

/// A number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err(String::from("a number above zero is needed")),
    }
}

/// A number from 0 to 1.
pub fn fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err(String::from("a number from 0 to 1 is needed")),
    }
}

/// `LOW..HIGH`, both finite numbers, the first lower.
pub fn range(text: &str) -> Result<(f64, f64), String> {
    let remedy = || String::from("write it as LOW..HIGH with LOW below HIGH, as in 0.1..30");
    let (low, high) = text.split_once("..").ok_or_else(remedy)?;
    let (low, high): (f64, f64) = (low.parse().map_err(|_| remedy())?, high.parse().map_err(|_| remedy())?);
    if low.is_finite() && high.is_finite() && low < high { Ok((low, high)) } else { Err(remedy()) }
}
