//! The conditioned inverse on the same actuators: what goes beyond the paper.

use rotorlead_answer::{Axis, Cell, Color, Column, Figure, FigureKind, Mark, Panel, Series, Table};
use rotorlead_design::{
    BandwidthPoint, Chain, InverseOptions, StepPoint, StepSimulation, bandwidths, design_inverse, steps,
};
use rotorlead_identify::frequency_response::bandwidth::EtfeBandwidth;
use rotorlead_identify::lag::multisine::{PeriodicOptions, identify_periodic};
use rotorlead_plant::bench::Plan;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Excitation;
use rotorlead_results::bandwidth_cell;
use serde::Serialize;

use crate::progress;
use crate::simulate::simulate;
use rotorlead_results::RESAMPLES;

/// Amplitude of its multisines: with the paper's 0.05 the slowest actuator's command would meet its limits in a tenth of all ticks.
const AMPLITUDE: f64 = 0.02;
/// Size of the steps in the table.
const STEP: f64 = 0.05;
/// Steps in the figure, from the lowest nominal command.
const DRAWN_STEPS: [f64; 2] = [0.05, 0.3];
/// Slew limit in the figure, units of the command per second: 2 % per millisecond.
const DRAWN_SLEW_PER_S: f64 = 20.0;
/// How long they are drawn, seconds, and how many ticks there are to a point.
const DRAWN_S: f64 = 0.4;
const DRAWN_EVERY: usize = 5;

/// What came of the inverse.
pub(super) struct InverseDemonstration {
    pub design: CompensatorDesign,
    /// By the lags of the paper and the inverse that they give.
    pub simulated: Vec<BandwidthPoint>,
    /// On the stand, with actuators whose time constant follows their speed.
    pub measured: Vec<EtfeBandwidth>,
    /// With the lead, and with the inverse.
    pub steps: [Vec<StepPoint>; 2],
    pub figure: Figure,
}

/// What came out at one nominal command, for programs.
#[derive(Serialize)]
pub(super) struct Row {
    nominal: f64,
    simulated_rad_s: rotorlead_identify::frequency_response::bandwidth::Bandwidth,
    measured_rad_s: rotorlead_identify::frequency_response::bandwidth::Bandwidth,
    measured_interval_rad_s: [rotorlead_identify::frequency_response::bandwidth::Bandwidth; 2],
    steps: Vec<StepPoint>,
}

impl InverseDemonstration {
    /// Designs an inverse for `model`, which was identified, and measures it on `actuators`; `lead` is for comparison.
    pub(super) fn run(actuators: &Model, model: &Model, plan: &Plan, lead: &CompensatorDesign) -> miette::Result<Self> {
        let design = design_inverse(model, &InverseOptions::default())?.compensator;
        let design = CompensatorDesign::from(design).designed_for(model);
        let mut plan = plan.clone().compensated("inverse.toml");
        plan.records.retain(|record| record.excitation == Excitation::Multisine);
        plan.records.iter_mut().for_each(|record| record.amplitude = Some(AMPLITUDE));
        let stand = simulate(&plan, actuators, Some(&design))?;
        let bar = progress::spinner("measuring the inverse");
        let measured = identify_periodic(&stand, &PeriodicOptions::default())?.bandwidths(RESAMPLES, plan.seed)?;
        let papers: CompensatorDesign = design_inverse(actuators, &InverseOptions::default())?.compensator.into();
        let simulated = bandwidths(actuators, Chain::Designed(&papers));
        let steps_of = |design: &CompensatorDesign| steps(actuators, design, plan.esc_frame_hz, &[STEP]);
        let steps = [steps_of(lead)?, steps_of(&design)?];
        let slow = InverseOptions { slew_per_s: Some(DRAWN_SLEW_PER_S), ..InverseOptions::default() };
        let slow = design_inverse(model, &slow)?.compensator.into();
        let figure = figure(actuators, plan.esc_frame_hz, lead, &design, &slow)?;
        bar.finish_and_clear();
        let measured = measured.into_iter().map(|measured| measured.bandwidth).collect();
        Ok(Self { design, simulated, measured, steps, figure })
    }

    /// For programs.
    pub(super) fn rows(&self) -> Vec<Row> {
        let rows = self.simulated.iter().zip(&self.measured);
        rows.map(|(simulated, measured)| Row {
            nominal: simulated.nominal,
            simulated_rad_s: simulated.compensated,
            measured_rad_s: measured.bandwidth,
            measured_interval_rad_s: [measured.lower, measured.upper],
            steps: self.steps[1].iter().filter(|step| step.nominal == simulated.nominal).copied().collect(),
        })
        .collect()
    }

