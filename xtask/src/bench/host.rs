//! `rotorlead identify` from CSV files to a model, beside NumPy and SciPy in the same steps on the same files.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::process::{Cost, measure};
use crate::run::{Result, cargo, command, output, run, target_folder};

/// Rows of a period of the records: 10 s at 5 kHz.
const PERIOD_ROWS: usize = 50_000;
/// Runs of each program, of which the quickest counts: what the code can do, not what else the machine does.
const RUNS: usize = 3;
/// Above so many rows a program is run once.
const MANY_ROWS: usize = 5_000_000;
/// Time constants of both that differ by more than this are not those of the same work.
const SAME_TIME_CONSTANT: f64 = 0.01;
/// No run of `rotorlead` may take more memory, MiB, however large its files.
const MOST_MIB: f64 = 200.0;
/// From one size to the next time may grow with this power of the rows at most: linear, with room for what else the machine does.
const STEEPEST: f64 = 1.1;
/// The peer, and how it may read CSV.
const PEER: &str = "sim/identify/benches/peers/identify.py";
const READERS: [(&str, &str); 2] = [("numpy", "numpy, scipy"), ("pandas", "numpy, scipy, pandas")];

/// An experiment to identify.
#[derive(Clone, Copy, Debug)]
struct Set {
    records: usize,
    periods: usize,
}

/// Six records of 40 s, as a motor is identified from.
const SIX: Set = Set { records: 6, periods: 4 };
/// Two records each, of 10^5, 10^6, 10^7 and 10^8 rows together: files of 4 MB to 4 GB.
const SIZES: [Set; 4] = [
    Set { records: 2, periods: 1 },
    Set { records: 2, periods: 10 },
    Set { records: 2, periods: 100 },
    Set { records: 2, periods: 1000 },
];

impl Set {
    fn rows(self) -> usize {
        self.records * self.periods * PERIOD_ROWS
    }
}

/// What a program cost on a set.
#[derive(Clone, Debug)]
struct Row {
    program: String,
    set: Set,
    cost: Cost,
    /// Seconds of its stages.
    stages: Value,
    /// In the order of the records.
    time_constants_s: Vec<f64>,
}

/// All that was measured.
#[derive(Debug, Default)]
struct Report {
    rows: Vec<Row>,
    /// What was not measured, and why.
    missing: Vec<String>,
}

/// Measures, prints and writes. With `largest` also 10^8 rows, which takes minutes and 5 GB of disk.
pub fn identify(largest: bool, json: Option<&str>) -> Result {
    let programs = Programs::build()?;
    let folder = target_folder().join("bench-identify");
    let report = programs.measure_all(&folder, if largest { &SIZES } else { &SIZES[..3] });
    // The files are large: they go whatever happened.
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let report = report?;
    super::say(&report, &report.json(), json)?;
    report.check()
}

/// What there is to run.
struct Programs {
    rotorlead: PathBuf,
    stages: PathBuf,
    python: Option<String>,
}

impl Programs {
    fn build() -> Result<Self> {
        // A benchmark is built with the programs of its package.
        let arguments = ["bench", "--no-run", "--package", "rotorlead-identify", "--bench", "identify", "--locked"];
        let mut build = cargo(&arguments);
        build.args(["--message-format", "json-render-diagnostics"]).stderr(Stdio::inherit());
        let built = build.output().map_err(|error| format!("cargo: {error}"))?;
        let messages = String::from_utf8_lossy(&built.stdout);
        let messages: Vec<Value> = messages.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let executable = |name: &str| {
            let of_name = messages.iter().filter(|message| message["target"]["name"] == name);
            let path = of_name.filter_map(|message| message["executable"].as_str()).next_back();
            path.map(PathBuf::from).ok_or_else(|| format!("cargo {} built no {name}", arguments.join(" ")))
        };
        let (rotorlead, stages) = (executable("rotorlead")?, executable("identify")?);
        // The name on the way, or another one: an environment with NumPy may have its own.
        let python = std::env::var("PYTHON").unwrap_or_else(|_| String::from("python3"));
        let python = output(&mut command(&python, &["--version"])).map(|_| python);
        Ok(Self { rotorlead, stages, python })
    }

