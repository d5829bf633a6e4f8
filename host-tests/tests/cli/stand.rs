//! A folder of a test's own with good files in it, and the program run there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command as Process;
use std::sync::LazyLock;
use std::time::SystemTime;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use serde_json::Value;

/// Two points: every nominal command from 0.4 to 0.5 is known.
pub const MODEL: &str = "\
format = 1
[[point]]
nominal = 0.4
gain = 6.2
time_constant_s = 0.08
[[point]]
nominal = 0.5
gain = 7.1
time_constant_s = 0.06
";

/// A vehicle that hovers where the model holds, with one latency and few actuators.
pub const AIRFRAME: &str = "\
format = 1
[roll]
inertia_kg_m2 = 0.0125
arm_m = 0.159
motors = 4
disturbance_n_m = 0.3
step_deg = 1.0
[controller]
rate_hz = 1000
gyro_low_pass_hz = 90
d_low_pass_hz = 60
integral_time_s = 0.3
latency_s = [0.002]
gyro_noise_deg_s_sqrt_hz = 0.05
[hover]
command = 0.45
range = [0.4, 0.5]
[actuators]
inverse_rad_s = [150]
";

/// A multisine to fit and a square wave to validate, with little noise.
pub const PLAN: &str = "\
format = 1
name = \"short\"
seed = 1
esc_frame_hz = 600
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.5
excitation = \"multisine\"
amplitude = 0.05
lines = 150
periods = 2
warm_up_periods = 1
role = \"fit\"
[[record]]
nominal = 0.5
excitation = \"square\"
amplitude = 0.05
half_period_s = 1
periods = 2
role = \"validate\"
";

/// Two actuators, for the plan of `host_tests::stand_plan`.
pub const ACTUATORS: &str = "\
format = 1
[[point]]
nominal = 0.5
gain = 10.2
time_constant_s = 0.11
[[point]]
nominal = 0.65
gain = 16.1
time_constant_s = 0.07
";

/// One step from 0.4 to 0.5, at 100 rows per second.
pub const STEP: &str = "\
format = 1
name = \"step\"
command = \"duty\"
output = \"thrust_n\"
[[record]]
file = \"step.csv\"
nominal = 0.4
excitation = \"step\"
amplitude = 0.1
";

/// A folder with `model.toml`, `plan.toml`, `airframe.toml` and the experiment `stand`, and the program in it.
pub struct Stand {
    folder: PathBuf,
    /// Removes it with the stand.
    _temporary: Option<tempfile::TempDir>,
}

impl Stand {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let stand = Self::kept_in(folder.path().to_owned());
        Self { _temporary: Some(folder), ..stand }
    }

    /// Without any file.
    pub fn empty() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { folder: folder.path().to_owned(), _temporary: Some(folder) }
    }

    /// As [`Self::new`], in a folder that stays.
    pub fn kept_in(folder: PathBuf) -> Self {
        let stand = Self { folder, _temporary: None };
        fs::create_dir_all(stand.path("stand")).unwrap();
        stand.write("model.toml", MODEL);
        stand.write("plan.toml", PLAN);
        stand.write("airframe.toml", AIRFRAME);
        stand.write("stand/experiment.toml", STEP);
        stand.write("stand/step.csv", step_csv());
        stand
    }

    /// As [`Self::new`], with two levels in `plan.toml`, a multisine and a square wave each, and `actuators.toml` for them.
    pub fn with_two_levels() -> Self {
        let stand = Self::new();
        stand.write("plan.toml", host_tests::stand_plan());
        stand.write("actuators.toml", ACTUATORS);
        stand
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// A model that was identified, but for the checksum of the files that it was read from.
    #[track_caller]
    pub fn model(&self, name: &str) -> String {
        let model = self.read(name);
        let is_checksum = |line: &&str| line.starts_with("records_crc32 = ");
        assert_eq!(model.lines().filter(is_checksum).count(), 1, "{model}");
        model.lines().filter(|line| !is_checksum(line)).collect::<Vec<_>>().join("\n")
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    /// As [`Self::write`], with the folders that the name goes through.
    pub fn write_below(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    /// Replaces `from`, which has to be there, by `to`.
    #[track_caller]
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = self.read(name);
        assert!(text.contains(from), "no `{from}` in {name}:\n{text}");
        self.write(name, text.replacen(from, to, 1));
    }

    /// Every file and folder below, with the files' content, sorted.
    pub fn everything(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        everything(&self.folder)
    }

    /// The program with these arguments, separated by spaces, in this folder.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = program();
        command.current_dir(&self.folder).args(arguments.split_whitespace());
        command
    }

    /// What the program prints when all is well.
    #[track_caller]
    pub fn run(&self, arguments: &str) -> String {
        let output = self.command(arguments).assert().code(0).get_output().stdout.clone();
        String::from_utf8(output).unwrap()
    }

    /// The JSON on standard output, where nothing else may be.
    #[track_caller]
    pub fn json(&self, arguments: &str) -> Value {
        let text = self.run(&format!("{arguments} --json -"));
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in:\n{text}"))
    }

    /// Asserts that the program refuses: with `status`, every one of `parts` on standard error and nothing on standard
    /// output, leaving every file and folder as it was.
    #[track_caller]
    pub fn refuses(&self, arguments: &str, status: i32, parts: &[&str]) {
        let before = self.everything();
        let assert = self.command(arguments).assert();
        let report = report(&assert);
        assert_eq!(assert.get_output().status.code(), Some(status), "`{arguments}` says:\n{report}");
        for part in parts {
            assert!(report.contains(part), "no `{part}` in what `{arguments}` says:\n{report}");
        }
        assert!(!report.contains("panicked"), "{report}");
        if status == 1 {
            assert!(report.contains("help: "), "no remedy in what `{arguments}` says:\n{report}");
        }
        assert!(assert.get_output().stdout.is_empty(), "`{arguments}` prints although it fails");
        assert!(self.everything() == before, "`{arguments}` leaves something behind");
    }
}

