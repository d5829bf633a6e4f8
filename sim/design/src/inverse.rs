//! The conditioned inverse of a model, and whether its time constants are known well enough for one.
//!
//! An inverse cancels the lag at each operating point, so it needs the time constant at each. Where its table is longer than the
//! rotor's time constant, the command asks for too much and the rotor overshoots, by about 0.9 % for each percent. How much that may
//! be is judged by what the records leave open: over the reference model, the response at an operating point is
//!
//! ```text
//! |G C| / (|G(0)| |M|) = |1 + j omega tau_table| / |1 + j omega tau|
//! ```
//!
//! which rises with the frequency, and is largest at `omega_f` for the shortest time constant that the records allow.

use rotorlead::design::{CurvePoint, DEFAULT_DAMPING, DEFAULT_LOOP_RATE_HZ, InverseError, ReferenceModel};
use rotorlead::inverse::TABLE_POINTS;
use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;
use rotorlead_plant::effect::{asymmetric_lag, parameter_error};
use rotorlead_plant::{Effect, InverseCompensator, InverseRange, Model, Point};

use super::CompensatorError;
use super::error::MOST_OVER_REFERENCE;

/// Part of the time constants that the robust setting puts in its table. Tuned on the simulated rotor of Table 1: with an `omega_f` of
/// 125 rad/s the bandwidth holds where time constants are 10 % off either way (`docs/inverse.md`).
const ROBUST_PART: f64 = 0.9;
/// How far beyond the measured commands the curve reaches the bound at which it goes on, and the inverse is used unless another range
/// is asked for. Chosen: one distance between the paper's operating points; farther, the continued curve is a guess.
pub const REACH: f64 = 0.05;

/// What an inverse is asked for beside the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseOptions {
    /// How sure of the time constants the design is; `None`: exact where the records allow it, else robust.
    pub setting: Option<Setting>,
    /// Natural frequency of the reference model, rad/s; `None`: that of the setting.
    pub omega_f_rad_s: Option<f64>,
    /// Damping ratio of the reference model.
    pub damping: f64,
    /// Rate at which the inverse runs, hertz.
    pub loop_rate_hz: f64,
    /// The lowest and the highest command that the ESC gets, 0..1.
    pub range: (f64, f64),
    /// What the ESC changes its output by at most, units of the command per second; `None` for no limit.
    pub slew_per_s: Option<f64>,
    /// The lowest and the highest command for which the inverse is in the path; `None`: the measured ones and 0.05 beyond them.
    pub compensated: Option<(f64, f64)>,
}

impl Default for InverseOptions {
    /// The bandwidth of the paper's fastest operating point at all of them, 5 kHz, the whole range of commands, no slew limit.
    fn default() -> Self {
        Self {
            setting: None,
            omega_f_rad_s: None,
            damping: DEFAULT_DAMPING,
            loop_rate_hz: DEFAULT_LOOP_RATE_HZ,
            range: (0.0, 1.0),
            slew_per_s: None,
            compensated: None,
        }
    }
}

/// How sure of the time constants a design is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// The table has the time constants of the model.
    Exact,
    /// The table has nine tenths of them, and a faster reference model makes up for what that loses: the bandwidth holds for rotors
    /// that are a tenth slower or faster.
    Robust,
}

impl Setting {
    /// Natural frequency of its reference model unless another is asked for, rad/s: the paper's, and the one that was tuned together with
    /// the nine tenths of the robust table.
    #[must_use]
    pub fn omega_f_rad_s(self) -> f64 {
        match self {
            Self::Exact => 94.2,
            Self::Robust => 125.0,
        }
    }

    fn part(self) -> f64 {
        match self {
            Self::Exact => 1.0,
            Self::Robust => ROBUST_PART,
        }
    }
}

