//! One motor's filter: the section, its limits, and the switch that takes it in and out.

use crate::biquad::{COEFFICIENT_BITS, Coefficients, Section};
use crate::throttle::{Command, Throttle};

/// The lead compensator of one motor.
///
/// - **Limits without wind-up.** The section runs unclamped inside its headroom, and only what leaves is clamped to
///   `[min, max]`. So the output leaves the limit on the very tick on which the unclamped filter re-enters the range.
/// - **Bumpless switching.** On the tick of a switch the output moves towards what the new path asks for, but by no
///   more than it moved on the tick before. What is then left over is added as an offset. It fades with the time
///   constant of the section's poles, and loses at once what a limit cuts off. At a constant input there is nothing
///   left over, and no output bit changes.
/// - **Bypass** gives the input, clamped. The section does not run meanwhile; when it is switched in again it starts at
///   rest at the last input, so that how long it was out does not matter. What it lacks of the past dies out with its
///   own poles: with a time constant of 15 ms for the paper's.
///
/// # Examples
///
/// A step of the command by 0.1, answered by the paper's compensator:
///
/// ```
/// use rotorlead::compensator::Compensator;
/// use rotorlead::design::{LeadDesign, LeadParameters};
/// use rotorlead::throttle::Command;
///
/// // Poles of the identified motors, and the highest frequency that is to be amplified, rad/s.
/// let lead = LeadParameters::from_poles(&[6.2758, 9.2889, 14.1275], 628.32)?;
/// let design = LeadDesign::new(lead, 5000.0, None)?;
///
/// let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
/// compensator.reset(Command::saturating_from_f64(0.4));
/// let peak = (0..5000).map(|_| compensator.update(Command::saturating_from_f64(0.5)).to_f64()).fold(0.0, f64::max);
///
/// // It overshoots the step 3.4 times, as its design says, and settles on it within a second.
/// assert!((peak - (0.4 + 0.1 * design.check().step_peak)).abs() < 1e-4, "{peak}");
/// assert!((compensator.output().to_f64() - 0.5).abs() < 1e-8);
/// # Ok::<(), rotorlead::design::DesignError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Compensator {
    coefficients: Coefficients,
    section: Section,
    min: Command,
    /// At least `min`.
    max: Command,
    /// Nothing but the section is at work: the filter was in the path and shall be, and nothing is left of a switch.
    is_plain: bool,
    /// Whether the filter was in the path on the last tick, and whether it shall be on the next.
    enabled: bool,
    wanted: bool,
    /// The last input, while the filter is out of the path.
    input: Command,
    /// The last two outputs, older first.
    outputs: [Command; 2],
    /// The section was put at another level since the last tick.
    restarted: bool,
    /// Output minus what the present path asks for, in steps of 2^-29; 0 but for a while after a switch.
    offset: i32,
}

impl Compensator {
    /// A compensator, switched in and at rest at `min`, that puts out commands in [`min`, `max`]. Where `min` is above
    /// `max` the output is `min`.
    #[must_use]
    pub const fn new(coefficients: Coefficients, min: Command, max: Command) -> Self {
        Self {
            coefficients,
            section: Section::at_level(min),
            min,
            max: if max.to_bits() < min.to_bits() { min } else { max },
            is_plain: true,
            enabled: true,
            wanted: true,
            input: min,
            outputs: [min; 2],
            restarted: false,
            offset: 0,
        }
    }

    /// Puts everything at rest at `level`, without regard to what the output was: the next output for that input is
    /// `level`, clamped.
    pub const fn reset(&mut self, level: Command) {
        self.section = Section::at_level(level);
        self.input = level;
        self.outputs = [level.clamp_to(self.min, self.max); 2];
        self.enabled = self.wanted;
        self.restarted = false;
        self.offset = 0;
        self.is_plain = self.wanted;
    }

