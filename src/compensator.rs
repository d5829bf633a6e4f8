//! The compensator of one motor: the section, its output limits, and bumpless switching.

use core::num::NonZeroI32;

use crate::biquad::{COEFFICIENT_BITS, Coefficients, Section};
use crate::throttle::{Command, Throttle};

/// The lead compensator of one motor.
///
/// - **Limits without wind-up.** The section runs unclamped within its headroom. Only the output is clamped, to
///   [`min`, `max`]. So the output leaves a limit on the tick on which the unclamped filter re-enters the range.
/// - **Bumpless switching.** On the tick of a switch the output `y` moves towards the target, which is the output of
///   the new path, by at most the size of its last increment: `|y[n] - y[n-1]| <= |y[n-1] - y[n-2]|`. The difference
///   that remains is an offset from the target. From then on it decays with a time constant of `2 / |k|` ticks, that
///   of complex poles of the section, and loses at once whatever a limit cuts off. In steady state there is no
///   difference, and switching changes no output bit.
/// - **Bypass.** The output is the input, clamped. When the filter is switched in again it starts at rest at the last
///   input, however long it was bypassed. The error of this initial condition decays with the section's poles: 15 ms
///   for the paper's compensator.
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
    /// At rest at the last input while the filter is bypassed.
    section: Section,
    min: Command,
    /// At least `min`.
    max: Command,
    state: State,
    /// The last two outputs, older first.
    outputs: [Command; 2],
}

/// What the output follows.
#[derive(Clone, Copy, Debug)]
enum Path {
    /// The section, clamped.
    Filter,
    /// The input, clamped.
    Bypass,
}

/// How the next tick forms the output from its target, the output of the path.
///
/// Offsets are output minus target in LSB of 2^-29.
#[derive(Clone, Copy, Debug)]
enum State {
    /// The output is that of the filter: the fast path of [`Compensator::update`].
    Filter,
    /// The output is that of the bypass.
    Bypass,
    /// The output is that of `path`, plus an offset that decays.
    Decay { path: Path, offset: NonZeroI32 },
    /// The tick switches to the path `to`, and limits the output increment.
    Switch {
        to: Path,
        /// Of the path left, 0 for none. A switch back before the tick restores it.
        offset: i32,
    },
    /// The section was restarted at another level. The tick limits the output increment, on either path.
    Restart { path: Path },
}

impl Path {
    const fn new(enabled: bool) -> Self {
        if enabled { Self::Filter } else { Self::Bypass }
    }
}

impl State {
    /// After a tick of `path`, which left `offset`.
    const fn after(path: Path, offset: i32) -> Self {
        match (NonZeroI32::new(offset), path) {
            (Some(offset), path) => Self::Decay { path, offset },
            (None, Path::Filter) => Self::Filter,
            (None, Path::Bypass) => Self::Bypass,
        }
    }

    /// The path of the next tick.
    const fn path(self) -> Path {
        match self {
            Self::Filter => Path::Filter,
            Self::Bypass => Path::Bypass,
            Self::Decay { path, .. } | Self::Switch { to: path, .. } | Self::Restart { path } => path,
        }
    }

    /// The state with `to` as the path of the next tick.
    // Rarely called, from several places: inlined, it takes 0.8 kB more flash.
    #[inline(never)]
    const fn switched(self, to: Path) -> Self {
        match (self, self.path(), to) {
            (Self::Restart { .. }, ..) => Self::Restart { path: to },
            (_, Path::Filter, Path::Filter) | (_, Path::Bypass, Path::Bypass) => self,
            (Self::Filter | Self::Bypass, ..) => Self::Switch { to, offset: 0 },
            (Self::Decay { offset, .. }, ..) => Self::Switch { to, offset: offset.get() },
            (Self::Switch { offset, .. }, ..) => Self::after(to, offset),
        }
    }
}

impl Compensator {
    /// A compensator with its filter in the path and at rest at `min`. Its outputs are in [`min`, `max`]. If `min` is
    /// above `max`, every output is `min`.
    #[must_use]
    pub const fn new(coefficients: Coefficients, min: Command, max: Command) -> Self {
        Self {
            coefficients,
            section: Section::at_level(min),
            min,
            max: if max.to_bits() < min.to_bits() { min } else { max },
            state: State::Filter,
            outputs: [min; 2],
        }
    }

    /// Puts the filter and the past outputs at rest at `level`. The output may jump: at an input of `level` the next
    /// output is `level`, clamped. A switch of [`Self::set_enabled`] that waits for the next tick is done at once.
    pub const fn reset(&mut self, level: Command) {
        self.section = Section::at_level(level);
        self.outputs = [level.clamp_to(self.min, self.max); 2];
        self.state = State::after(self.state.path(), 0);
    }

