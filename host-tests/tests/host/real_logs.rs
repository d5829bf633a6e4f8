//! Logs of real motors, from log to model.
//!
//! Where the logs are looked for, and what happens without them, is said at [`real_log`].

use host_tests::real_log;
use rotorlead_design::{
    Chain, CompensatorError, DesignOptions, InverseOptions, Setting, bandwidths, design, design_inverse,
};
use rotorlead_identify::alignment::{AlignmentOptions, CommandLog, ResponseLog, align};
use rotorlead_identify::identification::{IdentifyOptions, Lags, identify};
use rotorlead_identify::lag::steps::{Direction, StaircaseFit, StepFault, StepsWarning, fit_staircase};
use rotorlead_identify::static_map::{MapLimit, StaticMapFit, SteadyPoints, fit_static_map};
use rotorlead_identify::validate::validate;
use rotorlead_plant::Model;
use rotorlead_records::Excitation;
use rotorlead_records::import::{Import, ImportOptions, import};

struct Identified {
    log: Import,
    fit: StaircaseFit,
    model: Model,
}

fn identified(name: &str) -> Option<Identified> {
    let log = import(&real_log(name)?, &ImportOptions::default()).unwrap();
    let fit = fit_staircase(&log.experiment.records[0], log.experiment.output, log.experiment.esc_frame_hz).unwrap();
    let model = fit.to_model("test").unwrap();
    print(name, &fit);
    Some(Identified { log, fit, model })
}

fn print(name: &str, fit: &StaircaseFit) {
    println!(
        "{name}: fit {:.1} % ({:.1} % with spikes, {:.1} % with own levels), delay {:.1} +- {:.1} ms, onsets {:.1} ms, \
         curvature {:.2} +- {:.2}",
        fit.fit_percent,
        fit.fit_percent_with_spikes,
        fit.fit_percent_own_levels,
        1e3 * fit.delay_s.value,
        1e3 * fit.delay_s.std,
        1e3 * fit.onset_std_s,
        fit.curvature.value,
        fit.curvature.std
    );
    for level in &fit.levels {
        print!("  {:.2}", level.command);
        for branch in [level.up, level.down] {
            match branch.and_then(|b| b.time_constant_s.zip(b.fit_percent)) {
                Some((tau, fit)) => print!(" | {:5.1} +- {:4.1} ms {fit:4.1} %", 1e3 * tau.value, 1e3 * tau.std),
                None => print!(" | {:22}", "-"),
            }
        }
        println!(" | {:6.0} per unit", level.gain.map_or(f64::NAN, |g| g.value));
    }
    for warning in &fit.warnings {
        println!("  {warning}");
    }
}

fn tau_ms(fit: &StaircaseFit, command: f64, direction: Direction) -> f64 {
    let level = fit.levels.iter().find(|l| (l.command - command).abs() < 1e-6);
    let branch = level.and_then(|l| l.branch(direction)).unwrap();
    1e3 * branch.time_constant_s.unwrap().value
}

fn median_tau_up_ms(fit: &StaircaseFit) -> f64 {
    let up = |l: &rotorlead_identify::lag::steps::Level| l.up?.time_constant_s;
    let mut all: Vec<f64> = fit.levels.iter().filter_map(up).map(|e| e.value).collect();
    all.sort_by(f64::total_cmp);
    1e3 * all[all.len() / 2]
}

