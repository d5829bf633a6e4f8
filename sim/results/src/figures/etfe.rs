//! Frequency responses that were measured, with what was fitted to them: the paper's Figs. 5 and 6.

use rotorlead_answer::{Color, Figure, FigureKind, Mark};
use rotorlead_identify::lag::multisine::{NominalIdentification, PeriodicIdentification};
use rotorlead_identify::validate::ComparedLines;
use rotorlead_records::Output;

use super::bode::{Curve, bode};
use crate::number::at_nominal;
use crate::unit::gain_decibels;

/// All nominal commands together: the smoothed estimates with their bands, and the lags. `None` without a record that is
/// not compensated.
#[must_use]
pub fn responses(found: &PeriodicIdentification, output: Output) -> Option<Figure> {
    let of_nominal = |(index, nominal): (usize, &NominalIdentification)| -> Option<[Curve; 2]> {
        let response = nominal.responses.iter().find(|response| !response.compensated)?;
        let points = response.actuator.smoothed();
        let ends = (points.first()?.omega_rad_s, points.last()?.omega_rad_s);
        let (group, color) = (at_nominal(nominal.nominal), Color::nth(index));
        let measured = Curve::measured(format!("{group}, measured"), Mark::Dots, color, points, 1.0);
        let lag = |omega: f64| nominal.fit.response(omega);
        let model = Curve::from_model(format!("{group}, lag"), Mark::Line, color, ends, lag);
        Some([measured.under(&group), model.under(&group)])
    };
    let curves: Vec<Curve> = found.nominals.iter().enumerate().filter_map(of_nominal).flatten().collect();
    (!curves.is_empty()).then(|| {
        Figure::new(
            FigureKind::Responses,
            "Frequency responses: dots measured, lines the lags fitted to them",
            "Dots are the smoothed response over command at the excited lines, without the holds of loop and ESC; the shade is \
             their 95 % band. Lines are the fitted lags. A lag falls by 20 dB per decade beyond its pole, and its phase \
             ends at -90 degrees; a dead time bends the phase further down.",
            bode(&curves, &gain_decibels(output), &[]),
        )
    })
}

/// One record beside the model.
#[must_use]
pub fn compared(title: String, lines: &ComparedLines, output: Output) -> Figure {
    let smoothed = Curve::estimated("measured, smoothed, 95 % band", Mark::Line, Color::Blue, &lines.smoothed);
    let frequencies = || lines.smoothed.lines.iter().map(|line| line.omega_rad_s);
    let raw = frequencies().zip(lines.raw.iter().copied()).collect();
    let model = frequencies().zip(lines.model.iter().copied()).collect();
    let curves = [
        Curve::new("measured", Mark::Dots, Color::Sky, raw),
        smoothed,
        Curve::new("model", Mark::Dashes, Color::Vermilion, model),
    ];
    Figure::new(
        FigureKind::FrequencyValidation,
        title,
        "Where the broken line leaves the shade at many neighboring lines, the model is wrong there by more than the noise.",
        bode(&curves, &gain_decibels(output), &[]),
    )
}
