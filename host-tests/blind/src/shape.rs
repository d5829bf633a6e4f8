//! Laws that are a little other than the catalog's: no actuator follows a catalog to the letter.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::kind::{Effect, Kind};

/// By how much laws differ: the part of them that is bent, or of their numbers.
const BENT: std::ops::Range<f64> = 0.1..0.3;

/// What the laws of the chain are bent by; nothing where all are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shape {
    /// The part by which a slew limit is lower downward.
    pub slower_down: f64,
    /// Command on either side of a clip over which it bends.
    pub knee: f64,
    /// The part of a second lag's time constant that a third lag has.
    pub third_lag: f64,
    /// The part by which the logarithm of the ratio of both directions grows with a way of the paper's swing.
    pub unevenness_of_way: f64,
    /// Whether a drift is a ramp.
    pub ramp: bool,
    /// Cubic over quadratic term of a thrust at the paper's amplitude.
    pub cubic: f64,
    /// Whether the supply's drop goes with the square of the command, and is relative to a voltage of one without a current.
    pub sags_by_command: bool,
    /// Whether the lag is linear in the speed, in place of a power of it.
    pub linear_lag: bool,
    /// The part by which the width of a dead band grows with a deviation of the paper's amplitude.
    pub width_of_command: f64,
    /// The part of the motion within a play that comes through.
    pub compliance: f64,
}

impl Shape {
    /// The kinds that have another law. A delay that is in part a lag is two effects of the catalog.
    pub const KINDS: [Kind; 10] = [
        Kind::SlewLimit,
        Kind::Saturation,
        Kind::SecondPole,
        Kind::AsymmetricLag,
        Kind::GainDrift,
        Kind::QuadraticThrust,
        Kind::SupplySag,
        Kind::OperatingPointLag,
        Kind::DeadBand,
        Kind::Backlash,
    ];

    /// Draws how the law of a kind is bent.
    #[must_use]
    pub fn draw(kind: Kind, rng: &mut ChaCha8Rng) -> Self {
        let (bent, none) = (rng.random_range(BENT), Self::default());
        match kind {
            Kind::SlewLimit => Self { slower_down: bent, ..none },
            // Of the paper's amplitude.
            Kind::Saturation => Self { knee: 0.05 * bent, ..none },
            Kind::SecondPole => Self { third_lag: bent, ..none },
            Kind::AsymmetricLag => Self { unevenness_of_way: bent, ..none },
            Kind::GainDrift => Self { ramp: true, ..none },
            Kind::QuadraticThrust => Self { cubic: bent, ..none },
            Kind::SupplySag => Self { sags_by_command: true, ..none },
            Kind::OperatingPointLag => Self { linear_lag: true, ..none },
            Kind::DeadBand => Self { width_of_command: bent, ..none },
            Kind::Backlash => Self { compliance: bent, ..none },
            _ => none,
        }
    }

    /// An effect of a kind that is large enough for its law to show in the paper's records: between a third and all of its range, and a
    /// limit that commands meet.
    #[must_use]
    pub fn draw_effect(kind: Kind, rng: &mut ChaCha8Rng) -> Effect {
        loop {
            let effect = kind.draw(rng);
            let value = effect.values[0];
            let shows = match kind {
                Kind::SlewLimit => value < 1.0,
                Kind::Saturation => value < 0.69,
                Kind::SecondPole => value > 3e-3,
                Kind::DeadBand => value > 0.004,
                Kind::Backlash => value > 0.006,
                _ => true,
            };
            if shows {
                return effect;
            }
        }
    }

    /// The factor of the width of a dead band at a deviation from the nominal command.
    #[must_use]
    pub fn width_at(&self, deviation: f64) -> f64 {
        1.0 + self.width_of_command * deviation / 0.05
    }

    /// A command behind a clip at `upper`.
    #[must_use]
    pub fn clipped(&self, command: f64, upper: f64) -> f64 {
        // A parabola that touches both straight lines.
        let over = command - upper;
        if self.knee > 0.0 && over.abs() < self.knee {
            return command - (over + self.knee).powi(2) / (4.0 * self.knee);
        }
        command.min(upper)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn every_kind_of_the_list_is_bent() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for kind in Shape::KINDS {
            assert_ne!(Shape::draw(kind, &mut rng), Shape::default(), "{kind:?}");
        }
        assert_eq!(Shape::draw(Kind::ClockSkew, &mut rng), Shape::default());
    }

    #[test]
    fn a_soft_knee_joins_both_lines_without_a_corner() {
        let shape = Shape { knee: 0.01, ..Shape::default() };
        for (command, clipped) in [(0.5, 0.5), (0.69, 0.69), (0.70, 0.6975), (0.71, 0.70), (0.8, 0.70)] {
            assert!((shape.clipped(command, 0.7) - clipped).abs() < 1e-12, "{command}");
        }
        assert_eq!(Shape::default().clipped(0.701, 0.7), 0.7);
    }
}
