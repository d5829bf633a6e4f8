//! The rotor with effects on it, integrated in steps.

use super::filter::MEMORY_TIME_CONSTANTS;
use super::passage::{Passage, Readings, Rotates, Wanted};
use super::rotor::{Motion, RotorEffect, Supply};
use super::{Interval, Lagged, Memory, PlantError, RotorBase, Segment};

/// A step is at most this part of the time constant of its moment. Derived: the classical Runge-Kutta method then errs by less than `0.1^5
/// / 120`, 1e-7 of the way to the steady response, per step.
const STEP_PART: f64 = 0.1;

/// A step this short errs no more by the midpoint rule. Derived: by `SHORT_STEP^2 / 6`, 7e-7, in a time constant, where the longest ones
/// err by `STEP_PART^4 / 120`, 8e-7.
const SHORT_STEP: f64 = 0.002;

/// This near its steady state, as a command, the rotor is all but settled: there a step may be longer, as long as it errs no more than one
/// of [`STEP_PART`] does here, up to [`SETTLED_PART`]. Chosen: such a step errs by 1e-11. Derived: the method is stable for 2.8 time
/// constants, so an effect's own state may be five times as fast as the rotor.
const SETTLED: f64 = 1e-4;
const SETTLED_PART: f64 = 0.5;

/// So much slower than its base at most an effect makes the rotor for long, as far as what it forgets is concerned. Chosen: the largest
/// plausible asymmetry of the catalog, 3, slows by 1.7, `sqrt(3)`; more makes every run-in longer.
const MOST_SLOWED: f64 = 2.0;

/// Effects that the rotor may have, each with a state of its own. Chosen: one more than a diagnosis names; each has its place in every
/// step, used or not.
const MOST_TERMS: usize = 4;

/// The states of the effects, or how fast they move.
type Own = [f64; MOST_TERMS];

/// What is integrated, or how fast it moves.
#[derive(Clone, Copy, Debug, Default)]
struct IntegratedState {
    /// Speed, as a command.
    speed: f64,
    /// Lagged response, or what of it lags ([`Lagged`]).
    response: f64,
    /// The states of the effects.
    own: Own,
}

/// How fast the state moves in a moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slopes {
    of: IntegratedState,
    /// One over the time constant of the moment.
    rate_per_s: f64,
}

/// The rotor with effects, by the classical fourth-order Runge-Kutta method in steps of [`STEP_PART`] of the time constant at most,
/// longer ones where all is settled, and by the midpoint rule in those up to [`SHORT_STEP`].
///
/// ```text
/// dx/dt = rate (drive - x)                                 x: speed, as a command
/// dy/dt = rate (steady(drive) + gain bend(drive - anchor) - y)
/// response = y + gain output_nonlinearity(x - anchor)
/// ```
///
/// On [`RotorBase::Speed`] the response is that of the speed itself, `y = steady(x) + gain bend(x - anchor)`.
///
/// Steps end where the command changes, so that they see no corner of it.
pub(super) struct IntegratedRotor {
    rotor: RotorState,
    terms: Vec<Box<dyn IntegratedTerm>>,
}

/// A rotor without its effects, and where it is.
pub struct RotorState {
    base: RotorBase,
    /// One over the time constant of the linear model.
    linear_per_s: f64,
    /// The part of the time constant that a step may take: [`STEP_PART`], or more.
    step_part: f64,
    state: IntegratedState,
    drive: f64,
}

/// An effect that can be integrated with nothing else beside it: compiled for each effect by itself, which is several times as
/// quick as to ask for every part of every step what the effect is.
pub trait IntegratedTerm: RotorEffect {
    /// Lets a rotor pass that has no other effect.
    fn pass_alone(&self, rotor: &mut RotorState, passage: &mut Passage);
}

impl<T: RotorEffect> IntegratedTerm for T {
    fn pass_alone(&self, rotor: &mut RotorState, passage: &mut Passage) {
        rotor.pass(&Alone(self), passage);
    }
}

