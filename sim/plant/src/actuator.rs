//! The whole simulated actuator: the chain from the command to the response.

mod passing;

use super::effect::{ActiveEffect, Part, Site};
use super::filter::MEMORY_TIME_CONSTANTS;
use super::integrated::{IntegratedRotor, IntegratedTerm};
use super::passage::cut;
use super::{
    CommandStage, EscFrame, FirstOrder, Interval, Memory, Model, OperatingCurve, OperatingPoint, PlantError,
    ResponseStage, RotorBase, Segment, Supply, TransportDelay,
};

/// A response that later stages have to follow is cut into pieces of this part of the time in which it bends. Derived: the cubic through
/// the ends of a piece is then off by less than `0.1^4 / 384`, 3e-7, of it.
const PIECE_PART: f64 = 0.1;
/// No piece is shorter than this, s. Derived: what bends faster has settled within it. Where the slope of a response jumps, the cubic is
/// off by less than the jump times this, for that long; the next stage gathers of it the jump times `LEAST_PIECE_S^2 / 12`, 2e-10 s^2,
/// times its own frequency.
const LEAST_PIECE_S: f64 = 5e-5;

/// A simulated actuator: command -> stages in order -> rotor -> stages in order.
///
/// Physical order of the chain: clip, quantize, dead band, backlash, slew, frame hold, delay; supply, static map, rotor lag;
/// inflow, stand, sensor, logger. What a model says nothing of is not there. Noise is added by whoever logs the response.
///
/// A chain of linear links is exact: commands are straight in pieces, and so each piece has a closed form. Where the rotor
/// itself is changed it is integrated, to about a millionth in a time constant.
pub struct Actuator {
    stages: Vec<Box<dyn CommandStage>>,
    rotor: Rotor,
    after: Vec<Box<dyn ResponseStage>>,
    /// Longest piece that the stages after the rotor can take.
    longest_s: f64,
    /// What the last of them gave.
    output: f64,
    time_s: f64,
    record_start_s: f64,
    clock: f64,
}

/// The lag in its two forms.
enum Rotor {
    /// In closed form.
    Exact(FirstOrder),
    /// In steps.
    Integrated(IntegratedRotor),
}

/// How the actuator takes over commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EscTiming {
    /// Rate of the ESC's frames in hertz; `None`: it takes over a command at once.
    pub frame_hz: Option<f64>,
    /// Where in a frame time 0 is, 0..1: the first frame starts this part of a frame later.
    pub frame_phase: f64,
}

/// Which of the two first-order plants the rotor is; [`FirstOrder`] says when to use which.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Linear around the nominal command.
    LinearAround(f64),
    /// Gain and time constant of the level; the dead time is that at the given command, for ever.
    FollowingLevel(f64),
    /// Gain and time constant of the rotor's own speed, as a command; the dead time is that at the given command, for ever. The
    /// one for commands that are far from what the rotor does, as those of an inverse are.
    FollowingSpeed(f64),
}

impl Actuator {
    /// The actuator that `model` describes, with its effects, at rest at the command that `law` names, at time 0.
    ///
    /// # Errors
    /// [`PlantError`] when the model, the frame rate or its phase are impossible, or when the model has no points
    /// around the nominal command.
    pub fn new(model: &Model, law: Law, timing: EscTiming) -> Result<Self, PlantError> {
        let effects = ActiveEffect::from_model(model)?;
        match law {
            Law::LinearAround(nominal) => {
                Self::with_effects(OperatingCurve::around_without_effects(model, nominal)?, &effects, timing)
            }
            Law::FollowingLevel(command) => {
                Self::following_level(OperatingCurve::without_effects(model)?, command, &effects, timing)
            }
            Law::FollowingSpeed(command) => {
                let curve = OperatingCurve::without_effects(model)?;
                let delay_s = curve.clamped_at(command).lag.delay_s;
                Self::chain(RotorBase::Speed(curve), command, delay_s, &effects, timing)
            }
        }
    }

