//! The rotor with its propeller as a first-order lag.

use super::passage::{Passage, Readings, Rotates, Wanted};
use super::{Interval, Lagged, Model, OperatingCurve, OperatingPoint, PlantError, RotorBase, Segment};

/// The first-order plant `time_constant dy/dt = steady(u) - y` (paper, eq. (1)), propagated exactly.
///
/// While the command is constant the solution is `y(t + d) = steady + (y(t) - steady) e^(-d / time_constant)`, so a
/// step of any length is exact to rounding; nothing is integrated numerically.
///
/// There are two of them:
/// - [`FirstOrder::around`] is linear around one nominal command: constant gain and time constant. It is what the paper
///   identifies, and what small excitations (multisine, square wave, one step) are run on, so that an estimate
///   can be compared with the numbers of the model.
/// - [`FirstOrder::over_range`] follows the level: steady response and time constant are those of the command of the
///   moment, and where the static map says so it is the response's square root that lags. It is for records that move over a wide range (a staircase), where one linear model means nothing.
///
/// The dead time of the model is not in here but in the chain before it, as a
/// [`TransportDelay`](super::TransportDelay).
#[derive(Clone, Debug)]
pub struct FirstOrder {
    law: LagSchedule,
    lagged: Lagged,
    /// The command that `target` belongs to, and the rate where it follows the level.
    command: f64,
    /// What the lagged quantity goes to, and where it is.
    target: f64,
    rate_per_s: f64,
    quantity: f64,
    kept: Decay,
}

/// `e^-x - 1` for the last `x = duration / time constant`. Evenly spaced rows differ by rounding only, for which the slope
/// at the kept one is exact.
#[derive(Clone, Copy, Debug)]
struct Decay {
    exponent: f64,
    less_one: f64,
}

/// Exponents this near are the same but for rounding. Derived: what the slope leaves out is half its square, 5e-19.
const SAME_EXPONENT: f64 = 1e-9;
/// Up to this exponent six terms of the series are quicker, and exact. Derived: the next one is below `SHORT^6 / 5040`, 2e-16 of the sum.
const SHORT: f64 = 0.01;

impl Decay {
    #[inline]
    fn over(&mut self, exponent: f64) -> f64 {
        let off = exponent - self.exponent;
        if off.abs() <= SAME_EXPONENT * self.exponent {
            return self.less_one - off * (1.0 + self.less_one);
        }
        // expm1 keeps the digits that 1 - e^-x would lose for steps that are short beside the time constant.
        let less_one = if exponent < SHORT { short(exponent) } else { (-exponent).exp_m1() };
        *self = Self { exponent, less_one };
        less_one
    }
}

/// `e^-x - 1` for an `x` from 0 up to [`SHORT`].
#[inline]
fn short(x: f64) -> f64 {
    const RECIPROCALS: [f64; 5] = [1.0 / 6.0, 1.0 / 5.0, 1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0];
    -x * RECIPROCALS.iter().fold(1.0, |sum, of_n| 1.0 - x * of_n * sum)
}

#[derive(Clone, Debug)]
enum LagSchedule {
    Linear(OperatingPoint),
    Level(OperatingCurve),
}

impl FirstOrder {
    /// Linear around `nominal`, at rest there: `y = response + gain (u - nominal)` when steady.
    ///
    /// # Errors
    /// [`PlantError`] when the model is impossible or has no points around `nominal`.
    pub fn around(model: &Model, nominal: f64) -> Result<Self, PlantError> {
        Ok(Self::linear(OperatingCurve::around(model, nominal)?))
    }

    /// Linear with the numbers of `point`, at rest there. The point's time constant must be above 0.
    #[must_use]
    pub fn linear(point: OperatingPoint) -> Self {
        Self::at_rest(LagSchedule::Linear(point), point.nominal)
    }

    /// Following the level over the model's whole range (and beyond it as [`OperatingCurve`] says), at rest at
    /// `command`.
    ///
    /// # Errors
    /// [`PlantError`] when the model is impossible.
    pub fn over_range(model: &Model, command: f64) -> Result<Self, PlantError> {
        Ok(Self::at_rest(LagSchedule::Level(OperatingCurve::new(model)?), command))
    }

