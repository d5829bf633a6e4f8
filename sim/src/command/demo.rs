//! `rotorlead demo`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::IntoDiagnostic as _;
use num_complex::Complex64;
use rotorlead::design::LeadDesign;
use serde_json::json;

use super::bandwidth::RESAMPLES;
use super::design::describe;
use super::identify::periodic_model;
use super::outcome::{JsonOption, Outcome, wrapped};
use super::report_option::{ReportOption, check_folder, make_folder};
use super::simulate::simulate;
use super::validate::record_json;
use super::{progress, report_pages};
use crate::bench::{Plan, Prediction};
use crate::design::{BandwidthPoint, Chain, DesignOptions, bandwidths, compensator_file, design};
use crate::files::write_file;
use crate::identify::{
    Bandwidth, EtfeBandwidth, MeasuredBandwidth, NominalIdentification, PeriodicIdentification, PeriodicOptions,
    RecordValidation, bandwidth_of, identify_periodic, table_2, validate,
};
use crate::plant::Model;
use crate::report::paper::{CONTRADICTIONS, PAPER, PaperRow, table_1};
use crate::report::{
    Color, Curve, Figure, FigureKind, Identification, Mark, Report, Tone, Verdict, bandwidth_cell, bandwidth_section,
    bode, cells, design_section, excitation_section, identification_section, measured_response, rad_s,
    simulation_and_experiment, validation_section, verdict,
};

/// Nominal commands in the Bode plot: one in the middle, where compensation helps by half, and the fastest.
const DRAWN: [f64; 2] = [0.50, 0.65];
/// Highest frequency of a line in the Bode plot, rad/s: the top line of the compensated run.
const DRAWN_UP_TO_RAD_S: f64 = 282.0;

/// Runs the paper's method from end to end on simulated actuators
///
/// The actuators have the lags of the paper's Table 1, and thrust noise of 0.02 N. They are driven by the code that runs
/// on the controller: its excitation, its filter in integers. What is identified, designed and measured is printed
/// beside what the paper prints.
#[derive(Args, Debug)]
pub struct Demo {
    /// Where the model, the compensator and the Bode plot go; those of an earlier run are replaced
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    pub(super) out: PathBuf,
    /// Seed of the thrust noise
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u64).range(..1 << 63), allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What the stand measured of one actuator, without and with the compensator.
struct Measured {
    uncompensated: EtfeBandwidth,
    compensated: EtfeBandwidth,
    /// What the compensated one would be without noise: section, holds and lag in closed form.
    predicted: Bandwidth,
}

impl Demo {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        check_folder(&self.out)?;
        self.report.check(None)?;
        let actuators = table_1();
        let plan = Plan { seed: self.seed, ..Plan::paper(&actuators) };
        let stand = simulate(&plan, &actuators, None)?;
        let bar = progress::spinner("identifying");
        let found = identify_periodic(&stand, &PeriodicOptions::default())?;
        let model = periodic_model(&stand, &found);
        let validated = validate(&stand, &model)?;
        let design = design(&model, &DesignOptions::default())?;
        bar.finish_and_clear();

        let compensated_plan = plan.clone().compensated("compensator.toml");
        let compensated_stand = simulate(&compensated_plan, &actuators, Some(&design))?;
        let bar = progress::spinner("measuring");
        let compensated = identify_periodic(&compensated_stand, &PeriodicOptions::default())?;
        let [before, after] = [&found, &compensated].map(|found| found.bandwidths(RESAMPLES, self.seed));
        let (before, after) = (before?, after?);
        bar.finish_and_clear();
        let measured = measured(&actuators, &compensated_plan, &design, &before, &after)?;
        let of_records = [before, after].concat();
        // The paper's own simulation: the lags of Table 1 and the compensator that they give.
        let papers_design = crate::design::design(&actuators, &DesignOptions::default())?;
        let simulated = bandwidths(&actuators, Chain::Continuous(papers_design.lead()));

        let figure = self.out.join("bode.svg");
        make_folder(&self.out)?;
        model.write(&self.out.join("model.toml"))?;
        compensator_file(&design).write(&self.out.join("compensator.toml"))?;
        let drawn = bode_plot(&design, &found, &compensated);
        write_file(&figure, drawn.svg()?.as_bytes())?;

