//! What shapes a command: the section of a lead compensator, or a conditioned inverse.

use super::SpeedCorrection;
use crate::biquad::{self, LimitedCoefficients, LimitedSection, Section};
use crate::inverse::{self, ConditionedInverse, Limits, SlewLimit};
use crate::multiply::signed;
use crate::throttle::Command;

/// What a compensator runs, as a checked design gives it.
// One for each motor, for as long as it lives.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// A lead, of a [`LeadDesign`](crate::design::LeadDesign).
    Lead(LeadFilter),
    /// A conditioned inverse, of an [`InverseDesign`](crate::design::InverseDesign).
    Inverse(InverseFilter),
}

/// A lead with what it is allowed to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeadFilter {
    /// Its section.
    pub coefficients: biquad::Coefficients,
    /// Largest change of the output per tick. With one the section has the limits in its state ([`LimitedSection`]). With
    /// [`SlewLimit::NONE`] it runs unlimited, and a clamp to the range follows.
    pub slew: SlewLimit,
}

/// A conditioned inverse with what it is allowed to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InverseFilter {
    /// Its reference model and the rotor's curve.
    pub coefficients: inverse::Coefficients,
    /// Largest change of the output per tick.
    pub slew: SlewLimit,
    /// The commands for which the curve is known. It is bypassed at others.
    pub range: CommandRange,
}

/// Commands from `lowest` to `highest`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandRange {
    /// The lowest.
    pub lowest: Command,
    /// The highest.
    pub highest: Command,
}

impl CommandRange {
    /// Every command.
    pub const FULL: Self = Self { lowest: Command::ZERO, highest: Command::ONE };

    #[inline]
    fn contains(&self, command: Command) -> bool {
        self.lowest <= command && command <= self.highest
    }
}

impl From<biquad::Coefficients> for Filter {
    /// A lead without a slew limit.
    fn from(coefficients: biquad::Coefficients) -> Self {
        LeadFilter { coefficients, slew: SlewLimit::NONE }.into()
    }
}

impl From<LeadFilter> for Filter {
    fn from(filter: LeadFilter) -> Self {
        Self::Lead(filter)
    }
}

impl From<InverseFilter> for Filter {
    fn from(filter: InverseFilter) -> Self {
        Self::Inverse(filter)
    }
}

/// A [`Filter`] with its state. Its outputs are within the limits that it was made with.
#[allow(clippy::large_enum_variant)] // As `Filter`.
#[derive(Clone, Copy, Debug)]
#[repr(u8)] // For `KINDS`.
pub(super) enum RunningFilter {
    Lead(RunningLead) = 0,
    LimitedLead(RunningLimitedLead) = 1,
    Inverse(RunningInverse) = 2,
}

/// A section with the limits of its output.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningLead {
    coefficients: biquad::Coefficients,
    section: Section,
    min: Command,
    max: Command,
}

impl RunningLead {
    /// One control tick.
    #[inline]
    pub fn update(&mut self, input: Command) -> Command {
        self.section.update(&self.coefficients, input).clamp_in_order(self.min, self.max)
    }
}

/// A section with the limits in its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningLimitedLead {
    coefficients: LimitedCoefficients,
    section: LimitedSection,
}

impl RunningLimitedLead {
    /// One control tick.
    #[inline]
    pub fn update(&mut self, input: Command) -> Command {
        self.section.update(&self.coefficients, input)
    }
}

/// A conditioned inverse with the commands that it may shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningInverse {
    coefficients: inverse::Coefficients,
    inverse: ConditionedInverse,
    range: CommandRange,
    pub correction: SpeedCorrection,
}

impl RunningInverse {
    /// Whether it may shape this command.
    #[inline]
    pub fn covers(&self, command: Command) -> bool {
        self.range.contains(command)
    }

    /// What a reply has said of the speed, after a tick.
    #[inline]
    pub fn correct(&mut self, turn_us: i32) {
        self.correction.update(self.inverse.rotor_state(), turn_us);
    }

    /// One control tick.
    #[inline]
    pub fn update(&mut self, input: Command) -> Command {
        self.inverse.update(&self.coefficients, self.correction.corrected(input))
    }
}

impl RunningFilter {
    /// Its first byte is below this.
    pub const KINDS: u8 = 3;

