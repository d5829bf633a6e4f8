//! `rotorlead device tune`: from the motors of a vehicle to their compensator, without a stand.

use std::fmt::Write as _;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Diagnostic, IntoDiagnostic as _, WrapErr as _, miette};
use rotorlead::controller::filters;
use rotorlead::design::{SHORTEST_SPEED_RANGE, SpeedCurve};
use rotorlead::settings::{Key, MOTORS, Settings};
use rotorlead_answer::words::{counted, warning};
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{InverseOptions, Latency};
use rotorlead_device::{DeviceError, Session, change, curve_text};
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::{CompensatorDesign, Judgement, Model, Readiness};
use rotorlead_records::files::{AcceptedRange, OutputFolder};
use rotorlead_records::{Experiment, Role};
use rotorlead_results::{Chosen, DesignRequest, DesignResult, IdentifyResult};
use serde_json::{Value, json};
use thiserror::Error;

use super::compensator;
use super::excite::{Excite, PlayedArguments};
use super::record::Sensor;
use super::tune_speeds::{correct_by, measured_speeds};
use crate::UsageError;
use crate::outcome::Outcome;
use crate::parameters::{KindName, PurposeOption, number};

/// Part of the highest speed that a motor reaches at least at the highest of the commands. Chosen: a number of magnets that is twice the true
/// one halves the speed, while `--most-rpm` leaves a motor room of a tenth or a fifth.
const LEAST_OF_MOST: f64 = 0.6;

/// What a motor does to its surroundings while nobody but the host drives it.
const CONDITIONS: [&str; 3] = [
    "Is the vehicle fastened so that it cannot move, and is nobody near its propellers?",
    "Are the flight controller's signals disconnected, and the ESCs powered?",
    "Can you cut the ESCs' power at once?",
];

#[derive(Args, Debug)]
pub(super) struct Tune {
    /// The folder that is made: of each motor its records, its model and its compensator
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// The motors, from 0; one after the other
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_value = "0,1,2,3")]
    motors: Vec<u8>,
    /// Commands around which to play, from the lowest on: those of a flight
    #[arg(long, value_name = "U,U,...", value_delimiter = ',', required = true, value_parser = number(AcceptedRange::DUTY))]
    nominal: Vec<f64>,
    /// The speed that no motor may reach, revolutions per minute: by its maker's table, with its propeller, at the highest of the commands,
    /// and a tenth more. Beyond it all stops
    #[arg(long, value_name = "RPM", value_parser = number(AcceptedRange::NUMBER), requires = "motor_poles", required_unless_present = "newtons_per_count")]
    most_rpm: Option<f64>,
    #[command(flatten)]
    played: PlayedArguments,
    #[command(flatten)]
    sensor: Sensor,
    /// The compensator; what is recommended for the purpose unless given
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    #[command(flatten)]
    purpose: PurposeOption,
    /// Have the inverse go by the ESCs' replies in flight (`compensator rpm`): battery and propeller then change the speed no more. Of two
    /// commands or more
    #[arg(long, requires = "motor_poles")]
    rpm: bool,
    /// Also take motors that were judged as ready within limits; the limits are shown before anything is set
    #[arg(long)]
    accept_limits: bool,
    /// Answer every question with yes, for a script that has seen to it
    #[arg(long)]
    yes: bool,
}

/// A motor with what was found of it.
struct Tuned {
    motor: u8,
    folder: PathBuf,
    model: Model,
    judgement: Judgement,
    /// Where they are to correct the inverse.
    speeds: Option<SpeedCurve>,
}

