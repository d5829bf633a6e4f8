//! `compensator.toml` of `kind = "inverse"`: a conditioned inverse's parameters, and the integers that a controller makes of them.

use std::f64::consts::PI;
use std::fmt::Display;

use rotorlead::design::{CurvePoint, InverseError, ReferenceModel};
use rotorlead_records::files::{Fault, KeyPath};
use serde::{Deserialize, Serialize};

use super::stored::CompensatorFile;
use super::{CompensatorProvenance, InverseCompensator, InverseRange, SignalFormat};

/// A conditioned inverse: the response that the rotor is to have, the time constants that it has, and what its command can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InverseFile {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// That it is one.
    pub kind: InverseKind,
    /// Natural frequency of the reference model, radians per second.
    pub natural_rad_s: f64,
    /// Its damping ratio.
    pub damping: f64,
    /// Rate at which the inverse runs, hertz.
    pub loop_rate_hz: f64,
    /// Commands, increasing, 0..1.
    pub nominal: Vec<f64>,
    /// Time constants of the table at these, seconds.
    pub time_constant_s: Vec<f64>,
    /// The lowest command that the ESC gets, 0..1.
    pub min: f64,
    /// The highest, 0..1.
    pub max: f64,
    /// What the command changes by at most, units per second; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slew_per_s: Option<f64>,
    /// The lowest command of the flight controller for which the time constant is known, 0..1: below it the inverse is bypassed;
    /// `None`: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensate_from: Option<f64>,
    /// The highest one; `None`: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensate_to: Option<f64>,
    /// How `a` and `b` are stored.
    pub coefficient_format: ReferenceFormat,
    /// How the gains are stored.
    pub gain_format: GainFormat,
    /// How a signal is stored.
    pub signal_format: SignalFormat,
    /// The integers.
    pub coefficients: StoredInverse,
    /// Where it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<CompensatorProvenance>,
}

/// The kind of compensator that the file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum InverseKind {
    /// A conditioned inverse.
    #[serde(rename = "inverse")]
    Inverse,
}

/// The integers of the recurrence; what they multiply is said at the controller's `inverse` module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredInverse {
    /// Gain of the reference model.
    pub a: i32,
    /// Damping of the reference model.
    pub b: i32,
    /// Gains of the inverse, at the commands 0, 1/32, ..., 1.
    pub g: Vec<i32>,
}

/// How the coefficients of the reference model are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReferenceFormat {
    /// `q1.30`: the integer is the coefficient times 2^30.
    #[serde(rename = "q1.30")]
    Q1_30,
}

/// How the gains of the inverse are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum GainFormat {
    /// `q9.22`: the integer is the gain times 2^22.
    #[serde(rename = "q9.22")]
    Q9_22,
}

impl InverseFile {
    fn compensated(&self) -> (f64, f64) {
        (self.compensate_from.unwrap_or(0.0), self.compensate_to.unwrap_or(1.0))
    }
}

impl CompensatorFile for InverseFile {
    type Design = InverseCompensator;

    fn from_design(inverse: &InverseCompensator) -> Self {
        let (design, range) = (inverse.design(), inverse.range());
        let (from, to) = range.compensated;
        let coefficients = design.coefficients();
        Self {
            format: 1,
            kind: InverseKind::Inverse,
            natural_rad_s: design.reference().omega_f_rad_s,
            damping: design.reference().damping,
            loop_rate_hz: design.loop_rate_hz(),
            nominal: inverse.points().iter().map(|point| point.command).collect(),
            time_constant_s: inverse.points().iter().map(|point| point.tau_s).collect(),
            min: range.min,
            max: range.max,
            slew_per_s: range.slew_per_s,
            compensate_from: (from > 0.0).then_some(from),
            compensate_to: (to < 1.0).then_some(to),
            coefficient_format: ReferenceFormat::Q1_30,
            gain_format: GainFormat::Q9_22,
            signal_format: SignalFormat::Q2_29,
            coefficients: StoredInverse { a: coefficients.a(), b: coefficients.b(), g: coefficients.gains().to_vec() },
            provenance: None,
        }
    }

