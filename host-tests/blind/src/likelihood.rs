//! The likelihood of a case's records under the generator's own chain and the noise that the generator knows.
//!
//! It is Whittle's (see [`super::whiten`]), and a sum over records. Only the thrust counts. The chain runs with a
//! coarser step than the one the data were made with (see [`fit_step_s`]), which a test shows to cost less than one
//! unit of log likelihood of the margin of five.

use super::case::{Case, Columns, logger_times};
use super::chain::{Chain, read_at};
use super::excitation::{ROWS, ROWS_HZ};
use super::kind::{Effect, Kind};
use super::motor::Motor;
use super::parameters::shifted;
use super::path::{Timing, means, pieces};
use super::setup::Setup;
use super::whiten::Spectrum;

/// Size of the change of a parameter that a derivative is taken over.
const RELATIVE: f64 = 1e-4;

/// Step of the chain in fits, in seconds.
///
/// Half a row. A logger that reads between grid points sees where the grid rounds corners off, and gets a quarter.
/// Where commands change with the rows only and nothing follows the rotor, a step of a row is exact for the plain lag,
/// and a tenth of a unit away at most for the others.
#[must_use]
pub fn fit_step_s(setup: &Setup) -> f64 {
    let row_s = 1.0 / ROWS_HZ;
    if setup.skew_ppm != 0.0 {
        row_s / 4.0
    } else if setup.changes_with_rows_only() {
        row_s
    } else {
        row_s / 2.0
    }
}

/// The data of a case, or of some of its records.
pub struct Likelihood<'a> {
    case: &'a Case,
    /// Mean of the thrust by record, in newtons.
    mean_n: Vec<f64>,
    /// Whitened thrust by record.
    measured: Vec<Vec<f64>>,
    weights: Vec<f64>,
    spectrum: Spectrum,
    step_s: fn(&Setup) -> f64,
    timings: Vec<Timing>,
    /// The records that count, by their place in the case.
    chosen: Vec<usize>,
    /// The commands at the rotor by chosen record, with the part of the setup that they belong to: most changes in a
    /// fit are behind them.
    driven: Option<Driven>,
}

/// Commands at the rotor.
struct Driven {
    path: Setup,
    step_s: f64,
    means: Vec<Vec<f64>>,
}

/// A model's answer in one record: its mean in newtons, and its whitened bins.
struct Response {
    mean_n: f64,
    bins: Vec<f64>,
}

/// A model with what is needed for its derivatives, in whitened bins by chosen record.
pub(super) struct State {
    /// Sum over the chosen records.
    pub log_likelihood: f64,
    /// The parts of the sum.
    pub by_record: Vec<f64>,
    pub motor: Motor,
    pub effects: Vec<Effect>,
    model: Vec<Vec<f64>>,
    residual: Vec<Vec<f64>>,
}

/// Normal equations of the smallest squares, in the logarithms of the gains, then of the time constants, then in the
/// free parameters' own scale (see [`shifted`]).
pub(super) struct Normal {
    pub matrix: Vec<Vec<f64>>,
    pub slope: Vec<f64>,
}

impl Normal {
    /// Takes an unknown out of the equations: its step is zero, and the others step as if it were known.
    pub fn hold(&mut self, unknown: usize) {
        self.matrix[unknown].fill(0.0);
        for row in &mut self.matrix {
            row[unknown] = 0.0;
        }
        self.matrix[unknown][unknown] = 1.0;
        self.slope[unknown] = 0.0;
    }
}

impl<'a> Likelihood<'a> {
    /// All records of `case`, `columns` by record, with the chain's step by setup.
    #[must_use]
    pub fn new(case: &'a Case, columns: &[Columns], step_s: fn(&Setup) -> f64) -> Self {
        let exact = Timing::exact(ROWS, 1.0 / ROWS_HZ);
        let (weights, mut spectrum) = (case.noise.weights(ROWS), Spectrum::new(ROWS));
        Self {
            case,
            mean_n: columns.iter().map(|columns| mean(&columns.thrust_n)).collect(),
            measured: columns.iter().map(|columns| spectrum.whitened(&columns.thrust_n, &weights)).collect(),
            weights,
            spectrum,
            step_s,
            // A fit does not know by how little each command was early or late. It begins with the frames where they lie.
            timings: case
                .runs
                .iter()
                .map(|run| Timing { frame_phase: run.timing.frame_phase, ..exact.clone() })
                .collect(),
            chosen: (0..case.runs.len()).collect(),
            driven: None,
        }
    }

