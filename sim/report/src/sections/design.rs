//! A compensator that was designed.

use rotorlead::design::LeadDesign;
use rotorlead_plant::{Model, Point};

use crate::compensation::{compensator, simulated};
use crate::html::{Cell, Column, Section, Table};

/// Its parameters, what the controller makes of them, and what it does to the model.
#[must_use]
pub fn design_section(design: &LeadDesign, model: &Model) -> Section {
    Section {
        text: vec![transfer_function(design)],
        tables: vec![design_table(design, model), discrete_table(design)],
        figures: vec![simulated(model, design.lead()), compensator(design)],
        ..Section::new("compensator", "Compensator")
    }
}

/// C(s) in numbers.
#[must_use]
pub fn transfer_function(design: &LeadDesign) -> String {
    let lead = design.lead();
    let omega_f2 = lead.omega_f_rad_s.powi(2);
    format!(
        "C(s) = ({:.2} s + {omega_f2:.2}) / (s^2 + {:.2} s + {omega_f2:.2})",
        omega_f2 / lead.omega_z_rad_s,
        2.0 * lead.damping * lead.omega_f_rad_s
    )
}

/// The point with the fastest pole, on which the zero stands.
#[must_use]
pub fn fastest_point(model: &Model) -> Option<&Point> {
    model.points.iter().min_by(|a, b| a.time_constant_s.total_cmp(&b.time_constant_s))
}

/// The parameters of C(s), and how far a step of the command is exceeded.
#[must_use]
pub fn design_table(design: &LeadDesign, model: &Model) -> Table {
    let (lead, check) = (design.lead(), design.check());
    let origin = fastest_point(model).map_or_else(String::new, |point| {
        let percent = |std: f64| format!(" +- {:.1} %", 100.0 * std / point.time_constant_s);
        format!("u_nom {:.3}{}, ", point.nominal, point.time_constant_s_std.map_or_else(String::new, percent))
    });
    parameters(
        "compensator",
        "The compensator",
        vec![
            row("zero", Cell::number(lead.omega_z_rad_s, 4), "rad/s", &format!("{origin}the fastest pole (2)")),
            row("poles", Cell::number(lead.omega_f_rad_s, 4), "rad/s", "both (5)"),
            row("damping", Cell::number(lead.damping, 4), "", "of the poles (4)"),
            row("omega_g", Cell::number(lead.omega_g_rad_s(), 2), "rad/s", "amplifies up to here (6)"),
            row("asymptotic peak", Cell::number(lead.asymptotic_peak_db(), 4), "dB", "(5)"),
            row(
                "gains little below",
                Cell::number(lead.slowest_helped_rad_s(), 4),
                "rad/s",
                "a slower lag has fallen by 3 dB before the zero lifts it",
            ),
            row("step peak", Cell::number(check.step_peak, 2), "", "of the answer to a step of one: leave room for it"),
        ],
    )
}

/// The integers of the controller, and what the check of the rounded filter found.
#[must_use]
pub fn discrete_table(design: &LeadDesign) -> Table {
    let (check, rounded) = (design.check(), design.coefficients());
    let exact = design.prewarp_rad_s().map_or_else(String::new, |prewarp| format!(", exact at {prewarp} rad/s"));
    let whole = |value: i32| Cell::number(f64::from(value), 0);
    let radius = |index: usize| Cell::number(check.pole_radii[index], 8);
    parameters(
        "discrete",
        "The integers of the controller (2^-32), and their check",
        vec![
            row("loop rate", Cell::number(design.loop_rate_hz(), 0), "Hz", &format!("Tustin{exact}")),
            row("k", whole(rounded.k()), "2^-32", ""),
            row("c", whole(rounded.c()), "2^-32", ""),
            row("g0", whole(rounded.g0()), "2^-32", ""),
            row("g1", whole(rounded.g1()), "2^-32", ""),
            row(
                "deviation by rounding",
                Cell::shown(check.worst_deviation_db, format!("{:.1e}", check.worst_deviation_db)),
                "dB",
                &format!("at most, at {:.0} rad/s", check.worst_deviation_rad_s),
            ),
            row("pole radius", radius(0), "", "of the rounded filter"),
            row("pole radius", radius(1), "", "of the rounded filter"),
            row(
                "L1 gain",
                Cell::number(check.l1_gain, 3),
                "",
                &format!(
                    "a command in [0, 1] stays in [{:.2}, {:.2}]",
                    (1.0 - check.l1_gain) / 2.0,
                    (1.0 + check.l1_gain) / 2.0
                ),
            ),
        ],
    )
}

fn row(name: &str, value: Cell, unit: &str, meaning: &str) -> Vec<Cell> {
    vec![Cell::text(name), value, Cell::text(unit), Cell::text(meaning)]
}

fn parameters(name: &str, caption: &str, rows: Vec<Vec<Cell>>) -> Table {
    let column = |key, heading| Column::new(key, heading, "");
    Table {
        name: name.to_owned(),
        caption: caption.to_owned(),
        columns: vec![column("name", ""), column("value", "value"), column("unit", "unit"), column("meaning", "")],
        rows,
    }
}
