//! `rotorlead diagnose` on whole experiments: what a case costs, and how that grows with the rows.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::process::{Cost, measure};
use crate::run::{Result, cargo, release_folder, run, target_folder};

/// Commands and rows per second, and rows of a period of 10 s.
const LOOP_HZ: usize = 5000;
const RATE_HZ: usize = 1000;
const PERIOD_ROWS: usize = 10 * RATE_HZ;
/// Runs of each case, the median of which counts; more rows than these are run once.
const RUNS: usize = 3;
const MANY_ROWS: usize = 500_000;
/// Motors of the blind cases whose supply sags, the slowest of which counts, and those with two effects and with one outside the
/// catalog, by `--seeds`.
const SAGS: &str = "20";
const OTHERS: &str = "1";
/// Periods of a record: 12 records of three have 360 000 rows.
const PERIODS: [usize; 3] = [3, 9, 30];

/// The paper's points.
const POINTS: [(f64, f64, f64); 6] = [
    (0.40, 9.9955, 0.1593422),
    (0.45, 10.4556, 0.1360100),
    (0.50, 10.1718, 0.1076554),
    (0.55, 10.9196, 0.1008776),
    (0.60, 13.4519, 0.0851506),
    (0.65, 16.1063, 0.0707839),
];

/// What is hidden in the actuator, as tables of a model: nothing, effects by what they make of the chain, and two at once.
const HIDDEN: [(&str, &str); 8] = [
    ("nothing", ""),
    ("second_pole", "[[effect]]\nkind = \"second_pole\"\nparameters = { time_constant_s = 0.012 }\n"),
    ("slew_limit", "[[effect]]\nkind = \"slew_limit\"\nparameters = { rate_per_s = 0.6 }\n"),
    ("dead_band", "[[effect]]\nkind = \"dead_band\"\nparameters = { width = 0.006 }\n"),
    ("esc_frame_hold", "[[effect]]\nkind = \"esc_frame_hold\"\nparameters = { frame_hz = 120.0 }\n"),
    (
        "supply_sag",
        "[[effect]]\nkind = \"supply_sag\"\nparameters = { polarization_drop = 0.08, polarization_s = 0.6 }\n",
    ),
    ("asymmetric_lag", "[[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.5 }\n"),
    (
        "two effects",
        "[[effect]]\nkind = \"dead_band\"\nparameters = { width = 0.006 }\n\
         [[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.5 }\n",
    ),
];
/// The case with which the rows grow.
const GROWING: usize = 1;

/// One case.
#[derive(Clone, Debug)]
struct Row {
    hidden: String,
    rows: usize,
    cost: Cost,
    /// What was said, and what was named.
    verdict: String,
    named: Vec<String>,
}

/// All that was measured.
#[derive(Debug)]
struct Report(Vec<Row>);

/// Measures, prints and writes.
pub fn diagnose(json: Option<&str>) -> Result {
    run(&mut cargo(&["build", "--release", "--bin", "rotorlead", "--bin", "blind", "--locked"]))?;
    let program = |name: &str| release_folder().join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    let folder = target_folder().join("bench-diagnose");
    let removed = || match std::fs::remove_dir_all(&folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(format!("{}: {error}", folder.display())),
        _ => Ok(()),
    };
    removed()?;
    let report = measure_all(&program("rotorlead"), &program("blind"), &folder);
    // The files are large: they go whatever happened.
    removed()?;
    let report = Report(report?);
    super::say(&report, &report.json(), json)
}

fn measure_all(tool: &Path, blind: &Path, folder: &Path) -> Result<Vec<Row>> {
    std::fs::create_dir_all(folder).map_err(|error| in_words(folder, &error))?;
    let cases = (0..HIDDEN.len()).map(|hidden| (hidden, PERIODS[0]));
    let growing = PERIODS[1..].iter().map(|periods| (GROWING, *periods));
    let mut rows: Vec<Row> = cases
        .chain(growing)
        .map(|(hidden, periods)| one(tool, folder, HIDDEN[hidden], periods))
        .collect::<Result<_>>()?;
    rows.push(slowest_sag(tool, &blind_cases(blind, &folder.join("sags"), "supply_sag", SAGS)?)?);
    for case in blind_cases(blind, &folder.join("others"), "pair,outside", OTHERS)? {
        rows.push(case.row(tool, RUNS)?);
    }
    Ok(rows)
}

fn in_words(path: &Path, error: &dyn fmt::Display) -> String {
    format!("{}: {error}", path.display())
}

