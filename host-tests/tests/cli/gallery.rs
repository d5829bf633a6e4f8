//! Each command of the command line, run once on its standard input. What it printed and wrote is kept for every test that looks at it:
//! at its width, its JSON, its figures, or its report in a browser.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::CommandFactory as _;
use rotorlead_cli::Arguments;
use serde_json::Value;

use crate::stand::{ACTUATORS, Stand};

/// A slew limit, so that a diagnosis has something to find.
const LIMIT: &str = "[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n";

/// The static curve of a motor for steps through its range.
const STATIC_MAP: &str = "[static_map]\ncommand = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]\n\
                          response = [0.1, 0.6, 1.4, 2.4, 3.5, 4.8, 6.2, 7.8]\n";
const STAIRS: &str = "format = 1\nname = \"stairs\"\nseed = 1\nloop_rate_hz = 200\nsample_rate_hz = 200\n\
                      [noise]\nsigma_n = 0.02\n[[record]]\nnominal = 0.5\nexcitation = \"staircase\"\n\
                      levels = [0.3, 0.4, 0.5, 0.6, 0.7, 0.6, 0.5, 0.4, 0.3]\nhold_s = 2\n";

const HAMMER: &str = "format = 1\nname = \"hammer\"\ncommand = \"force_n\"\noutput = \"thrust_n\"\n\
                      [[record]]\nfile = \"blow.csv\"\nnominal = 0\nexcitation = \"free\"\n";

/// A command as a user gives it, what is asked of the browser, and how it ends.
struct Case {
    arguments: &'static str,
    is_opened: bool,
    status: i32,
}

const fn succeeding(arguments: &'static str) -> Case {
    Case { arguments, is_opened: false, status: 0 }
}

/// One whose report is opened in a browser.
const fn opened(arguments: &'static str) -> Case {
    Case { is_opened: true, ..succeeding(arguments) }
}

/// One that finds an error in what it looks at, and says so.
const fn failing(arguments: &'static str) -> Case {
    Case { status: 1, ..succeeding(arguments) }
}

/// Cases that stand on those before them in their row. Rows are run beside each other, each in a folder of its own.
const ROWS: [&[Case]; 4] = [
    &[
        opened("simulate --model limited.toml --plan plan.toml --out slow"),
        opened("report slow --out report.html"),
        opened("identify slow --out slow.toml"),
        opened("validate slow --model slow.toml"),
        opened("design --model actuators.toml --loop-rate 200 --omega-g 100 --out compensator.toml"),
        succeeding("simulate --model actuators.toml --plan plan.toml --compensator compensator.toml --out faster"),
        succeeding("check faster"),
        opened("bandwidth --model actuators.toml --compensator compensator.toml --records slow --records faster"),
        opened("diagnose slow --model actuators.toml"),
        opened("diagnose slow --redesign --out-plan next.toml"),
    ],
    &[
        succeeding("simulate --model actuators.toml --plan plan.toml --out sim"),
        succeeding("check sim"),
        succeeding("identify sim --out found.toml"),
        succeeding("validate sim --model found.toml"),
        succeeding("design --model found.toml --loop-rate 200 --omega-g 200 --out c.toml"),
        succeeding("simulate --model actuators.toml --plan plan.toml --compensator c.toml --out led"),
        succeeding("check led"),
        succeeding("bandwidth --model found.toml"),
        succeeding("bandwidth --model found.toml --records led"),
        succeeding("diagnose sim --model actuators.toml"),
        succeeding("diagnose sim --redesign --out-model better.toml"),
        succeeding("report sim --out report.html"),
        opened("identify --stand hammer --order 4 --top 150 --out stand.toml"),
        succeeding("simulate --model curved.toml --plan stairs-plan.toml --out stairs"),
        opened("report stairs --out stairs.html"),
        opened("identify stairs --out stairs.toml"),
        opened("compare found.toml stairs.toml"),
    ],
    &[
        succeeding("import rcbenchmark.csv --out rc"),
        succeeding("import esc32.csv --out esc"),
        succeeding("import blackbox.bbl --excitation free --out bb"),
        succeeding("import esc_status.ulg --out ulog"),
        succeeding("import bench.bin --out bench"),
        succeeding("import chirp.bin --out chirp"),
        succeeding("import vectors.mat --out mat"),
        succeeding("import stand/step.csv --excitation step --out plain"),
        succeeding("identify rc --out rc.toml"),
        succeeding("identify esc --out esc.toml"),
        succeeding("identify bench --out bench.toml"),
        succeeding("identify chirp --out chirp.toml"),
        succeeding("check rc"),
        failing("check bb"),
        succeeding("check chirp"),
        succeeding("diagnose esc"),
    ],
    &[
        succeeding("sample"),
        succeeding("sample hidden.csv"),
        succeeding("new first"),
        succeeding("excite --band 0.1..2 --rate 100 --starts 1 --out command.csv"),
        succeeding("excite --band 0.1..2 --rate 100 --detection --realizations 3 --out detect.csv"),
        opened("excite --band 0.1..30 --rate 200 --starts 1 --out period.csv"),
        succeeding("validate stand --model model.toml"),
        failing("check stand"),
        opened("vehicle --verbose"),
        opened("demo"),
    ],
];

