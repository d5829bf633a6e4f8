//! `compensator.toml` of `kind = "inverse"`: a conditioned inverse's parameters, and the integers that a controller makes of them.

use std::f64::consts::PI;
use std::path::Path;

use rotorlead_records::files::{Fault, FileError, Place, TomlFile, write_toml};
use serde::{Deserialize, Serialize};

use crate::SignalFormat;

/// A conditioned inverse: the response that the rotor is to have, the time constants that it has, and what its command can do.
///
/// As for a lead ([`CompensatorFile`](crate::CompensatorFile)) the parameters are what counts, and the integers tell whether two
/// programs mean the same.
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
    /// How `a` and `b` are stored.
    pub coefficient_format: ReferenceFormat,
    /// How the gains are stored.
    pub gain_format: GainFormat,
    /// How a signal is stored.
    pub signal_format: SignalFormat,
    /// The integers.
    pub coefficients: StoredInverse,
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
    /// Reads an inverse and refuses it unless `compute` makes the stored integers of its parameters. `compute` is the controller's
    /// own computation; its error is the reason why it refuses the parameters.
    ///
    /// # Errors
    /// When the file is missing or is no inverse; parameters that break a rule or that `compute` refuses; other integers than it
    /// computes. The error shows the place in the file.
    pub fn read_matching<E: std::fmt::Display>(
        path: &Path,
        compute: impl FnOnce(&Self) -> Result<StoredInverse, E>,
    ) -> Result<Self, FileError> {
        let (inverse, file): (Self, _) = TomlFile::read(path)?;
        inverse.check().map_err(|fault| file.show(&fault))?;
        let computed = compute(&inverse).map_err(|reason| {
            file.show(&Place::root().fault(
                format!("no inverse can be made of these parameters: {reason}"),
                "run `rotorlead design`, or correct the parameter",
            ))
        })?;
        inverse.check_integers(&computed).map_err(|fault| file.show(&fault))?;
        Ok(inverse)
    }

    /// Checks an inverse and writes it, complete or not at all.
    ///
    /// # Errors
    /// When reading it back would refuse it, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.check().map_err(|fault| FileError::refused(path, fault))?;
        write_toml(path, self)
    }

    /// Refuses parameters that make no inverse at any number format. What the controller's format can hold is for its design to say.
    ///
    /// # Errors
    /// A fault that names the first number that breaks a rule: frequencies, damping, time constants and the slew limit are finite and
    /// above zero, the natural frequency is below half the loop rate, commands are 0..1 and increase, and both lists are as long.
    pub fn check(&self) -> Result<(), Fault> {
        let root = Place::root();
        for (key, value) in [
            ("natural_rad_s", Some(self.natural_rad_s)),
            ("damping", Some(self.damping)),
            ("loop_rate_hz", Some(self.loop_rate_hz)),
            ("slew_per_s", self.slew_per_s),
        ] {
            value.map_or(Ok(()), |value| root.key(key).positive(value))?;
        }
        let half_rate_rad_s = PI * self.loop_rate_hz;
        if self.natural_rad_s >= half_rate_rad_s {
            return Err(root.key("natural_rad_s").fault(
                format!("{} is not below half the loop rate, {half_rate_rad_s:.6} rad/s", self.natural_rad_s),
                "lower it, or raise `loop_rate_hz`",
            ));
        }
        root.key("min").fraction(self.min)?;
        root.key("max").fraction(self.max)?;
        if self.min > self.max {
            return Err(root
                .key("min")
                .fault(format!("{} is above `max`, {}", self.min, self.max), "exchange the two"));
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
            place.clone().fraction(nominal)?;
            root.key("time_constant_s").item(index).positive(time_constant_s)?;
            if index > 0 && nominal <= self.nominal[index - 1] {
                return Err(place.fault(
                    format!("{nominal} is not above the command before it, {}", self.nominal[index - 1]),
                    "sort the commands, and their time constants with them",
                ));
            }
        }
        Ok(())
    }

    fn check_integers(&self, computed: &StoredInverse) -> Result<(), Fault> {
        let stored = &self.coefficients;
        let root = Place::root().key("coefficients");
        let differs = |place: Place, stored: String, computed: String| {
            place.fault(
                format!("{stored} is stored, but the parameters give {computed}"),
                "a parameter or an integer was changed by hand, or another version wrote the file: run `rotorlead design` again",
            )
        };
        for (key, stored, computed) in [("a", stored.a, computed.a), ("b", stored.b, computed.b)] {
            if stored != computed {
                return Err(differs(root.key(key), stored.to_string(), computed.to_string()));
            }
        }
        if stored.g.len() != computed.g.len() {
            let count = |gains: &[i32]| format!("a table of {} gains", gains.len());
            return Err(differs(root.key("g"), count(&stored.g), count(&computed.g)));
        }
        let pairs = stored.g.iter().zip(&computed.g).enumerate();
        let mut wrong = pairs.filter(|(_, (stored, computed))| stored != computed);
        wrong.next().map_or(Ok(()), |(index, (stored, computed))| {
            Err(differs(root.key("g").item(index), stored.to_string(), computed.to_string()))
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    const INVERSE: &str = r#"format = 1
kind = "inverse"
natural_rad_s = 94.2
damping = 0.7071067811865476
loop_rate_hz = 5000
nominal = [0.4, 0.65]
time_constant_s = [0.159, 0.071]
min = 0
max = 1
slew_per_s = 160
coefficient_format = "q1.30"
gain_format = "q9.22"
signal_format = "q2.29"
[coefficients]
a = 1
b = 2
g = [3, 4]
"#;

    fn stored() -> StoredInverse {
        StoredInverse { a: 1, b: 2, g: vec![3, 4] }
    }

    fn read(text: &str, computed: Result<StoredInverse, String>) -> Result<InverseFile, FileError> {
        let scratch = Scratch::new();
        InverseFile::read_matching(&scratch.file("compensator.toml", text), |_| computed)
    }

    #[test]
    fn every_key_is_read_and_written() {
        let inverse = read(INVERSE, Ok(stored())).unwrap();
        assert_eq!((inverse.natural_rad_s, inverse.slew_per_s), (94.2, Some(160.0)));
        assert_eq!(inverse.time_constant_s, [0.159, 0.071]);
        let without = read(&INVERSE.replace("slew_per_s = 160\n", ""), Ok(stored())).unwrap();
        assert_eq!(without.slew_per_s, None);
        let scratch = Scratch::new();
        let path = scratch.path().join("c.toml");
        inverse.write(&path).unwrap();
        assert_eq!(InverseFile::read_matching(&path, |_| Ok::<_, String>(stored())).unwrap(), inverse);
    }

    #[test]
    fn parameters_have_their_ranges() {
        for (from, to, place, rule) in [
            ("\"inverse\"", "\"lead\"", "2:8", "`inverse`"),
            ("= 94.2", "= -1", "3:17", "above 0"),
            ("= 94.2", "= 15708", "3:17", "raise `loop_rate_hz`"),
            ("= 0.7071", "= -0.7071", "4:11", "above 0"),
            ("= 5000", "= nan", "5:16", "above 0"),
            ("[0.4, 0.65]", "[0.4, 1.65]", "6:17", "0 to 1"),
            ("[0.4, 0.65]", "[0.7, 0.65]", "6:17", "sort the commands"),
            ("[0.4, 0.65]", "[0.4]", "7:19", "2 time constants for 1 commands"),
            ("[0.159, 0.071]", "[0.159, 0]", "7:27", "above 0"),
            ("min = 0", "min = 2", "8:7", "0 to 1"),
            ("max = 1", "max = 1\n#", "", ""),
            ("min = 0\nmax = 1", "min = 0.5\nmax = 0.2", "8:7", "exchange the two"),
            ("= 160", "= 0", "10:14", "above 0"),
        ] {
            let text = INVERSE.replacen(from, to, 1);
            match read(&text, Ok(stored())) {
                Err(error) => assert_report(error, &[&format!("compensator.toml:{place}]"), rule, "help: "]),
                Ok(_) => assert!(rule.is_empty(), "{to} is accepted"),
            }
        }
    }

    #[test]
    fn integers_are_compared_with_those_of_the_parameters() {
        for (computed, place) in [
            (StoredInverse { a: 2, ..stored() }, "15:5"),
            (StoredInverse { b: 1, ..stored() }, "16:5"),
            (StoredInverse { g: vec![3, 5], ..stored() }, "17:9"),
            (StoredInverse { g: vec![3], ..stored() }, "17:5"),
        ] {
            let error = read(INVERSE, Ok(computed)).unwrap_err();
            let place = format!("compensator.toml:{place}]");
            assert_report(error, &[&place, "the parameters give", "run `rotorlead design` again"]);
        }
        let error = read(INVERSE, Err("the rotor is too fast".to_owned())).unwrap_err();
        assert_report(error, &["the rotor is too fast", "rotorlead design"]);
    }

    #[test]
    fn an_inverse_that_would_not_read_back_is_not_written() {
        let scratch = Scratch::new();
        let mut inverse = read(INVERSE, Ok(stored())).unwrap();
        inverse.damping = f64::NAN;
        assert_report(inverse.write(&scratch.path().join("c.toml")).unwrap_err(), &["c.toml", "`damping`", "NaN"]);
        assert!(scratch.names().is_empty());
    }

    proptest! {
        #[test]
        fn an_inverse_comes_back_bit_for_bit(
            natural_rad_s in 1.0..1e3,
            damping in 1e-3..10.0,
            time_constant_s in prop::collection::vec(1e-3..1.0, 1..33),
            slew_per_s in prop::option::of(1.0..1e3),
            integers in prop::collection::vec(any::<i32>(), 35),
        ) {
            let inverse = InverseFile {
                natural_rad_s,
                damping,
                nominal: (0..time_constant_s.len()).map(|k| k as f64 / 33.0).collect(),
                time_constant_s,
                slew_per_s,
                coefficients: StoredInverse { a: integers[0], b: integers[1], g: integers[2..].to_vec() },
                ..read(INVERSE, Ok(stored())).unwrap()
            };
            let scratch = Scratch::new();
            let path = scratch.path().join("compensator.toml");
            inverse.write(&path).unwrap();
            let again = InverseFile::read_matching(&path, |file| Ok::<_, String>(file.coefficients.clone())).unwrap();
            prop_assert_eq!(again, inverse);
        }
    }
}