/// All effects of a rotor.
pub(super) trait Terms {
    /// How many.
    fn count(&self) -> usize;
    /// How fast their own states move; sets what drives the rotor.
    fn state_derivative(&self, own: &Own, motion: &mut Motion) -> Own;
    /// Sets how fast the rotor is.
    fn pace(&self, motion: &mut Motion);
    /// What they add to the static map ahead of the lag.
    fn input_nonlinearity(&self, deviation: f64) -> f64;
    /// The same behind the lag.
    fn output_nonlinearity(&self, deviation: f64) -> f64;
}

/// One effect.
pub(super) struct Alone<'a, T: ?Sized>(pub &'a T);

impl<T: RotorEffect + ?Sized> Terms for Alone<'_, T> {
    fn count(&self) -> usize {
        1
    }

    fn state_derivative(&self, own: &Own, motion: &mut Motion) -> Own {
        let mut slopes = Own::default();
        slopes[0] = self.0.state_derivative(own[0], motion);
        slopes
    }

    fn pace(&self, motion: &mut Motion) {
        self.0.pace(motion);
    }

    fn input_nonlinearity(&self, deviation: f64) -> f64 {
        self.0.input_nonlinearity(deviation)
    }

    fn output_nonlinearity(&self, deviation: f64) -> f64 {
        self.0.output_nonlinearity(deviation)
    }
}

impl Terms for [Box<dyn IntegratedTerm>] {
    fn count(&self) -> usize {
        self.len()
    }

    fn state_derivative(&self, own: &Own, motion: &mut Motion) -> Own {
        let mut slopes = Own::default();
        for ((term, &own), slope) in self.iter().zip(own).zip(&mut slopes) {
            *slope = term.state_derivative(own, motion);
        }
        slopes
    }

    fn pace(&self, motion: &mut Motion) {
        self.iter().for_each(|term| term.pace(motion));
    }

    fn input_nonlinearity(&self, deviation: f64) -> f64 {
        self.iter().map(|term| term.input_nonlinearity(deviation)).sum()
    }

    fn output_nonlinearity(&self, deviation: f64) -> f64 {
        self.iter().map(|term| term.output_nonlinearity(deviation)).sum()
    }
}

impl IntegratedRotor {
    /// # Errors
    /// [`PlantError::RotorEffects`] with more terms than there is room for.
    pub(super) fn new(base: RotorBase, terms: Vec<Box<dyn IntegratedTerm>>) -> Result<Self, PlantError> {
        if terms.len() > MOST_TERMS {
            return Err(PlantError::RotorEffects { count: terms.len(), most: MOST_TERMS });
        }
        let linear_per_s = match &base {
            RotorBase::Linear(point) => 1.0 / point.lag.time_constant_s,
            RotorBase::Level(_) | RotorBase::Speed(_) => f64::NAN,
        };
        Ok(Self {
            rotor: RotorState {
                base,
                linear_per_s,
                step_part: STEP_PART,
                state: IntegratedState::default(),
                drive: 0.0,
            },
            terms,
        })
    }

    /// Lets steps be so many times as long.
    pub(super) fn lengthen_steps(&mut self, times: f64) {
        self.rotor.step_part = (times * self.rotor.step_part).min(SETTLED_PART);
    }

    /// Puts the rotor at rest: the command has been `command` for ever.
    pub(super) fn settle(&mut self, command: f64) {
        let rotor = &mut self.rotor;
        let mut motion = rotor.motion(command, command);
        for (term, own) in self.terms.iter().zip(&mut rotor.state.own) {
            *own = term.at_rest(&mut motion);
        }
        rotor.drive = command;
        rotor.state.speed = motion.drive;
        rotor.state.response = rotor.target(&self.terms[..], &motion);
    }

    pub(super) fn response(&self) -> f64 {
        self.rotor.output(&self.terms[..])
    }

    pub(super) fn memory(&self) -> Memory {
        // One of many levels may be slow at any of them.
        let RotorBase::Linear(point) = &self.rotor.base else { return Memory::Lasting };
        let own = self.terms.iter().map(|term| term.memory_s()).sum::<f64>();
        Memory::Seconds(MOST_SLOWED * MEMORY_TIME_CONSTANTS * point.lag.time_constant_s + own)
    }

    pub(super) fn equivalent_command(&self) -> f64 {
        self.rotor.state.speed
    }

