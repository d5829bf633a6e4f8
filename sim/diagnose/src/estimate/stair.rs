//! How well a place is known where a chi-square is least that is a stair of many small steps.
//!
//! Each command that changes sides adds its own part `d` to the mean of the chi-square `S`, and a random one of the variance `4 d` by
//! the noise: on either side `S` is a random walk upward. With `u` the mean of `S`, the place of the least is that of the largest of
//! `W(u) - |u| / 2`, `W` a Wiener process on both sides. It lies within 11.03 of the middle in 95 of 100 (Yao, Approximating the
//! distribution of the maximum likelihood estimate of the change-point, Annals of Statistics 15, 1987), more than 1.96 of its
//! standard deviations, `sqrt(26)`: the tails are long. Seen from its least, which it does not go below, `S` first rises by `c` where `u`
//! is `c - 4` on average: the mean time that a walk of drift 1 and variance 4 takes that is conditioned to stay above 0,
//! `c coth(c / 4) - 4`. So that 1.96 of it are the interval of 95 %,
//!
//! ```text
//! std = 11.03 / 1.96 / (c - 4) x_c
//! ```
//!
//! with `x_c` how far that is.

/// The place where `W(u) - |u| / 2` is largest lies within this in 95 of 100, by the deviations that a normal one has there. Standard: Yao
/// 1987, and the normal quantile at 97.5 %.
const YAO: f64 = 11.03 / 1.96;
/// How much sooner than on average a walk has risen that is seen from its least. Derived: the limit of `c - c coth(c / 4) + 4` for a large
/// `c`.
const SOONER: f64 = 4.0;
/// A rise that all of the stair is seen over, where its mean is known to be a parabola. Chosen: that of a profile. It sets the factor of
/// 1.38, which would be 2.4 at half of it and 0.9 at twice of it.
const RISE: f64 = 24.0;

/// Of a stair that has risen by `rise`, well above 4, at this `distance` from where it is least.
pub(crate) fn std(distance: f64, rise: f64) -> f64 {
    YAO / (rise - SOONER) * distance
}

/// Of a stair whose mean is a parabola with this standard error by its curvature: 1.38 of that.
pub(crate) fn std_of_parabola(by_curvature: f64) -> f64 {
    std(RISE.sqrt() * by_curvature, RISE)
}