/// What holds for every log: points by increasing command, all usable, none at a level whose map falls.
fn check_model(it: &Identified) {
    let points = &it.model.points;
    assert!(points.is_sorted_by(|a, b| a.nominal < b.nominal));
    for p in points {
        assert!(p.gain > 0.0 && p.delay_s >= 0.0, "{p:?}");
        assert!((0.015..0.09).contains(&p.time_constant_s), "{p:?}");
        assert!(p.fit_step_percent.is_none_or(|percent| percent > 75.0), "{p:?}");
    }
    let map = it.model.static_map.as_ref().unwrap();
    assert_eq!(map.command.len(), it.fit.levels.len());
    let judged = &validate(&it.log.experiment, &it.model).unwrap()[0];
    println!("  the model file on its record: {:.2} % of {:?}", judged.fit_percent, judged.ceiling_percent);
    // The file has no curvature and one time constant for both directions; what these explain is small.
    assert!((judged.fit_percent - it.fit.fit_percent).abs() < 0.2, "{judged:?}");
    assert!(judged.fit_percent < judged.ceiling_percent.unwrap(), "{judged:?}");

    let design = design(&it.model, &DesignOptions::default()).unwrap();
    let predicted = bandwidths(&it.model, Chain::Continuous(design.lead()));
    assert_eq!(predicted.len(), points.len());
    for point in predicted {
        let (before, after) = (point.uncompensated.rad_s().unwrap(), point.compensated.rad_s().unwrap());
        println!("  {:.2}: {before:.2} rad/s, compensated {after:.2} rad/s", point.nominal);
        // The slowest level, at a third of the zero, gains 15 %; those within 3 dB of it several times as much.
        let gain = if before < design.lead().slowest_helped_rad_s() { 1.1 } else { 2.5 };
        assert!(after > gain * before, "{point:?}");
    }
}

#[test]
fn rcbenchmark_log() {
    let Some(it) = identified("Log_2019-11-09_181347.csv") else {
        return;
    };
    let (summary, fit) = (&it.log.summary, &it.fit);
    assert_eq!((summary.rows_read, summary.rows_taken), (15875, 15688));
    assert_eq!(summary.timing.rows_reordered, 4);
    let thrust = summary.columns.iter().find(|c| c.name == "Thrust (gf)");
    assert!(thrust.is_some_and(|c| c.taken_as.is_none() && c.note.contains("Hz")));
    check_model(&it);

    // 96.1 %; 94.4 % with the probe's spikes, beside 89 % of a quadratic map with one lag and 94 % of a
    // lag that depends on the speed, both fitted by hand to all rows.
    assert!((95.9..96.4).contains(&fit.fit_percent), "{}", fit.fit_percent);
    assert!(fit.fit_percent_with_spikes > 94.2);
    assert!(fit.fit_percent_own_levels > 98.7);
    assert!((0.030..0.037).contains(&fit.delay_s.value), "{:?}", fit.delay_s);
    // Commands wait for the next of the stand's 20 ms frames: uniform, so 5.8 ms.
    assert!((0.005..0.008).contains(&fit.onset_std_s), "{}", fit.onset_std_s);
    assert!((33.0..37.0).contains(&median_tau_up_ms(fit)));
    assert!((40.0..55.0).contains(&tau_ms(fit, 0.20, Direction::Up)));
    for command in [0.3, 0.5, 0.7] {
        assert!((36.0..47.0).contains(&tau_ms(fit, command, Direction::Down)));
    }
    // The erratic start before 16 s of the log, and the top step.
    let start_s = it.log.experiment.records[0].time_s[fit.runs[0].start] + 1.35;
    assert!((15.5..16.0).contains(&start_s), "{start_s}");
    let falling = |w: &StepsWarning| matches!(w, StepsWarning::NotRising { command } if *command > 0.94);
    assert!(fit.warnings.iter().any(falling));
    assert!(fit.warnings.contains(&StepsWarning::Spikes { rows: 26, column: "rpm" }));
    // Without 0.15, to which no step leads. The step to 0.80 came out twice as fast as its neighbors, and the curve does not
    // follow it.
    assert_eq!(it.model.points.len(), 15);
    let at =
        |command: f64| it.model.points.iter().find(|p| (p.nominal - command).abs() < 1e-6).unwrap().time_constant_s;
    assert!(tau_ms(fit, 0.80, Direction::Up) < 22.0 && at(0.80) > 0.030);
    assert!(it.model.points.iter().all(|p| p.nominal < 0.91));
}

