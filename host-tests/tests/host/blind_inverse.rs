//! An inverse that is designed from the diagnosis of blind records, on the motor that the records are of.

use std::f64::consts::TAU;

use blind_cases::case::{Case, Class, Columns, STEP_S, Set};
use blind_cases::chain::Chain;
use blind_cases::folder::write;
use blind_cases::kind::Kind;
use blind_cases::motor::Point;
use blind_cases::path::{Timing, means, pieces};
use blind_cases::setup::Setup;
use rotorlead::throttle::Command;
use rotorlead_design::redesign::{KindOptions, RedesignOptions, redesign};
use rotorlead_design::{InverseOptions, MOST_OVER_REFERENCE, steps};
use rotorlead_diagnose::{Options, diagnose};
use rotorlead_plant::{Catalog, CompensatorDesign, Model};
use rotorlead_records::Experiment;

/// What is hidden: what an inverse could be harmed by.
const HIDDEN: [Kind; 3] = [Kind::AsymmetricLag, Kind::SecondPole, Kind::SlewLimit];
/// The motor of the records has one lag around each nominal command, and the table moves: signals as small as that, and still a hundred
/// steps of the output.
const AMPLITUDE: f64 = 0.002;
const STEP: f64 = 0.005;
/// Seconds before the fit and in it, and of a step.
const LEAD_IN_S: f64 = 3.0;
const FITTED_S: f64 = 1.6;
const STEP_LENGTH_S: f64 = 3.0;
/// How far a bandwidth is searched for, in natural frequencies.
const SEARCHED: f64 = 2.5;

/// What an inverse does at one point: by prediction, or in truth.
#[derive(Clone, Copy, Debug)]
struct Done {
    bandwidth_rad_s: f64,
    overshoot: f64,
}

/// One case.
#[derive(Debug)]
struct Outcome {
    /// Predicted and true at each point; `None` where the design was refused.
    points: Option<Vec<(Done, Done)>>,
    /// Whether an exact or a robust table from the true time constants as found would pass the check on the true motor.
    may_be_designed: bool,
}

impl Outcome {
    fn reaches(&self) -> bool {
        self.points.iter().flatten().all(|(predicted, found)| found.bandwidth_rad_s >= 0.9 * predicted.bandwidth_rad_s)
    }

    fn overshoots(&self) -> bool {
        self.points.iter().flatten().any(|(predicted, found)| found.overshoot > predicted.overshoot + 0.05)
    }
}

/// The force of the true motor behind the inverse, from rest at the nominal command.
fn force(setup: &Setup, point: Point, design: &CompensatorDesign, commands: impl Iterator<Item = f64>) -> Vec<f64> {
    let rate_hz = design.loop_rate_hz();
    let mut filter = design.running(Command::saturating_from_f64(point.nominal));
    let to_esc: Vec<f64> =
        commands.map(|command| filter.update(Command::saturating_from_f64(command)).to_f64()).collect();
    let timing = Timing::exact(to_esc.len(), 1.0 / rate_hz);
    let steps = (to_esc.len() as f64 / rate_hz / STEP_S).round() as usize;
    let means = means(&pieces(&to_esc, point.nominal, setup, &timing), STEP_S, steps);
    Chain { point, setup, step_s: STEP_S }.force(&means)
}

/// The response of the true motor to a sinusoid, over its static one.
fn response(setup: &Setup, point: Point, design: &CompensatorDesign, omega: f64) -> f64 {
    let periods = (FITTED_S * omega / TAU).ceil();
    let fitted_s = periods * TAU / omega;
    let ticks = ((LEAD_IN_S + fitted_s) * design.loop_rate_hz()).ceil() as usize;
    let sinusoid =
        (0..ticks).map(|tick| point.nominal + AMPLITUDE * (omega * tick as f64 / design.loop_rate_hz()).sin());
    let force = force(setup, point, design, sinusoid);
    let rows = (fitted_s / STEP_S).round() as usize;
    let (mut re, mut im) = (0.0, 0.0);
    for (index, force) in force.iter().enumerate().rev().take(rows) {
        let (sin, cos) = (omega * index as f64 * STEP_S).sin_cos();
        (re, im) = (re + force * cos, im + force * sin);
    }
    2.0 * f64::hypot(re, im) / rows as f64 / (AMPLITUDE * point.gain_n)
}

fn in_truth(setup: &Setup, point: Point, design: &CompensatorDesign) -> Done {
    let is_behind = |omega: f64| response(setup, point, design, omega) < 10_f64.powf(-0.15);
    let searched = SEARCHED * design.natural_rad_s();
    let (mut low, mut high) = (2.0, 2.0);
    while high < searched && !is_behind(high) {
        (low, high) = (high, 1.15 * high);
    }
    while high > 1.01 * low && high < searched {
        let middle = 0.5 * (low + high);
        *if is_behind(middle) { &mut high } else { &mut low } = middle;
    }
    let ticks = (STEP_LENGTH_S * design.loop_rate_hz()) as usize;
    let overshoot = [STEP, -STEP].map(|step| {
        let force = force(setup, point, design, std::iter::repeat_n(point.nominal + step, ticks));
        let (start, end) = (force[0], force[force.len() - 1]);
        force.iter().fold(0.0, |most, force| f64::max(most, (force - start) / (end - start) - 1.0))
    });
    Done { bandwidth_rad_s: low, overshoot: overshoot[0].max(overshoot[1]) }
}

