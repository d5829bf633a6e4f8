//! Settings by name, as on the command line.

use rotorlead::design::{CurvePoint, RotorCurve, SpeedCurve};
use rotorlead::settings::{CompensatorKind, Key, MOTORS, MotorSettings, NoSignal, PulseProtocol, SettingId, Settings};
use rotorlead::throttle::{Command, Throttle};
use rotorlead_records::files::did_you_mean;

use super::DeviceError;
use super::speed_text::{read_speeds, speeds_text};

/// What a compensator runs.
const KINDS: [(&str, CompensatorKind); 3] =
    [("lead", CompensatorKind::Lead), ("inverse", CompensatorKind::Inverse), ("rpm", CompensatorKind::Rpm)];
/// What an output does without a signal.
const NO_SIGNAL: [(&str, NoSignal); 2] = [("no_pulses", NoSignal::NoPulses), ("stop_pulses", NoSignal::StopPulses)];

/// All settings, name and value, in the form that [`set`] takes.
#[must_use]
pub fn entries(settings: &Settings) -> Vec<(String, String)> {
    let mut copy = settings.clone();
    let mut entries = Vec::new();
    let mut add = |key: Key, motor: Option<u8>| {
        let value = Value::from_settings(&mut copy, key, motor.map_or(0, usize::from)).show();
        entries.push((SettingId { key, motor }.to_string(), value));
    };
    for key in Key::ALL.into_iter().filter(|key| !key.is_of_a_motor()) {
        add(key, None);
    }
    for motor in 0..MOTORS as u8 {
        for key in Key::ALL.into_iter().filter(|key| key.is_of_a_motor()) {
            add(key, Some(motor));
        }
    }
    entries
}

/// Changes one setting; `motor.*.idle` changes that of every motor. Ranges are checked by
/// [`Settings::validate`], not here.
///
/// # Errors
/// [`DeviceError::Setting`]: no such key, or not such a value.
pub fn set(settings: &mut Settings, name: &str, text: &str) -> Result<(), DeviceError> {
    let (motors, key_name) = match name.strip_prefix("motor.").and_then(|rest| rest.split_once('.')) {
        Some(("*", key)) => (0..MOTORS, key),
        Some((motor, key)) => match motor.parse::<usize>() {
            Ok(motor) if motor < MOTORS => (motor..motor + 1, key),
            _ => return Err(unknown(name)),
        },
        None => (0..1, name),
    };
    let is_of_a_motor = name.starts_with("motor.");
    let key = Key::ALL.into_iter().find(|key| key.name() == key_name && key.is_of_a_motor() == is_of_a_motor);
    let key = key.ok_or_else(|| unknown(name))?;
    for motor in motors {
        Value::from_settings(settings, key, motor)
            .parse(text)
            .map_err(|help| DeviceError::Setting { message: format!("`{text}` is no value for {name}"), help })?;
    }
    Ok(())
}

/// The error that there is no setting of this name, with the nearest one.
#[must_use]
pub fn unknown(name: &str) -> DeviceError {
    let names = entries(&Settings::default());
    let meant = did_you_mean(name, names.iter().map(|(known, _)| known.as_str()));
    let meant = meant.map(|question| question + " ").unwrap_or_default();
    DeviceError::Setting {
        message: format!("there is no setting `{name}`"),
        help: format!("{meant}`rotorlead device get` shows them all, and motor.*.KEY means every motor"),
    }
}

