//! The model as a product of sections of first and second order: what the search moves.
//!
//! ```text
//! G(s) = K prod(1 + b_1 x + b_2 x^2) / prod(1 + a_1 x + a_2 x^2),   x = s / w_section
//! ```
//!
//! Each section's scale `w_section` is the magnitude of its roots at the start. The coefficients are then near one, each
//! moves the response around its own frequency only, and they pass smoothly from a complex pair to two real roots and,
//! for zeros, through infinity. This keeps the problem well conditioned at orders where polynomial coefficients are not.

use num_complex::Complex64;

/// Scale and order of one section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) scale_rad_s: f64,
    /// Number of its roots, one or two.
    pub(super) order: usize,
}

impl Section {
    fn value(&self, coefficients: &[f64], s: Complex64) -> Complex64 {
        let x = s / self.scale_rad_s;
        match *coefficients {
            [c1, c2] => 1.0 + x * (c1 + x * c2),
            [c1] => 1.0 + x * c1,
            _ => Complex64::ONE,
        }
    }

    /// The roots in rad/s, the one in the upper half plane first.
    pub(super) fn roots(&self, coefficients: &[f64]) -> Vec<Complex64> {
        let scaled = match *coefficients {
            [c1, c2] => {
                let discriminant = c1 * c1 - 4.0 * c2;
                if discriminant < 0.0 {
                    let root = Complex64::new(-c1, (-discriminant).sqrt()) / (2.0 * c2);
                    let upper = Complex64::new(root.re, root.im.abs());
                    vec![upper, upper.conj()]
                } else {
                    // Without the cancellation of the textbook formula.
                    let q = -0.5 * (c1 + discriminant.sqrt().copysign(c1));
                    vec![Complex64::new(1.0 / q, 0.0), Complex64::new(q / c2, 0.0)]
                }
            }
            [c1] => vec![Complex64::new(-1.0 / c1, 0.0)],
            _ => vec![],
        };
        scaled.into_iter().map(|root| root * self.scale_rad_s).collect()
    }

    /// Whether both roots are in the left half plane.
    fn is_stable(coefficients: &[f64]) -> bool {
        coefficients.iter().all(|c| *c > 0.0)
    }
}

/// The sections of a model, and where their coefficients are among the parameters:
/// `[K, denominator.., numerator..]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sections {
    pub(super) denominator: Vec<Section>,
    pub(super) numerator: Vec<Section>,
}

/// One section with the place of its first coefficient.
pub(super) type Placed<'a> = (&'a Section, std::ops::Range<usize>);

impl Sections {
    /// Sections and parameters for a gain, and roots in rad/s. Roots beyond `range_rad_s` are
    /// moved to its ends: what the lines do not show cannot be started from.
    pub(super) fn from_roots(
        gain: f64,
        poles: &[Complex64],
        zeros: &[Complex64],
        range_rad_s: (f64, f64),
    ) -> (Self, Vec<f64>) {
        let mut parameters = vec![gain];
        let mut sections = |roots: &[Complex64]| -> Vec<Section> {
            group(&clip(roots, range_rad_s))
                .into_iter()
                .map(|roots| {
                    let product = roots.iter().product::<Complex64>().re;
                    let scale_rad_s = product.abs().powf(1.0 / roots.len() as f64);
                    parameters.push(-roots.iter().map(|r| scale_rad_s / r).sum::<Complex64>().re);
                    if roots.len() == 2 {
                        parameters.push(scale_rad_s * scale_rad_s / product);
                    }
                    Section { scale_rad_s, order: roots.len() }
                })
                .collect()
        };
        let denominator = sections(poles);
        let numerator = sections(zeros);
        (Self { denominator, numerator }, parameters)
    }

    /// The denominator's sections, each with the range of its coefficients among the parameters.
    pub(super) fn placed_poles(&self) -> impl Iterator<Item = Placed<'_>> {
        place(&self.denominator, 1)
    }

    /// The numerator's.
    pub(super) fn placed_zeros(&self) -> impl Iterator<Item = Placed<'_>> {
        place(&self.numerator, 1 + self.denominator.iter().map(|s| s.order).sum::<usize>())
    }

    pub(super) fn poles(&self, parameters: &[f64]) -> Vec<Complex64> {
        self.placed_poles().flat_map(|(section, at)| section.roots(&parameters[at])).collect()
    }

    pub(super) fn zeros(&self, parameters: &[f64]) -> Vec<Complex64> {
        self.placed_zeros().flat_map(|(section, at)| section.roots(&parameters[at])).collect()
    }

    pub(super) fn is_stable(&self, parameters: &[f64]) -> bool {
        self.placed_poles().all(|(_, at)| Section::is_stable(&parameters[at]))
    }

    /// The response at a frequency in rad/s.
    pub(super) fn response(&self, parameters: &[f64], omega_rad_s: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega_rad_s);
        let mut value = Complex64::from(parameters[0]);
        for (section, at) in self.placed_poles() {
            value /= section.value(&parameters[at], s);
        }
        for (section, at) in self.placed_zeros() {
            value *= section.value(&parameters[at], s);
        }
        value
    }

    /// The response, and its derivative by each parameter into `out`.
    pub(super) fn gradient(&self, parameters: &[f64], omega_rad_s: f64, out: &mut [Complex64]) -> Complex64 {
        let s = Complex64::new(0.0, omega_rad_s);
        let without_gain = {
            let mut unit = Complex64::ONE;
            for (section, at) in self.placed_poles() {
                unit /= section.value(&parameters[at], s);
            }
            unit
        };
        let mut numerator = Complex64::ONE;
        for (section, at) in self.placed_zeros() {
            numerator *= section.value(&parameters[at], s);
        }
        out[0] = without_gain * numerator;
        let value = out[0] * parameters[0];
        for (section, at) in self.placed_poles() {
            let x = s / section.scale_rad_s;
            let by_first = -value * x / section.value(&parameters[at.clone()], s);
            out[at.start] = by_first;
            if section.order == 2 {
                out[at.start + 1] = by_first * x;
            }
        }
        for (index, (section, at)) in self.placed_zeros().enumerate() {
            let x = s / section.scale_rad_s;
            let own = section.value(&parameters[at.clone()], s);
            let others = if own == Complex64::ZERO {
                let others = self.placed_zeros().enumerate().filter(|(other, _)| *other != index);
                others.map(|(_, (section, at))| section.value(&parameters[at], s)).product()
            } else {
                numerator / own
            };
            let by_first = without_gain * parameters[0] * others * x;
            out[at.start] = by_first;
            if section.order == 2 {
                out[at.start + 1] = by_first * x;
            }
        }
        value
    }
}

