//! How well each kind explains a case, by the generator's own chain and the noise that the generator knows.
//!
//! Each kind is fitted together with gain and time constant of every point by Gauss and Newton's method with
//! Levenberg's damping, from several starts; the log likelihood is Whittle's (see [`super::whiten`]). Only the thrust
//! counts. The chain runs with a coarser step than the one the data were made with, which a test shows to cost less
//! than one unit of log likelihood of the margin of five.

use super::case::{Case, Columns, logger_times};
use super::chain::{Chain, read_at};
use super::excitation::{ROWS, ROWS_HZ};
use super::kind::{Effect, Kind};
use super::motor::Motor;
use super::path::{Timing, means, pieces};
use super::setup::Setup;
use super::solve::solve;
use super::whiten::Spectrum;

/// Step of the chain in fits, in seconds.
pub const FIT_STEP_S: f64 = 0.5e-3;
/// How far beyond the plausible range a parameter may go in a fit.
const WIDER: f64 = 2.0;

/// A case's data, ready for fits.
pub struct Fitter<'a> {
    case: &'a Case,
    thrust_n: Vec<Vec<f64>>,
    weights: Vec<f64>,
    spectrum: Spectrum,
    step_s: f64,
    timings: Vec<Timing>,
    /// The commands at the rotor by record, with the part of the setup that they belong to: most changes in a fit are
    /// behind them.
    driven: Option<Driven>,
}

/// Commands at the rotor.
struct Driven {
    path: Setup,
    step_s: f64,
    means: Vec<Vec<f64>>,
}

/// A fitted kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Log likelihood but for a constant that all fits of a case share.
    pub log_likelihood: f64,
    /// Base parameters.
    pub motor: Motor,
    /// The effects with their fitted parameters.
    pub effects: Vec<Effect>,
}

/// Residual and what is needed for its derivatives, in whitened bins by record.
struct State {
    log_likelihood: f64,
    motor: Motor,
    effects: Vec<Effect>,
    model: Vec<Vec<f64>>,
    residual: Vec<Vec<f64>>,
}

impl<'a> Fitter<'a> {
    /// The data of `case`, `columns` by record.
    #[must_use]
    pub fn new(case: &'a Case, columns: &[Columns]) -> Self {
        Self::with_step(case, columns, FIT_STEP_S)
    }

    /// As [`Fitter::new`], with another step of the chain.
    #[must_use]
    pub fn with_step(case: &'a Case, columns: &[Columns], step_s: f64) -> Self {
        let exact = Timing::exact(ROWS, 1.0 / ROWS_HZ);
        Self {
            case,
            thrust_n: columns.iter().map(|columns| columns.thrust_n.clone()).collect(),
            weights: case.noise.weights(ROWS),
            spectrum: Spectrum::new(ROWS),
            step_s,
            // A fit does not know by how little each command was early or late, but it knows the frames.
            timings: case
                .runs
                .iter()
                .map(|run| Timing { frame_phase: run.timing.frame_phase, ..exact.clone() })
                .collect(),
            driven: None,
        }
    }

    /// The best fit with these kinds from the truth, where they are those of the case, and from several other starts.
    pub fn best(&mut self, kinds: &[Kind], frozen: Option<&Motor>) -> Fit {
        let mut starts = vec![Vec::new()];
        for kind in kinds {
            starts = starts
                .into_iter()
                .flat_map(|start: Vec<Effect>| {
                    kind_starts(*kind).into_iter().map(move |effect| {
                        let mut longer = start.clone();
                        longer.push(effect);
                        longer
                    })
                })
                .collect();
        }
        let truth: Vec<Effect> = kinds
            .iter()
            .filter_map(|kind| self.case.effects.iter().find(|effect| effect.kind == *kind).cloned())
            .collect();
        let base = frozen.unwrap_or(&self.case.motor).clone();
        let is_true = truth.len() == kinds.len();
        if is_true {
            starts = vec![truth];
        }
        let mut screened: Vec<State> =
            starts.into_iter().map(|effects| self.refine(base.clone(), effects, 1, frozen.is_some(), true)).collect();
        screened.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        screened.truncate(2);
        let mut best: Option<State> = None;
        for start in screened {
            let mut state = self.refine(start.motor, start.effects, 12, frozen.is_some(), false);
            if kinds.iter().any(|kind| is_jagged(*kind)) {
                state = self.search(state, frozen.is_some());
            }
            if best.as_ref().is_none_or(|best| state.log_likelihood > best.log_likelihood) {
                best = Some(state);
            }
        }
        let best = best.expect("at least one start");
        Fit { log_likelihood: best.log_likelihood, motor: best.motor, effects: best.effects }
    }

