//! Spikes on a line, as the switching of an ESC couples them into it: the level is turned over for the time of each.

/// Widths of spikes, microseconds.
pub const WIDTHS_US: [f64; 4] = [0.1, 0.2, 1.0, 1.9];
/// Rates of spikes, kilohertz. ESCs switch at 24 to 48.
pub const RATES_KHZ: [f64; 5] = [1.0, 10.0, 24.0, 48.0, 100.0];

/// A spike of `width` about every `period` from 0 to `end`, in any unit of time: beginnings and ends in turn. The period is 1.37 % longer,
/// and each comes earlier or later by up to a tenth of it, so that none keeps its place beside the pulses of a line.
#[must_use]
pub fn toggles(period: f64, width: u64, end: u64, seed: u64) -> Vec<u64> {
    let mut random = 2 * seed + 1;
    let period = 1.0137 * period;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let count = (end as f64 / period) as u64;
    let begins = (1..count).map(|n| ((n as f64 + 0.2 * next() - 0.1) * period).round() as u64);
    begins.flat_map(|begin| [begin, begin + width]).collect()
}

/// A line that is low at first and changes its level at each of these times, with these spikes.
#[must_use]
pub fn on_line(line: &[u64], spikes: &[u64]) -> Vec<(u64, bool)> {
    let mut times = [line, spikes].concat();
    times.sort_unstable();
    let mut edges: Vec<(u64, bool)> = Vec::new();
    let mut is_high = false;
    for time in times {
        is_high = !is_high;
        // Two at once are none.
        if edges.last().is_some_and(|(last, _)| *last == time) {
            edges.pop();
        } else {
            edges.push((time, is_high));
        }
    }
    edges
}