/// One setting, wherever it is.
enum Value<'a> {
    Rate(&'a mut u32),
    Number(&'a mut f64),
    Count(&'a mut u16),
    Level(&'a mut i32),
    OptionalLevel(&'a mut Option<i32>),
    Switch(&'a mut bool),
    Kind(&'a mut CompensatorKind),
    Curve(&'a mut Option<RotorCurve>),
    Speeds(&'a mut Option<SpeedCurve>),
    Protocol(&'a mut PulseProtocol),
    NoSignal(&'a mut NoSignal),
}

impl<'a> Value<'a> {
    fn from_settings(settings: &'a mut Settings, key: Key, motor: usize) -> Self {
        let MotorSettings { compensate, disarming, arming, idle, max, hold_ms, curve } = &mut settings.motors[motor];
        let inverse = &mut settings.inverse;
        match key {
            Key::LoopRateHz => Self::Rate(&mut settings.loop_rate_hz),
            Key::Compensator => Self::Kind(&mut settings.compensator),
            Key::OmegaZRadS => Self::Number(&mut settings.lead.omega_z_rad_s),
            Key::OmegaFRadS => Self::Number(&mut settings.lead.omega_f_rad_s),
            Key::Damping => Self::Number(&mut settings.lead.damping),
            Key::InverseNaturalRadS => Self::Number(&mut inverse.natural_rad_s),
            Key::InverseDamping => Self::Number(&mut inverse.damping),
            Key::InverseCompensateFrom => Self::Level(&mut inverse.compensate_from),
            Key::InverseCompensateTo => Self::Level(&mut inverse.compensate_to),
            Key::InputProtocol => Self::Protocol(&mut settings.input.protocol),
            Key::InputFrameHz => Self::Count(&mut settings.input.frame_hz),
            Key::OutputProtocol => Self::Protocol(&mut settings.output.protocol),
            Key::OutputFrameHz => Self::Count(&mut settings.output.frame_hz),
            Key::OutputSlewPerS => Self::Number(&mut settings.slew_per_s),
            Key::Stop => Self::Level(&mut settings.stop),
            Key::NoSignal => Self::NoSignal(&mut settings.no_signal),
            Key::StopPulsesMs => Self::Count(&mut settings.stop_pulses_ms),
            Key::Resume => Self::Switch(&mut settings.resume),
            Key::Compensate => Self::Switch(compensate),
            Key::Disarming => Self::OptionalLevel(disarming),
            Key::Arming => Self::OptionalLevel(arming),
            Key::Idle => Self::OptionalLevel(idle),
            Key::Max => Self::Level(max),
            Key::HoldMs => Self::Count(hold_ms),
            Key::TimeConstantS => Self::Curve(curve),
            Key::Erpm => Self::Speeds(&mut settings.speeds[motor]),
            Key::ExcitationMaxDurationS => Self::Count(&mut settings.excitation.max_duration_s),
            Key::ExcitationMaxCommand => Self::Level(&mut settings.excitation.max_command),
            Key::ExcitationMaxAmplitude => Self::Level(&mut settings.excitation.max_amplitude),
            Key::ExcitationArmMs => Self::Count(&mut settings.excitation.arm_ms),
            Key::ExcitationRampMs => Self::Count(&mut settings.excitation.ramp_ms),
            Key::RecorderDivisor => Self::Count(&mut settings.recorder_divisor),
        }
    }

    /// As text that [`Self::parse`] takes back to the same value.
    fn show(&self) -> String {
        match self {
            Self::Rate(value) => value.to_string(),
            Self::Number(value) => number_text(**value),
            Self::Count(value) => value.to_string(),
            Self::Level(bits) => level_text(**bits),
            Self::OptionalLevel(bits) => bits.map_or_else(|| NONE.to_owned(), level_text),
            Self::Switch(value) => value.to_string(),
            Self::Kind(value) => find_name(&KINDS, **value),
            Self::Curve(value) => value.as_ref().map_or_else(|| NONE.to_owned(), curve_text),
            Self::Speeds(value) => value.as_ref().map_or_else(|| NONE.to_owned(), speeds_text),
            Self::Protocol(value) => value.name().to_owned(),
            Self::NoSignal(value) => find_name(&NO_SIGNAL, **value),
        }
    }

    /// Changes the setting; the error says what would be a value.
    fn parse(self, text: &str) -> Result<(), String> {
        fn take<T: std::str::FromStr>(place: &mut T, text: &str, what: &str) -> Result<(), String> {
            *place = text.parse().map_err(|_| what.to_owned())?;
            Ok(())
        }
        match self {
            Self::Rate(place) => take(place, text, "give a whole number of hertz"),
            Self::Number(place) => take(place, text, "give a number"),
            Self::Count(place) => take(place, text, "give a whole number from 0 to 65535"),
            Self::Switch(place) => take(place, text, "give true or false"),
            Self::Level(place) => {
                *place = read_level(text).ok_or("give a command from 0 to 1")?;
                Ok(())
            }
            Self::OptionalLevel(place) => {
                let level =
                    || read_level(text).ok_or("give a command from 0 to 1, or none for what the input's protocol has");
                *place = if text == NONE { None } else { Some(level()?) };
                Ok(())
            }
            Self::Kind(place) => choose(&KINDS, place, text),
            Self::Curve(place) => {
                *place = if text == NONE { None } else { Some(read_curve(text)?) };
                Ok(())
            }
            Self::Speeds(place) => {
                *place = if text == NONE { None } else { Some(read_speeds(text)?) };
                Ok(())
            }
            Self::Protocol(place) => {
                choose(&PulseProtocol::ALL.map(|protocol| (protocol.name(), protocol)), place, text)
            }
            Self::NoSignal(place) => choose(&NO_SIGNAL, place, text),
        }
    }
}

/// Time constants or speeds that are not known, or a level that nobody has chosen.
pub(super) const NONE: &str = "none";
/// The form of time constants.
pub const CURVE: &str = "COMMAND:SECONDS,...";

/// A number as short as it reads back the same.
fn number_text(value: f64) -> String {
    let (plain, scientific) = (value.to_string(), format!("{value:e}"));
    if scientific.len() < plain.len() { scientific } else { plain }
}

/// A level as a number that reads back the same, with as few decimals as do; ten resolve 2^-29.
pub(super) fn level_text(bits: i32) -> String {
    let value = Throttle::from_bits(bits).to_f64();
    let shown = (0..10).map(|decimals| format!("{value:.decimals$}"));
    shown.into_iter().find(|text| read_level(text) == Some(bits)).unwrap_or_else(|| number_text(value))
}

/// The bits of a command from 0 to 1.
fn read_level(text: &str) -> Option<i32> {
    let value = text.parse().ok().filter(|value| (0.0..=1.0).contains(value))?;
    Some(Command::saturating_from_f64(value).to_bits())
}

/// A curve as a setting: `COMMAND:SECONDS,...` for the points of the table, without those inside a run of equal time constants.
#[must_use]
pub fn curve_text(curve: &RotorCurve) -> String {
    let tau_s = curve.time_constants_s();
    let last = tau_s.len() - 1;
    let is_needed = |index: &usize| match *index {
        index if index > 0 && index < last => tau_s[index - 1] != tau_s[index] || tau_s[index] != tau_s[index + 1],
        _ => true,
    };
    let points: Vec<String> =
        (0..=last).filter(is_needed).map(|index| format!("{}:{}", index as f64 / last as f64, tau_s[index])).collect();
    points.join(",")
}

/// The curve through `COMMAND:SECONDS,...`; the error says what is wrong with it.
fn read_curve(text: &str) -> Result<RotorCurve, String> {
    let form = || format!("give {CURVE}, as 0.40:0.159,0.65:0.071, or {NONE}");
    let point = |point: &str| {
        let (command, tau_s) = point.split_once(':')?;
        Some(CurvePoint { command: command.trim().parse().ok()?, tau_s: tau_s.trim().parse().ok()? })
    };
    let points: Vec<CurvePoint> = text.split(',').map(point).collect::<Option<_>>().ok_or_else(form)?;
    RotorCurve::through(&points).map_err(|error| error.to_string())
}

/// The name of a value among those that there are.
fn find_name<T: Copy + PartialEq>(names: &[(&str, T)], value: T) -> String {
    names.iter().find(|(_, known)| *known == value).map_or("", |(name, _)| name).to_owned()
}

/// Takes the value of that name; the error names all that there are.
fn choose<T: Copy>(names: &[(&str, T)], place: &mut T, text: &str) -> Result<(), String> {
    let Some((_, value)) = names.iter().find(|(name, _)| *name == text) else {
        let names: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        return Err(format!("give {}", names.join(" or ")));
    };
    *place = *value;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_as_short_as_it_reads_back() {
        for (value, text) in
            [(0.5, "0.5"), (20.0, "20"), (-5.0 * f64::powi(2.0, -29), "-9.313225746154785e-9"), (1e300, "1e300")]
        {
            assert_eq!(number_text(value), text);
            assert_eq!(text.parse(), Ok(value));
        }
    }
}