    /// The case.
    #[must_use]
    pub fn case(&self) -> &'a Case {
        self.case
    }

    /// From now on only these records count, by their place in the case.
    pub fn choose(&mut self, records: &[usize]) {
        self.chosen = records.to_vec();
        self.driven = None;
    }

    /// From now on the frames of each record lie by this part of a frame elsewhere than they did when it was made.
    pub(super) fn turn_frames(&mut self, part: f64) {
        for (timing, run) in self.timings.iter_mut().zip(&self.case.runs) {
            timing.frame_phase = (run.timing.frame_phase + part).fract();
        }
        self.driven = None;
    }

    /// How many bins count in the chosen records.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.weights.iter().filter(|weight| **weight > 0.0).count() * self.chosen.len()
    }

    /// The model with these parameters. Unless it is `frozen`, its gains become the best ones where thrust is in
    /// proportion to them, which costs nothing.
    pub(super) fn evaluate(&mut self, motor: Motor, effects: Vec<Effect>, frozen: bool) -> State {
        let mut motor = motor;
        let mut responses = self.respond(&motor, &effects);
        if needs_rest(&effects) {
            // Thrust at rest: what is left of the mean.
            for _ in 0..2 {
                self.settle_rest(&mut motor, &responses);
                responses = self.respond(&motor, &effects);
            }
        }
        let mut model: Vec<Vec<f64>> = responses.into_iter().map(|response| response.bins).collect();
        if !frozen && !needs_rest(&effects) {
            self.settle_gains(&mut motor, &mut model);
        }
        let mut residual = Vec::with_capacity(model.len());
        for (record, model) in self.chosen.iter().zip(&model) {
            residual.push(self.measured[*record].iter().zip(model).map(|(y, model)| y - model).collect::<Vec<f64>>());
        }
        let by_record: Vec<f64> = residual.iter().map(|residual| -dot(residual, residual)).collect();
        State { log_likelihood: by_record.iter().sum(), by_record, motor, effects, model, residual }
    }

    fn settle_rest(&self, motor: &mut Motor, responses: &[Response]) {
        let mut shift = vec![(0.0, 0.0); motor.points.len()];
        for (record, response) in self.chosen.iter().zip(responses) {
            let (sum, count) = &mut shift[self.case.runs[*record].point];
            *sum += self.mean_n[*record] - response.mean_n;
            *count += 1.0;
        }
        for (point, (sum, count)) in motor.points.iter_mut().zip(shift) {
            point.rest_n = (point.rest_n + sum / f64::max(count, 1.0)).max(0.05);
        }
    }

    fn settle_gains(&self, motor: &mut Motor, model: &mut [Vec<f64>]) {
        let mut products = vec![(0.0, 0.0); motor.points.len()];
        for (record, model) in self.chosen.iter().zip(model.iter()) {
            let (measured, square) = &mut products[self.case.runs[*record].point];
            *measured += dot(model, &self.measured[*record]);
            *square += dot(model, model);
        }
        // Against the thrust of a model that hardly moves, or the wrong way, there is no better gain.
        let factors: Vec<f64> = products
            .into_iter()
            .map(|(measured, square)| if measured > 1e-3 * square { measured / square } else { 1.0 })
            .collect();
        for (point, factor) in motor.points.iter_mut().zip(&factors) {
            point.gain_n *= factor;
        }
        for (record, model) in self.chosen.iter().zip(model) {
            let factor = factors[self.case.runs[*record].point];
            model.iter_mut().for_each(|value| *value *= factor);
        }
    }

    /// The answer in each chosen record.
    fn respond(&mut self, motor: &Motor, effects: &[Effect]) -> Vec<Response> {
        let setup = Setup::from_effects(effects, self.case.resistance_share);
        let (path, step_s) = (setup.path(), (self.step_s)(&setup));
        let driven = match self.driven.take() {
            Some(known) if known.path == path && known.step_s == step_s => known,
            _ => self.drive(path, step_s),
        };
        let mut responses = Vec::with_capacity(self.chosen.len());
        for (record, means) in self.chosen.iter().zip(&driven.means) {
            let chain = Chain { point: motor.points[self.case.runs[*record].point], setup: &setup, step_s };
            let force_n = chain.force(means);
            let force_n: Vec<f64> = if setup.skew_ppm == 0.0 {
                let stride = (1.0 / ROWS_HZ / step_s).round() as usize;
                force_n.into_iter().step_by(stride).take(ROWS).collect()
            } else {
                read_at(&force_n, step_s, logger_times(&setup))
            };
            let bins = self.spectrum.whitened(&force_n, &self.weights);
            responses.push(Response { mean_n: mean(&force_n), bins });
        }
        self.driven = Some(driven);
        responses
    }

    /// The means of each chosen record's command at the rotor.
    fn drive(&self, path: Setup, step_s: f64) -> Driven {
        // A little more than the rows, for a logger that is late.
        let steps = (ROWS as f64 / ROWS_HZ / step_s) as usize + (0.1 / step_s) as usize;
        let of = |record: &usize| {
            let run = &self.case.runs[*record];
            let nominal = self.case.motor.points[run.point].nominal;
            means(&pieces(&run.commands, nominal, &path, &self.timings[*record]), step_s, steps)
        };
        let means = self.chosen.iter().map(of).collect();
        Driven { path, step_s, means }
    }

    /// Whitened derivative of the model by a change of [`RELATIVE`] in the parameters.
    fn derivative(&mut self, from: &State, motor: &Motor, effects: &[Effect]) -> Vec<Vec<f64>> {
        let mut changed = self.respond(motor, effects);
        for (changed, model) in changed.iter_mut().zip(&from.model) {
            changed.bins.iter_mut().zip(model).for_each(|(a, b)| *a = (*a - b) / RELATIVE);
        }
        changed.into_iter().map(|changed| changed.bins).collect()
    }

    /// The normal equations at a state; `None` when nothing is free.
    pub(super) fn normal_equations(&mut self, state: &State, free: &[(usize, usize)], frozen: bool) -> Option<Normal> {
        let points = state.motor.points.len();
        // Parameters of all points are moved at once: each record sees its own point's alone.
        let mut computed: Vec<Vec<Vec<f64>>> = Vec::new();
        let is_proportional = !needs_rest(&state.effects);
        if !frozen && !is_proportional {
            let mut motor = state.motor.clone();
            motor.points.iter_mut().for_each(|point| point.gain_n *= 1.0 + RELATIVE);
            computed.push(self.derivative(state, &motor, &state.effects));
        }
        if !frozen {
            let mut motor = state.motor.clone();
            motor.points.iter_mut().for_each(|point| point.time_constant_s *= 1.0 + RELATIVE);
            computed.push(self.derivative(state, &motor, &state.effects));
        }
        for at in free {
            computed.push(self.derivative(state, &state.motor, &shifted(&state.effects, *at, RELATIVE)));
        }
        let by_point = if frozen { 0 } else { 2 };
        let size = by_point * points + free.len();
        if size == 0 {
            return None;
        }
        let (mut matrix, mut slope) = (vec![vec![0.0; size]; size], vec![0.0; size]);
        for (place, record) in self.chosen.iter().enumerate() {
            let point = self.case.runs[*record].point;
            // What is in proportion to the gain is its own derivative by the gain's logarithm.
            let own = (!frozen && is_proportional).then(|| state.model[place].as_slice());
            let columns: Vec<(usize, &[f64])> = own
                .into_iter()
                .chain(computed.iter().map(|column| column[place].as_slice()))
                .enumerate()
                .map(|(index, column)| {
                    (if index < by_point { index * points + point } else { (points - 1) * by_point + index }, column)
                })
                .collect();
            for (row, left) in &columns {
                slope[*row] += dot(left, &state.residual[place]);
                for (column, right) in columns.iter().filter(|(column, _)| column >= row) {
                    let product = dot(left, right);
                    matrix[*row][*column] += product;
                    if column > row {
                        matrix[*column][*row] += product;
                    }
                }
            }
        }
        Some(Normal { matrix, slope })
    }
}

/// Whether thrust itself, and not only its deviation from rest, enters the chain. It does where a drift scales all of
/// it; in every other chain the deviation is in proportion to the gain and knows nothing of the rest.
fn needs_rest(effects: &[Effect]) -> bool {
    effects.iter().any(|effect| effect.kind == Kind::GainDrift)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// With several sums at a time, which do not wait for each other.
fn dot(left: &[f64], right: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (left, right) = (left.chunks_exact(LANES), right.chunks_exact(LANES));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    for (left, right) in left.zip(right) {
        for ((sum, a), b) in sums.iter_mut().zip(left).zip(right) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}
