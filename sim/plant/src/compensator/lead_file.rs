//! `compensator.toml` of a lead: its parameters, and the integers that a controller makes of them.

use std::f64::consts::PI;
use std::fmt::Display;

use rotorlead::design::{LeadDesign, LeadParameters};
use rotorlead_records::files::{Fault, KeyPath};
use serde::{Deserialize, Serialize};

use super::CompensatorProvenance;
use super::stored::CompensatorFile;

/// A compensator `C(s) = pole^2 (s / zero + 1) / (s^2 + 2 damping pole s + pole^2)` (3), and its
/// image at one loop rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeadFile {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// That it is a lead; a file without a kind is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<LeadKind>,
    /// The zero, in radians per second (2).
    pub zero_rad_s: f64,
    /// Natural frequency of the two poles, in radians per second (5).
    pub pole_rad_s: f64,
    /// Their damping ratio (4).
    pub damping: f64,
    /// Rate at which the filter runs, hertz.
    pub loop_rate_hz: f64,
    /// Frequency at which the sampled filter matches `C(s)` exactly, radians per second; `None`:
    /// plain bilinear transform.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prewarp_rad_s: Option<f64>,
    /// What the command changes by at most, units per second; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slew_per_s: Option<f64>,
    /// How a coefficient is stored.
    pub coefficient_format: CoefficientFormat,
    /// How a signal is stored.
    pub signal_format: SignalFormat,
    /// The integers.
    pub coefficients: StoredCoefficients,
    /// Where it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<CompensatorProvenance>,
}

/// The kind of compensator that the file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum LeadKind {
    /// A lead.
    #[serde(rename = "lead")]
    Lead,
}

/// The filter's coefficients as the controller holds them; what they multiply is said there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredCoefficients {
    /// The integer of coefficient `k`.
    pub k: i32,
    /// The integer of coefficient `c`.
    pub c: i32,
    /// The integer of coefficient `g0`.
    pub g0: i32,
    /// The integer of coefficient `g1`.
    pub g1: i32,
}

/// How a coefficient is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CoefficientFormat {
    /// `q0.32`: the integer is the coefficient times 2^32.
    #[serde(rename = "q0.32")]
    Q0_32,
}

/// How a signal is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SignalFormat {
    /// `q2.29`: the integer is the signal times 2^29.
    #[serde(rename = "q2.29")]
    Q2_29,
}

impl CompensatorFile for LeadFile {
    type Design = LeadDesign;

    fn from_design(design: &LeadDesign) -> Self {
        let (lead, coefficients) = (design.lead(), design.coefficients());
        Self {
            format: 1,
            kind: None,
            zero_rad_s: lead.omega_z_rad_s,
            pole_rad_s: lead.omega_f_rad_s,
            damping: lead.damping,
            loop_rate_hz: design.loop_rate_hz(),
            prewarp_rad_s: design.prewarp_rad_s(),
            slew_per_s: design.slew_per_s(),
            coefficient_format: CoefficientFormat::Q0_32,
            signal_format: SignalFormat::Q2_29,
            coefficients: StoredCoefficients {
                k: coefficients.k(),
                c: coefficients.c(),
                g0: coefficients.g0(),
                g1: coefficients.g1(),
            },
            provenance: None,
        }
    }

