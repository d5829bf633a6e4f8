//! A case: what is hidden in which motor, and the records that show it.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::chain::{Chain, Signals, read_at, relative_current};
use super::excitation::{Drive, ROWS, ROWS_HZ, commands};
use super::kind::{Effect, Kind};
use super::motor::Motor;
use super::noise::Noise;
use super::nuisance::{self, Nuisance};
use super::outside::{Outside, Sort};
use super::path::{Timing, means, pieces};
use super::rotor::rpm;
use super::setup::Setup;
use super::shape::{Law, Shape};

/// Grid on which data are made, in seconds.
pub const STEP_S: f64 = 50e-6;
/// The paper's amplitude.
const AMPLITUDE: f64 = 0.05;
/// Commands take effect up to this much early or late, in seconds; as often early as late.
const COMMAND_JITTER_S: f64 = 50e-6;
/// The logger reads up to this much early or late, in seconds; as often early as late.
const LOGGER_JITTER_S: f64 = 20e-6;
/// The supply at rest at hover, in volts.
const SUPPLY_V: f64 = 14.8;
/// The current at hover, in amperes.
const HOVER_A: f64 = 5.0;

/// Seeds for tuning the method, or for reporting on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Anyone may look at these while the method is made.
    Tune,
    /// Only for the figures that are published.
    Report,
}

impl Set {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tune => "tune",
            Self::Report => "report",
        }
    }

    /// The first of its seeds; the sets are far apart.
    #[must_use]
    pub fn base(self) -> u64 {
        match self {
            Self::Tune => 0x7440_0000_0000,
            Self::Report => 0x2c87_0000_0000,
        }
    }
}

/// What a case hides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// One effect.
    Single(Kind),
    /// Nothing.
    Empty,
    /// Two effects of distinct kinds, any two of them.
    Pair,
    /// Three effects of distinct kinds.
    Triple,
    /// One effect, whose law is a little other than the catalog's.
    Perturbed,
    /// Something that no catalog names.
    Outside,
    /// No effect, but one or two nuisances of the stand.
    Nuisance,
    /// One effect, and one or two nuisances that are forces.
    SingleInNuisance,
}

impl Class {
    /// Every class but those of one effect.
    pub const OTHERS: [Self; 7] =
        [Self::Empty, Self::Pair, Self::Triple, Self::Outside, Self::Perturbed, Self::Nuisance, Self::SingleInNuisance];

    /// Its name in tables: the kind's name for a single one.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Single(kind) => kind.name(),
            Self::Empty => "nothing",
            Self::Pair => "pair",
            Self::Triple => "triple",
            Self::Perturbed => "perturbed",
            Self::Outside => "outside",
            Self::Nuisance => "nuisance",
            Self::SingleInNuisance => "single_in_nuisance",
        }
    }

    fn number(self) -> u64 {
        match self {
            Self::Single(kind) => kind as u64,
            Self::Empty => 100,
            Self::Pair => 101,
            Self::Outside => 102,
            Self::Perturbed => 103,
            Self::Triple => 104,
            Self::Nuisance => 105,
            Self::SingleInNuisance => 106,
        }
    }
}

/// The model that the tool is given.
#[derive(Clone, Debug, PartialEq)]
pub enum Given {
    /// None.
    Nothing,
    /// The motor's own numbers.
    Right,
    /// Numbers that are wrong by these parts at each point: gain and time constant.
    Stale(Vec<(f64, f64)>),
}

/// How a record was run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The point by its place in the motor.
    pub point: usize,
    /// Excitation.
    pub drive: Drive,
    /// Peak amplitude, 0..1.
    pub amplitude: f64,
    /// Whether it is marked as kept out of the fit; `None` when the case marks none.
    pub held_out: Option<bool>,
    /// Name of its file.
    pub file: String,
    /// The commands by row.
    pub commands: Vec<f64>,
    /// When they take effect.
    pub timing: Timing,
}