#[test]
fn esc32_log_f60() {
    let Some(it) = identified("esc32v3_f60-1.csv") else {
        return;
    };
    let (timing, fit) = (&it.log.summary.timing, &it.fit);
    assert_eq!(timing.rows_missing, 34);
    assert!((99.9..100.1).contains(&timing.rate_hz), "{timing:?}");
    assert!(timing.residual_rms_s.unwrap() < 0.006, "{timing:?}");
    check_model(&it);

    assert!((97.2..97.6).contains(&fit.fit_percent), "{}", fit.fit_percent);
    assert!(fit.fit_percent_own_levels > 98.2);
    // No delay; a duty is logged with the row after it was set, half a row on average.
    assert!((-0.005..0.001).contains(&fit.delay_s.value), "{:?}", fit.delay_s);
    assert!((31.0..38.0).contains(&median_tau_up_ms(fit)));
    // This ESC lets the motor coast: steps down are slower.
    assert!((57.0..68.0).contains(&tau_ms(fit, 0.25, Direction::Down)));
    assert!((30.0..34.5).contains(&tau_ms(fit, 0.25, Direction::Up)));
    assert!((47.0..54.0).contains(&tau_ms(fit, 0.50, Direction::Down)));
    assert_eq!(it.model.points.len(), 18);
    assert!(it.model.points.iter().all(|p| p.nominal < 0.96), "full duty slows it down");
}

#[test]
fn esc32_log_f40() {
    let Some(it) = identified("f40_steps_5-2.csv") else {
        return;
    };
    let (timing, fit) = (&it.log.summary.timing, &it.fit);
    assert_eq!(timing.rows_missing, 35);
    assert!(timing.residual_rms_s.unwrap() < 0.006, "{timing:?}");
    check_model(&it);

    assert!((97.5..97.9).contains(&fit.fit_percent), "{}", fit.fit_percent);
    assert!(fit.fit_percent_own_levels > 97.9);
    assert!((-0.005..0.001).contains(&fit.delay_s.value), "{:?}", fit.delay_s);
    assert!((31.0..37.0).contains(&median_tau_up_ms(fit)));
    assert!((53.0..65.0).contains(&tau_ms(fit, 0.25, Direction::Down)));
    assert!((33.0..40.0).contains(&tau_ms(fit, 0.25, Direction::Up)));
    assert_eq!(it.model.points.len(), 18);
    assert_eq!(it.model.points.last().unwrap().nominal, 1.0, "here full duty is the fastest");

    // What docs/inverse.md says of it.
    let inverse = design_inverse(&it.model, &InverseOptions::default()).unwrap();
    assert_eq!((inverse.setting, inverse.compensator.range().compensated), (Setting::Robust, (0.1, 1.0)));
    assert!((1.09..1.12).contains(&inverse.worst.1), "{:?}", inverse.worst);
    let table_s = inverse.compensator.points().iter().find(|point| point.command == 0.5).unwrap().tau_s;
    let point_s = it.model.points.iter().find(|point| point.nominal == 0.5).unwrap().time_constant_s;
    assert!((table_s / point_s / 0.9 - 0.86).abs() < 0.01, "{}", table_s / point_s);
}

fn static_map(it: &Identified) -> StaticMapFit {
    let steady = SteadyPoints::from_record(&it.log.experiment.records[0], it.log.experiment.output, None).unwrap();
    let fit = fit_static_map(&steady).unwrap();
    println!(
        "  degree {}, {:?}, {:?}, {:?}, excess {:.1}",
        fit.degree(),
        fit.hysteresis,
        fit.limit,
        fit.dead_zone,
        fit.excess
    );
    fit
}