    /// The log likelihood of the chain as it was made, with its own parameters.
    pub fn at_truth(&mut self) -> f64 {
        let state = self.evaluate(self.case.motor.clone(), self.case.effects.clone());
        state.log_likelihood
    }

    fn evaluate(&mut self, motor: Motor, effects: Vec<Effect>) -> State {
        let mut motor = motor;
        // Thrust at rest: what is left of the mean. It matters where thrust and not only its deviation enters.
        for _ in 0..if needs_rest(&effects) { 2 } else { 1 } {
            let model = self.simulate(&motor, &effects);
            let mut shift = vec![(0.0, 0.0); motor.points.len()];
            for ((run, measured), model) in self.case.runs.iter().zip(&self.thrust_n).zip(&model) {
                let mean = measured.iter().zip(model).map(|(y, model)| y - model).sum::<f64>() / ROWS as f64;
                shift[run.point].0 += mean;
                shift[run.point].1 += 1.0;
            }
            if !needs_rest(&effects) {
                return self.state(motor, effects, model);
            }
            for (point, (sum, count)) in motor.points.iter_mut().zip(shift) {
                point.rest_n = (point.rest_n + sum / f64::max(count, 1.0)).max(0.05);
            }
        }
        let model = self.simulate(&motor, &effects);
        self.state(motor, effects, model)
    }

    fn state(&mut self, motor: Motor, effects: Vec<Effect>, model: Vec<Vec<f64>>) -> State {
        let mut residual = Vec::with_capacity(model.len());
        for (measured, model) in self.thrust_n.iter().zip(&model) {
            let off: Vec<f64> = measured.iter().zip(model).map(|(y, model)| y - model).collect();
            residual.push(self.spectrum.whitened(&off, &self.weights));
        }
        let log_likelihood = -residual.iter().flatten().map(|value| value * value).sum::<f64>();
        State { log_likelihood, motor, effects, model, residual }
    }

    fn simulate(&mut self, motor: &Motor, effects: &[Effect]) -> Vec<Vec<f64>> {
        let setup = Setup::of(effects, self.case.resistance_share);
        let path = setup.path();
        // A logger that reads between grid points sees where the grid rounds corners off.
        let step_s = if setup.skew_ppm == 0.0 { self.step_s } else { self.step_s / 2.0 };
        let driven = match self.driven.take() {
            Some(known) if known.path == path && known.step_s == step_s => known,
            _ => self.drive(path, step_s),
        };
        let forces = self.case.runs.iter().zip(&driven.means).map(|(run, means)| {
            let point = motor.points[run.point];
            let chain = Chain { point, setup: &setup, step_s };
            read_at(&chain.run(means).force_n, step_s, logger_times(&setup))
        });
        let forces = forces.collect();
        self.driven = Some(driven);
        forces
    }

    /// The means of each record's command at the rotor.
    fn drive(&self, path: Setup, step_s: f64) -> Driven {
        let steps = (ROWS as f64 / ROWS_HZ / step_s) as usize + (0.1 / step_s) as usize;
        let runs = self.case.runs.iter().zip(&self.timings);
        let means = runs
            .map(|(run, timing)| {
                let nominal = self.case.motor.points[run.point].nominal;
                means(&pieces(&run.commands, nominal, &path, timing), step_s, steps)
            })
            .collect();
        Driven { path, step_s, means }
    }

