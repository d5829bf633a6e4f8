//! The bench against its own prediction, and against itself.

use std::f64::consts::TAU;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Complex;
use rotorlead::design::{LeadDesign, LeadParameters};
use rotorlead_fourier as fourier;
use rotorlead_records::{Excitation, Experiment, Output, Record};

use super::*;
use crate::testing::{model, table_1};
use crate::{
    Actuator, Color, CommandSignal, CompensatorDesign, Effect, EscTiming, Law, Model, Noise, Provenance, Start,
    simulate,
};

/// How far the mean response is from what rows at every tick find.
const MEAN_AT_TICKS: f64 = 2e-5;

fn paper_lead() -> CompensatorDesign {
    let poles: Vec<f64> = table_1().points.iter().map(|p| 1.0 / p.time_constant_s).collect();
    LeadDesign::new(LeadParameters::from_poles(&poles, TAU * 100.0).unwrap(), 5000.0, None).unwrap().into()
}

fn silent(mut plan: Plan) -> Plan {
    plan.noise = Noise::default();
    plan
}

fn quick(plan: &Plan, model: &Model, compensator: Option<&CompensatorDesign>) -> Experiment {
    run(plan, model, compensator, &|_| {}).unwrap()
}

fn spectrum(x: &[f64]) -> Vec<Complex<f64>> {
    let fft = fourier::real_forward(x.len());
    let (mut input, mut output) = (x.to_vec(), fft.make_output_vec());
    fft.process(&mut input, &mut output).unwrap();
    output
}

/// Largest relative deviation of the transfer function estimate over the whole record from `expected(omega)`, at the
/// excited lines.
fn worst_deviation(record: &Record, lines: usize, expected: impl Fn(f64) -> Complex<f64>) -> f64 {
    let step_s = record.time_s[1] - record.time_s[0];
    let periods = (record.time_s.len() as f64 * step_s / record.period_s.unwrap()).round() as usize;
    let (u, y) = (spectrum(&record.command), spectrum(record.thrust_n.as_ref().unwrap()));
    (0..lines)
        .map(|line| {
            let harmonic = 2 * line + 1;
            let expected = expected(TAU * 0.1 * harmonic as f64);
            (y[harmonic * periods] / u[harmonic * periods] / expected - 1.0).norm()
        })
        .fold(0.0, f64::max)
}

fn multisines(plan: &mut Plan) {
    plan.records.retain(|record| record.excitation == Excitation::Multisine);
}

/// A record of `excitation` at 0.5 with nothing else.
fn bare(excitation: Excitation) -> PlannedRecord {
    PlannedRecord::new(0.5, excitation)
}

fn plan_with(record: PlannedRecord) -> Plan {
    Plan { records: vec![record], ..silent(Plan::paper(&table_1())) }
}

/// What remains is the rounding of commands to 2^-29.
#[test]
fn without_noise_the_bench_finds_its_prediction_at_every_line_to_1e_7() {
    let lead = paper_lead();
    let mut plain = silent(Plan::paper(&table_1()));
    multisines(&mut plain);
    let compensated = plain.clone().compensated("compensator.toml");
    for (plan, lead, lines) in [(plain, None, 150), (compensated, Some(&lead), 225)] {
        let experiment = quick(&plan, &table_1(), lead);
        for record in &experiment.records {
            assert_eq!(record.compensated, lead.is_some());
            let prediction = Prediction::new(&plan, &table_1(), record.nominal, lead).unwrap();
            let worst = worst_deviation(record, lines, |omega| prediction.response_at_rows(omega));
            assert!(worst < 1e-7, "{lines} lines at {}: off by {worst:e}", record.nominal);
        }
    }
}

#[test]
fn frames_at_any_phase_and_delays_between_ticks_are_in_the_prediction() {
    let delayed = model(&[(0.5, 10.0, 0.1, 0.003_217)]);
    for (esc_frame_hz, esc_frame_phase, sample_rate_hz) in [
        (None, 0.0, 1000),
        (Some(600.0), 0.37, 1000),
        (Some(600.0), 0.0, 5000),
        (Some(1500.0), 0.9, 500),
        (Some(8000.0), 0.1, 1000),
    ] {
        let mut plan = silent(Plan::paper(&delayed));
        multisines(&mut plan);
        plan.records[0].periods = Some(1);
        plan = Plan { esc_frame_hz, esc_frame_phase, sample_rate_hz, ..plan };
        let experiment = quick(&plan, &delayed, None);
        let prediction = Prediction::new(&plan, &delayed, 0.5, None).unwrap();
        let worst = worst_deviation(&experiment.records[0], 150, |omega| prediction.response_at_rows(omega));
        assert!(worst < 1e-7, "{esc_frame_hz:?} Hz, phase {esc_frame_phase}: off by {worst:e}");
    }
}

