//! The search for the largest likelihood.

use num_complex::Complex64;
use rotorlead_numerics::least_squares::{Solution, StoppingCriteria, minimize};

use super::ParametricError;
use super::data::WeightedLines;
use super::problem::SectionsProblem;
use super::sections::{Sections, group};
use super::start::{Start, start};
use super::structure::Structure;

/// The search ends when a step lowers chi-square, some hundreds, by less than this share: no parameter then moves by a
/// thousandth of its standard error. Chosen: a search that needs more than 200 steps is taken not to converge.
const LIMITS: StoppingCriteria = StoppingCriteria { iterations: 200, decrease: 1e-9 };

/// Roots start within this factor of the lowest and the highest line. Chosen: at its end a root changes a line by a thousandth, which the
/// search can still follow.
const REACH: f64 = 1e3;

/// The best model found.
#[derive(Clone, Debug)]
pub(super) struct BestFit {
    pub(super) sections: Sections,
    pub(super) solution: Solution,
}

/// Searches from the start of the linear method, with its unstable poles reflected into the left half plane, and again wherever real
/// roots have come to share sections with others than their neighbors.
pub(super) fn search(data: &WeightedLines, structure: Structure) -> Result<BestFit, ParametricError> {
    let failed = |reason| ParametricError::NoFit { poles: structure.poles, zeros: structure.zeros, reason };
    let start = start(data, structure).ok_or_else(|| failed("the linear method finds no start"))?;
    from(data, &start).ok_or_else(|| failed("the search does not settle"))
}

fn from(data: &WeightedLines, start: &Start) -> Option<BestFit> {
    let range = (data.omega_rad_s[0] / REACH, data.top_rad_s() * REACH);
    let run = |gain: f64, poles: &[Complex64], zeros: &[Complex64]| -> Option<BestFit> {
        let (sections, mut parameters) = Sections::from_roots(gain, poles, zeros, range);
        parameters[0] = best_gain(data, &sections, &parameters)?;
        let solution = minimize(&SectionsProblem { data, sections: &sections }, &parameters, LIMITS)?;
        solution.converged.then_some(BestFit { sections, solution })
    };
    let stable: Vec<Complex64> = start.poles.iter().map(|pole| Complex64::new(-pole.re.abs(), pole.im)).collect();
    let mut found = run(start.gain, &stable, &start.zeros)?;
    // Two real roots can become a complex pair only within a section. Where the search has moved the neighbor of a root
    // into another section, they are grouped anew. Chosen: three times; each ends where nothing is regrouped or gained, and a gain below
    // 1e-6 of chi-square is far under a standard error.
    for _ in 0..3 {
        let parameters = &found.solution.parameters;
        let (poles, zeros) = (found.sections.poles(parameters), found.sections.zeros(parameters));
        let as_grouped = |roots: &[Complex64], sections: &[super::sections::Section]| {
            let mut offset = 0;
            let old: Vec<Vec<Complex64>> = sections
                .iter()
                .map(|section| {
                    offset += section.order;
                    roots[offset - section.order..offset].to_vec()
                })
                .collect();
            group(roots).iter().all(|new| old.iter().any(|old| old == new || old.iter().rev().eq(new.iter())))
        };
        if as_grouped(&poles, &found.sections.denominator) && as_grouped(&zeros, &found.sections.numerator) {
            break;
        }
        match run(parameters[0], &poles, &zeros) {
            Some(again) if again.solution.sum_of_squares < found.solution.sum_of_squares * (1.0 - 1e-6) => {
                found = again;
            }
            _ => break,
        }
    }
    Some(found)
}

/// The gain of least chi-square with everything else as it is.
fn best_gain(data: &WeightedLines, sections: &Sections, parameters: &[f64]) -> Option<f64> {
    let (mut product, mut square) = (0.0, 0.0);
    for k in 0..data.len() {
        let model = sections.response(parameters, data.omega_rad_s[k]);
        let weight = data.weight[k].powi(2);
        product += weight * (data.response[k] * model.conj()).re;
        square += weight * model.norm_sqr();
    }
    let gain = parameters[0] * product / square;
    (gain.is_finite() && gain != 0.0).then_some(gain)
}