    /// The actuator that is linear with the numbers of `point`, at rest there, at time 0. The point's time constant must
    /// be above 0.
    ///
    /// # Errors
    /// [`PlantError`] when the delay, the frame rate or its phase are impossible.
    pub fn linear(point: OperatingPoint, timing: EscTiming) -> Result<Self, PlantError> {
        Self::with_effects(point, &[], timing)
    }

    /// [`Actuator::linear`] with effects, which come in the order of the catalog ([`Catalog::sort`](super::Catalog::sort)).
    ///
    /// # Errors
    /// Those of [`Actuator::linear`], and [`PlantError::RotorEffects`].
    pub fn with_effects(
        point: OperatingPoint,
        effects: &[ActiveEffect],
        timing: EscTiming,
    ) -> Result<Self, PlantError> {
        Self::chain(RotorBase::Linear(point), point.nominal, point.lag.delay_s, effects, timing)
    }

    /// The actuator whose gain and time constant are those of the level, at rest at `command`, with effects in the order of
    /// the catalog. Its dead time is that at `command`.
    ///
    /// # Errors
    /// Those of [`Actuator::with_effects`].
    pub fn following_level(
        curve: OperatingCurve,
        command: f64,
        effects: &[ActiveEffect],
        timing: EscTiming,
    ) -> Result<Self, PlantError> {
        let delay_s = curve.clamped_at(command).lag.delay_s;
        Self::chain(RotorBase::Level(curve), command, delay_s, effects, timing)
    }

    fn chain(
        mut base: RotorBase,
        start: f64,
        delay_s: f64,
        effects: &[ActiveEffect],
        timing: EscTiming,
    ) -> Result<Self, PlantError> {
        let mut links = Links::default();
        let frame = timing.frame_hz.map(|frame_hz| EscFrame::new(frame_hz, timing.frame_phase)).transpose()?;
        let delay = (delay_s > 0.0).then(|| TransportDelay::new(delay_s)).transpose()?;
        // Frames and dead time of the base come ahead of the first effect behind them.
        let ahead = effects.iter().take_while(|effect| effect.kind().site <= Site::Command).count();
        let (before, behind) = effects.split_at(ahead);
        before.iter().for_each(|effect| links.add(effect.part(&base), &mut base));
        links.stages.extend(frame.map(|frame| Box::new(frame) as Box<dyn CommandStage>));
        links.stages.extend(delay.map(|delay| Box::new(delay) as Box<dyn CommandStage>));
        behind.iter().for_each(|effect| links.add(effect.part(&base), &mut base));

        let ramps = links.stages.iter().any(|stage| stage.makes_ramps());
        let exact = match &base {
            RotorBase::Linear(_) => links.terms.is_empty(),
            RotorBase::Level(_) => links.terms.is_empty() && !ramps,
            RotorBase::Speed(_) => false,
        };
        let tau_s = base.at(start).lag.time_constant_s;
        let rotor = if exact {
            Rotor::Exact(FirstOrder::from_base(base, start))
        } else {
            Rotor::Integrated(IntegratedRotor::new(base, links.terms)?)
        };
        let followed = links.after.iter().rev().skip(1).map(|stage| stage.time_scale_s());
        let bends_s = followed.fold(if links.after.is_empty() { f64::INFINITY } else { tau_s }, f64::min);
        let mut actuator = Self {
            stages: links.stages,
            rotor,
            after: links.after,
            longest_s: (PIECE_PART * bends_s).max(LEAST_PIECE_S),
            output: 0.0,
            time_s: 0.0,
            record_start_s: 0.0,
            clock: 1.0 + links.skew,
        };
        actuator.settle(start);
        Ok(actuator)
    }