/// The mean response is that of the continuous output. Rows at 1 kHz fold images onto the lines; rows at every tick
/// see next to none of them.
#[test]
fn the_mean_response_is_what_dense_rows_find_and_sparse_ones_nearly() {
    let lead = paper_lead();
    for (sample_rate_hz, lead, lines, tolerance) in
        [(5000, None, 150, MEAN_AT_TICKS), (1000, None, 150, 5e-4), (1000, Some(&lead), 225, 1e-3)]
    {
        let mut plan = silent(Plan::paper(&table_1()));
        multisines(&mut plan);
        plan.records.truncate(1);
        plan.records[0].periods = Some(1);
        if lead.is_some() {
            plan = plan.compensated("compensator.toml");
        }
        plan.sample_rate_hz = sample_rate_hz;
        let experiment = quick(&plan, &table_1(), lead);
        let prediction = Prediction::new(&plan, &table_1(), 0.4, lead).unwrap();
        let worst = worst_deviation(&experiment.records[0], lines, |omega| prediction.response(omega));
        assert!(worst < tolerance, "{lines} lines, rows at {sample_rate_hz} Hz: off by {worst:e}");
        assert!(worst > 0.1 * tolerance, "the stated {tolerance:e} is too modest: {worst:e}");
    }
}

#[test]
fn a_square_wave_in_steady_state_follows_the_analytic_response_to_1e_7() {
    let record = PlannedRecord {
        amplitude: Some(0.05),
        half_period_s: Some(0.3),
        periods: Some(2),
        // The rest of the transient is e^-33 of it.
        warm_up_periods: Some(6),
        ..bare(Excitation::Square)
    };
    let plan = plan_with(record);
    let record = quick(&plan, &table_1(), None).records.remove(0);
    assert_eq!((record.period_s, record.time_s.len()), (Some(0.6), 1200));
    let point = &table_1().points[2];
    let (start, end) = (quick_steady(0.5), 0.3_f64);
    let over = 2.0 / (1.0 + (-end / point.time_constant_s).exp());
    for (row, &thrust_n) in record.thrust_n.as_ref().unwrap().iter().enumerate() {
        let (half, within) = (row / 300, (row % 300) as f64 / 1000.0);
        let sign = if half % 2 == 0 { 1.0 } else { -1.0 };
        let expected = start + sign * 0.05 * point.gain * (1.0 - over * (-within / point.time_constant_s).exp());
        assert!((thrust_n - expected).abs() < 1e-7, "row {row}: {thrust_n} for {expected}");
        // 300 ms are 180 frames: the level that takes effect is that of the row.
        assert!((record.command[row] - (0.5 + sign * 0.05)).abs() < 2e-9);
    }
}

fn quick_steady(command: f64) -> f64 {
    crate::operating::OperatingCurve::new(&table_1()).unwrap().steady_response(command)
}

#[test]
fn a_staircase_settles_at_the_steady_responses_and_a_step_stays_linear() {
    let levels = vec![0.40, 0.65, 0.50];
    let staircase = PlannedRecord { levels: Some(levels.clone()), hold_s: Some(4.0), ..bare(Excitation::Staircase) };
    let record = quick(&plan_with(staircase), &table_1(), None).records.remove(0);
    assert_eq!((record.time_s.len(), record.period_s), (12_000, None));
    assert!((record.amplitude.unwrap() - 0.15).abs() < 1e-15);
    let thrust_n = record.thrust_n.unwrap();
    for (index, &level) in levels.iter().enumerate() {
        assert!((thrust_n[4000 * (index + 1) - 1] - quick_steady(level)).abs() < 1e-7);
    }
    // 0.1 s after the step to 0.65 the time constant is that at 0.65, 1 / 14.1275 s, not that at 0.40.
    let part = (thrust_n[4100] - thrust_n[4000]) / (quick_steady(0.65) - quick_steady(0.40));
    assert!((part - (1.0 - (-1.412_75_f64).exp())).abs() < 1e-7, "{part}");

    let down = PlannedRecord { amplitude: Some(-0.2), hold_s: Some(4.0), ..bare(Excitation::Step) };
    let record = quick(&plan_with(down), &table_1(), None).records.remove(0);
    let thrust_n = record.thrust_n.unwrap();
    assert_eq!(thrust_n[0], quick_steady(0.5));
    assert!((thrust_n[7999] - (quick_steady(0.5) - 0.2 * 10.1718)).abs() < 1e-7);
}