/// What ends the tuning.
#[derive(Debug, Error, Diagnostic)]
enum TuneError {
    /// A question was not answered with yes.
    #[error("{question} was not answered with yes")]
    #[diagnostic(help("{done}"))]
    NotConfirmed { question: &'static str, done: &'static str },
    /// Motors would turn too fast.
    #[error(
        "motor {motor} turns at {rpm:.0} rpm at {nominal}, and by that at {expected:.0} at {next}: --most-rpm allows {most_rpm:.0}"
    )]
    #[diagnostic(help(
        "is its propeller on, and --motor-poles the number of its magnets? Else leave the higher commands out"
    ))]
    WouldBeTooFast { motor: u8, rpm: f64, nominal: f64, expected: f64, next: f64, most_rpm: f64 },
    /// Motors turn too slowly.
    #[error("motor {motor} turns at {rpm:.0} rpm at {nominal}, far from the {most_rpm:.0} of --most-rpm")]
    #[diagnostic(help(
        "is --motor-poles the number of its magnets? Else give --most-rpm by what the motor reaches at {nominal}"
    ))]
    TooSlow { motor: u8, rpm: f64, nominal: f64, most_rpm: f64 },
    /// Motors that have a compensator in their path already.
    #[error("motor {motor} has a compensator in its path{}", if *is_tuned { ", through which it would be measured" } else { ", and is not among --motors: all share one kind and its parameters" })]
    #[diagnostic(help("`rotorlead device set motor.{motor}.{compensate} false` takes it out: tuning puts in what it finds", compensate = Key::Compensate.name()))]
    HasCompensator { motor: usize, is_tuned: bool },
    /// The records allow no compensator.
    #[error("motor {motor} was judged, as {judgement}: no setting was changed")]
    #[diagnostic(help("its records are in `{}`: `rotorlead report` shows them", folder.display()))]
    NotReady { motor: u8, judgement: Judgement, folder: PathBuf },
    /// Speeds that make no curve.
    #[error("the speeds of motor {motor} correct nothing: {reason}; no setting was changed")]
    #[diagnostic(help("give more commands with --nominal, or leave --rpm out"))]
    NoSpeeds { motor: u8, reason: String },
    /// A lead has no gain to correct.
    #[error("a lead is recommended, and --rpm corrects an inverse: no setting was changed")]
    #[diagnostic(help("--kind inverse, or leave --rpm out; the records are in `{}`", folder.display()))]
    NoInverse { folder: PathBuf },
    /// Motors that are unlike each other.
    #[error("a lead is recommended for some of the motors, and an inverse for others")]
    #[diagnostic(help("choose one with --kind; the records are in `{}`", folder.display()))]
    Mixed { folder: PathBuf },
}

