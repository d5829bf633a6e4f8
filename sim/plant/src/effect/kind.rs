//! What a kind of effect is.

use serde::{Serialize, Serializer};
use std::fmt;

use num_complex::Complex64;

use super::{Part, Recipe};
use crate::operating::OperatingPoint;
use crate::rotor::RotorBase;

/// Beyond what is plausible by this factor a value is a slip of its unit. Derived: prefixes of units are a thousand apart.
const FAR: f64 = 1e3;

/// A kind of effect: what it is, how it shows, and how it is simulated.
pub struct Kind {
    /// Identifier in files: lower case with underscores.
    pub id: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Where in the chain it acts.
    pub site: Site,
    /// The model equation.
    pub equation: &'static str,
    /// Its parameters. Values are always in this order.
    pub parameters: &'static [Parameter],
    /// How it shows in measurements.
    pub signature: &'static str,
    /// What it is mistaken for, and what tells them apart.
    pub confusions: &'static [Confusion],
    /// What it means for flying, and what to do: words without a capital and a full stop, as those of a finding.
    pub remedy: &'static str,
    /// Where equation and numbers come from.
    pub sources: &'static [&'static str],
    /// What [`Kind::response`] means.
    pub linearity: Linearity,
    /// Which logs it shows in.
    pub shows: Shows,
    /// How its values are looked for.
    pub search: Search,
    /// Refuses values that do not go together, each in its own range; gives the parameter that is wrong and why.
    pub check: fn(&[f64]) -> Checked,
    /// The link of the chain. [`Part::Nothing`] for null values, so that these change no digit.
    pub part: fn(&[f64], &RotorBase) -> Part,
    /// By what it multiplies the response of the lag around a nominal command, at a frequency in rad/s; 1 where
    /// [`Linearity::Absent`].
    pub response: fn(&[f64], &OperatingPoint, f64) -> Complex64,
}

/// By its name in a model file.
impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id)
    }
}

/// Whether values go together: if not, the place of the parameter that is wrong among all, and what it is not.
pub type Checked = Result<(), (usize, &'static str)>;

/// Where in the chain an effect acts. The known frames of the ESC come between `Command` and `Line`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Site {
    /// The numbers of the lag themselves.
    Base,
    /// The command before it reaches the ESC.
    Command,
    /// Between the ESC taking a command over and the motor.
    Line,
    /// The voltage that drives the motor.
    Supply,
    /// Steady response against command.
    Map,
    /// The rotor's way to its steady response.
    Rotor,
    /// From speed to thrust.
    Air,
    /// What carries the sensor.
    Stand,
    /// The sensor, which stays on the stand.
    Sensor,
    /// Filter and clock of the logger.
    Logger,
}

/// Whether an effect has a frequency response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Linearity {
    /// It is linear and time-invariant: the response is exact, at any amplitude.
    Exact,
    /// The mean over its own rhythm is: the response leaves out the images of a sampler.
    Mean,
    /// The response is that for small deviations from the nominal command.
    SmallSignal,
    /// It has none: amplitude or time would change it. Behind the rotor: its steady response drifts with the time in a record.
    Absent,
}

/// Which records a kind shows in, if its values are large enough. Staircases and other logs that do not repeat show less than periods
/// around one command, and more. Where a kind does not show it is not looked for: it would be the name of whatever else is the
/// matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// All that excite it.
    Anywhere,
    /// Not those of a command that goes from one settled level to the next in steps larger than the effect. These only settle
    /// somewhat elsewhere, for which there are many reasons, or somewhat later, which is a delay.
    BetweenLevels,
    /// Not logs of the speed: it is in the force on the stand.
    InForce,
    /// Not logs that do not repeat: it takes two clocks, and one stamps their rows.
    BetweenClocks,
    /// Logs that go through levels of many loads alone. Around one level another kind looks the same.
    OverLevels,
}

/// What a residual tells of the values of a kind, beyond its starts and plausible ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Nothing.
    Values,
    /// Which distance between commands it repeats with: that of the steps of a grid.
    Steps,
    /// How often something waits for the next frame.
    Frames,
    /// The frequency and the width of a peak.
    Peak,
    /// Nothing, but it lies a little below the highest commands, or it changes nothing or much.
    Limit,
}

/// One parameter of a kind.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Name in files, with its unit.
    pub name: &'static str,
    /// Unit for people; empty for plain numbers.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// The value at which the effect is not there; a limit at infinity is infinite. Where another parameter makes it vanish
    /// (a time constant of something of size 0), NaN.
    pub null: f64,
    /// Smallest and largest possible value. What is outside is refused, but for an infinite null value.
    pub possible: (f64, f64),
    /// From and to where to search for it.
    pub plausible: (f64, f64),
    /// How to step through the plausible range.
    pub scale: Scale,
    /// Where searches start.
    pub starts: &'static [f64],
    /// Into how many pieces the plausible range has to be cut for the response to move smoothly within each.
    pub pieces: u32,
    /// Whether data has to say it.
    pub usage: Use,
    /// Whether it is the time constant of a lag in series with the rotor's: around one command both could as well change places.
    pub is_lag: bool,
}

/// How to step through a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In equal steps.
    Linear,
    /// By equal factors.
    Log,
}