/// One record's columns besides the command.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Seconds that stand beside each row; a row without them is not in the file.
    pub stamps_s: Vec<Option<f64>>,
    /// Newtons.
    pub thrust_n: Vec<f64>,
    /// Revolutions per minute.
    pub rpm: Vec<f64>,
    /// Volts.
    pub voltage_v: Vec<f64>,
    /// Amperes.
    pub current_a: Vec<f64>,
}

/// Everything about a case but the noise's values.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it is for.
    pub class: Class,
    /// Its number within the class and set.
    pub number: u64,
    /// The seed that everything comes from.
    pub seed: u64,
    /// The motor.
    pub motor: Motor,
    /// What is hidden.
    pub effects: Vec<Effect>,
    /// What stands in the place of its law.
    pub law: Option<Law>,
    /// By what its law is bent.
    pub shape: Shape,
    /// What the stand adds.
    pub nuisances: Vec<Nuisance>,
    /// What is hidden and has no name.
    pub outside: Option<Outside>,
    /// Resistance's share of a supply's drop.
    pub resistance_share: f64,
    /// The load cell's noise.
    pub noise: Noise,
    /// The model beside the data.
    pub given: Given,
    /// Whether the records have rpm, voltage and current.
    pub has_more_columns: bool,
    /// The records in the order of the file.
    pub runs: Vec<Run>,
}

impl Case {
    /// Draws the case of that number.
    #[must_use]
    pub fn draw(set: Set, class: Class, number: u64) -> Self {
        let seed = set.base() + class.number() * 0x1_0000 + number;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let rng = &mut rng;
        let motor = Motor::draw(rng);
        let (mut law, mut shape, mut nuisances) = (None, Shape::default(), Vec::new());
        let (effects, outside) = match class {
            Class::Single(kind) => (vec![kind.draw(rng)], None),
            Class::Empty => (Vec::new(), None),
            Class::Pair => (draw_several(2, rng), None),
            Class::Triple => (draw_several(3, rng), None),
            Class::Perturbed => {
                let (bent, ..) = Law::TABLE[number as usize % Law::TABLE.len()];
                (law, shape) = (Some(bent), bent.draw(rng));
                (vec![bent.draw_effect(rng)], None)
            }
            Class::Outside => {
                let sorts: &[Sort] = match set {
                    Set::Tune => &Sort::TUNE,
                    Set::Report => &Sort::REPORT,
                };
                (Vec::new(), Some(sorts[number as usize % sorts.len()].draw(rng)))
            }
            Class::Nuisance => {
                let first = nuisance::Sort::ALL[number as usize % nuisance::Sort::ALL.len()];
                nuisances = nuisance::Sort::draw_some(first, rng);
                (Vec::new(), None)
            }
            Class::SingleInNuisance => {
                let first = nuisance::Sort::FORCES[rng.random_range(0..nuisance::Sort::FORCES.len())];
                nuisances = nuisance::Sort::draw_some(first, rng);
                (vec![Kind::ALL[number as usize % Kind::ALL.len()].draw(rng)], None)
            }
        };
        let given = match effects.iter().find(|effect| effect.kind == Kind::ParameterError) {
            Some(effect) => stale(effect, motor.points.len(), rng),
            None if rng.random_bool(0.5) => Given::Right,
            None => Given::Nothing,
        };
        let gain = motor.points.iter().map(|point| point.gain_n).sum::<f64>() / motor.points.len() as f64;
        let level = 0.002 * 25.0_f64.powf(rng.random_range(0.0..1.0));
        let noise = Noise::draw(level * 2.0 * AMPLITUDE * gain, rng);
        let resistance_share = rng.random_range(0.0..0.5);
        let has_more_columns = rng.random_bool(0.5);
        let runs = draw_runs(motor.points.len(), &motor, rng);
        Self {
            class,
            number,
            seed,
            motor,
            effects,
            law,
            shape,
            nuisances,
            outside,
            resistance_share,
            noise,
            given,
            has_more_columns,
            runs,
        }
    }

