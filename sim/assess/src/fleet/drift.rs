//! How a motor changes with time.

use rotorlead_numerics::statistics::{f_upper_tail, t_quantile};

use super::relative_change;

/// Fewest logs of a motor for a line. Derived: four leave it two degrees of freedom, at which a 95 % interval is 4.3 standard errors to
/// either side; three leave one and 12.7.
const FEWEST: usize = 4;
/// The unit of time. Standard: a twelfth of a Julian year.
const DAYS_PER_MONTH: f64 = 365.25 / 12.0;

/// A line through the deviations of one motor's logs over time, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Share per month.
    pub per_month: f64,
    /// Its 95 % interval, from the scatter about the line.
    pub interval: [f64; 2],
    /// Probability of such a slope, up or down, where there is none.
    pub p_value: f64,
    slope_per_day: f64,
    mean_day: f64,
    mean_deviation: f64,
}

impl Drift {
    /// Through `(day, deviation)`; `None` of fewer than four, of one day, and of logs without scatter.
    pub(super) fn through(logs: &[(f64, f64)]) -> Option<Self> {
        if logs.len() < FEWEST {
            return None;
        }
        let count = logs.len() as f64;
        let mean_day = logs.iter().map(|(day, _)| day).sum::<f64>() / count;
        let mean_deviation = logs.iter().map(|(_, deviation)| deviation).sum::<f64>() / count;
        let spread: f64 = logs.iter().map(|(day, _)| (day - mean_day).powi(2)).sum();
        let slope_per_day =
            logs.iter().map(|(day, deviation)| (day - mean_day) * (deviation - mean_deviation)).sum::<f64>() / spread;
        let scatter: f64 = logs
            .iter()
            .map(|(day, deviation)| (deviation - mean_deviation - slope_per_day * (day - mean_day)).powi(2))
            .sum();
        let dof = count - 2.0;
        let std = (scatter / dof / spread).sqrt();
        if !slope_per_day.is_finite() || std == 0.0 {
            return None;
        }
        let half = t_quantile(0.975, dof) * std;
        let month = |slope: f64| relative_change(slope * DAYS_PER_MONTH);
        Some(Self {
            per_month: month(slope_per_day),
            interval: [month(slope_per_day - half), month(slope_per_day + half)],
            p_value: f_upper_tail((slope_per_day / std).powi(2), 1.0, dof),
            slope_per_day,
            mean_day,
            mean_deviation,
        })
    }

    /// The line at a day.
    pub(super) fn at(&self, day: f64) -> f64 {
        self.mean_deviation + self.slope_per_day * (day - self.mean_day)
    }
}
