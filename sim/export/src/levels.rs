//! The response at the ends of a stack's motor output, from levels measured on both sides of them.

/// A level this close to an end of the motor output is that end: 5 us of a pulse's 1000. Chosen: a thrust that goes with the square of the
/// command differs by 1 % there; less refuses maps for a rounded command, more takes another thrust for the full one.
pub(super) const END: f64 = 0.005;

/// Levels through which a response between them goes. Chosen: a cubic, whose error for a smooth map in steps of a tenth is below what load
/// cells read; more let a level's noise reach further.
const NODES: usize = 4;

/// A response at a command.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    pub(super) command: f64,
    pub(super) response: f64,
    /// Standard error of the interpolation; 0 of a level that was measured.
    pub(super) error: f64,
    /// The levels that it is from, by their index, with the weight of each.
    pub(super) weights: Vec<(usize, f64)>,
}

impl Level {
    pub(super) fn measured(index: usize, (command, response): (f64, f64)) -> Self {
        Self { command, response, error: 0.0, weights: vec![(index, 1.0)] }
    }

    pub(super) fn is_interpolated(&self) -> bool {
        self.weights.len() > 1
    }

    /// Where a stack's highest motor output is, to which it refers thrust and speed. Levels are (command, response), commands increasing.
    pub(super) fn at_top(levels: &[(f64, f64)], top: f64) -> Result<Self, String> {
        Self::at(levels, top).ok_or_else(|| {
            let (highest, _) = levels.last().copied().unwrap_or((0.0, 0.0));
            format!(
                "the stack's highest motor output is a command of {top}, and the highest level measured is {highest:.3}: \
                 measure up to there, or limit the stack's output and state that with `--output-range`"
            )
        })
    }

    /// Where a stack's lowest motor output is, which is not standstill: the stack counts thrust from there.
    pub(super) fn at_bottom(levels: &[(f64, f64)], bottom: f64) -> Result<Self, String> {
        Self::at(levels, bottom).ok_or_else(|| {
            let (lowest, _) = levels.first().copied().unwrap_or((1.0, 0.0));
            format!(
                "the lowest command measured is {lowest:.3}, and the stack's lowest motor output is {bottom}: measure down to it, \
                 or state with `--output-range` what the stack's is"
            )
        })
    }

    /// The level measured there, or else interpolated; `None` beyond the levels.
    fn at(levels: &[(f64, f64)], at: f64) -> Option<Self> {
        let distance = |index: &usize| (levels[*index].0 - at).abs();
        let nearest = (0..levels.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        if distance(&nearest) <= END {
            return Some(Self::measured(nearest, levels[nearest]));
        }
        let above = levels.partition_point(|(command, _)| *command < at);
        let count = levels.len().min(NODES);
        let first = above.saturating_sub(NODES / 2).min(levels.len() - count);
        let mut nodes: Vec<usize> = (first..first + count).collect();
        nodes.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let ((_, before), (_, behind)) = (levels.get(above.checked_sub(1)?)?, levels.get(above)?);
        // As monotone as the map: not beyond the levels on either side.
        let response = |weights: &[(usize, f64)]| {
            let sum: f64 = weights.iter().map(|(index, weight)| weight * levels[*index].1).sum();
            sum.clamp(before.min(*behind), before.max(*behind))
        };
        let weights = lagrange(levels, &nodes, at);
        let coarser = response(&lagrange(levels, &nodes[..count - 1], at));
        let response = response(&weights);
        // What the farthest level adds is the size of what a further one would, at most, for a smooth map (Press et al., Numerical Recipes,
        // section 3.2).
        Some(Self { command: at, response, error: (response - coarser).abs(), weights })
    }
}

/// The nodes with their weights in the polynomial through them.
fn lagrange(levels: &[(f64, f64)], nodes: &[usize], at: f64) -> Vec<(usize, f64)> {
    let command = |index: usize| levels[index].0;
    let weight = |&node: &usize| {
        let others = nodes.iter().filter(|other| **other != node);
        (node, others.map(|&other| (at - command(other)) / (command(node) - command(other))).product())
    };
    nodes.iter().map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tenths(response: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        (0..=10).map(|k| f64::from(k) / 10.0).map(|u| (u, response(u))).collect()
    }

    #[test]
    fn a_cubic_is_exact_and_its_error_is_what_a_square_misses() {
        for at in [0.02, 0.055, 0.15, 0.43, 0.95] {
            let level = Level::at(&tenths(|u| 2.0 + u + u * u), at).unwrap();
            assert!((level.response - (2.0 + at + at * at)).abs() < 1e-12 && level.error < 1e-12, "{level:?}");
            let level = Level::at(&tenths(|u| u + u.powi(3)), at).unwrap();
            let miss = level.response - (at + at.powi(3));
            assert!(miss.abs() < 1e-12 && (1e-5..1e-3).contains(&level.error), "{level:?}");
        }
    }

    #[test]
    fn a_level_within_the_tolerance_is_the_end_and_nothing_is_beyond_the_levels() {
        let levels = tenths(|u| u);
        assert_eq!(Level::at(&levels, 0.904), Some(Level::measured(9, levels[9])));
        assert_eq!(Level::at(&levels[2..], 0.19), None);
        assert_eq!(Level::at(&levels[..10], 0.95), None);
        assert_eq!(Level::at(&[], 0.5), None);
    }

    #[test]
    fn a_kink_stays_between_its_neighbors() {
        let level = Level::at(&tenths(|u| (u - 0.3).max(0.0)), 0.25).unwrap();
        assert_eq!(level.response, 0.0);
        assert!(level.is_interpolated());
    }
}
