//! A compensator as it is designed, stored in `compensator.toml`, and run: a lead, or a conditioned inverse.

mod inverse;
mod inverse_file;
mod lead_file;
mod provenance;
mod stored;

pub use inverse::{InverseCompensator, InverseRange};
pub use inverse_file::{GainFormat, InverseFile, InverseKind, ReferenceFormat, StoredInverse};
pub use lead_file::{CoefficientFormat, LeadFile, LeadKind, SignalFormat, StoredCoefficients};
pub use provenance::CompensatorProvenance;

use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;
use rotorlead::compensator::{Compensator, Filter};
use rotorlead::design::{LeadDesign, LeadParameters};
use rotorlead::throttle::Command;
use rotorlead_records::files::{FileError, KeyPath, TextFile, TomlFile, write_file};
use serde::{Deserialize, Serialize};

use crate::model::Model;
use stored::CompensatorFile;

/// A checked design, and the model that it is for.
#[derive(Clone, Debug, PartialEq)]
pub struct CompensatorDesign {
    /// What was designed.
    pub kind: FilterDesign,
    /// What it was designed for; `None` where its file does not say so, and of what a controller runs.
    pub provenance: Option<CompensatorProvenance>,
}

/// A checked design of either kind.
// There are few of them.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum FilterDesign {
    /// The paper's C(s).
    Lead(LeadDesign),
    /// A conditioned inverse.
    Inverse(InverseCompensator),
}

/// A compensator as its file holds it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StoredCompensator {
    /// Of a lead.
    Lead(LeadFile),
    /// Of an inverse.
    Inverse(InverseFile),
}

/// The key that says which kind a file holds.
#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