    /// Whitened derivative of the model by a change of parameters, `by` being the size of the change.
    fn derivative(&mut self, from: &State, motor: &Motor, effects: &[Effect], by: &[f64]) -> Vec<Vec<f64>> {
        let changed = self.simulate(motor, effects);
        let mut out = Vec::with_capacity(changed.len());
        for (index, (changed, model)) in changed.iter().zip(&from.model).enumerate() {
            let by = by[self.case.runs[index].point];
            let slope: Vec<f64> = changed.iter().zip(model).map(|(a, b)| (a - b) / by).collect();
            out.push(self.spectrum.whitened(&slope, &self.weights));
        }
        out
    }

    /// Damped Gauss-Newton steps until they gain less than 0.01. With `base_only` the effects stay as they are.
    fn refine(&mut self, motor: Motor, effects: Vec<Effect>, limit: usize, frozen: bool, base_only: bool) -> State {
        let mut state = self.evaluate(motor, effects);
        let mut damping = 1e-4;
        for _ in 0..limit {
            let mut free = if base_only { Vec::new() } else { free_parameters(&state.effects) };
            free.retain(|(index, _)| !is_jagged(state.effects[*index].kind));
            let Some((matrix, slope)) = self.normal_equations(&state, &free, frozen) else { return state };
            let mut gained = 0.0;
            for _ in 0..5 {
                let mut damped = matrix.clone();
                for (index, row) in damped.iter_mut().enumerate() {
                    row[index] = row[index] * (1.0 + damping) + 1e-9;
                }
                let Some(step) = solve(damped, slope.clone()) else { break };
                let (motor, effects) = moved(&state, &free, &step, frozen);
                let trial = self.evaluate(motor, effects);
                if trial.log_likelihood > state.log_likelihood {
                    gained = trial.log_likelihood - state.log_likelihood;
                    state = trial;
                    damping = (damping / 10.0_f64).max(1e-9);
                    break;
                }
                damping = (damping * 30.0).max(1e-3);
            }
            if gained < 0.01 {
                break;
            }
        }
        state
    }

    /// In the logarithms of gains and time constants, and in the effects' own scale (see [`shifted`]).
    fn normal_equations(
        &mut self,
        state: &State,
        free: &[(usize, usize)],
        frozen: bool,
    ) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
        const RELATIVE: f64 = 1e-4;
        let points = state.motor.points.len();
        let mut by_point: Vec<Vec<Vec<f64>>> = Vec::new();
        if !frozen {
            let mut motor = state.motor.clone();
            motor.points.iter_mut().for_each(|point| point.gain_n *= 1.0 + RELATIVE);
            by_point.push(self.derivative(state, &motor, &state.effects, &vec![RELATIVE; points]));
            let mut motor = state.motor.clone();
            motor.points.iter_mut().for_each(|point| point.time_constant_s *= 1.0 + RELATIVE);
            by_point.push(self.derivative(state, &motor, &state.effects, &vec![RELATIVE; points]));
        }
        let mut shared: Vec<Vec<Vec<f64>>> = Vec::new();
        for at in free {
            let effects = shifted(&state.effects, *at, RELATIVE);
            shared.push(self.derivative(state, &state.motor, &effects, &vec![RELATIVE; points]));
        }
        let own = by_point.len() * points;
        let size = own + shared.len();
        if size == 0 {
            return None;
        }
        let (mut matrix, mut slope) = (vec![vec![0.0; size]; size], vec![0.0; size]);
        for (record, run) in self.case.runs.iter().enumerate() {
            let columns: Vec<(usize, &[f64])> = by_point
                .iter()
                .enumerate()
                .map(|(index, column)| (index * points + run.point, column[record].as_slice()))
                .chain(shared.iter().enumerate().map(|(index, column)| (own + index, column[record].as_slice())))
                .collect();
            for (row, left) in &columns {
                slope[*row] += dot(left, &state.residual[record]);
                for (column, right) in columns.iter().filter(|(column, _)| column >= row) {
                    let product = dot(left, right);
                    matrix[*row][*column] += product;
                    if column > row {
                        matrix[*column][*row] += product;
                    }
                }
            }
        }
        Some((matrix, slope))
    }

    /// Parameters in which the likelihood is no smooth function: a pattern search down to steps of half a percent.
    fn search(&mut self, state: State, frozen: bool) -> State {
        let mut state = state;
        let mut jagged = free_parameters(&state.effects);
        jagged.retain(|(index, _)| is_jagged(state.effects[*index].kind));
        for (index, parameter) in jagged {
            let mut reach = 0.25;
            while reach > 0.004 {
                let mut moved = false;
                for part in [-reach, reach] {
                    let effects = shifted(&state.effects, (index, parameter), part);
                    let trial = self.refine(state.motor.clone(), effects, 1, frozen, true);
                    if trial.log_likelihood > state.log_likelihood {
                        state = trial;
                        moved = true;
                        break;
                    }
                }
                if !moved {
                    reach /= 2.5;
                }
            }
        }
        state
    }
}

