//! Records replayed through the law that a simulator will run with the exported numbers, and the model on the same rows.

use rotorlead_identify::goodness_of_fit::fit_percent;
use rotorlead_identify::simulation::{align, fit_initial_state, run_record};
use rotorlead_identify::validate::{ComparedRow, Comparison, validate};
use rotorlead_plant::effect::{asymmetric_lag, slew_limit, transport_delay};
use rotorlead_plant::{ActiveEffect, Actuator, EscTiming, Lagged, Law, Model, OperatingCurve, Point, RotorBase};
use rotorlead_records::{Excitation, Experiment, Output, Record, Role};
use serde::Serialize;

use super::definition::StackParameter;
use super::rotor::RPM;
use super::{KnownMotor, Lagging, Stack, StackOptions, Stepping};

/// A simulator on the records.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Replay {
    /// The law that it runs.
    pub stepping: &'static Stepping,
    /// Its steps, seconds.
    pub step_s: f64,
    /// The time constants that these steps have in truth, of a rising and a falling speed, seconds; `None` where they overshoot.
    pub effective_time_constant_s: [Option<f64>; 2],
    /// How it explains each record; none where its steps diverge.
    pub records: Vec<RecordFit>,
    /// What the model has and it does not hold.
    pub not_held: Vec<String>,
}

/// Simulator and model on one record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordFit {
    /// The record's file.
    pub file: String,
    /// % fit of the simulator.
    pub fit_percent: f64,
    /// % fit of the model on the same rows.
    pub model_fit_percent: f64,
}

/// Records that show a lag, with the model on their rows.
pub struct ReplayRecords<'a> {
    model: &'a Model,
    experiment: &'a Experiment,
    compared: Vec<ComparedRecord<'a>>,
    /// Whether they are kept out of fits.
    pub held_out: bool,
}

struct ComparedRecord<'a> {
    record: &'a Record,
    rows: Vec<ComparedRow>,
    model_fit_percent: f64,
}

/// What steps a motor in a simulator.
struct SimulatedMotor {
    stepping: &'static Stepping,
    step_s: f64,
    /// Of a rising and a falling speed, seconds.
    time_constants_s: [f64; 2],
    /// To which power of the response the lag applies.
    exponent: f64,
    /// The highest rate of what lags, per second; `None` without a limit.
    most_per_s: Option<f64>,
    dead_steps: usize,
    range: (f64, f64),
}

impl<'a> ReplayRecords<'a> {
    /// The records that are kept out of fits, or all where none is, and the model on them; `None` where none moves its command.
    ///
    /// # Errors
    /// Why the model cannot be compared with them.
    pub fn new(model: &'a Model, experiment: &'a Experiment) -> Result<Option<Self>, String> {
        let moves = |record: &&Record| record.excitation != Excitation::Steady && !record.time_s.is_empty();
        let held_out = experiment.records.iter().any(|record| record.role == Some(Role::Validate));
        let chosen = |record: &&Record| moves(record) && (!held_out || record.role == Some(Role::Validate));
        let records: Vec<&Record> = experiment.records.iter().filter(chosen).collect();
        if records.is_empty() {
            return Ok(None);
        }
        let compared = records.into_iter().map(|record| compared(model, experiment, record));
        Ok(Some(Self { model, experiment, compared: compared.collect::<Result<_, _>>()?, held_out }))
    }

    /// The records through each version of a simulator that differs; empty for a stack that is none.
    ///
    /// # Errors
    /// Which of the simulator's numbers is not known.
    pub fn replays(&self, stack: Stack, options: StackOptions) -> Result<Vec<Replay>, String> {
        let known = KnownMotor::new(stack, self.model, Some(self.experiment), options);
        let replays = stack.steppings().iter().map(|stepping| {
            let motor = SimulatedMotor::new(&known, stepping, self.experiment.output, options.step_s)?;
            let [up, down] = motor.time_constants_s;
            let effective = |time_constant_s| stepping.effective_time_constant_s(time_constant_s, motor.step_s);
            let records = match motor.diverges() {
                true => Vec::new(),
                false => self.compared.iter().map(|compared| self.fit(&motor, compared)).collect::<Result<_, _>>()?,
            };
            Ok(Replay {
                stepping,
                step_s: motor.step_s,
                effective_time_constant_s: [effective(up), effective(down)],
                records,
                not_held: not_held(&known, &motor, self.experiment),
            })
        });
        replays.collect()
    }