#[test]
fn a_row_has_the_command_that_takes_effect_then_and_the_response_before_it() {
    let step = PlannedRecord { amplitude: Some(0.1), hold_s: Some(0.01), ..bare(Excitation::Step) };
    let mut plan = plan_with(step);
    plan.compensator = Some("compensator.toml".into());
    let lead = paper_lead();
    let record = quick(&plan, &table_1(), Some(&lead)).records.remove(0);
    let (esc_command, thrust_n) = (record.esc_command.unwrap(), record.thrust_n.unwrap());
    assert_eq!(record.time_s[10], 0.01);
    assert_eq!((record.command[9], esc_command[9]), (0.5, 0.5));
    // The section's first output after a step u is g0 u: there is no tick between command and ESC.
    assert!((record.command[10] - 0.6).abs() < 1e-9 && esc_command[10] > 0.5);
    assert_eq!(thrust_n[10], thrust_n[0]);
    assert!(thrust_n[11] > thrust_n[0]);
}

#[test]
fn the_result_depends_on_the_seed_and_not_on_the_threads() {
    let mut plan = Plan::paper(&table_1());
    plan.noise = Noise { sigma_n: 0.02, color: Color::Ar1, pole: Some(0.8), hum_n: Some(0.01), hum_hz: Some(50.0) };
    for record in &mut plan.records {
        record.periods = Some(1);
        record.warm_up_periods = Some(0);
    }
    let on =
        |threads, plan: &Plan| run_on(NonZeroUsize::new(threads).unwrap(), plan, &table_1(), None, &|_| {}).unwrap();
    let one = on(1, &plan);
    for threads in [2, 5, 64] {
        assert!(one == on(threads, &plan), "{threads} threads");
    }
    plan.seed = 2;
    let other = on(2, &plan);
    for (a, b) in one.records.iter().zip(&other.records) {
        assert!(a.command == b.command && a.thrust_n != b.thrust_n);
    }
}

/// Sigma of 40 000 rows has a standard error of 0.35 %, their correlation one of 0.5 %: five of each.
#[test]
fn every_record_has_noise_of_its_own_with_the_sigma_of_the_plan() {
    let mut plan = Plan::paper(&table_1());
    plan.records.truncate(3);
    let noisy = quick(&plan, &table_1(), None);
    let mut added = quick(&silent(plan.clone()), &table_1(), None);
    let noise: Vec<Vec<f64>> = noisy
        .records
        .iter()
        .zip(&added.records)
        .map(|(a, b)| a.thrust_n.iter().flatten().zip(b.thrust_n.iter().flatten()).map(|(a, b)| a - b).collect())
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / 40_000.0;
    for a in 0..3 {
        for b in 0..a {
            assert!((dot(&noise[a], &noise[b]) / 0.02_f64.powi(2)).abs() < 0.025);
        }
        assert!((dot(&noise[a], &noise[a]).sqrt() / 0.02 - 1.0).abs() < 0.0175);
    }
    add_noise(&mut added, plan.noise, plan.seed).unwrap();
    assert!(added == noisy);
}

