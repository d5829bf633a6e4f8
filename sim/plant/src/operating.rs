//! The first-order model at any command between the points of a [`Model`].

use nalgebra::Complex;

use super::{Lag, Lagged, Model, PlantError, Point, StaticMap};

/// The linear model around one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatingPoint {
    /// The command, 0..1.
    pub nominal: f64,
    /// Gain, time constant and delay.
    pub lag: Lag,
    /// Steady response at the command, in response units.
    pub response: f64,
}

impl Lag {
    /// `gain e^(-j omega delay) / (1 + j omega time_constant)` (paper, eq. (1)): response units per unit of command.
    #[must_use]
    pub fn frequency_response(&self, omega_rad_s: f64) -> Complex<f64> {
        let x = omega_rad_s * self.time_constant_s;
        let lag = Complex::new(1.0, -x) * (self.gain / (1.0 + x * x));
        // Fits ask this of thousands of frequencies, mostly without a delay.
        if self.delay_s == 0.0 { lag } else { lag * Complex::cis(-omega_rad_s * self.delay_s) }
    }
}

/// A [`Model`] at any command, with the steady response that belongs to it.
///
/// - Gain, time constant and delay are linear between points ([`Model::at`]) and keep their end values beyond them.
/// - The steady response is that of `static_map` where the model has one: linear between its commands, and beyond them
///   with the slope of the last piece. Otherwise it is the integral of the interpolated gain, with 0 at the first
///   point: then differences of the response mean something, its absolute value does not.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatingCurve {
    points: Vec<Point>,
    statics: Static,
}

#[derive(Clone, Debug, PartialEq)]
enum Static {
    Map(StaticMap),
    /// The integral of the gain up to each point.
    Integral(Vec<f64>),
}

impl OperatingCurve {
    /// Checks the model and takes over its points.
    ///
    /// # Errors
    /// [`PlantError`] when [`Model::check`] refuses the model, or when it has effects: to leave one out in silence
    /// would be another actuator. [`OperatingCurve::without_effects`] does so openly.
    pub fn new(model: &Model) -> Result<Self, PlantError> {
        let curve = Self::without_effects(model)?;
        match model.effects.first() {
            Some(effect) => Err(PlantError::EffectLeftOut { kind: effect.kind.clone() }),
            None => Ok(curve),
        }
    }

    /// Checks the model and takes over its points, and not its effects.
    ///
    /// # Errors
    /// [`PlantError`] when [`Model::check`] refuses the model.
    pub fn without_effects(model: &Model) -> Result<Self, PlantError> {
        model.check().map_err(PlantError::Model)?;
        let statics = match &model.static_map {
            Some(map) => Static::Map(map.clone()),
            None => Static::Integral(integrated_gain(&model.points)),
        };
        Ok(Self { points: model.points.clone(), statics })
    }

    /// The model around `nominal`.
    ///
    /// # Errors
    /// [`PlantError`] as for [`OperatingCurve::new`], or when `nominal` is not between the model's points.
    pub fn around(model: &Model, nominal: f64) -> Result<OperatingPoint, PlantError> {
        Self::new(model)?.point(model, nominal)
    }

    /// [`OperatingCurve::around`] for a model whose effects are counted elsewhere.
    ///
    /// # Errors
    /// [`PlantError`] when the model is impossible, or `nominal` is not between its points.
    pub fn around_without_effects(model: &Model, nominal: f64) -> Result<OperatingPoint, PlantError> {
        Self::without_effects(model)?.point(model, nominal)
    }

    fn point(&self, model: &Model, nominal: f64) -> Result<OperatingPoint, PlantError> {
        Ok(OperatingPoint { nominal, lag: model.at(nominal)?, response: self.steady_response(nominal) })
    }

    /// Multiplies gains and steady responses, and time constants.
    pub(super) fn scale(&mut self, gain: f64, time_constant: f64) {
        for point in &mut self.points {
            point.gain *= gain;
            point.time_constant_s *= time_constant;
        }
        let responses = match &mut self.statics {
            Static::Map(map) => &mut map.response,
            Static::Integral(up_to) => up_to,
        };
        responses.iter_mut().for_each(|response| *response *= gain);
    }

    /// What the lag acts on where the level is followed.
    #[must_use]
    pub fn lagged(&self) -> Lagged {
        match &self.statics {
            Static::Map(map) => map.lagged,
            // Its zero is none of the response's.
            Static::Integral(_) => Lagged::Response,
        }
    }

    /// The commands from the first point to the last.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.points[0].nominal, self.points[self.points.len() - 1].nominal)
    }

    /// The model at `command`, with the end values of gain, time constant and delay where that is beyond the points.
    #[must_use]
    pub fn clamped_at(&self, command: f64) -> OperatingPoint {
        let (index, share) = self.locate(command);
        let (low, high) = (&self.points[index], &self.points[(index + 1).min(self.points.len() - 1)]);
        let between = |low: f64, high: f64| low + share * (high - low);
        let lag = Lag {
            gain: between(low.gain, high.gain),
            time_constant_s: between(low.time_constant_s, high.time_constant_s),
            delay_s: between(low.delay_s, high.delay_s),
        };
        OperatingPoint { nominal: command, lag, response: self.steady_response(command) }
    }

    /// The response after the command has been `command` for ever.
    #[must_use]
    pub fn steady_response(&self, command: f64) -> f64 {
        match &self.statics {
            Static::Map(StaticMap { command: commands, response, .. }) => {
                let low = commands.partition_point(|&c| c <= command).clamp(1, commands.len() - 1) - 1;
                let slope = (response[low + 1] - response[low]) / (commands[low + 1] - commands[low]);
                response[low] + slope * (command - commands[low])
            }
            Static::Integral(up_to) => {
                let (index, share) = self.locate(command);
                let low = &self.points[index];
                let gain_here = match self.points.get(index + 1) {
                    Some(high) => low.gain + share * (high.gain - low.gain),
                    None => low.gain,
                };
                // The trapezoid is exact inside a piece, where the gain is linear, and beyond the ends, where it is
                // constant.
                up_to[index] + 0.5 * (low.gain + gain_here) * (command - low.nominal)
            }
        }
    }

    /// The point at or below `command` (the first one if there is none), and how far it is from there to the next
    /// one, 0..1.
    fn locate(&self, command: f64) -> (usize, f64) {
        let index = self.points.partition_point(|p| p.nominal <= command).saturating_sub(1);
        match self.points.get(index + 1) {
            Some(high) => {
                let low = self.points[index].nominal;
                (index, ((command - low) / (high.nominal - low)).max(0.0))
            }
            None => (index, 0.0),
        }
    }
}

