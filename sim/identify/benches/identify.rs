//! Records to identify, and how long each stage takes: `cargo bench -p rotorlead-identify --bench identify`.
//!
//! `-- make DIR RECORDS PERIODS` writes an experiment of so many multisine records, each of so many periods of 50 000 rows
//! at 5 kHz. `-- measure DIR` reads and identifies it, and prints seconds as JSON. Without either, both are done with six
//! records of four periods in a temporary folder.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::time::Instant;

use miette::{IntoDiagnostic as _, miette};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};
use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_identify::lag::multisine::{PeriodicOptions, identify_periodic};
use rotorlead_identify::spectra::{Spectrum, SpectrumOptions};
use rotorlead_plant::Model;
use rotorlead_plant::bench::{Plan, run};
use rotorlead_records::{Experiment, LONG_FILE, Record};

const RATE_HZ: f64 = 5000.0;
/// Thrust noise, newtons per row.
const SIGMA_N: f64 = 0.02;

/// The paper's gains and time constants at 0.4, 0.5 and 0.65, and others between them.
const POINTS: [(f64, f64, f64); 6] = [
    (0.40, 9.9955, 0.159342),
    (0.45, 10.08, 0.130),
    (0.50, 10.1718, 0.107656),
    (0.55, 12.1, 0.095),
    (0.60, 14.2, 0.082),
    (0.65, 16.1063, 0.070784),
];

fn main() -> miette::Result<()> {
    // `cargo bench` adds an argument of its own.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let number = |text: &str| text.parse::<usize>().map_err(|error| miette!("{text}: {error}"));
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make", folder, records, periods] => make(Path::new(folder), number(records)?, number(periods)?),
        ["measure", folder] => measure(Path::new(folder)),
        [] => {
            let scratch = tempfile::tempdir().into_diagnostic()?;
            let folder = scratch.path().join("six");
            make(&folder, 6, 4)?;
            measure(&folder)
        }
        _ => Err(miette!("usage: [make DIR RECORDS PERIODS | measure DIR]")),
    }
}

/// Writes the experiment. One period of each record is simulated; it is repeated with noise of its own in every row.
fn make(folder: &Path, records: usize, periods: usize) -> miette::Result<()> {
    let mut model = String::from("format = 1\n");
    let mut plan = String::from(
        "format = 1\nname = \"speed\"\nseed = 1\nloop_rate_hz = 5000\nsample_rate_hz = 5000\n[noise]\nsigma_n = 0.0\n",
    );
    for (nominal, gain, tau_s) in POINTS.iter().take(records) {
        model += &format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {tau_s}\n");
        plan += &format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\namplitude = 0.05\nlines = 150\nperiods = 1\n"
        );
    }
    let model: Model = toml::from_str(&model).expect("the text above is a model");
    let plan: Plan = toml::from_str(&plan).expect("the text above is a plan");
    let experiment = run(&plan, &model, None, &|_| {})?;
    // Its manifest; the records are then written over.
    experiment.write(folder)?;
    experiment
        .records
        .par_iter()
        .enumerate()
        .map(|(index, record)| write_repeated(&folder.join(&record.file), record, periods, index as u64))
        .collect::<std::io::Result<()>>()
        .into_diagnostic()
}

fn write_repeated(path: &Path, record: &Record, periods: usize, seed: u64) -> std::io::Result<()> {
    let thrust_n = record.thrust_n.as_deref().unwrap_or_default();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    file.write_all(b"time_s,command,thrust_n\n")?;
    let mut digits = ryu::Buffer::new();
    let rows = record.command.len();
    for row in 0..periods * rows {
        let noise: f64 = StandardNormal.sample(&mut rng);
        let cells = [row as f64 / RATE_HZ, record.command[row % rows], thrust_n[row % rows] + SIGMA_N * noise];
        for (cell, end) in cells.into_iter().zip([b",", b",", b"\n"]) {
            file.write_all(digits.format(cell).as_bytes())?;
            file.write_all(end)?;
        }
    }
    file.flush()
}

/// Runs the stages one by one. What stays on disk is read twice: without and with its spectra.
fn measure(folder: &Path) -> miette::Result<()> {
    let options = SpectrumOptions::default();
    let start = Instant::now();
    let mut lap = {
        let mut last = start;
        move || {
            let now = Instant::now();
            let lap_s = (now - last).as_secs_f64();
            last = now;
            lap_s
        }
    };
    let (mut experiment, long) = Experiment::read_except_long(folder, LONG_FILE)?;
    let mut rows: usize = experiment.records.iter().map(|record| record.time_s.len()).sum();
    let counts = long.par_iter().map(|record| record.for_each_block(|_| {})).collect::<Vec<_>>();
    for count in counts {
        rows += count?.rows;
    }
    let read_s = lap();

    let of_long = |record| Spectrum::from_long_record(&experiment, record, &options);
    let of_short = |record| Spectrum::from_record(&experiment, record, &options);
    let long_spectra = long.par_iter().map(of_long).collect::<Vec<_>>();
    let short_spectra = experiment.records.par_iter().map(of_short).collect::<Vec<_>>();
    let mut transformed = Vec::new();
    for (record, spectrum) in long.iter().zip(long_spectra) {
        transformed.push((record.header.clone(), spectrum?));
    }
    // The experiment is left without them, so that nothing is transformed twice.
    for (record, spectrum) in std::mem::take(&mut experiment.records).into_iter().zip(short_spectra) {
        transformed.push((record, spectrum?));
    }
    let both_s = lap();
    let spectra_s = if long.is_empty() { both_s } else { both_s - read_s };

    identify_periodic(&experiment, &PeriodicOptions { long: &transformed, ..PeriodicOptions::default() })?;
    let fit_s = lap();
    let stages = serde_json::json!({ "rows": rows, "read_s": read_s, "spectra_s": spectra_s, "fit_s": fit_s });
    println!("{stages}");
    Ok(())
}
