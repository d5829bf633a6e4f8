//! From the motors of a vehicle to their compensator, without a stand: each is measured, identified and judged, a compensator is designed for
//! all of them, and the controller gets it. Before anything turns or is written, an [`Operator`] is asked.

mod changes;
mod error;
mod speeds;

use std::path::Path;

pub use error::OptionsFault;
use miette::{IntoDiagnostic as _, WrapErr as _, miette};
use rotorlead::design::{SHORTEST_SPEED_RANGE, SpeedCurve};
use rotorlead::settings::{MOTORS, Settings};
use rotorlead_answer::words::counted;
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{InverseOptions, Latency};
use rotorlead_device::{
    DeviceError, Header, Keeper, Sensors, Series, Session, Signal, bench_frame_hz, change_with_filters, excite,
};
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::{Judgement, Model, Readiness};
use rotorlead_records::{Experiment, Role};
use rotorlead_results::{Chosen, DesignRequest, DesignResult, IdentifyResult, Kind};
use rotorlead_vehicle::Purpose;
use serde_json::{Map, Value, json};

use self::changes::{changes, summary};
use self::error::TuneError;
use self::speeds::{correct_by, measured_speeds};

/// The file of a motor's model.
pub const MODEL_FILE: &str = "model.toml";
/// The file of its compensator.
pub const COMPENSATOR_FILE: &str = "compensator.toml";

/// Part of the highest speed that a motor reaches at least at the highest of the commands. Chosen: a number of magnets that is twice the true
/// one halves the speed, while `--most-rpm` leaves a motor room of a tenth or a fifth.
const LEAST_OF_MOST: f64 = 0.6;

/// What a motor does to its surroundings while nobody but the host drives it.
const CONDITIONS: [&str; 3] = [
    "Is the vehicle fastened so that it cannot move, and is nobody near its propellers?",
    "Are the flight controller's signals disconnected, and the ESCs powered?",
    "Can you cut the ESCs' power at once?",
];

/// What is tuned, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneOptions {
    /// The motors, from 0; one after the other.
    pub motors: Vec<u8>,
    /// Commands around which to play: those of a flight.
    pub nominal: Vec<f64>,
    /// What is played around them.
    pub signal: Signal,
    /// What measures the response, and the speed that no motor may reach.
    pub sensors: Sensors,
    /// The compensator; what is recommended for the purpose unless given.
    pub kind: Option<Kind>,
    /// For what a compensator is chosen.
    pub purpose: Purpose,
    /// Whether the inverse goes by the ESCs' replies in flight.
    pub rpm: bool,
    /// Whether motors are taken that were judged as ready within limits.
    pub accept_limits: bool,
}

/// Who sees to the vehicle, and where things are kept.
pub trait Operator {
    /// Says what is about to be done, before the first question.
    fn announce(&mut self, what: &str);

    /// Says what was found and is to be set, before the last question.
    fn propose(&mut self, summary: &str);

    /// Whether a question is answered with yes ([`is_yes`]).
    fn is_confirmed(&mut self, question: &str) -> bool;

    /// Makes the place for all that is kept, and gives what the user calls it.
    ///
    /// # Errors
    /// When it cannot be made; no motor has turned by then.
    fn prepare(&mut self) -> miette::Result<String>;

    /// The place for a motor's records, model and compensator.
    ///
    /// # Errors
    /// When it cannot be made.
    fn keeper(&mut self, motor: u8, header: Header) -> miette::Result<Box<dyn Keeper>>;

    /// Says that a motor is being played on, and how many rows of so many are there.
    fn playing(&self, motor: u8, nominal: f64, rows: usize, total: usize);

    /// Says that no motor turns any more.
    fn at_rest(&mut self) {}
}

/// What was found, set and stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// What was found of each motor, and what was set, in words.
    pub summary: String,
    /// What the controller says of its settings.
    pub warnings: Vec<String>,
    /// All of it for programs.
    pub json: Value,
}

/// A motor with what was found of it.
struct MeasuredMotor {
    motor: u8,
    keeper: Box<dyn Keeper>,
    model: Model,
    judgement: Judgement,
    /// Where they are to correct the inverse.
    speeds: Option<SpeedCurve>,
}