    fn fit(&self, motor: &SimulatedMotor, compared: &ComparedRecord) -> Result<RecordFit, String> {
        let (record, rows) = (compared.record, &compared.rows);
        let time_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
        let measured: Vec<f64> = rows.iter().map(|row| row.measured).collect();
        let curve = OperatingCurve::without_effects(self.model).map_err(|error| error.to_string())?;
        let base = if follows_level(record.excitation) {
            RotorBase::Level(curve)
        } else {
            let point = OperatingCurve::around_without_effects(self.model, record.nominal);
            RotorBase::Linear(point.map_err(|error| error.to_string())?)
        };
        let simulated = motor.run(record, &time_s, |command| base.at(command).response);
        let tau_s = base.at(esc_command(record)[first_row(record, time_s[0])]).lag.time_constant_s;
        // As free as the model is: `validate` lets levels that a map gives stand.
        let simulated = if follows_level(record.excitation) && self.model.static_map.is_some() {
            let start = fit_initial_state(&time_s, &measured, &simulated, tau_s);
            let free = |t_s: &f64| start * (-(t_s - time_s[0]) / tau_s).exp();
            simulated.iter().zip(&time_s).map(|(response, t_s)| response + free(t_s)).collect()
        } else {
            align(&time_s, &measured, &simulated, tau_s)
        };
        let percent = fit_percent(&measured, &simulated).filter(|percent| percent.is_finite());
        Ok(RecordFit {
            file: record.file.clone(),
            fit_percent: percent.ok_or_else(|| format!("{}: its response is constant", record.file))?,
            model_fit_percent: compared.model_fit_percent,
        })
    }
}

/// The model on a record's rows; a multisine, which `validate` compares in frequency, in time as well.
fn compared<'a>(model: &Model, experiment: &Experiment, record: &'a Record) -> Result<ComparedRecord<'a>, String> {
    let Experiment { name, output, sample_rate_hz, esc_frame_hz, command_rate_hz, records: _ } = experiment;
    let one = Experiment {
        name: name.clone(),
        output: *output,
        sample_rate_hz: *sample_rate_hz,
        esc_frame_hz: *esc_frame_hz,
        command_rate_hz: *command_rate_hz,
        records: vec![record.clone()],
    };
    let validation = validate(&one, model).map_err(|error| error.to_string())?.remove(0);
    let (rows, model_fit_percent) = match validation.comparison {
        Comparison::Time(rows) => (rows, validation.fit_percent),
        Comparison::Frequency(_) => {
            let measured = record.response(experiment.output).unwrap_or_default();
            let timing = EscTiming { frame_hz: experiment.esc_frame_hz, frame_phase: 0.0 };
            let actuator = Actuator::new(model, Law::LinearAround(record.nominal), timing);
            let mut actuator = actuator.map_err(|error| error.to_string())?;
            let tau_s = model.at(record.nominal).map_err(|error| error.to_string())?.time_constant_s;
            let response = run_record(&mut actuator, record, esc_command(record), 0);
            let response = align(&record.time_s, measured, &response, tau_s);
            let percent = fit_percent(measured, &response).filter(|percent| percent.is_finite());
            let percent = percent.ok_or_else(|| format!("{}: the model has no fit in time", record.file))?;
            let row = |((&time_s, &measured), &model): ((&f64, &f64), &f64)| ComparedRow { time_s, measured, model };
            (record.time_s.iter().zip(measured).zip(&response).map(row).collect(), percent)
        }
    };
    Ok(ComparedRecord { record, rows, model_fit_percent })
}