    pub(super) fn supply_measurement(&self) -> Option<Supply> {
        let rotor = &self.rotor;
        let motion = rotor.motion(rotor.drive, rotor.state.speed);
        self.terms.iter().zip(&rotor.state.own).find_map(|(term, &own)| term.measured(own, &motion))
    }

    /// It piece by piece.
    pub(super) fn piecewise(&mut self) -> impl Rotates {
        With { rotor: &mut self.rotor, terms: &self.terms[..] }
    }

    /// Lets many pieces pass.
    pub(super) fn pass(&mut self, passage: &mut Passage) {
        match &self.terms[..] {
            [only] => only.pass_alone(&mut self.rotor, passage),
            several => self.rotor.pass(several, passage),
        }
    }
}

/// A rotor with its effects, which may be known when compiling.
struct With<'a, T: ?Sized> {
    rotor: &'a mut RotorState,
    terms: &'a T,
}

impl<T: Terms + ?Sized> Rotates for With<'_, T> {
    type Begin = Slopes;

    #[inline]
    fn begin(&mut self, piece: Segment) -> Slopes {
        self.rotor.derivative(self.terms, &self.rotor.state, piece.level)
    }

    #[inline]
    fn steps(&self, begin: &Slopes, piece: Segment, duration_s: f64) -> usize {
        self.rotor.steps(begin, piece, duration_s)
    }

    #[inline]
    fn advance(&mut self, begin: &Slopes, piece: Segment, span: (f64, f64)) -> Interval {
        self.rotor.advance(self.terms, begin, piece, span)
    }
}

impl RotorState {
    /// Lets many pieces pass, with these effects.
    pub(super) fn pass<T: Terms + ?Sized>(&mut self, terms: &T, passage: &mut Passage) {
        match &mut passage.wanted {
            Wanted::Intervals(intervals) => {
                intervals.take(&mut With { rotor: self, terms }, passage.from_s, passage.pieces);
            }
            Wanted::Readings(readings) => {
                let mut begin_s = passage.from_s;
                for piece in passage.pieces {
                    self.pass_piece(terms, begin_s, *piece, readings);
                    begin_s = piece.until_s;
                }
            }
        }
    }

    /// Lets `piece` pass, which begins at `from_s`. It is not stopped for readings.
    fn pass_piece<T: Terms + ?Sized>(&mut self, terms: &T, from_s: f64, piece: Segment, readings: &mut Readings) {
        let mut begin_s = from_s;
        while begin_s < piece.until_s {
            let left_s = piece.until_s - begin_s;
            let part = Segment { level: piece.level + piece.slope_per_s * (begin_s - from_s), ..piece };
            let begin = self.derivative(terms, &self.state, part.level);
            let count = self.steps(&begin, part, left_s);
            let end_s = if count == 1 { piece.until_s } else { begin_s + left_s / count as f64 };
            let step_s = end_s - begin_s;
            if readings.before(end_s).is_some() {
                // Between the ends of a step the response is the cubic through them, as good as the step itself.
                let interval = self.advance(terms, &begin, part, (begin_s, step_s));
                while let Some(moment_s) = readings.before(end_s) {
                    readings.take(interval.at(moment_s));
                }
            } else {
                self.step(terms, &begin, part, step_s);
            }
            if readings.moments_s.first().is_some_and(|moment_s| *moment_s <= end_s) {
                readings.take_end(end_s, self.output(terms));
            }
            begin_s = end_s;
        }
    }

    /// Into how many steps a piece of `duration_s` is cut, at the begin of which the state moves by `begin`.
    #[inline]
    fn steps(&self, begin: &Slopes, piece: Segment, duration_s: f64) -> usize {
        // A command at which the rotor is infinitely fast is no number of steps; a model with it is refused before.
        let time_constants = duration_s * begin.rate_per_s;
        if time_constants <= self.step_part {
            return 1;
        }
        // Chosen: 100 000 steps are 10 000 time constants; a piece in which the rotor is faster is settled in any case, and takes no
        // Chosen: 100 000 steps are 10 000 time constants in one piece; beyond, steps are longer, and the method holds up to 28 times that.
        ((time_constants / self.step_part(begin, piece)).ceil() as usize).clamp(1, 100_000)
    }

