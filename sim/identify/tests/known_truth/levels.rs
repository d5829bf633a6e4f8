//! Levels: which run, which have a gain, and what is said of those that do not.

use rotorlead_identify::lag::steps::{Direction, LeftOut, StaircaseFit, StepsWarning};
use rotorlead_records::Excitation;
use rotorlead_records::import::{ImportOptions, import};
use rotorlead_records::shared_data::data;

use super::steps::{BENCH, MOTOR, fitted, staircase_through};

#[test]
fn a_record_that_only_steps_down_has_gains_and_nothing_that_falls() {
    for (plateaus, seed) in [(&[0.8, 0.65, 0.5, 0.35, 0.2][..], 1), (&[0.9, 0.6, 0.3][..], 2), (&[0.7, 0.4][..], 3)] {
        let fit = fitted(&staircase_through(plateaus, &MOTOR, &BENCH, seed));
        assert_eq!(fit.main_direction, Direction::Down);
        assert!(fit.levels.iter().all(|level| level.gain.is_some() && !level.falls), "{:?}", fit.levels);
        let without_gain = |w: &StepsWarning| matches!(w, StepsWarning::NotRising { .. } | StepsWarning::NoGain { .. });
        assert!(!fit.warnings.iter().any(without_gain), "{:?}", fit.warnings);
    }
}

#[test]
fn a_level_whose_gain_is_not_known_is_not_said_to_fall() {
    for (plateaus, alone, seed) in [(&[0.75, 0.1, 0.9][..], 0.1, 1), (&[0.3, 0.6, 0.9, 0.45][..], 0.45, 2)] {
        let fit = fitted(&staircase_through(plateaus, &MOTOR, &BENCH, seed));
        let level = fit.levels.iter().find(|level| level.command == alone).unwrap();
        assert!(level.gain.is_none() && !level.falls, "{level:?}");
        assert!(fit.warnings.contains(&StepsWarning::NoGain { command: alone }), "{:?}", fit.warnings);
        assert!(!fit.warnings.iter().any(|w| matches!(w, StepsWarning::NotRising { .. })), "{:?}", fit.warnings);
    }
}

/// A staircase of a motor that turns slowly at command 0.05, at 4.5 % of its highest speed, and reads `at_zero` at command zero.
fn slow_start(plateaus: &[f64], at_zero: f64, at_slow: Option<f64>) -> StaircaseFit {
    let mut record = staircase_through(plateaus, &MOTOR, &BENCH, 1);
    let commands = record.command.clone();
    for (rpm, command) in record.rpm.as_mut().unwrap().iter_mut().zip(commands) {
        let noise = *rpm - rpm.round();
        *rpm = match at_slow {
            _ if command == 0.0 => at_zero + noise,
            Some(at_slow) if command == 0.05 => at_slow + noise,
            _ => *rpm - 2500.0,
        };
    }
    fitted(&record)
}

#[test]
fn a_slow_level_runs_where_its_speed_is_not_that_of_standstill() {
    let runs = slow_start(&[0.0, 0.4, 0.05, 0.7, 0.1, 0.9, 0.0], 0.0, None);
    assert_eq!(runs.levels.len(), 5, "{:?}", runs.levels);
    let reasons = |fit: &StaircaseFit| -> Vec<LeftOut> {
        let reason =
            |w: &StepsWarning| if let StepsWarning::PartLeftOut { reason, .. } = w { Some(*reason) } else { None };
        fit.warnings.iter().filter_map(reason).collect()
    };
    assert!(reasons(&runs).iter().all(|reason| matches!(reason, LeftOut::Idle { share } if share.abs() < 5e-4)));
    // What an ESC keeps at any low command says nothing of one that follows it.
    let idles = slow_start(&[0.0, 0.05, 0.4, 0.7, 0.5, 0.9, 0.0], 500.0, Some(500.0));
    assert!(idles.levels.iter().all(|level| level.command > 0.1), "{:?}", idles.levels);
    assert!(reasons(&idles).iter().any(|reason| matches!(reason, LeftOut::Idle { share } if *share > 0.03)));
    // A level between two stops runs, and is no idling motor.
    let alone = slow_start(&[0.0, 0.5, 0.0, 0.3, 0.6, 0.0], 0.0, None);
    assert_eq!(reasons(&alone)[0], LeftOut::Short, "{:?}", alone.warnings);
}

#[test]
fn the_first_running_level_of_a_log_with_slow_levels_is_kept() {
    let Some(log) = data("cases/dshot-order-blocks-guess/log.csv") else { return };
    let options = ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() };
    let fit = fitted(&import(&log, &options).unwrap().experiment.records[0]);
    // DShot 779, 135, 1577, 238 and 1796.
    assert_eq!(fit.levels.len(), 5, "{:?}", fit.levels);
    assert!(fit.levels.iter().all(|level| !level.falls && level.time_constant_s.is_none_or(|tau| tau.value < 0.05)));
    let left_out = fit.warnings.iter().filter(|w| matches!(w, StepsWarning::PartLeftOut { .. }));
    assert!(left_out.clone().count() > 0);
    for part in left_out {
        assert!(part.to_string().contains("stands still"), "{part}");
    }
}
