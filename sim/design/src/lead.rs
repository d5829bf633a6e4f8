//! One compensator for all points of a model, as the controller computes it.

use rotorlead::design::{DEFAULT_DAMPING, DEFAULT_LOOP_RATE_HZ, DesignError, LeadDesign, LeadParameters};
use rotorlead_plant::{Model, Point};

use super::CompensatorError;
use super::error::MOST_FACTOR;

/// What a design is asked for beside the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignOptions {
    /// Highest frequency that is to be amplified, rad/s; eq. (6).
    pub omega_g_rad_s: f64,
    /// Damping ratio of the poles, eq. (4).
    pub damping: f64,
    /// Rate at which the filter runs, hertz.
    pub loop_rate_hz: f64,
    /// Frequency at which the sampled filter matches C(s) exactly, rad/s; `None` for plain Tustin.
    pub prewarp_rad_s: Option<f64>,
    /// What the command changes by at most, units per second; `None` for no limit, as in the paper.
    pub slew_per_s: Option<f64>,
}

impl Default for DesignOptions {
    /// The paper's: omega_g = 2 pi 100 rad/s, damping 1/sqrt(2), 5 kHz.
    fn default() -> Self {
        Self {
            omega_g_rad_s: 200.0 * std::f64::consts::PI,
            damping: DEFAULT_DAMPING,
            loop_rate_hz: DEFAULT_LOOP_RATE_HZ,
            prewarp_rad_s: None,
            slew_per_s: None,
        }
    }
}

/// The paper's design, eq. (2) to (9), from the points of `model`: the zero on the fastest pole.
///
/// # Errors
/// When the model has no points, gains of both signs, or a time constant that is hardly known, or the controller refuses the
/// parameters.
///
/// # Examples
///
/// ```
/// use rotorlead_design::{DesignOptions, design};
/// use rotorlead_plant::Model;
///
/// let motor: Model = toml::from_str("
///     format = 1
///     [[point]]
///     nominal = 0.5
///     gain = 10.0
///     time_constant_s = 0.08
/// ")?;
/// let design = design(&motor, &DesignOptions::default())?;
///
/// // The zero (2) stands on the pole, and the two new poles (5) at the geometric mean of it and omega_g.
/// let lead = design.lead();
/// assert!((lead.omega_z_rad_s - 12.5).abs() < 1e-9);
/// assert!((lead.omega_f_rad_s - (12.5_f64 * 200.0 * std::f64::consts::PI).sqrt()).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn design(model: &Model, options: &DesignOptions) -> Result<LeadDesign, CompensatorError> {
    let gain = |point: &Point| (point.nominal, point.gain);
    if let Some(first) = model.points.first()
        && let Some(other) = model.points.iter().find(|point| point.gain.signum() != first.gain.signum())
    {
        return Err(CompensatorError::GainsOfBothSigns { first: gain(first), other: gain(other) });
    }
    check_band(model)?;
    let poles: Vec<f64> = model.points.iter().map(|point| 1.0 / point.time_constant_s).collect();
    let design = |omega_g_rad_s: f64| {
        let lead = LeadParameters::from_poles(&poles, omega_g_rad_s)?;
        LeadDesign::new(
            LeadParameters { damping: options.damping, ..lead },
            options.loop_rate_hz,
            options.prewarp_rad_s,
        )?
        .with_slew(options.slew_per_s.unwrap_or(0.0))
    };
    design(options.omega_g_rad_s).map_err(|refused| match refused {
        DesignError::L1GainTooHigh { .. } => match largest(|omega_g| design(omega_g).is_ok(), options.omega_g_rad_s) {
            Some(largest_omega_g_rad_s) => CompensatorError::TooMuchLead { source: refused, largest_omega_g_rad_s },
            None => CompensatorError::Refused(refused),
        },
        _ => CompensatorError::Refused(refused),
    })
}

/// Refuses a zero on a time constant that is hardly known.
fn check_band(model: &Model) -> Result<(), CompensatorError> {
    let Some(band) = &model.time_constant_curve else { return Ok(()) };
    let fastest = model.points.iter().min_by(|a, b| a.time_constant_s.total_cmp(&b.time_constant_s));
    let Some(Point { nominal, time_constant_s, .. }) = fastest.cloned() else { return Ok(()) };
    let near = |k: &usize| (band.nominal[*k] - nominal).abs();
    let Some(k) = (0..band.nominal.len()).min_by(|a, b| near(a).total_cmp(&near(b))) else { return Ok(()) };
    let (low_s, high_s) = (band.low_s[k], band.high_s[k]);
    let factor = f64::max(high_s / time_constant_s, time_constant_s / low_s);
    match factor <= MOST_FACTOR {
        true => Ok(()),
        false => Err(CompensatorError::NotKnown { nominal, time_constant_s, low_s, high_s, factor }),
    }
}

/// The highest tenth below `refused` that is accepted, where one is: found by bisection from the first one that is on
/// the way down by tenths of itself. Chosen: a bracket of 0.01 rad/s is a tenth of what is shown; below 1 rad/s no rotor needs a lead.
fn largest(is_accepted: impl Fn(f64) -> bool, refused: f64) -> Option<f64> {
    let (mut high, mut low) = (refused, 0.9 * refused);
    while !is_accepted(low) {
        (high, low) = (low, 0.9 * low);
        if low < 1.0 {
            return None;
        }
    }
    while high - low > 0.01 {
        let middle = 0.5 * (low + high);
        if is_accepted(middle) { low = middle } else { high = middle }
    }
    let tenth = (10.0 * low).floor() / 10.0;
    is_accepted(tenth).then_some(tenth)
}