#[test]
fn progress_ends_at_the_total() {
    let plan = plan_with(PlannedRecord {
        amplitude: Some(0.05),
        half_period_s: Some(0.5),
        periods: Some(4),
        ..bare(Excitation::Square)
    });
    let (largest, calls) = (AtomicUsize::new(0), AtomicUsize::new(0));
    run(&plan, &table_1(), None, &|progress| {
        assert_eq!(progress.total, 25_000);
        largest.fetch_max(progress.done, Ordering::Relaxed);
        calls.fetch_add(1, Ordering::Relaxed);
    })
    .unwrap();
    assert_eq!((largest.into_inner(), calls.into_inner()), (25_000, 5));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let lead = paper_lead();
    let refused = |plan: &Plan, model: &Model, lead| run(plan, model, lead, &|_| {}).unwrap_err();
    let plain = Plan::paper(&table_1());
    let compensated = plain.clone().compensated("c.toml");
    assert_eq!(refused(&compensated, &table_1(), None), BenchError::CompensatorMissing { file: "c.toml".into() });
    assert_eq!(refused(&plain, &table_1(), Some(&lead)), BenchError::CompensatorNotNamed);
    let slow = LeadDesign::new(*lead.as_lead().unwrap().lead(), 2000.0, None).unwrap().into();
    assert!(matches!(refused(&compensated, &table_1(), Some(&slow)), BenchError::LoopRate { .. }));
    assert!(matches!(refused(&plain, &model(&[(0.5, 1.0, 0.1, 0.0)]), None), BenchError::Plant(_)));

    let mut rpm = table_1();
    rpm.provenance = Some(Provenance {
        experiment: None,
        records_crc32: None,
        records: Vec::new(),
        version: String::new(),
        output: Output::Rpm,
        excitation: None,
        command_rate_hz: None,
        esc_frame_hz: None,
        judgement: None,
    });
    assert_eq!(refused(&plain, &rpm, None), BenchError::NoiseUnit);
    let plan = Plan::paper(&rpm);
    let experiment = quick(&Plan { records: plan.records[..1].to_vec(), ..plan }, &rpm, None);
    assert!(experiment.output == Output::Rpm && experiment.records[0].rpm.is_some());
}

#[test]
fn files_are_named_by_level_and_excitation() {
    let at = |nominal| PlannedRecord {
        nominal,
        levels: Some(vec![0.5, 0.6]),
        hold_s: Some(0.1),
        ..bare(Excitation::Staircase)
    };
    let records = [0.05, 0.4, 0.4, 0.4125, 1.0].map(at).to_vec();
    let experiment = quick(&Plan { records, ..plan_with(at(0.5)) }, &table_1(), None);
    let names: Vec<&str> = experiment.records.iter().map(|record| &*record.file).collect();
    assert_eq!(
        names,
        [
            "u005_staircase.csv",
            "u040_staircase.csv",
            "u040_staircase_2.csv",
            "u04125_staircase.csv",
            "u100_staircase.csv"
        ]
    );
}

/// `table_1` with one effect.
fn with_effect(kind: &str, parameters: &[(&str, f64)]) -> Model {
    let mut model = table_1();
    let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    model.effects = vec![Effect { kind: kind.to_owned(), parameters, std: Default::default() }];
    model
}

#[test]
fn effects_of_the_model_are_in_the_records_on_the_loggers_own_clock_too() {
    let step = PlannedRecord { amplitude: Some(0.1), hold_s: Some(2.0), ..bare(Excitation::Step) };
    let square =
        PlannedRecord { amplitude: Some(0.05), half_period_s: Some(0.5), periods: Some(3), ..bare(Excitation::Square) };
    for (kind, parameters) in [
        ("slew_limit", &[("rate_per_s", 0.4)][..]),
        ("inflow_lead", &[("lead_ratio", 1.8), ("time_constant_s", 0.008)]),
        ("gain_drift", &[("drift", -0.1), ("time_s", 2.0)]),
        ("clock_skew", &[("skew_ppm", 2000.0)]),
        ("clock_skew", &[("skew_ppm", -2000.0)]),
    ] {
        let model = with_effect(kind, parameters);
        for record in [&step, &square] {
            let plan = plan_with(record.clone());
            let (seen, plain) = (quick(&plan, &model, None), quick(&plan, &table_1(), None));
            let (seen, plain) = (&seen.records[0], &plain.records[0]);
            assert_eq!((&seen.time_s, &seen.command), (&plain.time_s, &plain.command));
            assert_ne!(seen.thrust_n, plain.thrust_n, "{kind}");

            // The same chain on commands at the rows: there are no others in these records.
            let timing = EscTiming { frame_hz: plan.esc_frame_hz, frame_phase: 0.0 };
            let mut actuator = Actuator::new(&model, Law::LinearAround(0.5), timing).unwrap();
            let start = match seen.period_s {
                Some(period_s) => Start::WholePeriods { period_s, periods: 1 },
                None => Start::Rest(0.5),
            };
            // A period goes on behind the record's end, where a slow clock looks.
            let mut drive = (seen.time_s.clone(), seen.command.clone());
            if let Some(period_s) = seen.period_s {
                drive.0.push(3.0 * period_s);
                drive.1.push(seen.command[0]);
            }
            let drive = CommandSignal { time_s: &drive.0, command: &drive.1 };
            let expected = simulate(&mut actuator, drive, start, &seen.time_s).unwrap().response;
            for (row, (a, b)) in seen.thrust_n.iter().flatten().zip(&expected).enumerate() {
                // What ran before the record was cut into longer pieces: off by up to 3e-7 of how the response bends.
                assert!((a - b).abs() < 1e-8, "{kind}, row {row}: {a} for {b}");
            }
        }
    }
}

