//! A case as files: the experiment's folder for the tool, and the truth elsewhere for the scorer.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::case::{Case, Columns, Given};
use super::ceiling::{Ceiling, stale};
use super::excitation::{Drive, PERIOD_S, ROWS_HZ};
use super::kind::Kind;
use super::motor::Motor;
use super::scatter::mixed;

/// What the scorer knows of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The class's name: a kind's for a case of one effect.
    pub class: String,
    /// Number within the class.
    pub number: u64,
    /// The hidden effects.
    pub effects: Vec<Hidden>,
    /// The sort of a hidden effect outside the catalog.
    pub outside: Option<String>,
    /// What stands in the place of the law of the hidden effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// The sorts of what the stand adds.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nuisances: Vec<String>,
    /// Whether the experiment's folder has the columns rpm, voltage and current.
    pub more_columns: bool,
    /// `none`, `right` or `stale`.
    pub model: String,
    /// Standard deviation of the noise over the swing that an amplitude of 0.05 has.
    pub noise_level: f64,
    /// What can be identified, where it was computed.
    pub ceiling: Option<Ceiling>,
}

/// A hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// Its kind's name.
    pub kind: String,
    /// Its parameters by name.
    pub parameters: Vec<(String, f64)>,
}

impl Truth {
    /// The truth of a case.
    #[must_use]
    pub fn new(case: &Case, ceiling: Option<Ceiling>) -> Self {
        let gain = case.motor.points.iter().map(|point| point.gain_n).sum::<f64>() / case.motor.points.len() as f64;
        let colored: f64 = case.noise.colored.iter().map(|(sigma, _)| sigma * sigma).sum();
        let power = case.noise.white_n.powi(2) + colored + case.noise.hum_n.powi(2);
        Self {
            class: case.class.name().to_owned(),
            number: case.number,
            effects: case
                .effects
                .iter()
                .map(|effect| Hidden {
                    kind: effect.kind.name().to_owned(),
                    parameters: effect
                        .kind
                        .parameters()
                        .iter()
                        .zip(&effect.values)
                        .map(|(parameter, value)| (parameter.name.to_owned(), *value))
                        .collect(),
                })
                .collect(),
            outside: case.outside.map(|outside| outside.sort.name().to_owned()),
            law: case.law.map(|law| law.name().to_owned()),
            nuisances: case.nuisances.iter().map(|nuisance| nuisance.sort.name().to_owned()).collect(),
            more_columns: case.has_more_columns,
            model: match case.given {
                Given::Nothing => "none",
                Given::Right => "right",
                Given::Stale(_) => "stale",
            }
            .to_owned(),
            noise_level: power.sqrt() / (0.1 * gain),
            ceiling,
        }
    }

    /// Whether the effect leaves too little in the data to be seen, as far as is known.
    #[must_use]
    pub fn is_invisible(&self) -> bool {
        let Some(ceiling) = &self.ceiling else { return false };
        if self.effects.len() > 1 {
            // One is as good as none when the others alone explain nearly as much.
            return !ceiling.is_needed();
        }
        !ceiling.is_visible()
    }

    /// Whether the truth can be distinguished from every rival; `None` where that is unknown.
    #[must_use]
    pub fn is_identifiable(&self) -> Option<bool> {
        self.ceiling.as_ref().map(Ceiling::is_identifiable)
    }

    /// The kind of a single case.
    #[must_use]
    pub fn single(&self) -> Option<Kind> {
        Kind::named(&self.class)
    }
}

/// Where a case's files are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Paths {
    /// The experiment's folder. Its name says nothing.
    pub experiment: PathBuf,
    /// The model for the tool, beside the experiment; not every case has one.
    pub model: Option<PathBuf>,
}

/// What a case's files are called. The seed's number would give away the class: it is mixed.
#[must_use]
pub fn name(case: &Case) -> String {
    format!("case_{:016x}", mixed(case.seed))
}

/// Writes the experiment of a case into a folder of its own under `root`, and its model if it has one.
///
/// # Errors
/// When a file cannot be written.
pub fn write(case: &Case, columns: &[Columns], root: &Path) -> io::Result<Paths> {
    let experiment = root.join(name(case));
    fs::create_dir_all(&experiment)?;
    fs::write(experiment.join("experiment.toml"), manifest(case))?;
    for (run, columns) in case.runs.iter().zip(columns) {
        fs::write(experiment.join(&run.file), table(&run.commands, columns))?;
    }
    let model = match &case.given {
        Given::Nothing => None,
        Given::Right => Some(case.motor.clone()),
        Given::Stale(errors) => Some(stale(&case.motor, errors)),
    };
    let model = match model {
        None => None,
        Some(motor) => {
            let path = experiment.join("model.toml");
            fs::write(&path, model_file(&motor))?;
            Some(path)
        }
    };
    Ok(Paths { experiment, model })
}

