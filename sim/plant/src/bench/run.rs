//! Plays a plan on a simulated actuator.

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use rotorlead::throttle::Command;
use rotorlead_records::files::KeyPath;
use rotorlead_records::{Excitation, Experiment, Output, Record};

use super::signal::Signal;
use super::{BenchError, Plan, PlannedRecord};
use crate::actuator::{Actuator, EscTiming, Law};
use crate::compensator::CompensatorDesign;
use crate::error::PlantError;
use crate::model::Model;
use crate::noise::{Noise, SensorNoise};

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Ticks of the control loop that are done, over all records.
    pub done: usize,
    /// Ticks that there are to do.
    pub total: usize,
}

/// Runs `plan` on the actuator that `model` describes, with records side by side on as many threads as the machine
/// runs at once. `compensator` is the design that the plan's `compensator` names. `progress` is called from those
/// threads, after every period of a record.
///
/// A row at time `t` has the command that takes effect at `t` (before and, in a compensated record, after the
/// compensator) and the response at `t`, which that command has not yet changed. Multisines, square waves and single
/// steps run on the plant that is linear around the record's nominal command, staircases on the one that follows the
/// level; see [`FirstOrder`](crate::FirstOrder). Behind an inverse all of them run on the one that follows the rotor's speed
/// ([`Law::FollowingSpeed`]). The effects of the model are in it, and a supply whose voltage the
/// model says has its columns.
///
/// The result depends on the arguments alone: each record has its own stream of noise, by the plan's seed and its place
/// in the plan.
///
/// # Errors
/// [`BenchError`] when plan, model and compensator do not go together, or one of them is impossible.
pub fn run(
    plan: &Plan,
    model: &Model,
    compensator: Option<&CompensatorDesign>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Experiment, BenchError> {
    let threads = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    run_on(threads, plan, model, compensator, progress)
}

/// [`run`] on a given number of threads.
///
/// # Errors
/// Those of [`run`].
pub fn run_on(
    threads: NonZeroUsize,
    plan: &Plan,
    model: &Model,
    compensator: Option<&CompensatorDesign>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Experiment, BenchError> {
    check(plan, model, compensator)?;
    let jobs = jobs(plan, model, compensator)?;
    let total = jobs.iter().map(Job::ticks).sum();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let report = |ticks: usize| {
        let done = done.fetch_add(ticks, Ordering::Relaxed) + ticks;
        progress(Progress { done, total });
    };
    let finished = Mutex::new(Vec::with_capacity(jobs.len()));
    let work = || {
        while let Some((index, job)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, jobs.get(i)?)))
        {
            let record = job.run(job.filter(), &report);
            finished.lock().expect("no thread panics while it holds the lock").push((index, record));
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads.get().min(jobs.len()) {
            // Where the system has no thread left, those that there are do the work.
            let _ = thread::Builder::new().spawn_scoped(scope, work);
        }
        work();
    });
    let mut finished = finished.into_inner().expect("no thread panics while it holds the lock");
    finished.sort_by_key(|(index, _)| *index);
    let records = finished.into_iter().map(|(_, record)| record).collect::<Result<Vec<_>, _>>()?;

    experiment(plan, model, records)
}

/// [`run`], with the filter somewhere else: `esc` is given how far the run is, the command at which a record starts at
/// rest and those of all its ticks, and gives a command for the ESC for each tick. `compensator` is what is said to be in
/// there.
///
/// # Errors
/// Those of [`run`], and those of `esc`.
pub fn run_through<E: From<BenchError>>(
    plan: &Plan,
    model: &Model,
    compensator: Option<&CompensatorDesign>,
    mut esc: impl FnMut(Progress, Command, &[Command]) -> Result<Vec<Command>, E>,
) -> Result<Experiment, E> {
    check(plan, model, compensator)?;
    let mut records = Vec::new();
    let jobs = jobs(plan, model, compensator)?;
    let mut progress = Progress { done: 0, total: jobs.iter().map(Job::ticks).sum() };
    for job in jobs {
        let Signal { samples, warm_up_ticks, ticks, .. } = &job.signal;
        let commands: Vec<Command> = samples.iter().copied().cycle().take(warm_up_ticks + ticks).collect();
        let mut outputs = esc(progress, job.signal.start, &commands)?.into_iter();
        progress.done += commands.len();
        // A filter that gives too few rests at its last command; it is the caller's to check.
        let mut last = job.signal.start;
        let filter = |_| {
            last = outputs.next().unwrap_or(last);
            last
        };
        records.push(job.run(filter, &|_| {})?);
    }
    Ok(experiment(plan, model, records)?)
}

