//! The compensator of one motor: its filter, the limits of its output, and bumpless switching.

mod filter;
mod speed;

pub use filter::{CommandRange, Filter, InverseFilter, LeadFilter};
pub use speed::{OMEGA_I_RAD_S, SpeedCorrection, TICKS_PER_UPDATE};

use core::mem::offset_of;

use crate::throttle::{Command, Throttle};
use filter::RunningFilter;

/// The compensator of one motor: a lead, or a conditioned inverse.
///
/// - **Limits without wind-up.** The section of a lead without a slew limit runs unclamped within its headroom. Only the output
///   is clamped, to [`min`, `max`]. So the output leaves a limit on the tick on which the unclamped filter re-enters the range. A
///   [lead with a slew limit](crate::biquad::LimitedSection) and an [inverse](crate::inverse) have the limits in their own state.
/// - **Slew.** With such a filter in the path and no switch under way, no output differs from the last by more than the slew. A
///   bypassed command passes at any. What is left of a switch or a restart adds what its offset loses in a tick, as below.
/// - **Bumpless switching.** On the tick of a switch the output `y` moves towards the target, which is the output of
///   the new path, by at most the size of its last increment: `|y[n] - y[n-1]| <= |y[n-1] - y[n-2]|`. The difference
///   that remains is an offset from the target. From then on it decays with the time constant of complex poles of the
///   filter, and loses at once whatever a limit cuts off. In steady state a lead makes no difference, and switching
///   changes no output bit; an inverse makes one of at most half a step of its output, 2^-17.
/// - **Bypass.** The output is the input, clamped. When a lead is switched in again it starts at rest at the last input,
///   however long it was bypassed, and with a slew limit from the last output. The error of this initial condition decays with the
///   filter's poles: 15 ms for the paper's compensator. An inverse starts with the state of a rotor that got the outputs meanwhile.
/// - **Range.** Where the curve of an inverse is not known it is bypassed, and switched in again when the command returns.
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
    filter: RunningFilter,
    /// Whether the filter is in the path for the commands that it covers.
    is_enabled: bool,
    min: Command,
    /// At least `min`.
    max: Command,
    state: State,
    /// The last two outputs, older first.
    outputs: [Command; 2],
}

/// What the output follows.
#[derive(Clone, Copy, Debug)]
#[repr(u8)] // For `Compensator::is_held_by`.
enum Path {
    /// The filter, within the limits.
    Filter = 0,
    /// The input, clamped.
    Bypass = 1,
}

/// How the next tick forms the output from its target, the output of the path.
///
/// Offsets are output minus target in LSB of 2^-29.
#[derive(Clone, Copy, Debug)]
#[repr(u8)] // As `Path`.
enum State {
    /// The output is that of the filter: the fast path of [`Compensator::update`].
    Filter = 0,
    /// The output is that of the bypass.
    Bypass = 1,
    /// The output is that of `path`, plus an offset that decays.
    Decay { path: Path, offset: i32 } = 2,
    /// The tick switches to the path `to`, and limits the output increment.
    Switch {
        to: Path,
        /// Of the path left, 0 for none. A switch back before the tick restores it.
        offset: i32,
    } = 3,
    /// The filter was restarted at another level. The tick limits the output increment, on either path.
    Restart { path: Path } = 4,
}

impl Path {
    const fn new(enabled: bool) -> Self {
        if enabled { Self::Filter } else { Self::Bypass }
    }
}

impl State {
    /// After a tick of `path`, which left `offset`.
    const fn after(path: Path, offset: i32) -> Self {
        match (offset, path) {
            (0, Path::Filter) => Self::Filter,
            (0, Path::Bypass) => Self::Bypass,
            _ => Self::Decay { path, offset },
        }
    }

    /// Whether bytes hold a state: its number and, behind it, that of a path where it has one.
    #[inline]
    fn is_held_by(byte_at: impl Fn(usize) -> u8) -> bool {
        match byte_at(0) {
            0..=1 => true,
            2..=4 => byte_at(1) <= Path::Bypass as u8,
            _ => false,
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
            (Self::Decay { offset, .. }, ..) => Self::Switch { to, offset },
            (Self::Switch { offset, .. }, ..) => Self::after(to, offset),
        }
    }
}

impl Compensator {
    /// A compensator with its filter in the path and at rest at `min`. Its outputs are in [`min`, `max`]. If `min` is
    /// above `max`, every output is `min`.
    ///
    /// Outputs of an inverse are multiples of 2^-16. Where there is none from `min` to `max` they are the nearest to `min`.
    #[must_use]
    pub fn new(filter: impl Into<Filter>, min: Command, max: Command) -> Self {
        let max = max.max(min);
        let filter = RunningFilter::at_rest(filter.into(), min, max);
        Self { filter, is_enabled: true, min, max, state: State::Filter, outputs: [min; 2] }
    }

