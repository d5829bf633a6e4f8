//! A motor's frequency response at one nominal command: as its multisines show it, and that of its model, alone and behind a compensator.

use std::f64::consts::TAU;

use rotorlead_identify::frequency_response::etfe::ResponsePoint;
use rotorlead_identify::frequency_response::{FrequencyResponse, ResponseLine};
use rotorlead_identify::identification::{IdentifyOptions, Lags, identify};
use rotorlead_identify::lag::multisine::{NominalIdentification, RecordResponse};
use rotorlead_identify::validate::same_output;
use rotorlead_plant::{CompensatorDesign, Lag, Model};
use rotorlead_records::{Excitation, Experiment};
use serde::Serialize;

/// Nominal commands closer than this are one.
const SAME_NOMINAL: f64 = rotorlead_identify::lag::steps::SAME_LEVEL;
/// Frequencies closer than this share are one line of two records. Chosen: far below the spacing of lines, far above rounding.
const SAME_FREQUENCY: f64 = 1e-9;

/// Measured and modeled frequency responses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrequencyResponses {
    /// The nominal command, 0..1.
    pub nominal: f64,
    /// What is measured: `thrust_n` in newtons, `rpm` in revolutions per minute; per unit of command.
    pub output: &'static str,
    /// The records that the lines are the mean of.
    pub records: Vec<String>,
    /// The measured lines, by frequency.
    pub lines: Vec<MeasuredLine>,
    /// The model at the nominal command.
    pub model: TransferFunction,
    /// The same behind the compensator, where there is one.
    pub chain: Option<TransferFunction>,
}

/// One measured line; intervals cover with 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeasuredLine {
    /// Frequency, hertz.
    pub frequency_hz: f64,
    /// Real part of the response over the command.
    pub real: f64,
    /// Imaginary part.
    pub imaginary: f64,
    /// Variance of both parts together; each has half, and they do not go together.
    pub variance: f64,
    /// Share of the response's power in one period that follows the command, 0..1.
    pub coherence: f64,
    /// Interval of the magnitude.
    pub magnitude_interval: (f64, f64),
    /// Interval of the phase, degrees.
    pub phase_interval_deg: (f64, f64),
}

impl MeasuredLine {
    /// Magnitude, and phase in degrees.
    #[must_use]
    pub fn polar(&self) -> (f64, f64) {
        (self.real.hypot(self.imaginary), self.imaginary.atan2(self.real).to_degrees())
    }
}

/// A continuous transfer function with a dead time, for small signals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TransferFunction {
    /// Coefficients of the numerator, the highest power of s first.
    pub numerator: Vec<f64>,
    /// The same of the denominator.
    pub denominator: Vec<f64>,
    /// Dead time, seconds.
    pub delay_s: f64,
}

impl TransferFunction {
    fn from_lag(lag: Lag) -> Self {
        Self { numerator: vec![lag.gain], denominator: vec![lag.time_constant_s, 1.0], delay_s: lag.delay_s }
    }

    /// The same behind another one without a dead time.
    fn behind(&self, numerator: &[f64], denominator: &[f64]) -> Self {
        Self {
            numerator: product(&self.numerator, numerator),
            denominator: product(&self.denominator, denominator),
            delay_s: self.delay_s,
        }
    }

    /// Real and imaginary part at a frequency.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> (f64, f64) {
        // Horner's rule at j omega.
        let at = |coefficients: &[f64]| {
            coefficients
                .iter()
                .fold((0.0, 0.0), |(re, im), coefficient| (coefficient - im * omega_rad_s, re * omega_rad_s))
        };
        let ((a, b), (c, d)) = (at(&self.numerator), at(&self.denominator));
        let square = c * c + d * d;
        let (re, im) = ((a * c + b * d) / square, (b * c - a * d) / square);
        let (sin, cos) = (-omega_rad_s * self.delay_s).sin_cos();
        (re * cos - im * sin, re * sin + im * cos)
    }
}

