//! How well each kind explains a case, or some of its records.
//!
//! Each kind is fitted together with gain and time constant of every point by Gauss and Newton's method with
//! Levenberg's damping, from several starts.

use super::case::{Case, Columns};
use super::kind::{Effect, Kind};
use super::likelihood::{Likelihood, Normal, State, fit_step_s};
use super::motor::Motor;
use super::parameters::{free_parameters, is_jagged, kind_starts, shifted};
use super::setup::Setup;
use super::solve::solve;

/// A gain of log likelihood that is not worth a step.
const LITTLE: f64 = 0.01;
/// A promise of a gain that is not worth a try.
const HARDLY: f64 = 0.001;
/// Places in a frame over which a likelihood is averaged.
const PHASES: u32 = 32;
/// Levenberg's damping to begin with.
const FIRST_DAMPING: f64 = 1e-4;

/// Fits kinds to the data of a case.
pub struct Fitter<'a> {
    likelihood: Likelihood<'a>,
}

/// A fitted kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Log likelihood but for a constant that all fits to the same records share; with frames the mean over their phases.
    pub log_likelihood: f64,
    /// Its parts by record, in the order in which the records were chosen.
    pub by_record: Vec<f64>,
    /// Base parameters.
    pub motor: Motor,
    /// The effects with their fitted parameters.
    pub effects: Vec<Effect>,
}

impl<'a> Fitter<'a> {
    /// For all records of `case`, `columns` by record.
    #[must_use]
    pub fn new(case: &'a Case, columns: &[Columns]) -> Self {
        Self::with_step(case, columns, fit_step_s)
    }

    /// As [`Fitter::new`], with another step of the chain.
    #[must_use]
    pub fn with_step(case: &'a Case, columns: &[Columns], step_s: fn(&Setup) -> f64) -> Self {
        Self { likelihood: Likelihood::new(case, columns, step_s) }
    }

    /// From now on only these records are fitted, by their place in the case.
    pub fn choose(&mut self, records: &[usize]) {
        self.likelihood.choose(records);
    }

    /// The best fit with these kinds, those of the case from the truth and the others from several starts; also from
    /// `before`, which may be what was fitted to some of the records.
    pub fn best(&mut self, kinds: &[Kind], frozen: Option<&Motor>, before: Option<&[Effect]>) -> Fit {
        let case = self.likelihood.case();
        let mut starts = combinations(kinds, &case.effects);
        starts.extend(before.map(<[Effect]>::to_vec));
        let base = frozen.unwrap_or(&case.motor).clone();
        let mut screened: Vec<State> =
            starts.into_iter().map(|effects| self.settled(base.clone(), effects, frozen.is_some(), f64::MIN)).collect();
        screened.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        screened.truncate(2);
        let mut best: Option<State> = None;
        for start in screened {
            let mut state = self.refined(start.motor, start.effects, frozen.is_some());
            if kinds.iter().any(|kind| is_jagged(*kind)) {
                state = self.searched(state, frozen.is_some());
            }
            if best.as_ref().is_none_or(|best| state.log_likelihood > best.log_likelihood) {
                best = Some(state);
            }
        }
        let best = best.expect("at least one start");
        let mut fit = Fit {
            log_likelihood: best.log_likelihood,
            by_record: best.by_record,
            motor: best.motor,
            effects: best.effects,
        };
        if kinds.contains(&Kind::EscFrameHold) {
            self.average_over_phases(&mut fit);
        }
        fit
    }

    /// Takes the likelihood of a fit with frames as the mean over where the frames of each record lie: the generator draws
    /// that anew for each, as it draws the noise, and no record says it but by its thrust.
    fn average_over_phases(&mut self, fit: &mut Fit) {
        let by_phase: Vec<Vec<f64>> = (0..PHASES)
            .map(|phase| {
                self.likelihood.turn_frames(f64::from(phase) / f64::from(PHASES));
                self.likelihood.evaluate(fit.motor.clone(), fit.effects.clone(), true).by_record
            })
            .collect();
        self.likelihood.turn_frames(0.0);
        for (place, of_record) in fit.by_record.iter_mut().enumerate() {
            let highest = by_phase.iter().map(|records| records[place]).fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = by_phase.iter().map(|records| (records[place] - highest).exp()).sum();
            *of_record = highest + (sum / f64::from(PHASES)).ln();
        }
        fit.log_likelihood = fit.by_record.iter().sum();
    }

    /// The log likelihood of the chain as it was made, with its own parameters.
    pub fn at_truth(&mut self) -> f64 {
        let case = self.likelihood.case();
        self.likelihood.evaluate(case.motor.clone(), case.effects.clone(), true).log_likelihood
    }

    /// Damped Gauss-Newton steps until they gain less than [`LITTLE`].
    fn refined(&mut self, motor: Motor, effects: Vec<Effect>, frozen: bool) -> State {
        let mut state = self.likelihood.evaluate(motor, effects, frozen);
        let mut damping = FIRST_DAMPING;
        for _ in 0..12 {
            let mut free = free_parameters(&state.effects);
            free.retain(|(index, _)| !is_jagged(state.effects[*index].kind));
            let Some(better) = self.improved(&state, &free, frozen, &mut damping, HARDLY) else { break };
            let gained = better.log_likelihood - state.log_likelihood;
            state = better;
            if gained < LITTLE {
                break;
            }
        }
        state
    }