impl TuneOptions {
    /// Tunes the motors and stores their compensator.
    ///
    /// # Errors
    /// A [`DeviceError`], whatever the measurements are refused for, or a question that was not answered with yes. Settings are changed at
    /// the end or not at all.
    pub fn tune(&self, session: &mut Session, operator: &mut dyn Operator) -> miette::Result<Tuning> {
        let levels = self.levels()?;
        let settings = session.settings()?;
        self.sensors.check(&settings)?;
        self.check_paths(&settings)?;
        check_controller(session)?;
        let place = operator.prepare()?;
        operator.announce(&self.announcement(&settings, &levels));
        for question in CONDITIONS {
            confirm(operator, question, "no motor has turned, and no setting was changed")?;
        }
        let mut motors = Vec::new();
        for &motor in &self.motors {
            let frame_hz = bench_frame_hz(&settings);
            let header = Header::new(&settings, motor, self.signal.divisor, frame_hz, self.sensors.output())?;
            let mut keeper = operator.keeper(motor, header)?;
            self.measure(session, &settings, motor, keeper.as_mut(), &levels, operator)?;
            motors.push(self.identify(motor, keeper)?);
        }
        operator.at_rest();
        let designs = self.design(&settings, &mut motors, &place)?;
        let mut changes = changes(&settings, &motors, &designs)?;
        if self.rpm {
            if designs.iter().any(|design| design.compensator.as_inverse().is_none()) {
                return Err(TuneError::NoInverse { folder: place }.into());
            }
            let speeds = motors.iter().filter_map(|one| Some((one.motor, one.speeds?)));
            correct_by(&mut changes, &settings, &speeds.collect::<Vec<_>>());
        }
        let changed = change_with_filters(&settings, &changes)?;
        let summary = summary(&motors, &designs, &changes);
        operator.propose(&summary);
        confirm(operator, "Write these settings and store them?", "no setting was changed")?;
        let warnings: Vec<String> = session.set_settings(&changed)?.iter().map(|warning| warning.to_string()).collect();
        session.save()?;
        let found: Vec<Value> = motors
            .iter()
            .zip(&designs)
            .map(|(one, design)| {
                let points = &one.model.points;
                json!({ "motor": one.motor, "judgement": one.judgement, "points": points, "compensator": design.compensator.stored() })
            })
            .collect();
        let set: Map<String, Value> = changes.iter().map(|(key, value)| (key.clone(), json!(value))).collect();
        let json = json!({ "motors": found, "set": set, "warnings": warnings, "saved": true });
        Ok(Tuning { summary, warnings, json })
    }

    /// The levels in their order, where they and the motors are such.
    ///
    /// # Errors
    /// [`OptionsFault`], where they are not.
    pub fn levels(&self) -> Result<Vec<f64>, OptionsFault> {
        let mut levels = self.nominal.clone();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let (Some(lowest), Some(highest), Some(_)) = (levels.first(), levels.last(), self.motors.first()) else {
            return Err(OptionsFault::new(
                "there is nothing to play",
                "give --motors, and the commands with --nominal",
            ));
        };
        if let Some(motor) = self.motors.iter().find(|motor| usize::from(**motor) >= MOTORS) {
            return Err(OptionsFault::new(
                format!("there is no motor {motor}"),
                format!("count them from 0 to {}", MOTORS - 1),
            ));
        }
        if self.rpm && highest - lowest < SHORTEST_SPEED_RANGE.to_f64() {
            let problem = format!("--rpm takes two commands or more, {} apart", SHORTEST_SPEED_RANGE.to_f64());
            return Err(OptionsFault::new(problem, "give more with --nominal"));
        }
        if self.rpm && self.kind == Some(Kind::Lead) {
            return Err(OptionsFault::new("--rpm corrects an inverse, and --kind is lead", "leave one of them out"));
        }
        let is_twice = |(index, motor): (usize, &u8)| self.motors[..index].contains(motor);
        if self.motors.iter().enumerate().any(is_twice) {
            return Err(OptionsFault::new("--motors names a motor twice", "name each once"));
        }
        Ok(levels)
    }

