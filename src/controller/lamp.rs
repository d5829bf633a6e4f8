//! What a lamp on the board shows of the controller's state.

use super::tick::{Outputs, Tick};

/// How long a lamp shows one bit of a pattern, milliseconds.
pub const LAMP_STEP_MS: u32 = 100;

/// What a board's lamp shows, over and over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// On: a motor turns, or may be made to by its next command. Hands off.
    Turning,
    /// One flash in a second: every motor is at rest, and waits for its input.
    Ready,
    /// Two flashes in a second: the same, and the jumper lets a host turn motors.
    Bench,
    /// Flickers: no motor can be made to turn. Nobody has chosen settings, or the clock cannot be trusted.
    Useless,
}

impl Lamp {
    /// Of this state.
    #[must_use]
    pub fn select(tick: &Tick, is_bench_enabled: bool, tells_pulses_apart: bool) -> Self {
        if tick.outputs() == Outputs::Low {
            // Whatever the inputs ask for.
            Self::Useless
        } else if tick.turning().is_some() {
            Self::Turning
        } else if !tells_pulses_apart {
            Self::Useless
        } else if is_bench_enabled {
            Self::Bench
        } else {
            Self::Ready
        }
    }

    /// Whether the lamp is on, so many milliseconds after any start.
    #[must_use]
    pub const fn is_on(self, milliseconds: u32) -> bool {
        let pattern: u32 = match self {
            Self::Turning => 0b11_1111_1111,
            Self::Ready => 0b00_0000_0001,
            Self::Bench => 0b00_0000_0101,
            Self::Useless => 0b01_0101_0101,
        };
        pattern >> (milliseconds / LAMP_STEP_MS % 10) & 1 != 0
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn every_state_looks_different() {
        let seen = [Lamp::Turning, Lamp::Ready, Lamp::Bench, Lamp::Useless]
            .map(|lamp| (0..2000).filter(|&ms| lamp.is_on(ms)).count());
        assert_eq!(seen, [2000, 200, 400, 1000]);
        let flashes = |lamp: Lamp| {
            let levels: Vec<bool> = (0..1000).map(|ms| lamp.is_on(ms)).collect();
            levels.windows(2).filter(|pair| pair[0] && !pair[1]).count()
        };
        assert_eq!([Lamp::Turning, Lamp::Ready, Lamp::Bench, Lamp::Useless].map(flashes), [0, 1, 2, 5]);
    }
}
