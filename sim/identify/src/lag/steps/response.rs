//! The response of a lag to a staircase, in closed form.
//!
//! Between two changes of the command the response `w` moves toward the level `W` that the static map
//! gives:
//!
//! `dw/dt = (W - w)/tau (1 + k (w - W)/R)`, with `R` the highest level
//!
//! `k = 0` is the first-order lag. A motor against the propeller's drag has
//! `dw/dt = a u - b w - c w^2 - e`, which is this with `1/tau = b + 2 c W` and
//! `k = c R tau`: 0 without drag, 1/2 with nothing but drag at the highest level, more below it. So `tau` is the time constant of small
//! motions about `W`, the one a linear model needs, while a large step starts faster from above and
//! slower from below. With `x = w - W` it is Bernoulli's equation and its solution is exact at any
//! time, so sampling, uneven or not, adds no error:
//!
//! `x(t) = x0 E / (1 + k x0/R (1 - E))`, `E = exp(-t/tau)`
//!
//! Where the response is a thrust, the square of a speed that lags so ([`Lagged::SquareRoot`]), `w` is its square root, and the response
//! is `w^2 = W^2 + x (2 W + x)`.
//!
//! So is its integral, of which the readings of a sensor are that counts pulses or averages between two readings:
//!
//! `int_0^t x dt = x0 tau ln(1 + b (1 - E)) / b`, `b = k x0/R`
//!
//! and, with `D = 1 + b (1 - E)`, `int_0^t x^2 dt = x0^2 tau ((1 + b) (1 - 1/D) - ln D) / b^2`.

use rotorlead_plant::Lagged;

/// A segment of constant command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// When the command changes to it, seconds.
    pub(super) from_s: f64,
    /// What the response moves toward.
    pub(super) level: f64,
    /// Time constant of small motions about the level, seconds.
    pub(super) time_constant_s: f64,
    /// Delay of the change, seconds.
    pub(super) delay_s: f64,
    /// `k/R`, one over the units of what lags.
    pub(super) bend: f64,
    /// What goes to the level as a lag.
    pub(super) lagged: Lagged,
}

impl Segment {
    /// What lags, above that of the level, where the response is `excess` above the level.
    fn excess_of_lagged(&self, excess: f64) -> f64 {
        self.lagged.at_response(self.level + excess) - self.lagged.at_response(self.level)
    }
}

/// Writes the response at `time_s` (increasing) into `out`; it starts settled on the first segment.
/// `false` when the parameters have no response: a time constant that is not positive, changes that
/// overtake each other, a bend that makes the response run away.
pub(super) fn simulate(segments: &[Segment], time_s: &[f64], out: &mut [f64]) -> bool {
    let Some(first) = segments.first() else {
        return false;
    };
    let mut excess = 0.0;
    let mut current = *first;
    let mut rest = &segments[1..];
    let mut ok = true;
    for (&t, w) in time_s.iter().zip(out) {
        while let Some((next, later)) = rest.split_first() {
            let switch = next.from_s + next.delay_s;
            if switch > t {
                break;
            }
            ok &= switch >= current.from_s + current.delay_s;
            excess = value(&current, excess, switch, &mut ok) - next.level;
            current = *next;
            rest = later;
        }
        *w = value(&current, excess, t, &mut ok);
    }
    ok
}

/// The response at `t`, having been `excess` above the segment's level when the change took effect; still
/// there before. Clears `ok` as [`simulate`] does.
pub(super) fn value(segment: &Segment, excess: f64, t: f64, ok: &mut bool) -> f64 {
    let elapsed = t - segment.from_s - segment.delay_s;
    *ok &= segment.time_constant_s > 0.0;
    if elapsed < 0.0 {
        return segment.level + excess;
    }
    let decay = (-elapsed / segment.time_constant_s).exp();
    let excess = segment.excess_of_lagged(excess);
    let bend = 1.0 + segment.bend * excess * (1.0 - decay);
    *ok &= bend > 0.0;
    segment.lagged.response(segment.lagged.at_response(segment.level) + excess * decay / bend)
}