    /// Frequencies, damping, time constants and the slew limit are finite and above zero, the natural frequency is below half the loop
    /// rate, commands are 0..1 and increase, and both lists are as long.
    fn check(&self) -> Result<(), Fault> {
        let root = KeyPath::root();
        for (key, value) in [
            ("natural_rad_s", Some(self.natural_rad_s)),
            ("damping", Some(self.damping)),
            ("loop_rate_hz", Some(self.loop_rate_hz)),
            ("slew_per_s", self.slew_per_s),
        ] {
            value.map_or(Ok(()), |value| root.key(key).accept(value))?;
        }
        let half_rate_rad_s = PI * self.loop_rate_hz;
        if self.natural_rad_s >= half_rate_rad_s {
            return Err(root.key("natural_rad_s").fault(
                format!("{} is not below half the loop rate, {half_rate_rad_s:.6} rad/s", self.natural_rad_s),
                "lower it, or raise `loop_rate_hz`",
            ));
        }
        root.key("min").accept(self.min)?;
        root.key("max").accept(self.max)?;
        if self.min > self.max {
            return Err(root
                .key("min")
                .fault(format!("{} is above `max`, {}", self.min, self.max), "exchange the two"));
        }
        let (from, to) = self.compensated();
        root.key("compensate_from").accept(from)?;
        root.key("compensate_to").accept(to)?;
        if from > to {
            return Err(root
                .key("compensate_from")
                .fault(format!("{from} is above `compensate_to`, {to}"), "exchange the two"));
        }
        let (commands, times) = (self.nominal.len(), self.time_constant_s.len());
        if commands != times {
            return Err(root.key("time_constant_s").fault(
                format!("{times} time constants for {commands} commands"),
                "give each command of `nominal` its time constant",
            ));
        }
        for (index, (&nominal, &time_constant_s)) in self.nominal.iter().zip(&self.time_constant_s).enumerate() {
            let place = root.key("nominal").item(index);
            place.clone().accept(nominal)?;
            root.key("time_constant_s").item(index).accept(time_constant_s)?;
            if index > 0 && nominal <= self.nominal[index - 1] {
                return Err(place.fault(
                    format!("{nominal} is not above the command before it, {}", self.nominal[index - 1]),
                    "sort the commands, and their time constants with them",
                ));
            }
        }
        Ok(())
    }

    fn design(&self) -> Result<InverseCompensator, impl Display> {
        let reference = ReferenceModel { omega_f_rad_s: self.natural_rad_s, damping: self.damping };
        let points = self.nominal.iter().zip(&self.time_constant_s);
        let points = points.map(|(&command, &tau_s)| CurvePoint { command, tau_s }).collect();
        let Self { min, max, slew_per_s, .. } = *self;
        let range = InverseRange { min, max, slew_per_s, compensated: self.compensated() };
        let designed: Result<_, InverseError> = InverseCompensator::new(reference, self.loop_rate_hz, points, &range);
        designed
    }

