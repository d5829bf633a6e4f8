//! Many pieces of the command at a time, as the rotor passes them.
//!
//! Link by link over many pieces is several times as quick as piece by piece over all links: nothing is asked what it is but once.

use super::{Interval, Segment};

/// Pieces in a row, and what is wanted of the response to them.
pub struct Passage<'a> {
    /// When the first piece begins, seconds.
    pub(super) from_s: f64,
    /// The pieces, each from the end of the one before.
    pub(super) pieces: &'a [Segment],
    /// What is wanted.
    pub(super) wanted: Wanted<'a>,
}

/// What is wanted of a response.
pub(super) enum Wanted<'a> {
    /// What it is at moments.
    Readings(Readings<'a>),
    /// How it moves, for the links behind.
    Intervals(&'a mut Intervals),
}

/// The response at moments.
pub(super) struct Readings<'a> {
    /// Those to come, seconds, increasing, after the begin of the first piece and not after the end of the last.
    pub moments_s: &'a [f64],
    /// The response at those that are past.
    pub read: &'a mut Vec<f64>,
}

impl Readings<'_> {
    /// The next moment, if it is before `until_s`.
    pub fn before(&self, until_s: f64) -> Option<f64> {
        self.moments_s.first().copied().filter(|moment_s| *moment_s < until_s)
    }

    /// Takes the response at the next moment.
    pub fn take(&mut self, response: f64) {
        self.read.push(response);
        self.moments_s = &self.moments_s[1..];
    }

    /// Takes the response at the end of a piece, if a moment is there.
    pub fn take_end(&mut self, until_s: f64, response: f64) {
        while self.moments_s.first().is_some_and(|moment_s| *moment_s <= until_s) {
            self.take(response);
        }
    }
}

/// The response in intervals that end where it is read.
#[derive(Default)]
pub(super) struct Intervals {
    /// Longest that the links behind can take, seconds.
    pub longest_s: f64,
    /// Where it is read, seconds; as in [`Readings`].
    pub moments_s: Vec<f64>,
    /// The intervals.
    pub intervals: Vec<Interval>,
    /// After how many of them each moment is.
    pub marks: Vec<usize>,
}

/// A rotor that passes one piece after the other.
pub(super) trait Rotates {
    /// How it moves in a moment.
    type Begin;

    /// How it moves now, with the command that begins as `piece` does.
    fn begin(&mut self, piece: Segment) -> Self::Begin;

    /// Into how many steps a piece of `duration_s` is cut that begins so.
    fn steps(&self, begin: &Self::Begin, piece: Segment, duration_s: f64) -> usize;

    /// Lets a span pass, its begin and its duration in seconds, at most what [`Rotates::steps`] allows.
    fn advance(&mut self, begin: &Self::Begin, piece: Segment, span: (f64, f64)) -> Interval;
}

impl Intervals {
    /// Lets a rotor pass the pieces.
    pub fn take(&mut self, rotor: &mut impl Rotates, from_s: f64, pieces: &[Segment]) {
        self.intervals.clear();
        self.marks.clear();
        let mut now_s = from_s;
        let mut moments = self.moments_s.iter();
        let mut next_s = moments.next();
        for piece in pieces {
            let mut rest = *piece;
            loop {
                let is_read = next_s.is_some_and(|moment_s| *moment_s <= piece.until_s);
                let until_s = next_s.filter(|_| is_read).map_or(piece.until_s, |moment_s| *moment_s);
                if until_s > now_s {
                    let duration_s = until_s - now_s;
                    cut(rotor, self.longest_s, (now_s, duration_s), rest, |interval| self.intervals.push(interval));
                    rest.level += rest.slope_per_s * duration_s;
                    now_s = until_s;
                }
                if !is_read {
                    break;
                }
                self.marks.push(self.intervals.len());
                next_s = moments.next();
            }
        }
    }
}

/// Lets `duration_s` pass from `from_s` on, in steps that are short enough for the rotor and for what is behind it.
#[inline]
pub(super) fn cut(
    rotor: &mut impl Rotates,
    longest_s: f64,
    (from_s, duration_s): (f64, f64),
    piece: Segment,
    mut take: impl FnMut(Interval),
) {
    let is_short = duration_s <= longest_s;
    let for_links = if is_short { 1 } else { (duration_s / longest_s).ceil().clamp(1.0, 1e6) as usize };
    let mut begin = rotor.begin(piece);
    let count = for_links.max(rotor.steps(&begin, piece, duration_s));
    let step_s = if count == 1 { duration_s } else { duration_s / count as f64 };
    for index in 0..count {
        let since_s = index as f64 * step_s;
        let part = Segment { level: piece.level + piece.slope_per_s * since_s, ..piece };
        if index > 0 {
            begin = rotor.begin(part);
        }
        take(rotor.advance(&begin, part, (from_s + since_s, step_s)));
    }
}