fn integrated_gain(points: &[Point]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut up_to = vec![sum];
    for pair in points.windows(2) {
        sum += 0.5 * (pair[0].gain + pair[1].gain) * (pair[1].nominal - pair[0].nominal);
        up_to.push(sum);
    }
    up_to
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effect;
    use crate::testing::{model, table_1};

    #[test]
    fn between_points_the_curve_is_the_model_and_beyond_them_it_keeps_their_numbers() {
        let two = model(&[(0.25, 8.0, 0.2, 0.001), (0.5, 16.0, 0.1, 0.003)]);
        let curve = OperatingCurve::new(&two).unwrap();
        for nominal in [0.25, 0.3, 0.375, 0.499, 0.5] {
            let (ours, models) = (curve.clamped_at(nominal).lag, two.at(nominal).unwrap());
            assert!((ours.gain - models.gain).abs() < 1e-14);
            assert!((ours.time_constant_s - models.time_constant_s).abs() < 1e-16);
            assert!((ours.delay_s - models.delay_s).abs() < 1e-17);
        }
        assert_eq!(curve.clamped_at(0.0).lag, two.points[0].lag());
        assert_eq!(curve.clamped_at(1.0).lag, two.points[1].lag());
    }

    #[test]
    fn without_a_map_the_steady_response_is_the_integral_of_the_gain_beyond_the_ends_too() {
        let curve = OperatingCurve::new(&table_1()).unwrap();
        assert_eq!(curve.steady_response(0.40), 0.0);
        // Midpoint rule over pieces that are linear or constant: exact but for rounding.
        let steps = 10_000;
        let mut sum = 0.0;
        for step in 0..steps {
            let u = 0.30 + 0.5 * (f64::from(step) + 0.5) / f64::from(steps);
            sum += curve.clamped_at(u).lag.gain * 0.5 / f64::from(steps);
        }
        assert!((curve.steady_response(0.80) - curve.steady_response(0.30) - sum).abs() < 1e-12);
    }

    #[test]
    fn a_static_map_is_linear_between_its_commands_and_beyond() {
        let mut with_map = table_1();
        with_map.static_map = Some(StaticMap {
            command: vec![0.0, 0.25, 0.5, 0.75],
            response: vec![0.0, 1.0, 4.0, 9.0],
            lagged: Lagged::Response,
            polynomial: None,
        });
        let curve = OperatingCurve::new(&with_map).unwrap();
        for (u, expected) in [(0.0, 0.0), (0.125, 0.5), (0.25, 1.0), (0.5, 4.0), (0.625, 6.5), (0.75, 9.0), (1.0, 14.0)]
        {
            assert_eq!(curve.steady_response(u), expected, "at {u}");
        }
        assert_eq!(OperatingCurve::around(&with_map, 0.5).unwrap().response, 4.0);
    }

    #[test]
    fn one_point_is_enough() {
        let one = model(&[(0.5, 10.0, 0.1, 0.0)]);
        let curve = OperatingCurve::new(&one).unwrap();
        assert_eq!(curve.clamped_at(0.7).lag.gain, 10.0);
        assert!((curve.steady_response(0.7) - 2.0).abs() < 1e-15);
        assert!((curve.steady_response(0.4) + 1.0).abs() < 1e-15);
        assert!(matches!(OperatingCurve::around(&one, 0.7), Err(PlantError::Range(_))));
    }

    #[test]
    fn a_model_that_cannot_be_simulated_is_refused() {
        assert!(matches!(OperatingCurve::new(&model(&[])), Err(PlantError::Model(_))));
        assert!(matches!(OperatingCurve::new(&model(&[(0.5, 1.0, 0.0, 0.0)])), Err(PlantError::Model(_))));
        let mut other = table_1();
        other.effects.push(Effect {
            kind: "backlash".into(),
            parameters: [("half_width".to_owned(), 0.01)].into(),
            std: Default::default(),
        });
        assert_eq!(OperatingCurve::new(&other), Err(PlantError::EffectLeftOut { kind: "backlash".into() }));
        assert_eq!(OperatingCurve::without_effects(&other), OperatingCurve::new(&table_1()));
    }

    #[test]
    fn the_frequency_response_is_down_by_half_the_power_at_the_corner() {
        let lag = Lag { gain: 10.0, time_constant_s: 0.1, delay_s: 0.01 };
        let at_corner = lag.frequency_response(10.0);
        assert!((at_corner.norm_sqr() - 50.0).abs() < 1e-12);
        assert!((at_corner.arg() + std::f64::consts::FRAC_PI_4 + 0.1).abs() < 1e-15);
    }
}
