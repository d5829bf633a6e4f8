//! `rotorlead excite`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::Diagnostic as _;
use rotorlead_answer::{Fact, Report, Section, Tone, Verdict};
use rotorlead_plant::bench::multisine::{
    DetectionRecipe, DetectionSet, LineSet, Multisine, MultisineError, Search, optimize,
};
use rotorlead_records::files::{AcceptedRange, check_writable, write_file};
use rotorlead_results::excitation;
use serde_json::json;

use super::UsageError;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{number, range};
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// The longest period, in samples: more than an hour at 5 kHz is a slip of the decimal point.
const MOST_SAMPLES: f64 = 2e7;

/// Designs a sum of sinusoids with a low crest factor
///
/// Lines of equal amplitude at the odd multiples of 1/period within the band: the even lines and the odd ones that are
/// left out then show what is not linear. The phases are searched for, from Schroeder's, so that the peak is low for
/// the power. The signal starts and ends at zero.
///
/// With `--detection` the phases are random instead and one odd line in each group is skipped: the even and the skipped
/// lines then show how much of the response is not linear. Record each realization by itself, four periods or more, all
/// at one nominal command.
#[derive(Args, Debug)]
pub struct Excite {
    /// Band in hertz
    #[arg(long, value_name = "LOW..HIGH", default_value = "0.1..30", value_parser = range(AcceptedRange::BAND_HZ), allow_hyphen_values = true)]
    band: (f64, f64),
    /// Period in seconds; the lines are 2/period apart
    #[arg(long, value_name = "S", default_value = "10", value_parser = number(AcceptedRange::DURATION_S), allow_hyphen_values = true)]
    period: f64,
    /// Rate of the samples in hertz
    #[arg(long, value_name = "HZ", default_value = "5000", value_parser = number(AcceptedRange::SAMPLE_RATE_HZ), allow_hyphen_values = true)]
    rate: f64,
    /// Command around which it runs, 0..1
    #[arg(long, value_name = "U", default_value = "0.5", value_parser = number(AcceptedRange::DUTY), allow_hyphen_values = true)]
    nominal: f64,
    /// Peak deviation of the command
    #[arg(long, value_name = "U", default_value = "0.05", value_parser = number(AcceptedRange::AMPLITUDE), allow_hyphen_values = true)]
    amplitude: f64,
    /// Skip odd lines and draw the phases, to detect nonlinear distortion
    #[arg(long)]
    detection: bool,
    /// One odd line is skipped in every group of this many
    #[arg(long, value_name = "N", default_value_t = DetectionRecipe::GROUP, requires = "detection", value_parser = clap::value_parser!(u32).range(2..=100))]
    group: u32,
    /// Signals of the same lines and amplitudes and other phases; with more than one, FILE is numbered from _1
    #[arg(long, value_name = "M", default_value = "1", requires = "detection", value_parser = clap::value_parser!(u32).range(1..=100))]
    realizations: u32,
    /// Seed of the search's starts, or of the skipped lines and the phases
    #[arg(long, default_value = "1", allow_negative_numbers = true)]
    seed: u64,
    /// Starts of the search; more may find a lower crest factor
    #[arg(long, default_value = "3", conflicts_with = "detection", value_parser = clap::value_parser!(u32).range(1..=1000))]
    starts: u32,
    /// Write one period as CSV: time_s, command
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Excite {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        if self.nominal - self.amplitude < 0.0 || self.nominal + self.amplitude > 1.0 {
            return Err(UsageError::new(
                format!(
                    "--nominal {} with --amplitude {} leaves the command's range 0..1",
                    self.nominal, self.amplitude
                ),
                "lower --amplitude, or move --nominal away from the end",
            )
            .into());
        }
        self.report.check()?;
        let samples = self.samples(self.band.1)?;
        let files = self.files();
        // Numbered, they are not on the command line.
        let others = [self.json.file(), self.report.file()];
        if let Some(both) = files.iter().find(|file| others.contains(&Some(file))) {
            let message = format!("--out and --json or --report are both `{}`", both.display());
            return Err(UsageError::new(message, "give them different files: one would overwrite the other").into());
        }
        for file in &files {
            check_writable(file)?;
        }
        let (signals, peak, skipped) = if self.detection { self.detection_set()? } else { self.low_crest()? };
        let [first_signal, ..] = &signals[..] else {
            return Err(miette::miette!("no signal was asked for"));
        };

        let crest_factors: Vec<f64> = signals.iter().map(|signal| signal.crest_factor(samples)).collect();
        let crest_factor = crest_factors.iter().copied().fold(0.0, f64::max);
        let hertz = |harmonic: u32| f64::from(harmonic) / self.period;
        let harmonics = first_signal.lines().harmonics();
        let (first, last) = (harmonics[0], first_signal.lines().top_harmonic());
        let line_amplitude = self.amplitude / peak;
        let mut text = format!("{} lines from {} to {} Hz, ", harmonics.len(), hertz(first), hertz(last));
        if self.detection {
            write!(text, "{} odd ones between them skipped, ", skipped.len()).expect("a string takes all");
        } else {
            write!(text, "{} Hz apart, ", 2.0 / self.period).expect("a string takes all");
        }
        let highest =
            if signals.len() > 1 { format!(", the highest of {} realizations", signals.len()) } else { String::new() };
        write!(
            text,
            "period {} s\ncrest factor {crest_factor:.4}{highest}\n\
             amplitude of one line {line_amplitude:.3e} for a peak of {}\n",
            self.period, self.amplitude
        )
        .expect("a string takes all");
        for (file, signal) in files.iter().zip(&signals) {
            let mut csv = String::from("time_s,command\n");
            for (k, value) in signal.waveform(samples).iter().enumerate() {
                let command = self.nominal + line_amplitude * value;
                writeln!(csv, "{},{command}", k as f64 / self.rate).expect("a string takes all");
            }
            write_file(file, csv.as_bytes())?;
            writeln!(text, "One period, {samples} samples, written to {}", file.display()).expect("a string takes all");
        }
        let frequencies_hz = |harmonics: &[u32]| harmonics.iter().map(|&harmonic| hertz(harmonic)).collect::<Vec<_>>();
        let mut json = json!({
            "lines": harmonics.len(),
            "frequencies_hz": frequencies_hz(harmonics),
            "phases_rad": first_signal.phases_rad(),
            "period_s": self.period,
            "crest_factor": crest_factor,
            "line_amplitude": line_amplitude,
        });
        if self.detection {
            json["skipped_hz"] = json!(frequencies_hz(&skipped));
            json["realizations"] = signals
                .iter()
                .zip(&crest_factors)
                .map(|(signal, crest_factor)| json!({"phases_rad": signal.phases_rad(), "crest_factor": crest_factor}))
                .collect();
        }
        text.push_str(&self.report.write(|| self.page(&signals, samples, line_amplitude, crest_factor))?);
        Ok(Outcome::new(text, &json))
    }

