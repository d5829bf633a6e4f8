//! What every link between the command and the rotor has in common.

/// A level that moves in a straight line, or not at all, until a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The level at its begin, as a command 0..1.
    pub level: f64,
    /// How fast it moves, command per second: 0 but behind a limit of the slew rate, and where the command itself is a line.
    pub slope_per_s: f64,
    /// Up to when it holds, seconds.
    pub until_s: f64,
}

impl Segment {
    /// A level that stays.
    #[must_use]
    pub fn constant(level: f64, until_s: f64) -> Self {
        Self { level, slope_per_s: 0.0, until_s }
    }

    /// Comes after `others`, as a part of the last one where the level stays.
    #[inline]
    pub(super) fn join(self, others: &mut Vec<Self>) {
        match others.last_mut() {
            Some(last) if last.level == self.level && last.slope_per_s == 0.0 && self.slope_per_s == 0.0 => {
                last.until_s = self.until_s;
            }
            _ => others.push(self),
        }
    }

    /// The same with many levels that stay.
    #[inline]
    pub(super) fn join_all(levels: impl Iterator<Item = Self>, others: &mut Vec<Self>) {
        let mut last = others.pop();
        for piece in levels {
            match &mut last {
                Some(last) if last.level == piece.level && last.slope_per_s == 0.0 => last.until_s = piece.until_s,
                _ => others.extend(last.replace(piece)),
            }
        }
        others.extend(last);
    }
}

/// For how long what a link was given shows in what it gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Memory {
    /// After so many seconds nothing is left, or less than 1e-6 of it.
    Seconds(f64),
    /// It knows the last turning points: what came before a whole period, and so many seconds, is forgotten.
    TurningPoints(f64),
    /// The begin may show for ever.
    Lasting,
}

impl Memory {
    /// How long what was shows beside what is kept, seconds.
    #[must_use]
    pub fn fades_in_s(self) -> f64 {
        match self {
            Self::Seconds(memory_s) | Self::TurningPoints(memory_s) => memory_s,
            Self::Lasting => 0.0,
        }
    }

    /// That of two links, one behind the other.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Lasting, _) | (_, Self::Lasting) => Self::Lasting,
            (Self::Seconds(one), Self::Seconds(other)) => Self::Seconds(one + other),
            // After one period all of them are what they are in every other.
            (Self::Seconds(one) | Self::TurningPoints(one), Self::Seconds(other) | Self::TurningPoints(other)) => {
                Self::TurningPoints(one + other)
            }
        }
    }
}

/// One link between command and rotor. It takes a command that is straight in pieces and gives one.
///
/// The caller asks for one piece at a time: "the input is this piece, which begins at `from_s`; what is the output at
/// `from_s`, how fast does it move, and how long does that stay so?" The next question comes from where the answer ended, or
/// from before that when a later stage cut the piece shorter, with the same input or another. So changes fall where they
/// belong, between the ticks of the control loop too: the piece that one gives is the question to the next. Many pieces go
/// from stage to stage at a time by [`CommandStage::pass`].
///
/// What puts levels to others at once holds that of a piece's begin: it is for commands that hold.
pub trait CommandStage: Send {
    /// Puts the stage in the state it has when its input has been `level` for ever; gives its output then.
    fn settle(&mut self, level: f64) -> f64;

    /// The output from `from_s` on, and until when it holds: later than `from_s`, not later than `input.until_s`.
    ///
    /// `from_s` is before `input.until_s`, and never before the `from_s` of the last question.
    fn advance(&mut self, from_s: f64, input: Segment) -> Segment;

    /// The outputs for many inputs in a row, the first of which begins at `from_s`: as [`CommandStage::advance`] has them. This
    /// is here to be compiled for each stage by itself; one that knows a quicker way has its own.
    fn pass(&mut self, from_s: f64, inputs: &[Segment], outputs: &mut Vec<Segment>) {
        let mut now_s = from_s;
        for input in inputs {
            let begin_s = now_s;
            while now_s < input.until_s {
                let level = input.level + input.slope_per_s * (now_s - begin_s);
                let output = self.advance(now_s, Segment { level, ..*input });
                now_s = output.until_s;
                output.join(outputs);
            }
        }
    }

    /// For how long what was shows in its output.
    fn memory(&self) -> Memory;

    /// The level that is all it keeps of the past, after a time in which the rest fades; `None` where it keeps nothing, or more.
    fn kept(&self, _now_s: f64) -> Option<f64> {
        None
    }

    /// Whether the output for the same input is another one `period_s` later, memory aside.
    fn changes_after(&self, _period_s: f64) -> bool {
        false
    }

    /// Whether the output may move between its changes: then the rotor behind it is not that of a level.
    fn makes_ramps(&self) -> bool {
        false
    }
}

/// A stage that puts a level to another one at once, whatever the time: what all of clip, quantize, dead band and play do.
pub(super) struct Levels<F> {
    next: F,
    held: f64,
    /// The part of what the input is away from the level that is held which comes out beside it.
    passing: f64,
    memory: Memory,
}

impl<F: FnMut(f64, f64) -> f64 + Send> Levels<F> {
    /// `next` gives the output for the output until now and the input. At rest the output until now is the input.
    pub(super) fn new(memory: Memory, next: F) -> Self {
        Self { next, held: 0.0, passing: 0.0, memory }
    }

    /// The same with a part of the input that passes beside it.
    pub(super) fn passing(self, part: f64) -> Self {
        Self { passing: part, ..self }
    }

    #[inline]
    fn output(&mut self, held: f64, input: f64) -> f64 {
        self.held = (self.next)(held, input);
        if self.passing == 0.0 { self.held } else { self.held + self.passing * (input - self.held) }
    }
}

impl<F: FnMut(f64, f64) -> f64 + Send> CommandStage for Levels<F> {
    fn settle(&mut self, level: f64) -> f64 {
        self.output(level, level)
    }

    #[inline]
    fn advance(&mut self, _: f64, input: Segment) -> Segment {
        Segment::constant(self.output(self.held, input.level), input.until_s)
    }

    fn pass(&mut self, _: f64, inputs: &[Segment], outputs: &mut Vec<Segment>) {
        let held = |input: &Segment| Segment::constant(self.output(self.held, input.level), input.until_s);
        Segment::join_all(inputs.iter().map(held), outputs);
    }

    fn memory(&self) -> Memory {
        self.memory
    }

    fn kept(&self, _: f64) -> Option<f64> {
        Some(self.held)
    }
}
