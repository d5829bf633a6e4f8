//! What is done about ticks that are late, and about a lowest priority that does not run.

/// Longest time that the lowest priority may be away, milliseconds: the design of a filter, or a save.
const IDLE_LIMIT_MS: u32 = 20_000;
/// How often what need not be done in every tick is done, per second, at the most: at the least half as often, and in every second tick.
const CHORES_HZ: u32 = 5000;

/// Counts late ticks, watches the lowest priority, and says when the control task does its chores: what is not for every tick.
///
/// While a flight controller turns a motor the watchdog is fed whatever the lowest priority does: it only talks to the host. A hang
/// is counted. With every motor at rest for some seconds it ends in a reset, which mends it: a pilot who cuts the throttle in the air for
/// a moment is still flying.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    missed: u32,
    /// The tick that was the last to miss its deadline.
    last_missed: u32,
    /// The lowest priority has run since the last review.
    idle_ran: bool,
    is_fed: bool,
    /// Ticks until the next chores at the latest: from twice the period down.
    until_chores: u32,
    chores_period: u32,
    /// The tick of the last review.
    last_review: u32,
    idle_away_ticks: u32,
    idle_limit_ticks: u32,
    idle_hangs: u32,
    /// That which goes on is counted.
    is_hang_counted: bool,
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
            until_chores: 0,
            chores_period: 0,
            last_review: 0,
            idle_away_ticks: 0,
            idle_limit_ticks: 0,
            idle_hangs: 0,
            is_hang_counted: false,
        };
        supervisor.set_rate(loop_rate_hz);
        supervisor
    }

    /// Another rate; what was counted stays.
    pub const fn set_rate(&mut self, loop_rate_hz: u32) {
        self.idle_limit_ticks = super::ticks(IDLE_LIMIT_MS, loop_rate_hz);
        self.chores_period = if loop_rate_hz > CHORES_HZ { loop_rate_hz / CHORES_HZ } else { 1 };
        self.until_chores = 2 * self.chores_period;
    }

    /// One tick. `idle_ran`: the lowest priority has run since the last one. `is_long`: this tick had new commands to work on. Whether
    /// the chores are due: at `CHORES_HZ`, but in a tick that is long only where they have waited for as long again.
    #[inline]
    pub const fn tick(&mut self, idle_ran: bool, is_long: bool) -> bool {
        self.idle_ran |= idle_ran;
        self.until_chores = self.until_chores.wrapping_sub(1);
        self.until_chores <= self.chores_period && (!is_long || self.until_chores == 0)
    }

    /// The chores are done. Whether feeding the watchdog is one of them.
    #[inline]
    pub const fn done(&mut self) -> bool {
        self.until_chores = 2 * self.chores_period;
        self.is_fed
    }

    /// Looks after the lowest priority, now and then. `tick`: the number of this tick. `is_flown`: a flight controller turns a motor.
    /// `is_rested`: every motor has been at rest for some seconds.
    pub const fn review(&mut self, tick: u32, is_flown: bool, is_rested: bool) {
        let ticks = tick.wrapping_sub(self.last_review);
        self.last_review = tick;
        self.idle_away_ticks = if self.idle_ran { 0 } else { self.idle_away_ticks.saturating_add(ticks) };
        self.idle_ran = false;
        let is_flown_hung = is_flown && self.is_idle_hung();
        if is_flown_hung && !self.is_hang_counted {
            self.idle_hangs = self.idle_hangs.wrapping_add(1);
        }
        self.is_hang_counted = self.is_idle_hung() && (self.is_hang_counted || is_flown_hung);
        self.is_fed = !self.is_idle_hung() || !is_rested;
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

    /// Chores between two reviews.
    const CHORES: u32 = 6;

    /// What becomes of the motors.
    #[derive(Clone, Copy, PartialEq)]
    enum Motors {
        Flown,
        /// Cut a moment ago.
        Cut,
        Rested,
    }

    /// A control task with nothing else to do.
    struct Task {
        supervisor: Supervisor,
        tick: u32,
        chores: u32,
        is_fed: bool,
    }

    impl Task {
        fn new(rate: u32) -> Self {
            // The count of ticks wraps.
            Self { supervisor: Supervisor::new(rate), tick: 0, chores: 0, is_fed: true }
        }

        /// One tick, and whether the watchdog is fed.
        fn is_fed(&mut self, idle_ran: bool, motors: Motors) -> bool {
            self.tick = self.tick.wrapping_add(1);
            if self.supervisor.tick(idle_ran, false) {
                self.chores += 1;
                if self.chores.is_multiple_of(CHORES) {
                    self.supervisor.review(self.tick, motors == Motors::Flown, motors == Motors::Rested);
                }
                self.is_fed = self.supervisor.done();
            }
            self.is_fed
        }

        /// Ticks without the lowest priority, up to one after which the watchdog is not fed; at most so many.
        fn unfed(&mut self, motors: Motors, most: u32) -> Option<u32> {
            (1..=most).find(|_| !self.is_fed(false, motors))
        }
    }

    #[test]
    fn chores_come_5000_times_a_second_and_wait_for_a_short_tick_for_as_long_again() {
        for (rate, period) in [(1000, 1), (5000, 1), (8000, 1), (10_000, 2)] {
            let mut supervisor = Supervisor::new(rate);
            let mut next = |is_long: fn(u32) -> bool| {
                let tick = (1..100).find(|&n| supervisor.tick(true, is_long(n))).unwrap();
                assert!(supervisor.done());
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
                assert!((seconds * rate..=seconds * rate + rate / 100).contains(&ticks), "{ticks} at {rate} Hz");
            };
            within(Task::new(rate).unfed(Motors::Rested, 21 * rate), 20);
            let mut task = Task::new(rate);
            assert_eq!(task.unfed(Motors::Flown, 60 * rate), None);
            assert_eq!(task.supervisor.idle_hangs(), 1, "once, however long");
            // The throttle is cut in the air for a second, and again.
            for _ in 0..3 {
                assert_eq!(task.unfed(Motors::Cut, rate), None);
                assert_eq!(task.unfed(Motors::Flown, rate), None);
            }
            // Landed.
            within(task.unfed(Motors::Rested, rate), 0);
        }
    }

    #[test]
    fn a_lowest_priority_that_comes_back_is_counted_anew_when_it_hangs_again() {
        let mut task = Task::new(1000);
        for hangs in 1..4 {
            assert_eq!(task.unfed(Motors::Flown, 21_000), None);
            assert_eq!(task.supervisor.idle_hangs(), hangs);
            (0..10).for_each(|_| assert!(task.is_fed(true, Motors::Flown)));
            assert_eq!(task.unfed(Motors::Flown, 19_900), None);
            assert_eq!(task.supervisor.idle_hangs(), hangs);
            // Its 20 s may be over while the throttle is cut.
            assert_eq!(task.unfed(Motors::Cut, 200), None);
            assert_eq!(task.supervisor.idle_hangs(), hangs);
            (0..10).for_each(|_| assert!(task.is_fed(true, Motors::Flown)));
        }
    }
}