    /// At rest at `min`, which is at most `max`.
    pub fn at_rest(filter: Filter, min: Command, max: Command) -> Self {
        match filter {
            Filter::Lead(LeadFilter { coefficients, slew: SlewLimit::NONE }) => {
                Self::Lead(RunningLead { coefficients, section: Section::at_level(min), min, max })
            }
            Filter::Lead(LeadFilter { coefficients, slew }) => {
                let section = LimitedSection::at_rest(min, max, slew, min);
                Self::LimitedLead(RunningLimitedLead { coefficients: coefficients.into(), section })
            }
            Filter::Inverse(InverseFilter { coefficients, slew, range }) => {
                let inverse = ConditionedInverse::at_rest(Limits::new(min, max, slew), min);
                Self::Inverse(RunningInverse { coefficients, inverse, range, correction: SpeedCorrection::NONE })
            }
        }
    }

    /// Puts it at rest at `level`, and forgets what speeds have said.
    #[inline]
    pub const fn reset(&mut self, level: Command) {
        if let Self::Inverse(inverse) = self {
            inverse.correction.reset();
        }
        self.rest(level);
    }

    /// Puts it at rest at `level`.
    #[inline]
    pub const fn rest(&mut self, level: Command) {
        match self {
            Self::Lead(lead) => lead.section = Section::at_level(level),
            Self::LimitedLead(lead) => lead.section.rest(level, level),
            Self::Inverse(inverse) => inverse.inverse.reset(inverse.correction.corrected(level)),
        }
    }

    /// A tick without it: the input is `input`, and the ESC gets `output`. A section rests at its input, one with a slew limit with the
    /// output that it must go on from. An inverse knows what a rotor does that gets the output, which lags behind.
    pub fn bypass(&mut self, input: Command, output: Command) {
        match self {
            Self::Lead(lead) => lead.section = Section::at_level(input),
            Self::LimitedLead(lead) => lead.section.rest(input, output),
            Self::Inverse(RunningInverse { coefficients, inverse, .. }) => inverse.follow(coefficients, output),
        }
    }

    /// Whether it may shape this command.
    #[inline]
    pub fn covers(&self, command: Command) -> bool {
        match self {
            Self::Lead(_) | Self::LimitedLead(_) => true,
            Self::Inverse(inverse) => inverse.covers(command),
        }
    }

    /// One control tick.
    pub fn update(&mut self, input: Command) -> Command {
        match self {
            Self::Lead(lead) => lead.update(input),
            Self::LimitedLead(lead) => lead.update(input),
            Self::Inverse(inverse) => inverse.update(input),
        }
    }

    /// What an offset of the output loses in one tick, in LSB: `(1 - p) / 2` of itself, where `p` is the product of the
    /// filter's poles; rounded away from zero, so that the decay ends.
    ///
    /// Complex poles have the radius `sqrt(p)`, about `1 - (1 - p) / 2`: the offset decays as fast as the filter's own
    /// response would. A slower decay drives the motor past its command. A faster one is the step that bumpless switching
    /// is to prevent.
    pub fn decay_step(&self, offset: i32) -> i32 {
        // p = 1 + k
        let of_section =
            |coefficients: &biquad::Coefficients| (-signed(offset, coefficients.k()), biquad::COEFFICIENT_BITS);
        let (product, bits) = match self {
            Self::Lead(lead) => of_section(&lead.coefficients),
            Self::LimitedLead(lead) => of_section(lead.coefficients.section()),
            // p = 1 - B
            Self::Inverse(inverse) => (signed(offset, inverse.coefficients.b()), inverse::COEFFICIENT_BITS),
        };
        (product >> (bits + 1)) as i32 + i32::from(offset > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every kind with its slowest and its fastest poles, and those of the paper's compensator.
    #[test]
    fn a_decay_ends_without_changing_sign() {
        let lead = |k| Filter::from(biquad::Coefficients::new(k, 4096, 1, 1).unwrap());
        let inverse = |b| {
            let gains = [1 << inverse::GAIN_BITS; inverse::TABLE_POINTS];
            let coefficients = inverse::Coefficients::new(1 << 20, b, gains).unwrap();
            Filter::Inverse(InverseFilter { coefficients, slew: SlewLimit::NONE, range: CommandRange::FULL })
        };
        let slow_and_fast = [
            (lead(-5462), 60_000_000),
            (lead(i32::MIN), 100),
            (lead(-112_938_246), 2000),
            (inverse(1366), 60_000_000),
            (inverse(1 << 30), 100),
            (inverse(28_234_561), 2000),
        ];
        for (filter, ticks) in slow_and_fast {
            let filter = RunningFilter::at_rest(filter, Command::ZERO, Command::ONE);
            for start in [1, -1, 255, -255, 256, -256, 1 << 29, -(1 << 29)] {
                let mut offset: i32 = start;
                for _ in 0..ticks {
                    let next = offset - filter.decay_step(offset);
                    assert!(next.signum() * start.signum() >= 0 && (next.abs() < offset.abs() || offset == 0));
                    offset = next;
                }
                assert_eq!(offset, 0, "from {start}");
            }
        }
    }
}