/// Whether `validate` follows the level of such a record, and is not linear around its nominal command.
fn follows_level(excitation: Excitation) -> bool {
    matches!(excitation, Excitation::Staircase | Excitation::Steady | Excitation::Flight | Excitation::Free)
}

/// What the ESC got.
fn esc_command(record: &Record) -> &[f64] {
    record.esc_command.as_deref().filter(|_| record.compensated).unwrap_or(&record.command)
}

fn first_row(record: &Record, from_s: f64) -> usize {
    record.time_s.partition_point(|t_s| *t_s < from_s).min(record.time_s.len() - 1)
}

impl Stepping {
    /// To which power of a response the lag applies. Thrust is taken to go with the square of the speed. Without a static map the zero of
    /// the response is not known, and small motions have the same lag either way.
    fn exponent(&self, model: &Model, output: Output) -> f64 {
        match (self.lagging, output) {
            _ if model.static_map.is_none() => 1.0,
            (Lagging::Speed, Output::ThrustN) => 0.5,
            (Lagging::Thrust, Output::Rpm) => 2.0,
            (Lagging::Speed, Output::Rpm) | (Lagging::Thrust, Output::ThrustN) => 1.0,
        }
    }
}

impl SimulatedMotor {
    fn new(
        known: &KnownMotor,
        stepping: &'static Stepping,
        output: Output,
        step_s: Option<f64>,
    ) -> Result<Self, String> {
        let value = |quantity| known.raw(quantity).map(|raw| raw.band.value);
        let time_constants_s = match (stepping.has_lag(), stepping.has_directions) {
            (false, _) => [0.0; 2],
            (true, false) => [value(StackParameter::TimeConstant)?; 2],
            (true, true) => [value(StackParameter::TimeConstantUp)?, value(StackParameter::TimeConstantDown)?],
        };
        let exponent = stepping.exponent(known.model, output);
        // What lags over the rotor speed in rad/s: rpm, or the root of the thrust. Thrust itself has no rate of the speed.
        let per_rad_s = match output {
            Output::Rpm => Ok(RPM.recip()),
            Output::ThrustN if exponent < 1.0 => value(StackParameter::MotorConstant).map(f64::sqrt),
            Output::ThrustN => Err(String::new()),
        };
        let most_per_s = value(StackParameter::SpeedRate).and_then(|rad_s2| Ok(rad_s2 * per_rad_s?)).ok();
        Ok(Self {
            stepping,
            step_s: step_s.unwrap_or(stepping.step_s),
            time_constants_s,
            exponent,
            most_per_s: most_per_s.filter(|_| stepping.has_rate_limit),
            // A dead time that is none has no steps.
            dead_steps: stepping.late_steps
                + value(StackParameter::DeadTimeSteps)
                    .ok()
                    .filter(|_| stepping.has_dead_time)
                    .map_or(0, |steps| steps as usize),
            range: known.range,
        })
    }

    /// Whether steps grow without end.
    fn diverges(&self) -> bool {
        self.stepping.has_lag()
            && self.time_constants_s.iter().any(|tau_s| self.stepping.share(*tau_s, self.step_s) >= 2.0)
    }