    /// The part of the time constant that a step may take from here on. An error of the method goes with the fifth power of it
    /// and with the way that is left.
    fn step_part(&self, begin: &Slopes, piece: Segment) -> f64 {
        if piece.slope_per_s != 0.0 {
            return self.step_part;
        }
        let Slopes { of, rate_per_s } = begin;
        let gain = self.base.at(piece.level).lag.gain.abs();
        let own = of.own.iter().fold(0.0_f64, |most, slope| most.max(slope.abs()));
        let left = of
            .speed
            .abs()
            .max((self.lagged().slope(self.state.response) * of.response).abs() / gain.max(f64::MIN_POSITIVE))
            .max(own)
            / rate_per_s;
        // What is not a number is far from settled.
        if left < SETTLED { (self.step_part * (SETTLED / left).powf(0.2)).min(SETTLED_PART) } else { self.step_part }
    }

    fn advance<T: Terms + ?Sized>(
        &mut self,
        terms: &T,
        begin: &Slopes,
        piece: Segment,
        (from_s, duration_s): (f64, f64),
    ) -> Interval {
        let (start, start_slope) = (self.output(terms), self.output_slope(terms, &begin.of));
        self.step(terms, begin, piece, duration_s);
        let slopes = self.derivative(terms, &self.state, self.drive);
        let (end, end_slope) = (self.output(terms), self.output_slope(terms, &slopes.of));
        Interval { from_s, duration_s, start, start_slope, end, end_slope }
    }

    /// Lets `duration_s` pass, at the begin of which the state moves by `begin`.
    #[inline(always)]
    fn step<T: Terms + ?Sized>(&mut self, terms: &T, begin: &Slopes, piece: Segment, duration_s: f64) {
        let command = |part: f64| piece.level + piece.slope_per_s * (part * duration_s);
        let count = terms.count().min(MOST_TERMS);
        let k1 = begin.of;
        let middle_s = 0.5 * duration_s;
        let k2 = self.derivative(terms, &self.along(&k1, middle_s, count), command(0.5)).of;
        let slopes = if duration_s * begin.rate_per_s <= SHORT_STEP {
            k2
        } else {
            let k3 = self.derivative(terms, &self.along(&k2, middle_s, count), command(0.5)).of;
            let k4 = self.derivative(terms, &self.along(&k3, duration_s, count), command(1.0)).of;
            let mean = |k1: f64, k2: f64, k3: f64, k4: f64| (k1 + 2.0 * (k2 + k3) + k4) * (1.0 / 6.0);
            IntegratedState {
                speed: mean(k1.speed, k2.speed, k3.speed, k4.speed),
                response: mean(k1.response, k2.response, k3.response, k4.response),
                own: std::array::from_fn(|of| mean(k1.own[of], k2.own[of], k3.own[of], k4.own[of])),
            }
        };
        self.state = self.along(&slopes, duration_s, count);
        self.drive = command(1.0);
    }

    /// The state after `duration_s` at these slopes, with so many states of effects.
    #[inline(always)]
    fn along(&self, slopes: &IntegratedState, duration_s: f64, count: usize) -> IntegratedState {
        let mut moved = IntegratedState {
            speed: self.state.speed + duration_s * slopes.speed,
            response: self.state.response + duration_s * slopes.response,
            ..IntegratedState::default()
        };
        for index in 0..count {
            moved.own[index] = self.state.own[index] + duration_s * slopes.own[index];
        }
        moved
    }

    #[inline(always)]
    fn motion(&self, command: f64, speed: f64) -> Motion {
        let rate_per_s = match &self.base {
            RotorBase::Linear(_) => self.linear_per_s,
            RotorBase::Level(curve) => 1.0 / curve.clamped_at(command).lag.time_constant_s,
            RotorBase::Speed(curve) => 1.0 / curve.clamped_at(speed).lag.time_constant_s,
        };
        Motion { drive: command, speed, anchor: self.base.anchor(command), rate_per_s }
    }

