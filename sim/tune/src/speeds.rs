//! What is set with an inverse that is corrected: the speeds that correct it.

use rotorlead::design::SpeedCurve;
use rotorlead::settings::{Key, SettingId, Settings};
use rotorlead_device::{speed_curve, speeds_text};
use rotorlead_numerics::sample::mean;
use rotorlead_records::{Experiment, Role};

/// Electrical revolutions per minute over the command, from the mean speed of each record that is not held out, in order of the command.
pub(super) fn measured_speeds(experiment: &Experiment, motor_poles: u8) -> Result<SpeedCurve, String> {
    let to_electrical = f64::from(motor_poles) / 2.0;
    let records = experiment.records.iter().filter(|record| record.role != Some(Role::Validate));
    let points = records.filter_map(|record| Some((record.nominal, to_electrical * mean(record.rpm.as_ref()?))));
    speed_curve(&points.collect::<Vec<_>>())
}

/// Has the inverse that `changes` set go by these speeds of motors. A motor whose speeds nobody knows gets those of the first one.
pub(super) fn correct_by(changes: &mut Vec<(String, String)>, settings: &Settings, speeds: &[(u8, SpeedCurve)]) {
    for (key, value) in changes.iter_mut() {
        if key == Key::Compensator.name() {
            *value = "rpm".to_owned();
        }
    }
    for (motor, known) in (0..).zip(&settings.speeds) {
        let own = speeds.iter().find(|(tuned, _)| *tuned == motor);
        let first = speeds.first().filter(|_| known.is_none());
        if let Some((_, curve)) = own.or(first) {
            let key = SettingId { key: Key::Erpm, motor: Some(motor) };
            changes.push((key.to_string(), speeds_text(curve)));
        }
    }
}