    /// The plant of `base`, at rest at `command`.
    pub(super) fn from_base(base: RotorBase, command: f64) -> Self {
        match base {
            RotorBase::Linear(point) => Self::at_rest(LagSchedule::Linear(point), command),
            // The plant that follows its own speed has no closed form, and is integrated.
            RotorBase::Level(curve) | RotorBase::Speed(curve) => Self::at_rest(LagSchedule::Level(curve), command),
        }
    }

    fn at_rest(law: LagSchedule, command: f64) -> Self {
        let kept = Decay { exponent: 0.0, less_one: 0.0 };
        let (rate_per_s, lagged) = match &law {
            LagSchedule::Linear(point) => (1.0 / point.lag.time_constant_s, Lagged::Response),
            LagSchedule::Level(curve) => (0.0, curve.lagged()),
        };
        // No command is the one of the moment yet.
        let mut plant = Self { law, lagged, command: f64::NAN, target: 0.0, rate_per_s, quantity: 0.0, kept };
        plant.settle(command);
        plant
    }

    /// Puts the plant at rest: the command has been `command` for ever.
    pub fn settle(&mut self, command: f64) {
        self.set_command(command);
        self.quantity = self.target;
    }

    /// Lets `duration_s` (not negative) pass with a constant `command`.
    #[inline]
    pub fn advance(&mut self, command: f64, duration_s: f64) {
        self.set_command(command);
        self.quantity = self.after(duration_s);
    }

    /// The lagged quantity that the command of the moment leads to in `duration_s`.
    #[inline]
    fn after(&mut self, duration_s: f64) -> f64 {
        self.quantity - (self.target - self.quantity) * self.kept.over(duration_s * self.rate_per_s)
    }

    /// The same with a command that moves by `slope_per_s` from now on. Exact on the linear plant:
    /// `y(d) = steady(d) - m tau + (y(0) - steady(0) + m tau) e^(-d / tau)` with `m` the slope of the steady response.
    /// The plant that follows the level has no such solution; it takes the level at the middle of the duration.
    #[inline]
    fn after_ramp(&mut self, slope_per_s: f64, duration_s: f64) -> f64 {
        match &self.law {
            LagSchedule::Linear(point) => {
                let ramp = point.lag.gain * slope_per_s;
                let begin = self.target - ramp * point.lag.time_constant_s;
                let lagged = self.quantity - (begin - self.quantity) * self.kept.over(duration_s * self.rate_per_s);
                lagged + ramp * duration_s
            }
            LagSchedule::Level(_) => {
                let command = self.command;
                self.set_command(command + 0.5 * slope_per_s * duration_s);
                let quantity = self.after(duration_s);
                self.set_command(command);
                quantity
            }
        }
    }

    /// How fast the response moves, per second.
    fn slope_per_s(&self) -> f64 {
        self.lagged.slope(self.quantity) * (self.target - self.quantity) * self.rate_per_s
    }

    /// Lets many pieces pass.
    pub(super) fn pass(&mut self, passage: &mut Passage) {
        match &mut passage.wanted {
            Wanted::Intervals(intervals) => intervals.take(self, passage.from_s, passage.pieces),
            Wanted::Readings(readings) => self.read(passage.from_s, passage.pieces, readings),
        }
    }

    fn read(&mut self, from_s: f64, pieces: &[Segment], readings: &mut Readings) {
        let mut now_s = from_s;
        for piece in pieces {
            self.set_command(piece.level);
            // From one moment to the next, which are as far apart as the ones before.
            while let Some(moment_s) = readings.before(piece.until_s) {
                self.propagate(piece.slope_per_s, moment_s - now_s);
                now_s = moment_s;
                readings.take(self.response());
            }
            self.propagate(piece.slope_per_s, piece.until_s - now_s);
            now_s = piece.until_s;
            readings.take_end(piece.until_s, self.response());
        }
    }

