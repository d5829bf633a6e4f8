//! A compensator in tables and figures.

use rotorlead::design::{CurvePoint, LeadDesign};
use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_design::Chain;
use rotorlead_plant::{CommandNoiseGain, CompensatorDesign, FilterDesign, InverseCompensator, Model, Point};

use crate::figures::compensation::{compensator, simulated};

/// Its parameters, what the controller makes of them, and what it does to the model.
#[must_use]
pub fn design_section(design: &CompensatorDesign, model: &Model) -> Section {
    let tables = match &design.kind {
        FilterDesign::Lead(lead) => vec![design_table(lead, model), discrete_table(lead)],
        FilterDesign::Inverse(inverse) => vec![inverse_table(design, inverse), curve_table(inverse)],
    };
    Section {
        tables,
        figures: vec![simulated(model, Chain::Designed(design)), compensator(design, model)],
        ..Section::new("compensator", "Compensator")
    }
}

/// The parameters of either kind in a line.
#[must_use]
pub fn in_short(design: &CompensatorDesign) -> String {
    match &design.kind {
        FilterDesign::Lead(design) => {
            let lead = design.lead();
            format!(
                "zero {:.4} rad/s, poles {:.4} rad/s, damping {:.4}, {} Hz{}",
                lead.omega_z_rad_s,
                lead.omega_f_rad_s,
                lead.damping,
                design.loop_rate_hz(),
                slew_in_short(design.slew_per_s())
            )
        }
        FilterDesign::Inverse(inverse) => {
            let (reference, range) = (inverse.design().reference(), inverse.range());
            let slew = slew_in_short(range.slew_per_s);
            format!(
                "inverse, natural frequency {:.4} rad/s, damping {:.4}, {} Hz, output {} to {} duty{slew}",
                reference.omega_f_rad_s,
                reference.damping,
                inverse.design().loop_rate_hz(),
                range.min,
                range.max
            )
        }
    }
}

fn slew_in_short(slew_per_s: Option<f64>) -> String {
    slew_per_s.map_or_else(String::new, |slew_per_s| format!(", slew {slew_per_s} duty/s"))
}

/// The recurrence's continuous form in numbers.
fn inverse_equation(inverse: &InverseCompensator) -> String {
    let reference = inverse.design().reference();
    let omega_f2 = reference.omega_f_rad_s.powi(2);
    format!(
        "u = v + tau(v) dv/dt, d2v/dt2 = {omega_f2:.2} (r - v) - {:.2} dv/dt",
        2.0 * reference.damping * reference.omega_f_rad_s
    )
}

/// The parameters of an inverse.
fn inverse_table(design: &CompensatorDesign, inverse: &InverseCompensator) -> Table {
    let (reference, range, own) = (inverse.design().reference(), inverse.range(), inverse.design());
    let (from, to) = range.compensated;
    parameters(
        "inverse",
        &format!("The inverse: {}", inverse_equation(inverse)),
        vec![
            row(
                "natural frequency",
                Cell::number(reference.omega_f_rad_s, 4),
                "rad/s",
                "of the response at every point",
            ),
            row("damping", Cell::number(reference.damping, 4), "", ""),
            row("loop rate", Cell::number(own.loop_rate_hz(), 0), "Hz", ""),
            row("lowest output", Cell::number(range.min, 4), "duty", ""),
            row("highest output", Cell::number(range.max, 4), "duty", ""),
            row(
                "slew",
                Cell::optional(range.slew_per_s, 2),
                "duty/s",
                "most by which the output changes; none: no limit",
            ),
            row("in the path from", Cell::number(from, 4), "duty", "bypassed below this command"),
            row("in the path up to", Cell::number(to, 4), "duty", "bypassed above this command"),
            row(
                "step peak",
                Cell::number(design.step_peak(), 2),
                "",
                "of the answer to a step of one at the slowest point, without limits",
            ),
            row(
                "rounding",
                Cell::number(own.rounding_error(), 0),
                "2^-29",
                "at most, of the output at rest; half a step of the output is 4096",
            ),
        ]
        .into_iter()
        .chain(noise_rows(design, ", at the slowest point"))
        .collect(),
    )
}