/// A conditioned inverse for a model.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignedInverse {
    /// What the controller runs. Its points are beyond the measured commands too.
    pub compensator: InverseCompensator,
    /// How sure of the time constants it is.
    pub setting: Setting,
    /// The lowest and the highest command at which the time constant was measured.
    pub measured: (f64, f64),
    /// Where the response may exceed the reference model most, and by which factor: at most [`MOST_OVER_REFERENCE`].
    pub worst: (f64, f64),
}

/// A time constant with what the records say of it.
#[derive(Clone, Copy, Debug)]
struct KnownTimeConstant {
    command: f64,
    tau_s: f64,
    /// The shortest that the records allow, at 95 %.
    low_s: f64,
}

/// Designs the inverse of `model`, with the time constants of its curve, or else of its points, and with those of its effects that
/// change them: a wrong time constant, and of unequal ones up and down the shorter, so that neither direction overshoots.
///
/// Beyond the measured commands the curve goes on at the lower end of the interval of the last time constant, and upward it falls as
/// the rotor becomes faster: a table that is too short costs speed, and one that is too long makes the rotor overshoot.
///
/// # Errors
/// When the model has no operating point, a time constant is too badly known, or the controller refuses the curve.
pub fn design_inverse(model: &Model, options: &InverseOptions) -> Result<DesignedInverse, CompensatorError> {
    let known = known(model);
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return Err(InverseError::NoPoints.into()) };
    let settings = options.setting.map_or_else(|| vec![Setting::Exact, Setting::Robust], |setting| vec![setting]);
    let over = |setting: Setting| {
        let omega = options.omega_f_rad_s.unwrap_or(setting.omega_f_rad_s());
        let of = |known: &KnownTimeConstant| {
            (known.command, over_reference(omega, setting.part() * known.tau_s, known.low_s))
        };
        known.iter().map(of).fold((0.0, 0.0), |worst, here| if here.1 > worst.1 { here } else { worst })
    };
    let judged: Vec<(Setting, (f64, f64))> = settings.into_iter().map(|setting| (setting, over(setting))).collect();
    let Some(&(setting, worst)) = judged.iter().find(|(_, (_, factor))| *factor <= MOST_OVER_REFERENCE) else {
        let (_, (nominal, factor)) = judged[judged.len() - 1];
        let at = known.iter().find(|known| known.command == nominal).unwrap_or(&first);
        return Err(CompensatorError::NotKnownForInverse {
            nominal,
            time_constant_s: at.tau_s,
            low_s: at.low_s,
            factor,
        });
    };
    let reference = ReferenceModel {
        omega_f_rad_s: options.omega_f_rad_s.unwrap_or(setting.omega_f_rad_s()),
        damping: options.damping,
    };
    let measured = (first.command, last.command);
    let reached = (decimal((measured.0 - REACH).max(0.0)), decimal((measured.1 + REACH).min(1.0)));
    let range = InverseRange {
        min: options.range.0,
        max: options.range.1,
        slew_per_s: options.slew_per_s,
        compensated: options.compensated.unwrap_or(reached),
    };
    let compensator =
        InverseCompensator::new(reference, options.loop_rate_hz, curve(&known, (first, last), setting), &range)?;
    Ok(DesignedInverse { compensator, setting, measured, worst })
}

/// The response over that of the reference model, at its natural frequency.
fn over_reference(omega_f_rad_s: f64, table_s: f64, tau_s: f64) -> f64 {
    let lag = |tau_s: f64| (omega_f_rad_s * tau_s).hypot(1.0);
    lag(table_s) / lag(tau_s)
}