impl Tune {
    pub(super) fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let levels = self.check()?;
        let settings = session.settings()?;
        self.sensor.sensors(&settings)?;
        self.check_paths(&settings)?;
        check_controller(session)?;
        OutputFolder::create(&self.out)?.commit()?;
        let seconds = self.played.seconds(&settings) * ((levels.len() + 1) * self.motors.len()) as f64;
        eprintln!(
            "{} at commands up to {:.3}, for {} in all.",
            match self.motors[..] {
                [motor] => format!("Motor {motor} turns"),
                _ => format!("{} motors turn, one after the other,", self.motors.len()),
            },
            levels[levels.len() - 1] + self.played.amplitude,
            counted((seconds / 60.0).ceil() as usize, "minute")
        );
        for question in CONDITIONS {
            self.ask(question, "no motor has turned, and no setting was changed")?;
        }
        let mut tuned = Vec::new();
        for &motor in &self.motors {
            let folder = self.out.join(format!("motor{motor}"));
            self.measure(session, motor, &folder, &levels)?;
            tuned.push(self.identify(motor, folder)?);
        }
        let designs = self.design(&settings, &tuned)?;
        let mut changes = changes(&settings, &tuned, &designs);
        if self.rpm {
            if designs.iter().any(|design| design.compensator.as_inverse().is_none()) {
                return Err(TuneError::NoInverse { folder: self.out.clone() }.into());
            }
            let speeds = tuned.iter().filter_map(|one| Some((one.motor, one.speeds?)));
            correct_by(&mut changes, &settings, &speeds.collect::<Vec<_>>());
        }
        let changed = change(&settings, &changes)?;
        filters(&changed).map_err(|error| miette!(help = super::design_remedy(&error), "{error}"))?;
        let mut text = summary(&tuned, &designs, &changes);
        if !self.yes {
            eprint!("{}", std::mem::take(&mut text));
        }
        self.ask("Write these settings and store them?", "no setting was changed")?;
        let warnings: Vec<String> = session.set_settings(&changed)?.iter().map(|warning| warning.to_string()).collect();
        session.save()?;
        text.extend(warnings.iter().map(|sentence| warning(sentence)));
        write!(text, "Set and saved. Take the jumper out before a flight.\nWritten to {}\n", self.out.display())
            .into_diagnostic()?;
        let motors: Vec<Value> = tuned
            .iter()
            .zip(&designs)
            .map(|(one, design)| {
                let points = &one.model.points;
                json!({ "motor": one.motor, "judgement": one.judgement, "points": points, "compensator": design.compensator.stored() })
            })
            .collect();
        let set: serde_json::Map<String, Value> =
            changes.iter().map(|(key, value)| (key.clone(), json!(value))).collect();
        Ok(Outcome::new(text, &json!({ "motors": motors, "set": set, "warnings": warnings, "saved": true })))
    }

    /// The levels in their order, where they and the motors are such.
    fn check(&self) -> Result<Vec<f64>, UsageError> {
        let mut levels = self.nominal.clone();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        if let Some(motor) = self.motors.iter().find(|motor| usize::from(**motor) >= MOTORS) {
            return Err(UsageError::new(
                format!("there is no motor {motor}"),
                format!("count them from 0 to {}", MOTORS - 1),
            ));
        }
        let range = levels[levels.len() - 1] - levels[0];
        if self.rpm && range < SHORTEST_SPEED_RANGE.to_f64() {
            let problem = format!("--rpm takes two commands or more, {} apart", SHORTEST_SPEED_RANGE.to_f64());
            return Err(UsageError::new(problem, "give more with --nominal"));
        }
        if self.rpm && self.kind == Some(KindName::Lead) {
            return Err(UsageError::new("--rpm corrects an inverse, and --kind is lead", "leave one of them out"));
        }
        let is_twice = |(index, motor): (usize, &u8)| self.motors[..index].contains(motor);
        if self.motors.iter().enumerate().any(is_twice) {
            return Err(UsageError::new("--motors names a motor twice", "name each once"));
        }
        Ok(levels)
    }

    /// Whether the motors are to be measured as they are, and no other gets a compensator that nobody has measured for it.
    fn check_paths(&self, settings: &Settings) -> Result<(), TuneError> {
        let Some(motor) = settings.motors.iter().position(|motor| motor.compensate) else { return Ok(()) };
        let is_tuned = self.motors.iter().any(|&tuned| usize::from(tuned) == motor);
        Err(TuneError::HasCompensator { motor, is_tuned })
    }

    /// Plays on one motor, from the lowest command on, and last once more at the middle one, for a record that nothing is fitted to. What it
    /// reaches at one says whether the next is allowed.
    fn measure(&self, session: &mut Session, motor: u8, folder: &Path, levels: &[f64]) -> miette::Result<()> {
        let mut play = |nominal: f64, role: Option<Role>| {
            let excite = Excite {
                out: folder.to_owned(),
                nominal: vec![nominal],
                motor,
                played: self.played,
                sensor: self.sensor.clone(),
                most_rpm: self.most_rpm,
                role,
            };
            excite.run(session).wrap_err_with(|| format!("motor {motor} was not measured, and no setting was changed"))
        };
        for (index, &nominal) in levels.iter().enumerate() {
            play(nominal, None)?;
            if let Some(most_rpm) = self.most_rpm {
                check_speed(motor, folder, (nominal, levels.get(index + 1).copied()), most_rpm)?;
            }
        }
        play(levels[levels.len() / 2], Some(Role::Validate)).map(drop)
    }

    /// The model of a motor, which is written, where a compensator may be built on it.
    fn identify(&self, motor: u8, folder: PathBuf) -> miette::Result<Tuned> {
        let experiment = Experiment::read(&folder)?;
        let mut found = IdentifyResult::identify(&experiment, &IdentifyOptions::default())
            .wrap_err_with(|| format!("nothing was identified of motor {motor}, and no setting was changed"))?;
        let provenance = found.identification.model.provenance.iter_mut();
        provenance.for_each(|from| from.records_crc32 = Experiment::checksum(&folder));
        let model = found.identification.model;
        model.write(&folder.join("model.toml"))?;
        let judgement = found.assessment.judgement;
        let is_ready = match judgement.state {
            Readiness::Ready => true,
            Readiness::ReadyWithinLimits => self.accept_limits,
            Readiness::MeasureAgain | Readiness::NotALag => false,
        };
        if !is_ready {
            return Err(TuneError::NotReady { motor, judgement, folder }.into());
        }
        let speeds = self.sensor.motor_poles.filter(|_| self.rpm).map(|poles| measured_speeds(&experiment, poles));
        let speeds = speeds.transpose().map_err(|reason| TuneError::NoSpeeds { motor, reason })?;
        Ok(Tuned { motor, folder, model, judgement, speeds })
    }

    /// A compensator for each motor, alike in all that the controller has for all of them: an inverse with the slowest of the reference
    /// models that are recommended, or the lead of the fastest motor.
    fn design(&self, settings: &Settings, tuned: &[Tuned]) -> miette::Result<Vec<DesignResult>> {
        let loop_rate_hz = f64::from(settings.loop_rate_hz);
        let latency = Latency::new(settings.input, settings.output, loop_rate_hz).into_diagnostic()?;
        let request = DesignRequest {
            kind: self.kind.map(KindName::kind),
            loop_rate_hz: Some(loop_rate_hz),
            slew_per_s: (settings.slew_per_s > 0.0).then_some(settings.slew_per_s),
            ..DesignRequest::default()
        };
        let failed = |motor: u8| format!("motor {motor} gets no compensator, and no setting was changed");
        let chosen: Vec<Chosen> = tuned
            .iter()
            .map(|one| {
                let chosen = request.chosen(&one.model, self.purpose.purpose(), None);
                chosen.map_err(miette::Report::from).wrap_err_with(|| failed(one.motor))
            })
            .collect::<miette::Result<_>>()?;
        let inverses: Vec<InverseOptions> = chosen
            .iter()
            .filter_map(|one| if let KindOptions::Inverse(options) = one.options { Some(options) } else { None })
            .collect();
        if !inverses.is_empty() && inverses.len() < chosen.len() {
            return Err(TuneError::Mixed { folder: self.out.clone() }.into());
        }
        let natural_rad_s = inverses.iter().filter_map(|options| options.omega_f_rad_s).reduce(f64::min);
        let mut designs = Vec::new();
        for (one, chosen) in tuned.iter().zip(chosen) {
            let options = match chosen.options {
                KindOptions::Inverse(options) => {
                    KindOptions::Inverse(InverseOptions { omega_f_rad_s: natural_rad_s, ..options })
                }
                lead @ KindOptions::Lead(_) => lead,
            };
            let design = DesignResult::design(&one.model, Chosen { options, ..chosen }, latency)
                .map_err(miette::Report::from)
                .wrap_err_with(|| failed(one.motor))?;
            design.compensator.write(&one.folder.join("compensator.toml"))?;
            designs.push(design);
        }
        Ok(designs)
    }

    fn ask(&self, question: &'static str, done: &'static str) -> Result<(), TuneError> {
        if self.yes || is_confirmed(question, &mut std::io::stdin().lock(), &mut std::io::stderr()) {
            return Ok(());
        }
        Err(TuneError::NotConfirmed { question, done })
    }
}