/// Whether thrust itself, and not only its deviation from rest, enters the chain.
fn needs_rest(effects: &[Effect]) -> bool {
    effects.iter().any(|effect| matches!(effect.kind, Kind::OperatingPointLag | Kind::SupplySag | Kind::GainDrift))
}

/// Whether small changes of the parameter make jumps.
fn is_jagged(kind: Kind) -> bool {
    matches!(kind, Kind::EscFrameHold | Kind::DeadBand | Kind::Backlash | Kind::CommandQuantization | Kind::Saturation)
}

fn free_parameters(effects: &[Effect]) -> Vec<(usize, usize)> {
    let of = |(index, effect): (usize, &Effect)| (0..effect.values.len()).map(move |parameter| (index, parameter));
    let fitted = effects.iter().enumerate().filter(|(_, effect)| effect.kind != Kind::ParameterError);
    fitted.flat_map(of).collect()
}

/// Whether a parameter moves by parts of itself. The others, small numbers of either sign, move by parts of their range.
fn is_relative(effect: &Effect, parameter: usize) -> bool {
    let range = effect.kind.parameters()[parameter];
    range.logarithmic && !range.unsigned
}

/// The effects with one parameter moved by `part` of itself, or of its range.
fn shifted(effects: &[Effect], (index, parameter): (usize, usize), part: f64) -> Vec<Effect> {
    let mut effects = effects.to_vec();
    let effect = &mut effects[index];
    let relative = is_relative(effect, parameter);
    let range = effect.kind.parameters()[parameter];
    let value = &mut effect.values[parameter];
    if relative {
        *value = (*value * part.clamp(-1.0, 1.0).exp()).clamp(range.low / WIDER, range.high * WIDER);
    } else {
        let span = range.high - range.low;
        let (low, high) = match effect.kind {
            Kind::AsymmetricLag => (0.3, 3.0),
            Kind::Saturation => (0.3, 1.2),
            _ => (-range.high * WIDER, range.high * WIDER),
        };
        *value = (*value + part * span).clamp(low, high);
    }
    effects
}

fn moved(state: &State, free: &[(usize, usize)], step: &[f64], frozen: bool) -> (Motor, Vec<Effect>) {
    let points = state.motor.points.len();
    let mut motor = state.motor.clone();
    let own = if frozen { 0 } else { 2 * points };
    if !frozen {
        for (index, point) in motor.points.iter_mut().enumerate() {
            point.gain_n *= step[index].clamp(-1.0, 1.0).exp();
            point.time_constant_s *= step[points + index].clamp(-1.0, 1.0).exp();
        }
    }
    let mut effects = state.effects.clone();
    for (at, part) in free.iter().zip(&step[own..]) {
        effects = shifted(&effects, *at, *part);
    }
    (motor, effects)
}

fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(a, b)| a * b).sum()
}