    /// Puts the filter at rest at `level` without a jump of the output, as [`Self::set_enabled`] does: what is left
    /// over fades. For an input that comes back from an outage, whose change meanwhile is no step to answer.
    pub const fn restart(&mut self, level: Command) {
        self.section = Section::at_level(level);
        self.input = level;
        self.restarted = true;
        self.is_plain = false;
    }

    /// Switches the filter in (`true`) or out of the path from the next tick on. There and back between two ticks is
    /// no switch.
    pub const fn set_enabled(&mut self, enabled: bool) {
        self.wanted = enabled;
        self.is_plain = self.enabled && enabled && !self.restarted && self.offset == 0;
    }

    /// Whether the filter is in the path from the next tick on.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.wanted
    }

    /// The last output.
    #[must_use]
    pub const fn output(&self) -> Command {
        self.outputs[1]
    }

    /// One tick: takes the command of the flight controller, gives that for the ESC.
    #[inline]
    pub fn update(&mut self, input: Command) -> Command {
        if !self.is_plain {
            return self.update_any(input);
        }
        let output = self.filter(input);
        self.outputs = [self.outputs[1], output];
        output
    }

    #[inline]
    fn filter(&mut self, input: Command) -> Command {
        self.section.update(&self.coefficients, input).clamp_in_order(self.min, self.max)
    }

    /// Any tick.
    #[inline(never)]
    fn update_any(&mut self, input: Command) -> Command {
        let is_switching = self.wanted != self.enabled || self.restarted;
        if self.wanted && !self.enabled {
            self.section = Section::at_level(self.input);
        }
        self.enabled = self.wanted;
        self.restarted = false;
        let target = if self.enabled { self.filter(input) } else { input.clamp_to(self.min, self.max) };
        let output = if is_switching {
            let [before, last] = [self.outputs[0].to_bits(), self.outputs[1].to_bits()];
            let largest = (last - before).abs();
            let step = (target.to_bits() - last).max(-largest).min(largest);
            // Between the last output and the target, and so within the limits.
            let output = Command::saturating_from_bits(last + step);
            self.offset = output.to_bits() - target.to_bits();
            output
        } else if self.offset != 0 {
            let faded = self.offset - fade_step(self.offset, &self.coefficients);
            let output = Throttle::from_bits(target.to_bits() + faded).clamp_to(self.min, self.max);
            // What was cut off is gone: kept, it would hold the output at the limit after the filter has left it.
            self.offset = output.to_bits() - target.to_bits();
            output
        } else {
            target
        };
        self.input = input;
        self.outputs = [self.outputs[1], output];
        self.is_plain = self.enabled && self.offset == 0;
        output
    }
}

/// What `offset` loses in a tick: `|k| / 2` of itself, rounded away from zero so that it ends.
///
/// The product of the section's poles is `1 + k`, so this is the pace at which the lead that a motor was given would
/// have died out had the section stayed in. A slower fade goes on driving the motor past its command, a faster one is
/// felt as the step that it is to prevent.
const fn fade_step(offset: i32, coefficients: &Coefficients) -> i32 {
    let product = offset as i64 * -(coefficients.k() as i64);
    (product >> (COEFFICIENT_BITS + 1)) as i32 + (offset > 0) as i32
}

#[cfg(test)]
mod tests {
    use super::{Coefficients, fade_step};

    #[test]
    fn a_fade_ends_without_changing_sign() {
        // The least and the greatest k, and the paper's.
        for (k, ticks) in [(-5462, 60_000_000), (i32::MIN, 100), (-112_938_246, 2000)] {
            let coefficients = Coefficients::new(k, 4096, 1, 1).unwrap();
            for start in [1, -1, 255, -255, 256, -256, 1 << 29, -(1 << 29)] {
                let mut offset: i32 = start;
                for _ in 0..ticks {
                    let next = offset - fade_step(offset, &coefficients);
                    assert!(next.signum() * start.signum() >= 0 && (next.abs() < offset.abs() || offset == 0));
                    offset = next;
                }
                assert_eq!(offset, 0, "from {start}");
            }
        }
    }
}
