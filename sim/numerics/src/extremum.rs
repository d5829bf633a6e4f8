//! Extremes of functions of one variable.

/// Part of an interval that golden section keeps.
const KEPT: f64 = 0.618_033_988_749_894_9;

/// The parabola through three points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parabola {
    /// Abscissa of the middle point.
    middle: f64,
    /// Slope there.
    slope: f64,
    /// Half the second derivative.
    curvature: f64,
}

impl Parabola {
    /// Through three points of different abscissas.
    #[must_use]
    pub fn through([(a, at_a), (b, at_b), (c, at_c)]: [(f64, f64); 3]) -> Self {
        let (before, after) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
        let curvature = (after - before) / (c - a);
        Self { middle: b, slope: before + curvature * (b - a), curvature }
    }

    /// Half the second derivative: positive where it opens upward.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        self.curvature
    }

    /// Where it is least; `None` unless it opens upward and all three points are finite.
    #[must_use]
    pub fn lowest(&self) -> Option<f64> {
        let lowest = self.middle - 0.5 * self.slope / self.curvature;
        (self.curvature > 0.0 && lowest.is_finite()).then_some(lowest)
    }
}

/// Where a function with one maximum between `low` and `high` has it, to `share` of their distance (golden section; Kiefer
/// 1953). A maximum flatter than the function's own rounding is found to that only.
#[must_use]
pub fn maximum(value: impl Fn(f64) -> f64, low: f64, high: f64, share: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    let steps = (share.ln() / KEPT.ln()).ceil() as u32;
    let (mut left, mut right) = (high - KEPT * (high - low), low + KEPT * (high - low));
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..steps {
        if at_left < at_right {
            (low, left, at_left) = (left, right, at_right);
            right = low + KEPT * (high - low);
            at_right = value(right);
        } else {
            (high, right, at_right) = (right, left, at_left);
            left = high - KEPT * (high - low);
            at_left = value(left);
        }
    }
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertex_of_a_known_parabola() {
        // 3 (x - 2)^2 + 5, at uneven distances.
        let at = |x: f64| (x, 3.0 * (x - 2.0) * (x - 2.0) + 5.0);
        for points in [[at(1.0), at(1.5), at(4.0)], [at(5.0), at(6.5), at(7.0)], [at(-1e3), at(0.0), at(1e3)]] {
            let parabola = Parabola::through(points);
            assert!((parabola.lowest().unwrap() - 2.0).abs() < 1e-9, "{parabola:?}");
            assert!((parabola.curvature() - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_line_and_a_cap_have_no_least() {
        assert_eq!(Parabola::through([(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]).lowest(), None);
        assert_eq!(Parabola::through([(0.0, 1.0), (1.0, 2.0), (2.0, 1.0)]).lowest(), None);
        assert_eq!(Parabola::through([(0.0, f64::INFINITY), (1.0, 2.0), (2.0, f64::INFINITY)]).lowest(), None);
    }

    #[test]
    fn the_maximum_lies_within_the_share_that_is_asked_for() {
        // Of |x| the error is not hidden by rounding.
        for peak in [-3.0, -0.1, 0.0, 2.5, 7.0] {
            for share in [1e-2, 1e-6, 1e-12] {
                let found = maximum(|x| -f64::abs(x - peak), -3.0, 7.0, share);
                assert!((found - peak).abs() <= 10.0 * share, "{peak} {share}: {found}");
            }
        }
        // A smooth maximum is flat over the root of the rounding unit.
        let found = maximum(f64::sin, 0.0, 3.0, 1e-10);
        assert!((found - std::f64::consts::FRAC_PI_2).abs() < 1e-7, "{found}");
    }
}
