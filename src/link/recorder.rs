//! The recorder, from ticks to [`Record`]s.

use super::{RECORD_SAMPLES, Record, Series};

/// [`Sample::input`] where there is no pulse.
pub const NO_INPUT: i32 = -1;
/// [`Sample::after`], and an output of an injection, where the ESC gets no pulse.
pub const NO_PULSE: i32 = crate::throttle::EscCommand::NO_PULSE.to_bits();
/// [`Sensed::turn_us`] where no ESC has said it lately.
pub const NO_TURN: i32 = -1;

/// What is measured of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sensed {
    /// The converter's count.
    pub adc: u16,
    /// Microseconds of an electrical turn as the ESC's newest reply has them, or [`NO_TURN`].
    pub turn_us: i32,
}

impl Sensed {
    /// A count, and no ESC that replies.
    #[must_use]
    pub const fn adc(adc: u16) -> Self {
        Self { adc, turn_us: NO_TURN }
    }
}

/// One tick of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The tick, counted from the start of the recording.
    pub tick: u32,
    /// The pulse input as a command, Q2.29, or [`NO_INPUT`].
    pub input: i32,
    /// The command before the compensator, Q2.29.
    pub before: i32,
    /// The command after it, Q2.29, or [`NO_PULSE`].
    pub after: i32,
    /// What is measured.
    pub sensed: Sensed,
}

/// Says in the control tick whether this one is recorded, and its number. Lives beside the tick; the samples go through
/// a queue to a [`Recorder`] in a task of lower priority. A full queue drops samples, and their missing numbers show it.
#[derive(Clone, Copy, Debug)]
pub struct RecordClock {
    divisor: u16,
    tick: u32,
    /// Ticks until the next sample.
    wait: u16,
}

impl RecordClock {
    /// One tick in `divisor`, beginning with the next; 0 counts as 1.
    #[must_use]
    pub const fn new(divisor: u16) -> Self {
        Self { divisor: if divisor == 0 { 1 } else { divisor }, tick: 0, wait: 0 }
    }

    /// One tick: its number, when it is to be recorded.
    #[inline]
    pub const fn tick(&mut self) -> Option<u32> {
        let tick = self.tick;
        self.tick = tick.wrapping_add(1);
        if self.wait == 0 {
            self.wait = self.divisor - 1;
            Some(tick)
        } else {
            self.wait -= 1;
            None
        }
    }
}

/// Collects samples to frames.
#[derive(Clone, Debug)]
pub struct Recorder {
    record: Record,
    next_tick: u32,
    missing: u32,
}

impl Recorder {
    /// A recording of `motor` with one sample in `divisor` ticks; 0 counts as 1.
    #[must_use]
    pub const fn new(motor: u8, divisor: u16) -> Self {
        let divisor = if divisor == 0 { 1 } else { divisor };
        Self { record: empty(motor, divisor), next_tick: 0, missing: 0 }
    }

    /// Adds a sample, and gives the record that is complete with it: a full one, or the samples before a gap.
    pub fn push(&mut self, sample: Sample) -> Option<Record> {
        let gap = sample.tick.wrapping_sub(self.next_tick);
        if gap != 0 {
            self.missing = self.missing.wrapping_add(gap / u32::from(self.record.divisor));
            let before_gap = self.finish();
            self.append(sample);
            return before_gap;
        }
        self.append(sample);
        self.record.before.is_full().then(|| self.take())
    }

    /// The samples that are left, at the end of a recording.
    pub fn finish(&mut self) -> Option<Record> {
        (!self.record.before.is_empty()).then(|| self.take())
    }

    /// Samples that never came, by the numbers of those that did.
    #[must_use]
    pub const fn missing(&self) -> u32 {
        self.missing
    }

    fn append(&mut self, sample: Sample) {
        let record = &mut self.record;
        if record.before.is_empty() {
            record.first_tick = sample.tick;
        }
        // A record leaves when it is full, so there is room; were there none, the tick's number would show the loss.
        let columns = [
            (&mut record.input, sample.input),
            (&mut record.before, sample.before),
            (&mut record.after, sample.after),
            (&mut record.adc, i32::from(sample.sensed.adc)),
            (&mut record.turn_us, sample.sensed.turn_us),
        ];
        for (column, value) in columns {
            let _ = column.push(value);
        }
        self.next_tick = sample.tick.wrapping_add(u32::from(record.divisor));
    }

    fn take(&mut self) -> Record {
        let fresh = empty(self.record.motor, self.record.divisor);
        core::mem::replace(&mut self.record, fresh)
    }
}

const fn empty(motor: u8, divisor: u16) -> Record {
    const NONE: Series<RECORD_SAMPLES> = Series::new();
    Record { motor, divisor, first_tick: 0, input: NONE, before: NONE, after: NONE, adc: NONE, turn_us: NONE }
}