    /// The same in steps that are so many times as long, for comparisons with what is known less well: the error of a step grows with
    /// the fifth power, from less than a millionth. A chain in closed form has no steps.
    #[must_use]
    pub fn in_longer_steps(mut self, times: f64) -> Self {
        if let Rotor::Integrated(rotor) = &mut self.rotor {
            rotor.lengthen_steps(times);
        }
        self.longest_s *= times;
        self
    }

    /// Puts everything at rest: the command has been `command` for ever. The clock goes on.
    pub fn settle(&mut self, command: f64) {
        // What a clip or a grid makes of the command is what the links behind it rest at.
        let level = self.stages.iter_mut().fold(command, |level, stage| stage.settle(level));
        self.rotor.settle(level);
        self.output = self.after.iter_mut().fold(self.rotor.response(), |output, stage| stage.settle(output));
    }

    /// Sets the clock before anything happens, for a run that is to begin before time 0, seconds.
    pub fn begin_at(&mut self, time_s: f64) {
        self.time_s = time_s;
    }

    /// The time of the moment, seconds.
    pub(super) fn now_s(&self) -> f64 {
        self.time_s
    }

    /// A record begins now: its first row is taken at this moment. Drift counts from here, and so does the logger's clock.
    pub fn start_record(&mut self) {
        self.record_start_s = self.time_s;
        self.after.iter_mut().for_each(|stage| stage.start_record(self.time_s));
    }

    /// When a row is taken that the logger stamps `row_s`, seconds from the record's first row. On one clock it is
    /// `start + row_s`.
    #[must_use]
    pub fn moment_of_row(&self, row_s: f64) -> f64 {
        if self.clock == 1.0 { self.record_start_s + row_s } else { self.record_start_s + row_s * self.clock }
    }

    /// Whether rows are taken by another clock than the commands'.
    #[must_use]
    pub fn has_own_clock(&self) -> bool {
        self.clock != 1.0
    }

    /// For how long what was shows in the response.
    pub fn memory(&self) -> Memory {
        let stages = self.stages.iter().map(|stage| stage.memory());
        let after = self.after.iter().map(|stage| stage.memory());
        stages.chain(after).fold(self.rotor.memory(), Memory::and)
    }

    /// How long a command of the past shows that nothing keeps; `None` where the response to a command that repeats every
    /// `period_s` need not come to repeat, rows being stamped by the commands' clock.
    pub(super) fn fades_in_s(&self, period_s: f64) -> Option<f64> {
        let changes = self.stages.iter().any(|stage| stage.changes_after(period_s))
            || self.after.iter().any(|stage| stage.changes())
            || self.has_own_clock();
        let stages = self.stages.iter().map(|stage| stage.memory());
        let after = self.after.iter().map(|stage| stage.memory());
        let behind = after.fold(self.rotor.memory(), Memory::and);
        match behind {
            Memory::Seconds(behind_s) if !changes => Some(behind_s + stages.map(Memory::fades_in_s).sum::<f64>()),
            _ => None,
        }
    }

    /// The levels that stages keep of the past, whatever fades: where these are the same, so is what comes of the same commands.
    /// `None` where a stage keeps something and does not say what.
    pub(super) fn kept(&self) -> Option<Vec<f64>> {
        let keeping = self.stages.iter().filter(|stage| !matches!(stage.memory(), Memory::Seconds(_)));
        keeping.map(|stage| stage.kept(self.time_s)).collect()
    }

    /// Holds `command` (0..1) from now until `until_s`.
    #[inline]
    pub fn advance(&mut self, command: f64, until_s: f64) {
        while self.time_s < until_s {
            let mut piece = Segment::constant(command, until_s);
            for stage in &mut self.stages {
                piece = stage.advance(self.time_s, piece);
            }
            match &mut self.rotor {
                // The plain chain, which is most of what is simulated.
                Rotor::Exact(lag) if piece.slope_per_s == 0.0 && self.after.is_empty() => {
                    lag.advance(piece.level, piece.until_s - self.time_s);
                    self.output = lag.response();
                }
                _ => self.follow(piece),
            }
            self.time_s = piece.until_s;
        }
    }

