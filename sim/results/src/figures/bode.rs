//! Bode plots: magnitude over phase.

use std::collections::VecDeque;

use num_complex::Complex64;
use rotorlead_answer::{Axis, Color, Mark, Panel, Series};
use rotorlead_identify::frequency_response::FrequencyResponse;
use rotorlead_identify::frequency_response::etfe::ResponsePoint;
use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;

/// Probability that a band holds the truth, at each line. Standard: 95 %, as of every interval that is printed.
pub(super) const BAND: f64 = 0.95;

/// One response.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What it is.
    pub name: String,
    /// What the legend says.
    pub group: String,
    /// How it is drawn.
    pub mark: Mark,
    /// A model and what was measured of it share theirs.
    pub color: Color,
    /// Frequency in rad/s and response, by increasing frequency.
    pub points: Vec<(f64, Complex64)>,
    /// Bands of magnitude and of phase in radians, one a point; empty for none.
    pub bands: Vec<Band>,
}

/// From where to where a response may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Magnitude.
    pub magnitude: (f64, f64),
    /// Phase, radians.
    pub phase_rad: (f64, f64),
}

impl Curve {
    /// A curve without bands.
    #[must_use]
    pub fn new(name: impl Into<String>, mark: Mark, color: Color, points: Vec<(f64, Complex64)>) -> Self {
        let name = name.into();
        Self { group: name.clone(), name, mark, color, points, bands: Vec::new() }
    }

    /// Together with others in the legend.
    #[must_use]
    pub fn under(self, group: &str) -> Self {
        Self { group: group.to_owned(), ..self }
    }

    /// A model at `count` frequencies, evenly by their logarithm.
    #[must_use]
    pub fn from_model(
        name: impl Into<String>,
        mark: Mark,
        color: Color,
        (from, to): (f64, f64),
        response: impl Fn(f64) -> Complex64,
    ) -> Self {
        let frequencies = (0..=COUNT).map(|i| from * (to / from).powf(f64::from(i) / f64::from(COUNT)));
        Self::new(name, mark, color, frequencies.map(|omega| (omega, response(omega))).collect())
    }

    /// What was measured, over `scale`, with its bands.
    #[must_use]
    pub fn measured(name: impl Into<String>, mark: Mark, color: Color, points: &[ResponsePoint], scale: f64) -> Self {
        let band = |point: &ResponsePoint| {
            let reach = STANDARD_ERRORS_OF_95_PERCENT * point.magnitude_std();
            let magnitude = point.response.norm();
            let share = reach / magnitude;
            let phase = if share < 1.0 { share.asin() } else { std::f64::consts::PI };
            Band {
                magnitude: ((magnitude - reach).max(0.0) / scale.abs(), (magnitude + reach) / scale.abs()),
                phase_rad: ((point.response / scale).arg() - phase, (point.response / scale).arg() + phase),
            }
        };
        let bands = points.iter().map(band).collect();
        let points = points.iter().map(|point| (point.omega_rad_s, point.response / scale)).collect();
        Self { bands, ..Self::new(name, mark, color, points) }
    }

    /// A frequency response with its bands.
    #[must_use]
    pub fn estimated(name: impl Into<String>, mark: Mark, color: Color, response: &FrequencyResponse) -> Self {
        let bands = response.lines.iter().map(|line| Band {
            magnitude: response.magnitude_interval(line, BAND),
            phase_rad: response.phase_interval_rad(line, BAND),
        });
        let points = response.lines.iter().map(|line| (line.omega_rad_s, line.response)).collect();
        Self { bands: bands.collect(), ..Self::new(name, mark, color, points) }
    }

    fn series(&self, points: Vec<(f64, f64)>, band: Vec<(f64, f64)>) -> Series {
        Series::new(self.name.clone(), self.color, self.mark, points).under(&self.group).with_band(band)
    }

    /// In decibels.
    fn magnitude(&self) -> Series {
        let points = self.points.iter().map(|(omega, value)| (*omega, decibels(value.norm())));
        let band = self.bands.iter().map(|band| (decibels(band.magnitude.0), decibels(band.magnitude.1)));
        self.series(points.collect(), band.collect())
    }

    /// In degrees, unwrapped: each point on the turn that is nearest to the mean of those before it. Of a curve that is one point;
    /// of what was measured several, since noise that is larger than the response would else climb by a turn now and then.
    fn phase(&self) -> Series {
        let before = if self.mark == Mark::Line { 1 } else { NEAR };
        let mut recent: VecDeque<f64> = VecDeque::new();
        let mut points = Vec::new();
        let mut band = Vec::new();
        for (index, (omega, value)) in self.points.iter().enumerate() {
            if *omega <= 0.0 || !value.norm().is_normal() {
                points.push((*omega, f64::NAN));
                band.push((f64::NAN, f64::NAN));
                continue;
            }
            let wrapped = value.arg().to_degrees();
            let mean = recent.iter().sum::<f64>() / recent.len().max(1) as f64;
            let turns = -360.0 * ((wrapped - mean) / 360.0).round();
            recent.push_back(wrapped + turns);
            if recent.len() > before {
                recent.pop_front();
            }
            points.push((*omega, wrapped + turns));
            if let Some(Band { phase_rad: (low, high), .. }) = self.bands.get(index) {
                band.push((low.to_degrees() + turns, high.to_degrees() + turns));
            }
        }
        self.series(points, if self.bands.is_empty() { Vec::new() } else { band })
    }
}

/// Measured points whose mean phase says the turn of the next. Chosen: noise of the mean is a third of a point's; fewer climb by a turn
/// sooner, more lag behind a phase that falls.
const NEAR: usize = 9;
/// Frequencies of a model's curve. Chosen: one every 3 to 4 of a figure's 900 pixels, which shows no corners; more make the file large.
const COUNT: u32 = 240;