/// The log's two columns as two logs, the response on a clock that is 1.234 s behind and 400 ppm fast: what changes is known.
fn check_alignment(it: &Identified) {
    let record = &it.log.experiment.records[0];
    let rows = it.fit.runs[0].clone();
    let (time_s, command) = (&record.time_s[rows.clone()], &record.command[rows.clone()]);
    let y = &record.rpm.as_ref().unwrap()[rows];
    let moved: Vec<f64> = time_s.iter().map(|t| t * (1.0 + 400e-6) - 1.234).collect();
    let of = |time: &[f64]| {
        let log = CommandLog { name: "command", time_s, command, response: None };
        let response = ResponseLog { name: "response", time_s: time, response: y };
        let options = AlignmentOptions { within_s: Some(3.0), ..AlignmentOptions::default() };
        align(&log, &response, &options).unwrap()
    };
    let (before, after) = (of(time_s), of(&moved));
    let (skew, none) = (after.skew.unwrap(), before.skew.unwrap());
    println!(
        "  delay {:?}, skew {none:?}, lag {:?}, order {}",
        before.delay_s, before.time_constant_s, before.noise_order
    );
    assert!((skew.value - none.value - 400e-6).abs() < 0.1 * skew.std + 1e-6, "{skew:?} {none:?}");
    let at = |found: &rotorlead_identify::alignment::Alignment, t: f64| found.command_time_s(t);
    // The same row has the same command time before and after, to a tenth of the standard error.
    let middle = time_s.len() / 2;
    let off = at(&before, time_s[middle]) - at(&after, moved[middle]);
    assert!(off.abs() < 0.1 * before.delay_s.std + 1e-5, "{off}");
    assert!(before.delay_s.std < 0.005, "{before:?}");
}

#[test]
fn held_out_steps_static_map_and_alignment_of_the_rcbenchmark_log() {
    let Some(it) = identified("Log_2019-11-09_181347.csv") else { return };
    let map = static_map(&it);
    assert!(
        matches!(map.limit, Some(MapLimit::Falls { command, .. }) if (command - 0.9).abs() < 1e-6),
        "{:?}",
        map.limit
    );
    check_alignment(&it);
}

#[test]
fn held_out_steps_static_map_and_alignment_of_the_f60_log() {
    let Some(it) = identified("esc32v3_f60-1.csv") else { return };
    let map = static_map(&it);
    assert!(
        matches!(map.limit, Some(MapLimit::Falls { command, .. }) if (command - 0.95).abs() < 1e-6),
        "{:?}",
        map.limit
    );
    check_alignment(&it);
}

#[test]
fn held_out_steps_static_map_and_alignment_of_the_f40_log() {
    let Some(it) = identified("f40_steps_5-2.csv") else { return };
    let map = static_map(&it);
    assert!(!matches!(map.limit, Some(MapLimit::Falls { .. })), "{:?}", map.limit);
    check_alignment(&it);
}

/// A staircase of a small motor, its command DShot's numbers. By hand 34.2 ms and 29.9 ms of delay on the whole run, stalled steps
/// included; the stand's own software fitted 27 ms up and 34 ms down to single steps.
#[test]
fn log_of_a_small_motor() {
    let Some(it) = identified("micro_2023-12-17_162234.csv") else { return };
    let fit = &it.fit;
    // Two steps lie in stalls of the logger, two lead to and from a level of five rows; nothing else is cut.
    let faults = |is_one: fn(&StepFault) -> bool| fit.steps.iter().filter_map(|s| s.fault).filter(is_one).count();
    assert_eq!(faults(|fault| matches!(fault, StepFault::ResponseInGap { .. })), 2);
    assert_eq!(faults(|fault| matches!(fault, StepFault::Short)), 2);
    assert_eq!(fit.runs.len(), 1);
    assert!(fit.steps.last().unwrap().at_s > 40.0, "the run goes on behind the level of five rows");
    let cut = fit
        .warnings
        .iter()
        .filter(|w| matches!(w, StepsWarning::PartLeftOut { from_s: Some(_), until_s: Some(_), .. }));
    assert_eq!(cut.count(), 0, "nothing is cut out of the middle");
    let curve = fit.curve.as_ref().unwrap();
    let average = |direction| 1e3 * curve.average(direction).unwrap().value;
    println!("  up {:.1} ms, down {:.1} ms", average(Direction::Up), average(Direction::Down));
    // Single steps of the stand's software scatter by 2.6 and 3.1 ms.
    assert!((average(Direction::Up) - 27.0).abs() < 3.2 && (average(Direction::Down) - 34.0).abs() < 3.1);
    // By hand, of one lag for all steps.
    let delay_ms = 1e3 * fit.delay_s.value;
    println!("  delay {delay_ms:.1} ms");
    assert!((delay_ms / 29.9 - 1.0).abs() < 0.1, "{delay_ms}");
}

