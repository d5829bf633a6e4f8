//! What was played: the paper's Fig. 4.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_fourier as fourier;
use rotorlead_records::{Excitation, Record};

/// Points of the curve over time. Chosen: two to each of the 900 pixels of a figure's width; fewer lose peaks, more make the file large.
const MOST: usize = 2000;
/// Lines below this part of the strongest are none. Chosen: the rounding of a command is far below, and equal lines are all kept; a set
/// with lines weaker than 2 % would be shown in part.
const FAINTEST: f64 = 0.02;

/// Peak of the deviation over its root mean square, of whole periods.
#[must_use]
pub fn crest_factor(command: &[f64]) -> f64 {
    let mean = command.iter().sum::<f64>() / command.len() as f64;
    let peak = command.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    let power = command.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / command.len() as f64;
    peak / power.sqrt()
}

/// One period over time, and the amplitudes of its lines. `None` for a constant command.
#[must_use]
pub fn excitation(of: &str, period: &[f64], rate_hz: f64) -> Option<Figure> {
    let count = period.len();
    let crest_factor = crest_factor(period);
    if count < 4 || !crest_factor.is_finite() {
        return None;
    }
    let each = count.div_ceil(MOST);
    let over_time = period.iter().enumerate().step_by(each).map(|(k, value)| (k as f64 / rate_hz, *value)).collect();
    let mut bins: Vec<Complex64> = period.iter().map(|value| Complex64::new(*value, 0.0)).collect();
    fourier::forward(count).process(&mut bins);
    let line = |k: usize| (TAU * k as f64 * rate_hz / count as f64, 2.0 * bins[k].norm() / count as f64);
    let lines: Vec<(f64, f64)> = (1..count / 2).map(line).collect();
    let strongest = lines.iter().map(|line| line.1).fold(0.0, f64::max);
    let lines: Vec<_> = lines.into_iter().filter(|line| line.1 > FAINTEST * strongest).collect();
    let kept = lines.len();
    let panels = vec![
        Panel {
            height: 260,
            ..Panel::new(
                Axis::linear("time in the period", "s"),
                Axis::linear("command", "duty"),
                vec![Series::new("command", Color::Blue, Mark::Line, over_time)],
            )
        },
        Panel {
            height: 290,
            ..Panel::new(
                Axis::frequency(),
                Axis::linear("amplitude of a line", "duty").within(0.0, 1.15 * strongest),
                vec![Series::new("lines", Color::Vermilion, Mark::Dots, lines)],
            )
        },
    ];
    let caption = format!(
        "One period of {of}, and its {kept} lines. Crest factor {crest_factor:.3}: the peak over the root mean square; the lower it \
         is, the more power there is for the same peak."
    );
    Some(Figure::new(
        FigureKind::Excitation,
        format!("Excitation of {of}, crest factor {crest_factor:.2}"),
        &caption,
        panels,
    ))
}

/// One period of a multisine record; `None` for others, and where there is no whole period.
#[must_use]
pub fn excitation_figure(record: &Record) -> Option<Figure> {
    let period_s = record.period_s.filter(|_| record.excitation == Excitation::Multisine)?;
    let (first, last) = (*record.time_s.first()?, *record.time_s.last()?);
    let rate_hz = (record.time_s.len() - 1) as f64 / (last - first);
    let rows = (period_s * rate_hz).round() as usize;
    let period = record.command.get(..rows)?;
    Some(excitation(&record.file, period, rate_hz)?.with_record(&record.file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sinusoid_has_its_crest_factor_and_one_line() {
        let period: Vec<f64> = (0..1000).map(|k| 0.5 + 0.05 * (TAU * 3.0 * f64::from(k) / 1000.0).sin()).collect();
        assert!((crest_factor(&period) - 2f64.sqrt()).abs() < 1e-3);
        let figure = excitation("e.csv", &period, 100.0).unwrap();
        let lines = &figure.panels[1].series[0].points;
        assert_eq!(lines.len(), 1);
        // Three periods in ten seconds.
        assert!((lines[0].0 - TAU * 0.3).abs() < 1e-9 && (lines[0].1 - 0.05).abs() < 1e-9, "{lines:?}");
        assert!(excitation("e.csv", &[0.5; 100], 100.0).is_none());
    }
}