    /// The report: every signal over time, and its lines.
    fn page(&self, signals: &[Multisine], samples: usize, line_amplitude: f64, crest_factor: f64) -> Report {
        let figure = |(index, signal): (usize, &Multisine)| {
            let period: Vec<f64> =
                signal.waveform(samples).iter().map(|value| self.nominal + line_amplitude * value).collect();
            let number = if signals.len() > 1 { format!("_{}", index + 1) } else { String::new() };
            let of = format!("the multisine{}", number.replace('_', " "));
            Some(excitation(&of, &period, self.rate)?.with_record(&format!("excitation{number}")))
        };
        let section = Section {
            figures: signals.iter().enumerate().filter_map(figure).collect(),
            ..Section::new("excitation", "Excitation")
        };
        let headline = format!("A multisine with a crest factor of {crest_factor:.3}.");
        let (low, high) = self.band;
        Report {
            facts: vec![
                Fact::new("Band", format!("{low} to {high} Hz")),
                Fact::new("Period", format!("{} s at {} Hz", self.period, self.rate)),
                Fact::new("Command", format!("{} ± {}, duty", self.nominal, self.amplitude)),
                report_pages::version(),
            ],
            sections: vec![section],
            ..report_pages::report("Excitation", "Excitation", Verdict::new(Tone::Plain, headline))
        }
    }

    /// The multisine of low crest factor, its peak, and no skipped line.
    fn low_crest(&self) -> miette::Result<(Vec<Multisine>, f64, Vec<u32>)> {
        let (low_hz, high_hz) = self.band;
        let lines = LineSet::odd_in_band(low_hz, high_hz, self.period).map_err(|error| self.wrong_band(&error))?;
        let bar = progress::bar("searching phases", 1);
        let search = Search { seed: self.seed, starts: self.starts };
        let multisine = optimize(&lines, &search, |progress| {
            bar.set_length(progress.total as u64);
            bar.set_position(progress.done as u64);
        })?;
        bar.finish_and_clear();
        let peak = multisine.peak();
        Ok((vec![multisine], peak, Vec::new()))
    }

    /// The multisines that show a nonlinearity, their highest peak, and the skipped harmonics.
    fn detection_set(&self) -> miette::Result<(Vec<Multisine>, f64, Vec<u32>)> {
        let recipe = DetectionRecipe {
            band_hz: self.band,
            period_s: self.period,
            group: self.group,
            seed: self.seed,
            realizations: self.realizations,
        };
        let set = DetectionSet::new(&recipe).map_err(|error| self.wrong_band(&error))?;
        Ok((set.realizations, set.peak, set.skipped))
    }

    fn wrong_band(&self, error: &MultisineError) -> UsageError {
        let help = error.help().map(|help| help.to_string()).unwrap_or_default();
        let (low_hz, high_hz) = self.band;
        UsageError::new(format!("--band {low_hz}..{high_hz} with --period {}: {error}", self.period), help)
    }

    /// Where the signals go: `--out`, numbered when there are several.
    fn files(&self) -> Vec<PathBuf> {
        let Some(out) = &self.out else { return Vec::new() };
        if self.realizations == 1 {
            return vec![out.clone()];
        }
        let numbered = |number: u32| {
            let mut name = out.file_stem().unwrap_or_default().to_os_string();
            name.push(format!("_{number}"));
            if let Some(extension) = out.extension() {
                name.push(".");
                name.push(extension);
            }
            out.with_file_name(name)
        };
        (1..=self.realizations).map(numbered).collect()
    }

    /// Samples in one period: a whole number, and enough for the highest line.
    fn samples(&self, high_hz: f64) -> Result<usize, UsageError> {
        let samples = self.period * self.rate;
        if samples > MOST_SAMPLES {
            return Err(UsageError::new(
                format!("--period {:?} at --rate {:?} is {samples:?} samples", self.period, self.rate),
                format!("shorten --period or lower --rate: {MOST_SAMPLES} samples are the most"),
            ));
        }
        let whole = samples.round();
        if (samples - whole).abs() > 1e-6 * whole.max(1.0) {
            return Err(UsageError::new(
                format!("--period {} at --rate {} is {samples} samples, not a whole number", self.period, self.rate),
                "choose --period and --rate so that their product is whole",
            ));
        }
        if high_hz >= self.rate / 2.0 {
            return Err(UsageError::new(
                format!("--band ends at {high_hz} Hz, not below half of --rate {}", self.rate),
                "lower the upper end of --band, or raise --rate",
            ));
        }
        Ok(whole as usize)
    }
}
