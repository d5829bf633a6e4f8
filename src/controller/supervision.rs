//! What is done about ticks that are late, and about a lowest priority that does not run.

/// Longest time that the lowest priority may be away, milliseconds: the design of a filter, or a save.
const IDLE_LIMIT_MS: u32 = 20_000;

/// Counts late ticks and watches the lowest priority.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    missed: u32,
    /// The tick that was the last to miss its deadline.
    last_missed: u32,
    idle_away_ticks: u32,
    idle_limit_ticks: u32,
}

impl Supervisor {
    /// For a loop at `loop_rate_hz`.
    #[must_use]
    pub const fn new(loop_rate_hz: u32) -> Self {
        let idle_limit_ticks = super::ticks(IDLE_LIMIT_MS, loop_rate_hz);
        Self { missed: 0, last_missed: 0, idle_away_ticks: 0, idle_limit_ticks }
    }

    /// Another rate; what was counted stays.
    pub const fn set_rate(&mut self, loop_rate_hz: u32) {
        self.idle_limit_ticks = super::ticks(IDLE_LIMIT_MS, loop_rate_hz);
    }

    /// One tick. `idle_ran`: the lowest priority has run since the last one. Whether the watchdog is to be fed.
    #[inline]
    pub const fn tick(&mut self, idle_ran: bool) -> bool {
        self.idle_away_ticks = if idle_ran { 0 } else { self.idle_away_ticks.saturating_add(1) };
        self.idle_away_ticks < self.idle_limit_ticks
    }

    /// The tick of this number has missed its deadline: the next one is due already. Where that goes on nothing of lower
    /// priority runs, and a host could not stop an excitation: it is to end (`true`) with the second miss in a row.
    #[cold]
    pub const fn late(&mut self, tick: u32) -> bool {
        let is_second = self.missed > 0 && tick.wrapping_sub(self.last_missed) == 1;
        self.missed = self.missed.wrapping_add(1);
        self.last_missed = tick;
        is_second
    }

    /// Ticks that missed their deadline, wrapping.
    #[must_use]
    pub const fn missed(&self) -> u32 {
        self.missed
    }
}
