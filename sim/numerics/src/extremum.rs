//! Extremes of functions of one variable.

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
}
