//! Betaflight's `thrust_linear`, which has one law up to release 2025.12 and another one from 2026.6 on, and what a value of one is in
//! the other.
//!
//! With the motor output at a thrust `y` of 0..1, `t` for a value of the older law and `e` for one of the newer, both over 100, the
//! outputs differ by
//!
//! ```text
//! y (1 - y) ((e - t/2) + (e^2 - t/2) (1 - 2 y))
//! ```
//!
//! whose mean square over `y` is `((e - t/2)^2 / 30 + (e^2 - t/2)^2 / 210)`. It is least over `t` where `4 t = 7 e + e^2`, and over `e`
//! where `2 e^3 + (7 - t) e = 7 t/2`, which increases for the values that the firmware takes. At half thrust the laws agree for `e = t/2`.

use std::str::FromStr;

use serde::Serialize;

pub(super) const BOOST_RELEASES: &str = "4.2 to 2025.12";
pub(super) const SERIES_RELEASES: &str = "2026.6 on";
/// Standard: src/main/cli/settings.c.
pub(super) const BOOST_BOUNDS: (f64, f64) = (0.0, 150.0);
/// The firmware takes up to 150. Derived: above 100 its throttle compensation, `y (1 - e (1 - y))`, is below zero at low throttle, and above
/// `100 sqrt(5/3)` the output falls where the thrust rises.
pub(super) const SERIES_BOUNDS: (f64, f64) = (0.0, 100.0);
/// Halvings of a bracket of 0..1. Derived: a double has 53 bits.
const HALVINGS: usize = 53;

/// A release of Betaflight that has one of the two laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirmwareRelease {
    /// From 4.2 to 2025.12.
    UpTo2025,
    /// From 2026.6 on.
    From2026,
}

/// Reads releases as Betaflight calls them: `4.5.1`, `2025.12`.
impl FromStr for FirmwareRelease {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut numbers = text.split('.').map(str::parse::<u16>);
        let (Some(Ok(major)), Some(Ok(minor))) = (numbers.next(), numbers.next()) else {
            return Err(format!("`{text}` is no release: give it as 4.5, 2025.12 or 2026.6"));
        };
        match (major, minor) {
            (..4, _) | (4, ..2) => {
                Err(format!("release {text} has neither of the two laws of `thrust_linear`: they are of 4.2 and later"))
            }
            // The one after 4.5 is called by year and month, as all since.
            (4, ..=5) | (2025, 12) | (2026, 1..=5) => Ok(Self::UpTo2025),
            (2026.., 1..=12) => Ok(Self::From2026),
            _ => Err(format!("there is no release {text}: they are 4.2 to 4.5, and from 2025.12 on year and month")),
        }
    }
}

impl FirmwareRelease {
    /// The releases with this law.
    #[must_use]
    pub fn releases(self) -> &'static str {
        match self {
            Self::UpTo2025 => BOOST_RELEASES,
            Self::From2026 => SERIES_RELEASES,
        }
    }

    /// The releases with the other law.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::UpTo2025 => Self::From2026,
            Self::From2026 => Self::UpTo2025,
        }
    }

    fn bounds(self) -> (f64, f64) {
        match self {
            Self::UpTo2025 => BOOST_BOUNDS,
            Self::From2026 => SERIES_BOUNDS,
        }
    }
}

/// A value of `thrust_linear` in the law of other releases.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ThrustLinear {
    /// The whole number to set.
    pub value: f64,
    /// The releases that it is for.
    pub releases: &'static str,
    /// Before it is rounded: least squares of the motor output over thrusts from 0 to 1.
    pub least_squares: f64,
    /// The value with the same motor output at half thrust.
    pub same_at_half_thrust: f64,
    /// What is left between the two laws, root of the mean square, % of the full output.
    pub rms_error_percent: f64,
    /// Its highest, % of the full output.
    pub worst_error_percent: f64,
}

impl ThrustLinear {
    /// Converts `value` from the law of these releases to the other law.
    ///
    /// # Errors
    /// When one of the two values is beyond those for which its law holds.
    pub fn convert(value: f64, from: FirmwareRelease) -> Result<Self, String> {
        let to = from.other();
        let check = |value: f64, release: FirmwareRelease| {
            let (least, most) = release.bounds();
            let is_within = (least..=most).contains(&value);
            let releases = release.releases();
            is_within.then_some(()).ok_or_else(|| {
                format!("`thrust_linear` of releases {releases} goes from {least} to {most}, and this is {value:.0}")
            })
        };
        check(value, from)?;
        let share = value / 100.0;
        let (least_squares, same_at_half_thrust) = match to {
            FirmwareRelease::From2026 => (newer(share), 0.5 * share),
            FirmwareRelease::UpTo2025 => (0.25 * share * (7.0 + share), 2.0 * share),
        };
        let set = (100.0 * least_squares).round();
        check(set, to)?;
        let (t, e) = match to {
            FirmwareRelease::From2026 => (share, set / 100.0),
            FirmwareRelease::UpTo2025 => (set / 100.0, share),
        };
        let (even, odd) = (e - 0.5 * t, e * e - 0.5 * t);
        Ok(Self {
            value: set,
            releases: to.releases(),
            least_squares: 100.0 * least_squares,
            same_at_half_thrust: 100.0 * same_at_half_thrust,
            rms_error_percent: 100.0 * (even * even / 30.0 + odd * odd / 210.0).sqrt(),
            worst_error_percent: 100.0 * worst(even, odd),
        })
    }
}

