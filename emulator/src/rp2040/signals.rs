//! What a flight controller puts on a line.

use super::{CYCLES_PER_S, Edge};

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
    fn the_first_bit_of_a_frame_is_its_highest() {
        // 1000 cycles in a bit.
        let found = highs(&frames(2, 125_000, [(50, 0x8001), (20_000, 0)]));
        assert_eq!(found.len(), 32);
        assert_eq!((found[0], found[1], found[15]), ((50, 750), (1050, 375), (15_050, 750)));
        assert!(found[16..].iter().all(|&(_, high)| high == 375));
    }
}