    /// Puts the filter at rest at `level`. The output does not jump: the next tick limits its increment, as at a
    /// switch, and the offset that remains decays. For an input that returns after an outage: the change of the input
    /// during the outage is not answered as a step.
    pub const fn restart(&mut self, level: Command) {
        self.section = Section::at_level(level);
        self.state = State::Restart { path: self.state.path() };
    }

    /// Switches the filter in (`true`) or bypasses it (`false`) from the next tick on, without a jump of the output.
    /// Only the last call before a tick counts: a switch there and back changes nothing.
    pub const fn set_enabled(&mut self, enabled: bool) {
        self.state = self.state.switched(Path::new(enabled));
    }

    /// Whether the next tick has the filter in its path.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        matches!(self.state.path(), Path::Filter)
    }

    /// The last output, in [`min`, `max`]. Before the first tick, the level at rest, clamped.
    #[must_use]
    pub const fn output(&self) -> Command {
        self.outputs[1]
    }

    /// One control tick: takes the input `x[n]`, the command of the flight controller, and returns the output `y[n]`,
    /// the command for the ESC, in [`min`, `max`].
    #[inline]
    pub fn update(&mut self, input: Command) -> Command {
        if !matches!(self.state, State::Filter) {
            return self.update_any(input);
        }
        self.update_filter(input)
    }

    /// [`Self::update`] in the state [`State::Filter`].
    #[inline(never)]
    fn update_filter(&mut self, input: Command) -> Command {
        let output = self.filter(input);
        self.outputs = [self.outputs[1], output];
        output
    }

    #[inline]
    fn filter(&mut self, input: Command) -> Command {
        self.section.update(&self.coefficients, input).clamp_in_order(self.min, self.max)
    }

    /// [`Self::update`] in any state.
    #[inline(never)]
    fn update_any(&mut self, input: Command) -> Command {
        let path = self.state.path();
        let target = match path {
            Path::Filter => self.filter(input),
            Path::Bypass => {
                self.section = Section::at_level(input);
                Throttle::from(input).clamp_in_order(self.min, self.max)
            }
        };
        let output = match self.state {
            State::Filter | State::Bypass => target,
            State::Decay { offset, .. } => {
                let offset = offset.get() - decay_step(offset.get(), &self.coefficients);
                Throttle::from_bits(target.to_bits() + offset).clamp_in_order(self.min, self.max)
            }
            State::Switch { .. } | State::Restart { .. } => {
                let [before_last, last] = [self.outputs[0].to_bits(), self.outputs[1].to_bits()];
                let largest = (last - before_last).abs();
                let increment = (target.to_bits() - last).max(-largest).min(largest);
                // Between the last output and the target, and so within the limits.
                Command::saturating_from_bits(last + increment)
            }
        };
        // From the clamped output: an offset that kept what the clamp cut off would hold the output at the limit after
        // the path has left it.
        self.state = State::after(path, output.to_bits() - target.to_bits());
        self.outputs = [self.outputs[1], output];
        output
    }
}

/// What `offset` loses in one tick, in LSB: `|k| / 2` of itself, rounded away from zero so that the decay ends.
///
/// The product of the section's poles is `1 + k`, so complex poles have the radius `sqrt(1 + k)`, about `1 - |k| / 2`:
/// the offset decays as fast as the filter's own response would. A slower decay drives the motor past its command. A
/// faster one is the step that bumpless switching is to prevent.
const fn decay_step(offset: i32, coefficients: &Coefficients) -> i32 {
    let product = offset as i64 * -(coefficients.k() as i64);
    (product >> (COEFFICIENT_BITS + 1)) as i32 + (offset > 0) as i32
}

#[cfg(test)]
mod tests {
    use super::{Coefficients, decay_step};

    #[test]
    fn a_decay_ends_without_changing_sign() {
        // The smallest and the largest |k|, and that of the paper's compensator.
        for (k, ticks) in [(-5462, 60_000_000), (i32::MIN, 100), (-112_938_246, 2000)] {
            let coefficients = Coefficients::new(k, 4096, 1, 1).unwrap();
            for start in [1, -1, 255, -255, 256, -256, 1 << 29, -(1 << 29)] {
                let mut offset: i32 = start;
                for _ in 0..ticks {
                    let next = offset - decay_step(offset, &coefficients);
                    assert!(next.signum() * start.signum() >= 0 && (next.abs() < offset.abs() || offset == 0));
                    offset = next;
                }
                assert_eq!(offset, 0, "from {start}");
            }
        }
    }
}
