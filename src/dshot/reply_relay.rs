//! From the replies of an ESC to those that its flight controller gets.
//!
//! A flight controller awaits its reply some 30 µs after its frame, before this very frame has reached the ESC. So it gets the
//! newest that the ESC gave to earlier frames, with its bits as they came. Its frames need not come as often as replies do, so a
//! reply is repeated until the next one, for [`FRESH_MS`] at most: a flight controller counts a frame without a reply as an error
//! of the line, and keeps the old number all the same. Extended telemetry is repeated alike, since it says what is, and not what
//! has changed; but nothing overtakes it before it has gone out, since it comes seldom.

use super::Reply;

/// For how long a reply is repeated, milliseconds: a little more than a frame of the slowest flight controllers, at 400 Hz.
pub const FRESH_MS: u32 = 3;

/// What a flight controller is to get from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Offer {
    /// After each of its frames this one.
    Reply(Reply),
    /// Nothing.
    None,
}

/// One motor's replies, from one line to the other.
pub struct ReplyRelay {
    fresh_ticks: u32,
    /// Came in, and is not offered yet.
    waiting: Option<Reply>,
    /// Whether a reply is offered.
    is_offered: bool,
    /// Since it is.
    ticks: u32,
}

impl ReplyRelay {
    /// Repeats a reply for so many control ticks.
    #[must_use]
    pub const fn new(fresh_ticks: u32) -> Self {
        Self { fresh_ticks, waiting: None, is_offered: false, ticks: 0 }
    }

    /// Once per control tick: a reply that has come in, and whether the last offer has gone out once. What is to be offered now,
    /// where that changes.
    pub fn tick(&mut self, received: Option<Reply>, is_taken: bool) -> Option<Offer> {
        if received.is_some() && !self.waiting.is_some_and(Reply::is_extended) {
            self.waiting = received;
        }
        if is_taken && let Some(reply) = self.waiting.take() {
            (self.is_offered, self.ticks) = (true, 0);
            return Some(Offer::Reply(reply));
        }
        if !self.is_offered {
            return None;
        }
        self.ticks = self.ticks.saturating_add(1);
        (self.ticks >= self.fresh_ticks).then(|| self.withdraw())
    }

    /// Offers nothing from now on.
    pub const fn withdraw(&mut self) -> Offer {
        (self.waiting, self.is_offered) = (None, false);
        Offer::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRESH: u32 = 5;
    const TAKEN: bool = true;

    fn reply(period_us: u32) -> Reply {
        Reply::from_period_us(Some(period_us))
    }

    fn offers(
        relay: &mut ReplyRelay,
        received: impl IntoIterator<Item = (Option<Reply>, bool)>,
    ) -> std::vec::Vec<Option<Offer>> {
        received.into_iter().map(|(received, is_taken)| relay.tick(received, is_taken)).collect()
    }

    #[test]
    fn each_reply_is_offered_once_and_stays_until_the_next() {
        let mut relay = ReplyRelay::new(FRESH);
        assert_eq!(relay.tick(None, TAKEN), None);
        for period in 300..310 {
            assert_eq!(relay.tick(Some(reply(period)), TAKEN), Some(Offer::Reply(reply(period))));
            assert_eq!(offers(&mut relay, [(None, TAKEN); FRESH as usize - 1]), [None; FRESH as usize - 1]);
        }
    }

    #[test]
    fn one_that_is_too_old_is_withdrawn_once_and_the_next_is_offered() {
        let mut relay = ReplyRelay::new(FRESH);
        for is_taken in [true, false] {
            assert!(relay.tick(Some(reply(300)), TAKEN).is_some());
            assert_eq!(offers(&mut relay, [(None, is_taken); 4]), [None; 4]);
            assert_eq!(relay.tick(None, is_taken), Some(Offer::None));
            assert_eq!(offers(&mut relay, [(None, is_taken); 50]), [None; 50]);
        }
    }

    #[test]
    fn of_those_that_wait_the_newest_goes_out_and_none_that_is_too_old() {
        let mut relay = ReplyRelay::new(FRESH);
        assert!(relay.tick(Some(reply(300)), TAKEN).is_some());
        assert_eq!(offers(&mut relay, [(Some(reply(301)), false), (Some(reply(302)), false)]), [None; 2]);
        assert_eq!(relay.tick(None, TAKEN), Some(Offer::Reply(reply(302))));
        // A flight controller that is silent for long.
        assert_eq!(offers(&mut relay, (0..4).map(|n| (Some(reply(400 + n)), false))), [None; 4]);
        assert_eq!(relay.tick(Some(reply(410)), false), Some(Offer::None));
        assert_eq!(relay.tick(None, TAKEN), None);
    }

    #[test]
    fn nothing_overtakes_extended_telemetry() {
        let mut relay = ReplyRelay::new(FRESH);
        let temperature = Reply::from_payload(0x214);
        assert!(temperature.is_extended() && temperature.period_us().is_none());
        assert!(relay.tick(Some(reply(300)), TAKEN).is_some());
        assert_eq!(relay.tick(Some(temperature), false), None);
        assert_eq!(relay.tick(Some(reply(301)), TAKEN), Some(Offer::Reply(temperature)));
        assert_eq!(relay.tick(Some(reply(302)), TAKEN), Some(Offer::Reply(reply(302))));
    }

    #[test]
    fn what_was_withdrawn_does_not_come_back() {
        let mut relay = ReplyRelay::new(FRESH);
        assert!(relay.tick(Some(reply(300)), TAKEN).is_some());
        assert_eq!(relay.tick(Some(reply(301)), false), None);
        assert_eq!(relay.withdraw(), Offer::None);
        assert_eq!(offers(&mut relay, [(None, TAKEN); 10]), [None; 10]);
    }
}