fn product(one: &[f64], other: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; one.len() + other.len() - 1];
    for (i, a) in one.iter().enumerate() {
        for (j, b) in other.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}

impl FrequencyResponses {
    /// Of the multisines in `experiment` at the nominal command `at`, the middle one unless given. Holds of loop and ESC are divided out of them;
    /// records behind a compensator are left out.
    ///
    /// # Errors
    /// A sentence: that records or model have no response there, or the compensator no transfer function.
    pub fn new(
        model: &Model,
        experiment: &Experiment,
        compensator: Option<&CompensatorDesign>,
        at: Option<f64>,
    ) -> Result<Self, String> {
        let no_multisine = || String::from("the records have no multisine: record one, as `rotorlead excite` makes it");
        if experiment.records.iter().all(|record| record.excitation != Excitation::Multisine) {
            return Err(no_multisine());
        }
        same_output(experiment, model).map_err(|error| error.to_string())?;
        let found = identify(experiment, &IdentifyOptions::default()).map_err(|error| error.to_string())?;
        let Lags::Multisines(found) = &found.lags else { return Err(no_multisine()) };
        let nominals = &found.nominals;
        let chosen = match at {
            Some(at) => nominals.iter().find(|found| (found.nominal - at).abs() <= SAME_NOMINAL),
            None => nominals.get(nominals.len() / 2),
        };
        let NominalIdentification { nominal, responses, .. } = chosen.ok_or_else(|| {
            let known: Vec<String> = nominals.iter().map(|found| found.nominal.to_string()).collect();
            format!("multisines are at commands of {}: choose one of these with `--at`", known.join(", "))
        })?;
        let fitted: Vec<&RecordResponse> = responses.iter().filter(|response| response.used_in_fit).collect();
        let lag = model.at(*nominal).map_err(|error| error.to_string())?;
        let alone = TransferFunction::from_lag(lag);
        let chain = compensator
            .map(|compensator| {
                let lead = compensator.lead_at(*nominal).ok_or_else(|| {
                    format!("the compensator is not in the path at a command of {nominal}: choose another with `--at`")
                })?;
                // C(s) of the paper, eq. (3).
                let square = lead.omega_f_rad_s.powi(2);
                let denominator = [1.0, 2.0 * lead.damping * lead.omega_f_rad_s, square];
                Ok::<_, String>(alone.behind(&[square / lead.omega_z_rad_s, square], &denominator))
            })
            .transpose()?;
        Ok(Self {
            nominal: *nominal,
            output: experiment.output.column(),
            records: fitted.iter().map(|response| response.spectrum.file.clone()).collect(),
            lines: measured_lines(&fitted),
            model: alone,
            chain,
        })
    }
}