    #[inline(always)]
    fn target<T: Terms + ?Sized>(&self, terms: &T, motion: &Motion) -> f64 {
        let deviation = motion.drive - self.base.anchor(motion.drive);
        let bent = terms.input_nonlinearity(deviation);
        match &self.base {
            RotorBase::Linear(point) => point.response + point.lag.gain * (deviation + bent),
            RotorBase::Level(curve) | RotorBase::Speed(curve) => {
                let point = curve.clamped_at(motion.drive);
                self.lagged().at_response(point.response + point.lag.gain * bent)
            }
        }
    }

    /// What lags: one that follows the speed takes its response from that.
    #[inline(always)]
    fn lagged(&self) -> Lagged {
        match &self.base {
            RotorBase::Level(curve) => curve.lagged(),
            RotorBase::Linear(_) | RotorBase::Speed(_) => Lagged::Response,
        }
    }

    #[inline(always)]
    fn derivative<T: Terms + ?Sized>(&self, terms: &T, state: &IntegratedState, command: f64) -> Slopes {
        let mut motion = self.motion(command, state.speed);
        let own = terms.state_derivative(&state.own, &mut motion);
        terms.pace(&mut motion);
        let rate_per_s = motion.rate_per_s;
        let (speed, response) = (motion.drive - state.speed, self.target(terms, &motion) - state.response);
        Slopes { of: IntegratedState { speed: rate_per_s * speed, response: rate_per_s * response, own }, rate_per_s }
    }

    /// The response of the moment.
    fn output<T: Terms + ?Sized>(&self, terms: &T) -> f64 {
        let IntegratedState { speed, response, .. } = self.state;
        let deviation = speed - self.base.anchor(speed);
        let (response, bent) = match &self.base {
            RotorBase::Speed(curve) => (
                curve.steady_response(speed),
                terms.input_nonlinearity(deviation) + terms.output_nonlinearity(deviation),
            ),
            RotorBase::Linear(_) | RotorBase::Level(_) => {
                (self.lagged().response(response), terms.output_nonlinearity(deviation))
            }
        };
        if bent == 0.0 { response } else { response + self.base.at(speed).lag.gain * bent }
    }

    /// How fast the response moves where the state moves by `slopes`.
    fn output_slope<T: Terms + ?Sized>(&self, terms: &T, slopes: &IntegratedState) -> f64 {
        // The bend's slope by a central difference: exact for a parabola, and off by the square of the width for its cubic term.
        let speed = self.state.speed;
        let anchor = self.base.anchor(speed);
        let width = 1e-3;
        let is_of_speed = matches!(self.base, RotorBase::Speed(_));
        let bend = |speed: f64| {
            let deviation = speed - anchor;
            terms.output_nonlinearity(deviation) + if is_of_speed { terms.input_nonlinearity(deviation) } else { 0.0 }
        };
        let bent = (bend(speed + width) - bend(speed - width)) / (2.0 * width);
        if is_of_speed {
            return self.base.at(speed).lag.gain * (1.0 + bent) * slopes.speed;
        }
        let response = self.lagged().slope(self.state.response) * slopes.response;
        if bent == 0.0 { response } else { response + self.base.at(speed).lag.gain * bent * slopes.speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalog;
    use crate::testing::{active, actuator};

    #[test]
    fn short_steps_err_no_more_than_they_say() {
        // With tau as one over the speed a step from 0.5 to u is logistic: x = u / (1 + (u / 0.5 - 1) e^(-u t / (0.5 tau))).
        let kind = Catalog::standard().find("operating_point_lag").unwrap();
        let mut actuator = actuator(&[active(kind, &[1.0])]);
        let (tick_s, tau_s, u) = (2e-4, 0.1, 0.2);
        assert!(tick_s / tau_s <= SHORT_STEP);
        let worst = (1..=2500_u32).map(|tick| {
            let time_s = f64::from(tick) * tick_s;
            actuator.advance(u, time_s);
            let x = u / (1.0 + (u / 0.5 - 1.0) * (-u * time_s / (0.5 * tau_s)).exp());
            (actuator.equivalent_command() - x).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        // Of the way of 0.3; and a step that errs less was none of the midpoint rule.
        let claimed = 0.3 * SHORT_STEP.powi(2) / 6.0;
        assert!(worst < claimed && worst > 0.01 * claimed, "{worst:e} for {claimed:e}");
    }
}
