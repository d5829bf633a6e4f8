//! `rotorlead device`

mod compensator;
mod excite;
mod folder;
mod inject;
mod record;
mod set;
mod tune;
mod tune_speeds;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use clap::{Args, Subcommand};
use miette::IntoDiagnostic as _;
use rotorlead::controller::FilterError;
use rotorlead::design::{CurvePoint, InverseError, LeadDesign};
use rotorlead::link::{BrownOut, CrystalCheck, Info, ResetReason};
use rotorlead::settings::{CompensatorKind, MOTORS, Settings};
use rotorlead::throttle::Throttle;
use rotorlead_device::{DEFAULT_BAUD, DeviceError, Session};
use rotorlead_plant::{CompensatorDesign, InverseCompensator, InverseRange};
use rotorlead_records::files::AcceptedRange;
use serde_json::{Value, json};

use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::number;
use rotorlead_answer::words::warning;

/// Talks to a controller over its serial port, or to one in the emulator
#[derive(Args, Debug)]
pub struct Device {
    /// A serial port (/dev/ttyUSB0, COM3), or tcp:HOST:PORT; left out, that of the controller which is plugged in by USB
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Baud rate of the serial port
    #[arg(long, value_name = "BAUD", default_value_t = DEFAULT_BAUD)]
    baud: u32,
    /// How long an answer is waited for, seconds
    #[arg(long, value_name = "S", default_value = "1", value_parser = number(AcceptedRange::DURATION_S))]
    timeout: f64,
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    json: JsonOption,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Says what the controller is and how it is
    Info,
    /// Shows the settings in use
    Get {
        /// Only this one
        key: Option<String>,
    },
    /// Changes settings, until the power goes: all in one, checked together, or none
    Set(set::Set),
    /// Stores the settings in use, once they are chosen; every motor must be disarmed
    Save,
    /// Shows what went wrong since the start
    Faults,
    /// Ramps an excitation down
    Stop,
    /// Leaves the firmware for the board's boot loader, to flash another; needs the jumper and every motor disarmed
    Bootloader,
    /// Records a motor while something else drives it
    Record(record::Record),
    /// Has the controller play multisines on a motor, and records them. Nothing else may drive the motor
    Excite(excite::Excite),
    /// Measures the motors of a vehicle one after the other, designs their compensator and stores it, with a question before each
    Tune(tune::Tune),
    /// Plays a plan through the controller's filter into a simulated motor, without pulses
    Inject(inject::Inject),
}

impl Action {
    /// Where its own output goes.
    fn out(&self) -> Option<&Path> {
        match self {
            Self::Record(options) => Some(&options.out),
            Self::Excite(options) => Some(&options.out),
            Self::Tune(options) => Some(&options.out),
            Self::Inject(options) => Some(&options.out),
            _ => None,
        }
    }
}

impl Device {
    /// Runs the command and says what came out. Outputs that are not the host's are said, and fail the command all the
    /// same.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.check(self.action.out())?;
        let (outcome, verdict) = self.run()?;
        self.json.say(|| Ok(outcome), verbosity)?;
        verdict
    }

    fn run(&self) -> miette::Result<(Outcome, miette::Result<()>)> {
        let address = self.port.clone().map_or_else(rotorlead_device::find, Ok)?;
        let port = rotorlead_device::open(&address, self.baud)?;
        let mut session = Session::new(port, &address, Duration::from_secs_f64(self.timeout));
        let outcome = match &self.action {
            Action::Info => info(&mut session),
            Action::Get { key } => get(&mut session, key.as_deref()),
            Action::Set(options) => options.run(&mut session),
            Action::Save => save(&mut session),
            Action::Faults => faults(&mut session),
            Action::Stop => {
                session.stop_excitation()?;
                Ok(Outcome::new("Stopping.\n".into(), &json!({ "stopping": true })))
            }
            Action::Bootloader => {
                session.enter_boot_loader()?;
                let text = "The board is gone from this port, and shows itself as a drive: copy the .uf2 file there.\n";
                Ok(Outcome::new(text.into(), &json!({ "bootloader": true })))
            }
            Action::Record(options) => options.run(&mut session),
            Action::Excite(options) => options.run(&mut session),
            Action::Tune(options) => options.run(&mut session),
            Action::Inject(options) => return options.run(&mut session),
        }?;
        Ok((outcome, Ok(())))
    }
}

