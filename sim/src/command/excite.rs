//! `rotorlead excite`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::Diagnostic as _;
use serde_json::json;

use super::WrongUse;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{fraction, positive, range};
use super::progress;
use crate::bench::multisine::{LineSet, Search, optimize};
use crate::files::{check_writable, write_file};

/// The longest period, in samples: more than an hour at 5 kHz is a slip of the decimal point.
const MOST_SAMPLES: f64 = 2e7;

/// Designs a sum of sinusoids with a low crest factor
///
/// Lines of equal amplitude at the odd multiples of 1/period within the band: the even lines and the odd ones that are
/// left out then show what is not linear. The phases are searched for, from Schroeder's, so that the peak is low for
/// the power. The signal starts and ends at zero.
#[derive(Args, Debug)]
pub struct Excite {
    /// Band in hertz
    #[arg(long, value_name = "LOW..HIGH", default_value = "0.1..30", value_parser = range, allow_hyphen_values = true)]
    band: (f64, f64),
    /// Period in seconds; the lines are 2/period apart
    #[arg(long, value_name = "S", default_value = "10", value_parser = positive, allow_hyphen_values = true)]
    period: f64,
    /// Rate of the samples in hertz
    #[arg(long, value_name = "HZ", default_value = "5000", value_parser = positive, allow_hyphen_values = true)]
    rate: f64,
    /// Command around which it runs, 0..1
    #[arg(long, value_name = "U", default_value = "0.5", value_parser = fraction, allow_hyphen_values = true)]
    nominal: f64,
    /// Peak deviation of the command
    #[arg(long, value_name = "U", default_value = "0.05", value_parser = fraction, allow_hyphen_values = true)]
    amplitude: f64,
    /// Seed of the search's starts
    #[arg(long, default_value = "1", allow_negative_numbers = true)]
    seed: u64,
    /// Starts of the search; more may find a lower crest factor
    #[arg(long, default_value = "3", value_parser = clap::value_parser!(u32).range(1..=1000))]
    starts: u32,
    /// Write one period as CSV: time_s, command
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Excite {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let (low_hz, high_hz) = self.band;
        if self.nominal - self.amplitude < 0.0 || self.nominal + self.amplitude > 1.0 {
            return Err(WrongUse::new(
                format!(
                    "--nominal {} with --amplitude {} leaves the command's range 0..1",
                    self.nominal, self.amplitude
                ),
                "lower --amplitude, or move --nominal away from the end",
            )
            .into());
        }
        let samples = self.samples(high_hz)?;
        let lines = LineSet::odd_in_band(low_hz, high_hz, self.period).map_err(|error| {
            let help = error.help().map(|help| help.to_string()).unwrap_or_default();
            WrongUse::new(format!("--band {low_hz}..{high_hz} with --period {}: {error}", self.period), help)
        })?;
        if let Some(file) = &self.out {
            check_writable(file)?;
        }
        let bar = progress::bar("searching phases", 1);
        let search = Search { seed: self.seed, starts: self.starts };
        let multisine = optimize(&lines, &search, |progress| {
            bar.set_length(progress.total as u64);
            bar.set_position(progress.done as u64);
        })?;
        bar.finish_and_clear();

        let crest_factor = multisine.crest_factor(samples);
        let hertz = |harmonic: u32| f64::from(harmonic) / self.period;
        let harmonics = lines.harmonics();
        let (first, last) = (harmonics[0], lines.top_harmonic());
        let line_amplitude = self.amplitude / multisine.peak();
        let mut text = format!(
            "{} lines from {} to {} Hz, {} Hz apart, period {} s\ncrest factor {crest_factor:.4}\n\
             amplitude of one line {line_amplitude:.3e} for a peak of {}\n",
            harmonics.len(),
            hertz(first),
            hertz(last),
            2.0 / self.period,
            self.period,
            self.amplitude
        );
        if let Some(file) = &self.out {
            let mut csv = String::from("time_s,command\n");
            for (k, value) in multisine.waveform(samples).iter().enumerate() {
                let command = self.nominal + line_amplitude * value;
                writeln!(csv, "{},{command}", k as f64 / self.rate).expect("a string takes all");
            }
            write_file(file, csv.as_bytes())?;
            writeln!(text, "One period, {samples} samples, written to {}", file.display()).expect("a string takes all");
        }
        let json = json!({
            "lines": harmonics.len(),
            "frequencies_hz": harmonics.iter().map(|&harmonic| hertz(harmonic)).collect::<Vec<_>>(),
            "phases_rad": multisine.phases_rad(),
            "period_s": self.period,
            "crest_factor": crest_factor,
            "line_amplitude": line_amplitude,
        });
        Ok(Outcome { text, json })
    }

    /// Samples in one period: a whole number, and enough for the highest line.
    fn samples(&self, high_hz: f64) -> Result<usize, WrongUse> {
        let samples = self.period * self.rate;
        if samples > MOST_SAMPLES {
            return Err(WrongUse::new(
                format!("--period {:?} at --rate {:?} is {samples:?} samples", self.period, self.rate),
                format!("shorten --period or lower --rate: {MOST_SAMPLES} samples are the most"),
            ));
        }
        let whole = samples.round();
        if (samples - whole).abs() > 1e-6 * whole.max(1.0) {
            return Err(WrongUse::new(
                format!("--period {} at --rate {} is {samples} samples, not a whole number", self.period, self.rate),
                "choose --period and --rate so that their product is whole",
            ));
        }
        if high_hz >= self.rate / 2.0 {
            return Err(WrongUse::new(
                format!("--band ends at {high_hz} Hz, not below half of --rate {}", self.rate),
                "lower the upper end of --band, or raise --rate",
            ));
        }
        Ok(whole as usize)
    }
}
