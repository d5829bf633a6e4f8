//! The kinds of effects by name, with their parameters and plausible ranges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A kind of effect. The names in files and JSON are those of [`Kind::name`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Nothing but wrong numbers in the model that the tool is given.
    ParameterError,
    /// A pure delay.
    TransportDelay,
    /// The ESC takes over the command at its own frames.
    EscFrameHold,
    /// Changes below a width are ignored until they add up.
    DeadBand,
    /// Play.
    Backlash,
    /// Rounding to a grid.
    CommandQuantization,
    /// An upper limit of the command.
    Saturation,
    /// A limit of the command's slope.
    SlewLimit,
    /// Rising and falling lags differ.
    AsymmetricLag,
    /// The lag follows the speed.
    OperatingPointLag,
    /// A curved static map.
    QuadraticThrust,
    /// One more pole.
    SecondPole,
    /// Thrust leads speed.
    InflowLead,
    /// The voltage falls with the current.
    SupplySag,
    /// The gain changes with time.
    GainDrift,
    /// A mode of the stand.
    StandResonance,
    /// The logger's clock runs at another rate.
    ClockSkew,
    /// The sensor averages.
    MovingAverage,
}

use Kind::{
    AsymmetricLag, Backlash, ClockSkew, CommandQuantization, DeadBand, EscFrameHold, GainDrift, InflowLead,
    MovingAverage, OperatingPointLag, ParameterError, QuadraticThrust, Saturation, SecondPole, SlewLimit,
    StandResonance, SupplySag, TransportDelay,
};

/// How a parameter is drawn and searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in JSON.
    pub name: &'static str,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
    /// Drawn so that every decade is as likely as any other.
    pub logarithmic: bool,
    /// Whether the sign is a matter of convention, so that only the size is compared.
    pub unsigned: bool,
}

impl Parameter {
    const fn linear(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, logarithmic: false, unsigned: false }
    }

    const fn log(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, logarithmic: true, unsigned: false }
    }

    /// The value at `part` of the range, 0..1.
    #[must_use]
    pub fn at(&self, part: f64) -> f64 {
        if self.logarithmic {
            self.low * (self.high / self.low).powf(part)
        } else {
            self.low + (self.high - self.low) * part
        }
    }
}

const fn unsigned(mut parameter: Parameter) -> Parameter {
    parameter.unsigned = true;
    parameter
}

impl Kind {
    /// Every kind. The number of one is part of its seeds: a new one comes last.
    pub const ALL: [Self; 18] = [
        ParameterError,
        TransportDelay,
        EscFrameHold,
        DeadBand,
        Backlash,
        CommandQuantization,
        Saturation,
        SlewLimit,
        AsymmetricLag,
        OperatingPointLag,
        QuadraticThrust,
        SecondPole,
        InflowLead,
        SupplySag,
        GainDrift,
        StandResonance,
        ClockSkew,
        MovingAverage,
    ];

