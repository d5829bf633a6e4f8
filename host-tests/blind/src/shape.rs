//! Laws that are a little other than the catalog's: no actuator follows a catalog to the letter.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::kind::{Effect, Kind};
use super::scatter::scattered;

/// By how much laws differ: the part of them that is bent, or of their numbers.
const BENT: std::ops::Range<f64> = 0.1..0.3;
/// Plays in parallel.
const PLAYS: usize = 5;

/// A law in the place of the catalog's. A delay that is in part a lag is none of these: it is two effects of the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// A slew limit that is lower downward.
    SlowerDown,
    /// A clip without a corner.
    SoftClip,
    /// A part of a second lag is a third one.
    ThirdLag,
    /// Lags up and down that differ the more, the longer the way.
    UnevennessOfWay,
    /// A drift along a straight line.
    RampDrift,
    /// A thrust with a cubic term.
    CubicThrust,
    /// A supply that follows the square of the command, not the cube of the speed.
    SagByCommand,
    /// A lag that is linear in the speed.
    LinearLag,
    /// A dead band that is wider at higher commands.
    GrowingBand,
    /// Play whose ends give way.
    Compliance,
    /// A dead band after which a change that hardly passes it is not followed all the way.
    BandKnee,
    /// Plays of several widths in parallel.
    SeveralPlays,
    /// A delay that is not the same for every command.
    DelayJitter,
    /// A quantizer with uneven steps.
    UnevenSteps,
    /// A stand with a second mode.
    SecondMode,
    /// Frames that come early or late.
    FrameJitter,
    /// An inflow that is the faster, the faster the rotor.
    InflowOfSpeed,
    /// A clock whose rate moves.
    DriftingClock,
    /// An average of averages: an amplifier's own, and one of its readings.
    AveragedTwice,
    /// An average in which what is recent counts for more.
    RecentFirst,
}

use Law::{
    AveragedTwice, BandKnee, Compliance, CubicThrust, DelayJitter, DriftingClock, FrameJitter, GrowingBand,
    InflowOfSpeed, LinearLag, RampDrift, RecentFirst, SagByCommand, SecondMode, SeveralPlays, SlowerDown, SoftClip,
    ThirdLag, UnevenSteps, UnevennessOfWay,
};