    /// These effects after one step of the base parameters, which gets them near their best. The step is spared where
    /// thrice what it promises would leave the likelihood below `floor`.
    fn settled(&mut self, motor: Motor, effects: Vec<Effect>, frozen: bool, floor: f64) -> State {
        let state = self.likelihood.evaluate(motor, effects, frozen);
        let worth = f64::max(HARDLY, (floor - state.log_likelihood) / 3.0);
        self.improved(&state, &[], frozen, &mut { FIRST_DAMPING }, worth).unwrap_or(state)
    }

    /// The state after one damped Gauss-Newton step of the base parameters and the `free` ones. `None` when no step is
    /// better, or the equations promise less than it is `worth`.
    fn improved(
        &mut self,
        state: &State,
        free: &[(usize, usize)],
        frozen: bool,
        damping: &mut f64,
        worth: f64,
    ) -> Option<State> {
        let mut normal = self.likelihood.normal_equations(state, free, frozen)?;
        // A parameter at its bound that would leave its range stays, and the others step without it.
        let own = normal.slope.len() - free.len();
        for (place, at) in free.iter().enumerate() {
            let outward = 1e-3 * normal.slope[own + place].signum();
            if shifted(&state.effects, *at, outward) == state.effects {
                normal.hold(own + place);
            }
        }
        let Normal { matrix, slope } = normal;
        for _ in 0..5 {
            let mut damped = matrix.clone();
            for (index, row) in damped.iter_mut().enumerate() {
                row[index] = row[index] * (1.0 + *damping) + 1e-9;
            }
            let step = solve(damped, slope.clone())?;
            // What a step without damping gains where the model is straight.
            let promised: f64 = step.iter().zip(&slope).map(|(step, slope)| step * slope).sum();
            if *damping <= 1e-3 && promised < worth {
                return None;
            }
            let (motor, effects) = moved(state, free, &step, frozen);
            let trial = self.likelihood.evaluate(motor, effects, frozen);
            if trial.log_likelihood > state.log_likelihood {
                *damping = (*damping / 10.0).max(1e-9);
                return Some(trial);
            }
            *damping = (*damping * 30.0).max(1e-3);
        }
        None
    }

    /// Parameters in which the likelihood is no smooth function: a pattern search down to steps of half a percent.
    fn searched(&mut self, state: State, frozen: bool) -> State {
        let mut state = state;
        let mut jagged = free_parameters(&state.effects);
        jagged.retain(|(index, _)| is_jagged(state.effects[*index].kind));
        for (index, parameter) in jagged {
            let mut reach = 0.25;
            while reach > 0.004 {
                let mut moved = false;
                for part in [-reach, reach] {
                    let effects = shifted(&state.effects, (index, parameter), part);
                    let trial = self.settled(state.motor.clone(), effects, frozen, state.log_likelihood);
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

/// Every combination of a start of each kind.
fn combinations(kinds: &[Kind], truth: &[Effect]) -> Vec<Vec<Effect>> {
    let mut starts = vec![Vec::new()];
    for kind in kinds {
        starts = starts
            .into_iter()
            .flat_map(|start: Vec<Effect>| {
                let known = truth.iter().find(|effect| effect.kind == *kind);
                known.map_or_else(|| kind_starts(*kind), |known| vec![known.clone()]).into_iter().map(move |effect| {
                    let mut longer = start.clone();
                    longer.push(effect);
                    longer
                })
            })
            .collect();
    }
    starts
}

/// The parameters after a step of the normal equations.
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
        let bins = fitter.likelihood.bins();
        // A sum of n exponential numbers: n +- sqrt(n), and a little of the hum that leaks past its notch.
        let off = -fitter.at_truth() / bins as f64 - 1.0;
        assert!(off.abs() < 0.02, "{off}");
    }

    #[test]
    fn the_step_of_fits_costs_less_than_a_unit_at_the_smallest_noise() {
        let kinds = [
            Kind::SlewLimit,
            Kind::EscFrameHold,
            Kind::AsymmetricLag,
            Kind::OperatingPointLag,
            Kind::SupplySag,
            Kind::GainDrift,
            Kind::ClockSkew,
            Kind::StandResonance,
            Kind::InflowLead,
            Kind::Backlash,
        ];
        for kind in kinds {
            let mut case = Case::draw(Set::Tune, Class::Single(kind), 0);
            // 0.2 % of the weakest motor's swing.
            case.noise = Noise::white(0.002 * 0.1 * 8.0);
            let columns = data(&case);
            let coarse = Fitter::new(&case, &columns).at_truth();
            let fine = Fitter::with_step(&case, &columns, |_| 50e-6).at_truth();
            assert!((coarse - fine).abs() < 1.0, "{}: {}", kind.name(), coarse - fine);
            if case.setup().changes_with_rows_only() {
                assert!((coarse - fine).abs() < 0.15, "{}: {}", kind.name(), coarse - fine);
            }
        }
    }

    #[test]
    fn a_fit_finds_what_the_case_was_made_with() {
        let case = Case::draw(Set::Tune, Class::Single(Kind::TransportDelay), 0);
        let columns = data(&case);
        let fit = Fitter::new(&case, &columns).best(&[Kind::TransportDelay], None, None);
        assert!((fit.effects[0].values[0] - case.effects[0].values[0]).abs() < 0.5e-3);
        for (fitted, point) in fit.motor.points.iter().zip(&case.motor.points) {
            assert!((fitted.gain_n / point.gain_n - 1.0).abs() < 0.03);
            assert!((fitted.time_constant_s / point.time_constant_s - 1.0).abs() < 0.05);
        }
    }
}