/// What there is to run, record by record.
fn jobs<'a>(
    plan: &'a Plan,
    model: &'a Model,
    compensator: Option<&'a CompensatorDesign>,
) -> Result<Vec<Job<'a>>, BenchError> {
    let output = model_output(model);
    plan.records
        .iter()
        .zip(file_names(&plan.records))
        .enumerate()
        .map(|(index, (record, file))| {
            let signal = Signal::new(plan, record, &KeyPath::root().key("record").item(index))?;
            Ok(Job { plan, record, file, signal, model, compensator, output })
        })
        .collect()
}

/// The experiment of these records, with its noise.
fn experiment(plan: &Plan, model: &Model, records: Vec<Record>) -> Result<Experiment, BenchError> {
    let mut experiment = Experiment {
        name: plan.name.clone(),
        output: model_output(model),
        sample_rate_hz: Some(f64::from(plan.sample_rate_hz)),
        esc_frame_hz: plan.esc_frame_hz,
        command_rate_hz: (plan.loop_rate_hz != plan.sample_rate_hz).then_some(f64::from(plan.loop_rate_hz)),
        records,
    };
    add_noise(&mut experiment, plan.noise, plan.seed)?;
    Ok(experiment)
}

/// Adds sensor noise to the thrust of every record: stream `k` of `seed` to record `k`. What [`run`] does last; on its
/// own it makes many noisy experiments out of one without noise.
///
/// # Errors
/// [`PlantError`] when the noise is impossible.
pub fn add_noise(experiment: &mut Experiment, noise: Noise, seed: u64) -> Result<(), PlantError> {
    noise.check(&KeyPath::root()).map_err(PlantError::Noise)?;
    if noise.is_silent() {
        return Ok(());
    }
    for (stream, record) in (0..).zip(&mut experiment.records) {
        let mut source = SensorNoise::new(noise, seed, stream)?;
        if let Some(thrust_n) = &mut record.thrust_n {
            for (thrust_n, &time_s) in thrust_n.iter_mut().zip(&record.time_s) {
                *thrust_n += source.sample(time_s);
            }
        }
    }
    Ok(())
}

fn check(plan: &Plan, model: &Model, compensator: Option<&CompensatorDesign>) -> Result<(), BenchError> {
    plan.check()?;
    check_compensator(plan, compensator)?;
    if model_output(model) == Output::Rpm && !plan.noise.is_silent() {
        return Err(BenchError::NoiseUnit);
    }
    Ok(())
}

/// Refuses a compensator that is not the plan's.
pub(super) fn check_compensator(plan: &Plan, compensator: Option<&CompensatorDesign>) -> Result<(), BenchError> {
    match (&plan.compensator, compensator) {
        (Some(file), None) => Err(BenchError::CompensatorMissing { file: file.display().to_string() }),
        (None, Some(_)) => Err(BenchError::CompensatorNotNamed),
        (Some(_), Some(design)) if design.loop_rate_hz() != f64::from(plan.loop_rate_hz) => {
            Err(BenchError::LoopRate { designed_hz: design.loop_rate_hz(), loop_rate_hz: plan.loop_rate_hz })
        }
        _ => Ok(()),
    }
}

/// What the model's response is: thrust where it does not say.
fn model_output(model: &Model) -> Output {
    model.provenance.as_ref().map_or(Output::ThrustN, |provenance| provenance.output)
}

/// `u050_multisine.csv`: the nominal command in hundredths (in ten-thousandths where that is not enough) and the
/// excitation; the second one of the same name gets `_2`.
fn file_names(records: &[PlannedRecord]) -> Vec<String> {
    let mut seen = HashMap::new();
    records
        .iter()
        .map(|record| {
            let name = file_stem(record.nominal, record.excitation);
            let count = seen.entry(name.clone()).and_modify(|count| *count += 1).or_insert(1);
            if *count == 1 { format!("{name}.csv") } else { format!("{name}_{count}.csv") }
        })
        .collect()
}

/// `u050_multisine`, of a record's file name.
pub fn file_stem(nominal: f64, excitation: Excitation) -> String {
    let hundredths = nominal * 100.0;
    // Chosen: 1e-6 is above the rounding of decimals, and below the hundredth that a name of five digits shows.
    let nominal = if (hundredths - hundredths.round()).abs() < 1e-6 {
        format!("{hundredths:03.0}")
    } else {
        format!("{:05.0}", nominal * 1e4)
    };
    format!("u{nominal}_{}", excitation.name())
}

/// One record that is to be run.
struct Job<'a> {
    plan: &'a Plan,
    record: &'a PlannedRecord,
    file: String,
    signal: Signal,
    model: &'a Model,
    compensator: Option<&'a CompensatorDesign>,
    output: Output,
}

