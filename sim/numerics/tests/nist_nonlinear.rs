//! The solver against the Statistical Reference Datasets for nonlinear regression of the National Institute of Standards and
//! Technology: <https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml>, files `Misra1a.dat`, `Lanczos3.dat` (lower
//! difficulty), `MGH17.dat` (average), `MGH09.dat`, `MGH10.dat`, `Thurber.dat`, `BoxBOD.dat` and `Eckerle4.dat` (higher). All data, starts
//! and certified values are theirs.

mod nist_data;

use nist_data::{Problem, problems};
use rotorlead_numerics::least_squares::{Limits, Residuals, minimize};

/// Until nothing is gained beyond rounding, so that the certified digits are reached.
const LIMITS: Limits = Limits { iterations: 10_000, decrease: 1e-15 };

struct Regression<'a> {
    problem: &'a Problem,
    start: &'a [f64],
}

impl Residuals for Regression<'_> {
    fn count(&self) -> usize {
        self.problem.data.len()
    }

    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
        for (residual, (y, x)) in out.iter_mut().zip(self.problem.data) {
            *residual = (self.problem.model)(parameters, *x) - y;
        }
        out.iter().all(|residual| residual.is_finite())
    }

    fn typical(&self, index: usize) -> f64 {
        // None of them comes near zero.
        1e-6 * self.start[index].abs()
    }
}

/// Both starts of a problem, to these relative differences of parameters, standard deviations and residual sum of squares.
fn agrees(name: &str) {
    let problem = problems().into_iter().find(|problem| problem.name == name).expect("a problem of the list");
    for start in problem.starts {
        let found = minimize(&Regression { problem: &problem, start }, start, LIMITS)
            .expect("the model is defined at NIST's starts");
        assert!(found.converged, "{name} from {start:?}: {found:?}");
        let differs = |what: &str, value: f64, certified: f64, most: f64| {
            let difference = (value / certified - 1.0).abs();
            println!("{name} {what} {difference:.1e} in {} steps", found.iterations);
            assert!(
                difference < most,
                "{name} from {start:?}, {what}: {value} differs from {certified} by {difference:.1e}"
            );
        };
        let variance = found.sum_of_squares / (problem.data.len() - start.len()) as f64;
        let covariance = found.unit_covariance.as_ref().expect("the data determine all parameters");
        differs("sum of squares", found.sum_of_squares, problem.sum_of_squares, 1e-9);
        for (index, (value, std)) in problem.certified.iter().enumerate() {
            differs(&format!("b{}", index + 1), found.parameters[index], *value, 1e-6);
            differs(&format!("sd of b{}", index + 1), (covariance[(index, index)] * variance).sqrt(), *std, 1e-6);
        }
    }
}

#[test]
fn misra1a() {
    agrees("Misra1a");
}

#[test]
fn lanczos3() {
    agrees("Lanczos3");
}

#[test]
fn mgh17() {
    agrees("MGH17");
}

#[test]
fn mgh09() {
    agrees("MGH09");
}

#[test]
fn mgh10() {
    agrees("MGH10");
}

#[test]
fn thurber() {
    agrees("Thurber");
}

#[test]
fn boxbod() {
    agrees("BoxBOD");
}

#[test]
fn eckerle4() {
    agrees("Eckerle4");
}