fn info(session: &mut Session) -> miette::Result<Outcome> {
    let info = session.info()?;
    let [major, minor, patch] = info.firmware;
    let mut text = format!(
        "firmware {major}.{minor}.{patch}\nclock {:?}, core {} Hz, timers {} Hz, {} ticks\n",
        info.clock, info.core_hz, info.timer_hz, info.ticks
    );
    for line in state_lines(&info) {
        writeln!(text, "{line}").into_diagnostic()?;
    }
    for (motor, (state, path)) in info.motors.iter().zip(&info.paths).enumerate() {
        writeln!(text, "motor {motor}: {state:?}, {}", path_text(path)).into_diagnostic()?;
        if path.leaves_pulses_over() {
            let what = format!(
                "motor {motor}: of {} pulses a second that come, {} go out; raise output.frame_hz (DShot: \
                 loop_rate_hz) if the ESC allows it, or lower the flight controller's rate",
                path.input_hz, path.output_hz
            );
            text.push_str(&warning(&what));
        }
    }
    Ok(Outcome::new(text, &info))
}

/// What comes in and goes out at a motor, and what is between.
fn path_text(path: &rotorlead::link::Path) -> String {
    let level = |bits: i32, none: &str| {
        if bits < 0 { none.to_owned() } else { format!("{:.4}", Throttle::from_bits(bits).to_f64()) }
    };
    let rate = |hz: u32| if hz == 0 { String::new() } else { format!(" at {hz} Hz") };
    let between = if path.compensates { "compensated" } else { "as it is" };
    let (command, output) = (level(path.command, "no command"), level(path.output, "no pulse"));
    format!("{command}{} in, {between}, {output}{} out", rate(path.input_hz), rate(path.output_hz))
}

/// What a controller says of its crystal, start, supply, settings and jumper, with what to do about it.
fn state_lines(info: &Info) -> [String; 6] {
    let mhz = |hz: u32| f64::from(hz) / 1e6;
    let crystal = match info.crystal {
        CrystalCheck::NotChecked => "crystal not checked: none runs, or nothing on the board counts it".to_owned(),
        CrystalCheck::Right { measured_hz } => {
            format!("crystal as expected, {:.2} MHz by the internal oscillator", mhz(measured_hz))
        }
        CrystalCheck::Wrong { measured_hz } => format!(
            "crystal WRONG: {:.2} MHz by the internal oscillator; not used, and no motor arms. Use a board with 8 MHz",
            mhz(measured_hz)
        ),
    };
    let arming = if info.may_arm {
        "pulses may arm motors"
    } else {
        "pulses arm NO motor: this clock does not tell a disarmed pulse from an armed one"
    };
    let brown_out = match info.brown_out {
        BrownOut::Unknown => "brown-out reset unknown: the option bytes cannot be read".to_owned(),
        BrownOut::Level3 => "brown-out reset at level 3".to_owned(),
        low => format!("brown-out reset {low:?}: set the option BOR_LEV to level 3, or a sagging supply is undefined"),
    };
    let outputs = if info.outputs_enabled {
        "outputs enabled".to_owned()
    } else {
        "outputs LOW: nobody has chosen the settings. Set output.protocol to that of the ESCs, then save".to_owned()
    };
    let jumper = if info.bench_enabled {
        "bench jumper fitted: excitation and injection are allowed"
    } else {
        "bench jumper not fitted: no excitation, no injection"
    };
    [
        format!("{crystal}; {arming}"),
        format!("started by {}{}", started_by(info.reset), resumed(info)),
        brown_out,
        format!("settings {:?}", info.settings),
        outputs,
        jumper.to_owned(),
    ]
}

