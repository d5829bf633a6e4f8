//! The motor under everything: a gain and a lag at each nominal command.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, LogNormal};

/// The paper's Table 1: nominal command, gain in newtons per unit of command, pole in rad/s.
const TABLE_1: [(f64, f64, f64); 6] = [
    (0.40, 9.9955, 6.2758),
    (0.45, 10.4556, 7.3524),
    (0.50, 10.1718, 9.2889),
    (0.55, 10.9196, 9.9130),
    (0.60, 13.4519, 11.7439),
    (0.65, 16.1063, 14.1275),
];

/// One operating point: thrust `rest_n` at rest, and small deviations by `gain_n / (time_constant_s s + 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Command, 0..1.
    pub nominal: f64,
    /// Newtons per unit of command.
    pub gain_n: f64,
    /// Seconds.
    pub time_constant_s: f64,
    /// Newtons at rest at `nominal`.
    pub rest_n: f64,
}

impl Point {
    /// The rotor's speed at a thrust, as the command that would keep it.
    #[must_use]
    pub fn speed(&self, thrust_n: f64) -> f64 {
        self.nominal + (thrust_n - self.rest_n) / self.gain_n
    }
}

/// The points of one motor, in increasing order.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Six of them, 0.40 to 0.65.
    pub points: Vec<Point>,
}

impl Motor {
    /// A motor after the paper's Table 1: the whole motor up to 20 % stronger and slower or weaker and faster, and each
    /// point 4 % off by itself. The thrust at rest is what a square law of the command gives at 0.40 with that gain,
    /// `gain * 0.40 / 2`, and the integral of the gain from there.
    ///
    /// # Panics
    /// Never: the spreads are fixed.
    #[must_use]
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        let (strength, slowness): (f64, f64) = (rng.random_range(0.8..1.2), rng.random_range(0.8..1.2));
        let jitter = LogNormal::new(0.0, 0.04).expect("a positive spread");
        let mut points: Vec<Point> = Vec::new();
        for (nominal, gain, pole) in TABLE_1 {
            let gain_n = gain * strength * jitter.sample(rng);
            let rest_n = points.last().map_or(gain_n * nominal / 2.0, |last| {
                last.rest_n + (last.gain_n + gain_n) / 2.0 * (nominal - last.nominal)
            });
            points.push(Point { nominal, gain_n, time_constant_s: slowness / pole * jitter.sample(rng), rest_n });
        }
        Self { points }
    }
}
