//! What happens to a controller and what must come of it, written once, and the targets that can play it.
//!
//! A [`Scenario`] is a function over a [`Target`]: it has the target play what it needs, judges what came of it, and ends with
//! a figure, or with what is wrong. The same function judges the library on a board in memory and the images in their
//! emulators. A target that lacks something which a scenario needs says what ([`Miss::Cannot`]). The controls of a scenario
//! spoil what is played, and must make it fail.
//!
//! Time is in cycles of 125 MHz since the reset, as in [`pins`].

mod mocks;
mod rp2040;
mod stm32;
pub mod table;

use emulator::rp2040::Edge;
use rotorlead::dshot::Speed;
use rotorlead::link::{Faults, Message, Request};
use rotorlead::settings::Settings;

pub use mocks::Mocks;
pub use rp2040::Rp2040;
pub use stm32::Stm32;

use crate::pins::{self, INPUT_1, JUMPER, LED, OUTPUT_1, Pulse, us};

/// When every target runs: the start takes 208 ms with a lead.
pub const STARTED: u64 = 37_500_000;
/// When the lines of a flight controller begin.
pub const LINES_BEGIN: u64 = 62_500;

/// What happens to a controller from its reset on.
#[derive(Clone, Debug)]
pub struct Play {
    /// The settings in its flash; `None` where nobody has chosen any.
    pub settings: Option<Settings>,
    /// Edges at the inputs and at the jumper, which are pins of the RP2040: [`INPUT_1`], [`JUMPER`]. The jumper is not fitted
    /// until its pin is low.
    pub edges: Vec<Edge>,
    /// Counts of the thrust sensor's converter, each from a time on.
    pub thrust: Vec<(u64, u16)>,
    /// What the host asks, and when, in order.
    pub requests: Vec<(u64, Request)>,
    /// When it is over.
    pub end: u64,
}

impl Play {
    /// A controller with these settings, to which nothing happens.
    #[must_use]
    pub fn new(settings: &Settings, end: u64) -> Self {
        Self { settings: Some(settings.clone()), ..Self::without_settings(end) }
    }

    /// A controller on which nobody has set anything.
    #[must_use]
    pub const fn without_settings(end: u64) -> Self {
        Self { settings: None, edges: Vec::new(), thrust: Vec::new(), requests: Vec::new(), end }
    }

    /// The jumper is fitted, or pulled out.
    pub fn fit_jumper(&mut self, cycle: u64, is_fitted: bool) {
        self.edges.push(Edge { cycle, pin: JUMPER, is_high: !is_fitted });
    }

    /// A line that has this level from some time on.
    pub fn stick(&mut self, motor: u8, cycle: u64, is_high: bool) {
        self.edges.push(Edge { cycle, pin: INPUT_1 + motor, is_high });
    }

    /// Pulses at an input, one in `period` up to `end`: `width_us` gives each by its number.
    pub fn pulses(&mut self, motor: u8, period: u64, end: u64, width_us: impl Fn(u64) -> f64) {
        let width = |n| us(width_us(n));
        self.edges.extend(pins::pulses(INPUT_1 + motor, LINES_BEGIN, period, end, width));
    }

    /// Frames of DShot at an input, one in `period` up to shortly before the end: `bits` gives each by its number, or none.
    pub fn frames(&mut self, motor: u8, speed: Speed, period: u64, bits: impl Fn(u64) -> Option<u16>) {
        let starts = (LINES_BEGIN..self.end - us(200.0)).step_by(period as usize);
        let frames = (0..).zip(starts).filter_map(|(n, start)| Some((start, bits(n)?)));
        self.edges.extend(pins::frames(INPUT_1 + motor, speed, frames));
    }

    /// The host asks something.
    pub fn ask(&mut self, cycle: u64, request: Request) {
        self.requests.push((cycle, request));
    }
}

/// Number of the first pulse or frame that begins when every target runs.
#[must_use]
pub const fn first_after_start(period: u64) -> u64 {
    STARTED.div_ceil(period)
}

/// What was seen at the outputs.
enum Outputs {
    /// Every edge, true to so many cycles; pins are numbered as those of the RP2040.
    Edges { edges: Vec<Edge>, true_to_cycles: f64 },
    /// Widths of the pulses in microseconds, as they stood in the registers after each answer.
    Registers(Vec<[f64; 4]>),
}

/// What came of a play.
pub struct Outcome {
    outputs: Outputs,
    /// What the controller has said, in order.
    pub answers: Vec<Message>,
    /// When the play was over.
    end: u64,
}

impl Outcome {
    fn edges_on(&self, pin: u8) -> Result<impl Iterator<Item = Edge> + Clone, Miss> {
        let Outputs::Edges { edges, .. } = &self.outputs else { return Err(Miss::Cannot("no pins")) };
        Ok(edges.iter().copied().filter(move |edge| edge.pin == pin))
    }

