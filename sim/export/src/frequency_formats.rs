//! Frequency responses as MATLAB, python-control and spreadsheets take them.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rotorlead_records::files::{MAT5_HEAD, MatVariable, mat5};

use super::frequency::{FrequencyResponses, MeasuredLine, TransferFunction};

/// How files of frequency responses start, in each format.
pub(super) const HEADS: [&str; 3] = [MAT5_HEAD, PYTHON_HEAD, CSV_HEAD];
const PYTHON_HEAD: &str = "# Frequency response by rotorlead: ";
const CSV_HEAD: &str = "frequency_hz,real,imaginary,magnitude,magnitude_low,magnitude_high,phase_deg,phase_low_deg,phase_high_deg,\
     coherence,model_real,model_imaginary";
/// Order of the Padé approximation of a dead time in Python. Chosen: its phase errs by less than 0.1 degrees to 2 / dead time, rad/s, far
/// above a rotor's corner.
const PADE_ORDER: u8 = 3;

impl FrequencyResponses {
    /// A MAT-file: `frd(S.response, S.frequency)` and `idfrd(S.response, S.frequency, 0, 'CovarianceData', S.covariance)` take it after
    /// `S = load(FILE)`; frequencies in rad/s.
    #[must_use]
    pub fn mat(&self) -> Vec<u8> {
        let count = self.lines.len();
        let column = |name, value: &dyn Fn(&MeasuredLine) -> f64| {
            let real = self.lines.iter().map(value).collect();
            MatVariable { name, dimensions: vec![count, 1], real, imaginary: None }
        };
        let row = |name, values: &[f64]| MatVariable {
            name,
            dimensions: vec![1, values.len()],
            real: values.to_vec(),
            imaginary: None,
        };
        // Parts of real and imaginary part, of which each has half and the two do not go together.
        let half: Vec<f64> = self.lines.iter().map(|line| 0.5 * line.variance).collect();
        let none = vec![0.0; count];
        let covariance = MatVariable {
            name: "covariance",
            dimensions: vec![1, 1, count, 2, 2],
            real: [&half[..], &none, &none, &half].concat(),
            imaginary: None,
        };
        let imaginary = Some(self.lines.iter().map(|line| line.imaginary).collect());
        let mut variables = vec![
            MatVariable { imaginary, ..column("response", &|line| line.real) },
            column("frequency", &|line| TAU * line.frequency_hz),
            covariance,
            column("coherence", &|line| line.coherence),
            row("nominal", &[self.nominal]),
            row("model_numerator", &self.model.numerator),
            row("model_denominator", &self.model.denominator),
            row("delay_s", &[self.model.delay_s]),
        ];
        if let Some(chain) = &self.chain {
            variables.push(row("chain_numerator", &chain.numerator));
            variables.push(row("chain_denominator", &chain.denominator));
        }
        mat5(&variables)
    }

    /// A Python module with `measured` (`control.FRD`), `model` and, with a compensator, `chain` (`control.tf`).
    #[must_use]
    pub fn python(&self) -> String {
        let list = |value: &dyn Fn(&MeasuredLine) -> String| {
            let rows = self.lines.iter().map(|line| format!("    {},\n", value(line)));
            format!("[\n{}]", rows.collect::<String>())
        };
        let transfer = |of: &TransferFunction| {
            let dead_time = if of.delay_s > 0.0 {
                format!(" * control.tf(*control.pade({:?}, {PADE_ORDER}))", of.delay_s)
            } else {
                String::new()
            };
            format!("control.tf({:?}, {:?}){dead_time}", of.numerator, of.denominator)
        };
        let mut text = format!(
            "{PYTHON_HEAD}{} per unit of command at {}, the mean of {}; holds of loop and ESC are divided out.\n\
             import control\n\n\
             # rad/s\n\
             omega = {}\n\
             response = {}\n\
             # Variance of real and imaginary part together, and the share of one period that follows the command.\n\
             variance = {}\n\
             coherence = {}\n\
             measured = control.FRD(response, omega)\n\
             model = {}\n",
            self.output,
            self.nominal,
            self.records.join(", "),
            list(&|line| format!("{:?}", TAU * line.frequency_hz)),
            list(&|line| format!("complex({:?}, {:?})", line.real, line.imaginary)),
            list(&|line| format!("{:?}", line.variance)),
            list(&|line| format!("{:?}", line.coherence)),
            transfer(&self.model),
        );
        if let Some(chain) = &self.chain {
            writeln!(text, "# The compensator as a continuous filter, and the model.\nchain = {}", transfer(chain))
                .expect("a string takes all");
        }
        text
    }

    /// A line of names, then one row a frequency; intervals cover with 95 %.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = String::from(CSV_HEAD);
        text += if self.chain.is_some() { ",chain_real,chain_imaginary\n" } else { "\n" };
        for line in &self.lines {
            let (magnitude, phase) = line.polar();
            let (model, chain) = (Some(&self.model), self.chain.as_ref());
            let responses = [model, chain].into_iter().flatten().map(|of| of.response(TAU * line.frequency_hz));
            let mut row = vec![line.frequency_hz, line.real, line.imaginary, magnitude];
            row.extend([line.magnitude_interval.0, line.magnitude_interval.1, phase]);
            row.extend([line.phase_interval_deg.0, line.phase_interval_deg.1, line.coherence]);
            row.extend(responses.flat_map(|(re, im)| [re, im]));
            let row: Vec<String> = row.iter().map(f64::to_string).collect();
            text += &(row.join(",") + "\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> FrequencyResponses {
        let line = |frequency_hz| MeasuredLine {
            frequency_hz,
            real: 3.0,
            imaginary: -4.0,
            variance: 0.5,
            coherence: 0.99,
            magnitude_interval: (4.5, 5.5),
            phase_interval_deg: (-54.0, -52.0),
        };
        let transfer = |delay_s| TransferFunction { numerator: vec![10.0], denominator: vec![0.1, 1.0], delay_s };
        FrequencyResponses {
            nominal: 0.5,
            output: "thrust_n",
            records: vec![String::from("one.csv")],
            lines: vec![line(1.0), line(2.0), line(4.0)],
            model: transfer(0.004),
            chain: Some(transfer(0.0)),
        }
    }

    #[test]
    fn rows_of_csv_are_numbers_under_as_many_names() {
        let text = found().csv();
        let mut lines = text.lines();
        let names = lines.next().unwrap().split(',').count();
        for line in lines {
            let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
            assert_eq!((numbers.len(), numbers[3]), (names, 5.0), "{line}");
        }
        assert_eq!(text.lines().count(), 4);
    }

    #[test]
    fn python_has_a_response_and_transfer_functions() {
        let text = found().python();
        for part in [
            "import control\n",
            "    complex(3.0, -4.0),\n",
            "measured = control.FRD(response, omega)\n",
            "model = control.tf([10.0], [0.1, 1.0]) * control.tf(*control.pade(0.004, 3))\n",
            "chain = control.tf([10.0], [0.1, 1.0])\n",
        ] {
            assert!(text.contains(part), "no {part} in {text}");
        }
    }
}
