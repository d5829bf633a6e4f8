//! Which harmonics a multisine has, and how strong each is.

use super::MultisineError;

/// The highest harmonic. Chosen: it keeps the finest grid of the search at 2^24 samples, 128 MB; 6.5 kHz at a period of 10 s is beyond any
/// motor.
const HIGHEST_HARMONIC: u32 = 1 << 16;

/// Harmonics of `1 / period` and their amplitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSet {
    harmonics: Vec<u32>,
    amplitudes: Vec<f64>,
}

impl LineSet {
    /// Any harmonics, by increasing number from 1, with one positive amplitude each (only their
    /// ratios matter).
    ///
    /// # Errors
    /// [`MultisineError`] names the place in the list that breaks a rule.
    pub fn new(harmonics: Vec<u32>, amplitudes: Vec<f64>) -> Result<Self, MultisineError> {
        let Some(&top) = harmonics.last() else {
            return Err(MultisineError::NoLine);
        };
        let mut previous = 0;
        for (place, &harmonic) in harmonics.iter().enumerate() {
            if harmonic <= previous {
                return Err(MultisineError::NotIncreasing { place, harmonic });
            }
            previous = harmonic;
        }
        if top > HIGHEST_HARMONIC {
            return Err(MultisineError::TooHigh { harmonic: top, limit: HIGHEST_HARMONIC });
        }
        let bad = amplitudes.iter().position(|a| !(a.is_finite() && *a > 0.0));
        if let Some(place) = bad {
            return Err(MultisineError::Amplitude { place });
        }
        if amplitudes.len() != harmonics.len() {
            return Err(MultisineError::Amplitude { place: amplitudes.len().min(harmonics.len()) });
        }
        Ok(Self { harmonics, amplitudes })
    }

    /// Harmonics of equal, unit amplitude.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn equal(harmonics: Vec<u32>) -> Result<Self, MultisineError> {
        let amplitudes = vec![1.0; harmonics.len()];
        Self::new(harmonics, amplitudes)
    }

    /// The first `count` odd harmonics, of unit amplitude: 150 of a period of 10 s reach from 0.1 to
    /// 29.9 Hz.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn odd(count: u32) -> Result<Self, MultisineError> {
        Self::equal((0..count).map(|k| k.saturating_mul(2).saturating_add(1)).collect())
    }

    /// The odd harmonics of `1 / period_s` from `low_hz` to `high_hz`, both included, of unit
    /// amplitude.
    ///
    /// # Errors
    /// As [`Self::new`], and when the band or the period is no range.
    pub fn odd_in_band(low_hz: f64, high_hz: f64, period_s: f64) -> Result<Self, MultisineError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        for (parameter, value, good) in [
            ("period_s", period_s, positive(period_s)),
            ("low_hz", low_hz, low_hz == 0.0 || positive(low_hz)),
            ("high_hz", high_hz, positive(high_hz) && high_hz > low_hz),
        ] {
            if !good {
                return Err(MultisineError::Band { parameter, value });
            }
        }
        // Edges that lie on a line in decimals must not lose it to their rounding. Chosen: far above a rounding, 1e-16, and far below the
        // distance of two lines, 1e-5 of the highest.
        let slack = 1e-9;
        let low = (low_hz * period_s * (1.0 - slack)).ceil();
        let high = (high_hz * period_s * (1.0 + slack)).floor();
        if high > f64::from(HIGHEST_HARMONIC) {
            let harmonic = if high < f64::from(u32::MAX) { high as u32 } else { u32::MAX };
            return Err(MultisineError::TooHigh { harmonic, limit: HIGHEST_HARMONIC });
        }
        Self::equal((low as u32..=high as u32).filter(|harmonic| harmonic % 2 == 1).collect())
    }

    /// Numbers of the harmonics, increasing.
    #[must_use]
    pub fn harmonics(&self) -> &[u32] {
        &self.harmonics
    }

    /// Amplitude of each harmonic.
    #[must_use]
    pub fn amplitudes(&self) -> &[f64] {
        &self.amplitudes
    }

    /// The highest harmonic.
    #[must_use]
    pub fn top_harmonic(&self) -> u32 {
        // A set has at least one line; without one, 0 is right too.
        self.harmonics.last().copied().unwrap_or(0)
    }

    /// Root of the mean square over a period, whatever the phases (Parseval).
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.amplitudes.iter().map(|a| a * a).sum::<f64>() / 2.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_of_the_paper_has_150_lines_and_the_wider_one_225() {
        let narrow = LineSet::odd_in_band(0.1, 30.0, 10.0).unwrap();
        assert_eq!(narrow, LineSet::odd(150).unwrap());
        let wide = LineSet::odd_in_band(0.1, 45.0, 10.0).unwrap();
        assert_eq!((wide.harmonics().len(), wide.top_harmonic()), (225, 449));
        // 29.9 * 10 is 299.00000000000006 or 298.99999999999994, depending on the machine's mood.
        assert_eq!(LineSet::odd_in_band(0.1, 29.9, 10.0).unwrap(), narrow);
    }

    #[test]
    fn what_makes_no_set_is_refused_by_place_and_name() {
        use MultisineError::*;
        assert_eq!(LineSet::odd(0), Err(NoLine));
        assert_eq!(LineSet::equal(vec![0, 1]), Err(NotIncreasing { place: 0, harmonic: 0 }));
        assert_eq!(LineSet::equal(vec![1, 3, 3]), Err(NotIncreasing { place: 2, harmonic: 3 }));
        assert_eq!(LineSet::new(vec![1, 3], vec![1.0]), Err(Amplitude { place: 1 }));
        assert_eq!(LineSet::new(vec![1, 3], vec![1.0, f64::NAN]), Err(Amplitude { place: 1 }));
        assert!(matches!(LineSet::equal(vec![1 << 20]), Err(TooHigh { .. })));
        for (low, high, period, name) in [
            (0.1, 30.0, 0.0, "period_s"),
            (-1.0, 30.0, 10.0, "low_hz"),
            (5.0, 5.0, 10.0, "high_hz"),
            (0.1, f64::INFINITY, 10.0, "high_hz"),
        ] {
            let error = LineSet::odd_in_band(low, high, period).unwrap_err();
            assert!(matches!(error, Band { parameter, .. } if parameter == name), "{error}");
        }
        assert_eq!(LineSet::odd_in_band(0.11, 0.29, 10.0), Err(NoLine));
        assert!(matches!(LineSet::odd_in_band(0.1, 1e300, 10.0), Err(TooHigh { .. })));
    }
}