impl Law {
    /// Every law with its name in the truth and the kind whose law it replaces; every kind has one, but wrong numbers, which are no law.
    pub const TABLE: [(Self, &'static str, Kind); 20] = [
        (SlowerDown, "slower_down", Kind::SlewLimit),
        (SoftClip, "soft_clip", Kind::Saturation),
        (ThirdLag, "third_lag", Kind::SecondPole),
        (UnevennessOfWay, "unevenness_of_way", Kind::AsymmetricLag),
        (RampDrift, "ramp_drift", Kind::GainDrift),
        (CubicThrust, "cubic_thrust", Kind::QuadraticThrust),
        (SagByCommand, "sag_by_command", Kind::SupplySag),
        (LinearLag, "linear_lag", Kind::OperatingPointLag),
        (GrowingBand, "growing_band", Kind::DeadBand),
        (Compliance, "compliance", Kind::Backlash),
        (BandKnee, "band_knee", Kind::DeadBand),
        (SeveralPlays, "several_plays", Kind::Backlash),
        (DelayJitter, "delay_jitter", Kind::TransportDelay),
        (UnevenSteps, "uneven_steps", Kind::CommandQuantization),
        (SecondMode, "second_mode", Kind::StandResonance),
        (FrameJitter, "frame_jitter", Kind::EscFrameHold),
        (InflowOfSpeed, "inflow_of_speed", Kind::InflowLead),
        (DriftingClock, "drifting_clock", Kind::ClockSkew),
        (AveragedTwice, "averaged_twice", Kind::MovingAverage),
        (RecentFirst, "recent_first", Kind::MovingAverage),
    ];

    /// Every law.
    pub fn all() -> impl ExactSizeIterator<Item = Self> {
        Self::TABLE.into_iter().map(|(law, ..)| law)
    }

    fn row(self) -> (Self, &'static str, Kind) {
        Self::TABLE[self as usize]
    }

    /// Its name in the truth.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// The kind whose law it replaces.
    #[must_use]
    pub fn kind(self) -> Kind {
        self.row().2
    }

    /// Draws by how much the law is bent.
    #[must_use]
    pub fn draw(self, rng: &mut ChaCha8Rng) -> Shape {
        let (bent, none) = (rng.random_range(BENT), Shape::default());
        match self {
            SlowerDown => Shape { slower_down: bent, ..none },
            // Of the paper's amplitude.
            SoftClip => Shape { knee: 0.05 * bent, ..none },
            ThirdLag => Shape { third_lag: bent, ..none },
            UnevennessOfWay => Shape { unevenness_of_way: bent, ..none },
            RampDrift => Shape { ramp: true, ..none },
            CubicThrust => Shape { cubic: bent, ..none },
            SagByCommand => Shape { sags_by_command: true, ..none },
            LinearLag => Shape { linear_lag: true, ..none },
            GrowingBand => Shape { width_of_command: bent, ..none },
            Compliance => Shape { compliance: bent, ..none },
            BandKnee => Shape { band_knee: bent, ..none },
            // Plays that hardly differ are one.
            SeveralPlays => Shape { spread_of_plays: 3.0 * bent, ..none },
            DelayJitter => Shape { delay_jitter: bent, seed: rng.random(), ..none },
            UnevenSteps => Shape { uneven_steps: bent, seed: rng.random(), ..none },
            SecondMode => Shape { second_mode: bent, second_mode_ratio: rng.random_range(1.3..2.5), ..none },
            FrameJitter => Shape { frame_jitter: bent, seed: rng.random(), ..none },
            InflowOfSpeed => Shape { inflow_of_speed: true, ..none },
            DriftingClock => Shape { clock_drift: bent, ..none },
            AveragedTwice => Shape { second_average: bent, ..none },
            RecentFirst => Shape { recency: bent, ..none },
        }
    }

    /// An effect of its kind that is large enough for the law to show in the paper's records: between a third and all of its range,
    /// and a limit that commands meet.
    #[must_use]
    pub fn draw_effect(self, rng: &mut ChaCha8Rng) -> Effect {
        loop {
            let effect = self.kind().draw(rng);
            let value = effect.values[0];
            let shows = match self.kind() {
                Kind::SlewLimit => value < 1.0,
                Kind::Saturation => value < 0.69,
                Kind::SecondPole | Kind::TransportDelay => value > 3e-3,
                Kind::DeadBand => value > 0.004,
                Kind::Backlash => value > 0.006,
                Kind::CommandQuantization => value > 1.0 / 256.0,
                Kind::EscFrameHold => value < 250.0,
                Kind::StandResonance => effect.values[2] > 0.3,
                Kind::ClockSkew => value.abs() > 300.0,
                Kind::MovingAverage => value > 0.01,
                _ => true,
            };
            if shows {
                return effect;
            }
        }
    }
}

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
    /// The part of the width that a change of just the width of a dead band is not followed by.
    pub band_knee: f64,
    /// The part of the motion within a play that comes through.
    pub compliance: f64,
    /// By what part of their mean the narrowest and the widest of several plays differ from it.
    pub spread_of_plays: f64,
    /// The largest part of a delay by which a command comes early or late.
    pub delay_jitter: f64,
    /// The largest part of a step by which a quantizer's level is off.
    pub uneven_steps: f64,
    /// The part of a stand's participation that a second mode has.
    pub second_mode: f64,
    /// Its frequency over that of the first.
    pub second_mode_ratio: f64,
    /// The largest part of a frame by which a frame begins early or late.
    pub frame_jitter: f64,
    /// Whether the inflow's time constants are inverse to the speed, and those stated are of hover.
    pub inflow_of_speed: bool,
    /// The part by which a clock's error is smaller when a record begins and larger when it ends than in the mean.
    pub clock_drift: f64,
    /// The part of an average's window over which it is averaged again.
    pub second_average: f64,
    /// The part by which the latest moment of an average counts for more, and its earliest for less.
    pub recency: f64,
    /// What scatters delays, levels and frames.
    pub seed: u64,
}

impl Shape {
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

    /// By how much the output of a dead band of this width stays behind a change of this size that passes it.
    #[must_use]
    pub fn behind(&self, change: f64, width: f64) -> f64 {
        // A parabola that touches the straight line of all that pass.
        let knee = self.band_knee * width;
        let short = width + 2.0 * knee - change;
        if knee > 0.0 && short > 0.0 { short * short / (4.0 * knee) } else { 0.0 }
    }

    /// Half widths of the plays in parallel whose mean half width is `half`.
    #[must_use]
    pub fn half_plays(&self, half: f64) -> Vec<f64> {
        if self.spread_of_plays == 0.0 {
            return vec![half];
        }
        let place = |index: usize| 2.0 * index as f64 / (PLAYS - 1) as f64 - 1.0;
        (0..PLAYS).map(|index| half * (1.0 + self.spread_of_plays * place(index))).collect()
    }

    /// The level of a quantizer of this mean step that is nearest to a command.
    #[must_use]
    pub fn quantized(&self, command: f64, step: f64) -> f64 {
        let number = (command / step).round();
        let level = |number: f64| (number + self.uneven_steps * scattered(self.seed, number as u64)) * step;
        let nearer =
            |near: f64, other: f64| if (other - command).abs() < (near - command).abs() { other } else { near };
        if self.uneven_steps == 0.0 {
            return number * step;
        }
        nearer(level(number), nearer(level(number - 1.0), level(number + 1.0)))
    }

