//! Dead time between the ESC and the rotor.

use std::collections::VecDeque;

use super::error::checked;
use super::{CommandStage, PlantError, Segment};

/// A transport delay `e^(-s delay)` of any length, exact: every change of the input comes out `delay_s` later.
#[derive(Clone, Debug)]
pub struct TransportDelay {
    delay_s: f64,
    /// Changes that are under way: when they come out, and to which level.
    under_way: VecDeque<(f64, f64)>,
    last_in: f64,
    out: f64,
}

impl TransportDelay {
    /// A delay of `delay_s` seconds, 0 or more. At rest at 0.
    ///
    /// # Errors
    /// [`PlantError::Setting`] when `delay_s` is negative or not finite.
    pub fn new(delay_s: f64) -> Result<Self, PlantError> {
        checked("delay_s", delay_s, "finite and not negative", delay_s.is_finite() && delay_s >= 0.0)?;
        Ok(Self { delay_s, under_way: VecDeque::new(), last_in: 0.0, out: 0.0 })
    }
}

impl CommandStage for TransportDelay {
    fn settle(&mut self, level: f64) {
        self.under_way.clear();
        self.last_in = level;
        self.out = level;
    }

    #[inline]
    fn advance(&mut self, from_s: f64, until_s: f64, input: f64) -> Segment {
        if input != self.last_in {
            self.last_in = input;
            self.under_way.push_back((from_s + self.delay_s, input));
        }
        while let Some(&(due_s, level)) = self.under_way.front() {
            if due_s > from_s {
                return Segment { level: self.out, until_s: until_s.min(due_s) };
            }
            self.out = level;
            self.under_way.pop_front();
        }
        Segment { level: self.out, until_s }
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
                    let piece = stage.advance(from, until, f64::from(tick / 3));
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
