//! The linear filters between rotor and logger, exact for inputs that are cubic in pieces.

use nalgebra::ComplexField;
use num_complex::Complex64;

use super::Memory;

/// Times that differ by less than this part count as the same where a filter keeps its exponentials: what rounding makes of evenly spaced
/// rows. Derived: rows of a millisecond after 1000 s are rounded by `1e-13 / 1e-3`.
const SAME_DURATION: f64 = 1e-10;
/// After so many time constants nothing is left of what was before. Derived: 3e-7, `e^-15`.
pub(super) const MEMORY_TIME_CONSTANTS: f64 = 15.0;
/// Durations whose exponentials are kept. Derived: commands, their coming out of a delay, and rows taken between them cut the time in three
/// lengths by turns.
const KEPT: usize = 3;

/// What a signal does over a time: its value and slope at both ends. Between them it is taken as the cubic through these
/// (Hermite), off by at most `d^4 / 384` of its fourth derivative over the duration `d`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// When it begins, seconds.
    pub from_s: f64,
    /// How long it is, seconds, above 0.
    pub duration_s: f64,
    /// Value at the begin, response units.
    pub start: f64,
    /// Slope just after the begin, per second.
    pub start_slope: f64,
    /// Value at the end.
    pub end: f64,
    /// Slope just before the end, per second.
    pub end_slope: f64,
}

impl Interval {
    /// The value at a moment within, by that cubic.
    #[must_use]
    pub fn at(&self, moment_s: f64) -> f64 {
        let part = (moment_s - self.from_s) / self.duration_s;
        let left = 1.0 - part;
        let ends = self.start * (left * left * (1.0 + 2.0 * part)) + self.end * (part * part * (3.0 - 2.0 * part));
        ends + self.duration_s * part * left * (self.start_slope * left - self.end_slope * part)
    }

    /// Its slope at a moment within.
    fn slope_at(&self, moment_s: f64) -> f64 {
        let part = (moment_s - self.from_s) / self.duration_s;
        let left = 1.0 - part;
        let ends = self.start_slope * (left * (left - 2.0 * part)) + self.end_slope * (part * (part - 2.0 * left));
        ends + 6.0 * part * left * (self.end - self.start) / self.duration_s
    }

    /// A part of it, which is the same cubic.
    pub(super) fn part(&self, from_s: f64, duration_s: f64) -> Self {
        let until_s = from_s + duration_s;
        let (start, end) = (self.at(from_s), self.at(until_s));
        Self { from_s, duration_s, start, start_slope: self.slope_at(from_s), end, end_slope: self.slope_at(until_s) }
    }
}

/// One link behind the rotor: it takes the response as it is and gives what the next link sees. Of a signal that is not a number, as a
/// fit may come by on its way, it makes one that is none either, and does not panic ([`f64::clamp`] does).
pub trait ResponseStage: Send {
    /// Puts the stage in the state it has when its input has been `level` for ever; gives its output then.
    fn settle(&mut self, level: f64) -> f64;

    /// Puts the output over the same time in place of the input. The next question begins where this one ended.
    fn advance(&mut self, signal: &mut Interval);

    /// The same over many intervals in a row. Not to be implemented: it is here to be compiled for each stage by itself.
    fn pass(&mut self, signals: &mut [Interval]) {
        signals.iter_mut().for_each(|signal| self.advance(signal));
    }

    /// The shortest time in which the output bends, seconds: what a later stage needs to know to follow it.
    fn time_scale_s(&self) -> f64 {
        f64::INFINITY
    }

    /// For how long what was shows in its output.
    fn memory(&self) -> Memory;

    /// Whether the output for the same input is another one later, memory aside.
    fn changes(&self) -> bool {
        false
    }

    /// The record's first row is at `at_s`.
    fn start_record(&mut self, _at_s: f64) {}
}

/// A pole, and the state that belongs to it: a real number, or a complex one that stands for a pair.
pub(super) trait Root: ComplexField<RealField = f64> + Copy {}

impl Root for f64 {}
impl Root for Complex64 {}

/// `dw/dt = pole w + input`, propagated exactly for a cubic input.
///
/// With `z = pole d` and the input `sum c_k theta^k`, `theta = t / d`:
/// `w(d) = e^z w(0) + d sum_k k! c_k phi_(k+1)(z)`, where `phi_0 = e^z` and `phi_(k+1) = (phi_k - 1 / k!) / z`
/// (Hochbruck & Ostermann, *Exponential integrators*, Acta Numerica 2010, eq. (2.11)).
#[derive(Clone, Debug)]
pub(super) struct Mode<T> {
    pole: T,
    state: T,
    /// Durations with the functions of each, and the place of the one that was kept last.
    kept: [(f64, [T; 5]); KEPT],
    latest: usize,
}

impl<T: Root> Mode<T> {
    /// A pole in rad/s, not at 0.
    pub(super) fn new(pole: T) -> Self {
        Self { pole, state: T::zero(), kept: [(-1.0, [T::one(); 5]); KEPT], latest: 0 }
    }

    /// At rest with an input that has been `level` for ever: `-level / pole`.
    pub(super) fn settle(&mut self, level: f64) {
        self.state = T::from_real(-level) / self.pole;
    }

    pub(super) fn state(&self) -> T {
        self.state
    }

