//! `plan.toml`: what to run on the bench.

use std::path::{Path, PathBuf};

use rotorlead_records::files::{Fault, FileError, KeyPath, TomlFile};
use rotorlead_records::{Excitation, Output, Role};
use serde::{Deserialize, Serialize};

use super::signal::Signal;
use crate::model::Model;
use crate::noise::Noise;

/// Peak deviation of the command. Standard: that of the paper's experiments.
pub const PAPER_AMPLITUDE: f64 = 0.05;
/// Thrust noise of the generated plan, newtons per row at 1 kHz. Chosen: 4 % of the thrust of the paper's amplitude, 0.05 of 10 N; more
/// hides what a plan is to show, less hardly shows.
const DEFAULT_SIGMA_N: f64 = 0.02;
/// A generated plan leaves out points with less room than this between them and the ends of the command's range. Chosen: a tenth of the
/// paper's, whose lines have a hundredth of its power.
const SMALLEST_AMPLITUDE: f64 = 0.005;

/// An experiment that is yet to be run.
///
/// ```toml
/// format = 1
/// name = "paper"
/// seed = 1
/// loop_rate_hz = 5000              # default
/// sample_rate_hz = 1000            # rows; default
/// esc_frame_hz = 600               # absent: the ESC takes over every command at once
/// esc_frame_phase = 0.0            # default: frame 0 starts with tick 0
/// compensator = "compensator.toml" # absent: none
/// [noise]
/// sigma_n = 0.02
/// color = "white"                  # or "ar1", which needs pole
/// [[record]]
/// nominal = 0.5
/// excitation = "multisine"
/// amplitude = 0.05
/// lines = 150
/// periods = 4
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// What the experiment is called.
    pub name: String,
    /// Starts the noise; below 2^63. The same plan with the same seed gives the same numbers.
    pub seed: u64,
    /// Ticks of the control loop per second: 5000 where absent.
    #[serde(default = "default_loop_rate_hz")]
    pub loop_rate_hz: u32,
    /// Rows per second, a divisor of `loop_rate_hz`: 1000 where absent.
    #[serde(default = "default_sample_rate_hz")]
    pub sample_rate_hz: u32,
    /// Frames of the ESC per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub esc_frame_hz: Option<f64>,
    /// The first frame starts this part of a frame after the first tick; 0..1.
    #[serde(default)]
    pub esc_frame_phase: f64,
    /// The compensator that runs in front of the ESC, for all records.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensator: Option<PathBuf>,
    /// What the thrust sensor adds.
    #[serde(default)]
    pub noise: Noise,
    /// What to run.
    #[serde(rename = "record", default)]
    pub records: Vec<PlannedRecord>,
}

/// One record that is yet to be run. Which keys it needs depends on its excitation; others are refused.
///
/// | excitation | keys |
/// |---|---|
/// | `multisine` | `amplitude`, `lines`, `realization`, `periods`, `warm_up_periods` |
/// | `square`, `triangle` | `amplitude`, `half_period_s`, `periods`, `warm_up_periods` |
/// | `step` | `amplitude`, `hold_s` |
/// | `staircase` | `levels`, `hold_s` |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedRecord {
    /// The command around which it runs, 0..1.
    pub nominal: f64,
    /// `multisine`, `square`, `triangle`, `step` or `staircase`.
    pub excitation: Excitation,
    /// Peak deviation of the command from `nominal`, above 0. A step may also go down, by a negative one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
    /// Lines of a multisine at odd multiples of 0.1 Hz: 150 (up to 29.9 Hz) or 225 (up to 44.9 Hz).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lines: Option<u32>,
    /// Plays, in place of the controller's multisine, one that shows a nonlinearity: odd lines up to the same frequency,
    /// one in four skipped, random phases ([`DetectionSet`](super::multisine::DetectionSet), seed 1). The number, 1 to 8,
    /// chooses the phases; records that differ in it alone show what a change of phases does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realization: Option<u32>,
    /// Half the period of a square wave or a triangle, seconds. The first half of a square wave is the high one; a triangle
    /// begins at `nominal` and rises.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_period_s: Option<f64>,
    /// Periods that are recorded, 1 or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods: Option<u32>,
    /// Periods that run before these without being recorded, so that the record is in its periodic steady state: 1
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warm_up_periods: Option<u32>,
    /// How long each level holds, seconds: `nominal` and then the stepped level, or each of `levels`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold_s: Option<f64>,
    /// Levels of a staircase, 0..1 each, in order. It starts at rest at the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<Vec<f64>>,
    /// What the record is for; the tools choose where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
}

