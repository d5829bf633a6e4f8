//! Models for tests.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::effect::{Kind, Part};
use super::{
    ActiveEffect, Actuator, CommandSignal, EscTiming, Lag, Model, OperatingPoint, Point, RotorBase, Segment, Start,
    simulate,
};

/// A model with the given (nominal, gain, time constant, delay).
pub fn model(points: &[(f64, f64, f64, f64)]) -> Model {
    Model {
        format: 1,
        points: points
            .iter()
            .map(|&(nominal, gain, time_constant_s, delay_s)| {
                Point::new(nominal, Lag { gain, time_constant_s, delay_s })
            })
            .collect(),
        static_map: None,
        time_constant_curve: None,
        effects: Vec::new(),
        provenance: None,
    }
}

/// Table 1 of the paper, with the time constants as 1 / omega_s.
pub fn table_1() -> Model {
    model(&[
        (0.40, 9.9955, 1.0 / 6.2758, 0.0),
        (0.45, 10.4556, 1.0 / 7.3524, 0.0),
        (0.50, 10.1718, 1.0 / 9.2889, 0.0),
        (0.55, 10.9196, 1.0 / 9.9130, 0.0),
        (0.60, 13.4519, 1.0 / 11.7439, 0.0),
        (0.65, 16.1063, 1.0 / 14.1275, 0.0),
    ])
}

/// Gain 10, time constant 0.1 s, no dead time, around 0.5, where the response is 0.
pub fn point() -> OperatingPoint {
    OperatingPoint { nominal: 0.5, lag: Lag { gain: 10.0, time_constant_s: 0.1, delay_s: 0.0 }, response: 0.0 }
}

/// An effect with these values, optional ones at their defaults where they are not given.
pub fn active(kind: &'static Kind, values: &[f64]) -> ActiveEffect {
    let mut all = kind.null();
    all[..values.len()].copy_from_slice(values);
    ActiveEffect::new(kind, all).unwrap()
}

/// [`point`] with effects.
pub fn actuator(effects: &[ActiveEffect]) -> Actuator {
    Actuator::with_effects(point(), effects, EscTiming::default()).unwrap()
}

/// The response of [`point`] with effects to a step of `height` from 0.5, at rows of 1 ms from the step on.
pub fn step(height: f64, duration_s: f64, effects: &[ActiveEffect]) -> Vec<f64> {
    let rows: Vec<f64> = (0..(duration_s * 1e3).round() as u32).map(|row| f64::from(row) * 1e-3).collect();
    let drive = CommandSignal { time_s: &[0.0], command: &[0.5 + height] };
    simulate(&mut actuator(effects), drive, Start::Rest(0.5), &rows).unwrap().response
}

/// What the effects between command and rotor make of `command`, one value per millisecond: the level at each.
pub fn after_command_stages(effects: &[ActiveEffect], command: &[f64]) -> Vec<f64> {
    let base = RotorBase::Linear(point());
    let mut stages: Vec<_> = effects
        .iter()
        .map(|effect| match effect.part(&base) {
            Part::Command(stage) => stage,
            _ => panic!("{:?} is not between command and rotor", effect.kind()),
        })
        .collect();
    stages.iter_mut().fold(command[0], |level, stage| stage.settle(level));
    let mut levels = Vec::with_capacity(command.len());
    for (row, &u) in command.iter().enumerate() {
        let (mut from_s, end_s) = (row as f64 * 1e-3, (row + 1) as f64 * 1e-3);
        let begin_s = from_s;
        while from_s < end_s {
            let mut piece = Segment::constant(u, end_s);
            for stage in &mut stages {
                piece = stage.advance(from_s, piece);
                assert!(piece.until_s > from_s && piece.until_s <= end_s);
            }
            if from_s == begin_s {
                levels.push(piece.level);
            }
            from_s = piece.until_s;
        }
    }
    levels
}

/// Period of the sine of [`fundamental`], seconds: slow enough that rows of 1 ms are no part of the answer.
pub const SINE_S: usize = 20;

/// Fundamental of the output over that of the input for a sine of that amplitude around 0.5, in the last of 30 periods,
/// through the effects between command and rotor.
pub fn fundamental(effects: &[ActiveEffect], amplitude: f64) -> Complex64 {
    let period = SINE_S * 1000;
    let turn = |row: usize| TAU * (row % period) as f64 / period as f64;
    let command: Vec<f64> = (0..30 * period).map(|row| 0.5 + amplitude * turn(row).sin()).collect();
    let line = |x: &[f64]| {
        x.iter().enumerate().skip(29 * period).map(|(row, x)| (x - 0.5) * Complex64::cis(-turn(row))).sum::<Complex64>()
    };
    line(&after_command_stages(effects, &command)) / line(&command)
}

/// Response at `omega_rad_s` over that of the lag, from a simulation with ticks of 50 us: a sine of small amplitude over
/// 20 s after 5 s, by least squares; the hold of a tick is divided out.
pub fn seen_response(effects: &[ActiveEffect], omega_rad_s: f64) -> Complex64 {
    let tick_s = 5e-5;
    let ticks: Vec<f64> = (0..500_000_u32).map(|tick| f64::from(tick) * tick_s).collect();
    let command: Vec<f64> = ticks.iter().map(|t| 0.5 + 1e-3 * (omega_rad_s * t).sin()).collect();
    let rows: Vec<f64> = (0..20_000_u32).map(|row| 5.0 + f64::from(row) * 1e-3).collect();
    let drive = CommandSignal { time_s: &ticks, command: &command };
    let seen = simulate(&mut actuator(effects), drive, Start::Rest(0.5), &rows).unwrap().response;
    // Least squares of a sin + b cos + c.
    let design = nalgebra::DMatrix::from_fn(rows.len(), 3, |row, column| {
        let (sin, cos) = (omega_rad_s * rows[row]).sin_cos();
        [sin, cos, 1.0][column]
    });
    let normal = design.transpose() * &design;
    let fit = normal.lu().solve(&(design.transpose() * nalgebra::DVector::from_vec(seen))).unwrap();
    let hold = super::hold::zero_order_hold(tick_s, omega_rad_s);
    Complex64::new(fit[0], fit[1]) / 1e-3 / hold / point().lag.frequency_response(omega_rad_s)
}