    /// Lets `duration_s` pass with the command of the moment, which moves by `slope_per_s`.
    #[inline]
    fn propagate(&mut self, slope_per_s: f64, duration_s: f64) {
        if slope_per_s == 0.0 {
            self.quantity = self.after(duration_s);
        } else {
            self.quantity = self.after_ramp(slope_per_s, duration_s);
            self.set_command(self.command + slope_per_s * duration_s);
        }
    }

    /// Seconds, where it is the same at every level.
    pub(super) fn time_constant_s(&self) -> Option<f64> {
        match &self.law {
            LagSchedule::Linear(point) => Some(point.lag.time_constant_s),
            LagSchedule::Level(_) => None,
        }
    }

    /// The command that would keep the response of the moment. On the plant that follows the level the static map has to rise
    /// for that; where the gain is 0, it is the command of the moment.
    pub(super) fn equivalent_command(&self) -> f64 {
        match &self.law {
            LagSchedule::Linear(point) if point.lag.gain == 0.0 => self.command,
            LagSchedule::Linear(point) => point.nominal + (self.response() - point.response) / point.lag.gain,
            LagSchedule::Level(curve) => {
                let (response, mut low, mut high) = (self.response(), -1.0, 2.0);
                // Derived: 50 halvings of commands from -1 to 2 leave `3 / 2^50`, 3e-15.
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    let below = curve.steady_response(middle) < response;
                    if below { low = middle } else { high = middle }
                }
                0.5 * (low + high)
            }
        }
    }

    /// The response of the moment: newtons or revolutions per minute, as the model has it.
    #[inline]
    #[must_use]
    pub fn response(&self) -> f64 {
        self.lagged.response(self.quantity)
    }

    #[inline]
    fn set_command(&mut self, command: f64) {
        if command == self.command {
            return;
        }
        self.command = command;
        match &self.law {
            LagSchedule::Linear(point) => {
                self.target = point.response + point.lag.gain * (command - point.nominal);
            }
            LagSchedule::Level(curve) => {
                let point = curve.clamped_at(command);
                self.target = self.lagged.at_response(point.response);
                self.rate_per_s = 1.0 / point.lag.time_constant_s;
            }
        }
    }
}

impl Rotates for FirstOrder {
    type Begin = ();

    #[inline]
    fn begin(&mut self, piece: Segment) {
        self.set_command(piece.level);
    }

    #[inline]
    fn steps(&self, _: &(), _: Segment, _: f64) -> usize {
        1
    }

