//! Explain: one effect, calibrated on one column of bandwidths, with what it predicts of both.

use rotorlead_identify::Estimate;
use rotorlead_numerics::least_squares::{Limits, Residuals, Solution, minimize};
use rotorlead_plant::effect::{Kind, Linearity, Parameter};
use serde::Serialize;

use super::case::{Case, Row};
use super::free_parameter::{FreeParameter, first_values, free_parameters};
use super::likelihood::Likelihood;
use super::table::Column;

/// InitialCondition that are searched on from, the best of all.
const SEARCHES: usize = 2;
/// When a search ends: a bandwidth is known to four digits at best.
const LIMITS: Limits = Limits { iterations: 30, decrease: 1e-9 };
/// Steps between which a bandwidth is looked for over a parameter's range.
const STEPS: u32 = 24;
/// Halvings of the step that has it.
const HALVINGS: u32 = 40;
/// `|ln(measured / predicted)|` of a number that reproduces a bandwidth.
const REPRODUCED: f64 = 1e-6;
/// What leaves more than this part of the sum of squares does not bring the model nearer.
const NO_NEARER: f64 = 0.99;

/// For which nominal commands a calibrated number holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// One for all.
    All,
    /// Another one at each.
    Each,
}

/// What stands of an explanation after all were calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It is named.
    Chosen,
    /// The fitted column cannot tell it from the one that is named.
    Alternative,
    /// The fitted column speaks against it.
    Worse,
}

impl Standing {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Chosen => "chosen",
            Self::Alternative => "alternative",
            Self::Worse => "worse",
        }
    }
}

/// An effect that moves bandwidths, with the numbers that bring it nearest to the fitted column.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// What it is.
    pub kind: &'static Kind,
    /// Whether its size is one number for all nominal commands.
    pub scope: Scope,
    /// How many numbers were calibrated.
    pub numbers: usize,
    /// All values of the kind's parameters, for each row of the table; `None` at a row that the fitted column leaves empty,
    /// for an explanation with a number at each.
    pub values: Vec<Option<Vec<f64>>>,
    /// What was calibrated, for an explanation with one number for all: the first is its size.
    pub parameters: Vec<(&'static Parameter, Estimate)>,
    /// RMS of `ln(measured / predicted)` over the fitted column.
    pub fitted_rms: f64,
    /// Gain of log likelihood over the fitted column. With as many numbers as data it says nothing.
    pub gain: f64,
    /// The same over the numbers' penalty; `None` with as many numbers as data.
    pub score: Option<f64>,
    /// Bandwidths without and with compensator, rad/s, for each row.
    pub predicted_rad_s: Vec<[Option<f64>; 2]>,
    /// RMS of `ln(measured / predicted)` over the held-out column; `None` where nothing is held out or a bandwidth is gone.
    pub held_out_rms: Option<f64>,
    /// What stands of it.
    pub standing: Standing,
}

impl Explanation {
    /// Its name among the explanations: the kind's identifier, with `_at_each` where its size is another at each nominal
    /// command.
    #[must_use]
    pub fn name(&self) -> String {
        match self.scope {
            Scope::All => self.kind.id.to_owned(),
            Scope::Each => format!("{}_at_each", self.kind.id),
        }
    }
}

/// A kind that can be no explanation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RuledOut {
    /// What it is.
    pub kind: &'static Kind,
    /// Why.
    pub reason: String,
}

/// Calibrates one kind: one number for all nominal commands, and one at each.
pub(super) fn explanations(
    case: &Case,
    likelihood: &Likelihood,
    kind: &'static Kind,
) -> Result<Vec<Explanation>, RuledOut> {
    let no = |reason: &str| Err(RuledOut { kind, reason: reason.to_owned() });
    if case.has(kind) {
        return no("in the model already");
    }
    if kind.linearity == Linearity::Absent {
        return no("no frequency response, so bandwidths say nothing of it");
    }
    let free_parameters = free_parameters(case, kind);
    let Some(size) = free_parameters.first() else {
        return no(match kind.linearity {
            Linearity::SmallSignal => "small deviations from u_nom are left alone",
            _ => "the magnitude is left alone, and with it every bandwidth",
        });
    };
    let all = for_all(case, likelihood, kind, &free_parameters);
    let shape = all.as_ref().and_then(|found| found.values.first().cloned().flatten());
    let each =
        at_each(case, likelihood, kind, size, free_parameters.len() - 1, &shape.unwrap_or_else(|| first_values(kind)));
    let left = |found: &Explanation| found.fitted_rms.powi(2) * likelihood.count as f64 / likelihood.before;
    let all = all.filter(|found| each.is_some() || left(found) < NO_NEARER);
    let found: Vec<Explanation> = all.into_iter().chain(each).collect();
    if found.is_empty() { no("no value brings the model nearer to the measurement") } else { Ok(found) }
}