/// An experiment.
struct Case {
    hidden: String,
    data: PathBuf,
    /// The model that it is compared with, if any.
    model: Option<PathBuf>,
}

impl Case {
    /// What its diagnosis costs, by the median of so many runs.
    fn row(&self, tool: &Path, runs: usize) -> Result<Row> {
        let mut costs: Vec<Cost> = Vec::with_capacity(runs);
        for _ in 0..runs {
            let mut diagnose = Command::new(tool);
            diagnose.arg("diagnose").arg(&self.data).args(["--json", "-"]).stderr(Stdio::null());
            if let Some(model) = &self.model {
                diagnose.arg("--model").arg(model);
            }
            costs.push(measure(&mut diagnose)?);
        }
        costs.sort_by(|a, b| a.wall_s.total_cmp(&b.wall_s));
        let cost = costs.swap_remove(costs.len() / 2);
        let found: Value =
            serde_json::from_str(&cost.output).map_err(|error| format!("rotorlead diagnose: {error}"))?;
        let kinds = found["effects"].as_array().map(Vec::as_slice).unwrap_or_default().iter();
        let named = kinds.filter_map(|effect| effect["kind"].as_str().map(str::to_owned)).collect();
        let verdict = found["verdict"].as_str().unwrap_or_default().to_owned();
        Ok(Row { hidden: self.hidden.clone(), rows: self.rows()?, cost, verdict, named })
    }

    /// Rows of all its records.
    fn rows(&self) -> Result<usize> {
        let mut rows = 0;
        for entry in std::fs::read_dir(&self.data).map_err(|error| in_words(&self.data, &error))? {
            let path = entry.map_err(|error| in_words(&self.data, &error))?.path();
            if path.extension().is_some_and(|extension| extension == "csv") {
                let text = std::fs::read(&path).map_err(|error| in_words(&path, &error))?;
                // The first line is the header.
                rows += text.iter().filter(|byte| **byte == b'\n').count().saturating_sub(1);
            }
        }
        Ok(rows)
    }
}

/// A case of the tool's own simulation.
fn one(tool: &Path, folder: &Path, (hidden, effects): (&str, &str), periods: usize) -> Result<Row> {
    let mut model = String::from("format = 1\n");
    let mut plan = format!(
        "format = 1\nname = \"speed\"\nseed = 1\nloop_rate_hz = {LOOP_HZ}\nsample_rate_hz = {RATE_HZ}\n[noise]\nsigma_n = 0.02\n"
    );
    for (nominal, gain, tau_s) in POINTS {
        model += &format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {tau_s}\n");
        plan += &format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\namplitude = 0.05\nlines = 150\nperiods = {periods}\n\
             [[record]]\nnominal = {nominal}\nexcitation = \"square\"\namplitude = 0.05\nhalf_period_s = 5\nperiods = {periods}\n"
        );
    }
    let write = |name: &str, text: &str| -> Result<PathBuf> {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|error| in_words(&path, &error))?;
        Ok(path)
    };
    let (model, plan) = (write("model.toml", &(model + effects))?, write("plan.toml", &plan)?);
    let data = folder.join(format!("{}_{periods}", hidden.replace(' ', "_")));
    let mut simulate = Command::new(tool);
    simulate.arg("simulate").arg("--model").arg(model).arg("--plan").arg(plan).arg("--out").arg(&data);
    run(simulate.stdout(Stdio::null()))?;
    let is_long = 2 * POINTS.len() * periods * PERIOD_ROWS > MANY_ROWS;
    let case = Case { hidden: hidden.to_owned(), data: data.clone(), model: None };
    let row = case.row(tool, if is_long { 1 } else { RUNS })?;
    std::fs::remove_dir_all(&data).map_err(|error| in_words(&data, &error))?;
    Ok(row)
}