/// The time constants of a model with the lower ends of their intervals, in order of the command.
fn known(model: &Model) -> Vec<KnownTimeConstant> {
    let mut known: Vec<KnownTimeConstant> = match &model.time_constant_curve {
        Some(band) => {
            // The table has the faster direction.
            let is_effect = model.effects.iter().any(|effect| effect.kind == asymmetric_lag::ID);
            let ratio = band.down_over_up.filter(|_| !is_effect);
            let faster = ratio.map_or(1.0, |ratio| 0.5 * (1.0 + ratio.min(1.0 / ratio)));
            let rows = band.nominal.iter().zip(&band.time_constant_s).zip(&band.low_s);
            rows.map(|((&command, &tau_s), &low_s)| KnownTimeConstant {
                command,
                tau_s: faster * tau_s,
                low_s: faster * low_s,
            })
            .collect()
        }
        None => {
            let of = |point: &Point| {
                let tau_s = point.time_constant_s;
                // A ratio is what is known of a time constant, and keeps it above zero.
                let share = point.time_constant_s_std.map_or(0.0, |std| std / tau_s);
                KnownTimeConstant {
                    command: point.nominal,
                    tau_s,
                    low_s: tau_s * (-STANDARD_ERRORS_OF_95_PERCENT * share).exp(),
                }
            };
            model.points.iter().map(of).collect()
        }
    };
    for effect in &model.effects {
        let (factor, shortest) = time_constant_factor(effect);
        for known in &mut known {
            known.tau_s *= factor;
            known.low_s *= shortest;
        }
    }
    known
}

/// What an effect multiplies the time constant by, and its lower end: that of the faster direction where they are unequal.
fn time_constant_factor(effect: &Effect) -> (f64, f64) {
    let with_std = |name: &str| {
        let value = effect.parameters.get(name).copied()?;
        Some((value, STANDARD_ERRORS_OF_95_PERCENT * effect.std.get(name).copied().unwrap_or(0.0)))
    };
    match effect.kind.as_str() {
        parameter_error::ID => with_std("time_constant_error").map_or((1.0, 1.0), |(error, off)| {
            // A ratio, as the time constant itself.
            let factor = 1.0 + error;
            (factor, factor * (-off / factor).exp())
        }),
        asymmetric_lag::ID => with_std("ratio").map_or((1.0, 1.0), |(ratio, off)| {
            let faster = ratio.max(1.0 / ratio).sqrt();
            (1.0 / faster, (-0.5 * off / ratio).exp() / faster)
        }),
        _ => (1.0, 1.0),
    }
}

/// The curve of a setting, over all commands.
fn curve(
    known: &[KnownTimeConstant],
    (first, last): (KnownTimeConstant, KnownTimeConstant),
    setting: Setting,
) -> Vec<CurvePoint> {
    let part = setting.part();
    let point = |command: f64, tau_s: f64| CurvePoint { command, tau_s: part * tau_s };
    let inside = thinned(known);
    let below = (first.command > 0.0).then(|| point(decimal((first.command - REACH).max(0.0)), first.low_s));
    // The pole of a rotor goes about with its speed, and so with the command.
    let falling = |command: f64| point(command, last.low_s * last.command / command);
    let next = decimal((last.command + REACH).min(1.0));
    let above = [Some(next).filter(|next| *next > last.command), Some(1.0).filter(|_| next < 1.0)];
    let above = above.into_iter().flatten().map(falling);
    below.into_iter().chain(inside.iter().map(|known| point(known.command, known.tau_s))).chain(above).collect()
}

/// To a millionth, so that the sum of two decimals is one.
fn decimal(command: f64) -> f64 {
    (1e6 * command).round() / 1e6
}