    fn measure_all(&self, folder: &Path, sizes: &[Set]) -> Result<Report> {
        let mut report = Report::default();
        let mut readers = Vec::new();
        match &self.python {
            None => {
                report.missing.push(String::from("NumPy/SciPy: python not found (set PYTHON to one that has them)"))
            }
            Some(python) => {
                for (reader, modules) in READERS {
                    match output(&mut command(python, &["-c", &format!("import {modules}")])) {
                        Some(_) => readers.push(reader),
                        None => report.missing.push(format!("read by {reader}: `{python}` cannot import {modules}")),
                    }
                }
            }
        }
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        for set in std::iter::once(SIX).chain(sizes.iter().copied()) {
            let data = folder.join(format!("{}x{}", set.records, set.periods));
            if data.exists() {
                std::fs::remove_dir_all(&data).map_err(|error| format!("{}: {error}", data.display()))?;
            }
            let path = data.to_string_lossy();
            run(Command::new(&self.stages).args(["make", &path, &set.records.to_string(), &set.periods.to_string()]))?;
            // All programs in turn, again and again: whatever else the machine does meets all of them.
            let mut quickest: Vec<Option<Row>> = vec![None; 2 + readers.len()];
            for _ in 0..if set.rows() > MANY_ROWS { 1 } else { RUNS } {
                let mut rows = vec![self.rotorlead(set, &data, false)?, self.rotorlead(set, &data, true)?];
                for reader in &readers {
                    rows.push(self.peer(set, &data, reader)?);
                }
                for (best, row) in quickest.iter_mut().zip(rows) {
                    if best.as_ref().is_none_or(|best| row.cost.wall_s < best.cost.wall_s) {
                        *best = Some(row);
                    }
                }
            }
            let stages = measure(Command::new(&self.stages).args(["measure", &path]))?;
            let stages = serde_json::from_str(&stages.output).map_err(|error| format!("its stages: {error}"))?;
            if let Some(Some(row)) = quickest.first_mut() {
                row.stages = stages;
            }
            report.rows.extend(quickest.into_iter().flatten());
            std::fs::remove_dir_all(&data).map_err(|error| format!("{}: {error}", data.display()))?;
        }
        Ok(report)
    }

    fn rotorlead(&self, set: Set, data: &Path, one_thread: bool) -> Result<Row> {
        let model = data.join("model.toml");
        let mut command = Command::new(&self.rotorlead);
        if one_thread {
            command.env("RAYON_NUM_THREADS", "1");
        }
        command.arg("identify").arg(data).arg("--out").arg(&model).args(["--json", "-"]).stderr(Stdio::null());
        let cost = measure(&mut command)?;
        let found: Value =
            serde_json::from_str(&cost.output).map_err(|error| format!("rotorlead identify: {error}"))?;
        let points = found["points"].as_array().map(Vec::as_slice).unwrap_or_default();
        let time_constants_s = points.iter().filter_map(|point| point["time_constant_s"].as_f64()).collect();
        let program = if one_thread { "rotorlead, one thread" } else { "rotorlead" };
        Ok(Row { program: program.to_owned(), set, cost, stages: Value::Null, time_constants_s })
    }

    fn peer(&self, set: Set, data: &Path, reader: &str) -> Result<Row> {
        let python = self.python.as_deref().ok_or("python not found")?;
        let cost = measure(command(python, &[PEER]).arg(data).arg(reader))?;
        let stages: Value = serde_json::from_str(&cost.output).map_err(|error| format!("{PEER}: {error}"))?;
        let found = stages["time_constants_s"].as_array().map(Vec::as_slice).unwrap_or_default();
        let time_constants_s = found.iter().filter_map(Value::as_f64).collect();
        Ok(Row { program: format!("NumPy/SciPy, read by {reader}"), set, cost, stages, time_constants_s })
    }
}

