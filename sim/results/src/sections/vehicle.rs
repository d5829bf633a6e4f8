//! Actuators compared in a vehicle.

use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_vehicle::{Airframe, AtLatency, ForceRow, Row, Study, TuningRule, findings};

use crate::figures::vehicle::vehicle_figures;

/// The findings, the tables of each latency, and the figures.
#[must_use]
pub fn vehicle_section(study: &Study, airframe: &Airframe) -> Section {
    let mut tables = Vec::new();
    for index in 0..study.latencies.len() {
        tables.extend([false, true].map(|is_range| vehicle_table(study, airframe, index, is_range)));
        tables.push(vehicle_other_table(study, airframe, index));
        tables.push(vehicle_gains_table(study, index));
    }
    tables.extend(vehicle_force_table(study, airframe));
    let mut text = vec![rule_said(&study.rule, airframe)];
    text.extend(findings(study, airframe.hover.command, airframe.hover.range));
    text.extend(study.refused.iter().map(|one| format!("There is no {}: {}.", one.actuator.name(), one.reason)));
    Section { text, tables, figures: vehicle_figures(study, airframe), ..Section::new("vehicle", "In a vehicle") }
}

fn rule_said(rule: &TuningRule, airframe: &Airframe) -> String {
    format!(
        "Each controller has the largest integral gain at an integral time of {} s that keeps a sensitivity of {}, a phase margin of \
         {:.0} degrees and a noise of the ESC's command of {}, and then the largest attitude gain at a sensitivity of {}.",
        airframe.controller.integral_time_s,
        rule.max_sensitivity,
        rule.phase_margin_deg,
        rule.actuator_noise,
        rule.attitude_max_sensitivity
    )
}

/// One row per actuator at the latency `index`: tuned at hover, or one gain set for the range.
#[must_use]
pub fn vehicle_table(study: &Study, airframe: &Airframe, index: usize, is_range: bool) -> Table {
    let at = &study.latencies[index];
    let rows = if is_range { &at.range } else { &at.hover };
    let (name, tuned) = if is_range {
        let [from, to] = airframe.hover.range;
        ("range", format!("one gain set for {from:.2} to {to:.2}, the worst of each"))
    } else {
        ("hover", format!("tuned for {:.2} alone", airframe.hover.command))
    };
    Table {
        name: format!("vehicle_{name}_latency_{}", index + 1),
        caption: format!(
            "Roll axis, latency {}, {tuned}: the angle's peak after {} N m",
            milliseconds(at),
            airframe.roll.disturbance_n_m
        ),
        columns: vec![
            Column::new("actuator", "actuator", ""),
            Column::new("bandwidth_rad_s", "bandwidth", "rad/s"),
            Column::new("bandwidth_over_none", "over none", ""),
            Column::new("disturbance_peak_deg", "peak", "deg"),
            Column::new("disturbance_peak_over_none", "over none", ""),
            Column::new("settling_ms", "settling", "ms"),
            Column::new("settling_over_none", "over none", ""),
            Column::new("verdict", "than none", ""),
        ],
        rows: rows.iter().map(|row| cells(row, &rows[0])).collect(),
        ..Table::default()
    }
}

fn cells(row: &Row, bare: &Row) -> Vec<Cell> {
    let own = row.performance.as_ref();
    let ratios = row.ratios(bare);
    let is_bare = row.actuator == bare.actuator;
    let verdict = match row.worth(bare) {
        _ if own.is_none() => "no gains",
        _ if is_bare => "",
        worth => worth.map_or("", |worth| worth.word()),
    };
    vec![
        Cell::text(row.actuator.name()),
        Cell::optional(own.map(|own| own.margins.bandwidth_rad_s), 1),
        Cell::optional(ratios.map(|ratios| ratios.bandwidth), 2),
        Cell::optional(own.map(|own| own.disturbance_peak_deg), 2),
        Cell::optional(ratios.map(|ratios| ratios.disturbance_peak), 2),
        Cell::optional(own.and_then(|own| own.settling_s).map(|settling_s| 1e3 * settling_s), 0),
        Cell::optional(ratios.and_then(|ratios| ratios.settling), 2),
        Cell::text(verdict),
    ]
}