impl Job<'_> {
    fn ticks(&self) -> usize {
        self.signal.warm_up_ticks + self.signal.ticks
    }

    /// The controller's own filter.
    fn filter(&self) -> impl FnMut(Command) -> Command {
        let mut compensator = self.compensator.map(|design| design.running(self.signal.start));
        move |sample| compensator.as_mut().map_or(sample, |compensator| compensator.update(sample))
    }

    fn run(&self, mut filter: impl FnMut(Command) -> Command, report: &dyn Fn(usize)) -> Result<Record, BenchError> {
        let Signal { start, samples, warm_up_ticks, ticks, .. } = &self.signal;
        let loop_rate_hz = f64::from(self.plan.loop_rate_hz);
        let sample_rate_hz = f64::from(self.plan.sample_rate_hz);
        let ticks_per_row = (self.plan.loop_rate_hz / self.plan.sample_rate_hz) as usize;
        let is_inverse = self.compensator.is_some_and(|design| design.as_inverse().is_some());
        let law = match self.record.excitation {
            // Its commands are far from what the rotor does, and its table follows the rotor.
            _ if is_inverse => Law::FollowingSpeed(start.to_f64()),
            Excitation::Staircase => Law::FollowingLevel(start.to_f64()),
            _ => Law::LinearAround(self.record.nominal),
        };
        let timing = EscTiming { frame_hz: self.plan.esc_frame_hz, frame_phase: self.plan.esc_frame_phase };
        let mut actuator = Actuator::new(self.model, law, timing)?;
        let rows = ticks / ticks_per_row;
        let column = || Vec::with_capacity(rows);
        let (mut time_s, mut command, mut esc_command) = (column(), column(), column());
        let mut seen = Seen { rows, response: column(), voltage_v: Vec::new(), current_a: Vec::new() };
        let recorded = *warm_up_ticks..warm_up_ticks + ticks;
        // A logger whose clock is slow takes its last rows after the last recorded tick: a period goes on, a level stays.
        let after = self.signal.period_s.map_or(samples.len() - 1, |_| 0);
        let sample_of = |tick: usize| match tick < recorded.end {
            true => samples[tick % samples.len()],
            false => samples[after.max(tick % samples.len())],
        };
        let mut tick = 0;
        while tick < recorded.end || seen.response.len() < rows {
            let to_esc = filter(sample_of(tick));
            if tick == recorded.start {
                actuator.start_record();
            }
            if recorded.contains(&tick) && (tick - recorded.start) % ticks_per_row == 0 {
                time_s.push(((tick - recorded.start) / ticks_per_row) as f64 / sample_rate_hz);
                command.push(sample_of(tick).to_f64());
                esc_command.push(to_esc.to_f64());
                if !actuator.has_own_clock() {
                    seen.take(&actuator);
                }
            }
            let end_s = (tick + 1) as f64 / loop_rate_hz;
            if actuator.has_own_clock() && tick >= recorded.start {
                seen.take_until(end_s, sample_rate_hz, &mut actuator, to_esc.to_f64());
            }
            actuator.advance(to_esc.to_f64(), end_s);
            tick += 1;
            if tick <= recorded.end && tick % samples.len() == 0 {
                report(samples.len());
            }
        }

        let Seen { response, voltage_v, current_a, .. } = seen;
        let (thrust_n, rpm) = match self.output {
            Output::ThrustN => (Some(response), None),
            Output::Rpm => (None, Some(response)),
        };
        Ok(Record {
            file: self.file.clone(),
            nominal: self.record.nominal,
            excitation: self.record.excitation,
            period_s: self.signal.period_s,
            amplitude: Some(self.signal.amplitude),
            compensated: self.compensator.is_some(),
            compensator: self.plan.compensator.clone(),
            role: self.record.role,
            time_s,
            command,
            thrust_n,
            rpm,
            command_log: None,
            esc_command: self.compensator.map(|_| esc_command),
            voltage_v: (!voltage_v.is_empty()).then_some(voltage_v),
            current_a: (!current_a.is_empty()).then_some(current_a),
            setpoints: rotorlead_records::Setpoints::default(),
        })
    }
}

/// What the logger has seen so far.
struct Seen {
    /// How many rows it is to take.
    rows: usize,
    response: Vec<f64>,
    voltage_v: Vec<f64>,
    current_a: Vec<f64>,
}

impl Seen {
    fn take(&mut self, actuator: &Actuator) {
        self.response.push(actuator.response());
        if let Some(supply) = actuator.supply_measurement() {
            self.voltage_v.push(supply.voltage_v);
            self.current_a.push(supply.current_a);
        }
    }

    /// Takes the rows that the logger's own clock puts before `end_s`, while the command stays.
    fn take_until(&mut self, end_s: f64, sample_rate_hz: f64, actuator: &mut Actuator, command: f64) {
        while self.response.len() < self.rows {
            let moment_s = actuator.moment_of_row(self.response.len() as f64 / sample_rate_hz);
            if moment_s >= end_s {
                return;
            }
            actuator.advance(command, moment_s);
            self.take(actuator);
        }
    }
}
