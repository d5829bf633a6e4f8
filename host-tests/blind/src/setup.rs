//! A list of effects as the numbers that the chain runs with.

use super::kind::{Effect, Kind};
use super::shape::Shape;

/// Everything that can be set on the chain. What is not hidden has its null value: no limit, no step, no lag.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Highest command.
    pub upper: f64,
    /// Step of the command's grid, from zero; 0 for none.
    pub step: f64,
    /// Width below which changes are ignored; 0 for none.
    pub dead_band: f64,
    /// Half the play; 0 for none.
    pub half_play: f64,
    /// Highest slope of the command per second.
    pub slope_per_s: f64,
    /// Frames per second of the ESC; infinite for none.
    pub frame_hz: f64,
    /// Delay of the command in seconds.
    pub delay_s: f64,
    /// Relative voltage drop of the slow polarization at hover.
    pub sag_depth: f64,
    /// Its time constant in seconds.
    pub sag_time_s: f64,
    /// Relative voltage drop of the resistance at hover: a nuisance of the kind, no parameter of it.
    pub sag_resistance: f64,
    /// `c` of `K (d + c d^2)`, per unit of command.
    pub curvature: f64,
    /// Relative change of the thrust in the drift's first time constant.
    pub drift_change: f64,
    /// Time constant of the drift in seconds.
    pub drift_time_s: f64,
    /// `tau_down / tau_up`.
    pub ratio: f64,
    /// Exponent of the speed in the lag.
    pub exponent: f64,
    /// Zero of the inflow in seconds.
    pub lead_s: f64,
    /// Pole of the inflow in seconds.
    pub lag_s: f64,
    /// Time constant of one more pole, in seconds; 0 for none.
    pub pole_s: f64,
    /// Natural frequency of the stand in hertz; 0 for none.
    pub stand_hz: f64,
    /// Its damping ratio.
    pub stand_damping: f64,
    /// How much of the thrust goes through the mode.
    pub participation: f64,
    /// Over how long the sensor averages, in seconds; 0 for not at all.
    pub window_s: f64,
    /// How much longer the logger's second is, in parts per million.
    pub skew_ppm: f64,
    /// By what the laws of all this are bent.
    pub shape: Shape,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            upper: f64::INFINITY,
            step: 0.0,
            dead_band: 0.0,
            half_play: 0.0,
            slope_per_s: f64::INFINITY,
            frame_hz: f64::INFINITY,
            delay_s: 0.0,
            sag_depth: 0.0,
            sag_time_s: 1.0,
            sag_resistance: 0.0,
            curvature: 0.0,
            drift_change: 0.0,
            drift_time_s: 1.0,
            ratio: 1.0,
            exponent: 0.0,
            lead_s: 0.0,
            lag_s: 0.0,
            pole_s: 0.0,
            stand_hz: 0.0,
            stand_damping: 1.0,
            participation: 0.0,
            window_s: 0.0,
            skew_ppm: 0.0,
            shape: Shape::default(),
        }
    }
}

impl Setup {
    /// The chain with these effects, and a resistance that makes `resistance_share` of a supply's slow drop.
    #[must_use]
    pub fn from_effects(effects: &[Effect], resistance_share: f64) -> Self {
        let mut setup = Self::default();
        for effect in effects {
            let value = |index: usize| effect.values[index];
            match effect.kind {
                Kind::ParameterError => {}
                Kind::TransportDelay => setup.delay_s = value(0),
                Kind::EscFrameHold => setup.frame_hz = value(0),
                Kind::DeadBand => setup.dead_band = value(0),
                Kind::Backlash => setup.half_play = value(0),
                Kind::CommandQuantization => setup.step = value(0),
                Kind::Saturation => setup.upper = value(0),
                Kind::SlewLimit => setup.slope_per_s = value(0),
                Kind::AsymmetricLag => setup.ratio = value(0),
                Kind::OperatingPointLag => setup.exponent = value(0),
                Kind::QuadraticThrust => setup.curvature = value(0),
                Kind::SecondPole => setup.pole_s = value(0),
                Kind::InflowLead => (setup.lead_s, setup.lag_s) = (value(0) * value(1), value(1)),
                Kind::SupplySag => {
                    (setup.sag_depth, setup.sag_time_s) = (value(0), value(1));
                    setup.sag_resistance = resistance_share * value(0);
                }
                Kind::GainDrift => (setup.drift_change, setup.drift_time_s) = (value(0), value(1)),
                Kind::StandResonance => {
                    (setup.stand_hz, setup.stand_damping, setup.participation) = (value(0), value(1), value(2));
                }
                Kind::ClockSkew => setup.skew_ppm = value(0),
                Kind::MovingAverage => setup.window_s = value(0),
            }
        }
        setup
    }

    /// The part that the command's way to the rotor depends on; the rest at null.
    #[must_use]
    pub fn path(&self) -> Self {
        Self {
            upper: self.upper,
            step: self.step,
            dead_band: self.dead_band,
            half_play: self.half_play,
            slope_per_s: self.slope_per_s,
            frame_hz: self.frame_hz,
            delay_s: self.delay_s,
            shape: self.shape,
            ..Self::default()
        }
    }

    /// Whether commands that change with the rows only also reach the rotor so, and the rotor's own thrust is what the
    /// logger reads, at the rows.
    #[must_use]
    pub(super) fn changes_with_rows_only(&self) -> bool {
        self.slope_per_s == f64::INFINITY
            && self.frame_hz == f64::INFINITY
            && self.delay_s == 0.0
            && self.lead_s == self.lag_s
            && self.pole_s == 0.0
            && self.participation == 0.0
            && self.window_s == 0.0
            && self.skew_ppm == 0.0
    }

    /// Whether the rotor's lag is a fixed first-order lag on a fixed map, which has an exact step.
    #[must_use]
    pub(super) fn is_plain_rotor(&self) -> bool {
        self.sag_depth == 0.0
            && self.sag_resistance == 0.0
            && self.drift_change == 0.0
            && self.ratio == 1.0
            && self.exponent == 0.0
    }
}
