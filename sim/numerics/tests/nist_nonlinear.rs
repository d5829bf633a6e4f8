//! The solver against the Statistical Reference Datasets for nonlinear regression of the National Institute of Standards and
//! Technology: <https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml>, files `Misra1a.dat`, `Lanczos3.dat` (lower
//! difficulty), `MGH17.dat` (average), `MGH09.dat`, `MGH10.dat`, `Thurber.dat`, `BoxBOD.dat` and `Eckerle4.dat` (higher). All
//! data, starts and certified values are theirs.

mod nist_data;

use nalgebra::{DMatrix, DVector};
use nist_data::{Problem, problems};
use rotorlead_numerics::least_squares::{
    Damping, Decrease, NormalEquations, Residuals, Solution, StoppingCriteria, Strategy, minimize, search,
};
use rotorlead_numerics::normal_equations::scaled_inverse;

/// Until nothing is gained beyond rounding, so that the certified digits are reached.
const LIMITS: StoppingCriteria = StoppingCriteria { iterations: 10_000, decrease: 1e-15 };

impl Residuals for Problem {
    fn count(&self) -> usize {
        self.data.len()
    }

    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
        for (residual, (y, x)) in out.iter_mut().zip(self.data) {
            *residual = (self.model)(parameters, *x) - y;
        }
        out.iter().all(|residual| residual.is_finite())
    }

    fn typical(&self, index: usize) -> f64 {
        // None of them comes near zero.
        1e-6 * self.certified[index].0.abs()
    }
}

fn problem(name: &str) -> Problem {
    problems().into_iter().find(|problem| problem.name == name).expect("a problem of the list")
}

fn solved(problem: &Problem, start: &[f64]) -> Solution {
    let solution = minimize(problem, start, LIMITS).expect("the model is defined at NIST's starts");
    assert!(solution.converged, "{} from {start:?}: {solution:?}", problem.name);
    solution
}

/// Whether parameters, standard deviations and residual sum of squares have the certified digits.
fn agrees(problem: &Problem, parameters: &[f64], sum_of_squares: f64, unit_covariance: &DMatrix<f64>) {
    let check = |what: &str, value: f64, certified: f64, most: f64| {
        let difference = (value / certified - 1.0).abs();
        assert!(difference < most, "{}, {what}: {value} is {difference:.1e} from {certified}", problem.name);
    };
    check("sum of squares", sum_of_squares, problem.sum_of_squares, 1e-9);
    let variance = sum_of_squares / (problem.data.len() - parameters.len()) as f64;
    for (index, (value, std)) in problem.certified.iter().enumerate() {
        check(&format!("b{}", index + 1), parameters[index], *value, 1e-6);
        check(&format!("std of b{}", index + 1), (unit_covariance[(index, index)] * variance).sqrt(), *std, 1e-6);
    }
}

fn agrees_from(problem: &Problem, start: &[f64]) {
    let solution = solved(problem, start);
    let covariance = solution.unit_covariance.as_ref().expect("the data determine all parameters");
    agrees(problem, &solution.parameters, solution.sum_of_squares, covariance);
    // Independent residuals of equal variance are a special case of the general covariance.
    let general = solution.covariance_with(&solution.jacobian).expect("there is a covariance");
    for index in 0..start.len() {
        assert!((general[(index, index)] / covariance[(index, index)] - 1.0).abs() < 1e-5, "{}", problem.name);
    }
}

fn agrees_from_both_starts(name: &str) {
    let problem = problem(name);
    problem.starts.iter().for_each(|start| agrees_from(&problem, start));
}

#[test]
fn misra1a() {
    agrees_from_both_starts("Misra1a");
}

#[test]
fn lanczos3() {
    agrees_from_both_starts("Lanczos3");
}

#[test]
fn mgh17() {
    agrees_from_both_starts("MGH17");
}

#[test]
fn mgh09() {
    agrees_from_both_starts("MGH09");
}

#[test]
fn mgh10() {
    agrees_from_both_starts("MGH10");
}