    /// Its response at times in the record, from rest at the command of the first. Each step holds the command of its start, as a
    /// simulation does; between steps the response is straight.
    fn run(&self, record: &Record, rows_s: &[f64], steady: impl Fn(f64) -> f64) -> Vec<f64> {
        let first = first_row(record, rows_s[0]);
        let (changes_s, commands) = record
            .command_changes(first..record.time_s.len())
            .unwrap_or_else(|| (record.time_s[first..].to_vec(), esc_command(record)[first..].to_vec()));
        let power = |value: f64, exponent: f64| value.abs().powf(exponent).copysign(value);
        let target = |step: usize| {
            let at_s = rows_s[0] + step.saturating_sub(self.dead_steps) as f64 * self.step_s;
            // A stamp that is a step's but for rounding counts as that.
            let row = changes_s.partition_point(|t_s| *t_s <= at_s + ROUNDING * self.step_s).saturating_sub(1);
            power(steady(commands[row].min(self.range.1)), self.exponent)
        };
        let most_per_s = self.most_per_s.unwrap_or(f64::INFINITY);
        let (mut before, mut step) = (target(0), 0_usize);
        let mut after = before;
        let response = |row_s: &f64| {
            let steps = (row_s - rows_s[0]) / self.step_s;
            while (step as f64) < steps {
                before = after;
                let error = target(step) - before;
                let [up_s, down_s] = self.time_constants_s;
                let tau_s = if error < 0.0 { down_s } else { up_s };
                after = before + self.stepping.advance(error, tau_s, self.step_s, most_per_s);
                step += 1;
            }
            let [before, after] = [before, after].map(|value| power(value, 1.0 / self.exponent));
            after - (after - before) * (step as f64 - steps)
        };
        rows_s.iter().map(response).collect()
    }
}

/// Part of a step by which stamps are off for their digits. Chosen: far above rounding, far below what a step resolves.
const ROUNDING: f64 = 1e-6;

/// What the model has and the simulator does not hold.
fn not_held(known: &KnownMotor, motor: &SimulatedMotor, experiment: &Experiment) -> Vec<String> {
    let (model, stepping) = (known.model, motor.stepping);
    let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
    let mut missing = Vec::new();
    let points = model.points.iter().map(Point::lag);
    if let Some(delay_s) = points.clone().map(|lag| lag.delay_s).reduce(f64::max).filter(|delay_s| *delay_s > 0.0) {
        let held_s = (motor.dead_steps - stepping.late_steps) as f64 * motor.step_s;
        if held_s == 0.0 {
            missing.push(format!("a dead time of {} ms", ms(delay_s)));
        } else if ms(held_s) != ms(delay_s) {
            missing.push(format!("a dead time of {} ms, for which it has {} ms", ms(delay_s), ms(held_s)));
        }
    }
    if !stepping.has_lag() {
        missing.push(String::from("the lag itself"));
        return missing;
    }
    let value = |quantity| known.raw(quantity).map(|raw| raw.band.value).ok();
    if let (Some(up), Some(down), false) =
        (value(StackParameter::TimeConstantUp), value(StackParameter::TimeConstantDown), stepping.has_directions)
        && ms(up) != ms(down)
    {
        missing.push(format!("time constants of {} ms up and {} ms down", ms(up), ms(down)));
    }
    let taus = || points.clone().map(|lag| lag.time_constant_s);
    if let (Some(least), Some(most)) = (taus().reduce(f64::min), taus().reduce(f64::max))
        && ms(least) != ms(most)
    {
        missing.push(format!("a time constant from {} to {} ms over the commands measured", ms(least), ms(most)));
    }
    let speed_lags = model.static_map.as_ref().is_some_and(|map| map.lagged == Lagged::SquareRoot);
    if speed_lags && stepping.lagging == Lagging::Thrust {
        missing.push(String::from("a thrust that is the square of the speed that lags"));
    }
    if let Some(frame_hz) = experiment.esc_frame_hz {
        missing.push(format!("the ESC's frames of {frame_hz} Hz"));
    }
    let holds = |id: &str| match id {
        slew_limit::ID => motor.most_per_s.is_some(),
        asymmetric_lag::ID => stepping.has_directions,
        transport_delay::ID => stepping.has_dead_time,
        _ => false,
    };
    let effects = ActiveEffect::from_model(model).unwrap_or_default();
    if motor.most_per_s.is_some()
        && effects.iter().any(|effect| effect.kind().id == slew_limit::ID && effect.value("down_ratio") != Some(1.0))
    {
        missing.push(String::from("other rates of the command up than down"));
    }
    missing.extend(
        // Unequal lags are said by their time constants.
        effects
            .iter()
            .map(ActiveEffect::kind)
            .filter(|kind| !holds(kind.id) && kind.id != asymmetric_lag::ID)
            .map(|kind| kind.title.to_owned()),
    );
    missing
}
