//! `stand.toml`: the transfer function of a stand, from the force put in to the thrust that its sensor shows.

use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;
use rotorlead_records::files::{Fault, FileError, KeyPath, TomlFile, write_toml};
use serde::{Deserialize, Serialize};

use crate::stand::transfer_function::{Root, TransferFunction};

/// A stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandModel {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// Static gain, newtons shown per newton put in.
    pub gain: f64,
    /// Its standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// End of the usable range in hertz, where the response is 3 dB off its static value; absent when it is nowhere within
    /// the lines of the experiment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usable_hz: Option<f64>,
    /// Its standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usable_hz_std: Option<f64>,
    /// The highest line that the model was fitted to, hertz.
    pub top_hz: f64,
    /// The poles, by frequency.
    #[serde(rename = "pole", default)]
    pub poles: Vec<StandRoot>,
    /// The zeros, by frequency.
    #[serde(rename = "zero", default)]
    pub zeros: Vec<StandRoot>,
    /// The records used.
    #[serde(default)]
    pub records: Vec<String>,
}

/// A pair of complex roots, or a real root: its damping is then exactly 1, or -1 in the right half plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandRoot {
    /// Magnitude over `2 pi`, hertz.
    pub frequency_hz: f64,
    /// Its standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_hz_std: Option<f64>,
    /// Damping ratio, -1 to 1; negative in the right half plane.
    pub damping: f64,
    /// Its standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_std: Option<f64>,
}

impl StandRoot {
    pub(super) fn from_root(root: &Root) -> Self {
        Self {
            frequency_hz: root.frequency_rad_s.value / TAU,
            frequency_hz_std: Some(root.frequency_rad_s.std / TAU),
            damping: root.damping.value,
            damping_std: root.is_pair().then_some(root.damping.std),
        }
    }

    /// The roots in rad/s: one, or two.
    fn values(&self) -> impl Iterator<Item = Complex64> {
        let real = -self.damping;
        let imaginary = (1.0 - real * real).max(0.0).sqrt();
        let unit = TAU * self.frequency_hz;
        let upper = Complex64::new(real, imaginary) * unit;
        std::iter::once(upper).chain((imaginary > 0.0).then_some(upper.conj()))
    }

    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        place.key("frequency_hz").accept(self.frequency_hz)?;
        error(place, "frequency_hz_std", self.frequency_hz_std)?;
        error(place, "damping_std", self.damping_std)?;
        place.key("damping").accept(self.damping)
    }
}

fn error(place: &KeyPath, key: &'static str, std: Option<f64>) -> Result<(), Fault> {
    if std.is_none_or(|std| std.is_finite() && std >= 0.0) {
        return Ok(());
    }
    Err(place
        .clone()
        .key(key)
        .fault(String::from("a standard error is finite and not negative"), "leave it out where it is not known"))
}

impl StandModel {
    /// Reads and checks a stand.
    ///
    /// # Errors
    /// When the file is missing or is no stand; the error shows the place in it.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let (model, file): (Self, _) = TomlFile::read(path)?;
        model.check().map_err(|fault| file.show(&fault))?;
        Ok(model)
    }

    /// Checks a stand and writes it, complete or not at all.
    ///
    /// # Errors
    /// When reading it back would refuse it, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.check().map_err(|fault| FileError::refused(path, fault))?;
        write_toml(path, self)
    }

    fn check(&self) -> Result<(), Fault> {
        let root = KeyPath::root();
        root.clone().key("gain").accept(self.gain)?;
        if self.gain == 0.0 {
            return Err(root.key("gain").fault("a stand that passes no force", "give its static gain, about 1"));
        }
        root.clone().key("top_hz").accept(self.top_hz)?;
        error(&root, "gain_std", self.gain_std)?;
        error(&root, "usable_hz_std", self.usable_hz_std)?;
        if let Some(usable_hz) = self.usable_hz {
            root.clone().key("usable_hz").accept(usable_hz)?;
        }
        for (key, roots) in [("pole", &self.poles), ("zero", &self.zeros)] {
            for (index, entry) in roots.iter().enumerate() {
                entry.check(&root.key(key).item(index))?;
            }
        }
        Ok(())
    }

    /// The transfer function, static gain included.
    #[must_use]
    pub fn transfer_function(&self) -> TransferFunction {
        let roots = |roots: &[StandRoot]| roots.iter().flat_map(StandRoot::values).collect();
        TransferFunction { gain: self.gain, poles: roots(&self.poles), zeros: roots(&self.zeros) }
    }

    /// The response over its static value, at a frequency in rad/s.
    ///
    /// This is what is divided out of a motor's response: the static gain of the thrust is the sensor's own calibration,
    /// which a hammer knows less well.
    #[must_use]
    pub fn shape(&self, omega_rad_s: f64) -> Complex64 {
        self.transfer_function().response(omega_rad_s) / self.gain
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    const STAND: &str = "format = 1\ngain = 1.02\ntop_hz = 150.0\n[[pole]]\nfrequency_hz = 60.0\ndamping = 0.05\n\
                         [[zero]]\nfrequency_hz = 90.0\ndamping = -1.0\n";

    fn read(text: &str) -> Result<StandModel, FileError> {
        let scratch = Scratch::new();
        StandModel::read(&scratch.file("stand.toml", text))
    }

    #[test]
    fn a_stand_comes_back_as_written() {
        let stand = read(STAND).unwrap();
        let scratch = Scratch::new();
        let path = scratch.path().join("stand.toml");
        stand.write(&path).unwrap();
        assert_eq!(StandModel::read(&path).unwrap(), stand);
    }

    #[test]
    fn roots_are_pairs_or_real_as_their_damping_says() {
        let tf = read(STAND).unwrap().transfer_function();
        assert_eq!((tf.poles.len(), tf.zeros.len()), (2, 1));
        assert!(tf.is_stable() && tf.is_non_minimum_phase());
        assert!((tf.zeros[0] - Complex64::new(TAU * 90.0, 0.0)).norm() < 1e-9);
        let stand = read(STAND).unwrap();
        assert!((stand.shape(0.0) - 1.0).norm() < 1e-12);
        // At its own frequency a lightly damped pair passes 1 / (2 j zeta) of the static value.
        let at_zero = 1.0 - Complex64::new(0.0, 60.0 / 90.0);
        let expected = at_zero / Complex64::new(0.0, 0.1);
        assert!((stand.shape(TAU * 60.0) - expected).norm() < 1e-9);
    }

    #[test]
    fn what_is_no_stand_is_refused_where_it_stands() {
        for (from, to, parts) in [
            ("gain = 1.02", "gain = 0", ["stand.toml:2:8", "passes no force"]),
            ("damping = 0.05", "damping = -0.05", ["stand.toml:6:11", "a stand that stands still"]),
            ("damping = 0.05", "damping = 1.5", ["stand.toml:6:11", "two entries of damping 1"]),
            ("= 60.0", "= nan", ["stand.toml:5:16", "above 0"]),
            ("= 60.0", "= 4.88e184", ["stand.toml:5:16", "4.88e184 is not from 0.1 to 1000000"]),
            ("gain = 1.02", "gain = -1e9", ["stand.toml:2:8", "-1e9 is not from -100000000 to 100000000"]),
            ("damping = 0.05", "damping = 0.05\ndamping_std = inf", ["stand.toml:7:15", "is finite"]),
        ] {
            assert!(STAND.contains(from));
            assert_report(read(&STAND.replace(from, to)).unwrap_err(), &parts);
        }
    }
}
