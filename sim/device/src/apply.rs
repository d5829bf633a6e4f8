//! Settings put to use and stored, where somebody has chosen them.

use rotorlead::settings::{Key, Validated};

use super::{DeviceError, Session, change_with_filters};

/// Settings that a controller has put to use.
#[derive(Clone, Debug, PartialEq)]
pub struct Applied {
    /// All of them.
    pub settings: Validated,
    /// What the controller says of them.
    pub warnings: Vec<String>,
}

/// Makes `changes` on the controller, all or none, until its power goes. `typed` are those that somebody typed, for a remedy that repeats
/// them.
///
/// # Errors
/// [`DeviceError`]: the changes make no settings that may be used, or nobody has chosen the ESC's protocol yet, and it is not among them.
pub fn apply(session: &mut Session, changes: &[(String, String)], typed: &str) -> Result<Applied, DeviceError> {
    // Here rather than by the controller: the reasons are the same, and a design says more.
    let settings = change_with_filters(&session.settings()?, changes)?;
    let is_protocol_given = changes.iter().any(|(key, _)| key == Key::OutputProtocol.name());
    if !is_protocol_given && !session.info()?.outputs_enabled {
        let help = format!(
            "set the ESC's protocol in the same command, even where it is standard_pwm: `set output.protocol PROTOCOL {typed}`"
        );
        return Err(DeviceError::NotChosen { act: "setting anything else alone", help });
    }
    let warnings = session.set_settings(&settings)?.iter().map(|warning| warning.to_string()).collect();
    Ok(Applied { settings, warnings })
}

/// Stores the settings in use.
///
/// # Errors
/// [`DeviceError`]; [`DeviceError::NotChosen`], where nobody has chosen them.
pub fn save_chosen(session: &mut Session) -> Result<(), DeviceError> {
    if !session.info()?.outputs_enabled {
        // Stored settings count as chosen. A flag for the defaults would soon be typed out of habit.
        let help = "`rotorlead device set output.protocol PROTOCOL` first, even where it is standard_pwm".to_owned();
        return Err(DeviceError::NotChosen { act: "storing them", help });
    }
    session.save()
}