/// The newer law's value that is nearest to one of the older law.
fn newer(t: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let e: f64 = 0.5 * (low + high);
        if 2.0 * e.powi(3) + (7.0 - t) * e < 3.5 * t { low = e } else { high = e }
    }
    0.5 * (low + high)
}

/// The highest magnitude of `(1 - u^2)/4 (even + odd u)` over `u` from -1 to 1, where its slope is zero.
fn worst(even: f64, odd: f64) -> f64 {
    let root = even.hypot(3.0_f64.sqrt() * odd);
    // The two roots of 3 odd u^2 + 2 even u - odd, of which the smaller without cancellation.
    let small = odd / (even + root.copysign(even));
    let large = -1.0 / (3.0 * small);
    let miss = |u: f64| if u.abs() <= 1.0 { (0.25 * (1.0 - u * u) * (even + odd * u)).abs() } else { 0.0 };
    miss(small).max(miss(large))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::ThrustLaw;

    fn outputs(t: f64, e: f64) -> impl Iterator<Item = (f64, f64)> {
        (0..=1000).map(|k| f64::from(k) / 1000.0).map(move |y| {
            (y * (1.0 + t * (1.0 - y) * (1.0 - y)), y * (1.0 + e * (1.0 - y) * (1.0 + e * (1.0 - 2.0 * y))))
        })
    }

    #[test]
    fn the_errors_and_the_least_squares_are_those_of_the_two_laws() {
        for (old, new) in [(0.0, 0.0), (25.0, 13.0), (100.0, 53.0), (120.0, 64.0), (123.0, 65.0), (150.0, 78.0)] {
            let found = ThrustLinear::convert(old, FirmwareRelease::UpTo2025).unwrap();
            assert_eq!(found.value, new);
            let misses: Vec<f64> = outputs(old / 100.0, new / 100.0).map(|(a, b)| b - a).collect();
            let rms = (misses.iter().map(|miss| miss * miss).sum::<f64>() / 1000.0).sqrt();
            let worst = misses.iter().fold(0.0_f64, |worst, miss| worst.max(miss.abs()));
            assert!((found.rms_error_percent - 100.0 * rms).abs() < 1e-4, "{found:?} {rms}");
            assert!((found.worst_error_percent - 100.0 * worst).abs() < 1e-3, "{found:?} {worst}");
            let sum = |e: f64| outputs(old / 100.0, e).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
            let e = found.least_squares / 100.0;
            assert!(old == 0.0 || sum(e) < sum(e + 1e-3).min(sum(e - 1e-3)), "{found:?}");
        }
    }

    #[test]
    fn both_ways_lead_back_within_what_rounding_and_the_two_laws_leave() {
        for old in [10.0, 40.0, 75.0, 120.0, 148.0] {
            let there = ThrustLinear::convert(old, FirmwareRelease::UpTo2025).unwrap();
            let back = ThrustLinear::convert(there.value, FirmwareRelease::From2026).unwrap();
            let difference =
                outputs(old / 100.0, 0.0).zip(outputs(back.value / 100.0, 0.0)).map(|((a, _), (b, _))| (a - b).abs());
            let worst = 100.0 * difference.fold(0.0, f64::max);
            assert!(worst <= there.worst_error_percent + back.worst_error_percent, "{old} {back:?}");
        }
    }

    #[test]
    fn half_of_the_older_value_is_exact_at_half_thrust() {
        let found = ThrustLinear::convert(120.0, FirmwareRelease::UpTo2025).unwrap();
        assert!((found.same_at_half_thrust - 60.0).abs() < 1e-9);
        let output = 0.5 * (1.0 + 1.2 * 0.25);
        for (law, value) in [(ThrustLaw::Boost, 1.2), (ThrustLaw::InverseSeries, 0.6)] {
            assert!((law.thrust(output, value).unwrap() - 0.5).abs() < 1e-12);
        }
    }

    #[test]
    fn releases_are_by_their_law_and_values_beyond_it_are_refused() {
        for (text, law) in [
            ("4.2", Some(FirmwareRelease::UpTo2025)),
            ("4.5.1", Some(FirmwareRelease::UpTo2025)),
            ("2025.12", Some(FirmwareRelease::UpTo2025)),
            ("2026.6", Some(FirmwareRelease::From2026)),
            ("2026.6.1", Some(FirmwareRelease::From2026)),
            ("2027.1", Some(FirmwareRelease::From2026)),
            ("4.6", None),
            ("7.9", None),
            ("2024.1", None),
            ("2026.13", None),
            ("4.1", None),
            ("3.5", None),
            ("2026", None),
            ("new", None),
        ] {
            assert_eq!(text.parse().ok(), law, "{text}");
        }
        let refused = |value, from| ThrustLinear::convert(value, from).unwrap_err();
        assert!(refused(151.0, FirmwareRelease::UpTo2025).contains("0 to 150"));
        assert!(refused(101.0, FirmwareRelease::From2026).contains("0 to 100"));
        assert!(refused(90.0, FirmwareRelease::From2026).contains("this is 178"));
    }
}
