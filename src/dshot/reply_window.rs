//! What an ESC's line was after a frame: where a reply may be.

use super::{BadReply, REPLY_BITS, Reply};

/// Levels of a window, one for each bit of a reply. A reply that starts within 33 of them is whole: 44 µs behind a frame at
/// 600 kbit/s. ESCs start some 30 µs behind it.
pub const WINDOW_LEVELS: u32 = 2 * WORD_LEVELS;
/// A board takes them in two words of so many.
pub const WORD_LEVELS: u32 = 27;

/// The levels of a line from the end of a frame on, taken in the middle of each bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplyWindow(u64);

impl ReplyWindow {
    /// From two words of [`WORD_LEVELS`], the first level the highest bit.
    #[must_use]
    pub const fn new(first: u32, second: u32) -> Self {
        const MASK: u32 = (1 << WORD_LEVELS) - 1;
        Self((((first & MASK) as u64) << WORD_LEVELS) | (second & MASK) as u64)
    }

    /// The reply in it; `None` where the line stayed high.
    ///
    /// # Errors
    /// [`BadReply`], also of one that the window's end has cut.
    pub fn reply(self) -> Option<Result<Reply, BadReply>> {
        // The levels at the top, behind them such as an idle line has. A reply begins with the first that is low.
        let levels = !(!self.0 << (u64::BITS - WINDOW_LEVELS));
        let start = levels.leading_ones();
        if start >= WINDOW_LEVELS {
            return None;
        }
        if start > WINDOW_LEVELS - REPLY_BITS {
            return Some(Err(BadReply::Cut));
        }
        Some(Reply::from_levels((levels << start >> (u64::BITS - REPLY_BITS)) as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line that is high up to `start`, has these levels, and is high again.
    fn window(start: u32, levels: u32) -> ReplyWindow {
        let levels = (0..WINDOW_LEVELS).fold(0_u64, |line, place| {
            let in_reply = place.checked_sub(start).filter(|bit| *bit < REPLY_BITS);
            line << 1 | in_reply.map_or(1, |bit| u64::from(levels >> (REPLY_BITS - 1 - bit) & 1))
        });
        ReplyWindow::new((levels >> WORD_LEVELS) as u32, levels as u32)
    }

    #[test]
    fn a_reply_is_found_wherever_it_starts() {
        for payload in (0..1 << 12).step_by(7) {
            let reply = Reply::from_payload(payload);
            for start in 0..=WINDOW_LEVELS - REPLY_BITS {
                assert_eq!(window(start, reply.to_levels()).reply(), Some(Ok(reply)), "{payload} at {start}");
            }
        }
    }

    #[test]
    fn a_line_that_stays_high_has_none_and_one_that_is_cut_or_low_a_bad_one() {
        let all = (1 << WORD_LEVELS) - 1;
        assert_eq!(ReplyWindow::new(all, all).reply(), None);
        assert_eq!(ReplyWindow::new(0, 0).reply(), Some(Err(BadReply::Group)));
        assert_eq!(ReplyWindow::new(all, all - 1).reply(), Some(Err(BadReply::Cut)));
        let reply = Reply::from_payload(0x123).to_levels();
        assert_eq!(window(WINDOW_LEVELS - REPLY_BITS + 1, reply).reply(), Some(Err(BadReply::Cut)));
        assert_eq!(window(20, reply ^ 1 << 9).reply().map(|reply| reply.is_err()), Some(true));
    }
}
