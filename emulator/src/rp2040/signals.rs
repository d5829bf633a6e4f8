//! What a flight controller puts on a line.

use super::{CYCLES_PER_S, Drive, Edge, Release};

/// Bits of a frame of DShot.
const FRAME_BITS: u32 = 16;

/// A line with pulses: from `start` on one each `period`, with the width that `width` gives for its number, until `end`. In cycles.
pub fn pulses(pin: u8, start: u64, period: u64, end: u64, mut width: impl FnMut(u64) -> u64) -> Vec<Edge> {
    let mut edges = vec![Edge { cycle: 0, pin, is_high: false }];
    for (n, rise) in (start..end).step_by(period as usize).enumerate() {
        edges.push(Edge { cycle: rise, pin, is_high: true });
        edges.push(Edge { cycle: rise + width(n as u64), pin, is_high: false });
    }
    edges
}

/// A line with frames of DShot, each with the cycle at which its first bit rises: 3/8 of a bit high for a zero, 6/8 for a one.
pub fn frames(pin: u8, bits_per_s: u32, frames: impl IntoIterator<Item = (u64, u16)>) -> Vec<Edge> {
    let bit = CYCLES_PER_S as f64 / f64::from(bits_per_s);
    let mut edges = vec![Edge { cycle: 0, pin, is_high: false }];
    for (start, bits) in frames {
        for n in 0..FRAME_BITS {
            let rise = start as f64 + f64::from(n) * bit;
            let high = if bits >> (FRAME_BITS - 1 - n) & 1 == 1 { 0.75 } else { 0.375 };
            edges.push(Edge { cycle: rise.round() as u64, pin, is_high: true });
            edges.push(Edge { cycle: (rise + high * bit).round() as u64, pin, is_high: false });
        }
    }
    edges
}

/// Bits for which a line that idles high is driven high before a frame.
const LEAD_BITS: f64 = 2.0;

/// The same for a line that idles high, inverted, and driven only from two bits before each frame to its end: edges, and where they end.
pub fn frames_of_idle_high(
    pin: u8,
    bits_per_s: u32,
    frames: impl IntoIterator<Item = (u64, u16)>,
) -> (Vec<Edge>, Vec<Release>) {
    let bit = CYCLES_PER_S as f64 / f64::from(bits_per_s);
    let (mut edges, mut releases) = (Vec::new(), Vec::new());
    for (start, bits) in frames {
        let at = |bits: f64| (start as f64 + bits * bit).round() as u64;
        edges.push(Edge { cycle: at(-LEAD_BITS), pin, is_high: true });
        for n in 0..FRAME_BITS {
            let low = if bits >> (FRAME_BITS - 1 - n) & 1 == 1 { 0.75 } else { 0.375 };
            edges.push(Edge { cycle: at(f64::from(n)), pin, is_high: false });
            edges.push(Edge { cycle: at(f64::from(n) + low), pin, is_high: true });
        }
        releases.push(Release { cycle: at(f64::from(FRAME_BITS)), pin });
    }
    (edges, releases)
}

/// What an ESC does after a frame of this rate: so many cycles after its end it drives `count` levels, the first the highest bit,
/// at 5/4 of the rate or at `clock` times that, then the idle level for another of them, and lets go.
pub fn reply(bits_per_s: u32, levels: u32, count: u32, delay: u64, clock: f64) -> Vec<Drive> {
    let frame_bit = CYCLES_PER_S as f64 / f64::from(bits_per_s);
    let bit = 0.8 * frame_bit / clock;
    let at = |place: u32| delay + (frame_bit + f64::from(place) * bit).round() as u64;
    let mut drives: Vec<_> = (0..count)
        .map(|place| Drive { after: at(place), level: Some(levels >> (count - 1 - place) & 1 != 0) })
        .collect();
    drives.push(Drive { after: at(count), level: Some(true) });
    drives.push(Drive { after: at(count + 1), level: None });
    drives
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rises, and how long the line is high after each.
    fn highs(edges: &[Edge]) -> Vec<(u64, u64)> {
        assert_eq!(edges[0], Edge { cycle: 0, pin: 2, is_high: false });
        let (pairs, rest) = edges[1..].as_chunks::<2>();
        assert!(rest.is_empty() && pairs.iter().all(|[rise, fall]| rise.is_high && !fall.is_high));
        pairs.iter().map(|[rise, fall]| (rise.cycle, fall.cycle - rise.cycle)).collect()
    }

    #[test]
    fn pulses_have_their_period_and_widths() {
        assert_eq!(highs(&pulses(2, 10, 100, 300, |n| 5 + n)), [(10, 5), (110, 6), (210, 7)]);
    }

    #[test]
    fn a_frame_of_an_idle_high_line_is_the_inverse_and_is_driven_no_longer_than_it_lasts() {
        let (edges, releases) = frames_of_idle_high(2, 125_000, [(5000, 0x8001)]);
        assert_eq!(releases, [Release { cycle: 21_000, pin: 2 }]);
        assert_eq!(edges[0], Edge { cycle: 3000, pin: 2, is_high: true });
        let inverse = frames(2, 125_000, [(5000, 0x8001)]);
        let turned: Vec<_> = edges[1..].iter().map(|edge| Edge { is_high: !edge.is_high, ..*edge }).collect();
        assert_eq!(turned, inverse[1..]);
    }

    #[test]
    fn a_reply_comes_behind_the_frame_at_five_fourths_of_its_rate() {
        let drives = reply(125_000, 0b010, 3, 4000, 1.0);
        let drives: Vec<_> = drives.iter().map(|drive| (drive.after, drive.level)).collect();
        let (low, high) = (Some(false), Some(true));
        assert_eq!(drives, [(5000, low), (5800, high), (6600, low), (7400, high), (8200, None)]);
    }

    #[test]
    fn the_first_bit_of_a_frame_is_its_highest() {
        // 1000 cycles in a bit.
        let found = highs(&frames(2, 125_000, [(50, 0x8001), (20_000, 0)]));
        assert_eq!(found.len(), 32);
        assert_eq!((found[0], found[1], found[15]), ((50, 750), (1050, 375), (15_050, 750)));
        assert!(found[16..].iter().all(|&(_, high)| high == 375));
    }
}