    /// The whole pulses of an output.
    ///
    /// # Errors
    /// Where the target has no pins.
    pub fn pulses(&self, motor: u8) -> Result<Vec<Pulse>, Miss> {
        Ok(pins::pulses_in(self.edges_on(OUTPUT_1 + motor)?))
    }

    /// What an output has sent as frames of DShot: when each began, and its bits.
    ///
    /// # Errors
    /// Where the target has no pins, or something else was sent.
    pub fn frames(&self, motor: u8, speed: Speed) -> Result<Vec<(u64, u16)>, Miss> {
        let Outputs::Edges { true_to_cycles, .. } = self.outputs else { return Err(Miss::Cannot("no pins")) };
        let edges = self.edges_on(OUTPUT_1 + motor)?;
        pins::frames_in(edges, self.end, speed, true_to_cycles)
            .map_err(|problem| Miss::Wrong(format!("output {motor}: {problem}")))
    }

    /// The times at which the lamp went on.
    ///
    /// # Errors
    /// Where the target has no pins.
    pub fn flashes(&self) -> Result<Vec<u64>, Miss> {
        Ok(self.edges_on(LED)?.filter(|edge| edge.is_high).map(|edge| edge.cycle).collect())
    }

    /// Wrong where one of these outputs ever was high.
    ///
    /// # Errors
    /// As it says.
    pub fn hold_low(&self, motors: impl IntoIterator<Item = u8>) -> Result<(), Miss> {
        for motor in motors {
            let highs = match &self.outputs {
                Outputs::Edges { .. } => self.edges_on(OUTPUT_1 + motor)?.filter(|edge| edge.is_high).count(),
                Outputs::Registers(widths) => widths.iter().filter(|widths| widths[usize::from(motor)] > 0.0).count(),
            };
            hold(highs == 0, || format!("output {motor} goes high {highs} times"))?;
        }
        Ok(())
    }

    /// The last whole pulse of an output, microseconds; 0 where there was none.
    #[must_use]
    pub fn last_width_us(&self, motor: u8) -> f64 {
        match &self.outputs {
            Outputs::Edges { edges, .. } => {
                let edges = edges.iter().copied().filter(|edge| edge.pin == OUTPUT_1 + motor);
                pins::pulses_in(edges).last().map_or(0.0, |pulse| pulse.width as f64 / us(1.0) as f64)
            }
            Outputs::Registers(widths) => widths.last().map_or(0.0, |widths| widths[usize::from(motor)]),
        }
    }

    /// The faults that the controller said last.
    ///
    /// # Errors
    /// Where it said none.
    pub fn faults(&self) -> Result<Faults, Miss> {
        let faults = |message: &Message| if let Message::Faults(faults) = message { Some(*faults) } else { None };
        let last = self.answers.iter().rev().find_map(faults);
        last.ok_or_else(|| Miss::Wrong(format!("no faults among {:?}", self.answers)))
    }
}

/// Why a scenario is not proven.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Miss {
    /// The target lacks this, in a word or two.
    Cannot(&'static str),
    /// It is not so, in words for a person.
    Wrong(String),
}

/// Wrong unless it holds.
///
/// # Errors
/// [`Miss::Wrong`].
pub fn hold(holds: bool, what: impl FnOnce() -> String) -> Result<(), Miss> {
    if holds { Ok(()) } else { Err(Miss::Wrong(what())) }
}

/// What can play.
pub trait Target: Sync {
    /// Its name in the table.
    fn column(&self) -> table::Column;

    /// Plays.
    ///
    /// # Errors
    /// [`Miss::Cannot`] where it lacks what the play needs, and [`Miss::Wrong`] where the controller broke down.
    fn play(&self, play: &Play) -> Result<Outcome, Miss>;
}

/// What a scenario comes to: a figure, or `yes`.
pub type Proof = Result<String, Miss>;

/// Spoils what is played.
pub type Spoil = fn(&mut Play);

/// What must hold of every controller.
#[derive(Clone, Copy)]
pub struct Scenario {
    /// Its row in the table.
    pub name: &'static str,
    /// Plays and judges.
    pub prove: fn(&dyn Target) -> Proof,
    /// What spoils the play, each in words, so that it must fail.
    pub controls: &'static [(&'static str, Spoil)],
}

/// A target that plays something else than it was asked for.
pub struct Spoiled<'a> {
    /// What plays.
    pub target: &'a dyn Target,
    /// What is done to the play.
    pub spoil: Spoil,
}

impl Target for Spoiled<'_> {
    fn column(&self) -> table::Column {
        self.target.column()
    }

    fn play(&self, play: &Play) -> Result<Outcome, Miss> {
        let mut play = play.clone();
        (self.spoil)(&mut play);
        self.target.play(&play)
    }
}

/// That it is so, for a row without a figure.
///
/// # Errors
/// Never: this ends a proof.
pub fn yes() -> Proof {
    Ok("yes".to_owned())
}