impl CompensatorDesign {
    /// Reads a compensator and computes its integers again, as a controller would.
    ///
    /// # Errors
    /// When the file cannot be read or is no compensator, when the controller refuses its parameters, or when the integers in it
    /// are others than the controller would compute. The error shows the place in the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::parse(TextFile::read(path)?)
    }

    /// As [`Self::read`], of a text that is here already.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: TextFile) -> Result<Self, FileError> {
        // What has no such key, and what cannot be read, is said by the reader of the kind that came first.
        let kind = TomlFile::parse::<Kind>(text.clone()).ok().and_then(|(read, file)| Some((read.kind?, file)));
        match kind.as_ref().map(|(kind, file)| (kind.as_str(), file)) {
            None | Some(("lead", _)) => {
                let (design, LeadFile { provenance, .. }) = LeadFile::parse(text)?;
                Ok(Self { kind: FilterDesign::Lead(design), provenance })
            }
            Some(("inverse", _)) => {
                let (inverse, InverseFile { provenance, .. }) = InverseFile::parse(text)?;
                Ok(Self { kind: FilterDesign::Inverse(inverse), provenance })
            }
            Some((other, file)) => Err(file.show(
                &KeyPath::root()
                    .key("kind")
                    .fault(format!("`{other}` is no kind of compensator"), "give `lead` or `inverse`"),
            )),
        }
    }

    /// The same, designed for `model`.
    #[must_use]
    pub fn designed_for(self, model: &Model) -> Self {
        Self { provenance: Some(CompensatorProvenance::new(model)), ..self }
    }

    /// Writes it, complete or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        write_file(path, self.text(path)?.as_bytes())
    }

    /// The text of its file, which is to be at `path`.
    ///
    /// # Errors
    /// When reading the file would refuse it.
    pub fn text(&self, path: &Path) -> Result<String, FileError> {
        match self.stored() {
            StoredCompensator::Lead(file) => file.text(path),
            StoredCompensator::Inverse(file) => file.text(path),
        }
    }

    /// What its file holds.
    #[must_use]
    pub fn stored(&self) -> StoredCompensator {
        let provenance = self.provenance.clone();
        match &self.kind {
            FilterDesign::Lead(design) => {
                StoredCompensator::Lead(LeadFile { provenance, ..LeadFile::from_design(design) })
            }
            FilterDesign::Inverse(inverse) => {
                StoredCompensator::Inverse(InverseFile { provenance, ..InverseFile::from_design(inverse) })
            }
        }
    }

    /// The controller's own code, at rest at `start`. The output of a lead is limited to the range of a command, that of an
    /// inverse to its own. Either has the slew limit of its design.
    #[must_use]
    pub fn running(&self, start: Command) -> Compensator {
        let (min, max) = match &self.kind {
            FilterDesign::Lead(_) => (Command::ZERO, Command::ONE),
            FilterDesign::Inverse(inverse) => inverse.ends(),
        };
        let mut compensator = Compensator::new(self.filter(), min, max);
        compensator.reset(start);
        compensator
    }

    /// What a [`Compensator`] is made of, without the limits of its output.
    #[must_use]
    pub fn filter(&self) -> Filter {
        match &self.kind {
            FilterDesign::Lead(design) => design.filter().into(),
            FilterDesign::Inverse(inverse) => inverse.filter().into(),
        }
    }

    /// Most by which the output changes, units of the command per second; `None` for no limit.
    #[must_use]
    pub fn slew_per_s(&self) -> Option<f64> {
        match &self.kind {
            FilterDesign::Lead(design) => design.slew_per_s(),
            FilterDesign::Inverse(inverse) => inverse.range().slew_per_s,
        }
    }

    /// Whether the controller would make the same of it, bit for bit: the same coefficients and limits.
    #[must_use]
    pub fn is_bit_identical_to(&self, other: &Self) -> bool {
        match (&self.kind, &other.kind) {
            (FilterDesign::Lead(one), FilterDesign::Lead(other)) => one.filter() == other.filter(),
            (FilterDesign::Inverse(one), FilterDesign::Inverse(other)) => one.is_bit_identical_to(other),
            _ => false,
        }
    }

    /// Ticks per second.
    #[must_use]
    pub fn loop_rate_hz(&self) -> f64 {
        match &self.kind {
            FilterDesign::Lead(design) => design.loop_rate_hz(),
            FilterDesign::Inverse(inverse) => inverse.design().loop_rate_hz(),
        }
    }

    /// The lead, if it is one.
    #[must_use]
    pub fn as_lead(&self) -> Option<&LeadDesign> {
        match &self.kind {
            FilterDesign::Lead(design) => Some(design),
            FilterDesign::Inverse(_) => None,
        }
    }

    /// The inverse, if it is one.
    #[must_use]
    pub fn as_inverse(&self) -> Option<&InverseCompensator> {
        match &self.kind {
            FilterDesign::Lead(_) => None,
            FilterDesign::Inverse(inverse) => Some(inverse),
        }
    }

    /// The continuous lead that it is for small signals around `nominal`; `None` where an inverse is bypassed.
    #[must_use]
    pub fn lead_at(&self, nominal: f64) -> Option<LeadParameters> {
        match &self.kind {
            FilterDesign::Lead(design) => Some(*design.lead()),
            FilterDesign::Inverse(inverse) => inverse.lead_at(nominal),
        }
    }

    /// Natural frequency of the poles, or of the reference model, rad/s.
    #[must_use]
    pub fn natural_rad_s(&self) -> f64 {
        match &self.kind {
            FilterDesign::Lead(design) => design.lead().omega_f_rad_s,
            FilterDesign::Inverse(inverse) => inverse.design().reference().omega_f_rad_s,
        }
    }

    /// Largest answer to a step of one: leave room for it. That of an inverse is at its slowest point, without its limits.
    #[must_use]
    pub fn step_peak(&self) -> f64 {
        match &self.kind {
            FilterDesign::Lead(design) => design.check().step_peak,
            FilterDesign::Inverse(inverse) => inverse.step_peak(),
        }
    }

    /// Asymptotic peak of the amplification, dB; that of an inverse at its slowest point.
    #[must_use]
    pub fn asymptotic_peak_db(&self) -> f64 {
        match &self.kind {
            FilterDesign::Lead(design) => design.lead().asymptotic_peak_db(),
            FilterDesign::Inverse(inverse) => {
                let lead = inverse.slowest().and_then(|point| inverse.lead_at(point.command));
                lead.map_or(0.0, |lead| lead.asymptotic_peak_db())
            }
        }
    }

    /// The response of the rounded recurrence to small signals around `nominal`, 1 at 0 rad/s.
    #[must_use]
    pub fn response(&self, nominal: f64, omega_rad_s: f64) -> Complex64 {
        match &self.kind {
            FilterDesign::Lead(design) => design.response(omega_rad_s),
            FilterDesign::Inverse(inverse) => inverse.response(nominal, omega_rad_s),
        }
    }
}