    /// Whether memory that others write to holds a compensator, of which `byte_at` reads the byte at an offset: whether its
    /// enumerations and its `bool` are among their values. All the rest are integers, with which no update reads beyond it,
    /// divides or loops.
    #[inline]
    #[must_use]
    pub fn is_held_by(byte_at: impl Fn(usize) -> u8) -> bool {
        byte_at(offset_of!(Self, filter)) < RunningFilter::KINDS
            && byte_at(offset_of!(Self, is_enabled)) <= 1
            && State::is_held_by(|offset| byte_at(offset_of!(Self, state) + offset))
    }

    /// Puts the filter and the past outputs at rest at `level`. The output may jump: at an input of `level` the next
    /// output is `level`, clamped. A switch of [`Self::set_enabled`] that waits for the next tick is done at once.
    pub const fn reset(&mut self, level: Command) {
        self.filter.reset(level);
        self.outputs = [level.clamp_to(self.min, self.max); 2];
        self.state = State::after(self.state.path(), 0);
    }

    /// Puts the filter at rest at `level`. The output does not jump: the next tick limits its increment, as at a
    /// switch, and the offset that remains decays. For an input that returns after an outage: the change of the input
    /// during the outage is not answered as a step.
    pub const fn restart(&mut self, level: Command) {
        self.filter.rest(level);
        self.state = State::Restart { path: self.state.path() };
    }

    /// Switches the filter in (`true`) or bypasses it (`false`) from the next tick on, without a jump of the output.
    /// Only the last call before a tick counts: a switch there and back changes nothing.
    pub const fn set_enabled(&mut self, enabled: bool) {
        self.is_enabled = enabled;
        self.state = self.state.switched(Path::new(enabled));
    }

    /// Has an inverse go by the speed that the ESC says, which [`Self::correct`] gives it. Without effect on a lead.
    pub const fn set_correction(&mut self, correction: SpeedCorrection) {
        if let RunningFilter::Inverse(inverse) = &mut self.filter {
            inverse.correction = correction;
        }
    }

    /// Once in [`TICKS_PER_UPDATE`] ticks, after a tick: the last electrical turn of the rotor took so many microseconds; negative where
    /// no reply has said it of late. Without effect where an inverse is not in the path, or still on its way there.
    #[inline]
    pub fn correct(&mut self, turn_us: i32) {
        if let (RunningFilter::Inverse(inverse), State::Filter) = (&mut self.filter, self.state) {
            inverse.correct(turn_us);
        }
    }

    /// What the speed has made of the gain of an inverse; 1 where nothing corrects it.
    #[must_use]
    pub fn gain(&self) -> f64 {
        if let RunningFilter::Inverse(inverse) = &self.filter { inverse.correction.gain() } else { 1.0 }
    }

    /// Whether the next tick has the filter in its path, if it covers the command.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.is_enabled
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

    /// [`Self::update`] in the state [`State::Filter`]: of a lead with a slew limit, and by way of the others of every filter.
    // Each kind in a function of its own: the one that needs fewer registers does not save those of the other.
    #[inline(never)]
    fn update_filter(&mut self, input: Command) -> Command {
        let RunningFilter::LimitedLead(lead) = &mut self.filter else { return self.update_inverse(input) };
        let output = lead.update(input);
        self.outputs = [self.outputs[1], output];
        output
    }

    /// The same for an inverse.
    #[inline(never)]
    fn update_inverse(&mut self, input: Command) -> Command {
        match &mut self.filter {
            RunningFilter::Inverse(inverse) if inverse.covers(input) => {
                let output = inverse.update(input);
                self.outputs = [self.outputs[1], output];
                output
            }
            RunningFilter::Inverse(_) => self.update_any(input),
            _ => self.update_lead(input),
        }
    }

    /// The same for a lead without a slew limit.
    #[inline(never)]
    fn update_lead(&mut self, input: Command) -> Command {
        let RunningFilter::Lead(lead) = &mut self.filter else { return self.update_any(input) };
        let output = lead.update(input);
        self.outputs = [self.outputs[1], output];
        output
    }

    /// [`Self::update`] in any state.
    #[inline(never)]
    fn update_any(&mut self, input: Command) -> Command {
        let path = Path::new(self.is_enabled && self.filter.covers(input));
        self.state = self.state.switched(path);
        let target = match path {
            Path::Filter => self.filter.update(input),
            Path::Bypass => Throttle::from(input).clamp_in_order(self.min, self.max),
        };
        let output = match self.state {
            State::Filter | State::Bypass => target,
            State::Decay { offset, .. } => {
                let offset = offset - self.filter.decay_step(offset);
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
        if matches!(path, Path::Bypass) {
            self.filter.bypass(input, output);
        }
        self.outputs = [self.outputs[1], output];
        output
    }
}