/// The mean of the response over the `mean_s` before `t`; its value there for no time at all. Clears `ok` as [`simulate`] does.
pub(super) fn mean_value(segment: &Segment, excess: f64, t: f64, mean_s: f64, ok: &mut bool) -> f64 {
    let end = value(segment, excess, t, ok);
    if mean_s == 0.0 {
        return end;
    }
    let elapsed = t - segment.from_s - segment.delay_s;
    let start = segment.excess_of_lagged(excess);
    let bend = segment.bend * start;
    let area = |elapsed: f64| {
        if elapsed < 0.0 {
            return excess * elapsed;
        }
        let gone = -(-elapsed / segment.time_constant_s).exp_m1();
        // Derived: behind the first two terms of the logarithm comes less than a double's rounding.
        let bent = if bend.abs() < 1e-8 { gone * (1.0 - 0.5 * bend * gone) } else { (bend * gone).ln_1p() / bend };
        let first = start * segment.time_constant_s * bent;
        match segment.lagged {
            Lagged::Response => first,
            Lagged::SquareRoot => {
                let level = segment.lagged.at_response(segment.level);
                2.0 * level * first + start * start * segment.time_constant_s * area_of_square(gone, bend)
            }
        }
    };
    segment.level + (area(elapsed) - area(elapsed - mean_s)) / mean_s
}

/// `int x^2 dt / (x0^2 tau)` where `gone` of an exponential is gone.
fn area_of_square(gone: f64, bend: f64) -> f64 {
    // Derived: the closed form loses digits with one over the square of the bend, and the third term of the series goes with that square:
    // here either is off by 1e-8.
    if bend.abs() < 1e-4 {
        return gone * (1.0 - 0.5 * gone) - bend * gone * gone * (1.0 - 2.0 / 3.0 * gone);
    }
    let bent = 1.0 + bend * gone;
    ((1.0 + bend) * (1.0 - 1.0 / bent) - (bend * gone).ln_1p()) / (bend * bend)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The closed form against Runge-Kutta on `dw/dt = a u - b w - c w^2 - e`.
    #[test]
    fn closed_form_is_the_motor_with_drag() {
        let (b, c) = (4.0, 1.2e-3);
        let torque = |w: f64| b * w + c * w * w;
        let level = [3000.0, 9000.0, 2000.0];
        let segment = |k: usize| {
            let tau = 1.0 / (b + 2.0 * c * level[k]);
            let from_s = k as f64 * 0.2;
            Segment {
                from_s,
                level: level[k],
                time_constant_s: tau,
                delay_s: 0.0137,
                bend: c * tau,
                lagged: Lagged::Response,
            }
        };
        for k in 1..3 {
            let (to, from) = (segment(k), segment(k - 1));
            let time_s: Vec<f64> = (0..150).map(|i| to.from_s + 0.0011 * i as f64).collect();
            let mut w = vec![0.0; time_s.len()];
            assert!(simulate(&[Segment { from_s: -10.0, ..from }, to], &time_s, &mut w));
            let mut truth = level[k - 1];
            let mut t = to.from_s + to.delay_s;
            for (&at, &w) in time_s.iter().zip(&w) {
                while t < at - 1e-12 {
                    let h = (at - t).min(1e-4);
                    let f = |w: f64| torque(level[k]) - torque(w);
                    let k1 = f(truth);
                    let k2 = f(truth + 0.5 * h * k1);
                    let k3 = f(truth + 0.5 * h * k2);
                    let k4 = f(truth + h * k3);
                    truth += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                    t += h;
                }
                assert!((w - truth).abs() < 1e-6, "at {at}: {w} {truth}");
            }
        }
    }
    #[test]
    fn the_mean_is_that_of_the_response() {
        let bends = [0.0, 1e-12, 2e-4, -1e-4].into_iter();
        let bends = bends.flat_map(|bend| [(bend, Lagged::Response), (60.0 * bend, Lagged::SquareRoot)]);
        for (bend, lagged) in bends {
            let segment = Segment { from_s: 0.2, level: 5000.0, time_constant_s: 0.05, delay_s: 0.013, bend, lagged };
            for (excess, t, mean_s) in
                [(-3000.0, 0.25, 0.1), (2000.0, 0.3, 0.02), (2000.0, 0.21, 0.05), (-3000.0, 0.5, 0.1)]
            {
                let mut ok = true;
                let parts = 20_000;
                let at = |k: usize| t - mean_s * (k as f64 + 0.5) / parts as f64;
                let right = (0..parts).map(|k| value(&segment, excess, at(k), &mut true)).sum::<f64>() / parts as f64;
                let found = mean_value(&segment, excess, t, mean_s, &mut ok);
                assert!(ok && (found - right).abs() < 1e-3, "{bend} {lagged:?} {excess} {t}: {found} {right}");
            }
        }
    }
}