    #[inline]
    fn advance(&mut self, _: &(), piece: Segment, (from_s, duration_s): (f64, f64)) -> Interval {
        let (start, start_slope) = (self.response(), self.slope_per_s());
        self.propagate(piece.slope_per_s, duration_s);
        Interval { from_s, duration_s, start, start_slope, end: self.response(), end_slope: self.slope_per_s() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StaticMap;
    use crate::testing::{model, table_1};

    #[test]
    fn a_step_follows_the_analytic_response_to_1e_12() {
        for point in table_1().points {
            let mut plant = FirstOrder::around(&table_1(), point.nominal).unwrap();
            let start = plant.response();
            let mut worst: f64 = 0.0;
            for tick in 1..=10_000_u32 {
                plant.advance(point.nominal + 0.05, 1.0 / 5000.0);
                let time_s = f64::from(tick) / 5000.0;
                let expected = start + point.gain * 0.05 * (1.0 - (-time_s / point.time_constant_s).exp());
                worst = worst.max((plant.response() - expected).abs());
            }
            assert!(worst < 1e-12, "off by {worst:e} N at {}", point.nominal);
        }
    }

    #[test]
    fn short_steps_are_those_of_the_exponential() {
        for x in (0..=100).map(|k| f64::from(k) * 1e-4) {
            let exact = (-x).exp_m1();
            assert!((short(x) - exact).abs() <= 4e-16 * exact.abs(), "{x}: {:e}", short(x) - exact);
        }
    }

    #[test]
    fn one_long_step_equals_many_short_ones() {
        let mut long = FirstOrder::around(&table_1(), 0.5).unwrap();
        let mut short = long.clone();
        long.advance(0.55, 0.1);
        for _ in 0..1000 {
            short.advance(0.55, 1e-4);
        }
        assert!((long.response() - short.response()).abs() < 1e-13);
    }

    #[test]
    fn a_ramp_follows_the_analytic_response_to_1e_12() {
        for duration_s in [1e-4, 1e-3, 0.05, 2.0] {
            let mut plant = FirstOrder::around(&table_1(), 0.5).unwrap();
            let (start, tau_s, slope) = (plant.response(), 1.0 / 9.2889, 10.1718 * 0.25);
            let ramp = Segment { level: 0.5, slope_per_s: 0.25, until_s: duration_s };
            plant.begin(ramp);
            Rotates::advance(&mut plant, &(), ramp, (0.0, duration_s));
            let expected = start + slope * (duration_s - tau_s * (1.0 - (-duration_s / tau_s).exp()));
            assert!((plant.response() - expected).abs() < 1e-12);
            // At its end the response moves as the command that it lags behind.
            let moves = slope * (1.0 - (-duration_s / tau_s).exp());
            assert!((plant.slope_per_s() - moves).abs() < 1e-11);
        }
    }

    #[test]
    fn over_the_range_gain_and_time_constant_are_those_of_the_level() {
        let two = model(&[(0.25, 8.0, 0.2, 0.0), (0.75, 24.0, 0.05, 0.0)]);
        let mut plant = FirstOrder::over_range(&two, 0.25).unwrap();
        assert_eq!(plant.response(), 0.0);
        plant.advance(0.75, 0.05);
        let up = 8.0 * (1.0 - (-1.0_f64).exp());
        assert!((plant.response() - up).abs() < 1e-12);
        plant.advance(0.5, 0.125);
        // Half way: the gain's integral is 0.25 (8 + 16) / 2 = 3, and the time constant 0.125 s.
        assert!((plant.response() - (3.0 + (up - 3.0) * (-1.0_f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn a_lag_of_the_square_root_is_squared() {
        let mut thrust = model(&[(0.25, 8.0, 0.2, 0.0), (0.75, 24.0, 0.2, 0.0)]);
        let map = StaticMap {
            command: vec![0.25, 0.5, 0.75],
            response: vec![1.0, 4.0, 9.0],
            lagged: Lagged::SquareRoot,
            polynomial: None,
        };
        thrust.static_map = Some(map);
        let mut plant = FirstOrder::over_range(&thrust, 0.75).unwrap();
        assert_eq!(plant.response(), 9.0);
        plant.advance(0.25, 0.1);
        let speed = 1.0 + 2.0 * (-0.5_f64).exp();
        assert!((plant.response() - speed * speed).abs() < 1e-12);
        assert!((plant.slope_per_s() + 2.0 * speed * (speed - 1.0) / 0.2).abs() < 1e-12);
    }

    #[test]
    fn the_speed_is_the_command_that_would_keep_the_response() {
        let two = model(&[(0.25, 8.0, 0.2, 0.0), (0.75, 24.0, 0.05, 0.0)]);
        let mut level = FirstOrder::over_range(&two, 0.3).unwrap();
        let mut linear = FirstOrder::around(&two, 0.3).unwrap();
        assert!((level.equivalent_command() - 0.3).abs() < 1e-12 && (linear.equivalent_command() - 0.3).abs() < 1e-12);
        level.advance(0.7, 0.02);
        linear.advance(0.7, 0.02);
        let curve = OperatingCurve::new(&two).unwrap();
        assert!((curve.steady_response(level.equivalent_command()) - level.response()).abs() < 1e-12);
        let tau = two.at(0.3).unwrap().time_constant_s;
        assert!((linear.equivalent_command() - 0.7 + 0.4 * (-0.02 / tau).exp()).abs() < 1e-12);
    }

    #[test]
    fn around_a_point_it_is_linear_however_far_the_command_goes() {
        let two = model(&[(0.25, 8.0, 0.2, 0.0), (0.75, 24.0, 0.05, 0.0)]);
        let mut plant = FirstOrder::around(&two, 0.25).unwrap();
        plant.advance(0.75, 100.0);
        assert!((plant.response() - 4.0).abs() < 1e-12);
    }
}