    /// The chain with what is hidden in it.
    #[must_use]
    pub fn setup(&self) -> Setup {
        Setup { shape: self.shape, ..Setup::from_effects(&self.effects, self.resistance_share) }
    }

    /// Makes one record's columns.
    #[must_use]
    pub fn record(&self, index: usize) -> Columns {
        let run = &self.runs[index];
        let setup = self.setup();
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let rng = &mut rng;
        let point = self.motor.points[run.point];
        // A little more than the rows, for a logger that is late.
        let steps = (ROWS as f64 / ROWS_HZ / STEP_S) as usize + 2_000;
        let pieces = pieces(&run.commands, point.nominal, &setup, &run.timing);
        let chain = Chain { point, setup: &setup, step_s: STEP_S };
        let mut signals: Signals = chain.run(&means(&pieces, STEP_S, steps));
        let swing_n = 2.0 * AMPLITUDE * point.gain_n;
        if let Some(outside) = self.outside.filter(|outside| !outside.is_in_the_logger()) {
            outside.apply(&mut signals.force_n, STEP_S, &point, swing_n, rng);
        }
        let times: Vec<f64> =
            logger_times(&setup).map(|time_s| time_s + rng.random_range(-LOGGER_JITTER_S..LOGGER_JITTER_S)).collect();
        let read = |signal: &[f64]| read_at(signal, STEP_S, times.iter().copied());
        let mut thrust_n = read(&signals.force_n);
        for (value, noise) in thrust_n.iter_mut().zip(self.noise.sample(ROWS, rng)) {
            *value += noise;
        }
        if let Some(outside) = self.outside.filter(Outside::is_in_the_logger) {
            outside.apply(&mut thrust_n, 1.0 / ROWS_HZ, &point, swing_n, rng);
        }
        let rotor = read(&signals.rotor_n);
        let mut stamps_s: Vec<Option<f64>> = (0..ROWS).map(|row| Some(row as f64 / ROWS_HZ)).collect();
        for nuisance in &self.nuisances {
            nuisance.add(&mut thrust_n, &rotor, swing_n, self.noise.hum_hz, rng);
            nuisance.restamp(&mut stamps_s, rng);
        }
        if !self.has_more_columns {
            return Columns { stamps_s, thrust_n, rpm: Vec::new(), voltage_v: Vec::new(), current_a: Vec::new() };
        }
        let mut noisy = |value: f64, sigma: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(rng);
            value + sigma * normal
        };
        let rest_v = SUPPLY_V * (1.0 - (setup.sag_depth + setup.sag_resistance) * (self.rest_current(run.point) - 1.0));
        let voltage: Vec<f64> = if signals.voltage.is_empty() { vec![1.0; ROWS] } else { read(&signals.voltage) };
        Columns {
            stamps_s,
            thrust_n,
            rpm: rotor.iter().map(|thrust| rpm(*thrust)).map(|rpm| noisy(rpm, 0.001 * rpm)).collect(),
            current_a: rotor
                .iter()
                .map(|thrust| HOVER_A * relative_current(point.speed(*thrust)))
                .map(|current| noisy(current, 0.05))
                .collect(),
            voltage_v: voltage.iter().map(|ratio| noisy(rest_v * ratio, 0.01)).collect(),
        }
    }

    /// The current at rest at a point, relative to hover.
    fn rest_current(&self, point: usize) -> f64 {
        relative_current(self.motor.points[point].nominal)
    }
}

/// When the logger reads its rows, in seconds of the controller's clock.
pub fn logger_times(setup: &Setup) -> impl Iterator<Item = f64> {
    let (error, shape) = (setup.skew_ppm * 1e-6, setup.shape);
    (0..ROWS).map(move |row| row as f64 * (1.0 + error * shape.clock_factor(row as f64 / ROWS as f64)) / ROWS_HZ)
}

