//! A conditioned inverse with what it was designed from and what its output can do.

use num_complex::Complex64;
use rotorlead::compensator::{CommandRange, InverseFilter};
use rotorlead::design::{CurvePoint, InverseDesign, InverseError, LeadParameters, ReferenceModel, RotorCurve};
use rotorlead::inverse::{COEFFICIENT_BITS, GAIN_BITS, Limits, TABLE_POINTS};
use rotorlead::throttle::Command;

/// Time constants of the reference model until a step has long had its peak. Chosen: `e^-10`, 5e-5, of its transient is left; the peak is
/// in the first of them.
const SETTLED: f64 = 10.0;

/// A conditioned inverse: the response that the rotor is to have, the time constants that it has, and what its command can do.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseCompensator {
    points: Vec<CurvePoint>,
    curve: RotorCurve,
    design: InverseDesign,
    filter: InverseFilter,
    min: f64,
    max: f64,
    slew_per_s: Option<f64>,
    compensated: (f64, f64),
}

/// What the output can do, and where the inverse is in the path: commands from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseRange {
    /// The lowest output.
    pub min: f64,
    /// The highest output, at least `min`.
    pub max: f64,
    /// Largest change of the output, units of the command per second; `None` for no limit.
    pub slew_per_s: Option<f64>,
    /// The lowest and the highest command of the flight controller for which the curve is known. At others it is bypassed.
    pub compensated: (f64, f64),
}

impl InverseCompensator {
    /// The inverse of the rotor with the curve through `points` along `reference`.
    ///
    /// # Errors
    /// When the controller refuses the reference model, the curve, or the limits of the output.
    pub fn new(
        reference: ReferenceModel,
        loop_rate_hz: f64,
        points: Vec<CurvePoint>,
        range: &InverseRange,
    ) -> Result<Self, InverseError> {
        let curve = RotorCurve::through(&points)?;
        let design = InverseDesign::from_curve(reference, loop_rate_hz, &curve)?;
        let InverseRange { min, max, slew_per_s, compensated } = *range;
        let [low, high, lowest, highest] = [min, max, compensated.0, compensated.1].map(Command::saturating_from_f64);
        let slew = slew_per_s.unwrap_or(0.0);
        design.limits(low, high, slew)?;
        let filter = design.filter(slew, CommandRange { lowest, highest })?;
        Ok(Self { points, curve, design, filter, min, max, slew_per_s, compensated })
    }

    /// The points that the curve goes through.
    #[must_use]
    pub fn points(&self) -> &[CurvePoint] {
        &self.points
    }

    /// The time constants of the table.
    #[must_use]
    pub fn curve(&self) -> &RotorCurve {
        &self.curve
    }

    /// The reference model, the loop rate and the coefficients.
    #[must_use]
    pub fn design(&self) -> &InverseDesign {
        &self.design
    }

    /// What the output can do, and where it is in the path.
    #[must_use]
    pub fn range(&self) -> InverseRange {
        let Self { min, max, slew_per_s, compensated, .. } = *self;
        InverseRange { min, max, slew_per_s, compensated }
    }

    /// Whether it is in the path for this command of the flight controller.
    #[must_use]
    pub fn covers(&self, command: f64) -> bool {
        (self.compensated.0..=self.compensated.1).contains(&command)
    }

    pub(super) fn filter(&self) -> InverseFilter {
        self.filter
    }

    /// The lowest and the highest output.
    pub(super) fn ends(&self) -> (Command, Command) {
        (Command::saturating_from_f64(self.min), Command::saturating_from_f64(self.max))
    }

    pub(super) fn is_bit_identical_to(&self, other: &Self) -> bool {
        // By what is left of the ends in steps of the output.
        let limits = |inverse: &Self| Limits::new(inverse.ends().0, inverse.ends().1, inverse.filter.slew);
        self.filter == other.filter && limits(self) == limits(other)
    }

    /// `omega_f^2 (tau s + 1) / (s^2 + 2 damping omega_f s + omega_f^2)` with the time constant of the table.
    pub(super) fn lead_at(&self, nominal: f64) -> Option<LeadParameters> {
        let ReferenceModel { omega_f_rad_s, damping } = *self.design.reference();
        // The gain of a slow loop rate is a little less than omega_f tau.
        let decay = a(&self.design) / self.gain_at(nominal);
        let tau_s = -1.0 / (self.design.loop_rate_hz() * (-decay).ln_1p());
        self.covers(nominal).then(|| LeadParameters { omega_z_rad_s: 1.0 / tau_s, omega_f_rad_s, damping })
    }

    /// From the equations of the recurrence at the fixed gain `g`, with `V = A X / (z - 1)`:
    ///
    /// ```text
    /// X (1 - (1 - B) / z + A^2 / (z - 1)) = A R,   U = (g + A / (z - 1)) X
    /// ```
    pub(super) fn response(&self, nominal: f64, omega_rad_s: f64) -> Complex64 {
        if !self.covers(nominal) || omega_rad_s == 0.0 {
            return Complex64::ONE;
        }
        let (a, b) = (a(&self.design), b(&self.design));
        let z = Complex64::cis(omega_rad_s / self.design.loop_rate_hz());
        let sum = (z - 1.0).inv();
        a * (self.gain_at(nominal) + a * sum) / (1.0 - (1.0 - b) / z + a * a * sum)
    }

