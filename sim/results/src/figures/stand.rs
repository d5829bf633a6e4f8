//! A thrust stand: the paper's Fig. 3.

use std::f64::consts::TAU;

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_identify::stand::StandIdentification;
use rotorlead_identify::stand::transfer_function::Root;

use super::bode::{Curve, bode};

/// The frequency response with the transfer function, and its poles and zeros.
#[must_use]
pub fn stand_figures(stand: &StandIdentification) -> Vec<Figure> {
    vec![response(stand), pole_zero_map(stand)]
}

fn response(stand: &StandIdentification) -> Figure {
    let model = stand.model().transfer_function();
    let ends = |at: fn(
        &[rotorlead_identify::frequency_response::ResponseLine],
    ) -> Option<&rotorlead_identify::frequency_response::ResponseLine>| {
        at(&stand.response.lines).map_or(1.0, |line| line.omega_rad_s)
    };
    let span = (ends(<[_]>::first), ends(<[_]>::last));
    let curves = [
        Curve::estimated("measured, 95 % band", Mark::Dots, Color::Blue, &stand.response),
        Curve::from_model("transfer function", Mark::Line, Color::Vermilion, span, |omega| model.response(omega)),
    ];
    let gain_db = 20.0 * stand.fit.gain.value.abs().log10();
    let mut panels =
        bode(&curves, "dB over 1 N per N", &[("3 dB off the static gain", gain_db - 3.0), ("", gain_db + 3.0)]);
    if let [magnitude, ..] = &mut panels[..] {
        for series in magnitude.series.iter_mut().filter(|series| series.name.is_empty()) {
            series.group = "3 dB off the static gain".to_owned();
            series.name = "3 dB above the static gain".to_owned();
        }
    }
    let usable = match stand.usable_hz {
        Some(usable) => format!("usable up to {:.1} Hz ({:.0} rad/s)", usable.value, TAU * usable.value),
        None => format!("usable up to {:.1} Hz at least", stand.top_hz),
    };
    let caption = format!(
        "Thrust that the sensor shows over the force put in: {usable}. Beyond it the stand changes what it is to measure, unless it \
         is divided out (`rotorlead identify --stand-model`)."
    );
    Figure::new(FigureKind::StandResponse, "Frequency response of the stand", &caption, panels)
}

fn pole_zero_map(stand: &StandIdentification) -> Figure {
    // Of a pair both are drawn.
    let places = |root: &Root| -> Vec<(f64, f64)> {
        let (re, im) = (root.value.re, root.value.im);
        if root.is_pair() { vec![(re, im.abs()), (re, -im.abs())] } else { vec![(re, 0.0)] }
    };
    let notes = |roots: &[&Root]| -> Vec<String> {
        let note = |root: &&Root| {
            let said = format!("{:.3} Hz, damping {:.4}", root.frequency_rad_s.value / TAU, root.damping.value);
            vec![said; places(root).len()]
        };
        roots.iter().flat_map(note).collect()
    };
    let (poles, zeros): (Vec<&Root>, Vec<&Root>) = (stand.poles().collect(), stand.zeros().collect());
    let all = || poles.iter().chain(&zeros).flat_map(|root| places(root));
    let high = all().map(|place| place.1.abs()).fold(1.0, f64::max);
    let series = |name: &str, color: Color, mark: Mark, roots: &[&Root]| {
        Series::new(name, color, mark, roots.iter().flat_map(|root| places(root)).collect()).with_notes(notes(roots))
    };
    let mut drawn = vec![
        Series::new("stability limit", Color::Gray, Mark::Dashes, vec![(0.0, -1.1 * high), (0.0, 1.1 * high)]),
        series("poles", Color::Blue, Mark::Crosses, &poles),
        series("zeros", Color::Vermilion, Mark::Rings, &zeros),
    ];
    drawn.retain(|series| !series.points.is_empty());
    let upward = Axis::linear("imaginary part", "rad/s").beside_hertz("frequency");
    let panel = Panel::new(Axis::linear("real part", "rad/s"), upward, drawn);
    Figure::new(
        FigureKind::PoleZeroMap,
        "Poles and zeros of the stand",
        "A pole near the limit rings; its height is its frequency. Zeros right of the limit make the sensor first show the \
         wrong direction: no filter can undo them.",
        vec![Panel { height: 420, ..panel }],
    )
}
