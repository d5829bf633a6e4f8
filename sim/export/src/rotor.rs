//! Rotor constants: the highest speed, and thrust over the square of the speed.

use std::f64::consts::TAU;

use rotorlead_numerics::statistics::t_quantile;
use rotorlead_plant::effect::slew_limit;
use rotorlead_plant::{Model, StaticMap};

use super::lag::ConfidenceInterval;
use super::levels::Level;
use super::maps::{Maps, between, scatter, with_standstill};
use rotorlead_identify::estimate::Estimate;

/// Rotor speed of one revolution per minute, rad/s.
pub(super) const RPM: f64 = TAU / 60.0;
/// Levels that tell thrust over speed squared, and an error. Chosen: they leave 2 degrees of freedom, and a 95 % interval of 4.3 standard
/// errors (Student's t); with two levels it would be 12.7.
const LEAST_LEVELS: usize = 3;
/// Commands closer than this are the same level in two responses of one record.
const SAME_LEVEL: f64 = rotorlead_identify::lag::steps::SAME_LEVEL;

/// Thrust over the square of the rotor speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorConstant {
    pub(super) n_per_rad2_s2: ConfidenceInterval,
    pub(super) measured: (f64, f64),
    /// % of the highest thrust.
    pub(super) worst_error_percent: f64,
}

/// The rotor speed at the highest motor output, rad/s, and the command of its level.
pub(super) fn top_speed_rad_s(maps: &Maps, (_, top): (f64, f64)) -> Result<(ConfidenceInterval, f64), String> {
    let map = maps.rpm.as_ref().ok_or(
        "no rotor speed is known at full command: identify records of `rpm` that hold levels, or give records that have it with the thrust with `--records`",
    )?;
    let (rpm, command) = highest(map, top, "rpm")?;
    Ok((rpm.times(RPM), command))
}

/// The thrust at the highest motor output, N, and the command of its level.
pub(super) fn top_thrust_n(maps: &Maps, (_, top): (f64, f64)) -> Result<(ConfidenceInterval, f64), String> {
    let map = maps.thrust_n.as_ref().ok_or(
        "no thrust is known at full command: identify records of `thrust_n` that hold levels, or give records that have it with the speed with `--records`",
    )?;
    highest(map, top, "N")
}

/// The response at the highest motor output, and the command of its level. Its interval is of the scatter of the levels around their
/// polynomial, and of the interpolation where it is between two levels.
fn highest(map: &StaticMap, top: f64, unit: &str) -> Result<(ConfidenceInterval, f64), String> {
    let levels: Vec<(f64, f64)> = with_standstill(map).collect();
    let Level { command, response, error, .. } = Level::at_top(&levels, top)?;
    if response <= 0.0 {
        return Err(format!("the response at a command of {command} is {response} {unit}: check its column"));
    }
    let reach = scatter(map).map(|(std, dof)| t_quantile(0.975, dof) * std.hypot(error));
    let end = |sign: f64| reach.map(|reach| response + sign * reach);
    Ok((ConfidenceInterval { value: response, low: end(-1.0), high: end(1.0) }, command))
}

/// The highest rate of the rotor speed around a command, rad/s^2: that of a model's slew limit, of its slower direction, times the slope of the speed's map.
pub(super) fn speed_rate_rad_s2(model: &Model, maps: &Maps, at: f64) -> Result<ConfidenceInterval, String> {
    let limit = model.effects.iter().find(|effect| effect.kind == slew_limit::ID).ok_or(
        "the model has no slew limit: `rotorlead diagnose` looks for one; the simulator's 100000, which it has unless it is set, limits nothing",
    )?;
    let map = maps.rpm.as_ref().ok_or(
        "the model's slew limit is of the command, and no rotor speed is known at steady levels: give records that have rpm with `--records`",
    )?;
    let levels: Vec<(f64, f64)> = between(map, (0.0, 1.0)).collect();
    let around = levels.iter().zip(levels.iter().skip(1)).find(|(low, high)| (low.0..=high.0).contains(&at));
    let (low, high) = around.ok_or_else(|| format!("no levels of the rotor speed are around a command of {at}"))?;
    let rpm_per_command = (high.1 - low.1) / (high.0 - low.0);
    let value = |name: &str| limit.parameters.get(name).copied();
    let up_per_s = value("rate_per_s").unwrap_or(f64::INFINITY);
    let rate_per_s = slew_limit::slower_per_s(up_per_s, value("down_ratio").unwrap_or(1.0));
    if !(rate_per_s.is_finite() && rpm_per_command > 0.0) {
        return Err(format!("the speed does not rise around a command of {at}, or the model's slew limit has no rate"));
    }
    // A model does not say how the errors of both directions go together.
    let std = limit.std.get("rate_per_s").filter(|_| rate_per_s == up_per_s);
    let band = std.map_or(ConfidenceInterval { value: rate_per_s, low: None, high: None }, |std| {
        ConfidenceInterval::from_estimate(Estimate::normal(rate_per_s, *std))
    });
    Ok(band.times(rpm_per_command * RPM))
}

/// Least squares through zero over the levels that have both responses.
pub(super) fn motor_constant(maps: &Maps) -> Result<MotorConstant, String> {
    let (thrust, rpm) = maps.thrust_n_and_rpm.as_ref().ok_or(
        "thrust and rotor speed are not known on the same levels: give an experiment whose records have thrust_n and rpm with \
         `--records`",
    )?;
    let both: Vec<(f64, f64, f64)> = between(thrust, (0.0, 1.0))
        .filter_map(|(command, thrust)| {
            let same = |(other, _): &(f64, f64)| (other - command).abs() <= SAME_LEVEL;
            let (_, rpm) = between(rpm, (0.0, 1.0)).find(same)?;
            Some((command, thrust, (rpm * RPM).powi(2)))
        })
        .collect();
    if both.len() < LEAST_LEVELS {
        return Err(format!(
            "{} levels have thrust and rotor speed, and {LEAST_LEVELS} are needed: record a staircase with both",
            both.len()
        ));
    }
    let square: f64 = both.iter().map(|(_, _, speed)| speed * speed).sum();
    let value = both.iter().map(|(_, thrust, speed)| thrust * speed).sum::<f64>() / square;
    if value <= 0.0 {
        return Err(String::from("the thrust falls with the rotor speed: check the sign of the load cell"));
    }
    let misses = || both.iter().map(|(_, thrust, speed)| (thrust - value * speed).abs());
    let dof = (both.len() - 1) as f64;
    let std = (misses().map(|miss| miss * miss).sum::<f64>() / dof / square).sqrt();
    let full = both.iter().map(|(_, thrust, _)| *thrust).fold(f64::MIN_POSITIVE, f64::max);
    Ok(MotorConstant {
        n_per_rad2_s2: ConfidenceInterval::from_estimate(Estimate { value, std, dof }),
        measured: (both[0].0, both[both.len() - 1].0),
        worst_error_percent: 100.0 * misses().fold(0.0, f64::max) / full,
    })
}
