//! The speed as bidirectional DShot reports it.

/// Pairs of poles. Standard: 14 magnets of the usual motors.
pub const POLE_PAIRS: f64 = 7.0;

/// Speed in rpm as reported: the period of an electrical revolution in microseconds, cut to nine bits with an exponent, as electrical
/// revolutions per minute in hundreds, as a blackbox has it.
#[must_use]
pub fn reported_rpm(speed_rad_s: f64) -> f64 {
    let period_us = std::f64::consts::TAU / (POLE_PAIRS * speed_rad_s.max(1.0)) * 1e6;
    let mut step = 1.0;
    while period_us / step >= 512.0 {
        step *= 2.0;
    }
    let period_us = (period_us / step).floor().max(1.0) * step;
    let hundreds = (60e6 / period_us / 100.0).round();
    hundreds * 100.0 / POLE_PAIRS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_off_by_a_quarter_of_a_percent_or_two() {
        for speed in [300.0, 900.0, 1500.0, 2500.0] {
            let rpm = reported_rpm(speed) / (speed * 60.0 / std::f64::consts::TAU);
            assert!((0.9995..1.006).contains(&rpm), "{speed} {rpm}");
        }
    }
}