    /// What the delay of command `index` of a record is multiplied by. The record is told by a number of its own.
    #[must_use]
    pub fn delay_factor(&self, record: u64, index: usize) -> f64 {
        1.0 + self.delay_jitter * scattered(self.seed ^ record, index as u64)
    }

    /// How late a frame begins, in frames.
    #[must_use]
    pub fn frame_late(&self, record: u64, frame: u32) -> f64 {
        self.frame_jitter * scattered(self.seed ^ record, u64::from(frame))
    }

    /// What the inflow's time constants are multiplied by at a speed; 1 at the speed of hover.
    #[must_use]
    pub fn inflow_factor(&self, speed: f64, hover: f64) -> f64 {
        // A rotor that nearly stands does not become infinitely slow.
        if self.inflow_of_speed { hover / speed.max(0.1) } else { 1.0 }
    }

    /// What a clock's error so far, at `part` of a record, is multiplied by: 1 at its end.
    #[must_use]
    pub fn clock_factor(&self, part: f64) -> f64 {
        1.0 + self.clock_drift * (part - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn every_law_bends_something_and_every_kind_but_wrong_numbers_has_one() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (place, law) in Law::all().enumerate() {
            assert_eq!(law as usize, place);
            assert_ne!(law.draw(&mut rng), Shape::default(), "{law:?}");
            assert_eq!(law.draw_effect(&mut rng).kind, law.kind());
            assert_eq!(Law::all().filter(|other| other.name() == law.name()).count(), 1);
        }
        for kind in Kind::ALL {
            assert_eq!(Law::all().any(|law| law.kind() == kind), kind != Kind::ParameterError, "{kind:?}");
        }
    }

    #[test]
    fn a_soft_knee_joins_both_lines_without_a_corner() {
        let shape = Shape { knee: 0.01, ..Shape::default() };
        for (command, clipped) in [(0.5, 0.5), (0.69, 0.69), (0.70, 0.6975), (0.71, 0.70), (0.8, 0.70)] {
            assert!((shape.clipped(command, 0.7) - clipped).abs() < 1e-12, "{command}");
        }
        assert_eq!(Shape::default().clipped(0.701, 0.7), 0.7);
    }

    #[test]
    fn a_knee_of_a_dead_band_joins_the_line_of_all_that_pass_without_a_corner() {
        let shape = Shape { band_knee: 0.2, ..Shape::default() };
        // A width of 0.01: the knee is 0.002, and ends 0.004 beyond the width.
        for (change, behind) in [(0.010, 0.002), (0.012, 0.0005), (0.014, 0.0), (0.02, 0.0)] {
            assert!((shape.behind(change, 0.01) - behind).abs() < 1e-12, "{change}");
        }
        let slope = (shape.behind(0.014, 0.01) - shape.behind(0.014 - 1e-6, 0.01)) / 1e-6;
        assert!(slope.abs() < 1e-3, "{slope}");
        assert_eq!(Shape::default().behind(0.010, 0.01), 0.0);
    }

    #[test]
    fn several_plays_have_the_mean_width_of_the_one_that_they_replace() {
        let halves = Shape { spread_of_plays: 0.5, ..Shape::default() }.half_plays(0.01);
        assert!((halves.iter().sum::<f64>() / PLAYS as f64 - 0.01).abs() < 1e-12);
        assert!((halves[0] - 0.005).abs() < 1e-12 && (halves[PLAYS - 1] - 0.015).abs() < 1e-12);
        assert_eq!(Shape::default().half_plays(0.01), [0.01]);
    }

    #[test]
    fn a_level_of_uneven_steps_is_the_nearest_and_off_by_no_more_than_it_may_be() {
        let (step, shape) = (1.0 / 64.0, Shape { uneven_steps: 0.3, seed: 5, ..Shape::default() });
        let mut levels: Vec<f64> =
            (0..20_000).map(|index| shape.quantized(0.4 + 1e-5 * f64::from(index), step)).collect();
        for (index, level) in levels.iter().enumerate() {
            let command = 0.4 + 1e-5 * index as f64;
            assert!(levels.iter().step_by(97).all(|other| (level - command).abs() <= (other - command).abs() + 1e-12));
        }
        levels.dedup();
        let off: Vec<f64> = levels.iter().map(|level| (level / step - (level / step).round()).abs()).collect();
        assert!(off.iter().all(|off| *off <= 0.3) && off.iter().any(|off| *off > 0.15), "{off:?}");
        // 0.2 has 12.8 steps.
        assert!((12..=15).contains(&levels.len()), "{}", levels.len());
    }
}