        let written = self.report.write(|| {
            let identification =
                Identification { output: stand.output, model: &model, found: Some(&found), static_map: None };
            let mut bandwidth = bandwidth_section(&simulated, &of_records);
            bandwidth.figures.extend(measured_response(&found, &compensated));
            bandwidth.figures.extend(simulation_and_experiment(&found, &compensated, &design));
            bandwidth.figures.push(drawn);
            let sections = vec![
                identification_section(&identification),
                excitation_section(&stand),
                validation_section(&validated, stand.output),
                design_section(&design, &model),
                bandwidth,
            ];
            let verdict = Verdict::new(Tone::Plain, report_pages::faster(&simulated));
            let facts = report_pages::records(&stand, &self.out);
            let title = "The paper's method on simulated actuators";
            Report { facts, sections, ..report_pages::report("Demonstration", title, verdict) }
        })?;
        let text =
            text(&model, &validated, &design, &simulated, &measured, &self.out, &figure).into_diagnostic()? + &written;
        let json = json!({
            "points": model.points,
            "validation": validated.iter().map(record_json).collect::<Vec<_>>(),
            "compensator": compensator_file(&design),
            "bandwidth": PAPER.iter().zip(&simulated).zip(&measured).map(|((paper, simulated), measured)| json!({
                "nominal": paper.nominal,
                "paper": {
                    "simulated_rad_s": paper.simulated_rad_s,
                    "measured_rad_s": paper.measured_rad_s,
                },
                "simulated_rad_s": [rad_s(simulated.uncompensated), rad_s(simulated.compensated)],
                "measured_rad_s": [rad_s(measured.uncompensated.bandwidth), rad_s(measured.compensated.bandwidth)],
                "measured_compensated_interval_rad_s": [rad_s(measured.compensated.lower), rad_s(measured.compensated.upper)],
                "predicted_compensated_rad_s": rad_s(measured.predicted),
            })).collect::<Vec<_>>(),
            "contradictions": CONTRADICTIONS,
            "bode": figure,
        });
        Ok(Outcome { text, json })
    }
}

/// Bandwidths of the ETFEs, and what the compensated ones should be.
fn measured(
    actuators: &Model,
    plan: &Plan,
    design: &LeadDesign,
    before: &[MeasuredBandwidth],
    after: &[MeasuredBandwidth],
) -> miette::Result<Vec<Measured>> {
    before
        .iter()
        .zip(after)
        .map(|(before, after)| {
            let prediction = Prediction::new(plan, actuators, after.nominal, Some(design))?;
            Ok(Measured {
                uncompensated: before.bandwidth,
                compensated: after.bandwidth,
                predicted: bandwidth_of(|omega| prediction.response(omega), DRAWN_UP_TO_RAD_S),
            })
        })
        .collect()
}

/// Models as lines and ETFEs as dots, both over the static gain.
fn bode_plot(design: &LeadDesign, found: &PeriodicIdentification, compensated: &PeriodicIdentification) -> Figure {
    let mut curves = Vec::new();
    let drawn = |nominal: f64| DRAWN.iter().any(|drawn| (drawn - nominal).abs() < 1e-9);
    let pairs = found.nominals.iter().zip(&compensated.nominals).filter(|(before, _)| drawn(before.nominal));
    for (index, (before, after)) in pairs.enumerate() {
        let gain = before.fit.gain.value;
        let lag = |omega: f64| before.fit.response(omega) / gain;
        let led = |omega: f64| lag(omega) * design.response(omega);
        let mut add = |what: &str, color: usize, model: &dyn Fn(f64) -> Complex64, measured: &NominalIdentification| {
            let (name, color) = (format!("u_nom {:.2}, {what}", before.nominal), Color::nth(color));
            let ends = (0.6, DRAWN_UP_TO_RAD_S);
            curves.push(Curve::of_model(format!("{name}, model"), Mark::Line, color, ends, model).under(&name));
            let points = measured.responses[0].actuator.smoothed();
            let dots = Curve::measured(format!("{name}, measured"), Mark::Dots, color, points, gain);
            curves.push(Curve { bands: Vec::new(), ..dots.under(&name) });
        };
        add("without", 2 * index, &lag, before);
        add("with compensator", 2 * index + 1, &led, after);
    }
    Figure::new(
        FigureKind::Demonstration,
        "Actuator over its static gain: dots measured, lines modeled",
        "Two of the levels, each without and with the compensator. The actuators are simulated lags, so that dots lie \
         on their lines.",
        bode(&curves, "dB over the static gain", &[("-3 dB", -3.0)]),
    )
}

/// A bandwidth in a column.
fn cell(bandwidth: Bandwidth) -> String {
    bandwidth_cell(bandwidth, 2)
}