    /// A piece of the command, in as many pieces as rotor and stages behind it need.
    fn follow(&mut self, piece: Segment) {
        let span = (self.time_s, piece.until_s - self.time_s);
        let take = |mut signal: Interval| {
            self.after.iter_mut().for_each(|stage| stage.advance(&mut signal));
            self.output = signal.end;
        };
        match &mut self.rotor {
            Rotor::Exact(lag) => cut(lag, self.longest_s, span, piece, take),
            Rotor::Integrated(rotor) => cut(&mut rotor.piecewise(), self.longest_s, span, piece, take),
        }
    }

    /// The response of the moment, without noise: newtons or revolutions per minute, as the model has it.
    #[inline]
    #[must_use]
    pub fn response(&self) -> f64 {
        self.output
    }

    /// The rotor's speed as the command that would keep it there: what a speed sensor shows, up to its unit. Sensors and
    /// stand do not come between.
    #[must_use]
    pub fn equivalent_command(&self) -> f64 {
        match &self.rotor {
            Rotor::Exact(lag) => lag.equivalent_command(),
            Rotor::Integrated(rotor) => rotor.equivalent_command(),
        }
    }

    /// Voltage and current, where an effect says them.
    #[must_use]
    pub fn supply_measurement(&self) -> Option<Supply> {
        match &self.rotor {
            Rotor::Exact(_) => None,
            Rotor::Integrated(rotor) => rotor.supply_measurement(),
        }
    }
}

/// The links that effects are, sorted by where they act.
#[derive(Default)]
struct Links {
    stages: Vec<Box<dyn CommandStage>>,
    terms: Vec<Box<dyn IntegratedTerm>>,
    after: Vec<Box<dyn ResponseStage>>,
    skew: f64,
}

impl Links {
    fn add(&mut self, part: Part, base: &mut RotorBase) {
        match part {
            Part::Nothing => {}
            Part::Base { gain, time_constant } => base.scale(gain, time_constant),
            Part::Command(stage) => self.stages.push(stage),
            Part::Rotor(term) => self.terms.push(term),
            Part::Response(stage) => self.after.push(stage),
            Part::Clock { skew } => self.skew += skew,
        }
    }
}

impl Rotor {
    fn settle(&mut self, level: f64) {
        match self {
            Self::Exact(lag) => lag.settle(level),
            Self::Integrated(rotor) => rotor.settle(level),
        }
    }

    fn response(&self) -> f64 {
        match self {
            Self::Exact(lag) => lag.response(),
            Self::Integrated(rotor) => rotor.response(),
        }
    }