/// `ln(predicted / measured)` over the fitted column, as a function of coordinates.
struct ChiSquare<'a> {
    case: &'a Case<'a>,
    kind: &'static Kind,
    free_parameters: &'a [FreeParameter],
    first: Vec<f64>,
}

impl ChiSquare<'_> {
    fn values(&self, coordinates: &[f64]) -> Vec<f64> {
        let mut values = self.first.clone();
        for (free_parameter, coordinate) in self.free_parameters.iter().zip(coordinates) {
            values[free_parameter.index] = free_parameter.value(*coordinate);
        }
        values
    }

    /// Every combination of the starts, as coordinates.
    fn starts(&self) -> Vec<Vec<f64>> {
        let mut starts = vec![Vec::new()];
        for free_parameter in self.free_parameters {
            let longer = |start: &Vec<f64>, value: &f64| {
                let mut start = start.clone();
                start.push(free_parameter.coordinate(*value));
                start
            };
            starts = starts
                .iter()
                .flat_map(|start| free_parameter.parameter.starts.iter().map(move |value| longer(start, value)))
                .collect();
        }
        starts
    }

    fn sum(&self, coordinates: &[f64]) -> f64 {
        let mut residuals = vec![0.0; self.count()];
        if self.evaluate(coordinates, &mut residuals) { residuals.iter().map(|r| r * r).sum() } else { f64::INFINITY }
    }
}

impl Residuals for ChiSquare<'_> {
    fn count(&self) -> usize {
        self.case.fitted_rows().count()
    }

    fn evaluate(&self, coordinates: &[f64], out: &mut [f64]) -> bool {
        let inside = |(free_parameter, at): (&FreeParameter, &f64)| {
            (free_parameter.range.0..=free_parameter.range.1).contains(at)
        };
        if !self.free_parameters.iter().zip(coordinates).all(inside) {
            return false;
        }
        let values = self.values(coordinates);
        out.iter_mut().zip(self.case.fitted_rows()).all(|(out, row)| {
            let chi_square = chi_square(self.case, row, self.kind, &values);
            *out = chi_square.unwrap_or(f64::NAN);
            chi_square.is_some()
        })
    }
}

/// `ln(predicted / measured)` in the fitted column.
fn chi_square(case: &Case, row: &Row, kind: &'static Kind, values: &[f64]) -> Option<f64> {
    let predicted = case.predicted(row, case.fitted, kind, values)?;
    Some((predicted / row.measured[case.fitted as usize]?).ln())
}

/// One value of each parameter for all nominal commands, by least squares; `None` where there are as many of them as data.
fn for_all(
    case: &Case,
    likelihood: &Likelihood,
    kind: &'static Kind,
    free_parameters: &[FreeParameter],
) -> Option<Explanation> {
    let numbers = free_parameters.len();
    if likelihood.count <= numbers {
        return None;
    }
    let chi_square = ChiSquare { case, kind, free_parameters, first: first_values(kind) };
    let mut starts: Vec<(f64, Vec<f64>)> =
        chi_square.starts().into_iter().map(|start| (chi_square.sum(&start), start)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let solutions = starts.iter().take(SEARCHES).filter_map(|(_, start)| minimize(&chi_square, start, LIMITS));
    let best = solutions.min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares))?;
    let values = chi_square.values(&best.parameters);
    let parameters = free_parameters.iter().enumerate().map(|(index, free_parameter)| {
        let estimate = estimate(&best, index, free_parameter, values[free_parameter.index], likelihood);
        (free_parameter.parameter, estimate)
    });
    let parameters = parameters.collect();
    let values = vec![Some(values); case.rows.len()];
    let score = likelihood.gain(best.sum_of_squares) - likelihood.penalty(numbers);
    Some(Explanation {
        parameters,
        score: Some(score),
        ..explained(case, likelihood, kind, Scope::All, numbers, values)
    })
}

