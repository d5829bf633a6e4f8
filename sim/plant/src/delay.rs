//! Dead time between the ESC and the rotor.

use std::collections::VecDeque;

use super::error::checked;
use super::{CommandStage, Memory, PlantError, Segment};

/// A transport delay `e^(-s delay)` of any length, exact: every change of the input comes out `delay_s` later.
#[derive(Clone, Debug)]
pub struct TransportDelay {
    delay_s: f64,
    /// Changes that are under way.
    under_way: VecDeque<Change>,
    last_in: Change,
    out: Change,
}

/// From a moment on, a level that moves at a speed.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// When the input has it (`last_in`), or when it comes out.
    at_s: f64,
    level: f64,
    slope_per_s: f64,
}

impl Change {
    const ZERO: Self = Self { at_s: 0.0, level: 0.0, slope_per_s: 0.0 };

    fn level_at(&self, time_s: f64) -> f64 {
        // A level that stays is to come out as it went in, bit for bit.
        if self.slope_per_s == 0.0 { self.level } else { self.level + self.slope_per_s * (time_s - self.at_s) }
    }

    fn piece(&self, from_s: f64, until_s: f64) -> Segment {
        Segment { level: self.level_at(from_s), slope_per_s: self.slope_per_s, until_s }
    }
}

impl TransportDelay {
    /// A delay of `delay_s` seconds, 0 or more. At rest at 0.
    ///
    /// # Errors
    /// [`PlantError::Setting`] when `delay_s` is negative or not finite.
    pub fn new(delay_s: f64) -> Result<Self, PlantError> {
        checked("delay_s", delay_s, "finite and not negative", delay_s.is_finite() && delay_s >= 0.0)?;
        Ok(Self { delay_s, under_way: VecDeque::new(), last_in: Change::ZERO, out: Change::ZERO })
    }
}

impl CommandStage for TransportDelay {
    fn settle(&mut self, level: f64) -> f64 {
        self.under_way.clear();
        self.last_in = Change { level, ..Change::ZERO };
        self.out = self.last_in;
        level
    }

    #[inline]
    fn advance(&mut self, from_s: f64, input: Segment) -> Segment {
        self.put_in(from_s, input);
        self.output(from_s, input.until_s)
    }

    /// What comes out does not stop where another level goes in.
    fn pass(&mut self, from_s: f64, inputs: &[Segment], outputs: &mut Vec<Segment>) {
        let mut end_s = from_s;
        for input in inputs {
            self.put_in(end_s, *input);
            end_s = input.until_s;
        }
        let mut now_s = from_s;
        let mut past = 0;
        for change in &self.under_way {
            if change.at_s >= end_s {
                break;
            }
            if change.at_s > now_s {
                self.out.piece(now_s, change.at_s).join(outputs);
                now_s = change.at_s;
            }
            self.out = *change;
            past += 1;
        }
        self.under_way.drain(..past);
        if now_s < end_s {
            self.out.piece(now_s, end_s).join(outputs);
        }
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(self.delay_s)
    }
}

impl TransportDelay {
    #[inline]
    fn put_in(&mut self, from_s: f64, Segment { level, slope_per_s, .. }: Segment) {
        if slope_per_s != self.last_in.slope_per_s || level != self.last_in.level_at(from_s) {
            self.last_in = Change { at_s: from_s, level, slope_per_s };
            self.under_way.push_back(Change { at_s: from_s + self.delay_s, level, slope_per_s });
        }
    }

    /// What comes out from `from_s` on, up to the next change or `until_s`.
    #[inline]
    fn output(&mut self, from_s: f64, until_s: f64) -> Segment {
        let mut until_s = until_s;
        while let Some(&change) = self.under_way.front() {
            if change.at_s > from_s {
                until_s = until_s.min(change.at_s);
                break;
            }
            self.out = change;
            self.under_way.pop_front();
        }
        self.out.piece(from_s, until_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_comes_out_later_by_the_delay() {
        for delay_s in [0.0, 0.25, 1.0, 2.75, 40.0] {
            let mut stage = TransportDelay::new(delay_s).unwrap();
            stage.settle(0.0);
            let mut level = 0.0;
            for tick in 0..100_u32 {
                let (mut from, until) = (f64::from(tick), f64::from(tick + 1));
                while from < until {
                    // Changes at every third second only: an unchanged input is no event.
                    let piece = stage.advance(from, Segment::constant(f64::from(tick / 3), until));
                    assert!(piece.until_s > from && piece.until_s <= until);
                    if piece.level != level {
                        level = piece.level;
                        assert_eq!(from, level * 3.0 + delay_s);
                    }
                    from = piece.until_s;
                }
            }
            // The last change that comes out before 100 s.
            assert_eq!(level, ((100.0 - delay_s) / 3.0).ceil() - 1.0);
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert!([-1e-9, f64::NAN, f64::INFINITY].into_iter().all(|delay_s| TransportDelay::new(delay_s).is_err()));
    }
}
