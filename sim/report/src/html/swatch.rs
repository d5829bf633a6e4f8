//! What a series looks like, in small, as the content of an SVG element of 24 by 14.

use rotorlead_answer::{Mark, Series};

/// The small picture in a button of the legend.
pub(super) fn swatch(series: &Series) -> String {
    let [red, green, blue] = series.color.rgb();
    let color = format!("rgb({red},{green},{blue})");
    let band = if series.band.is_empty() {
        String::new()
    } else {
        format!(r#"<rect width="24" height="14" fill="{color}" opacity=".25"/>"#)
    };
    let line =
        |path: &str, width: u32| format!(r#"<path d="{path}" stroke="{color}" stroke-width="{width}" fill="none"/>"#);
    let mark = match series.mark {
        Mark::Line => line("M0 7H24", 2),
        Mark::Dashes => line("M0 7H6M9 7H15M18 7H24", 2),
        Mark::Dots => format!(r#"<circle cx="12" cy="7" r="3" fill="{color}" opacity=".6"/>"#),
        Mark::Discs => format!(r#"<circle cx="12" cy="7" r="5" fill="{color}"/>"#),
        Mark::Crosses => line("M8 3L16 11M16 3L8 11", 2),
        Mark::Rings => format!(r#"<circle cx="12" cy="7" r="6" fill="none" stroke="{color}" stroke-width="2"/>"#),
        Mark::Ticks => line("M12 0V14", 3),
        Mark::Bars => format!(r#"<rect x="3" y="2" width="18" height="10" fill="{color}"/>"#),
    };
    band + &mark
}