/// Logs of other tools, for the third row.
const LOGS: [&str; 7] =
    ["rcbenchmark.csv", "esc32.csv", "blackbox.bbl", "esc_status.ulg", "bench.bin", "chirp.bin", "vectors.mat"];

/// What became of a case.
pub struct Shown {
    /// The command as a user gives it; that it is to write JSON, report and figures as well is left out.
    pub arguments: &'static str,
    /// What it printed.
    pub text: String,
    /// Its report.
    pub report: PathBuf,
    /// Whether that is for the browser.
    pub is_opened: bool,
    json: PathBuf,
    /// The folder of its figures, where its command draws any.
    figures: Option<PathBuf>,
}

impl Shown {
    /// Its JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        let text = fs::read_to_string(&self.json).unwrap_or_else(|error| panic!("`{}`: {error}", self.arguments));
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("`{}`: {error}", self.arguments))
    }

    /// A file or folder that it wrote.
    pub fn wrote(&self, name: &str) -> PathBuf {
        self.json.with_file_name(name)
    }
}

/// Every case, run; by whoever asks first. The files stay in cargo's folder for what tests leave, to be looked at, until the next
/// run of the tests.
pub fn shown() -> &'static [Shown] {
    static SHOWN: LazyLock<Vec<Shown>> = LazyLock::new(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gallery");
        if folder.exists() {
            fs::remove_dir_all(&folder).unwrap();
        }
        std::thread::scope(|scope| {
            let rows = std::array::from_fn::<_, { ROWS.len() }, _>(|row| {
                let folder = folder.join(row.to_string());
                scope.spawn(move || run_row(ROWS[row], folder))
            });
            rows.into_iter().flat_map(|row| row.join().unwrap()).collect()
        })
    });
    &SHOWN
}

/// The case of a command.
#[track_caller]
pub fn case(arguments: &str) -> &'static Shown {
    shown().iter().find(|shown| shown.arguments == arguments).unwrap_or_else(|| panic!("`{arguments}` is not shown"))
}

/// Puts what `demo` writes into a folder where a command asks for it as it is shown; `false` where the command is another one.
pub fn put_demo(command: &str, folder: &Path) -> bool {
    let demo = "rotorlead demo";
    let report = match command.strip_prefix(demo).map(str::trim) {
        Some("" | "--out demo-out") => None,
        Some("--open") => Some("demo-out/report.html"),
        Some(options) => match options.split_once(' ') {
            Some(("--report", file)) if !file.contains(' ') => Some(file),
            _ => return false,
        },
        None => return false,
    };
    let shown = case("demo");
    fs::create_dir(folder.join("demo-out")).unwrap();
    for entry in fs::read_dir(shown.wrote("demo-out")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.join("demo-out").join(path.file_name().unwrap())).unwrap();
    }
    if let Some(file) = report {
        fs::copy(&shown.report, folder.join(file)).unwrap();
    }
    true
}

/// Runs a row, one after the other.
fn run_row(row: &[Case], folder: PathBuf) -> Vec<Shown> {
    let stand = Stand::kept_in(folder);
    stand.write("plan.toml", host_tests::stand_plan());
    stand.write("actuators.toml", ACTUATORS);
    stand.write("limited.toml", format!("{ACTUATORS}{LIMIT}"));
    stand.write("curved.toml", format!("{ACTUATORS}{STATIC_MAP}"));
    stand.write("stairs-plan.toml", STAIRS);
    fs::create_dir(stand.path("hammer")).unwrap();
    stand.write("hammer/experiment.toml", HAMMER);
    stand.write("hammer/blow.csv", blow());
    for log in LOGS {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/records/tests/data").join(log);
        fs::copy(source, stand.path(log)).unwrap();
    }
    row.iter().enumerate().map(|(place, case)| show(&stand, place, case)).collect()
}