/// As many points as the controller's table has beside those beyond the ends.
fn thinned(known: &[KnownTimeConstant]) -> Vec<KnownTimeConstant> {
    /// Derived: one point lies below the measured commands and at most two above.
    const MOST: usize = TABLE_POINTS - 3;
    if known.len() <= MOST {
        return known.to_vec();
    }
    (0..MOST).map(|k| known[k * (known.len() - 1) / (MOST - 1)]).collect()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::TimeConstantBand;
    use rotorlead_plant::testing::table_1;

    use super::*;

    /// The paper's motors, with a band of so many parts of each time constant below it.
    fn with_band(share: f64) -> Model {
        let points = table_1().points;
        let tau_s: Vec<f64> = points.iter().map(|point| point.time_constant_s).collect();
        let scaled = |factor: f64| tau_s.iter().map(|tau_s| factor * tau_s).collect();
        let band = TimeConstantBand {
            nominal: points.iter().map(|point| point.nominal).collect(),
            low_s: scaled(1.0 - share),
            high_s: scaled(1.0 + share),
            time_constant_s: tau_s.clone(),
            down_over_up: None,
        };
        Model { time_constant_curve: Some(band), ..table_1() }
    }

    #[test]
    fn what_is_not_known_well_enough_gets_the_robust_setting_or_none() {
        let of = |share: f64| design_inverse(&with_band(share), &InverseOptions::default());
        for (share, setting) in [(0.0, Setting::Exact), (0.1, Setting::Exact), (0.15, Setting::Robust)] {
            let found = of(share).unwrap();
            assert_eq!(found.setting, setting, "{share}");
            assert_eq!(found.compensator.design().reference().omega_f_rad_s, setting.omega_f_rad_s());
            assert_eq!(found.compensator.range().compensated, (0.35, 0.7));
            assert!(found.worst.1 <= MOST_OVER_REFERENCE && found.measured == (0.4, 0.65), "{found:?}");
        }
        // A tenth is 1.11, a fifth 1.25.
        let exact = InverseOptions { setting: Some(Setting::Exact), ..InverseOptions::default() };
        assert!((design_inverse(&with_band(0.1), &exact).unwrap().worst.1 - 1.11).abs() < 0.005);
        let refused = design_inverse(&with_band(0.2), &exact).unwrap_err();
        let CompensatorError::NotKnownForInverse { factor, nominal, .. } = refused else { panic!("{refused}") };
        assert!((factor - 1.25).abs() < 0.005 && nominal == 0.4, "{factor} {nominal}");
        assert!(matches!(of(0.3), Err(CompensatorError::NotKnownForInverse { .. })));
    }

    #[test]
    fn beyond_what_was_measured_the_curve_is_at_its_lower_bound_and_falls_upward() {
        let found = design_inverse(&with_band(0.1), &InverseOptions::default()).unwrap();
        let points = found.compensator.points();
        let tau = |command: f64| points.iter().find(|point| (point.command - command).abs() < 1e-9).unwrap().tau_s;
        let (first, last) = (table_1().points[0].time_constant_s, table_1().points[5].time_constant_s);
        assert_eq!((tau(0.4), tau(0.65)), (first, last));
        assert!((tau(0.35) / (0.9 * first) - 1.0).abs() < 1e-12);
        assert!((tau(1.0) / (0.9 * last * 0.65) - 1.0).abs() < 1e-12 && tau(0.7) < 0.9 * last);
        assert!((points[0].command - 0.35).abs() < 1e-12 && points.len() == 9, "{points:?}");
        let robust = InverseOptions { setting: Some(Setting::Robust), ..InverseOptions::default() };
        let robust = design_inverse(&with_band(0.1), &robust).unwrap();
        for (one, other) in robust.compensator.points().iter().zip(points) {
            assert!((one.tau_s / (0.9 * other.tau_s) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn points_count_with_their_standard_errors_where_there_is_no_curve() {
        let mut model = table_1();
        assert!(design_inverse(&model, &InverseOptions::default()).unwrap().worst.1 <= 1.0 + 1e-9);
        model.points[2].time_constant_s_std = Some(0.2 * model.points[2].time_constant_s);
        let refused = design_inverse(&model, &InverseOptions::default()).unwrap_err();
        let named = model.points[2].nominal;
        assert!(
            matches!(refused, CompensatorError::NotKnownForInverse { nominal, .. } if nominal == named),
            "{refused}"
        );
        // One point is a curve around it: as long below, shorter above.
        model.points.truncate(1);
        let one = design_inverse(&model, &InverseOptions::default()).unwrap();
        assert_eq!((one.measured, one.compensator.range().compensated), ((0.4, 0.4), (0.35, 0.45)));
        model.points.clear();
        let refused = design_inverse(&model, &InverseOptions::default()).unwrap_err();
        assert_eq!(refused, CompensatorError::InverseRefused(InverseError::NoPoints));
    }

    #[test]
    fn effects_on_the_time_constant_are_in_the_table() {
        let with = |kind: &str, name: &str, value: f64, std: f64| {
            let of = |value: f64| [(name.to_owned(), value)].into();
            let effect = Effect { kind: kind.to_owned(), parameters: of(value), std: of(std) };
            design_inverse(&Model { effects: vec![effect], ..table_1() }, &InverseOptions::default())
        };
        let first_s = |found: DesignedInverse| {
            let points = found.compensator.points().iter();
            points.filter(|point| point.command == 0.4).map(|point| point.tau_s).sum::<f64>()
                / table_1().points[0].time_constant_s
        };
        assert!((first_s(with("parameter_error", "time_constant_error", -0.2, 0.01).unwrap()) - 0.8).abs() < 1e-12);
        for ratio in [1.69, 1.0 / 1.69] {
            assert!((first_s(with("asymmetric_lag", "ratio", ratio, 0.0).unwrap()) - 1.0 / 1.3).abs() < 1e-12);
        }
        let unknown = with("parameter_error", "time_constant_error", -0.2, 0.15).unwrap_err();
        assert!(matches!(unknown, CompensatorError::NotKnownForInverse { .. }), "{unknown}");
    }

    #[test]
    fn of_unequal_directions_the_table_has_the_faster() {
        let first_s = |ratio: Option<f64>| {
            let mut model = with_band(0.05);
            model.time_constant_curve.as_mut().unwrap().down_over_up = ratio;
            let found = design_inverse(&model, &InverseOptions::default()).unwrap();
            found.compensator.points().iter().find(|point| point.command == 0.4).unwrap().tau_s
        };
        // Up 0.1 s and down 0.15 s are 0.12 s in the mean of the rates.
        for ratio in [1.5, 1.0 / 1.5] {
            assert!((first_s(Some(ratio)) / first_s(None) - 0.1 / 0.12).abs() < 1e-12);
        }
    }

    #[test]
    fn what_the_controller_refuses_is_refused() {
        let model = with_band(0.05);
        let with = |options: InverseOptions| design_inverse(&model, &options).unwrap_err();
        let slow = InverseOptions { slew_per_s: Some(0.01), ..InverseOptions::default() };
        let crossed = InverseOptions { range: (0.6, 0.2), ..InverseOptions::default() };
        let fast = InverseOptions { loop_rate_hz: 50_000.0, ..InverseOptions::default() };
        for options in [slow, crossed, fast] {
            assert!(matches!(with(options), CompensatorError::InverseRefused(_)), "{options:?}");
        }
    }

    #[test]
    fn a_long_curve_is_thinned_to_what_the_controller_holds() {
        let mut model = with_band(0.05);
        let band = model.time_constant_curve.as_mut().unwrap();
        band.nominal = (0..50).map(|k| 0.2 + 0.7 * f64::from(k) / 49.0).collect();
        band.time_constant_s = band.nominal.iter().map(|u| 0.02 / u).collect();
        band.low_s = band.time_constant_s.iter().map(|tau_s| 0.95 * tau_s).collect();
        band.high_s = band.time_constant_s.clone();
        let found = design_inverse(&model, &InverseOptions::default()).unwrap();
        let points = found.compensator.points();
        assert!(points.len() <= TABLE_POINTS && points.is_sorted_by(|a, b| a.command < b.command));
        assert!(found.measured.0 == 0.2 && (found.measured.1 - 0.9).abs() < 1e-12, "{:?}", found.measured);
    }
}