    /// All numbers are finite and above zero, the zero is below the poles, poles and prewarp frequency are below half the loop
    /// rate.
    fn check(&self) -> Result<(), Fault> {
        let root = KeyPath::root();
        for (key, value) in [
            ("zero_rad_s", self.zero_rad_s),
            ("pole_rad_s", self.pole_rad_s),
            ("damping", self.damping),
            ("loop_rate_hz", self.loop_rate_hz),
        ] {
            root.key(key).accept(value)?;
        }
        self.slew_per_s.map_or(Ok(()), |value| root.key("slew_per_s").accept(value))?;
        if self.zero_rad_s >= self.pole_rad_s {
            return Err(root.key("zero_rad_s").fault(
                format!("{} is not below `pole_rad_s`, {}: the filter would lag", self.zero_rad_s, self.pole_rad_s),
                "a lead compensator has its zero below its poles: exchange or correct them",
            ));
        }
        let half_rate_rad_s = PI * self.loop_rate_hz;
        for (key, value) in [("pole_rad_s", Some(self.pole_rad_s)), ("prewarp_rad_s", self.prewarp_rad_s)] {
            let Some(value) = value else { continue };
            root.key(key).accept(value)?;
            if value >= half_rate_rad_s {
                return Err(root.key(key).fault(
                    format!("{value} is not below half the loop rate, {half_rate_rad_s:.6} rad/s"),
                    "lower it, or raise `loop_rate_hz`",
                ));
            }
        }
        Ok(())
    }

    fn design(&self) -> Result<LeadDesign, impl Display> {
        let lead =
            LeadParameters { omega_z_rad_s: self.zero_rad_s, omega_f_rad_s: self.pole_rad_s, damping: self.damping };
        let design = LeadDesign::new(lead, self.loop_rate_hz, self.prewarp_rad_s);
        design.and_then(|design| design.with_slew(self.slew_per_s.unwrap_or(0.0)))
    }