    /// What turns, and for how long.
    fn announcement(&self, settings: &Settings, levels: &[f64]) -> String {
        let seconds = self.signal.seconds(settings) * ((levels.len() + 1) * self.motors.len()) as f64;
        format!(
            "{} at commands up to {:.3}, for {} in all.",
            match self.motors[..] {
                [motor] => format!("Motor {motor} turns"),
                _ => format!("{} motors turn, one after the other,", self.motors.len()),
            },
            levels[levels.len() - 1] + self.signal.amplitude,
            counted((seconds / 60.0).ceil() as usize, "minute")
        )
    }

    /// Whether the motors are to be measured as they are, and no other gets a compensator that nobody has measured for it.
    fn check_paths(&self, settings: &Settings) -> Result<(), TuneError> {
        let Some(motor) = settings.motors.iter().position(|motor| motor.compensate) else { return Ok(()) };
        let is_tuned = self.motors.iter().any(|&tuned| usize::from(tuned) == motor);
        Err(TuneError::HasCompensator { motor, is_tuned })
    }

    /// Plays on one motor, from the lowest command on, and last once more at the middle one, for a record that nothing is fitted to. What it
    /// reaches at one says whether the next is allowed.
    fn measure(
        &self,
        session: &mut Session,
        settings: &Settings,
        motor: u8,
        keeper: &mut dyn Keeper,
        levels: &[f64],
        operator: &dyn Operator,
    ) -> miette::Result<()> {
        let mut play = |nominal: f64, role: Option<Role>, keeper: &mut dyn Keeper| {
            let series = Series { motor, signal: self.signal, sensors: self.sensors, role };
            let progress = |rows, total| operator.playing(motor, nominal, rows, total);
            excite(session, settings, &series, &[nominal], keeper, &progress)
                .wrap_err_with(|| format!("motor {motor} was not measured, and no setting was changed"))
        };
        for (index, &nominal) in levels.iter().enumerate() {
            play(nominal, None, keeper)?;
            if let Some(most_rpm) = self.sensors.most_rpm {
                let next = levels.get(index + 1).copied();
                check_speed(motor, &keeper.experiment()?, (nominal, next), most_rpm)?;
            }
        }
        play(levels[levels.len() / 2], Some(Role::Validate), keeper).map(drop)
    }

    /// The model of a motor, which is written, where a compensator may be built on it.
    fn identify(&self, motor: u8, mut keeper: Box<dyn Keeper>) -> miette::Result<MeasuredMotor> {
        let experiment = keeper.experiment()?;
        let mut found = IdentifyResult::identify(&experiment, &IdentifyOptions::default())
            .wrap_err_with(|| format!("nothing was identified of motor {motor}, and no setting was changed"))?;
        let provenance = found.identification.model.provenance.iter_mut();
        provenance.for_each(|from| from.records_crc32 = keeper.checksum());
        let model = found.identification.model;
        keeper.write(MODEL_FILE, &model.text(Path::new(MODEL_FILE))?)?;
        let judgement = found.assessment.judgement;
        let is_ready = match judgement.state {
            Readiness::Ready => true,
            Readiness::ReadyWithinLimits => self.accept_limits,
            Readiness::MeasureAgain | Readiness::NotALag => false,
        };
        if !is_ready {
            return Err(TuneError::NotReady { motor, judgement, folder: keeper.place() }.into());
        }
        let speeds = self.sensors.motor_poles.filter(|_| self.rpm).map(|poles| measured_speeds(&experiment, poles));
        let speeds = speeds.transpose().map_err(|reason| TuneError::NoSpeeds { motor, reason })?;
        Ok(MeasuredMotor { motor, keeper, model, judgement, speeds })
    }