/// Whether a table of these time constants may be used on the true motor: by its faster direction.
fn passes(case: &Case, model: &Model) -> bool {
    let setup = case.setup();
    let faster = setup.ratio.max(1.0 / setup.ratio).sqrt();
    let lag = |omega: f64, tau_s: f64| (omega * tau_s).hypot(1.0);
    // The two settings.
    [(94.2, 1.0), (125.0, 0.9)].iter().any(|&(omega, part)| {
        case.motor.points.iter().zip(&model.points).all(|(point, found)| {
            let (table_s, true_s) = (part * found.time_constant_s / faster, point.time_constant_s / faster);
            lag(omega, table_s) / lag(omega, true_s) <= MOST_OVER_REFERENCE
        })
    })
}

fn outcome(case: &Case) -> Outcome {
    let columns: Vec<Columns> = (0..case.runs.len()).map(|index| case.record(index)).collect();
    let root = tempfile::tempdir().unwrap();
    let paths = write(case, &columns, root.path()).unwrap();
    let experiment = Experiment::read(&paths.experiment).unwrap();
    let catalog = Catalog::standard();
    let found = diagnose(&experiment, &Options { model: None, catalog: &catalog, progress: &|| {} }).unwrap();
    let design = KindOptions::Inverse(InverseOptions::default());
    let options = RedesignOptions { design, amplitude: AMPLITUDE, esc_frame_hz: None };
    let may_be_designed = passes(case, &found.model);
    let Ok(redesigned) = redesign(&found.model, &options, &|| ()) else {
        return Outcome { points: None, may_be_designed };
    };
    let (design, setup) = (&redesigned.full.design, case.setup());
    let stepped = steps(&found.model, design, None, &[STEP]).unwrap();
    let points = redesigned.full.points.iter().zip(&case.motor.points).map(|(predicted, point)| {
        let of_point = stepped.iter().filter(|step| step.nominal == predicted.small.nominal);
        let overshoot = of_point.map(|step| step.compensated.overshoot).fold(0.0, f64::max);
        // What the records promise.
        let at_least = predicted.at_least.expect("a time constant is never known exactly");
        let bandwidth_rad_s = at_least.rad_s().unwrap_or(f64::INFINITY).min(SEARCHED * design.natural_rad_s());
        (Done { bandwidth_rad_s, overshoot }, in_truth(&setup, *point, design))
    });
    Outcome { points: Some(points.collect()), may_be_designed }
}

/// Runs so many cases of each kind, and holds the count to what is asked of it.
fn count(set: Set, cases: u64) {
    let (mut designed, mut may_be, mut both) = (0_usize, 0_usize, 0_usize);
    let (mut failed, mut total) = (Vec::new(), 0);
    for kind in HIDDEN {
        for number in 0..cases {
            let case = Case::draw(set, Class::Single(kind), number);
            let outcome = outcome(&case);
            total += 1;
            designed += usize::from(outcome.points.is_some());
            may_be += usize::from(outcome.may_be_designed);
            both += usize::from(outcome.points.is_some() && outcome.may_be_designed);
            let points = || outcome.points.iter().flatten();
            let least = points().map(|(predicted, found)| found.bandwidth_rad_s / predicted.bandwidth_rad_s);
            let most = points().map(|(predicted, found)| found.overshoot - predicted.overshoot);
            println!(
                "{} {number}: designed {}, at least {:.2} of the bandwidth, overshoot {:+.3} beyond",
                kind.name(),
                outcome.points.is_some(),
                least.fold(f64::NAN, f64::min),
                most.fold(f64::NAN, f64::max),
            );
            if !outcome.reaches() || outcome.overshoots() {
                println!("{outcome:?}");
                failed.push(format!("{} {number}", kind.name()));
            }
        }
    }
    println!(
        "{designed} of {total} designed; {both} of the {may_be} that pass the check on the true motor; {} not as predicted",
        failed.len()
    );
    // The bandwidths are bounds of 95 %.
    assert!(20 * failed.len() <= designed, "{failed:?}");
    assert!(5 * both >= 4 * may_be, "{both} of {may_be}");
}

#[test]
fn an_inverse_of_a_diagnosis_keeps_its_promise_on_the_true_motor() {
    count(Set::Tune, 1);
}

#[test]
#[ignore = "minutes: the published count"]
fn how_often_an_inverse_of_a_diagnosis_keeps_its_promise() {
    count(Set::Report, 20);
}