/// Where a fit of a kind begins: parts of the range of each parameter.
fn kind_starts(kind: Kind) -> Vec<Effect> {
    let of = |parts: &[f64]| Effect {
        kind,
        values: kind.parameters().iter().zip(parts).map(|(parameter, part)| parameter.at(*part)).collect(),
    };
    let with = |values: &[f64]| Effect { kind, values: values.to_vec() };
    match kind {
        Kind::ParameterError => vec![of(&[0.5, 0.5])],
        Kind::CommandQuantization | Kind::Saturation | Kind::EscFrameHold => {
            (0..9).map(|index| of(&[f64::from(index) / 8.0])).collect()
        }
        Kind::DeadBand | Kind::Backlash => (0..6).map(|index| of(&[f64::from(index) / 5.0 - 0.3])).collect(),
        Kind::SlewLimit => (0..6).map(|index| of(&[f64::from(index) / 5.0])).collect(),
        Kind::TransportDelay | Kind::SecondPole => [0.2, 0.5, 0.8].map(|part| of(&[part])).to_vec(),
        Kind::AsymmetricLag => vec![with(&[1.05]), with(&[1.5])],
        Kind::OperatingPointLag | Kind::QuadraticThrust => vec![with(&[0.1]), of(&[0.5])],
        Kind::InflowLead => vec![with(&[1.6, 5e-3]), with(&[2.0, 10e-3]), with(&[0.75, 8e-3])],
        Kind::SupplySag => vec![with(&[0.05, 0.4]), with(&[0.05, 2.0])],
        Kind::GainDrift => vec![with(&[0.02, 12.0]), with(&[0.02, 40.0])],
        Kind::StandResonance => (0..7).map(|index| of(&[f64::from(index) / 6.0, 0.5, 0.3])).collect(),
        Kind::ClockSkew => vec![with(&[1.0]), with(&[300.0]), with(&[-300.0])],
    }
}

#[cfg(test)]
mod tests {
    use super::super::case::{Class, Set};
    use super::super::noise::Noise;
    use super::*;

    fn data(case: &Case) -> Vec<Columns> {
        (0..case.runs.len()).map(|index| case.record(index)).collect()
    }

    #[test]
    fn the_truth_explains_a_case_down_to_its_noise() {
        let case = Case::draw(Set::Tune, Class::Single(Kind::SecondPole), 1);
        let columns = data(&case);
        let mut fitter = Fitter::new(&case, &columns);
        let bins = fitter.weights.iter().filter(|weight| **weight > 0.0).count() * case.runs.len();
        // A sum of n exponential numbers: n +- sqrt(n), and a little of the hum that leaks past its notch.
        let off = -fitter.at_truth() / bins as f64 - 1.0;
        assert!(off.abs() < 0.02, "{off}");
    }

    #[test]
    fn the_step_of_fits_costs_less_than_a_unit_at_the_smallest_noise() {
        let kinds =
            [Kind::SlewLimit, Kind::EscFrameHold, Kind::OperatingPointLag, Kind::ClockSkew, Kind::StandResonance];
        for kind in kinds {
            let mut case = Case::draw(Set::Tune, Class::Single(kind), 0);
            // 0.2 % of the weakest motor's swing.
            case.noise = Noise::white(0.002 * 0.1 * 8.0);
            let columns = data(&case);
            let coarse = Fitter::new(&case, &columns).at_truth();
            let fine = Fitter::with_step(&case, &columns, 50e-6).at_truth();
            assert!((coarse - fine).abs() < 1.0, "{}: {}", kind.name(), coarse - fine);
        }
    }

    #[test]
    fn a_fit_finds_what_the_case_was_made_with() {
        let case = Case::draw(Set::Tune, Class::Single(Kind::TransportDelay), 0);
        let columns = data(&case);
        let fit = Fitter::new(&case, &columns).best(&[Kind::TransportDelay], None);
        assert!((fit.effects[0].values[0] - case.effects[0].values[0]).abs() < 0.5e-3);
        for (fitted, point) in fit.motor.points.iter().zip(&case.motor.points) {
            assert!((fitted.gain_n / point.gain_n - 1.0).abs() < 0.03);
            assert!((fitted.time_constant_s / point.time_constant_s - 1.0).abs() < 0.05);
        }
    }
}