    /// Its identifier in files and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            ParameterError => "parameter_error",
            TransportDelay => "transport_delay",
            EscFrameHold => "esc_frame_hold",
            DeadBand => "dead_band",
            Backlash => "backlash",
            CommandQuantization => "command_quantization",
            Saturation => "saturation",
            SlewLimit => "slew_limit",
            AsymmetricLag => "asymmetric_lag",
            OperatingPointLag => "operating_point_lag",
            QuadraticThrust => "quadratic_thrust",
            SecondPole => "second_pole",
            InflowLead => "inflow_lead",
            SupplySag => "supply_sag",
            GainDrift => "gain_drift",
            StandResonance => "stand_resonance",
            ClockSkew => "clock_skew",
            MovingAverage => "moving_average",
        }
    }

    /// The kind of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Its parameters with their plausible ranges, in the order in which an [`Effect`] holds them.
    ///
    /// `parameter_error` has two numbers, but what is wrong is the model given to the tool, not the data.
    #[must_use]
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            ParameterError => {
                const { &[Parameter::linear("gain_error", -0.25, 0.25), Parameter::linear("time_constant_error", -0.4, 0.6)] }
            }
            TransportDelay => const { &[Parameter::log("delay_s", 0.03e-3, 25e-3)] },
            EscFrameHold => const { &[Parameter::log("frame_hz", 40.0, 600.0)] },
            DeadBand => const { &[Parameter::log("width", 0.002, 0.01)] },
            Backlash => const { &[Parameter::log("half_width", 0.003, 0.02)] },
            CommandQuantization => const { &[Parameter::log("step", 1.0 / 2048.0, 1.0 / 64.0)] },
            Saturation => const { &[Parameter::linear("max", 0.6, 1.0)] },
            SlewLimit => const { &[Parameter::log("rate_per_s", 0.25, 160.0)] },
            AsymmetricLag => const { &[Parameter::linear("ratio", 1.3, 2.0)] },
            OperatingPointLag => const { &[Parameter::linear("exponent", 0.5, 1.5)] },
            QuadraticThrust => const { &[Parameter::linear("curvature_per_duty", 1.0, 6.0)] },
            SecondPole => const { &[Parameter::log("time_constant_s", 0.1e-3, 30e-3)] },
            InflowLead => {
                const { &[Parameter::linear("lead_ratio", 1.3, 2.5), Parameter::log("time_constant_s", 3e-3, 15e-3)] }
            }
            SupplySag => {
                const { &[Parameter::linear("polarization_drop", 0.05, 0.15), Parameter::log("polarization_s", 0.3, 3.0)] }
            }
            GainDrift => const { &[Parameter::linear("drift", 0.03, 0.15), Parameter::log("time_s", 10.0, 60.0)] },
            StandResonance => {
                const {
                    &[
                        Parameter::log("frequency_hz", 12.0, 85.0),
                        Parameter::log("damping", 0.02, 0.1),
                        Parameter::log("participation", 0.1, 1.3),
                    ]
                }
            }
            ClockSkew => const { &[unsigned(Parameter::log("skew_ppm", 10.0, 2000.0))] },
            // From telemetry that takes the mean of two rows to a scale that takes that of many.
            MovingAverage => const { &[Parameter::log("window_s", 3e-3, 0.2)] },
        }
    }

    /// An effect of this kind with random parameters over the plausible range.
    ///
    /// Four draws are not uniform over each range. A quantizer has a whole number of steps in 0..1.
    /// A drift falls four times in five and else rises; a clock
    /// is as often fast as slow. Of the limits four in five lie below 0.72, where a command of 0.65 +- 0.05 can reach
    /// them at all.
    #[must_use]
    pub fn draw(self, rng: &mut ChaCha8Rng) -> Effect {
        let mut values: Vec<f64> =
            self.parameters().iter().map(|parameter| parameter.at(rng.random_range(0.0..1.0))).collect();
        let chance: f64 = rng.random_range(0.0..1.0);
        match self {
            CommandQuantization => values[0] = 1.0 / (1.0 / values[0]).round(),
            Saturation if chance < 0.8 => values[0] = rng.random_range(0.6..0.72),
            GainDrift if chance < 0.8 => values[0] = -values[0],
            ClockSkew if chance < 0.5 => values[0] = -values[0],
            _ => {}
        }
        Effect { kind: self, values }
    }

    /// Kinds that are known to look like this one; the first ones that a separation test must beat.
    #[must_use]
    pub fn confused_with(self) -> &'static [Self] {
        match self {
            ParameterError => &[],
            TransportDelay => &[EscFrameHold, SecondPole, SlewLimit, ClockSkew, MovingAverage],
            EscFrameHold => &[TransportDelay, SecondPole, SlewLimit],
            DeadBand => &[Backlash, CommandQuantization, TransportDelay],
            Backlash => &[DeadBand, CommandQuantization, TransportDelay, SecondPole],
            CommandQuantization => &[DeadBand, Backlash],
            Saturation => &[SlewLimit, QuadraticThrust, GainDrift],
            SlewLimit => &[Saturation, TransportDelay, SecondPole, EscFrameHold],
            AsymmetricLag => &[OperatingPointLag, QuadraticThrust],
            OperatingPointLag => &[AsymmetricLag, QuadraticThrust],
            QuadraticThrust => &[OperatingPointLag, AsymmetricLag, SupplySag],
            SecondPole => &[TransportDelay, EscFrameHold, SlewLimit, InflowLead, MovingAverage],
            InflowLead => &[SupplySag, SecondPole, StandResonance],
            SupplySag => &[GainDrift, InflowLead, OperatingPointLag],
            GainDrift => &[SupplySag, InflowLead],
            StandResonance => &[InflowLead, SecondPole],
            ClockSkew => &[TransportDelay, GainDrift],
            MovingAverage => &[TransportDelay, SecondPole, EscFrameHold],
        }
    }
}

/// An effect: its kind, and its parameters in the order of [`Kind::parameters`].
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// What it is.
    pub kind: Kind,
    /// The values, in the units that the names say.
    pub values: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn names_are_unique_and_found_again() {
        for kind in Kind::ALL {
            assert_eq!(Kind::named(kind.name()), Some(kind));
        }
        assert_eq!(Kind::named("gremlins"), None);
    }

    #[test]
    fn draws_stay_in_their_ranges_and_fill_them() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for kind in Kind::ALL {
            let draws: Vec<Effect> = (0..400).map(|_| kind.draw(&mut rng)).collect();
            for (index, parameter) in kind.parameters().iter().enumerate() {
                let sizes: Vec<f64> = draws
                    .iter()
                    .map(|draw| draw.values[index])
                    .map(|value| if parameter.unsigned || kind == GainDrift { value.abs() } else { value })
                    .collect();
                let (low, high) = sizes.iter().fold((f64::MAX, f64::MIN), |(l, h), s| (l.min(*s), h.max(*s)));
                let part = |value: f64| (value - parameter.low) / (parameter.high - parameter.low);
                assert!(part(low) > -0.01 && part(high) < 1.01, "{} {low} {high}", parameter.name);
                assert!(part(low) < 0.1 && part(high) > 0.8, "{} {low} {high}", parameter.name);
            }
        }
    }

    #[test]
    fn a_quantizer_has_a_whole_number_of_steps() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..50 {
            let steps = 1.0 / CommandQuantization.draw(&mut rng).values[0];
            assert!((steps - steps.round()).abs() < 1e-9);
        }
    }
}
