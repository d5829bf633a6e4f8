//! Compensated records that do not hold the command to the ESC: the compensator is then part of the chain.

use rotorlead::throttle::Command;
use rotorlead_plant::CompensatorDesign;
use rotorlead_records::files::{FileError, InputFolder};
use rotorlead_records::{Experiment, Record};

/// Gives each compensated record without `esc_command` the one that the compensator that it names makes of its `command`, by the
/// controller's own filter at its own rate. `folder` is the experiment's. Between two rows the filter moves and the column
/// cannot: a row has the mean of its ticks.
///
/// # Errors
/// [`FileError`] where a compensator's file cannot be read, or another program wrote it.
pub fn fill_in_esc_commands(experiment: &mut Experiment, folder: InputFolder) -> Result<(), FileError> {
    for record in &mut experiment.records {
        let Some(name) = record.compensator.as_deref().filter(|_| record.compensated && record.esc_command.is_none())
        else {
            continue;
        };
        let design = CompensatorDesign::parse(folder.text(&name.to_string_lossy())?)?;
        let first = record.command.first().copied().unwrap_or_default();
        let mut compensator = design.running(Command::saturating_from_f64(first));
        let applied = filtered(record, design.loop_rate_hz(), |input| {
            compensator.update(Command::saturating_from_f64(input)).to_f64()
        });
        record.esc_command = Some(applied);
    }
    Ok(())
}

/// The mean over the ticks of each row of what `filter` makes of the command.
fn filtered(record: &Record, rate_hz: f64, mut filter: impl FnMut(f64) -> f64) -> Vec<f64> {
    let begin_s = record.time_s.first().copied().unwrap_or_default();
    let tick_at = |time_s: f64| ((time_s - begin_s) * rate_hz).round() as u64;
    let mut last = record.command.first().copied().unwrap_or_default();
    let mut applied = Vec::with_capacity(record.command.len());
    for (row, &command) in record.command.iter().enumerate() {
        let ticks = record.time_s.get(row + 1).map_or(1, |next| tick_at(*next) - tick_at(record.time_s[row]));
        let sum: f64 = (0..ticks).map(|_| filter(command)).sum();
        // Rows closer than a tick have what was there.
        last = if ticks > 0 { sum / ticks as f64 } else { last };
        applied.push(last);
    }
    applied
}

#[cfg(test)]
mod tests {
    use rotorlead_design::{DesignOptions, InverseOptions, design, design_inverse};
    use rotorlead_identify::testing::{experiment, record};
    use rotorlead_plant::testing::table_1;
    use rotorlead_records::files::testing::Scratch;

    use super::*;

    #[test]
    fn the_column_is_what_the_filter_of_the_file_makes_of_the_command() {
        let lead = design(&table_1(), &DesignOptions::default()).unwrap().into();
        let inverse = design_inverse(&table_1(), &InverseOptions::default()).unwrap().compensator.into();
        for compensator in [lead, inverse] {
            fills_in(&compensator);
        }
    }

    fn fills_in(compensator: &CompensatorDesign) {
        let scratch = Scratch::new();
        compensator.write(&scratch.path().join("compensator.toml")).unwrap();
        let step: Vec<f64> = (0..400).map(|row| if row < 100 { 0.4 } else { 0.45 }).collect();
        let still = vec![1.0; step.len()];
        let mut experiment = experiment(500.0, vec![record(500.0, None, step, still)]);
        fill_in_esc_commands(&mut experiment, scratch.path().into()).unwrap();
        assert_eq!(experiment.records[0].esc_command, None, "it is not compensated");
        experiment.records[0].compensated = true;
        experiment.records[0].compensator = Some("compensator.toml".into());
        fill_in_esc_commands(&mut experiment, scratch.path().into()).unwrap();
        let applied = experiment.records[0].esc_command.clone().unwrap();
        assert!(applied[..100].iter().all(|u| (u - 0.4).abs() < 1e-5), "{applied:?}");
        // It leads, and comes to rest at the command.
        let most = applied[100..120].iter().fold(0.0_f64, |most, u| most.max(*u));
        // A row's mean comes near the largest of its ticks, and does not pass it.
        let peak = 0.4 + 0.05 * compensator.step_peak();
        assert!(most < peak && most - 0.4 > 0.9 * (peak - 0.4), "{most} {peak}");
        assert!((applied[399] - 0.45).abs() < 1e-4, "{}", applied[399]);
        experiment.records[0].esc_command = None;
        experiment.records[0].compensator = Some("other.toml".into());
        assert!(fill_in_esc_commands(&mut experiment, scratch.path().into()).is_err());
    }
}