    /// A compensator for each motor, alike in all that the controller has for all of them: an inverse with the slowest of the reference
    /// models that are recommended, or the lead of the fastest motor.
    fn design(
        &self,
        settings: &Settings,
        motors: &mut [MeasuredMotor],
        place: &str,
    ) -> miette::Result<Vec<DesignResult>> {
        let loop_rate_hz = f64::from(settings.loop_rate_hz);
        let latency = Latency::new(settings.input, settings.output, loop_rate_hz).into_diagnostic()?;
        let request = DesignRequest {
            kind: self.kind,
            loop_rate_hz: Some(loop_rate_hz),
            slew_per_s: (settings.slew_per_s > 0.0).then_some(settings.slew_per_s),
            ..DesignRequest::default()
        };
        let failed = |motor: u8| format!("motor {motor} gets no compensator, and no setting was changed");
        let chosen: Vec<Chosen> = motors
            .iter()
            .map(|one| {
                let chosen = request.chosen(&one.model, self.purpose, None);
                chosen.map_err(miette::Report::from).wrap_err_with(|| failed(one.motor))
            })
            .collect::<miette::Result<_>>()?;
        let inverses: Vec<InverseOptions> = chosen
            .iter()
            .filter_map(|one| if let KindOptions::Inverse(options) = one.options { Some(options) } else { None })
            .collect();
        if !inverses.is_empty() && inverses.len() < chosen.len() {
            return Err(TuneError::Mixed { folder: place.to_owned() }.into());
        }
        let natural_rad_s = inverses.iter().filter_map(|options| options.omega_f_rad_s).reduce(f64::min);
        let mut designs = Vec::new();
        for (one, chosen) in motors.iter_mut().zip(chosen) {
            let options = match chosen.options {
                KindOptions::Inverse(options) => {
                    KindOptions::Inverse(InverseOptions { omega_f_rad_s: natural_rad_s, ..options })
                }
                lead @ KindOptions::Lead(_) => lead,
            };
            let design = DesignResult::design(&one.model, Chosen { options, ..chosen }, latency)
                .map_err(miette::Report::from)
                .wrap_err_with(|| failed(one.motor))?;
            let file = Path::new(COMPENSATOR_FILE);
            one.keeper.write(COMPENSATOR_FILE, &design.compensator.text(file)?)?;
            designs.push(design);
        }
        Ok(designs)
    }
}

/// Whether an answer is yes, in full.
#[must_use]
pub fn is_yes(answer: &str) -> bool {
    answer.trim().eq_ignore_ascii_case("yes")
}

/// Asks, and goes on after a yes alone.
fn confirm(operator: &mut dyn Operator, question: &'static str, done: &'static str) -> Result<(), TuneError> {
    if operator.is_confirmed(question) { Ok(()) } else { Err(TuneError::NotConfirmed { question, done }) }
}

/// Whether a motor turned as fast as it should at the last command, and would not turn too fast at the next, if there is one.
fn check_speed(
    motor: u8,
    experiment: &Experiment,
    (nominal, next): (f64, Option<f64>),
    most_rpm: f64,
) -> Result<(), TuneError> {
    let Some(rpm) = experiment.records.last().and_then(|record| Some(mean(record.rpm.as_ref()?))) else {
        return Ok(());
    };
    // A rotor with its propeller turns less than in proportion to its command.
    let expected = next.map(|next| (next, rpm * next / nominal));
    match expected {
        Some((next, expected)) if expected > most_rpm => {
            Err(TuneError::WouldBeTooFast { motor, rpm, nominal, expected, next, most_rpm })
        }
        None if rpm < LEAST_OF_MOST * most_rpm => Err(TuneError::TooSlow { motor, rpm, nominal, most_rpm }),
        _ => Ok(()),
    }
}

/// Whether this controller may turn motors for the host.
fn check_controller(session: &mut Session) -> miette::Result<()> {
    let info = session.info()?;
    if !info.bench_enabled {
        return Err(miette!(
            help = "fit the jumper of docs/wiring.md, and take it out again before a flight",
            "the bench jumper is not fitted: no motor turns for a host"
        ));
    }
    if !info.outputs_enabled {
        let help = "`rotorlead device set output.protocol PROTOCOL` first, and `save`".to_owned();
        return Err(DeviceError::NotChosen { act: "tuning", help }.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_but_a_whole_yes_is_one() {
        for (answer, expected) in
            [("yes\n", true), (" YES \n", true), ("y\n", false), ("", false), ("no\n", false), ("yes please\n", false)]
        {
            assert_eq!(is_yes(answer), expected, "{answer:?}");
        }
    }
}
