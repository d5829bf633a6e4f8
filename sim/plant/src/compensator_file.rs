//! `compensator.toml`: a compensator's parameters, and the integers that a controller makes of
//! them.

use std::f64::consts::PI;
use std::path::Path;

use rotorlead_records::files::{Fault, FileError, Place, TomlFile, write_toml};
use serde::{Deserialize, Serialize};

/// A compensator `C(s) = pole^2 (s / zero + 1) / (s^2 + 2 damping pole s + pole^2)` (3), and its
/// image at one loop rate.
///
/// The parameters are what counts: a controller computes the coefficients from them at start-up.
/// The coefficients are in the file to be compared: they tell whether two programs mean the same
/// filter. See [`CompensatorFile::read_matching`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompensatorFile {
    /// Version of the file's layout; 1.
    pub format: u32,
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
    /// How a coefficient is stored.
    pub coefficient_format: CoefficientFormat,
    /// How a signal is stored.
    pub signal_format: SignalFormat,
    /// The integers.
    pub coefficients: StoredCoefficients,
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

impl CompensatorFile {
    /// Reads and checks a compensator's parameters. The coefficients are taken as they are: where
    /// they matter, use [`CompensatorFile::read_matching`].
    ///
    /// # Errors
    /// When the file is missing or is no compensator: an unknown key, a missing one, or a number
    /// that [`CompensatorFile::check`] refuses. The error shows the place in the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Ok(Self::read_located(path)?.0)
    }

    /// Reads a compensator and refuses it unless `compute` makes the stored coefficients of its
    /// parameters. `compute` is the controller's own computation; its error is the reason why it
    /// refuses the parameters.
    ///
    /// # Errors
    /// Those of [`CompensatorFile::read`]; parameters that `compute` refuses; other coefficients
    /// than it computes.
    pub fn read_matching<E: std::fmt::Display>(
        path: &Path,
        compute: impl FnOnce(&Self) -> Result<StoredCoefficients, E>,
    ) -> Result<Self, FileError> {
        let (compensator, file) = Self::read_located(path)?;
        let computed = compute(&compensator).map_err(|reason| {
            file.show(&Place::root().fault(
                format!("no filter can be made of these parameters: {reason}"),
                "run `rotorlead design`, or correct the parameter",
            ))
        })?;
        compensator.check_coefficients(computed).map_err(|fault| file.show(&fault))?;
        Ok(compensator)
    }

    fn read_located(path: &Path) -> Result<(Self, TomlFile), FileError> {
        let (compensator, file): (Self, _) = TomlFile::read(path)?;
        compensator.check().map_err(|fault| file.show(&fault))?;
        Ok((compensator, file))
    }

    /// Checks a compensator and writes it, complete or not at all.
    ///
    /// # Errors
    /// When reading it back would refuse it, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.check().map_err(|fault| FileError::refused(path, fault))?;
        write_toml(path, self)
    }

    /// Refuses parameters that make no lead compensator at any number format. What the filter's
    /// format can hold is for the controller's design to say.
    ///
    /// # Errors
    /// A fault that names the first number that breaks a rule: all are finite and above zero, the
    /// zero is below the poles, poles and prewarp frequency are below half the loop rate.
    pub fn check(&self) -> Result<(), Fault> {
        let root = Place::root();
        for (key, value) in [
            ("zero_rad_s", self.zero_rad_s),
            ("pole_rad_s", self.pole_rad_s),
            ("damping", self.damping),
            ("loop_rate_hz", self.loop_rate_hz),
        ] {
            root.key(key).positive(value)?;
        }
        if self.zero_rad_s >= self.pole_rad_s {
            return Err(root.key("zero_rad_s").fault(
                format!("{} is not below `pole_rad_s`, {}: the filter would lag", self.zero_rad_s, self.pole_rad_s),
                "a lead compensator has its zero below its poles: exchange or correct them",
            ));
        }
        let half_rate_rad_s = PI * self.loop_rate_hz;
        for (key, value) in [("pole_rad_s", Some(self.pole_rad_s)), ("prewarp_rad_s", self.prewarp_rad_s)] {
            let Some(value) = value else { continue };
            root.key(key).positive(value)?;
            if value >= half_rate_rad_s {
                return Err(root.key(key).fault(
                    format!("{value} is not below half the loop rate, {half_rate_rad_s:.6} rad/s"),
                    "lower it, or raise `loop_rate_hz`",
                ));
            }
        }
        Ok(())
    }

    fn check_coefficients(&self, computed: StoredCoefficients) -> Result<(), Fault> {
        let stored = self.coefficients;
        for (key, stored, computed) in [
            ("k", stored.k, computed.k),
            ("c", stored.c, computed.c),
            ("g0", stored.g0, computed.g0),
            ("g1", stored.g1, computed.g1),
        ] {
            if stored != computed {
                return Err(Place::root().key("coefficients").key(key).fault(
                    format!("{stored} is stored, but the parameters give {computed}"),
                    "a parameter or a coefficient was changed by hand, or another version wrote \
                     the file: run `rotorlead design` again",
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    const COMPENSATOR: &str = r#"format = 1
zero_rad_s = 14.1275
pole_rad_s = 94.2156
damping = 0.7071067811865476
loop_rate_hz = 5000
coefficient_format = "q0.32"
signal_format = "q2.29"
[coefficients]
k = 1
c = -2
g0 = 2147483647
g1 = -2147483648
"#;

    const STORED: StoredCoefficients = StoredCoefficients { k: 1, c: -2, g0: i32::MAX, g1: i32::MIN };

    fn read(text: &str) -> Result<CompensatorFile, FileError> {
        let scratch = Scratch::new();
        CompensatorFile::read(&scratch.file("compensator.toml", text))
    }

    #[track_caller]
    fn refuses(from: &str, to: &str, parts: &[&str]) {
        assert!(COMPENSATOR.contains(from));
        assert_report(read(&COMPENSATOR.replacen(from, to, 1)).unwrap_err(), parts);
    }

    #[test]
    fn every_key_is_read() {
        let compensator = read(COMPENSATOR).unwrap();
        assert_eq!(compensator.zero_rad_s, 14.1275);
        assert_eq!(compensator.loop_rate_hz, 5000.0);
        assert_eq!(compensator.prewarp_rad_s, None);
        assert_eq!(compensator.coefficients, STORED);
        let text = COMPENSATOR.replacen("damping", "prewarp_rad_s = 20\ndamping", 1);
        assert_eq!(read(&text).unwrap().prewarp_rad_s, Some(20.0));
    }

    #[test]
    fn a_missing_file_is_named() {
        let scratch = Scratch::new();
        let error = CompensatorFile::read(&scratch.path().join("c.toml")).unwrap_err();
        assert_report(error, &["c.toml", "does not exist", "check the path"]);
    }

    #[test]
    fn keys_are_those_of_the_layout() {
        refuses("damping", "dampin", &["compensator.toml:4:1", "did you mean `damping`"]);
        refuses("k = 1\n", "", &["compensator.toml:8:1", "add `k`"]);
        refuses("k = 1", "q = 1", &["compensator.toml:9:1", "`q`", "remove `q`"]);
        refuses("k = 1", "k = 1.5", &["compensator.toml:9:5", "a whole number is needed"]);
        refuses("k = 1", "k = 2147483648", &["compensator.toml:9:5", "2147483648"]);
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
            ("= 0.7071", "= -0.7071", "4:11", "above 0"),
            ("= 5000", "= -5000", "5:16", "above 0"),
            ("= 5000", "= 5000\nprewarp_rad_s = 0", "6:17", "above 0"),
            ("= 5000", "= 5000\nprewarp_rad_s = 15708", "6:17", "half the loop rate"),
        ] {
            refuses(from, to, &[&format!("compensator.toml:{place}]"), rule, "help: "]);
        }
    }

    #[test]
    fn coefficients_are_compared_with_those_of_the_parameters() {
        let scratch = Scratch::new();
        let path = scratch.file("compensator.toml", COMPENSATOR);
        let matching =
            |computed: Result<StoredCoefficients, String>| CompensatorFile::read_matching(&path, |_| computed);
        assert_eq!(matching(Ok(STORED)).unwrap().coefficients, STORED);
        for (computed, place) in [
            (StoredCoefficients { k: 2, ..STORED }, "9:5"),
            (StoredCoefficients { c: -1, ..STORED }, "10:5"),
            (StoredCoefficients { g0: 0, ..STORED }, "11:6"),
            (StoredCoefficients { g1: 0, ..STORED }, "12:6"),
        ] {
            let error = matching(Ok(computed)).unwrap_err();
            let place = format!("compensator.toml:{place}]");
            assert_report(error, &[&place, "the parameters give", "run `rotorlead design` again"]);
        }
        let error = matching(Err("damping is 9".to_owned())).unwrap_err();
        assert_report(error, &["compensator.toml:1:1]", "damping is 9", "rotorlead design"]);
    }

    #[test]
    fn a_compensator_that_would_not_read_back_is_not_written() {
        let scratch = Scratch::new();
        let mut compensator = read(COMPENSATOR).unwrap();
        compensator.damping = f64::NAN;
        let error = compensator.write(&scratch.path().join("c.toml")).unwrap_err();
        assert_report(error, &["c.toml", "`damping`", "NaN", "give a value"]);
        assert!(scratch.names().is_empty());
    }

    proptest! {
        #[test]
        fn a_compensator_comes_back_bit_for_bit(
            zero_rad_s in 1e-3..1e2,
            pole_rad_s in 1e2..1e3,
            damping in 1e-3..10.0,
            loop_rate_hz in 1e3..1e5,
            prewarp_rad_s in prop::option::of(1e-3..1e3),
            integers in any::<[i32; 4]>(),
        ) {
            let compensator = CompensatorFile {
                format: 1,
                zero_rad_s,
                pole_rad_s,
                damping,
                loop_rate_hz,
                prewarp_rad_s,
                coefficient_format: CoefficientFormat::Q0_32,
                signal_format: SignalFormat::Q2_29,
                coefficients: StoredCoefficients {
                    k: integers[0],
                    c: integers[1],
                    g0: integers[2],
                    g1: integers[3],
                },
            };
            let scratch = Scratch::new();
            let path = scratch.path().join("compensator.toml");
            compensator.write(&path).unwrap();
            prop_assert_eq!(CompensatorFile::read(&path).unwrap(), compensator);
        }
    }
}