impl PlannedRecord {
    /// A record without any of the keys that only some excitations need.
    #[must_use]
    pub fn new(nominal: f64, excitation: Excitation) -> Self {
        Self {
            nominal,
            excitation,
            amplitude: None,
            lines: None,
            realization: None,
            half_period_s: None,
            periods: None,
            warm_up_periods: None,
            hold_s: None,
            levels: None,
            role: None,
        }
    }
}

fn default_loop_rate_hz() -> u32 {
    5000
}

fn default_sample_rate_hz() -> u32 {
    1000
}

impl Plan {
    /// Reads and checks a plan file.
    ///
    /// # Errors
    /// [`FileError`], which shows the place in the file: what [`TomlFile::read`] refuses, and what [`Plan::check`]
    /// does.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let (plan, file) = TomlFile::read::<Self>(path)?;
        plan.check().map_err(|fault| file.show(&fault))?;
        Ok(plan)
    }

    /// The paper's experiment at the model's points: a multisine of 150 lines and 10 s to fit and a square wave
    /// of half period 5 s to validate, both of amplitude 0.05 and four periods, with a 5 kHz loop, 600 Hz frames and
    /// white thrust noise of 0.02 N (none for a model in revolutions per minute).
    ///
    /// Near the ends of the command's range the amplitude is what room there is; points with hardly any are left out.
    #[must_use]
    pub fn paper(model: &Model) -> Self {
        let rpm = model.provenance.as_ref().is_some_and(|p| p.output == Output::Rpm);
        let sigma_n = if rpm { 0.0 } else { DEFAULT_SIGMA_N };
        let mut records = Vec::new();
        for point in &model.points {
            let amplitude = PAPER_AMPLITUDE.min(point.nominal).min(1.0 - point.nominal);
            if amplitude < SMALLEST_AMPLITUDE {
                continue;
            }
            let multisine = PlannedRecord {
                amplitude: Some(amplitude),
                lines: Some(150),
                periods: Some(4),
                role: Some(Role::Fit),
                ..PlannedRecord::new(point.nominal, Excitation::Multisine)
            };
            let square = PlannedRecord {
                amplitude: Some(amplitude),
                half_period_s: Some(5.0),
                periods: Some(4),
                role: Some(Role::Validate),
                ..PlannedRecord::new(point.nominal, Excitation::Square)
            };
            records.extend([multisine, square]);
        }
        Self {
            format: 1,
            name: "paper".to_owned(),
            seed: 1,
            loop_rate_hz: default_loop_rate_hz(),
            sample_rate_hz: default_sample_rate_hz(),
            esc_frame_hz: Some(600.0),
            esc_frame_phase: 0.0,
            compensator: None,
            noise: Noise { sigma_n, ..Noise::default() },
            records,
        }
    }

    /// The same with the compensator of `file` in front of the ESC, and multisines of 225 lines, up to 44.9 Hz, as the
    /// paper validates its compensated actuator.
    #[must_use]
    pub fn compensated(mut self, file: impl Into<PathBuf>) -> Self {
        self.compensator = Some(file.into());
        for record in &mut self.records {
            if record.excitation == Excitation::Multisine {
                record.lines = Some(225);
            }
        }
        self
    }

    /// Checks every value. [`run`](super::run) does so too.
    ///
    /// # Errors
    /// The first [`Fault`], with the place of the value in the file.
    pub fn check(&self) -> Result<(), Fault> {
        let at = |key: &str| KeyPath::root().key(key);
        if self.format != 1 {
            return Err(at("format").fault(format!("{} is not known to this version", self.format), "use 1"));
        }
        if i64::try_from(self.seed).is_err() {
            return Err(at("seed").fault(format!("{} is 2^63 or more", self.seed), "use a smaller one"));
        }
        at("loop_rate_hz").accept(f64::from(self.loop_rate_hz))?;
        if !self.loop_rate_hz.is_multiple_of(self.sample_rate_hz) {
            return Err(at("sample_rate_hz").fault(
                format!("{} does not divide loop_rate_hz = {}", self.sample_rate_hz, self.loop_rate_hz),
                "every row belongs to a tick: use a divisor of the loop rate, such as the loop rate itself",
            ));
        }
        if let Some(frame_hz) = self.esc_frame_hz {
            at("esc_frame_hz").accept(frame_hz)?;
        }
        at("sample_rate_hz").accept(f64::from(self.sample_rate_hz))?;
        if !(0.0..1.0).contains(&self.esc_frame_phase) {
            return Err(at("esc_frame_phase").fault(
                format!("{} is not in 0..1 (1 excluded)", self.esc_frame_phase),
                "give the part of a frame between the first tick and the first frame",
            ));
        }
        self.noise.check(&at("noise"))?;
        if self.records.is_empty() {
            return Err(at("record").fault("there are no records to run", "add a [[record]]"));
        }
        for (index, record) in self.records.iter().enumerate() {
            Signal::check(self, record, &at("record").item(index))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{model, table_1};

    const TEXT: &str = r#"
format = 1
name = "all four"
seed = 7
esc_frame_hz = 600
[noise]
sigma_n = 0.02
color = "ar1"
pole = 0.9
[[record]]
nominal = 0.5
excitation = "multisine"
amplitude = 0.05
lines = 225
periods = 4
role = "fit"
[[record]]
nominal = 0.5
excitation = "square"
amplitude = 0.05
half_period_s = 5
periods = 2
warm_up_periods = 0
[[record]]
nominal = 0.5
excitation = "step"
amplitude = -0.1
hold_s = 2
[[record]]
nominal = 0.5
excitation = "staircase"
levels = [0.4, 0.5, 0.6]
hold_s = 2.5
"#;

    /// Reads `text` as a plan file; gives the report of the refusal.
    fn refusal(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        std::fs::write(&path, text).unwrap();
        format!("{:?}", miette::Report::new(Plan::read(&path).unwrap_err()))
    }

    #[test]
    fn a_plan_is_read_with_its_defaults_and_survives_writing() {
        let plan: Plan = toml::from_str(TEXT).unwrap();
        assert_eq!(plan.check(), Ok(()));
        assert_eq!((plan.loop_rate_hz, plan.sample_rate_hz, plan.esc_frame_phase), (5000, 1000, 0.0));
        assert_eq!(plan.records.len(), 4);
        for plan in [plan, Plan::paper(&table_1()), Plan::paper(&table_1()).compensated("compensator.toml")] {
            assert_eq!(toml::from_str::<Plan>(&toml::to_string(&plan).unwrap()).unwrap(), plan);
        }
    }

    #[test]
    fn the_generated_plan_is_the_papers() {
        let plan = Plan::paper(&table_1());
        assert_eq!(plan.check(), Ok(()));
        assert_eq!((plan.loop_rate_hz, plan.esc_frame_hz, plan.noise.sigma_n), (5000, Some(600.0), 0.02));
        assert_eq!(plan.records.len(), 12);
        for (pair, point) in plan.records.chunks(2).zip(&table_1().points) {
            assert!(
                pair.iter().all(|r| r.nominal == point.nominal && r.amplitude == Some(0.05) && r.periods == Some(4))
            );
            assert_eq!((pair[0].excitation, pair[0].lines), (Excitation::Multisine, Some(150)));
            assert_eq!((pair[1].excitation, pair[1].half_period_s), (Excitation::Square, Some(5.0)));
        }
        assert!(plan.compensated("c.toml").records.iter().all(|r| matches!(r.lines, None | Some(225))));
    }

    #[test]
    fn the_generated_plan_stays_within_the_commands_range() {
        let plan = Plan::paper(&model(&[
            (0.0, 1.0, 0.1, 0.0),
            (0.03, 1.0, 0.1, 0.0),
            (0.95, 1.0, 0.1, 0.0),
            (1.0, 1.0, 0.1, 0.0),
        ]));
        assert_eq!(plan.check(), Ok(()));
        let nominals: Vec<f64> = plan.records.iter().step_by(2).map(|r| r.nominal).collect();
        assert_eq!(nominals, [0.03, 0.95]);
    }

    #[test]
    fn a_wrong_value_is_refused_with_its_place_and_a_remedy() {
        for (from, to, expected) in [
            ("format = 1", "format = 2", ["format", "layout"]),
            ("seed = 7", "seed = -7", ["plan.toml", "a whole number of 0 or more"]),
            ("seed = 7", "seed = 7\nsede = 8", ["sede", "seed"]),
            ("seed = 7", "seed = 7\nsample_rate_hz = 999", ["sample_rate_hz", "divisor"]),
            ("seed = 7", "seed = 7\nsample_rate_hz = 0", ["sample_rate_hz", "divisor"]),
            ("seed = 7", "seed = 7\nloop_rate_hz = 0", ["loop_rate_hz", "50"]),
            ("seed = 7", "seed = 7\nloop_rate_hz = 80\nsample_rate_hz = 80", ["`record` 1", "excitation can play"]),
            ("esc_frame_hz = 600", "esc_frame_hz = 0", ["esc_frame_hz", "above 0"]),
            ("esc_frame_hz = 600", "esc_frame_phase = 1", ["esc_frame_phase", "0..1"]),
            ("sigma_n = 0.02", "sigma_n = -0.02", ["sigma_n", "0 or more"]),
            ("pole = 0.9", "pole = 1.0", ["pole", "-0.999999 to 0.999999"]),
            ("pole = 0.9", "", ["pole", "missing"]),
            ("color = \"ar1\"", "color = \"pink\"", ["pink", "white"]),
            ("lines = 225", "lines = 151", ["`record` 1, `lines`", "150"]),
            ("lines = 225", "", ["`record` 1", "add lines"]),
            ("lines = 225", "lines = 225\nhold_s = 1", ["`record` 1, `hold_s`", "remove it"]),
            ("lines = 225", "lines = 225\nrealization = 0", ["`record` 1, `realization`", "1 to 8"]),
            ("lines = 225", "lines = 225\nrealization = 9", ["`record` 1, `realization`", "1 to 8"]),
            ("hold_s = 2\n", "hold_s = 2\nrealization = 1\n", ["`record` 3, `realization`", "remove it"]),
            ("periods = 4", "periods = 0", ["`record` 1, `periods`", "1 period"]),
            ("periods = 4", "periods = 4000000000", ["`record` 1, `periods`", "may last"]),
            ("lines = 225", "lines = 225\nwarm_up_periods = 4000000000", ["`record` 1", "may last"]),
            ("amplitude = 0.05\nlines", "amplitude = 0.51\nlines", ["`record` 1, `amplitude`", "0..1"]),
            ("amplitude = 0.05\nlines", "amplitude = nan\nlines", ["`record` 1, `amplitude`", "above 0"]),
            ("half_period_s = 5", "half_period_s = 0.0005", ["`record` 2, `half_period_s`", "rows"]),
            ("half_period_s = 5", "half_period_s = inf", ["`record` 2, `half_period_s`", "finite"]),
            ("half_period_s = 5", "half_period_s = -5", ["`record` 2, `half_period_s`", "above 0"]),
            ("amplitude = -0.1", "amplitude = 0", ["`record` 3, `amplitude`", "step"]),
            ("hold_s = 2\n", "hold_s = 1e9\n", ["`record` 3, `hold_s`", "may last"]),
            (
                "excitation = \"square\"",
                "excitation = \"triangle\"\nlines = 150",
                ["`record` 2, `lines`", "half_period_s"],
            ),
            (
                "excitation = \"square\"\namplitude = 0.05",
                "excitation = \"triangle\"\namplitude = 0.6",
                ["`record` 2", "0..1"],
            ),
            ("levels = [0.4, 0.5, 0.6]", "levels = []", ["`record` 4, `levels`", "give the levels"]),
            ("levels = [0.4, 0.5, 0.6]", "levels = [0.4, 1.5]", ["`record` 4, `levels` 2", "1.5"]),
            ("excitation = \"step\"", "excitation = \"chirp\"", ["`record` 3, `excitation`", "staircase"]),
        ] {
            assert!(TEXT.contains(from));
            let report = refusal(&TEXT.replacen(from, to, 1));
            for expected in expected {
                assert!(report.contains(expected), "{to}: no \"{expected}\" in\n{report}");
            }
        }
        let (head, _) = TEXT.split_once("[[record]]").unwrap();
        assert!(refusal(head).contains("add a [[record]]"));
    }
}