/// Runs a case with every kind of output that its command has.
fn show(stand: &Stand, place: usize, case: &Case) -> Shown {
    let program = Arguments::command();
    let name = case.arguments.split(' ').next().unwrap();
    let command = program.find_subcommand(name).unwrap();
    let stem = format!("{place}-{name}");
    let has = |option: &str| command.get_arguments().any(|one| one.get_long() == Some(option));
    let mut all = case.arguments.to_owned();
    for (option, file) in [("json", ".json"), ("report", ".html"), ("figures", "-figures")] {
        if has(option) {
            write!(all, " --{option} {stem}{file}").unwrap();
        }
    }
    let output = stand.command(&all).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(case.status), "`{all}`: {error}");
    // What `report` writes is its `--out`.
    let own = case.arguments.split(' ').find(|word| word.ends_with(".html"));
    let report = stand.path(&own.map_or_else(|| format!("{stem}.html"), str::to_owned));
    let text = String::from_utf8(output.stdout).unwrap();
    stand.write(&format!("{stem}.txt"), format!("$ rotorlead {all}\n{text}{error}# exit status {}\n", case.status));
    Shown {
        arguments: case.arguments,
        text,
        report,
        is_opened: case.is_opened,
        json: stand.path(&format!("{stem}.json")),
        figures: has("figures").then(|| stand.path(&format!("{stem}-figures"))),
    }
}

#[test]
fn every_command_is_shown_with_its_json_and_its_figures() {
    for shown in shown() {
        let json = shown.json();
        assert!(json.as_object().is_some_and(|object| !object.is_empty()), "`{}`: {json}", shown.arguments);
        let Some(figures) = &shown.figures else { continue };
        let sizes: Vec<u64> = fs::read_dir(figures)
            .unwrap_or_else(|error| panic!("`{}` draws nothing: {error}", shown.arguments))
            .map(|entry| entry.unwrap().metadata().unwrap().len())
            .collect();
        assert!(!sizes.is_empty() && !sizes.contains(&0), "`{}`: {sizes:?}", shown.arguments);
    }
    // Those without JSON print a script or a page, and others have inputs of their own in tests that bear their name.
    for command in Arguments::command().get_subcommands() {
        let name = command.get_name();
        let is_shown = || shown().iter().any(|shown| shown.arguments.split(' ').next() == Some(name));
        let tests = format!("{}/tests/cli/{name}.rs", env!("CARGO_MANIFEST_DIR"));
        let has_json = command.get_arguments().any(|argument| argument.get_id() == "json");
        assert!(!has_json || fs::exists(tests).unwrap() || is_shown(), "`{name}` is neither shown here nor tested");
    }
}

/// A blow on a stand with modes at 40 and 110 Hz, 2 s at 2 kHz, with a ripple for noise.
fn blow() -> String {
    let mut csv = String::from("time_s,command,thrust_n\n");
    let steps = 100;
    let h = 1.0 / 2000.0 / f64::from(steps);
    let force = |t: f64| 20.0 * (-0.5 * ((t - 0.02) / 1e-3).powi(2)).exp();
    // Undamped angular frequency in rad/s, damping, share of the thrust; position and velocity.
    let modes = [(251.3_f64, 0.04, 0.7), (691.2, 0.025, 0.3)];
    let mut states = [(0.0, 0.0); 2];
    let mut seed = 1u64;
    for row in 0..4000 {
        let t = f64::from(row) / 2000.0;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let ripple = 6e-3 * ((seed >> 33) as f64 / 2f64.powi(31) - 0.5);
        let thrust: f64 = modes.iter().zip(&states).map(|((.., share), (position, _))| share * position).sum();
        writeln!(csv, "{t},{},{}", force(t), thrust + ripple).unwrap();
        for step in 0..steps {
            let u = force(t + (f64::from(step) + 0.5) * h);
            for ((omega, damping, _), (position, velocity)) in modes.iter().zip(&mut states) {
                *velocity += h * (omega * omega * (u - *position) - 2.0 * damping * omega * *velocity);
                *position += h * *velocity;
            }
        }
    }
    csv
}