fn place(sections: &[Section], first: usize) -> impl Iterator<Item = Placed<'_>> {
    sections.iter().scan(first, |next, section| {
        let at = *next..*next + section.order;
        *next = at.end;
        Some((section, at))
    })
}

fn clip(roots: &[Complex64], (least, most): (f64, f64)) -> Vec<Complex64> {
    roots
        .iter()
        .map(|root| match root.norm() {
            norm if norm > most => root * (most / norm),
            0.0 => Complex64::new(-least, 0.0),
            norm if norm < least => root * (least / norm),
            _ => *root,
        })
        .collect()
}

/// Roots by sections: complex ones with their conjugates, real ones with the nearest of the same sign, so that two that
/// are about to become complex are in one section.
pub(super) fn group(roots: &[Complex64]) -> Vec<Vec<Complex64>> {
    // Chosen: what is below is the rounding of an eigenvalue.
    let is_real = |root: &Complex64| root.im.abs() <= 1e-12 * root.norm();
    let mut groups: Vec<Vec<Complex64>> =
        roots.iter().filter(|r| !is_real(r) && r.im > 0.0).map(|r| vec![*r, r.conj()]).collect();
    let mut real: Vec<f64> = roots.iter().filter(|r| is_real(r)).map(|r| r.re).collect();
    real.sort_by(|a, b| a.total_cmp(b));
    while real.len() > 1 {
        let distance = |i: &usize| {
            let ratio: f64 = real[*i] / real[i + 1];
            // Opposite signs never meet at a finite frequency: they are paired last.
            if ratio > 0.0 { ratio.ln().abs() } else { f64::MAX }
        };
        let nearest = (0..real.len() - 1).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        let pair = real.drain(nearest..nearest + 2).map(|r| Complex64::new(r, 0.0)).collect();
        groups.push(pair);
    }
    groups.extend(real.into_iter().map(|r| vec![Complex64::new(r, 0.0)]));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn c(re: f64, im: f64) -> Complex64 {
        Complex64::new(re, im)
    }

    fn sample() -> (Sections, Vec<f64>, Vec<Complex64>, Vec<Complex64>) {
        let poles = vec![c(-3.0, 40.0), c(-3.0, -40.0), c(-20.0, 0.0), c(-300.0, 0.0), c(-21.0, 0.0)];
        let zeros = vec![c(90.0, 30.0), c(90.0, -30.0), c(500.0, 0.0)];
        let (sections, parameters) = Sections::from_roots(2.5, &poles, &zeros, (1e-3, 1e6));
        (sections, parameters, poles, zeros)
    }

    #[test]
    fn sections_have_the_response_and_the_roots_they_were_made_of() {
        let (sections, parameters, poles, zeros) = sample();
        for omega in [0.5, 40.0, 700.0] {
            let s = c(0.0, omega);
            let expected = 2.5 * zeros.iter().map(|z| 1.0 - s / z).product::<Complex64>()
                / poles.iter().map(|p| 1.0 - s / p).product::<Complex64>();
            assert!((sections.response(&parameters, omega) - expected).norm() < 1e-12 * expected.norm());
        }
        for (found, expected) in [(sections.poles(&parameters), poles), (sections.zeros(&parameters), zeros)] {
            assert_eq!(found.len(), expected.len());
            for e in expected {
                assert!(found.iter().any(|f| (f - e).norm() < 1e-10 * e.norm()), "{e} {found:?}");
            }
        }
    }

    #[test]
    fn neighboring_real_roots_share_a_section() {
        let groups = group(&[c(-300.0, 0.0), c(-20.0, 0.0), c(-21.0, 0.0)]);
        assert_eq!(groups, [vec![c(-21.0, 0.0), c(-20.0, 0.0)], vec![c(-300.0, 0.0)]]);
    }

    #[test]
    fn the_gradient_is_the_derivative() {
        let (sections, parameters, ..) = sample();
        let mut gradient = vec![Complex64::ZERO; parameters.len()];
        for omega in [0.5, 40.0, 700.0] {
            let value = sections.gradient(&parameters, omega, &mut gradient);
            assert!((value - sections.response(&parameters, omega)).norm() < 1e-12 * value.norm());
            for (j, analytic) in gradient.iter().enumerate() {
                let shifted = |by: f64| {
                    let mut p = parameters.clone();
                    p[j] += by;
                    sections.response(&p, omega)
                };
                let h = 1e-6 * parameters[j].abs();
                let numeric = (shifted(h) - shifted(-h)) / (2.0 * h);
                assert!((analytic - numeric).norm() < 1e-6 * (analytic.norm() + value.norm()), "{j} at {omega}");
            }
        }
    }
}