/// Blind cases of these kinds, by the names of their files, which say nothing of them.
fn blind_cases(blind: &Path, folder: &Path, kinds: &str, seeds: &str) -> Result<Vec<Case>> {
    let mut make = Command::new(blind);
    make.args(["--only-ceilings", "--set", "tune", "--rivals", "none", "--kinds", kinds, "--seeds", seeds, "--keep"]);
    run(make.arg(folder).stdout(Stdio::null()).stderr(Stdio::null()))?;
    let truths = folder.join("truth");
    let mut cases = Vec::new();
    for entry in std::fs::read_dir(&truths).map_err(|error| in_words(&truths, &error))? {
        let path = entry.map_err(|error| in_words(&truths, &error))?.path();
        let text = std::fs::read_to_string(&path).map_err(|error| in_words(&path, &error))?;
        let truth: Value = serde_json::from_str(&text).map_err(|error| in_words(&path, &error))?;
        let kinds = truth["effects"].as_array().map(Vec::as_slice).unwrap_or_default().iter();
        let hidden: Vec<&str> = kinds.filter_map(|effect| effect["kind"].as_str()).collect();
        let hidden = if hidden.is_empty() { "outside".to_owned() } else { hidden.join(" + ") };
        let data = folder.join("cases").join(path.file_stem().unwrap_or_default());
        let model = data.join("model.toml");
        cases.push(Case { hidden, data, model: model.is_file().then_some(model) });
    }
    cases.sort_by(|a, b| (&a.hidden, &a.data).cmp(&(&b.hidden, &b.data)));
    Ok(cases)
}

/// The slowest of some cases, by one run of each.
fn slowest_sag(tool: &Path, cases: &[Case]) -> Result<Row> {
    let mut slowest: Option<(f64, &Case)> = None;
    for case in cases {
        let wall_s = case.row(tool, 1)?.cost.wall_s;
        if slowest.is_none_or(|(most_s, _)| wall_s > most_s) {
            slowest = Some((wall_s, case));
        }
    }
    let (_, slowest) = slowest.ok_or("no case was made")?;
    let row = slowest.row(tool, RUNS)?;
    Ok(Row { hidden: format!("slowest of {SAGS}: {}", row.hidden), ..row })
}

impl Report {
    /// Rows, and wall time per row over that of the smallest size, of the case that grows.
    fn growth(&self) -> Vec<(usize, f64)> {
        let rows: Vec<&Row> = self.0.iter().filter(|row| row.hidden == HIDDEN[GROWING].0).collect();
        let per_row = |row: &Row| row.cost.wall_s / row.rows as f64;
        rows.iter().map(|row| (row.rows, per_row(row) / per_row(rows[0]))).collect()
    }

    fn json(&self) -> Value {
        let rows = self.0.iter().map(|row| {
            json!({
                "hidden": row.hidden,
                "rows": row.rows,
                "wall_s": row.cost.wall_s,
                "cpu_s": row.cost.cpu_s,
                "peak_mib": row.cost.peak_mib,
                "verdict": row.verdict,
                "named": row.named,
            })
        });
        let growth = self.growth().into_iter().map(|(rows, ratio)| json!({ "rows": rows, "time_per_row": ratio }));
        json!({ "rows": rows.collect::<Vec<_>>(), "growth": growth.collect::<Vec<_>>() })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        writeln!(
            f,
            "From CSV files to a diagnosis, the whole catalog, 12 records of commands at {LOOP_HZ} Hz, {cores} cores"
        )?;
        writeln!(
            f,
            "(the median of {RUNS} runs; of more than {MANY_ROWS} rows one run; the last rows are blind cases)\n"
        )?;
        writeln!(
            f,
            "{:>9} {:<32} {:>8} {:>8} {:>9}  {:<13} named",
            "rows", "hidden", "wall s", "cpu s", "peak MiB", "verdict"
        )?;
        let or_dash = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| String::from("-"), |value| format!("{value:.digits$}"))
        };
        for row in &self.0 {
            writeln!(
                f,
                "{:>9} {:<32} {:>8.2} {:>8} {:>9}  {:<13} {}",
                row.rows,
                row.hidden,
                row.cost.wall_s,
                or_dash(row.cost.cpu_s, 1),
                or_dash(row.cost.peak_mib, 0),
                row.verdict,
                row.named.join(", ")
            )?;
        }
        let growth: Vec<String> =
            self.growth().iter().map(|(rows, ratio)| format!("{ratio:.2} at {rows} rows")).collect();
        let mut walls_s: Vec<f64> =
            self.0.iter().filter(|row| row.rows <= MANY_ROWS).map(|row| row.cost.wall_s).collect();
        walls_s.sort_by(f64::total_cmp);
        let at = |place: usize| walls_s.get(place).copied().unwrap_or(f64::NAN);
        writeln!(
            f,
            "\nof those of up to {MANY_ROWS} rows: median {:.2} s, longest {:.2} s",
            at(walls_s.len() / 2),
            at(walls_s.len().saturating_sub(1))
        )?;
        writeln!(f, "time per row over that of the smallest: {}", growth.join(", "))
    }
}