fn text(
    model: &Model,
    validated: &[RecordValidation],
    design: &LeadDesign,
    simulated: &[BandwidthPoint],
    measured: &[Measured],
    folder: &Path,
    figure: &Path,
) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let rows = || PAPER.iter().zip(&model.points);

    writeln!(out, "Identified lags K / (tau s + 1), beside those simulated (the paper's Table 1)\n")?;
    writeln!(out, "           K (N)                       tau (ms)                    1/tau (rad/s)")?;
    writeln!(out, "  u_nom    paper   here                paper   here                paper    here")?;
    for (PaperRow { nominal, gain, omega_s_rad_s, .. }, point) in rows() {
        let std = |std: Option<f64>, scale: f64, digits: usize| {
            std.map_or(String::new(), |std| format!("+- {:.digits$}", scale * std))
        };
        writeln!(
            out,
            "  {nominal:<5.2} {gain:>8.4}  {:>7.4} {:<9} {:>7.1}  {:>6.2} {:<8} {omega_s_rad_s:>9.4}  {:>8.4}",
            point.gain,
            std(point.gain_std, 1.0, 4),
            1e3 / omega_s_rad_s,
            1e3 * point.time_constant_s,
            std(point.time_constant_s_std, 1e3, 2),
            1.0 / point.time_constant_s,
        )?;
    }

    writeln!(out, "\nValidation, % fit, and what noise leaves a perfect model (the paper's Table 2)\n")?;
    writeln!(out, "           frequency domain            square wave, held out")?;
    writeln!(out, "  u_nom    paper    here  ceiling     paper    here  ceiling")?;
    for (paper, row) in PAPER.iter().zip(table_2(validated)) {
        let [(frequency, frequency_ceiling), (square, square_ceiling)] = cells(&row);
        writeln!(
            out,
            "  {:<5.2}  {:>7.2} {frequency:>7}  {frequency_ceiling:>7}   {:>7.2} {square:>7}  {square_ceiling:>7}",
            paper.nominal, paper.fit_frequency_percent, paper.fit_square_percent,
        )?;
    }
    write!(out, "{}", verdict(validated))?;
    writeln!(out, "A real actuator is more than one lag; these are not.\nThe paper prints no ceiling.")?;

    writeln!(out, "\nCompensator\n\n{}", describe(design, model))?;

    writeln!(out, "Bandwidth in rad/s (the paper's Table 3)\n")?;
    writeln!(out, "           simulated: C(s) and the lag")?;
    writeln!(out, "           uncompensated     compensated")?;
    writeln!(out, "  u_nom    paper    here     paper    here")?;
    for (paper, simulated) in PAPER.iter().zip(simulated) {
        let here =
            |bandwidth: Bandwidth| bandwidth.rad_s().map_or_else(|| "-".to_owned(), |omega| format!("{omega:.4}"));
        let (before, after) = paper.simulated_rad_s;
        writeln!(
            out,
            "  {:<5.2} {before:>8.4} {:>8} {after:>8.4} {:>8}",
            paper.nominal,
            here(simulated.uncompensated),
            here(simulated.compensated),
        )?;
    }
    writeln!(out, "\n           measured: ETFE, the filter in integers in the loop")?;
    writeln!(out, "           uncompensated    compensated")?;
    writeln!(out, "  u_nom    paper   here     paper   here     95 % interval   noise-free")?;
    for (paper, measured) in PAPER.iter().zip(measured) {
        let interval = format!("{} .. {}", cell(measured.compensated.lower), cell(measured.compensated.upper));
        let (before, after) = paper.measured_rad_s;
        writeln!(
            out,
            "  {:<5.2} {before:>8.2} {:>6}   {after:>7.2} {:>6}  {interval:>16} {:>12}",
            paper.nominal,
            cell(measured.uncompensated.bandwidth),
            cell(measured.compensated.bandwidth),
            cell(measured.predicted),
        )?;
    }
    writeln!(
        out,
        "  From 0.45 to 0.55 the compensated response runs almost level near -3 dB: there\n  \
         0.1 dB moves the bandwidth by a tenth, and the intervals show it. The paper's\n  \
         measured bandwidths are those of its own stand, whose actuators are more than\n  \
         a lag; ours are measured on simulated lags, so they meet the simulation."
    )?;

    writeln!(out, "\nWhere the paper contradicts itself\n")?;
    for contradiction in CONTRADICTIONS {
        writeln!(out, "  - {}", wrapped(contradiction, 76, "    "))?;
    }
    writeln!(out, "\nBode plot: {}", figure.display())?;
    writeln!(out, "Model and compensator: {}", folder.display())?;
    Ok(out)
}