    /// The point with the longest time constant among those that it covers.
    pub(super) fn slowest(&self) -> Option<&CurvePoint> {
        let covered = self.points.iter().filter(|point| self.covers(point.command));
        covered.max_by(|one, other| one.tau_s.total_cmp(&other.tau_s))
    }

    /// The largest output of the recurrence at the highest gain, for a step of one.
    pub(super) fn step_peak(&self) -> f64 {
        let g = self.slowest().map_or(0.0, |point| self.gain_at(point.command));
        let (a, b) = (a(&self.design), b(&self.design));
        let ticks = (SETTLED / (b * 0.5)) as u32;
        let (mut v, mut x, mut peak) = (0.0_f64, 0.0, 1.0_f64);
        for _ in 0..ticks {
            x += a * (1.0 - v) - b * x;
            peak = peak.max(v + g * x);
            v += a * x;
        }
        peak
    }

    /// The gain `g` of the table at a command, as the tick interpolates it.
    #[must_use]
    pub fn gain_at(&self, command: f64) -> f64 {
        let gains = self.design.coefficients().gains();
        let at = command.clamp(0.0, 1.0) * (TABLE_POINTS - 1) as f64;
        let index = (at as usize).min(TABLE_POINTS - 2);
        let [low, high] = [gains[index], gains[index + 1]].map(|gain| f64::from(gain) / f64::from(1 << GAIN_BITS));
        low + (high - low) * (at - index as f64)
    }
}

fn a(design: &InverseDesign) -> f64 {
    f64::from(design.coefficients().a()) / f64::from(1 << COEFFICIENT_BITS)
}

fn b(design: &InverseDesign) -> f64 {
    f64::from(design.coefficients().b()) / f64::from(1 << COEFFICIENT_BITS)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use rotorlead::design::DEFAULT_DAMPING;

    use super::super::CompensatorDesign;
    use super::*;

    fn inverse(compensated: (f64, f64)) -> InverseCompensator {
        let points = [(0.40, 0.159), (0.65, 0.071)].map(|(command, tau_s)| CurvePoint { command, tau_s });
        let reference = ReferenceModel { omega_f_rad_s: 94.2, damping: DEFAULT_DAMPING };
        let range = InverseRange { min: 0.0, max: 1.0, slew_per_s: None, compensated };
        InverseCompensator::new(reference, 5000.0, points.to_vec(), &range).unwrap()
    }

    /// The recurrence itself, with a sinusoid so small that its gain stays and so large that its step does not show.
    #[test]
    fn the_response_is_that_of_the_recurrence() {
        let inverse = inverse((0.3, 0.7));
        for (nominal, omega, amplitude) in [(0.45, 20.0, 0.005), (0.45, 94.2, 0.005), (0.6, 300.0, 0.005)] {
            let mut running = CompensatorDesign::from(inverse.clone()).running(Command::saturating_from_f64(nominal));
            let period = TAU / omega * 5000.0;
            let (settled, ticks) = ((10.0 * period) as u32, (20.0 * period) as u32);
            let mut sum = Complex64::ZERO;
            for tick in 0..settled + ticks {
                let angle = omega * f64::from(tick) / 5000.0;
                let output = running.update(Command::saturating_from_f64(nominal + amplitude * angle.sin())).to_f64();
                if tick >= settled {
                    sum += (output - nominal) * Complex64::cis(-angle);
                }
            }
            let found = sum * 2.0 / f64::from(ticks) / amplitude * Complex64::I;
            let expected = inverse.response(nominal, omega);
            assert!((found / expected - 1.0).norm() < 0.01, "{found} {expected} at {nominal}, {omega}");
            let lead = inverse.lead_at(nominal).unwrap().response(omega);
            assert!((lead.norm() / expected.norm() - 1.0).abs() < 0.01, "{lead} {expected}");
        }
        assert_eq!(inverse.response(0.45, 0.0), Complex64::ONE);
    }

    #[test]
    fn it_is_bypassed_where_the_curve_is_not_known() {
        let inverse = inverse((0.42, 0.6));
        for (nominal, is_covered) in [(0.4, false), (0.42, true), (0.6, true), (0.61, false)] {
            assert_eq!(inverse.lead_at(nominal).is_some(), is_covered, "{nominal}");
            assert_eq!(inverse.response(nominal, 90.0) != Complex64::ONE, is_covered, "{nominal}");
            let mut running = CompensatorDesign::from(inverse.clone()).running(Command::saturating_from_f64(nominal));
            let up = Command::saturating_from_f64(nominal + 1e-3);
            let highest = (0..100).map(|_| running.update(up).to_f64() - nominal).fold(0.0, f64::max);
            assert_eq!(highest > 0.002, inverse.covers(nominal + 1e-3), "{highest} at {nominal}");
        }
    }

    #[test]
    fn the_time_constant_at_a_point_is_that_of_the_point() {
        let lead = inverse((0.0, 1.0)).lead_at(0.65 - 1.0 / 32.0).unwrap();
        let pole = 1.0 / 0.159 + (0.65 - 1.0 / 32.0 - 0.40) / 0.25 * (1.0 / 0.071 - 1.0 / 0.159);
        // The table interpolates g and not 1/tau.
        assert!((lead.omega_z_rad_s / pole - 1.0).abs() < 0.005, "{} {pole}", lead.omega_z_rad_s);
    }
}