    fn memory(&self) -> Memory {
        match self {
            // One of many levels may be slow at any of them.
            Self::Exact(lag) => {
                lag.time_constant_s().map_or(Memory::Lasting, |tau_s| Memory::Seconds(MEMORY_TIME_CONSTANTS * tau_s))
            }
            Self::Integrated(rotor) => rotor.memory(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalog;
    use crate::testing::{self, active, model};

    /// The response at every tick to a step from 0.5 to 0.6 at time 0.
    fn step(delay_s: f64, timing: EscTiming) -> Vec<f64> {
        let one = model(&[(0.5, 10.0, 0.1, delay_s)]);
        let mut actuator = Actuator::new(&one, Law::LinearAround(0.5), timing).unwrap();
        (1..=5000_u32)
            .map(|tick| {
                actuator.advance(0.6, f64::from(tick) / 5000.0);
                actuator.response()
            })
            .collect()
    }

    fn worst_deviation(responses: &[f64], dead_s: f64) -> f64 {
        (1_u32..).zip(responses).fold(0.0, |worst, (tick, &y)| {
            let since_s = (f64::from(tick) / 5000.0 - dead_s).max(0.0);
            worst.max((y - (1.0 - (-since_s / 0.1).exp())).abs())
        })
    }

    #[test]
    fn a_stage_far_quicker_than_the_rows_leaves_the_next_one_as_it_is() {
        let catalog = Catalog::standard();
        let effect = |id: &str, values: &[f64]| active(catalog.find(id).unwrap(), values);
        let resonance = effect("stand_resonance", &[1.0, 30.0, 0.05]);
        let alone = testing::step(0.1, 0.5, std::slice::from_ref(&resonance));
        for time_constant_s in [1e-9, 1e-6, 1e-5] {
            let pole = effect("second_pole", &[time_constant_s]);
            let both = testing::step(0.1, 0.5, &[pole, resonance.clone()]);
            // A quick pole is a delay of its time constant. The lag is no steeper than 10 per second, and the mode adds as much at
            // most; of the jump of that slope at the step it gathers what pieces leave, at 2 pi 30 rad/s.
            let of_pieces = 10.0 * LEAST_PIECE_S.powi(2) / 12.0 * std::f64::consts::TAU * 30.0;
            let worst = both.iter().zip(&alone).fold(0.0_f64, |worst, (both, alone)| worst.max((both - alone).abs()));
            assert!(worst < 20.0 * time_constant_s + of_pieces, "{time_constant_s} s: {worst:e}");
        }
    }

    #[test]
    fn a_delayed_step_follows_the_analytic_response_to_1e_12_for_delays_between_ticks_too() {
        for delay_s in [0.0, 1e-4, 0.000_2, 0.003_217_9, 0.025] {
            let worst = worst_deviation(&step(delay_s, EscTiming::default()), delay_s);
            assert!(worst < 1e-12, "off by {worst:e} with a delay of {delay_s} s");
        }
    }

    /// Against the equation itself in steps a hundredth as long.
    #[test]
    fn a_rotor_that_follows_its_speed_has_the_time_constant_and_the_response_of_it() {
        let curve = OperatingCurve::new(&testing::table_1()).unwrap();
        let law = Law::FollowingSpeed(0.4);
        let mut actuator = Actuator::new(&testing::table_1(), law, EscTiming::default()).unwrap();
        let (mut v, mut worst) = (0.4, 0.0_f64);
        for tick in 1..=5000_u32 {
            let u = if tick < 1000 { 0.9 } else { 0.45 };
            for _ in 0..100 {
                v += 2e-6 * (u - v) / curve.clamped_at(v).lag.time_constant_s;
            }
            actuator.advance(u, f64::from(tick) * 2e-4);
            worst = worst.max((actuator.equivalent_command() - v).abs());
            assert!((actuator.response() - curve.steady_response(actuator.equivalent_command())).abs() < 1e-12);
        }
        assert!(worst < 2e-5, "{worst:e}");
        // Small signals see the linear rotor.
        let tenth = 0.1 * testing::table_1().points[2].time_constant_s;
        let mut linear = Actuator::new(&testing::table_1(), Law::LinearAround(0.5), EscTiming::default()).unwrap();
        let mut following = Actuator::new(&testing::table_1(), Law::FollowingSpeed(0.5), EscTiming::default()).unwrap();
        let start = (linear.response(), following.response());
        for actuator in [&mut linear, &mut following] {
            actuator.advance(0.5001, tenth);
        }
        let ratio = (following.response() - start.1) / (linear.response() - start.0);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    }

    #[test]
    fn a_step_waits_for_the_frame_and_then_for_the_delay() {
        // A phase of 0.75: the frame starts 1.25 ms after the step.
        let timing = EscTiming { frame_hz: Some(600.0), frame_phase: 0.75 };
        for delay_s in [0.0, 0.003_3] {
            let worst = worst_deviation(&step(delay_s, timing), delay_s + 0.75 / 600.0);
            assert!(worst < 1e-12, "off by {worst:e} with a delay of {delay_s} s");
        }
    }
}
