//! The rotor where it is no linear lag: one that is integrated in steps.

use super::filter::FORGOTTEN;
use super::{Interval, Memory, OperatingCurve, OperatingPoint, PlantError, Segment};

/// A step is at most this part of the time constant of its moment. The classical Runge-Kutta method then errs by less than
/// `0.1^5 / 120`, 1e-7 of the way to the steady response, per step.
const STEP_PART: f64 = 0.1;

/// This near its steady state, as a command, the rotor is all but settled: there a step may be longer, as long as it errs no
/// more than a step of [`STEP_PART`] does here, up to [`SETTLED_PART`]: the method is stable for 2.8 time constants, so an effect's
/// own state may be five times as fast as the rotor.
const SETTLED: f64 = 1e-4;
const SETTLED_PART: f64 = 0.5;

/// So much slower than its base at most an effect makes the rotor for long, as far as what it forgets is concerned.
const MOST_SLOWED: f64 = 2.0;

/// Effects that the rotor may have, each with a state of its own.
const MOST_TERMS: usize = 4;
const STATES: usize = 2 + MOST_TERMS;

type State = [f64; STATES];

/// What the rotor would do without any effect: the steady response and the time constant of every command.
#[derive(Clone, Debug)]
pub enum RotorBase {
    /// The linear model around one command.
    Linear(OperatingPoint),
    /// The numbers of the command of the moment.
    Level(OperatingCurve),
}

impl RotorBase {
    /// Steady response at `command`, and the gain and time constant there.
    #[must_use]
    pub fn at(&self, command: f64) -> OperatingPoint {
        match self {
            Self::Linear(point) => {
                let response = point.response + point.lag.gain * (command - point.nominal);
                OperatingPoint { nominal: command, response, lag: point.lag }
            }
            Self::Level(curve) => curve.clamped_at(command),
        }
    }

    /// Multiplies gains and steady responses, and time constants.
    pub(super) fn scale(&mut self, gain: f64, time_constant: f64) {
        match self {
            Self::Linear(point) => {
                point.lag.gain *= gain;
                point.lag.time_constant_s *= time_constant;
            }
            Self::Level(curve) => curve.scale(gain, time_constant),
        }
    }

    /// The command for which the numbers at `command` were found: the nominal one, or that of the model's range next to it.
    /// What an effect adds to the linear model counts from here.
    #[must_use]
    pub fn anchor(&self, command: f64) -> f64 {
        match self {
            Self::Linear(point) => point.nominal,
            Self::Level(curve) => {
                let (from, to) = curve.range();
                command.clamp(from, to)
            }
        }
    }

    /// The command at which the supply has the voltage for which the model holds: the nominal command, or none (open
    /// circuit) for a model that spans a range.
    #[must_use]
    pub fn supplied_at(&self) -> f64 {
        match self {
            Self::Linear(point) => point.nominal,
            Self::Level(_) => 0.0,
        }
    }
}

/// What the rotor does in a moment. Effects change it, in their order.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// The command that drives it, 0..1.
    pub drive: f64,
    /// Its speed as the command that would keep it there.
    pub speed: f64,
    /// The command to which the base model's numbers belong; see [`RotorBase::anchor`].
    pub anchor: f64,
    /// One over the time constant.
    pub rate_per_s: f64,
}

/// Voltage and current of the supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Volts.
    pub voltage_v: f64,
    /// Amperes.
    pub current_a: f64,
}

/// An effect on the rotor itself, or on what it is fed. What a kind does not touch it leaves at these defaults.
pub trait RotorTerm: Send {
    /// The effect's own state at rest, where the command is `motion.drive`; sets `motion.drive` to what drives the rotor then.
    fn at_rest(&self, _motion: &mut Motion) -> f64 {
        0.0
    }

    /// How fast the effect's own state moves, per second; sets `motion.drive` to what the supply makes of it.
    fn supply(&self, _own: f64, _motion: &mut Motion) -> f64 {
        0.0
    }

    /// What the static map adds to the command at a `deviation` from the anchor, ahead of the lag.
    fn bend(&self, _deviation: f64) -> f64 {
        0.0
    }

    /// The same behind the lag, at a deviation of the speed.
    fn bend_behind(&self, _deviation: f64) -> f64 {
        0.0
    }

    /// Sets `motion.rate_per_s`.
    fn pace(&self, _motion: &mut Motion) {}

    /// For how long what was shows in the effect's own state, seconds.
    fn memory_s(&self) -> f64 {
        0.0
    }