    fn integers(&self) -> Vec<(KeyPath, i32)> {
        let coefficients = KeyPath::root().key("coefficients");
        let gains = coefficients.key("g");
        let ab = [("a", self.coefficients.a), ("b", self.coefficients.b)];
        let ab = ab.map(|(key, value)| (coefficients.key(key), value));
        let g = self.coefficients.g.iter().enumerate().map(|(index, &gain)| (gains.item(index), gain));
        ab.into_iter().chain(g).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rotorlead_records::files::FileError;
    use rotorlead_records::files::TextFile;
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    fn inverse() -> InverseCompensator {
        let points = [(0.4, 0.159), (0.65, 0.071)].map(|(command, tau_s)| CurvePoint { command, tau_s });
        let reference = ReferenceModel { omega_f_rad_s: 94.2, damping: 0.75 };
        let range = InverseRange { min: 0.05, max: 1.0, slew_per_s: Some(160.0), compensated: (0.35, 0.7) };
        InverseCompensator::new(reference, 5000.0, points.to_vec(), &range).unwrap()
    }

    fn text() -> String {
        let StoredInverse { a, b, g } = InverseFile::from_design(&inverse()).coefficients;
        format!(
            r#"format = 1
kind = "inverse"
natural_rad_s = 94.2
damping = 0.75
loop_rate_hz = 5000
nominal = [0.4, 0.65]
time_constant_s = [0.159, 0.071]
min = 0.05
max = 1
slew_per_s = 160
compensate_from = 0.35
compensate_to = 0.7
coefficient_format = "q1.30"
gain_format = "q9.22"
signal_format = "q2.29"
[coefficients]
a = {a}
b = {b}
g = {g:?}
"#
        )
    }

    fn read(text: &str) -> Result<InverseCompensator, FileError> {
        let scratch = Scratch::new();
        Ok(InverseFile::parse(TextFile::read(&scratch.file("compensator.toml", text))?)?.0)
    }

    #[track_caller]
    fn refuses(from: &str, to: &str, parts: &[&str]) {
        assert!(text().contains(from), "{from}");
        assert_report(read(&text().replacen(from, to, 1)).unwrap_err(), parts);
    }

    #[test]
    fn every_key_is_read_and_written() {
        assert_eq!(read(&text()).unwrap(), inverse());
        let without = text().replace("slew_per_s = 160\ncompensate_from = 0.35\ncompensate_to = 0.7\n", "");
        let range = InverseRange { slew_per_s: None, compensated: (0.0, 1.0), ..inverse().range() };
        assert_eq!(read(&without).unwrap().range(), range);
    }

    #[test]
    fn parameters_have_their_ranges() {
        for (from, to, place, rule) in [
            ("\"inverse\"", "\"lead\"", "2:8", "`inverse`"),
            ("= 94.2", "= -1", "3:17", "above 0"),
            ("= 94.2", "= 15708", "3:17", "raise `loop_rate_hz`"),
            ("= 94.2", "= 4000", "1:1", "too close to Nyquist"),
            ("= 0.75", "= -0.75", "4:11", "above 0"),
            ("= 5000", "= nan", "5:16", "above 0"),
            ("[0.4, 0.65]", "[0.4, 1.65]", "6:17", "0 to 1"),
            ("[0.4, 0.65]", "[0.7, 0.65]", "6:17", "sort the commands"),
            ("[0.4, 0.65]", "[0.4]", "7:19", "2 time constants for 1 commands"),
            ("[0.4, 0.65]", "[]", "7:19", "2 time constants for 0 commands"),
            ("[0.159, 0.071]", "[0.159, 0]", "7:27", "above 0"),
            ("[0.159, 0.071]", "[0.159, 0.004]", "1:1", "the rotor is faster than"),
            ("min = 0.05", "min = 2", "8:7", "0 to 1"),
            ("min = 0.05\nmax = 1", "min = 0.5\nmax = 0.2", "8:7", "exchange the two"),
            ("= 160", "= 0", "10:14", "above 0"),
            ("= 160", "= 0.01", "1:1", "at least 0.0763"),
            ("compensate_from = 0.35", "compensate_from = 1.5", "11:19", "0 to 1"),
            ("compensate_from = 0.35", "compensate_from = 0.8", "11:19", "exchange the two"),
        ] {
            refuses(from, to, &[&format!("compensator.toml:{place}]"), rule, "help: "]);
        }
    }

    #[test]
    fn integers_are_compared_with_those_of_the_parameters() {
        for (from, place) in [("\na = ", "17:5"), ("\nb = ", "18:5"), ("\ng = [", "19:6")] {
            let place = format!("compensator.toml:{place}]");
            refuses(from, &format!("{from}1"), &[&place, "the parameters give", "run `rotorlead design` again"]);
        }
        let g = InverseFile::from_design(&inverse()).coefficients.g;
        let last = format!(", {}]\n", g[g.len() - 1]);
        refuses(&last, "]\n", &["34 integers is stored", "run `rotorlead design` again"]);
    }

    #[test]
    fn an_inverse_that_would_not_read_back_is_not_written() {
        let scratch = Scratch::new();
        let file = InverseFile { damping: f64::NAN, ..InverseFile::from_design(&inverse()) };
        assert_report(file.text(&scratch.path().join("c.toml")).unwrap_err(), &["c.toml", "`damping`", "NaN"]);
        assert!(scratch.names().is_empty());
    }

    proptest! {
        #[test]
        fn an_inverse_comes_back_bit_for_bit(
            omega_f_rad_s in 50.0..200.0,
            damping in 0.3..2.0,
            pole_rad_s in 5.0..10.0,
            count in 1..33_usize,
            slew_per_s in prop::option::of(1.0..1e3),
            ends in (0.0..0.5, 0.5..1.0),
        ) {
            let point = |k: usize| {
                let command = k as f64 / 33.0;
                CurvePoint { command, tau_s: 1.0 / (pole_rad_s * (1.0 + command)) }
            };
            let range = InverseRange { min: ends.0 / 2.0, max: 1.0, slew_per_s, compensated: ends };
            let reference = ReferenceModel { omega_f_rad_s, damping };
            let inverse = InverseCompensator::new(reference, 5000.0, (0..count).map(point).collect(), &range).unwrap();
            let scratch = Scratch::new();
            let path = scratch.path().join("compensator.toml");
            crate::compensator::CompensatorDesign::from(inverse.clone()).write(&path).unwrap();
            prop_assert_eq!(InverseFile::parse(TextFile::read(&path).unwrap()).unwrap().0, inverse);
        }
    }
}