    fn integers(&self) -> Vec<(KeyPath, i32)> {
        let StoredCoefficients { k, c, g0, g1 } = self.coefficients;
        let coefficients = KeyPath::root().key("coefficients");
        [("k", k), ("c", c), ("g0", g0), ("g1", g1)].map(|(key, value)| (coefficients.key(key), value)).into()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rotorlead_records::files::FileError;
    use rotorlead_records::files::TextFile;
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    fn design() -> LeadDesign {
        let lead = LeadParameters { omega_z_rad_s: 14.1275, omega_f_rad_s: 94.2156, damping: 0.75 };
        LeadDesign::new(lead, 5000.0, None).unwrap()
    }

    fn text() -> String {
        let StoredCoefficients { k, c, g0, g1 } = LeadFile::from_design(&design()).coefficients;
        format!(
            r#"format = 1
zero_rad_s = 14.1275
pole_rad_s = 94.2156
damping = 0.75
loop_rate_hz = 5000
coefficient_format = "q0.32"
signal_format = "q2.29"
[coefficients]
k = {k}
c = {c}
g0 = {g0}
g1 = {g1}
"#
        )
    }

    fn read(text: &str) -> Result<LeadDesign, FileError> {
        let scratch = Scratch::new();
        Ok(LeadFile::parse(TextFile::read(&scratch.file("compensator.toml", text))?)?.0)
    }

    #[track_caller]
    fn refuses(from: &str, to: &str, parts: &[&str]) {
        assert!(text().contains(from), "{from}");
        assert_report(read(&text().replacen(from, to, 1)).unwrap_err(), parts);
    }

    #[test]
    fn every_key_is_read() {
        assert_eq!(read(&text()).unwrap(), design());
        assert_eq!(read(&text().replacen("zero", "kind = \"lead\"\nzero", 1)).unwrap(), design());
        let prewarped = LeadDesign::new(*design().lead(), 5000.0, Some(20.0)).unwrap();
        let scratch = Scratch::new();
        let path = scratch.path().join("compensator.toml");
        crate::compensator::CompensatorDesign::from(prewarped).write(&path).unwrap();
        assert_eq!(LeadFile::parse(TextFile::read(&path).unwrap()).unwrap().0.prewarp_rad_s(), Some(20.0));
        let limited = read(&text().replacen("= 5000", "= 5000\nslew_per_s = 20", 1)).unwrap();
        assert_eq!(limited, design().with_slew(20.0).unwrap());
        assert_ne!(limited.filter(), design().filter());
    }

    #[test]
    fn keys_are_those_of_the_layout() {
        refuses("damping", "dampin", &["compensator.toml:4:1", "did you mean `damping`"]);
        let k = format!("k = {}", LeadFile::from_design(&design()).coefficients.k);
        refuses(&format!("{k}\n"), "", &["compensator.toml:8:1", "add `k`"]);
        refuses(&k, "q = 1", &["compensator.toml:9:1", "`q`", "remove `q`"]);
        refuses(&k, "k = 1.5", &["compensator.toml:9:5", "a whole number is needed"]);
        refuses(&k, "k = 2147483648", &["compensator.toml:9:5", "2147483648"]);
        refuses("q0.32", "q1.31", &["compensator.toml:6:22", "`q1.31`", "instead of `q1.31`"]);
        refuses("q2.29", "f32", &["compensator.toml:7:17", "`f32`", "`q2.29`", "help: "]);
        refuses("format = 1", "format = 2", &["compensator.toml:1:10", "layout 2"]);
    }

    #[test]
    fn parameters_have_their_ranges() {
        for (from, to, place, rule) in [
            ("= 14.1275", "= 0", "2:14", "above 0"),
            ("= 14.1275", "= nan", "2:14", "above 0"),
            ("= 14.1275", "= 94.2156", "2:14", "zero below its poles"),
            ("= 94.2156", "= inf", "3:14", "above 0"),
            ("= 94.2156", "= 15708", "3:14", "raise `loop_rate_hz`"),
            ("= 0.75", "= -0.75", "4:11", "above 0"),
            ("= 0.75", "= 9", "1:1", "damping is 9"),
            ("= 5000", "= -5000", "5:16", "above 0"),
            ("= 5000", "= 5000\nprewarp_rad_s = 0", "6:17", "above 0"),
            ("= 5000", "= 5000\nprewarp_rad_s = 15708", "6:17", "half the loop rate"),
            ("= 5000", "= 5000\nslew_per_s = 0", "6:14", "above 0"),
            ("= 5000", "= 5000\nslew_per_s = 0.01", "1:1", "at least 0.0763"),
        ] {
            refuses(from, to, &[&format!("compensator.toml:{place}]"), rule, "help: "]);
        }
    }

    #[test]
    fn coefficients_are_compared_with_those_of_the_parameters() {
        for (place, key) in [("9:5", "k"), ("10:5", "c"), ("11:6", "g0"), ("12:6", "g1")] {
            let from = format!("\n{key} = ");
            let place = format!("compensator.toml:{place}]");
            refuses(&from, &format!("{from}1 # "), &[&place, "the parameters give", "run `rotorlead design` again"]);
        }
    }

    #[test]
    fn a_compensator_that_would_not_read_back_is_not_written() {
        let scratch = Scratch::new();
        let file = LeadFile { damping: f64::NAN, ..LeadFile::from_design(&design()) };
        let error = file.text(&scratch.path().join("c.toml")).unwrap_err();
        assert_report(error, &["c.toml", "`damping`", "NaN", "give a value"]);
        assert!(scratch.names().is_empty());
    }

    proptest! {
        #[test]
        fn a_compensator_comes_back_bit_for_bit(
            zero_rad_s in 1.0..50.0,
            ratio in 1.5..10.0,
            damping in 0.3..2.0,
            prewarp_rad_s in prop::option::of(1.0..1e3),
            slew_per_s in prop_oneof![Just(0.0), 0.1..500.0],
        ) {
            let lead = LeadParameters { omega_z_rad_s: zero_rad_s, omega_f_rad_s: ratio * zero_rad_s, damping };
            let Ok(design) = LeadDesign::new(lead, 5000.0, prewarp_rad_s) else { return Ok(()) };
            let design = design.with_slew(slew_per_s).unwrap();
            let scratch = Scratch::new();
            let path = scratch.path().join("compensator.toml");
            crate::compensator::CompensatorDesign::from(design).write(&path).unwrap();
            prop_assert_eq!(LeadFile::parse(TextFile::read(&path).unwrap()).unwrap().0, design);
        }
    }
}