#[test]
fn thurber() {
    agrees_from_both_starts("Thurber");
}

#[test]
fn eckerle4() {
    agrees_from_both_starts("Eckerle4");
}

/// From the first start a full step leads to where `exp(-b2 x)` vanishes at all points: `b2` has no effect there, which the
/// missing covariance says.
#[test]
fn boxbod_from_its_second_start_and_from_the_first_one_no_covariance() {
    let problem = problem("BoxBOD");
    agrees_from(&problem, problem.starts[1]);
    let lost = solved(&problem, problem.starts[0]);
    assert!(lost.unit_covariance.is_none() && lost.sum_of_squares > problem.sum_of_squares, "{lost:?}");
}

/// The normal equations of a problem, summed up row by row: no Jacobian is stored.
struct Streamed<'a>(&'a Problem);

struct Sums {
    matrix: DMatrix<f64>,
}

struct Place {
    parameters: Vec<f64>,
    sum: f64,
    gradient: DVector<f64>,
}

impl Streamed<'_> {
    /// Residual and derivatives of one row.
    fn row(&self, parameters: &[f64], (y, x): (f64, f64)) -> (f64, DVector<f64>) {
        let derivative = |index: usize, p: f64| {
            let step = f64::EPSILON.cbrt() * p.abs();
            let at = |moved: f64| {
                let mut all = parameters.to_vec();
                all[index] = moved;
                (self.0.model)(&all, x)
            };
            (at(p + step) - at(p - step)) / (2.0 * step)
        };
        let all = parameters.iter().enumerate().map(|(index, p)| derivative(index, *p));
        ((self.0.model)(parameters, x) - y, DVector::from_iterator(parameters.len(), all))
    }

    fn place(&self, parameters: Vec<f64>) -> Place {
        let mut place = Place { sum: 0.0, gradient: DVector::zeros(parameters.len()), parameters };
        for row in self.0.data {
            let (residual, derivatives) = self.row(&place.parameters, *row);
            place.sum += residual * residual;
            place.gradient += derivatives * residual;
        }
        place
    }
}

impl NormalEquations for Streamed<'_> {
    type Point = Place;
    type Linearization = Sums;

    fn linearize(&self, at: &mut Place) -> Option<Sums> {
        let mut matrix = DMatrix::zeros(at.parameters.len(), at.parameters.len());
        for row in self.0.data {
            let (_, derivatives) = self.row(&at.parameters, *row);
            matrix += &derivatives * derivatives.transpose();
        }
        Some(Sums { matrix })
    }

    fn matrix<'a>(&self, linearization: &'a Sums) -> &'a DMatrix<f64> {
        &linearization.matrix
    }

    fn moved(&self, from: &Place, step: &DVector<f64>, _: &Sums) -> Option<Place> {
        Some(self.place(from.parameters.iter().zip(step.iter()).map(|(at, step)| at + step).collect()))
    }

    fn sum_of_squares(&self, at: &Place) -> f64 {
        at.sum
    }

    fn gradient(&self, at: &Place, _: &Sums) -> DVector<f64> {
        at.gradient.clone()
    }
}

/// Every way to damp, with Jacobians that serve for several steps, comes to the same from the nearer start.
#[test]
fn streamed_normal_equations_and_jacobians_that_serve_on_reach_the_certified_values() {
    for damping in [Damping::GainRatio, Damping::Factors] {
        for reuses_jacobian in [false, true] {
            let strategy = Strategy {
                iterations: LIMITS.iterations,
                decrease: Decrease::Relative(LIMITS.decrease),
                damping,
                reuses_jacobian,
            };
            for problem in &problems() {
                let model = Streamed(problem);
                let mut found = search(&model, model.place(problem.starts[1].to_vec()), &strategy).unwrap();
                assert!(found.converged, "{} by {strategy:?}", problem.name);
                let matrix = model.linearize(&mut found.at).unwrap().matrix;
                agrees(problem, &found.at.parameters, found.at.sum, &scaled_inverse(&matrix, 0.0).unwrap());
            }
        }
    }
}