/// A calibrated value with the standard error that the known noise, or what is left, gives it.
fn estimate(
    best: &Solution,
    index: usize,
    free_parameter: &FreeParameter,
    value: f64,
    likelihood: &Likelihood,
) -> Estimate {
    let rest = (likelihood.count - best.parameters.len()) as f64;
    let (variance, dof) = match likelihood.accuracy {
        Some(std) => (std * std, f64::INFINITY),
        None => (best.sum_of_squares / rest, rest),
    };
    let unit = best.unit_covariance.as_ref().map_or(f64::INFINITY, |covariance| covariance[(index, index)]);
    Estimate { value, std: (unit * variance).sqrt() * free_parameter.slope(value), dof }
}

/// A size at each nominal command that reproduces its bandwidth, the other values as given; `None` where one cannot be
/// reproduced.
fn at_each(
    case: &Case,
    likelihood: &Likelihood,
    kind: &'static Kind,
    size: &FreeParameter,
    others: usize,
    shape: &[f64],
) -> Option<Explanation> {
    let mut values = Vec::new();
    for row in &case.rows {
        let is_fitted = row.measured[case.fitted as usize].is_some();
        values.push(if is_fitted { Some(reproducing(case, row, kind, size, shape)?) } else { None });
    }
    Some(explained(case, likelihood, kind, Scope::Each, likelihood.count + others, values))
}

/// The values with the size, nearest to none, that reproduces a bandwidth.
fn reproducing(case: &Case, row: &Row, kind: &'static Kind, size: &FreeParameter, shape: &[f64]) -> Option<Vec<f64>> {
    let values = |coordinate: f64| {
        let mut values = shape.to_vec();
        values[size.index] = size.value(coordinate);
        values
    };
    let chi_square = |coordinate: f64| chi_square(case, row, kind, &values(coordinate));
    let (low, high) = size.range;
    let step = |index: u32| low + (high - low) * f64::from(index) / f64::from(STEPS);
    let null = size.coordinate(size.parameter.null);
    let mut brackets = Vec::new();
    let mut before = (step(0), chi_square(step(0)));
    for index in 1..=STEPS {
        let here = (step(index), chi_square(step(index)));
        if let (Some(a), Some(b)) = (before.1, here.1)
            && (a <= 0.0) != (b <= 0.0)
        {
            brackets.push((before.0, here.0, a <= 0.0));
        }
        before = here;
    }
    // A null value at infinity is nearest to the end of the range.
    let distance = |bracket: &(f64, f64, bool)| (bracket.0 - null.clamp(low, high)).abs();
    brackets.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    brackets.into_iter().find_map(|(mut from, mut to, rising)| {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (from + to);
            if (chi_square(middle)? <= 0.0) == rising { from = middle } else { to = middle }
        }
        // A bandwidth may jump past the measured one.
        (chi_square(to)?.abs() < REPRODUCED).then(|| values(to))
    })
}

/// What calibrated values predict.
fn explained(
    case: &Case,
    likelihood: &Likelihood,
    kind: &'static Kind,
    scope: Scope,
    numbers: usize,
    values: Vec<Option<Vec<f64>>>,
) -> Explanation {
    let predicted_rad_s: Vec<[Option<f64>; 2]> = case
        .rows
        .iter()
        .zip(&values)
        .map(|(row, values)| {
            Column::ALL.map(|column| values.as_ref().and_then(|values| case.predicted(row, column, kind, values)))
        })
        .collect();
    let left = |(index, row): (usize, &Row), column: Column| {
        let measured = row.measured[column as usize]?;
        Some((measured / predicted_rad_s[index][column as usize]?).ln().powi(2))
    };
    let fitted = case.rows.iter().enumerate().filter_map(|row| left(row, case.fitted)).sum::<f64>();
    let held_out: Option<Vec<f64>> = case.held_out_rows().map(|row| left(row, case.fitted.other())).collect();
    let held_out = held_out.filter(|squares| !squares.is_empty());
    Explanation {
        kind,
        scope,
        numbers,
        values,
        parameters: Vec::new(),
        fitted_rms: (fitted / likelihood.count as f64).sqrt(),
        gain: likelihood.gain(fitted),
        score: None,
        predicted_rad_s,
        held_out_rms: held_out.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()),
        standing: Standing::Worse,
    }
}