/// The curve of an inverse, with the gains of its table there.
fn curve_table(inverse: &InverseCompensator) -> Table {
    let row = |point: &CurvePoint| {
        vec![
            Cell::number(point.command, 3),
            Cell::number(1e3 * point.tau_s, 2),
            Cell::number(inverse.gain_at(point.command), 3),
            Cell::text(if inverse.covers(point.command) { "" } else { "bypassed" }),
        ]
    };
    Table {
        name: "curve".to_owned(),
        caption: "Time constants of the table, and the gains that they give".to_owned(),
        columns: vec![
            Column::new("command", "v", "duty"),
            Column::new("time_constant_ms", "tau", "ms"),
            Column::new("gain", "g", ""),
            Column::new("path", "", ""),
        ],
        rows: inverse.points().iter().map(row).collect(),
        ..Table::default()
    }
    .in_detail()
}

/// C(s) in numbers.
fn transfer_function(design: &LeadDesign) -> String {
    let lead = design.lead();
    let omega_f2 = lead.omega_f_rad_s.powi(2);
    format!(
        "C(s) = ({:.2} s + {omega_f2:.2}) / (s^2 + {:.2} s + {omega_f2:.2})",
        omega_f2 / lead.omega_z_rad_s,
        2.0 * lead.damping * lead.omega_f_rad_s
    )
}

/// The point with the fastest pole, on which the zero stands.
pub(super) fn fastest_point(model: &Model) -> Option<&Point> {
    model.points.iter().min_by(|a, b| a.time_constant_s.total_cmp(&b.time_constant_s))
}

/// The parameters of C(s), and how far a step of the command is exceeded.
fn design_table(design: &LeadDesign, model: &Model) -> Table {
    let (lead, check) = (design.lead(), design.check());
    let origin = fastest_point(model).map_or_else(String::new, |point| {
        let percent = |std: f64| format!(" +- {:.1} %", 100.0 * std / point.time_constant_s);
        format!("u_nom {:.3}{}, ", point.nominal, point.time_constant_s_std.map_or_else(String::new, percent))
    });
    parameters(
        "compensator",
        &format!("The compensator: {}", transfer_function(design)),
        vec![
            row("zero", Cell::number(lead.omega_z_rad_s, 4), "rad/s", &format!("{origin}the fastest pole")),
            row("poles", Cell::number(lead.omega_f_rad_s, 4), "rad/s", "both"),
            row("damping", Cell::number(lead.damping, 4), "", "of the poles"),
            row("omega_g", Cell::number(lead.omega_g_rad_s(), 2), "rad/s", "amplifies up to here"),
            row(
                "asymptotic peak",
                Cell::number(lead.asymptotic_peak_db(), 4),
                "dB",
                "where the zero's slope meets the poles",
            ),
            row(
                "gains little below",
                Cell::number(lead.slowest_helped_rad_s(), 4),
                "rad/s",
                "a slower lag has fallen by 3 dB before the zero lifts it",
            ),
            row("step peak", Cell::number(check.step_peak, 2), "", "of the answer to a step of one: leave room for it"),
        ]
        .into_iter()
        .chain(
            design.slew_per_s().map(|slew_per_s| {
                row("slew", Cell::number(slew_per_s, 2), "duty/s", "most by which the output changes")
            }),
        )
        .chain(noise_rows(&(*design).into(), ""))
        .collect(),
    )
}

/// The integers of the controller, and what the check of the rounded filter found.
fn discrete_table(design: &LeadDesign) -> Table {
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
    .in_detail()
}

/// The gain on the noise of the command, by its frequency.
fn noise_rows(design: &CompensatorDesign, place: &str) -> Vec<Vec<Cell>> {
    let row = |CommandNoiseGain { frequency_hz, gain }| {
        row(&format!("gain at {frequency_hz} Hz"), Cell::number(gain, 1), "", &format!("on command noise{place}"))
    };
    design.command_noise_gain().map(row).into()
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
        ..Table::default()
    }
}