/// Every file and folder below, with the files' content, sorted.
pub fn everything(folder: &Path) -> Vec<(PathBuf, Option<Vec<u8>>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path.clone());
                found.push((path, None));
            } else {
                let content = fs::read(&path).unwrap();
                found.push((path, Some(content)));
            }
        }
    }
    found.sort();
    found
}

/// Text without the line breaks and indents of its layout.
pub fn flowing(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What is on standard error.
pub fn report(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

/// A first-order answer to one step at 1 s, on a staircase's two levels.
fn step_csv() -> String {
    let mut text = String::from("time_s,command,thrust_n\n");
    for row in 0..300 {
        let time_s = f64::from(row) / 100.0;
        let (command, thrust_n) =
            if row < 100 { (0.4, 2.0) } else { (0.5, 2.0 + 0.7 * (1.0 - (-(time_s - 1.0) / 0.1).exp())) };
        text.push_str(&format!("{time_s},{command},{thrust_n}\n"));
    }
    text
}

/// The program, without the user's settings for colors and terminals.
pub fn program() -> Command {
    let mut command = Command::new(&*PROGRAM);
    for name in ["NO_COLOR", "FORCE_COLOR", "CLICOLOR_FORCE", "NO_GRAPHICS", "RUST_BACKTRACE", "IGNORE_IS_TERMINAL"] {
        command.env_remove(name);
    }
    command
}

/// The program's file. Cargo builds the programs of a package for that package's own tests only: with
/// `cargo test -p host-tests` it may be missing or older than its source, and then it is built here. Where it is
/// newer than all of its source, as after `cargo build`, cargo is not called: with the features of another selection of
/// packages it would compile everything once more. A source that is saved while cargo compiles it goes unnoticed by
/// this; save it again. `ROTORLEAD_PROGRAM` in the environment is another, to compare it with.
static PROGRAM: LazyLock<PathBuf> = LazyLock::new(|| {
    if let Some(other) = std::env::var_os("ROTORLEAD_PROGRAM") {
        return other.into();
    }
    let test = std::env::current_exe().unwrap();
    // target/PROFILE/deps/cli-HASH
    let profile = test.parent().and_then(Path::parent).unwrap();
    let program = profile.join(format!("rotorlead{}", std::env::consts::EXE_SUFFIX));
    let built = fs::metadata(&program).and_then(|found| found.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let sources = ["Cargo.lock", "Cargo.toml", "src", "sim"];
    if sources.iter().map(|name| newest(&root.join(name))).max() > Some(built) {
        let mut cargo = Process::new(env!("CARGO"));
        cargo.current_dir(root).args(["build", "--quiet", "--package", "rotorlead-cli", "--bin", "rotorlead"]);
        cargo.arg("--target-dir").arg(profile.parent().unwrap());
        if profile.ends_with("release") {
            cargo.arg("--release");
        }
        assert!(cargo.status().unwrap().success(), "the program does not build");
    }
    assert!(program.is_file(), "{} is missing", program.display());
    program
});

/// When anything at or below `path` changed last.
fn newest(path: &Path) -> SystemTime {
    let own = fs::metadata(path).unwrap();
    if !own.is_dir() {
        return own.modified().unwrap();
    }
    let entries = fs::read_dir(path).unwrap().map(|entry| newest(&entry.unwrap().path()));
    entries.max().unwrap_or(SystemTime::UNIX_EPOCH)
}

/// The paper's Table 1 as a model file, with `tau = 1 / omega_s`.
pub fn table_1() -> String {
    let mut text = String::from("format = 1\n");
    for (nominal, gain, pole) in host_tests::TABLE_1 {
        let tau = 1.0 / pole;
        text += &format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {tau}\n");
    }
    text
}