/// One row per actuator at the latency `index`: without a D term, and with the gains of the first latency.
#[must_use]
pub fn vehicle_other_table(study: &Study, airframe: &Airframe, index: usize) -> Table {
    let (at, first) = (&study.latencies[index], &study.latencies[0]);
    let row = |row: &Row| {
        let kept = at.kept_gains.iter().find(|kept| kept.actuator == row.actuator);
        let sensitivity = match kept {
            None => Cell::unknown("-"),
            Some(kept) => kept.max_sensitivity.map_or_else(|| Cell::text("unstable"), |value| Cell::number(value, 2)),
        };
        let own = row.performance.as_ref();
        let mut cells = vec![
            Cell::text(row.actuator.name()),
            Cell::optional(own.map(|own| own.margins.bandwidth_rad_s), 1),
            Cell::optional(own.map(|own| own.disturbance_peak_deg), 2),
        ];
        // At the first latency these are the gains that were tuned for it.
        cells.extend((index > 0).then_some(sensitivity));
        cells
    };
    let without_d = format!(
        "Latency {}, {:.2} alone: without a D term (- where no gains keep the margins)",
        milliseconds(at),
        airframe.hover.command
    );
    let kept = format!(", and the largest sensitivity with the gains for {}", milliseconds(first));
    let mut columns = vec![
        Column::new("actuator", "actuator", ""),
        Column::new("without_d_bandwidth_rad_s", "bandwidth without D", "rad/s"),
        Column::new("without_d_disturbance_peak_deg", "peak without D", "deg"),
    ];
    columns.extend((index > 0).then(|| Column::new("kept_gains_max_sensitivity", "sensitivity with those gains", "")));
    Table {
        name: format!("vehicle_without_d_latency_{}", index + 1),
        caption: if index == 0 { without_d } else { without_d + &kept },
        columns,
        rows: at.without_d.iter().map(row).collect(),
        ..Table::default()
    }
}

/// The gain sets at the latency `index`, with what they keep.
#[must_use]
pub fn vehicle_gains_table(study: &Study, index: usize) -> Table {
    let at = &study.latencies[index];
    let sets = [("hover", &at.hover), ("range", &at.range), ("hover, no D", &at.without_d)];
    let rows = sets.into_iter().flat_map(|(name, rows)| {
        rows.iter().filter_map(move |row| {
            let own = row.performance.as_ref()?;
            Some(vec![
                Cell::text(row.actuator.name()),
                Cell::text(name),
                Cell::number(own.gains.rate_p_1_s, 1),
                Cell::number(1e3 * own.gains.derivative_time_s, 2),
                Cell::number(own.gains.attitude_p_1_s, 2),
                Cell::number(own.margins.max_sensitivity, 2),
                Cell::number(own.margins.phase_margin_deg, 1),
                Cell::number(own.margins.actuator_noise, 4),
            ])
        })
    });
    Table {
        name: format!("vehicle_gains_latency_{}", index + 1),
        caption: format!("Gain sets at a latency of {}, and the margins that they keep", milliseconds(at)),
        columns: vec![
            Column::new("actuator", "actuator", ""),
            Column::new("tuned_for", "tuned for", ""),
            Column::new("rate_p_1_s", "rate P", "1/s"),
            Column::new("derivative_time_ms", "Td", "ms"),
            Column::new("attitude_p_1_s", "attitude P", "1/s"),
            Column::new("max_sensitivity", "Ms", ""),
            Column::new("phase_margin_deg", "phase margin", "deg"),
            Column::new("actuator_noise", "noise", ""),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}

/// One row per actuator: how it follows a lateral force; `None` where there is none.
#[must_use]
pub fn vehicle_force_table(study: &Study, airframe: &Airframe) -> Option<Table> {
    let (lateral, bare) = (airframe.lateral?, study.lateral.first()?.performance);
    let row = |row: &ForceRow| {
        let own = row.performance;
        vec![
            Cell::text(row.actuator.name()),
            Cell::optional(own.rise_s.map(|rise_s| 1e3 * rise_s), 1),
            Cell::optional(own.rise_s.zip(bare.rise_s).map(|(own, bare)| own / bare), 2),
            Cell::number(100.0 * own.tracking_error, 1),
            Cell::number(own.tracking_error / bare.tracking_error, 2),
        ]
    };
    Some(Table {
        name: "vehicle_lateral_force".to_owned(),
        caption: format!(
            "Hexarotor with rotors tilted by {} degrees, at {:.2}: rise of a lateral force of {} N, and RMS error of a sine of {} N at \
             {} Hz",
            lateral.tilt_deg, airframe.hover.command, lateral.step_n, lateral.sine_n, lateral.sine_hz
        ),
        columns: vec![
            Column::new("actuator", "actuator", ""),
            Column::new("rise_ms", "rise", "ms"),
            Column::new("rise_over_none", "over none", ""),
            Column::new("tracking_error_percent", "tracking error", "%"),
            Column::new("tracking_error_over_none", "over none", ""),
        ],
        rows: study.lateral.iter().map(row).collect(),
        ..Table::default()
    })
}

fn milliseconds(at: &AtLatency) -> String {
    format!("{:.1} ms", 1e3 * at.latency_s)
}