fn manifest(case: &Case) -> String {
    let mut text = format!(
        "format = 1\nname = \"stand run\"\ncommand = \"duty\"\noutput = \"thrust_n\"\nsample_rate_hz = {ROWS_HZ}\n"
    );
    for run in &case.runs {
        let excitation = match run.drive {
            Drive::Multisine => "multisine",
            Drive::Square => "square",
        };
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n[[record]]\nfile = \"{}\"\nnominal = {:.2}\nexcitation = \"{excitation}\"\nperiod_s = {PERIOD_S:.1}\n\
             amplitude = {}\n",
            run.file, case.motor.points[run.point].nominal, run.amplitude,
        );
        match run.held_out {
            Some(true) => text.push_str("role = \"validate\"\n"),
            Some(false) => text.push_str("role = \"fit\"\n"),
            None => {}
        }
    }
    text
}

fn table(commands: &[f64], columns: &Columns) -> String {
    let mut text = String::with_capacity(commands.len() * 48);
    let more = !columns.rpm.is_empty();
    text.push_str(if more { "time_s,command,thrust_n,rpm,voltage_v,current_a\n" } else { "time_s,command,thrust_n\n" });
    for (row, command) in commands.iter().enumerate() {
        let Some(stamp_s) = columns.stamps_s[row] else { continue };
        let _ = write!(text, "{stamp_s:.6},{command:.9},{:.6}", columns.thrust_n[row]);
        if more {
            let _ =
                write!(text, ",{:.2},{:.4},{:.4}", columns.rpm[row], columns.voltage_v[row], columns.current_a[row]);
        }
        text.push('\n');
    }
    text
}

fn model_file(motor: &Motor) -> String {
    let mut text = String::from("format = 1\n");
    for point in &motor.points {
        let _ = write!(
            text,
            "\n[[point]]\nnominal = {:.2}\ngain = {:.6}\ntime_constant_s = {:.6}\n",
            point.nominal, point.gain_n, point.time_constant_s
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::case::{Class, Set};
    use super::super::ceiling::Difference;
    use super::*;

    #[test]
    fn the_folder_holds_what_the_manifest_names_and_nothing_of_the_truth() {
        let case = Case::draw(Set::Tune, Class::Single(Kind::Backlash), 0);
        let columns: Vec<Columns> = (0..case.runs.len()).map(|index| case.record(index)).collect();
        let root = tempfile::tempdir().unwrap();
        let paths = write(&case, &columns, root.path()).unwrap();
        let manifest = fs::read_to_string(paths.experiment.join("experiment.toml")).unwrap();
        assert_eq!(manifest.matches("[[record]]").count(), 12);
        for run in &case.runs {
            assert!(manifest.contains(&run.file));
            let table = fs::read_to_string(paths.experiment.join(&run.file)).unwrap();
            assert_eq!(table.lines().count(), 30_001);
        }
        assert!(!manifest.contains("backlash") && !paths.experiment.to_string_lossy().contains("backlash"));
        let files = fs::read_dir(&paths.experiment).unwrap().count();
        assert_eq!(files, 13 + usize::from(paths.model.is_some()));
    }

    #[test]
    fn rows_that_are_lost_are_not_in_the_file_and_stamps_that_jitter_are_there_as_they_are() {
        let case = Case::draw(Set::Tune, Class::Nuisance, 0);
        let mut columns = case.record(0);
        columns.stamps_s[2] = None;
        columns.stamps_s[3] = Some(0.003_021);
        let table = table(&case.runs[0].commands, &columns);
        let stamps: Vec<&str> = table.lines().skip(1).take(4).map(|line| line.split(',').next().unwrap()).collect();
        assert_eq!(stamps, ["0.000000", "0.001000", "0.003021", "0.004000"]);
        assert_eq!(table.lines().count(), 30_000);
    }

    #[test]
    fn the_truth_names_the_law_and_the_nuisances() {
        let bent = Truth::new(&Case::draw(Set::Tune, Class::Perturbed, 12), None);
        assert_eq!((bent.law.as_deref(), bent.effects[0].kind.as_str()), (Some("delay_jitter"), "transport_delay"));
        let nuisance = Truth::new(&Case::draw(Set::Tune, Class::Nuisance, 4), None);
        assert_eq!(nuisance.nuisances[0], "missing_rows");
        assert!(nuisance.effects.is_empty() && nuisance.law.is_none());
    }

    #[test]
    fn the_truth_survives_its_file() {
        let case = Case::draw(Set::Tune, Class::Pair, 0);
        let rivals = [("backlash", Difference::Fitted(-3.25)), ("dead_band", Difference::AtMost(-120.5))];
        let rivals = rivals.map(|(name, difference)| (name.to_owned(), difference)).to_vec();
        let ceiling = Ceiling { nothing: -12.5, rivals, exchanges: Vec::new() };
        let truth = Truth::new(&case, Some(ceiling));
        let again: Truth = serde_json::from_str(&serde_json::to_string(&truth).unwrap()).unwrap();
        assert_eq!(again, truth);
        assert!(truth.is_invisible() && truth.effects.len() == 2);
        assert!((0.0019..0.055).contains(&truth.noise_level), "{}", truth.noise_level);
    }
}
