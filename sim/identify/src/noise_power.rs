//! What a model leaves, beside the noise, in words and in numbers.

/// A ratio of powers beyond this is none to noise: the response would show its noise a millionth as large as what the model
/// leaves, and neither the digits of a log nor the sensor go so far.
const MOST: f64 = 1e12;

/// Power over that of the noise; `None` where the noise does not show.
#[must_use]
pub fn power_over_noise(ratio: f64) -> Option<f64> {
    (ratio <= MOST).then_some(ratio)
}

/// The same with so many decimals, as the end of "the model leaves".
#[must_use]
pub fn times_noise(ratio: f64, decimals: usize) -> String {
    match power_over_noise(ratio) {
        Some(ratio) => format!("{ratio:.decimals$} times the noise power"),
        None => String::from("more than the noise, which does not show"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_to_noise_that_does_not_show_is_none() {
        assert_eq!((power_over_noise(1.0), power_over_noise(1e9)), (Some(1.0), Some(1e9)));
        assert_eq!([1e13, f64::INFINITY, f64::NAN].map(power_over_noise), [None; 3]);
        assert_eq!(times_noise(1.234, 2), "1.23 times the noise power");
        assert!(times_noise(1e20, 2).contains("does not show"));
    }
}
