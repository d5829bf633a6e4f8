//! The whole simulated actuator: the chain from the command to the response.

use super::{CommandStage, EscFrame, FirstOrder, Model, OperatingCurve, OperatingPoint, PlantError, TransportDelay};

/// A simulated actuator: command -> stages in order -> rotor lag.
///
/// Physical order of the stages, of which this has the last two now: clip, quantize, dead band, backlash, slew, frame
/// hold, delay. What acts on the response (noise) is added by whoever logs it.
pub struct Actuator {
    stages: Vec<Box<dyn CommandStage>>,
    rotor: FirstOrder,
    time_s: f64,
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
}

impl Actuator {
    /// The actuator that `model` describes, at rest at the command that `law` names, at time 0.
    ///
    /// # Errors
    /// [`PlantError`] when the model, the frame rate or its phase are impossible, or when the model has no points
    /// around the nominal command.
    pub fn new(model: &Model, law: Law, timing: EscTiming) -> Result<Self, PlantError> {
        match law {
            Law::LinearAround(nominal) => Self::linear(OperatingCurve::around(model, nominal)?, timing),
            Law::FollowingLevel(command) => {
                let delay_s = OperatingCurve::new(model)?.clamped_at(command).lag.delay_s;
                Self::chain(FirstOrder::over_range(model, command)?, command, delay_s, timing)
            }
        }
    }

    /// The actuator that is linear with the numbers of `point`, at rest there, at time 0. The point's time constant must
    /// be above 0.
    ///
    /// # Errors
    /// [`PlantError`] when the delay, the frame rate or its phase are impossible.
    pub fn linear(point: OperatingPoint, timing: EscTiming) -> Result<Self, PlantError> {
        Self::chain(FirstOrder::linear(point), point.nominal, point.lag.delay_s, timing)
    }

    fn chain(rotor: FirstOrder, start: f64, delay_s: f64, timing: EscTiming) -> Result<Self, PlantError> {
        let mut stages: Vec<Box<dyn CommandStage>> = Vec::new();
        if let Some(frame_hz) = timing.frame_hz {
            stages.push(Box::new(EscFrame::new(frame_hz, timing.frame_phase)?));
        }
        if delay_s > 0.0 {
            stages.push(Box::new(TransportDelay::new(delay_s)?));
        }
        let mut actuator = Self { stages, rotor, time_s: 0.0 };
        actuator.settle(start);
        Ok(actuator)
    }

    /// Puts everything at rest: the command has been `command` for ever. The clock goes on.
    pub fn settle(&mut self, command: f64) {
        for stage in &mut self.stages {
            stage.settle(command);
        }
        self.rotor.settle(command);
    }

    /// Holds `command` (0..1) from now until `until_s`.
    #[inline]
    pub fn advance(&mut self, command: f64, until_s: f64) {
        while self.time_s < until_s {
            let (mut level, mut end_s) = (command, until_s);
            for stage in &mut self.stages {
                let segment = stage.advance(self.time_s, end_s, level);
                (level, end_s) = (segment.level, segment.until_s);
            }
            self.rotor.advance(level, end_s - self.time_s);
            self.time_s = end_s;
        }
    }

    /// The response of the moment, without noise: newtons or revolutions per minute, as the model has it.
    #[inline]
    #[must_use]
    pub fn response(&self) -> f64 {
        self.rotor.response()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::testing::model;

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
    fn a_delayed_step_follows_the_analytic_response_to_1e_12_for_delays_between_ticks_too() {
        for delay_s in [0.0, 1e-4, 0.000_2, 0.003_217_9, 0.025] {
            let worst = worst_deviation(&step(delay_s, EscTiming::default()), delay_s);
            assert!(worst < 1e-12, "off by {worst:e} with a delay of {delay_s} s");
        }
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