/// Effects of so many different kinds, any as likely as any others. All go together: wrong parameters are those of the model that
/// is given, whatever the chain has.
fn draw_several(count: usize, rng: &mut ChaCha8Rng) -> Vec<Effect> {
    let mut kinds = Kind::ALL;
    kinds.shuffle(rng);
    let mut effects: Vec<Effect> = kinds[..count].iter().map(|kind| kind.draw(rng)).collect();
    effects.sort_by_key(|effect| effect.kind);
    effects
}

/// Wrong numbers: those drawn in the mean, a fifth of them by point.
fn stale(effect: &Effect, points: usize, rng: &mut ChaCha8Rng) -> Given {
    let mut around = |error: f64| error * rng.random_range(0.8..1.2);
    Given::Stale((0..points).map(|_| (around(effect.values[0]), around(effect.values[1]))).collect())
}

/// The paper's twelve records in random order. In every second case the amplitude is the paper's throughout; else the
/// multisines or the square waves have half of it. In every second case two to four records are marked to be held out,
/// at most one of a point.
fn draw_runs(points: usize, motor: &Motor, rng: &mut ChaCha8Rng) -> Vec<Run> {
    let halved = match rng.random_range(0..4) {
        0 => Some(Drive::Multisine),
        1 => Some(Drive::Square),
        _ => None,
    };
    let mut held: Vec<usize> = (0..points).collect();
    held.shuffle(rng);
    held.truncate(if rng.random_bool(0.5) { rng.random_range(2..=4) } else { 0 });
    let mut numbers: Vec<u32> = (100..1000).collect();
    numbers.shuffle(rng);
    let mut runs = Vec::with_capacity(2 * points);
    for point in 0..points {
        let held_drive = if rng.random_bool(0.5) { Drive::Multisine } else { Drive::Square };
        for drive in [Drive::Multisine, Drive::Square] {
            let amplitude = if halved == Some(drive) { AMPLITUDE / 2.0 } else { AMPLITUDE };
            let mut timing = Timing::exact(ROWS, 1.0 / ROWS_HZ);
            timing.frame_phase = rng.random_range(0.0..1.0);
            for time_s in &mut timing.take_over_s {
                *time_s += rng.random_range(-COMMAND_JITTER_S..COMMAND_JITTER_S);
            }
            runs.push(Run {
                point,
                drive,
                amplitude,
                held_out: (!held.is_empty()).then(|| held.contains(&point) && drive == held_drive),
                file: format!("run_{}.csv", numbers[runs.len()]),
                commands: commands(drive, motor.points[point].nominal, amplitude, rng),
                timing,
            });
        }
    }
    runs.shuffle(rng);
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_makes_the_same_case_again_and_another_makes_another() {
        let case = Case::draw(Set::Tune, Class::Single(Kind::TransportDelay), 3);
        assert_eq!(case, Case::draw(Set::Tune, Class::Single(Kind::TransportDelay), 3));
        assert_eq!(case.record(2), case.record(2));
        let other = Case::draw(Set::Report, Class::Single(Kind::TransportDelay), 3);
        assert_ne!(case.motor, other.motor);
    }

    #[test]
    fn an_empty_case_is_the_plain_chain_and_noise_of_the_stated_size() {
        let case = Case::draw(Set::Tune, Class::Empty, 0);
        let run = &case.runs[0];
        let point = case.motor.points[run.point];
        let decay = (-1e-3 / point.time_constant_s).exp();
        let mut thrust = point.rest_n;
        let columns = case.record(0);
        let mut sum = 0.0;
        for (command, value) in run.commands.iter().zip(&columns.thrust_n) {
            sum += (value - thrust).powi(2);
            let target = point.rest_n + point.gain_n * (command - point.nominal);
            thrust = target + (thrust - target) * decay;
        }
        let colored: f64 = case.noise.colored.iter().map(|(sigma, _)| sigma * sigma).sum();
        let stated = (case.noise.white_n.powi(2) + colored + case.noise.hum_n.powi(2)).sqrt();
        assert!(((sum / ROWS as f64).sqrt() / stated - 1.0).abs() < 0.15);
    }

    #[test]
    fn pairs_are_any_two_kinds_and_triples_any_three() {
        let mut seen = std::collections::BTreeSet::new();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..2_000 {
            let kinds: Vec<Kind> = draw_several(2, &mut rng).iter().map(|effect| effect.kind).collect();
            assert!(kinds[0] < kinds[1]);
            seen.insert(kinds);
        }
        // 2000 draws leave out one of 153 pairs once in 3200 times.
        assert_eq!(seen.len(), Kind::ALL.len() * (Kind::ALL.len() - 1) / 2);
        assert_eq!(Case::draw(Set::Tune, Class::Triple, 0).effects.len(), 3);
    }

    #[test]
    fn the_model_of_a_pair_with_wrong_parameters_is_stale() {
        let mut pairs = (0..100).map(|number| Case::draw(Set::Tune, Class::Pair, number));
        let with = pairs.find(|case| case.effects[0].kind == Kind::ParameterError).unwrap();
        assert!(matches!(with.given, Given::Stale(_)) && with.effects[1].kind != Kind::ParameterError);
    }

    #[test]
    fn a_clock_that_drifts_is_as_far_off_at_the_end_and_less_in_the_middle() {
        let shape = Shape { clock_drift: 0.2, ..Shape::default() };
        let at = |shape: Shape, row: usize| {
            let setup = Setup { skew_ppm: 1000.0, shape, ..Setup::default() };
            logger_times(&setup).nth(row).unwrap() - row as f64 / ROWS_HZ
        };
        assert!((at(shape, ROWS / 2) - 13.5e-3).abs() < 1e-9);
        assert!((at(Shape::default(), ROWS / 2) - 15e-3).abs() < 1e-9);
        assert!((at(shape, ROWS - 1) - at(Shape::default(), ROWS - 1)).abs() < 1e-6);
    }

    #[test]
    fn a_nuisance_hides_no_effect_and_the_plain_motor_is_under_it() {
        for number in 0..6 {
            let case = Case::draw(Set::Tune, Class::Nuisance, number);
            assert!(case.effects.is_empty() && case.outside.is_none() && !case.nuisances.is_empty());
            assert_eq!(case.setup(), Setup::default());
            assert_eq!(case.nuisances[0].sort, nuisance::Sort::ALL[number as usize]);
        }
        let single = Case::draw(Set::Tune, Class::SingleInNuisance, 3);
        assert_eq!((single.effects.len(), single.effects[0].kind), (1, Kind::ALL[3]));
        assert!(single.nuisances.iter().all(|nuisance| nuisance::Sort::FORCES.contains(&nuisance.sort)));
    }

    #[test]
    fn a_bent_law_is_a_little_other_than_the_catalogs() {
        for (number, law) in Law::all().enumerate() {
            let bent = Case::draw(Set::Tune, Class::Perturbed, number as u64);
            let straight = Case { shape: Shape::default(), ..bent.clone() };
            let plain = Case { effects: Vec::new(), ..straight.clone() };
            // Where commands meet limits and never stand still.
            let at = |run: &Run| run.point == 5 && run.drive == Drive::Multisine;
            let record = bent.runs.iter().position(at).unwrap();
            // The noise is the same in all three.
            let [bent, straight, plain] = [bent, straight, plain].map(|case| case.record(record).thrust_n);
            let power = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            let part = (power(&bent, &straight) / power(&straight, &plain)).sqrt();
            assert!((0.01..0.95).contains(&part), "{law:?}: {part}");
        }
    }

    #[test]
    fn no_point_loses_both_of_its_records() {
        for number in 0..20 {
            let case = Case::draw(Set::Tune, Class::Empty, number);
            for point in 0..6 {
                let kept = case.runs.iter().filter(|run| run.point == point && run.held_out != Some(true)).count();
                assert!(kept >= 1);
            }
        }
    }
}