/// Whether a parameter has to be given.
#[derive(Clone, Copy, Debug)]
pub enum Use {
    /// It makes the effect: a model gives it, and a fit finds it.
    Fitted,
    /// A refinement: absent it has this value, and a fit leaves it there unless the data can tell.
    Optional(f64),
    /// Bends the law: a fit finds it only where it is asked to.
    Shape {
        /// The value that it has where it is absent: at it the law is the catalog's.
        neutral: f64,
        /// How another value bends the law, in a clause.
        says: fn(f64) -> String,
    },
}

/// Another kind that looks alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confusion {
    /// The other's identifier.
    pub with: &'static str,
    /// The records of the experiment that tells them apart.
    pub recipe: &'static Recipe,
    /// That experiment in words, and how it tells them apart.
    pub experiment: &'static str,
}

impl Kind {
    /// The values of an effect that does nothing, those that may be absent at their defaults; NaN for a parameter without a null
    /// value.
    #[must_use]
    pub fn null(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.default().unwrap_or(parameter.null)).collect()
    }

    /// The parameters that a fit finds, with their places among all.
    pub fn fitted(&self) -> impl Iterator<Item = (usize, &'static Parameter)> {
        self.parameters.iter().enumerate().filter(|(_, parameter)| matches!(parameter.usage, Use::Fitted))
    }

    /// The parameter that bends its law, with its place among all. A kind has one at most.
    #[must_use]
    pub fn shape(&self) -> Option<(usize, &'static Parameter)> {
        self.parameters.iter().enumerate().find(|(_, parameter)| matches!(parameter.usage, Use::Shape { .. }))
    }

    /// For [`Kind::check`] of kinds whose parameters have nothing to do with each other.
    pub fn any(_: &[f64]) -> Checked {
        Ok(())
    }

    /// For [`Kind::response`] of kinds that leave small deviations, or the magnitude, alone.
    pub fn unity(_: &[f64], _: &OperatingPoint, _: f64) -> Complex64 {
        Complex64::ONE
    }
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Eq for Kind {}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id)
    }
}

impl Parameter {
    /// A parameter that fits find, searched in equal steps between the ends of `plausible`, which it may also pass. To be
    /// refined by the other constructors.
    pub const fn fitted(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self {
            name,
            unit,
            meaning,
            null: 0.0,
            possible: (0.0, f64::INFINITY),
            plausible: (0.0, 1.0),
            scale: Scale::Linear,
            starts: &[],
            // Chosen: most responses change smoothly within a twelfth of a plausible range; fewer miss a basin, more take time.
            pieces: 12,
            usage: Use::Fitted,
            is_lag: false,
        }
    }

    /// The smallest and the largest value that is accepted: where `possible` has no end, a thousand times what is plausible.
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        let (low, high) = self.plausible;
        // A limit far away is none.
        let far = if self.null.is_infinite() { f64::MAX } else { FAR * low.abs().max(high.abs()) };
        (self.possible.0.max(-far), self.possible.1.min(far))
    }

    /// The value that it has where it is absent; `None` where a model has to give it.
    #[must_use]
    pub fn default(&self) -> Option<f64> {
        match self.usage {
            Use::Fitted => None,
            Use::Optional(default) | Use::Shape { neutral: default, .. } => Some(default),
        }
    }

    /// With another null value than 0.
    pub const fn null(mut self, null: f64) -> Self {
        self.null = null;
        self
    }

    /// With the range that is not refused; 0 and up unless said.
    pub const fn possible(mut self, from: f64, to: f64) -> Self {
        self.possible = (from, to);
        self
    }

    /// With the range and the starts of a search, in equal steps.
    pub const fn linear(mut self, from: f64, to: f64, starts: &'static [f64]) -> Self {
        self.plausible = (from, to);
        self.starts = starts;
        self
    }

    /// The same by equal factors.
    pub const fn log(mut self, from: f64, to: f64, starts: &'static [f64]) -> Self {
        self.scale = Scale::Log;
        self.linear(from, to, starts)
    }

    /// With a response that jumps about as the value moves, so that it is smooth only within one of so many pieces of the
    /// range.
    pub const fn jumping(mut self, pieces: u32) -> Self {
        self.pieces = pieces;
        self
    }

    /// With a response that moves smoothly over large parts of the range. Chosen: four pieces, one for each quarter of it; more take time.
    pub const fn smooth(self) -> Self {
        self.jumping(4)
    }

    /// Is the time constant of a lag in series with the rotor's.
    pub const fn lag(mut self) -> Self {
        self.is_lag = true;
        self
    }

    /// May be absent, and then is `default`.
    pub const fn optional(mut self, default: f64) -> Self {
        self.usage = Use::Optional(default);
        self
    }

    /// Bends the law, which is the catalog's at `neutral`; `says` how, of another value. The effect is there at any value, so that none
    /// is its null value. The width of the plausible range is how far, as a rule, actuators are from the catalog's law.
    pub const fn shape(mut self, neutral: f64, says: fn(f64) -> String) -> Self {
        self.usage = Use::Shape { neutral, says };
        self.null = f64::NAN;
        self
    }
}

/// A number to two significant digits, or to the unit where it is larger, for what a shape says.
pub(super) fn two_digits(value: f64) -> String {
    let decimals = (1.0 - value.abs().max(1e-6).log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}
