//! An axis as the drawing library takes it.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged};
use rotorlead_answer::{Axis, Scale};

use super::super::ticks::ticks;

/// An axis with its ends and the values that are named.
#[derive(Clone)]
pub(super) struct Along {
    is_log: bool,
    is_reversed: bool,
    ends: (f64, f64),
    named: Vec<(f64, String)>,
}

impl Along {
    /// About `count` values are named. A reversed axis begins at the top.
    pub(super) fn new(axis: &Axis, ends: (f64, f64), count: usize, is_reversed: bool) -> Self {
        let named = ticks(&axis.scale, ends, count);
        Self { is_log: axis.scale == Scale::Log, is_reversed, ends, named }
    }

    /// What is said at a value.
    pub(super) fn name(&self, value: f64) -> String {
        self.named.iter().find(|(named, _)| *named == value).map_or_else(String::new, |(_, name)| name.clone())
    }
}

impl Ranged for Along {
    type ValueType = f64;
    type FormatOption = NoDefaultFormatting;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let (from, to) = self.ends;
        let part = if self.is_log { (value / from).ln() / (to / from).ln() } else { (value - from) / (to - from) };
        let part = if self.is_reversed { 1.0 - part } else { part };
        low + (part * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.named.iter().map(|(value, _)| *value).collect()
    }

    fn range(&self) -> Range<f64> {
        self.ends.0..self.ends.1
    }
}

impl plotters::coord::ranged1d::ValueFormatter<f64> for Along {
    fn format_ext(&self, value: &f64) -> String {
        self.name(*value)
    }
}