    #[inline]
    pub(super) fn advance(&mut self, input: &Interval) {
        let d = input.duration_s;
        let is_same = |kept: &(f64, [T; 5])| (d - kept.0).abs() <= SAME_DURATION * d;
        let place = self.kept.iter().position(is_same).unwrap_or_else(|| {
            self.latest = (self.latest + 1) % KEPT;
            self.kept[self.latest] = (d, phi(self.pole.scale(d)));
            self.latest
        });
        let phi = &self.kept[place].1;
        let rise = input.end - input.start;
        let (begin, end) = (input.start_slope * d, input.end_slope * d);
        let (c2, c3) = (3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise);
        let forced = phi[1].scale(input.start) + phi[2].scale(begin) + phi[3].scale(2.0 * c2) + phi[4].scale(6.0 * c3);
        self.state = phi[0] * self.state + forced.scale(d);
    }
}

/// Terms of the series of `phi_4` beyond the first, up to 1 and up to [`SHORT`] in size. Derived: what follows is below 1e-16 of it, as `4!
/// / 21!` and `4! SHORT^10 / 14!` are.
const TERMS: usize = 16;
const FEW_TERMS: usize = 9;
const SHORT: f64 = 0.2;
/// `1 / n` from 5 on: the factor from each of the terms to the next.
const RECIPROCALS: [f64; TERMS] = {
    let mut reciprocals = [0.0; TERMS];
    let mut term = 0;
    while term < TERMS {
        reciprocals[term] = 1.0 / (term + 5) as f64;
        term += 1;
    }
    reciprocals
};

/// `phi_0` to `phi_4` at `z`.
fn phi<T: Root>(z: T) -> [T; 5] {
    const FACTORIALS: [f64; 4] = [1.0, 1.0, 2.0, 6.0];
    let mut phi = [T::one(); 5];
    let squared = z.modulus_squared();
    if squared > 1.0 {
        phi[0] = z.exp();
        for k in 0..4 {
            phi[k + 1] = (phi[k] - T::from_real(1.0 / FACTORIALS[k])) / z;
        }
    } else {
        // phi_4 by its series, where the recursion upward loses digits: sum z^n / (n + 4)!.
        let terms = if squared > SHORT * SHORT { TERMS } else { FEW_TERMS };
        let term = |sum: T, of_n: &f64| sum * z.scale(*of_n) + T::one();
        phi[4] = RECIPROCALS[..terms].iter().rev().fold(T::one(), term).scale(1.0 / 24.0);
        for k in (0..4).rev() {
            phi[k] = phi[k + 1] * z + T::from_real(1.0 / FACTORIALS[k]);
        }
    }
    phi
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_comes_out_as_the_analytic_solution_says() {
        // w = particular solution of w' = p w + t^3 plus e^(p t) times the rest.
        for pole in [Complex64::new(-3.0, 0.0), Complex64::new(-0.1, 8.0), Complex64::new(-400.0, 100.0)] {
            let mut mode = Mode::new(pole);
            mode.settle(0.0);
            let particular = |t: f64| {
                let p = pole;
                -(Complex64::from(t.powi(3)) / p
                    + 3.0 * t * t / (p * p)
                    + 6.0 * t / (p * p * p)
                    + 6.0 / (p * p * p * p))
            };
            let mut t = 0.0;
            for d in [0.1, 0.003, 1e-5, 0.3, 0.02] {
                let input = Interval {
                    from_s: t,
                    duration_s: d,
                    start: t.powi(3),
                    start_slope: 3.0 * t * t,
                    end: (t + d).powi(3),
                    end_slope: 3.0 * (t + d).powi(2),
                };
                mode.advance(&input);
                t += d;
                let exact = particular(t) - particular(0.0) * (pole * t).exp();
                assert!((mode.state() - exact).norm() < 1e-14, "{pole} at {t}: {} for {exact}", mode.state());
            }
        }
    }

    #[test]
    fn an_interval_is_the_cubic_that_it_was_taken_from() {
        let cubic = |t: f64| 2.0 - t + 3.0 * t * t - 4.0 * t * t * t;
        let slope = |t: f64| -1.0 + 6.0 * t - 12.0 * t * t;
        let interval = Interval {
            from_s: 0.2,
            duration_s: 0.5,
            start: cubic(0.2),
            start_slope: slope(0.2),
            end: cubic(0.7),
            end_slope: slope(0.7),
        };
        for t in [0.2, 0.25, 0.4, 0.69, 0.7] {
            assert!((interval.at(t) - cubic(t)).abs() < 1e-14, "{t}");
        }
        let part = interval.part(0.3, 0.2);
        for (is, expected) in [(part.start, cubic(0.3)), (part.end, cubic(0.5))] {
            assert!((is - expected).abs() < 1e-14, "{part:?}");
        }
        for (is, expected) in [(part.start_slope, slope(0.3)), (part.end_slope, slope(0.5))] {
            assert!((is - expected).abs() < 1e-13, "{part:?}");
        }
    }

    #[test]
    fn both_ways_to_the_phi_functions_agree_where_they_meet() {
        for angle in 0..16 {
            let z = Complex64::from_polar(1.0, f64::from(angle) * 0.4);
            for (a, b) in phi(z * 0.999_999).iter().zip(phi(z * 1.000_001)) {
                assert!((a - b).norm() < 1e-5 && (a - b).norm() > 1e-9, "{z}: {a} {b}");
            }
        }
    }
}
