//! What is done about ticks that are late, and about a lowest priority that does not run.

/// Longest time that the lowest priority may be away, milliseconds: the design of a filter, or a save.
const IDLE_LIMIT_MS: u32 = 20_000;
/// How long every motor must have been at rest before a hung lowest priority ends in a reset, milliseconds: a pilot who cuts the
/// throttle in the air for a moment is still flying.
const REST_LIMIT_MS: u32 = 2000;
/// Reviews per second, at the least half as many: of what need not be looked at in every tick.
const REVIEW_HZ: u32 = 1000;

/// Counts late ticks, watches the lowest priority, and says when the control task looks after what is not for every tick: the
/// [review](Self::review).
///
/// While a flight controller turns a motor the watchdog is fed whatever the lowest priority does: it only talks to the host. A hang
/// is counted. With every motor at rest it ends in a reset, which mends it.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    missed: u32,
    /// The tick that was the last to miss its deadline.
    last_missed: u32,
    /// The lowest priority has run since the last review.
    idle_ran: bool,
    /// Ticks until the next review at the latest: from twice the period down.
    until_review: u32,
    review_period: u32,
    idle_away_ticks: u32,
    idle_limit_ticks: u32,
    /// Since a flight controller has turned a motor.
    rest_ticks: u32,
    rest_limit_ticks: u32,
    idle_hangs: u32,
}

impl Supervisor {
    /// For a loop at `loop_rate_hz`.
    #[must_use]
    pub const fn new(loop_rate_hz: u32) -> Self {
        let mut supervisor = Self {
            missed: 0,
            last_missed: 0,
            idle_ran: false,
            until_review: 0,
            review_period: 0,
            idle_away_ticks: 0,
            idle_limit_ticks: 0,
            rest_ticks: u32::MAX,
            rest_limit_ticks: 0,
            idle_hangs: 0,
        };
        supervisor.set_rate(loop_rate_hz);
        supervisor
    }

    /// Another rate; what was counted stays.
    pub const fn set_rate(&mut self, loop_rate_hz: u32) {
        self.idle_limit_ticks = super::ticks(IDLE_LIMIT_MS, loop_rate_hz);
        self.rest_limit_ticks = super::ticks(REST_LIMIT_MS, loop_rate_hz);
        let period = loop_rate_hz / REVIEW_HZ;
        self.review_period = if period == 0 { 1 } else { period };
        self.until_review = 2 * self.review_period;
    }

    /// One tick. `idle_ran`: the lowest priority has run since the last one. `is_long`: this tick had new commands to work on. Whether
    /// a review is due: a millisecond after the last in the next tick that is not long, and after two in any.
    #[inline]
    pub const fn tick(&mut self, idle_ran: bool, is_long: bool) -> bool {
        self.idle_ran |= idle_ran;
        self.until_review = self.until_review.wrapping_sub(1);
        self.until_review <= self.review_period && (!is_long || self.until_review == 0)
    }

    /// The review. `is_flown`: a flight controller turns a motor. Whether the watchdog is to be fed.
    pub const fn review(&mut self, is_flown: bool) -> bool {
        let ticks = (2 * self.review_period).saturating_sub(self.until_review);
        self.until_review = 2 * self.review_period;
        let was_hung = self.is_idle_hung();
        self.idle_away_ticks = if self.idle_ran { 0 } else { self.idle_away_ticks.saturating_add(ticks) };
        self.idle_ran = false;
        self.rest_ticks = if is_flown { 0 } else { self.rest_ticks.saturating_add(ticks) };
        if is_flown && self.is_idle_hung() && !was_hung {
            self.idle_hangs = self.idle_hangs.wrapping_add(1);
        }
        !self.is_idle_hung() || self.rest_ticks < self.rest_limit_ticks
    }

    const fn is_idle_hung(&self) -> bool {
        self.idle_away_ticks >= self.idle_limit_ticks
    }

    /// Times that the lowest priority was away for 20 s while a flight controller turned a motor, wrapping.
    #[must_use]
    pub const fn idle_hangs(&self) -> u32 {
        self.idle_hangs
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks without the lowest priority, until one after whose review the watchdog is not fed; at most so many.
    fn unfed(supervisor: &mut Supervisor, is_flown: bool, most: u32) -> Option<u32> {
        (1..=most).find(|_| supervisor.tick(false, false) && !supervisor.review(is_flown))
    }

    #[test]
    fn a_review_comes_every_millisecond_and_waits_for_a_short_tick_for_another() {
        for (rate, period) in [(1000, 1), (5000, 5), (8000, 8), (10_000, 10)] {
            let mut supervisor = Supervisor::new(rate);
            let mut next = |is_long: fn(u32) -> bool| {
                let tick = (1..100).find(|&n| supervisor.tick(true, is_long(n))).unwrap();
                assert!(supervisor.review(false));
                tick
            };
            for _ in 0..3 {
                assert_eq!(next(|_| false), period);
                assert_eq!(next(|_| true), 2 * period);
            }
            assert_eq!(next(|n| n != 15), if period == 10 { 15 } else { (2 * period).min(15) });
        }
    }

    #[test]
    fn at_rest_the_watchdog_bites_after_20_s_without_the_lowest_priority_and_in_flight_it_does_not() {
        for rate in [1000, 5000, 10_000] {
            let mut supervisor = Supervisor::new(rate);
            assert_eq!(unfed(&mut supervisor, false, 21 * rate), Some(20 * rate));
            let mut supervisor = Supervisor::new(rate);
            assert_eq!(unfed(&mut supervisor, true, 60 * rate), None);
            assert_eq!(supervisor.idle_hangs(), 1, "once, however long");
            // The throttle is cut in the air for a second, and again.
            for _ in 0..3 {
                assert_eq!(unfed(&mut supervisor, false, rate), None);
                assert_eq!(unfed(&mut supervisor, true, rate), None);
            }
            // Landed.
            assert_eq!(unfed(&mut supervisor, false, 3 * rate), Some(2 * rate));
        }
    }

    #[test]
    fn a_lowest_priority_that_comes_back_is_counted_anew_when_it_hangs_again() {
        let mut supervisor = Supervisor::new(1000);
        for hangs in 1..4 {
            assert_eq!(unfed(&mut supervisor, true, 21_000), None);
            assert_eq!(supervisor.idle_hangs(), hangs);
            assert!(supervisor.tick(true, false) && supervisor.review(true));
            assert_eq!(unfed(&mut supervisor, true, 19_999), None);
            assert_eq!(supervisor.idle_hangs(), hangs);
            assert!(supervisor.tick(true, false) && supervisor.review(true));
        }
    }
}