#[test]
fn a_supply_whose_voltage_is_known_has_its_columns() {
    let step = PlannedRecord { amplitude: Some(0.1), hold_s: Some(1.0), ..bare(Excitation::Step) };
    let parameters = [("polarization_drop", 0.1), ("polarization_s", 0.5)];
    let known = [&parameters[..], &[("open_circuit_v", 16.0), ("hover_current_a", 8.0)]].concat();
    let record = quick(&plan_with(step.clone()), &with_effect("supply_sag", &known), None).records.remove(0);
    let (voltage_v, current_a) = (record.voltage_v.unwrap(), record.current_a.unwrap());
    assert_eq!((voltage_v.len(), current_a.len()), (2000, 2000));
    assert!((voltage_v[0] - 14.4).abs() < 1e-9 && voltage_v[1999] < voltage_v[1100] && current_a[1999] > 8.0);
    let record = quick(&plan_with(step), &with_effect("supply_sag", &parameters), None).records.remove(0);
    assert_eq!((record.voltage_v, record.current_a), (None, None));
}

#[test]
fn a_filter_in_front_meets_the_effects_tick_by_tick() {
    // The compensator asks for 628 times the step per second; the limit turns that into a ramp.
    let step = PlannedRecord { amplitude: Some(0.02), hold_s: Some(0.5), ..bare(Excitation::Step) };
    let mut plan = plan_with(step);
    plan.compensator = Some("compensator.toml".into());
    plan.esc_frame_hz = None;
    let record =
        quick(&plan, &with_effect("slew_limit", &[("rate_per_s", 0.3)]), Some(&paper_lead())).records.remove(0);
    let esc_command = record.esc_command.unwrap();
    let peak = esc_command.iter().fold(0.0_f64, |peak, u| peak.max(*u));
    assert!(peak > 0.56, "{peak}");
    // Up to the moment at which the ramp meets the falling command, the response is that of a ramp of 0.3 per second.
    let (tau, gain) = (1.0 / 9.2889, 10.1718);
    let thrust_n = record.thrust_n.unwrap();
    for row in 500..600 {
        let t = (row - 500) as f64 * 1e-3;
        let exact = thrust_n[0] + gain * 0.3 * (t - tau * (1.0 - (-t / tau).exp()));
        assert!((thrust_n[row] - exact).abs() < 1e-9, "row {row}: {} for {exact}", thrust_n[row]);
        if esc_command[row + 1] < 0.5 + 0.3 * (t + 2e-3) {
            assert!(row > 520, "{row}");
            return;
        }
    }
    panic!("the ramp never meets the command");
}

#[test]
fn a_triangle_rises_from_its_nominal_command_and_turns_at_its_amplitude() {
    let triangle = PlannedRecord {
        amplitude: Some(0.1),
        half_period_s: Some(2.0),
        periods: Some(2),
        ..bare(Excitation::Triangle)
    };
    let record = quick(&plan_with(triangle), &table_1(), None).records.remove(0);
    assert_eq!((record.file.as_str(), record.period_s, record.amplitude), ("u050_triangle.csv", Some(4.0), Some(0.1)));
    assert_eq!(record.command.len(), 8000);
    for (row, command) in record.command.iter().enumerate() {
        let quarters = (row % 4000) as f64 / 1000.0;
        let expected = match quarters {
            q if q <= 1.0 => q,
            q if q <= 3.0 => 2.0 - q,
            q => q - 4.0,
        };
        assert!((command - (0.5 + 0.1 * expected)).abs() < 1e-8, "row {row}: {command}");
    }
}
