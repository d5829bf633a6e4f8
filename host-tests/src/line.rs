//! An input line in the time domain: edges, and a decoder that is fed with them as the controller would.

use rotorlead::capture::{Decoder, Level, Signal};

/// Rate of the capture timer.
pub const TIMER_HZ: u32 = 84_000_000;
/// Rate of the control loop.
pub const LOOP_HZ: u32 = 5000;
/// Timer ticks per control tick.
pub const TICKS_PER_POLL: u64 = (TIMER_HZ / LOOP_HZ) as u64;

/// Timer ticks in `us` microseconds.
#[must_use]
pub fn us(us: f64) -> u64 {
    (us * f64::from(TIMER_HZ) / 1e6).round() as u64
}

/// Edges in the order of time, in timer ticks that do not wrap.
#[derive(Clone, Debug, Default)]
pub struct Line {
    edges: Vec<(u64, Level)>,
}

impl Line {
    /// `count` pulses of `width` timer ticks, one every `period`, the first at `start`.
    #[must_use]
    pub fn pulses(start: u64, period: u64, width: u64, count: u64) -> Self {
        let mut line = Self::default();
        for n in 0..count {
            line.level(start + n * period, Level::High);
            line.level(start + n * period + width, Level::Low);
        }
        line
    }

    /// One more edge, not before the last one.
    pub fn level(&mut self, time: u64, level: Level) {
        assert!(self.edges.last().is_none_or(|&(last, _)| last <= time), "edges out of order at {time}");
        self.edges.push((time, level));
    }

    /// Followed by another line.
    #[must_use]
    pub fn then(mut self, other: &Self) -> Self {
        for &(time, level) in &other.edges {
            self.level(time, level);
        }
        self
    }

    /// The line is forced to the opposite of what it is for `width` from `time` on; there must be no edge meanwhile.
    #[must_use]
    pub fn with_glitch(mut self, time: u64, width: u64) -> Self {
        let at = self.edges.partition_point(|&(edge, _)| edge < time);
        assert!(self.edges.get(at).is_none_or(|&(edge, _)| edge > time + width), "an edge within the glitch");
        let (there, back) = match at.checked_sub(1).map(|before| self.edges[before].1) {
            Some(Level::High) => (Level::Low, Level::High),
            _ => (Level::High, Level::Low),
        };
        self.edges.splice(at..at, [(time, there), (time + width, back)]);
        self
    }

    /// Without the edge number `index`.
    #[must_use]
    pub fn without_edge(mut self, index: usize) -> Self {
        self.edges.remove(index);
        self
    }

    /// The edges.
    #[must_use]
    pub fn edges(&self) -> &[(u64, Level)] {
        &self.edges
    }
}

/// What a decoder says at every control tick up to the timer tick `end`, with the time. The line's time 0 is the timer's
/// `origin`. Edges do not arrive while the input is masked, as on the controller.
pub fn decode(decoder: &mut Decoder, line: &Line, origin: u32, end: u64) -> Vec<(u64, Signal)> {
    decode_with(decoder, line, origin, end, Decoder::poll)
}

/// [`decode`], with another way of asking the decoder.
pub fn decode_with<T>(
    decoder: &mut Decoder,
    line: &Line,
    origin: u32,
    end: u64,
    poll: impl Fn(&mut Decoder, u32) -> T,
) -> Vec<(u64, T)> {
    let mut edges = line.edges().iter().peekable();
    let stamp = |time: u64| origin.wrapping_add(time as u32);
    (1..=end / TICKS_PER_POLL)
        .map(|tick| {
            let now = tick * TICKS_PER_POLL;
            while let Some(&(time, level)) = edges.next_if(|&&(time, _)| time < now) {
                if !decoder.is_off() {
                    decoder.edge(stamp(time), level);
                }
            }
            (now, poll(decoder, stamp(now)))
        })
        .collect()
}