impl Report {
    /// `rotorlead` as users run it, on the sizes of 10^5 rows and more.
    fn sizes(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.program == "rotorlead" && row.set.records != SIX.records)
    }

    /// The exponent `s` of `time = c rows^s` between two sizes that follow each other.
    fn slopes(&self) -> Vec<f64> {
        let rows: Vec<&Row> = self.sizes().collect();
        let slope = |pair: &[&Row]| {
            let ratio = |of: fn(&Row) -> f64| (of(pair[1]) / of(pair[0])).ln();
            ratio(|row| row.cost.wall_s) / ratio(|row| row.set.rows() as f64)
        };
        rows.windows(2).map(slope).collect()
    }

    /// How much longer than `rotorlead` a row's program takes on the same set.
    fn ratio(&self, row: &Row) -> Option<f64> {
        let ours = self.rows.iter().find(|ours| ours.program == "rotorlead" && ours.set.rows() == row.set.rows())?;
        Some(row.cost.wall_s / ours.cost.wall_s)
    }

    fn json(&self) -> Value {
        let rows = self.rows.iter().map(|row| {
            json!({
                "program": row.program,
                "records": row.set.records,
                "rows": row.set.rows(),
                "wall_s": row.cost.wall_s,
                "cpu_s": row.cost.cpu_s,
                "peak_mib": row.cost.peak_mib,
                "samples_per_s": row.set.rows() as f64 / row.cost.wall_s,
                "times_rotorlead": self.ratio(row),
                "time_constants_s": row.time_constants_s,
                "stages": row.stages,
            })
        });
        json!({ "rows": rows.collect::<Vec<_>>(), "slopes": self.slopes(), "missing": self.missing })
    }

    /// What is compared must be the same work, and cost no more than is claimed.
    fn check(&self) -> Result {
        self.check_work()?;
        for row in self.rows.iter().filter(|row| row.program.starts_with("rotorlead")) {
            if let Some(mib) = row.cost.peak_mib.filter(|mib| *mib > MOST_MIB) {
                return Err(format!("{}: {mib:.0} MiB for {} rows, above {MOST_MIB}", row.program, row.set.rows()));
            }
        }
        match self.slopes().into_iter().find(|slope| *slope > STEEPEST) {
            Some(slope) => Err(format!("time grows as rows^{slope:.2}, above {STEEPEST}: not linear")),
            None => Ok(()),
        }
    }

    fn check_work(&self) -> Result {
        for row in &self.rows {
            let ours = self.rows.iter().find(|ours| ours.set.rows() == row.set.rows());
            let ours = ours.map_or(&[][..], |ours| &ours.time_constants_s);
            let same = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < SAME_TIME_CONSTANT;
            if ours.len() != row.set.records
                || row.time_constants_s.len() != ours.len()
                || !row.time_constants_s.iter().zip(ours).all(same)
            {
                return Err(format!("{}: other time constants, {:?} for {ours:?}", row.program, row.time_constants_s));
            }
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        writeln!(f, "From CSV files to a model, whole programs with their start, {cores} cores")?;
        writeln!(f, "(the quickest of {RUNS} runs; of more than {MANY_ROWS} rows one run)\n")?;
        writeln!(
            f,
            "{:>11} {:<28} {:>8} {:>8} {:>8} {:>9} {:>7}",
            "rows", "program", "wall s", "cpu s", "Mrows/s", "peak MiB", "times"
        )?;
        let or_dash = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| String::from("-"), |value| format!("{value:.digits$}"))
        };
        for row in &self.rows {
            writeln!(
                f,
                "{:>11} {:<28} {:>8.3} {:>8} {:>8.2} {:>9} {:>7}",
                row.set.rows(),
                row.program,
                row.cost.wall_s,
                or_dash(row.cost.cpu_s, 2),
                row.set.rows() as f64 / row.cost.wall_s / 1e6,
                or_dash(row.cost.peak_mib, 0),
                or_dash(self.ratio(row), 2),
            )?;
        }
        for missing in &self.missing {
            writeln!(f, "{:>11} {missing}", "-")?;
        }
        writeln!(f, "\n{:>11} {:<28} {:>8} {:>8} {:>8}", "rows", "stages, seconds", "read", "spectra", "fit")?;
        for row in self.rows.iter().filter(|row| !row.stages.is_null()) {
            let stage = |name: &str| or_dash(row.stages[name].as_f64(), 3);
            let [read, spectra, fit] = ["read_s", "spectra_s", "fit_s"].map(stage);
            writeln!(f, "{:>11} {:<28} {read:>8} {spectra:>8} {fit:>8}", row.set.rows(), row.program)?;
        }
        let slopes: Vec<String> = self.slopes().iter().map(|slope| format!("{slope:.2}")).collect();
        writeln!(f, "\ntime ~ rows^s; from each size to the next s = {}", slopes.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `rotorlead` on the first sizes, with these times and this memory of each.
    fn report(wall_s: &[f64], peak_mib: f64) -> Report {
        let row = |(set, wall_s): (&Set, &f64)| Row {
            program: String::from("rotorlead"),
            set: *set,
            cost: Cost { wall_s: *wall_s, peak_mib: Some(peak_mib), ..Cost::default() },
            stages: Value::Null,
            time_constants_s: vec![0.1; set.records],
        };
        Report { rows: SIZES.iter().zip(wall_s).map(row).collect(), missing: Vec::new() }
    }

    #[test]
    fn memory_and_growth_are_held() {
        assert_eq!(report(&[0.03, 0.14, 0.81, 8.0], 56.0).check(), Ok(()));
        assert!(report(&[0.03, 0.14, 0.81, 8.0], 201.0).check().unwrap_err().contains("201 MiB"));
        assert!(report(&[0.03, 0.14, 2.0], 56.0).check().unwrap_err().contains("rows^1.15"));
    }

    #[test]
    fn other_time_constants_are_other_work() {
        let mut report = report(&[0.03, 0.14], 56.0);
        report.rows.push(Row { time_constants_s: vec![0.1, 0.12], ..report.rows[1].clone() });
        assert!(report.check().unwrap_err().contains("other time constants"));
    }
}
