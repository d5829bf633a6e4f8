//! What a controller says of itself, in words.

use rotorlead::link::{BrownOut, CrystalCheck, Faults, Info, Path, ResetReason};
use rotorlead::settings::MOTORS;
use rotorlead::throttle::Throttle;
use serde_json::Value;

/// A line of what a controller says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Said {
    /// How something is.
    Fact(String),
    /// What is to be changed.
    Warning(String),
}

/// What the controller is and how it is.
#[must_use]
pub fn info_lines(info: &Info) -> Vec<Said> {
    let [major, minor, patch] = info.firmware;
    let mut lines = vec![
        format!("firmware {major}.{minor}.{patch}"),
        format!("clock {:?}, core {} Hz, timers {} Hz, {} ticks", info.clock, info.core_hz, info.timer_hz, info.ticks),
    ];
    lines.extend(state_lines(info));
    let mut lines: Vec<Said> = lines.into_iter().map(Said::Fact).collect();
    for (motor, (state, path)) in info.motors.iter().zip(&info.paths).enumerate() {
        lines.push(Said::Fact(format!("motor {motor}: {state:?}, {}", path_text(path))));
        if path.leaves_pulses_over() {
            lines.push(Said::Warning(format!(
                "motor {motor}: of {} pulses a second that come, {} go out; raise output.frame_hz (DShot: \
                 loop_rate_hz) if the ESC allows it, or lower the flight controller's rate",
                path.input_hz, path.output_hz
            )));
        }
    }
    lines
}

/// What went wrong since the start: a line for each number.
#[must_use]
pub fn fault_lines(faults: &Faults) -> Vec<String> {
    let mut lines = Vec::new();
    list("", &serde_json::to_value(faults).expect("keys are text, and no number fails to be written"), &mut lines);
    lines
}

/// One line for each number in `value`.
fn list(name: &str, value: &Value, lines: &mut Vec<String>) {
    let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| list(&below(key), value, lines)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, value)| list(&below(&index.to_string()), value, lines));
        }
        value => lines.push(format!("{name} = {value}")),
    }
}

/// What comes in and goes out at a motor, and what is between.
fn path_text(path: &Path) -> String {
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
                paths: [Path::SILENT; MOTORS],
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