fn faults(session: &mut Session) -> miette::Result<Outcome> {
    let json = serde_json::to_value(session.faults()?).into_diagnostic()?;
    let mut text = String::new();
    list("", &json, &mut text);
    Ok(Outcome::new(text, &json))
}

/// One line for each number in `value`.
fn list(name: &str, value: &Value, text: &mut String) {
    let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| list(&below(key), value, text)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, value)| list(&below(&index.to_string()), value, text));
        }
        value => writeln!(text, "{name} = {value}").expect("a string takes all"),
    }
}

fn get(session: &mut Session, key: Option<&str>) -> miette::Result<Outcome> {
    let settings = session.settings()?;
    if let Some(key) = key {
        // The same error as for a `set` of a key that does not exist.
        let known = rotorlead_device::entries(&settings).into_iter().find(|(name, _)| name == key);
        let Some((name, value)) = known else {
            return Err(rotorlead_device::unknown(key).into());
        };
        return Ok(Outcome::new(format!("{value}\n"), &json!({ name: value })));
    }
    let mut text = String::new();
    let mut map = serde_json::Map::new();
    for (name, value) in rotorlead_device::entries(&settings) {
        writeln!(text, "{name} = {value}").into_diagnostic()?;
        map.insert(name, Value::String(value));
    }
    Ok(Outcome::new(text, &Value::Object(map)))
}

fn save(session: &mut Session) -> miette::Result<Outcome> {
    if !session.info()?.outputs_enabled {
        // Stored settings count as chosen. A flag for the defaults would soon be typed out of habit.
        let help = "`rotorlead device set output.protocol PROTOCOL` first, even where it is standard_pwm".to_owned();
        return Err(DeviceError::NotChosen { act: "storing them", help }.into());
    }
    session.save()?;
    Ok(Outcome::new("Saved.\n".into(), &json!({ "saved": true })))
}

/// What to do where a filter cannot be designed.
fn design_remedy(error: &FilterError) -> String {
    match error {
        FilterError::Lead(_) => "change omega_z_rad_s, omega_f_rad_s, damping or output.slew_per_s".to_owned(),
        FilterError::Inverse { motor, .. } => format!(
            "change inverse.natural_rad_s, inverse.damping, output.slew_per_s, loop_rate_hz or motor.{motor}.time_constant_s"
        ),
    }
}

/// The compensator of a motor by these settings, as the controller makes it.
fn design(settings: &Settings, motor: u8) -> miette::Result<CompensatorDesign> {
    let loop_rate_hz = f64::from(settings.loop_rate_hz);
    if settings.compensator == CompensatorKind::Lead {
        let design = LeadDesign::new(settings.lead.into(), loop_rate_hz, None);
        return design
            .and_then(|design| design.with_slew(settings.slew_per_s))
            .map(CompensatorDesign::from)
            .map_err(FilterError::Lead)
            .map_err(|error| miette::miette!(help = design_remedy(&error), "{error}"));
    }
    let of_motor = settings.motors.get(usize::from(motor)).copied().unwrap_or_default();
    let level = |bits: i32| Throttle::from_bits(bits).to_f64();
    let of_curve = || {
        let tau_s = of_motor.curve.ok_or(InverseError::NoPoints)?.time_constants_s();
        let command = |index: usize| index as f64 / (tau_s.len() - 1) as f64;
        let points = tau_s.iter().enumerate();
        let points = points.map(|(index, &tau_s)| CurvePoint { command: command(index), tau_s: f64::from(tau_s) });
        let inverse = &settings.inverse;
        let range = InverseRange {
            min: level(settings.levels(&of_motor).idle),
            max: level(of_motor.max),
            slew_per_s: (settings.slew_per_s > 0.0).then_some(settings.slew_per_s),
            compensated: (level(inverse.compensate_from), level(inverse.compensate_to)),
        };
        InverseCompensator::new(inverse.reference(), loop_rate_hz, points.collect(), &range)
    };
    of_curve()
        .map(CompensatorDesign::from)
        .map_err(|error| FilterError::Inverse { motor: usize::from(motor), error })
        .map_err(|error| miette::miette!(help = design_remedy(&error), "{error}"))
}