/// The logger stalls within 11 of 14 steps. By hand the others give 30 to 31 ms, 46 ms to the lowest level, and 20 to 26 ms of
/// delay.
#[test]
fn log_of_a_larger_motor_whose_logger_stalls() {
    let Some(it) = identified("so_v5_2023-12-13_130935.csv") else { return };
    let fit = &it.fit;
    let in_gap = fit.steps.iter().filter(|step| matches!(step.fault, Some(StepFault::ResponseInGap { .. }))).count();
    assert_eq!((in_gap, fit.steps.len()), (11, 14));
    for step in &fit.steps {
        let Some(tau) = step.time_constant_s() else { continue };
        let by_hand_ms = if step.to < 0.05 { 46.0 } else { 30.5 };
        assert!((1e3 * tau.value / by_hand_ms - 1.0).abs() < 0.1, "{step:?}");
        assert!((0.019..0.027).contains(&step.lag.unwrap().delay_s), "{step:?}");
    }
    for point in &it.model.points {
        // On the straight line between the lowest level and the next one to which a step without a stall leads.
        let share = ((point.nominal - 0.031) / (0.140 - 0.031)).clamp(0.0, 1.0);
        let by_hand_ms = 46.0 + share * (30.5 - 46.0);
        assert!((1e3 * point.time_constant_s / by_hand_ms - 1.0).abs() < 0.25, "{point:?}");
    }
    let design = design(&it.model, &DesignOptions::default()).unwrap();
    assert!((25.0..40.0).contains(&design.lead().omega_z_rad_s), "{:?}", design.lead());
    // What is known of three levels is too little for an inverse.
    let refused = design_inverse(&it.model, &InverseOptions::default()).unwrap_err();
    let CompensatorError::NotKnownForInverse { nominal, factor, .. } = refused else { panic!("{refused}") };
    assert!((nominal - 0.591).abs() < 1e-3 && factor > 1.2, "{refused}");
}

/// A table whose rows are averages gives a static map and no lag.
#[test]
fn table_of_steady_points() {
    let Some(path) = real_log("so_v5_steps_2024-02-06_103903.csv") else { return };
    let log = import(&path, &ImportOptions::default()).unwrap();
    assert_eq!(log.experiment.records[0].excitation, Excitation::Steady);
    let found = identify(&log.experiment, &IdentifyOptions::default()).unwrap();
    assert!(matches!(found.lags, Lags::None) && found.model.points.is_empty());
    let map = found.model.static_map.as_ref().unwrap();
    assert!(map.command.len() == 15 && map.response.is_sorted(), "{map:?}");
    let (_, fit) = found.static_map.as_ref().unwrap();
    // By hand from the table: 433.6 rad/s at DShot 200.
    let response = fit.response((200.0 - 48.0) / (2047.0 - 48.0)).value;
    assert!((response / (433.6 * 30.0 / std::f64::consts::PI) - 1.0).abs() < 0.1, "{response}");
    assert!(design(&found.model, &DesignOptions::default()).is_err());
}