    /// The further column of the paper's Table 3, and what a step does.
    pub(super) fn table(&self) -> Table {
        let up = |steps: &[StepPoint], nominal: f64| {
            let point = steps.iter().find(|point| point.nominal == nominal && point.step > 0.0).copied();
            let rise_ms = |response: rotorlead_design::StepResponse| response.rise_s.map(|rise_s| 1e3 * rise_s);
            (point.and_then(|point| rise_ms(point.uncompensated)), point.and_then(|point| rise_ms(point.compensated)))
        };
        let row = |(simulated, measured): (&BandwidthPoint, &EtfeBandwidth)| {
            let [(without, lead), (_, inverse)] =
                [&self.steps[0], &self.steps[1]].map(|steps| up(steps, simulated.nominal));
            vec![
                Cell::number(simulated.nominal, 2),
                bandwidth_cell(simulated.compensated, 2),
                bandwidth_cell(measured.bandwidth, 2),
                bandwidth_cell(measured.lower, 2),
                bandwidth_cell(measured.upper, 2),
                Cell::optional(without, 1),
                Cell::optional(lead, 1),
                Cell::optional(inverse, 1),
            ]
        };
        Table {
            name: "inverse_beside_table_3".to_owned(),
            caption: format!(
                "Bandwidth with the conditioned inverse instead, which the paper has not: simulated, and measured with its integers in the \
                 loop. Beside it the rise, 10 to 90 %, of a step by {STEP}"
            ),
            columns: vec![
                Column::new("u_nom", "u_nom", "duty"),
                Column::new("simulated_rad_s", "simulated", "rad/s"),
                Column::new("measured_rad_s", "measured", "rad/s"),
                Column::new("lower_rad_s", "from", "rad/s"),
                Column::new("upper_rad_s", "to", "rad/s"),
                Column::new("uncompensated_rise_ms", "rise without", "ms"),
                Column::new("lead_rise_ms", "rise with lead", "ms"),
                Column::new("inverse_rise_ms", "rise with inverse", "ms"),
            ],
            rows: self.simulated.iter().zip(&self.measured).map(row).collect(),
            ..Table::default()
        }
    }
}

/// A small and a large step without a compensator, with the lead, and with the inverse, whose ESC has a slew limit or none.
fn figure(
    actuators: &Model,
    esc_frame_hz: Option<f64>,
    lead: &CompensatorDesign,
    inverse: &CompensatorDesign,
    slow: &CompensatorDesign,
) -> miette::Result<Figure> {
    let nominal = actuators.points.first().map_or(0.0, |point| point.nominal);
    let rate_hz = lead.loop_rate_hz();
    let mut panels = Vec::new();
    for step in DRAWN_STEPS {
        let stepped =
            StepSimulation { model: actuators, esc_frame_hz, nominal, step, rate_hz, duration_s: DRAWN_S, supply: 1.0 };
        let mut series = Vec::new();
        // One end for all: that of the actuator alone, a second on.
        let long = StepSimulation { duration_s: 3.0, ..stepped }.responses(None)?;
        let (Some(start), Some(end)) = (long.first(), long.last()) else { continue };
        let slewing = format!("inverse, slew {DRAWN_SLEW_PER_S}/s");
        for (name, color, design) in [
            ("none", Color::Gray, None),
            ("lead", Color::Vermilion, Some(lead)),
            ("inverse", Color::Blue, Some(inverse)),
            (slewing.as_str(), Color::Green, Some(slow)),
        ] {
            let responses = stepped.responses(design)?;
            let part =
                |(tick, response): (usize, &f64)| (1e3 * tick as f64 / rate_hz, (response - start) / (end - start));
            let points = responses.iter().enumerate().step_by(DRAWN_EVERY).map(part).collect();
            series.push(Series::new(name, color, Mark::Line, points));
        }
        let title = format!("{nominal:.2} to {:.2}", nominal + step);
        panels.push(Panel {
            title,
            ..Panel::new(Axis::linear("time", "ms"), Axis::linear("part of the step", ""), series)
        });
    }
    Ok(Figure::new(
        FigureKind::DemonstratedSteps,
        "Thrust after a step of the command, over the step",
        "A small step, which the lead answers with a quick part and then the lag, and a large one. The command of the inverse meets its \
         limits there, and its state is that of a rotor that gets no more: it does not overshoot, nor wind up. With a slew limit it \
         reckons with that too.",
        panels,
    ))
}
