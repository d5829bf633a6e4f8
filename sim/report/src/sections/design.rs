//! A compensator that was designed.

use rotorlead::design::LeadDesign;
use rotorlead_plant::Model;

use crate::compensation::{compensator, simulated};
use crate::html::{Cell, Column, Section, Table};

/// Its parameters, what the controller makes of them, and what it does to the model.
#[must_use]
pub fn design_section(design: &LeadDesign, model: &Model) -> Section {
    let lead = design.lead();
    let check = design.check();
    let omega_f2 = lead.omega_f_rad_s.powi(2);
    let text = vec![
        format!(
            "C(s) = ({:.2} s + {omega_f2:.2}) / (s² + {:.2} s + {omega_f2:.2})",
            omega_f2 / lead.omega_z_rad_s,
            2.0 * lead.damping * lead.omega_f_rad_s
        ),
        format!(
            "A step of the command is answered by at most {:.2} times that step: within the range 0 to 1 there has to be room for it.",
            check.step_peak
        ),
    ];
    let row = |name: &str, value: Cell, unit: &str, meaning: &str| {
        vec![Cell::text(name), value, Cell::text(unit), Cell::text(meaning)]
    };
    let rounded = design.coefficients();
    let whole = |value: f64| Cell::number(value, 0);
    let table = Table {
        name: "compensator".to_owned(),
        caption: "The compensator, and the integers of the controller (2^-32)".to_owned(),
        columns: vec![
            Column::new("name", "", ""),
            Column::new("value", "value", ""),
            Column::new("unit", "unit", ""),
            Column::new("meaning", "", ""),
        ],
        rows: vec![
            row("zero", Cell::number(lead.omega_z_rad_s, 4), "rad/s", "the fastest pole of the model"),
            row("poles", Cell::number(lead.omega_f_rad_s, 4), "rad/s", "both"),
            row("damping", Cell::number(lead.damping, 4), "", "of the poles"),
            row("omega_g", Cell::number(lead.omega_g_rad_s(), 2), "rad/s", "amplifies up to here"),
            row("asymptotic peak", Cell::number(lead.asymptotic_peak_db(), 4), "dB", ""),
            row(
                "gains little below",
                Cell::number(lead.slowest_helped_rad_s(), 4),
                "rad/s",
                "a slower lag has fallen by 3 dB before the zero lifts it",
            ),
            row("loop rate", Cell::number(design.loop_rate_hz(), 0), "Hz", ""),
            row("k", whole(f64::from(rounded.k())), "2^-32", ""),
            row("c", whole(f64::from(rounded.c())), "2^-32", ""),
            row("g0", whole(f64::from(rounded.g0())), "2^-32", ""),
            row("g1", whole(f64::from(rounded.g1())), "2^-32", ""),
            row(
                "deviation by rounding",
                Cell::shown(check.worst_deviation_db, format!("{:.1e}", check.worst_deviation_db)),
                "dB",
                "at most",
            ),
            row("L1 gain", Cell::number(check.l1_gain, 3), "", "largest output for a command of one"),
        ],
    };
    let figures = vec![simulated(model, lead), compensator(design)];
    Section { text, tables: vec![table], figures, ..Section::new("compensator", "Compensator") }
}