fn decibels(magnitude: f64) -> f64 {
    20.0 * magnitude.log10()
}

/// A broken line across all frequencies.
#[must_use]
pub(super) fn level(name: &str, value: f64, curves: &[Curve]) -> Series {
    let ends = curves.iter().flat_map(|curve| &curve.points).map(|point| point.0).filter(|omega| *omega > 0.0);
    let (low, high) = ends.fold((f64::INFINITY, 0.0_f64), |(low, high), omega| (low.min(omega), high.max(omega)));
    Series::new(name, Color::Gray, Mark::Dashes, vec![(low, value), (high, value)])
}

/// Magnitude over phase. `unit` is that of the magnitude; a broken line is drawn at each of `levels`.
#[must_use]
pub fn bode(curves: &[Curve], unit: &str, levels: &[(&str, f64)]) -> Vec<Panel> {
    let levels = levels.iter().map(|(name, value)| level(name, *value, curves));
    let magnitudes = curves.iter().map(Curve::magnitude).chain(levels).collect();
    let phases = curves.iter().map(Curve::phase).collect();
    let phase = Panel::new(Axis::frequency(), Axis::phase(), phases);
    vec![Panel::new(Axis::frequency(), Axis::linear("magnitude", unit), magnitudes), Panel { height: 290, ..phase }]
}

/// Marks a place of a curve that is drawn, on its magnitude and on its phase; `words` are read there, and say what it is. Beyond
/// its ends there is no mark.
pub(super) fn mark(panels: &mut [Panel], curve: &str, omega_rad_s: f64, shape: Mark, words: &str) {
    for panel in panels {
        let Some(drawn) = panel.series.iter().find(|series| series.name == curve) else { continue };
        let Some(after) = drawn.points.iter().position(|point| point.0 >= omega_rad_s).filter(|after| *after > 0)
        else {
            continue;
        };
        let ((low, from), (high, to)) = (drawn.points[after - 1], drawn.points[after]);
        let at = from + (to - from) * (omega_rad_s / low).ln() / (high / low).ln();
        let name = format!("{curve}, {words}");
        let marked = Series::new(name, drawn.color, shape, vec![(omega_rad_s, at)]).under(&drawn.group);
        panel.series.push(marked.with_notes(vec![words.to_owned()]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_go_on_where_the_angle_turns_over() {
        // Five lags: the phase falls to -450 degrees.
        let lag = |omega: f64| (1.0 / Complex64::new(1.0, omega)).powi(5);
        let curve = Curve::from_model("five", Mark::Line, Color::Blue, (0.01, 1000.0), lag);
        let phase = curve.phase();
        let (_, last) = phase.points[phase.points.len() - 1];
        assert!((-450.0..-445.0).contains(&last), "{last}");
        assert!(phase.points.windows(2).all(|pair| (pair[0].1 - pair[1].1).abs() < 30.0));
        let (_, magnitude) = curve.magnitude().points[0];
        assert!(magnitude.abs() < 0.01, "{magnitude}");
    }

    #[test]
    fn measured_phases_in_noise_do_not_climb() {
        // A lag down to a fiftieth, in noise of a tenth: above, an angle is anywhere.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let points = (1..400).map(|line| {
            let omega = 0.25 * f64::from(line);
            (omega, 1.0 / Complex64::new(1.0, 0.5 * omega) + 0.2 * Complex64::new(uniform(), uniform()))
        });
        let points: Vec<_> = points.collect();
        let phase = Curve::new("", Mark::Dots, Color::Blue, points.clone()).phase();
        let highest = phase.points.iter().map(|(_, phase)| phase.abs()).fold(0.0, f64::max);
        assert!(highest < 400.0, "{highest}");
        let line = Curve::new("", Mark::Line, Color::Blue, points).phase();
        let climbed = line.points.iter().map(|(_, phase)| phase.abs()).fold(0.0, f64::max);
        assert!(climbed > highest, "line to line it goes to {climbed}, and by several to {highest}");
    }

    #[test]
    fn a_mark_is_on_its_curve_in_both_panels() {
        let lag = |omega: f64| 1.0 / Complex64::new(1.0, omega);
        let curve = Curve::from_model("lag", Mark::Line, Color::Blue, (0.01, 100.0), lag);
        let mut panels = bode(&[curve], "dB", &[]);
        mark(&mut panels, "lag", 1.0, Mark::Discs, "corner");
        mark(&mut panels, "lag", 200.0, Mark::Discs, "beyond");
        for (panel, expected) in panels.iter().zip([-10.0 * 2_f64.log10(), -45.0]) {
            let [_, marked] = &panel.series[..] else { panic!("{:?}", panel.series) };
            assert!((marked.points[0].1 - expected).abs() < 0.05, "{marked:?}");
        }
    }

    #[test]
    fn a_band_is_on_the_turn_of_its_point() {
        let response = Complex64::from_polar(2.0, 3.0);
        let points = vec![(1.0, Complex64::from_polar(2.0, 3.0)), (2.0, Complex64::from_polar(2.0, -3.0))];
        let band = |phase: f64| Band { magnitude: (1.0, 3.0), phase_rad: (phase - 0.1, phase + 0.1) };
        let curve = Curve { bands: vec![band(3.0), band(-3.0)], ..Curve::new("", Mark::Dots, Color::Blue, points) };
        let phase = curve.phase();
        for (point, band) in phase.points.iter().zip(&phase.band) {
            assert!(((band.0 + band.1) / 2.0 - point.1).abs() < 1e-9);
        }
        assert!(phase.points[1].1 > 180.0, "{:?} {response}", phase.points);
    }
}