/// Whether the answer to a question is yes, in full.
fn is_confirmed(question: &str, answers: &mut impl BufRead, out: &mut impl std::io::Write) -> bool {
    let mut answer = String::new();
    let is_asked = write!(out, "{question} Type yes: ").and_then(|()| out.flush()).is_ok();
    is_asked && answers.read_line(&mut answer).is_ok() && answer.trim().eq_ignore_ascii_case("yes")
}

/// Whether a motor turned as fast as it should at the last command, and would not turn too fast at the next, if there is one.
fn check_speed(motor: u8, folder: &Path, (nominal, next): (f64, Option<f64>), most_rpm: f64) -> miette::Result<()> {
    let experiment = Experiment::read(folder)?;
    let Some(rpm) = experiment.records.last().and_then(|record| Some(mean(record.rpm.as_ref()?))) else {
        return Ok(());
    };
    // A rotor with its propeller turns less than in proportion to its command.
    let expected = next.map(|next| (next, rpm * next / nominal));
    match expected {
        Some((next, expected)) if expected > most_rpm => {
            Err(TuneError::WouldBeTooFast { motor, rpm, nominal, expected, next, most_rpm }.into())
        }
        None if rpm < LEAST_OF_MOST * most_rpm => Err(TuneError::TooSlow { motor, rpm, nominal, most_rpm }.into()),
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

/// What is to be set: of a lead that of the fastest motor, and that these motors have it in their path.
fn changes(settings: &Settings, tuned: &[Tuned], designs: &[DesignResult]) -> Vec<(String, String)> {
    let lead_of = |design: &CompensatorDesign| design.as_lead().map(|lead| lead.lead().omega_z_rad_s);
    let fastest = designs
        .iter()
        .map(|design| &design.compensator)
        .filter(|design| lead_of(design).is_some())
        .max_by(|a, b| lead_of(a).unwrap_or(0.0).total_cmp(&lead_of(b).unwrap_or(0.0)));
    let mut changes: Vec<(String, String)> = Vec::new();
    for (one, design) in tuned.iter().zip(designs) {
        let of_motor = compensator::settings(fastest.unwrap_or(&design.compensator), Some(one.motor));
        let path = (format!("motor.{}.{}", one.motor, Key::Compensate.name()), "true".to_owned());
        for change in of_motor.into_iter().chain([path]) {
            if !changes.contains(&change) {
                changes.push(change);
            }
        }
    }
    // An inverse asks for the time constants of every motor, also of one in whose path it is not.
    let is_unknown = |motor: &usize| {
        settings.motors[*motor].curve.is_none() && tuned.iter().all(|one| usize::from(one.motor) != *motor)
    };
    if let Some(inverse) = designs.first().and_then(|design| design.compensator.as_inverse()) {
        let curve = curve_text(inverse.curve());
        let others = (0..MOTORS).filter(is_unknown);
        changes.extend(others.map(|motor| (format!("motor.{motor}.{}", Key::TimeConstantS.name()), curve.clone())));
    }
    changes
}

/// What was found of each motor, and what is to be set.
fn summary(tuned: &[Tuned], designs: &[DesignResult], changes: &[(String, String)]) -> String {
    let mut text = String::new();
    for (one, design) in tuned.iter().zip(designs) {
        let taus = one
            .model
            .points
            .iter()
            .map(|point| format!("{:.1} ms at {:.3}", 1e3 * point.time_constant_s, point.nominal));
        let taus = taus.collect::<Vec<_>>().join(", ");
        text += &format!(
            "motor {}: {}; {taus}; {}\n",
            one.motor,
            one.judgement.state,
            rotorlead_results::in_short(&design.compensator)
        );
        text.extend(one.judgement.limits.iter().map(|limit| format!("  - {limit}\n")));
    }
    let mut rest = changes;
    while let Some((_, value)) = rest.first() {
        // Of motors that were not tuned one after the other has the same time constants.
        let alike = rest.iter().take_while(|(_, other)| other == value).count();
        let (these, others) = rest.split_at(alike);
        let keys: Vec<&str> = these.iter().map(|(key, _)| key.as_str()).collect();
        text += &format!("  {} = {}\n", keys.join(", "), in_short(value));
        rest = others;
    }
    text
}

/// A curve by its ends: all of it is in the compensator's file.
fn in_short(value: &str) -> String {
    let points: Vec<&str> = value.split(',').collect();
    match points[..] {
        [first, _, _, .., last] => format!("{first} to {last}, {} points", points.len()),
        _ => value.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_shown_by_its_ends() {
        assert_eq!(in_short("0:0.07,0.3:0.06,0.5:0.05,1:0.03"), "0:0.07 to 1:0.03, 4 points");
        assert_eq!(in_short("0.3:52000,0.4:65000,0.5:77000"), "0.3:52000,0.4:65000,0.5:77000");
        assert_eq!(in_short("rpm"), "rpm");
    }

    #[test]
    fn nothing_but_a_whole_yes_confirms() {
        for (answer, is_yes) in
            [("yes\n", true), (" YES \n", true), ("y\n", false), ("", false), ("no\n", false), ("yes please\n", false)]
        {
            let mut out = Vec::new();
            assert_eq!(is_confirmed("Is it?", &mut answer.as_bytes(), &mut out), is_yes, "{answer:?}");
            assert_eq!(String::from_utf8(out).unwrap(), "Is it? Type yes: ");
        }
    }
}
