//! What is done about ticks that are late, and about a lowest priority that does not run.

/// Longest time that the lowest priority may be away, milliseconds: the design of a filter, or a save.
const IDLE_LIMIT_MS: u32 = 20_000;
/// How long every motor must have been at rest before a hung lowest priority ends in a reset, milliseconds: a pilot who cuts the
/// throttle in the air for a moment is still flying.
const REST_LIMIT_MS: u32 = 2000;
/// Steps of what need not be done in every tick, per second, at the least half as many.
const STEPS_HZ: u32 = 5000;

/// Counts late ticks, watches the lowest priority, and says when the control task takes a step of what is not for every tick: a
/// [turn](Self::turn).
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
    is_fed: bool,
    /// Ticks until the next turn at the latest: from twice the period down.
    until_turn: u32,
    turn_period: u32,
    steps_per_turn: u32,
    ticks_since_review: u32,
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
            is_fed: true,
            until_turn: 0,
            turn_period: 0,
            steps_per_turn: 0,
            ticks_since_review: 0,
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
        self.turn_period = if loop_rate_hz > STEPS_HZ { loop_rate_hz / STEPS_HZ } else { 1 };
        self.steps_per_turn = if loop_rate_hz == 0 { 1 } else { STEPS_HZ.div_ceil(loop_rate_hz) };
        self.until_turn = 2 * self.turn_period;
    }

    /// One tick. `idle_ran`: the lowest priority has run since the last one. `is_long`: this tick had new commands to work on. Whether
    /// a turn is due: at [`STEPS_HZ`], but in a tick that is long only where it has waited for as long again.
    #[inline]
    pub const fn tick(&mut self, idle_ran: bool, is_long: bool) -> bool {
        self.idle_ran |= idle_ran;
        self.until_turn = self.until_turn.wrapping_sub(1);
        self.until_turn <= self.turn_period && (!is_long || self.until_turn == 0)
    }

    /// The turn: how many steps it has.
    pub const fn turn(&mut self) -> u32 {
        let ticks = (2 * self.turn_period).saturating_sub(self.until_turn);
        self.ticks_since_review = self.ticks_since_review.saturating_add(ticks);
        self.until_turn = 2 * self.turn_period;
        self.steps_per_turn
    }

    /// Looks after the lowest priority, after some steps. `is_flown`: a flight controller turns a motor.
    pub const fn review(&mut self, is_flown: bool) {
        let ticks = self.ticks_since_review;
        self.ticks_since_review = 0;
        let was_hung = self.is_idle_hung();
        self.idle_away_ticks = if self.idle_ran { 0 } else { self.idle_away_ticks.saturating_add(ticks) };
        self.idle_ran = false;
        self.rest_ticks = if is_flown { 0 } else { self.rest_ticks.saturating_add(ticks) };
        if is_flown && self.is_idle_hung() && !was_hung {
            self.idle_hangs = self.idle_hangs.wrapping_add(1);
        }
        self.is_fed = !self.is_idle_hung() || self.rest_ticks < self.rest_limit_ticks;
    }

    /// Whether the watchdog is to be fed in each turn.
    #[must_use]
    pub const fn is_fed(&self) -> bool {
        self.is_fed
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

    /// The control task's steps between two reviews.
    const STEPS: u32 = 5;

    /// One tick, and whether the watchdog is to be fed after it.
    fn is_fed(supervisor: &mut Supervisor, step: &mut u32, idle_ran: bool, is_flown: bool) -> bool {
        if supervisor.tick(idle_ran, false) {
            for _ in 0..supervisor.turn() {
                *step += 1;
                if *step % STEPS == 0 {
                    supervisor.review(is_flown);
                }
            }
        }
        supervisor.is_fed()
    }

    /// Ticks without the lowest priority, up to one after which the watchdog is not fed; at most so many.
    fn unfed(supervisor: &mut Supervisor, is_flown: bool, most: u32) -> Option<u32> {
        let mut step = 0;
        (1..=most).find(|_| !is_fed(supervisor, &mut step, false, is_flown))
    }

    #[test]
    fn a_turn_comes_5000_times_a_second_and_waits_for_a_short_tick_for_as_long_again() {
        for (rate, period, steps) in [(1000, 1, 5), (2000, 1, 3), (5000, 1, 1), (8000, 1, 1), (10_000, 2, 1)] {
            let mut supervisor = Supervisor::new(rate);
            let mut next = |is_long: fn(u32) -> bool| {
                let tick = (1..100).find(|&n| supervisor.tick(true, is_long(n))).unwrap();
                assert_eq!(supervisor.turn(), steps);
                tick
            };
            for _ in 0..3 {
                assert_eq!(next(|_| false), period);
                assert_eq!(next(|_| true), 2 * period);
            }
            assert_eq!(next(|n| n != 3), if period == 2 { 3 } else { 2 });
        }
    }

    #[test]
    fn at_rest_the_watchdog_bites_after_20_s_without_the_lowest_priority_and_in_flight_it_does_not() {
        for rate in [1000, 5000, 10_000] {
            let within = |ticks: Option<u32>, seconds: u32| {
                let ticks = ticks.unwrap();
                assert!((seconds * rate..=seconds * rate + rate / 500).contains(&ticks), "{ticks} at {rate} Hz");
            };
            let mut supervisor = Supervisor::new(rate);
            within(unfed(&mut supervisor, false, 21 * rate), 20);
            let mut supervisor = Supervisor::new(rate);
            assert_eq!(unfed(&mut supervisor, true, 60 * rate), None);
            assert_eq!(supervisor.idle_hangs(), 1, "once, however long");
            // The throttle is cut in the air for a second, and again.
            for _ in 0..3 {
                assert_eq!(unfed(&mut supervisor, false, rate), None);
                assert_eq!(unfed(&mut supervisor, true, rate), None);
            }
            // Landed.
            within(unfed(&mut supervisor, false, 3 * rate), 2);
        }
    }

    #[test]
    fn a_lowest_priority_that_comes_back_is_counted_anew_when_it_hangs_again() {
        let mut supervisor = Supervisor::new(1000);
        for hangs in 1..4 {
            assert_eq!(unfed(&mut supervisor, true, 21_000), None);
            assert_eq!(supervisor.idle_hangs(), hangs);
            let mut step = 0;
            (0..10).for_each(|_| assert!(is_fed(&mut supervisor, &mut step, true, true)));
            assert_eq!(unfed(&mut supervisor, true, 19_900), None);
            assert_eq!(supervisor.idle_hangs(), hangs);
            (0..10).for_each(|_| assert!(is_fed(&mut supervisor, &mut step, true, true)));
        }
    }
}
