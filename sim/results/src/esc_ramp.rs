//! The ramps of ESCs, as a line of their own: in percent of the range in a millisecond, as ESCs' settings have them.

use rotorlead_diagnose::{EscRamp, RampRate};
use serde::{Deserialize, Serialize};

use crate::number::significant;

/// The ramps of an ESC.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EscRampValues {
    /// Of a command that rises.
    pub up: RampValues,
    /// Of one that falls.
    pub down: RampValues,
}

/// The ramp of one direction, % of the range in a millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RampValues {
    /// As found; `None` where no ramp shows.
    pub rate_percent_per_ms: Option<f64>,
    /// A slower one is excluded with 95 %; `None` where the records exclude none.
    pub low_percent_per_ms: Option<f64>,
    /// A faster one is; `None` where there may be no ramp.
    pub high_percent_per_ms: Option<f64>,
}

/// What a rate of 1/s is in % of the range in a millisecond.
const PERCENT_PER_MS: f64 = 0.1;

impl From<EscRamp> for EscRampValues {
    fn from(EscRamp { up, down }: EscRamp) -> Self {
        Self { up: up.into(), down: down.into() }
    }
}

impl From<RampRate> for RampValues {
    fn from(rate: RampRate) -> Self {
        let in_percent = |rate_per_s: Option<f64>| Some(PERCENT_PER_MS * rate_per_s?);
        Self {
            rate_percent_per_ms: in_percent(rate.rate_per_s),
            low_percent_per_ms: in_percent(rate.low_per_s),
            high_percent_per_ms: in_percent(rate.high_per_s),
        }
    }
}

impl EscRampValues {
    /// Of records that tell nothing.
    pub(crate) const UNKNOWN: Self = Self { up: RampValues::UNKNOWN, down: RampValues::UNKNOWN };

    /// Whether a diagnosis may say so: rates above zero, each between its ends.
    #[must_use]
    pub fn is_possible(self) -> bool {
        [self.up, self.down].into_iter().all(RampValues::is_possible)
    }

    /// Both directions in a sentence.
    #[must_use]
    pub fn sentence(self) -> String {
        if self == Self::UNKNOWN {
            return "ESC ramp: not known; steps of several sizes tell it.".to_owned();
        }
        format!("ESC ramp: {} up, {} down (95 %).", self.up.words(), self.down.words())
    }
}

impl RampValues {
    fn is_possible(self) -> bool {
        let ends = [self.low_percent_per_ms, self.rate_percent_per_ms, self.high_percent_per_ms];
        ends.into_iter().flatten().is_sorted() && ends.into_iter().flatten().all(|end| end > 0.0 && end.is_finite())
    }

    const UNKNOWN: Self = Self { rate_percent_per_ms: None, low_percent_per_ms: None, high_percent_per_ms: None };

    /// The rate with its interval, or which it is not slower than.
    #[must_use]
    pub fn words(self) -> String {
        match (self.rate_percent_per_ms, self.low_percent_per_ms, self.high_percent_per_ms) {
            (Some(rate), Some(low), Some(high)) => {
                format!("{} %/ms ({} to {})", significant(rate), significant(low), significant(high))
            }
            (Some(rate), ..) => format!("about {} %/ms", significant(rate)),
            (None, Some(low), _) => format!("none slower than {} %/ms", significant(low)),
            (None, None, _) => "unknown".to_owned(),
        }
    }

    /// From where to where it may be.
    #[must_use]
    pub fn range(self) -> (f64, f64) {
        (self.low_percent_per_ms.unwrap_or(0.0), self.high_percent_per_ms.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_has_both_directions_in_percent_per_millisecond() {
        let found = RampRate { rate_per_s: Some(1.0), low_per_s: Some(0.95), high_per_s: Some(1.06) };
        let none = RampRate { rate_per_s: None, low_per_s: Some(23.4), high_per_s: None };
        let values = EscRampValues::from(EscRamp { up: found, down: none });
        assert_eq!(
            values.sentence(),
            "ESC ramp: 0.100 %/ms (0.095 to 0.106) up, none slower than 2.3 %/ms down (95 %)."
        );
        let unknown = RampRate { rate_per_s: None, low_per_s: None, high_per_s: None };
        let values = EscRampValues::from(EscRamp { up: unknown, down: unknown });
        assert!(values.sentence().contains("not known"), "{}", values.sentence());
        assert_eq!(values.up.range(), (0.0, f64::INFINITY));
    }
}