    /// What the effect knows of the supply.
    fn measured(&self, _own: f64, _motion: &Motion) -> Option<Supply> {
        None
    }
}

/// The rotor with effects, by the classical fourth-order Runge-Kutta method.
///
/// ```text
/// dx/dt = rate (drive - x)                                 x: speed, as a command
/// dy/dt = rate (steady(drive) + gain bend(drive - anchor) - y)
/// response = y + gain bend_behind(x - anchor)
/// ```
///
/// Steps end where the command changes, so that they see no corner of it.
pub(super) struct IntegratedRotor {
    base: RotorBase,
    terms: Vec<Box<dyn RotorTerm>>,
    /// Speed, lagged response, and the states of the terms.
    state: State,
    drive: f64,
}

impl IntegratedRotor {
    /// # Errors
    /// [`PlantError::RotorEffects`] with more terms than there is room for.
    pub(super) fn new(base: RotorBase, terms: Vec<Box<dyn RotorTerm>>) -> Result<Self, PlantError> {
        if terms.len() > MOST_TERMS {
            return Err(PlantError::RotorEffects { count: terms.len(), most: MOST_TERMS });
        }
        Ok(Self { base, terms, state: [0.0; STATES], drive: 0.0 })
    }

    /// Puts the rotor at rest: the command has been `command` for ever.
    pub(super) fn settle(&mut self, command: f64) {
        let mut motion = self.motion(command, command);
        for (term, own) in self.terms.iter().zip(&mut self.state[2..]) {
            *own = term.at_rest(&mut motion);
        }
        self.drive = command;
        self.state[0] = motion.drive;
        self.state[1] = self.target(&motion);
    }

    pub(super) fn response(&self) -> f64 {
        self.output(&self.state)
    }

    pub(super) fn memory(&self) -> Memory {
        // One of many levels may be slow at any of them.
        let RotorBase::Linear(point) = &self.base else { return Memory::Lasting };
        let own = self.terms.iter().map(|term| term.memory_s()).sum::<f64>();
        Memory::Seconds(MOST_SLOWED * FORGOTTEN * point.lag.time_constant_s + own)
    }

    pub(super) fn speed(&self) -> f64 {
        self.state[0]
    }

    pub(super) fn supply(&self) -> Option<Supply> {
        let motion = self.motion(self.drive, self.state[0]);
        self.terms.iter().zip(&self.state[2..]).find_map(|(term, &own)| term.measured(own, &motion))
    }

    /// Into how many steps a piece of `duration_s` is cut that begins as `piece` does.
    pub(super) fn steps(&self, piece: Segment, duration_s: f64) -> usize {
        let mut motion = self.motion(piece.level, self.state[0]);
        self.terms.iter().for_each(|term| term.pace(&mut motion));
        // A command at which the rotor is infinitely fast is no number of steps; a model with it is refused before.
        let time_constants = duration_s * motion.rate_per_s;
        let part = if time_constants > STEP_PART { self.step_part(piece, motion.rate_per_s) } else { STEP_PART };
        ((time_constants / part).ceil() as usize).clamp(1, 100_000)
    }

    /// The part of the time constant that a step may take from here on. An error of the method goes with the fifth power of it
    /// and with the way that is left.
    fn step_part(&self, piece: Segment, rate_per_s: f64) -> f64 {
        if piece.slope_per_s != 0.0 {
            return STEP_PART;
        }
        let slopes = self.derivative(&self.state, piece.level);
        let gain = self.base.at(piece.level).lag.gain.abs();
        let own = slopes[2..].iter().fold(0.0_f64, |most, slope| most.max(slope.abs()));
        let left = slopes[0].abs().max(slopes[1].abs() / gain.max(f64::MIN_POSITIVE)).max(own) / rate_per_s;
        // What is not a number is far from settled.
        if left < SETTLED { (STEP_PART * (SETTLED / left).powf(0.2)).min(SETTLED_PART) } else { STEP_PART }
    }

    /// Lets `duration_s` pass, at most what [`IntegratedRotor::steps`] allows, with the command that begins as `piece` does.
    pub(super) fn advance(&mut self, from_s: f64, piece: Segment, duration_s: f64) -> Interval {
        let (start, start_slope) = self.value_and_slope(piece.level);
        self.step(piece, duration_s);
        let (end, end_slope) = self.value_and_slope(self.drive);
        Interval { from_s, duration_s, start, start_slope, end, end_slope }
    }

