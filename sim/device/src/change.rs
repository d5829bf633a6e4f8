//! Several settings changed at once.

use rotorlead::settings::{Key, MOTORS, Problem, SettingId, Settings, SettingsError, Validated};

use super::speed_text::SPEEDS;
use super::text::CURVE;
use super::{DeviceError, entries, set};

/// Makes `changes`, names and values, in their order, and checks the result as a whole: all of them, or none.
///
/// # Errors
/// [`DeviceError::Setting`]: no such key, not such a value, or settings that may not be used. Where keys that were not
/// changed are in the way, the remedy names them with the nearest values that fit.
pub fn change(settings: &Settings, changes: &[(String, String)]) -> Result<Validated, DeviceError> {
    let mut changed = settings.clone();
    for (name, value) in changes {
        set(&mut changed, name, value)?;
    }
    changed.clone().validate().map_err(|error| DeviceError::Setting {
        message: error.to_string(),
        help: Remedy::from_error(error, changed, changes).help(changes),
    })
}

/// What else has to be changed.
struct Remedy {
    /// Keys that were not changed, with values that fit.
    others: Vec<(SettingId, String)>,
    /// What is then still wrong, with a value that was given.
    left: Option<SettingsError>,
}

impl Remedy {
    /// Follows the errors of `settings` through the keys that `changes` leave alone.
    fn from_error(error: SettingsError, mut settings: Settings, changes: &[(String, String)]) -> Self {
        let is_given = |place: SettingId| changes.iter().any(|(name, _)| names(place).contains(name));
        let mut others: Vec<(SettingId, String)> = Vec::new();
        let mut next = Some(error);
        while let Some(error) = next {
            let (mut place, mut value) = (error.place, nearest(&settings, error));
            if is_given(place) && error.problem == Problem::StopWithoutRawDuty {
                (place, value) = (SettingId { key: Key::OutputProtocol, motor: None }, Some("raw_duty".into()));
            }
            if is_given(place) || others.iter().any(|(other, _)| *other == place) {
                return Self { others, left: Some(error) };
            }
            // Nobody but the user has the time constants and the speeds: which motors lack them.
            let lacks_curve = |motor: usize| settings.motors[motor].curve.is_none();
            let lacks_speeds = |motor: usize| settings.motors[motor].compensate && settings.speeds[motor].is_none();
            let lacking: Option<(&str, &dyn Fn(usize) -> bool)> = match error.problem {
                Problem::NoCurve => Some((CURVE, &lacks_curve)),
                Problem::NoSpeed => Some((SPEEDS, &lacks_speeds)),
                _ => None,
            };
            if let Some((form, lacks)) = lacking {
                let motors = (0..MOTORS).filter(|&motor| lacks(motor));
                let places = motors.map(|motor| SettingId { key: place.key, motor: Some(motor as u8) });
                others.extend(places.filter(|place| !is_given(*place)).map(|place| (place, form.into())));
                break;
            }
            let Some(value) = value.filter(|value| set(&mut settings, &place.to_string(), value).is_ok()) else {
                others.push((place, "VALUE".into()));
                break;
            };
            others.push((place, shown(&settings, place).unwrap_or(value)));
            next = settings.clone().validate().err();
        }
        Self { others, left: None }
    }

    fn help(&self, changes: &[(String, String)]) -> String {
        let mut words: Vec<String> = Vec::new();
        for (place, value) in &self.others {
            let of_key = self.others.iter().filter(|(other, same)| other.key == place.key && same == value).count();
            let [name, all] = names(*place);
            let name = if place.motor.is_some() && of_key == MOTORS { all } else { name };
            let word = format!("{name} {value}");
            if !words.contains(&word) {
                words.push(word);
            }
        }
        let is_alone = self.others.is_empty();
        match self.left {
            _ if is_alone => "nothing was changed".to_owned(),
            Some(left) => format!("nothing was changed; even with {} in the same command, {left}", words.join(" ")),
            None => {
                let given: Vec<String> = changes.iter().map(|(name, value)| format!("{name} {value}")).collect();
                format!(
                    "nothing was changed; it takes another key in the same command: `set {} {}`",
                    given.join(" "),
                    words.join(" ")
                )
            }
        }
    }
}

/// The names that mean this setting: its own, and that of all motors.
fn names(place: SettingId) -> [String; 2] {
    [place.to_string(), format!("motor.*.{}", place.key.name())]
}

/// A setting as [`entries`] shows it.
fn shown(settings: &Settings, place: SettingId) -> Option<String> {
    let name = place.to_string();
    entries(settings).into_iter().find(|(known, _)| *known == name).map(|(_, value)| value)
}

/// The value nearest to the one in `settings` to which `error` does not apply; `None` where there is none that is nearest.
fn nearest(settings: &Settings, error: SettingsError) -> Option<String> {
    match error.problem {
        Problem::OutOfRange { value, min, max } => Some(value.max(min).min(max).to_string()),
        Problem::FramesOutrunTicks { .. } => Some((settings.loop_rate_hz * 2).to_string()),
        Problem::NoEdges { min, max } => {
            let value: f64 = shown(settings, error.place)?.parse().ok()?;
            Some(value.max(min).min(max).to_string())
        }
        Problem::PulseTooLong { max_frame_hz, .. } => Some(max_frame_hz.to_string()),
        Problem::StopWithoutRawDuty => Some("0".into()),
        Problem::NeedsReplies => Some("dshot600_bidirectional".into()),
        Problem::ZeroNotBelowPoles | Problem::NoCurve | Problem::NoReplies | Problem::NoSpeed | Problem::SpeedFalls => {
            None
        }
    }
}