/// What the compensator makes of a small sinusoid of the command, as of the noise of a gyro that a flight controller passes on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CommandNoiseGain {
    /// Frequency of the sinusoid, hertz.
    pub frequency_hz: f64,
    /// Amplitude of the output over that of the command.
    pub gain: f64,
}

/// Frequencies of a [`CommandNoiseGain`]: about what a flight controller's filters leave of a gyro's noise. Chosen: from the paper's
/// compensated bandwidth, 15 Hz, to where low-passes of 60 to 90 Hz begin to cut.
const NOISE_FREQUENCIES_HZ: [f64; 3] = [15.0, 30.0, 50.0];

impl CompensatorDesign {
    /// The gains on the noise of the command, by the response of the rounded recurrence without its limits. That of an inverse is at its
    /// slowest point, where it is highest; 1 where it is bypassed at every point.
    #[must_use]
    pub fn command_noise_gain(&self) -> [CommandNoiseGain; 3] {
        let nominal = match &self.kind {
            // The same at every command.
            FilterDesign::Lead(_) => Some(0.0),
            FilterDesign::Inverse(inverse) => inverse.slowest().map(|point| point.command),
        };
        NOISE_FREQUENCIES_HZ.map(|frequency_hz| CommandNoiseGain {
            frequency_hz,
            gain: nominal.map_or(1.0, |nominal| self.response(nominal, TAU * frequency_hz).norm()),
        })
    }
}

impl From<LeadDesign> for CompensatorDesign {
    fn from(design: LeadDesign) -> Self {
        Self { kind: FilterDesign::Lead(design), provenance: None }
    }
}

impl From<InverseCompensator> for CompensatorDesign {
    fn from(inverse: InverseCompensator) -> Self {
        Self { kind: FilterDesign::Inverse(inverse), provenance: None }
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    /// Of the paper's lead: a gyro's noise at 15 Hz reaches the ESC nearly fivefold.
    #[test]
    fn the_gain_on_the_noise_of_the_command_is_that_of_the_filter() {
        let poles = LeadParameters::from_poles(&[14.1275], TAU * 100.0).unwrap();
        let design = CompensatorDesign::from(LeadDesign::new(poles, 5000.0, None).unwrap());
        let [at_15, at_30, at_50] = design.command_noise_gain().map(|at| at.gain);
        for (found, expected) in [(at_15, 4.8), (at_30, 3.2), (at_50, 2.0)] {
            assert!(f64::abs(found - expected) < 0.05, "{found} {expected}");
        }
        for CommandNoiseGain { frequency_hz, gain } in design.command_noise_gain() {
            let step = Command::saturating_from_f64(0.5);
            let mut running = design.running(step);
            let ticks = (5000.0 / frequency_hz * 60.0) as u32;
            let (mut highest, mut lowest) = (0.0, 1.0);
            for tick in 0..ticks {
                let angle = TAU * frequency_hz * f64::from(tick) / 5000.0;
                let output = running.update(Command::saturating_from_f64(0.5 + 0.01 * angle.sin())).to_f64();
                if tick > ticks / 2 {
                    (highest, lowest) = (f64::max(highest, output), f64::min(lowest, output));
                }
            }
            assert!(((highest - lowest) / 0.02 / gain - 1.0).abs() < 0.005, "{highest} {lowest} {gain}");
        }
    }

    #[test]
    fn what_is_no_kind_of_compensator_is_named() {
        let scratch = Scratch::new();
        let read = |text: &str| CompensatorDesign::read(&scratch.file("c.toml", text)).unwrap_err();
        assert_report(read("format = 1\nkind = \"pid\"\n"), &["c.toml:2:8", "`pid`", "`lead` or `inverse`"]);
        assert_report(read("format = 1\nkind = 3\n"), &["c.toml:2:8"]);
        assert_report(read("format = 1\nkind = \"inverse\"\nzero_rad_s = 3\n"), &["zero_rad_s"]);
        let missing = CompensatorDesign::read(&scratch.path().join("d.toml")).unwrap_err();
        assert_report(missing, &["d.toml", "does not exist", "check the path"]);
    }
}