/// The mean of records at their lines, each weighted by its inverse variance; lines of one frequency are one.
fn measured_lines(records: &[&RecordResponse]) -> Vec<MeasuredLine> {
    let mut all: Vec<(ResponseLine, usize)> = Vec::new();
    for response in records {
        all.extend(response.actuator.raw().iter().map(|&ResponsePoint { omega_rad_s, response: ratio, variance }| {
            (ResponseLine { omega_rad_s, response: ratio, variance }, response.spectrum.periods_used)
        }));
    }
    all.sort_by(|a, b| a.0.omega_rad_s.total_cmp(&b.0.omega_rad_s));
    let mut joined: Vec<(ResponseLine, usize)> = Vec::new();
    for (line, periods) in all {
        match joined.last_mut().filter(|last| line.omega_rad_s < last.0.omega_rad_s * (1.0 + SAME_FREQUENCY)) {
            Some((mean, of)) => {
                let sum = mean.variance + line.variance;
                let share = if sum > 0.0 { mean.variance / sum } else { 0.5 };
                mean.response += (line.response - mean.response) * share;
                mean.variance *= 1.0 - share;
                *of += periods;
            }
            None => joined.push((line, periods)),
        }
    }
    let degrees_of_freedom = records
        .iter()
        .map(|response| FrequencyResponse::from_spectrum(&response.spectrum).degrees_of_freedom)
        .fold(f64::INFINITY, f64::min);
    let noise = FrequencyResponse { lines: Vec::new(), degrees_of_freedom, periods: 1 };
    let measured = |(line, periods): &(ResponseLine, usize)| {
        let power = line.response.norm_sqr();
        let (low, high) = noise.phase_interval_rad(line, 0.95);
        MeasuredLine {
            frequency_hz: line.omega_rad_s / TAU,
            real: line.response.re,
            imaginary: line.response.im,
            variance: line.variance,
            // The mean over periods has the variance of one over their number.
            coherence: power / (power + line.variance * *periods as f64),
            magnitude_interval: noise.magnitude_interval(line, 0.95),
            phase_interval_deg: (low.to_degrees(), high.to_degrees()),
        }
    };
    joined.iter().map(measured).collect()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Point;
    use rotorlead_plant::bench::{Plan, run};

    use super::*;

    fn motor(gain: f64, delay_s: f64) -> Model {
        let point = Point::new(0.5, Lag { gain, time_constant_s: 0.1, delay_s });
        Model {
            format: 1,
            points: vec![point],
            static_map: None,
            time_constant_curve: None,
            effects: Vec::new(),
            provenance: None,
        }
    }

    #[test]
    fn a_transfer_function_is_that_of_the_lag_and_of_the_lead() {
        let lag = motor(10.0, 0.004).at(0.5).unwrap();
        let alone = TransferFunction::from_lag(lag);
        let chain = alone.behind(&[4.0, 9.0], &[1.0, 2.0, 9.0]);
        assert_eq!(chain.numerator, [40.0, 90.0]);
        for omega in [0.1_f64, 3.0, 50.0] {
            let (re, im) = alone.response(omega);
            let expected = lag.frequency_response(omega);
            assert!((re - expected.re).hypot(im - expected.im) < 1e-12, "{omega}");
            let magnitude =
                81.0_f64.mul_add(1.0, (4.0 * omega).powi(2)).sqrt() / (9.0 - omega * omega).hypot(2.0 * omega);
            let (a, b) = chain.response(omega);
            assert!((a.hypot(b) / re.hypot(im) - magnitude).abs() < 1e-12, "{omega}");
        }
    }

    #[test]
    fn the_multisines_of_a_stand_show_its_motor_within_the_intervals() {
        let motor = motor(10.0, 0.0);
        let plan = Plan { loop_rate_hz: 500, sample_rate_hz: 500, esc_frame_hz: None, ..Plan::paper(&motor) };
        let stand = run(&plan, &motor, None, &|_| ()).unwrap();
        let found = FrequencyResponses::new(&motor, &stand, None, None).unwrap();
        assert_eq!((found.nominal, found.chain.as_ref()), (0.5, None));
        let covered = found.lines.iter().filter(|line| {
            let (re, im) = found.model.response(TAU * line.frequency_hz);
            (line.magnitude_interval.0..=line.magnitude_interval.1).contains(&re.hypot(im))
        });
        let (covered, lines) = (covered.count(), found.lines.len());
        // Chosen: 95 % of them less four standard deviations.
        let least = 0.95 * lines as f64 - 4.0 * (0.95 * 0.05 * lines as f64).sqrt();
        assert!(lines > 20 && covered as f64 >= least, "{covered} of {lines}");
        assert!(found.lines.windows(2).all(|pair| pair[0].frequency_hz < pair[1].frequency_hz));
        assert!(found.lines.iter().all(|line| (0.0..=1.0).contains(&line.coherence)));
        let elsewhere = FrequencyResponses::new(&motor, &stand, None, Some(0.3)).unwrap_err();
        assert!(elsewhere.contains("commands of 0.5") && elsewhere.contains("`--at`"), "{elsewhere}");
    }
}