/// Whether the compensator is in a motor's path.
fn is_compensated(settings: &Settings, motor: u8) -> bool {
    settings.motors.get(usize::from(motor)).is_some_and(|motor| motor.compensate)
}

/// Frames per second that an ESC gets while no flight controller sends any: those of DShot come with control ticks.
fn bench_frame_hz(settings: &Settings) -> f64 {
    let own = f64::from(settings.output.frame_hz);
    let ticks = settings.clone().validate().ok().and_then(|settings| settings.bench_frame_ticks());
    ticks.map_or(own, |ticks| f64::from(settings.loop_rate_hz) / f64::from(ticks))
}

/// Why a controller started.
fn started_by(reason: ResetReason) -> String {
    match reason {
        ResetReason::Panic(place) => format!("Panic at {place}"),
        ResetReason::Fault { program_counter, status } => {
            format!("Fault at {program_counter:#010x}, status {status:#010x}")
        }
        ResetReason::StrayInterrupt(number) => format!("StrayInterrupt {number}"),
        reason => format!("{reason:?}"),
    }
}

/// The motors that have gone on after the reset, if any.
fn resumed(info: &Info) -> String {
    let motors: Vec<String> = (0..MOTORS).filter(|&motor| info.resumed[motor]).map(|motor| motor.to_string()).collect();
    match &motors[..] {
        [] => String::new(),
        motors => format!(" IN FLIGHT: motors {} have gone on at their last command", motors.join(", ")),
    }
}

/// What to do about an error, as it says itself.
fn own_help(cause: &DeviceError) -> String {
    miette::Diagnostic::help(cause).map(|help| help.to_string()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use rotorlead::link::{ChannelState, Clock};
    use rotorlead::settings::Origin;

    use super::*;

    #[test]
    fn what_is_wrong_with_crystal_and_brown_out_level_is_said_with_what_to_do() {
        let lines = |crystal, may_arm, brown_out| {
            state_lines(&Info {
                firmware: [1, 0, 0],
                clock: Clock::InternalPll,
                core_hz: 168_000_000,
                timer_hz: 84_000_000,
                crystal,
                may_arm,
                ticks: 0,
                reset: ResetReason::PowerOn,
                brown_out,
                settings: Origin::Stored,
                outputs_enabled: true,
                bench_enabled: false,
                motors: [ChannelState::NoSignal; MOTORS],
                paths: [rotorlead::link::Path::SILENT; MOTORS],
                resumed: [false; MOTORS],
            })
        };
        let [crystal, _, brown_out, ..] =
            lines(CrystalCheck::Wrong { measured_hz: 16_020_000 }, false, BrownOut::Level1);
        for part in ["crystal WRONG: 16.02 MHz", "no motor arms", "8 MHz", "pulses arm NO motor"] {
            assert!(crystal.contains(part), "{crystal}");
        }
        for part in ["Level1", "BOR_LEV to level 3"] {
            assert!(brown_out.contains(part), "{brown_out}");
        }
        let [crystal, _, brown_out, ..] = lines(CrystalCheck::Right { measured_hz: 8_010_000 }, true, BrownOut::Level3);
        assert_eq!(crystal, "crystal as expected, 8.01 MHz by the internal oscillator; pulses may arm motors");
        assert_eq!(brown_out, "brown-out reset at level 3");
        let [crystal, _, brown_out, ..] = lines(CrystalCheck::NotChecked, true, BrownOut::Unknown);
        assert!(crystal.contains("not checked") && brown_out.contains("cannot be read"));
        assert!(lines(CrystalCheck::NotChecked, true, BrownOut::Off)[2].contains("BOR_LEV"));
    }
}