    /// Lets `piece` pass, which begins at `from_s`, and reads the response at `moments` within it, increasing.
    pub(super) fn advance_reading(&mut self, from_s: f64, piece: Segment, moments: &[f64], read: &mut Vec<f64>) {
        let mut begin_s = from_s;
        let mut rest = moments;
        while begin_s < piece.until_s {
            let left_s = piece.until_s - begin_s;
            let part = Segment { level: piece.level + piece.slope_per_s * (begin_s - from_s), ..piece };
            let count = self.steps(part, left_s);
            let end_s = if count == 1 { piece.until_s } else { begin_s + left_s / count as f64 };
            let step_s = end_s - begin_s;
            let (here, later) = rest.split_at(rest.partition_point(|moment_s| *moment_s <= end_s));
            rest = later;
            match here {
                [] => self.step(part, step_s),
                [only] if *only == end_s => {
                    self.step(part, step_s);
                    read.push(self.response());
                }
                // Between the ends of a step the response is the cubic through them, as good as the step itself.
                _ => {
                    let interval = self.advance(begin_s, part, step_s);
                    read.extend(here.iter().map(|moment_s| interval.at(*moment_s)));
                }
            }
            begin_s = end_s;
        }
    }

    fn step(&mut self, piece: Segment, duration_s: f64) {
        let command = |part: f64| piece.level + piece.slope_per_s * (part * duration_s);
        let start = self.state;
        let k1 = self.derivative(&start, command(0.0));
        let k2 = self.derivative(&along(&start, &k1, 0.5 * duration_s), command(0.5));
        let k3 = self.derivative(&along(&start, &k2, 0.5 * duration_s), command(0.5));
        let k4 = self.derivative(&along(&start, &k3, duration_s), command(1.0));
        for index in 0..STATES {
            let slope = (k1[index] + 2.0 * (k2[index] + k3[index]) + k4[index]) / 6.0;
            self.state[index] = start[index] + duration_s * slope;
        }
        self.drive = command(1.0);
    }

    /// The response of the moment, and how fast it moves with the command `command`.
    fn value_and_slope(&self, command: f64) -> (f64, f64) {
        (self.response(), self.output_slope(&self.state, &self.derivative(&self.state, command)))
    }

    fn motion(&self, command: f64, speed: f64) -> Motion {
        let rate_per_s = 1.0 / self.base.at(command).lag.time_constant_s;
        Motion { drive: command, speed, anchor: self.base.anchor(command), rate_per_s }
    }

    fn target(&self, motion: &Motion) -> f64 {
        let point = self.base.at(motion.drive);
        let anchor = self.base.anchor(motion.drive);
        let bent: f64 = self.terms.iter().map(|term| term.bend(motion.drive - anchor)).sum();
        point.response + point.lag.gain * bent
    }

    fn derivative(&self, state: &State, command: f64) -> State {
        let mut motion = self.motion(command, state[0]);
        let mut slopes = [0.0; STATES];
        for ((term, &own), slope) in self.terms.iter().zip(&state[2..]).zip(&mut slopes[2..]) {
            *slope = term.supply(own, &mut motion);
        }
        for term in &self.terms {
            term.pace(&mut motion);
        }
        slopes[0] = motion.rate_per_s * (motion.drive - state[0]);
        slopes[1] = motion.rate_per_s * (self.target(&motion) - state[1]);
        slopes
    }

    fn output(&self, state: &State) -> f64 {
        let anchor = self.base.anchor(state[0]);
        let bent: f64 = self.terms.iter().map(|term| term.bend_behind(state[0] - anchor)).sum();
        if bent == 0.0 { state[1] } else { state[1] + self.base.at(state[0]).lag.gain * bent }
    }

    /// How fast the response moves where the state moves by `slopes`.
    fn output_slope(&self, state: &State, slopes: &State) -> f64 {
        // The bend's slope by a central difference: it is a parabola or nothing, for which that is exact.
        let anchor = self.base.anchor(state[0]);
        let width = 1e-3;
        let bend = |speed: f64| self.terms.iter().map(|term| term.bend_behind(speed - anchor)).sum::<f64>();
        let bent = (bend(state[0] + width) - bend(state[0] - width)) / (2.0 * width);
        if bent == 0.0 { slopes[1] } else { slopes[1] + self.base.at(state[0]).lag.gain * bent * slopes[0] }
    }
}

fn along(state: &State, slopes: &State, duration_s: f64) -> State {
    std::array::from_fn(|index| state[index] + duration_s * slopes[index])
}
