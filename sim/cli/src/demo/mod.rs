//! `rotorlead demo`

mod beside_the_paper;
mod inverse;
mod text;

use inverse::InverseDemonstration;

use std::path::{Path, PathBuf};

use clap::Args;
use miette::IntoDiagnostic as _;
use num_complex::Complex64;
use rotorlead::design::LeadDesign;
use rotorlead_answer::{Answer, Color, Figure, FigureKind, Mark, Report, Section};
use rotorlead_design::{BandwidthPoint, Chain, DesignOptions, Latency, design};
use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, EtfeBandwidth, compute_bandwidth};
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_identify::lag::multisine::MeasuredBandwidth;
use rotorlead_identify::lag::multisine::{
    NominalIdentification, PeriodicIdentification, PeriodicOptions, identify_periodic,
};
use rotorlead_identify::validate::{RecordValidation, validate};
use rotorlead_plant::bench::{Plan, Prediction};
use rotorlead_plant::{CompensatorDesign, Model, Point, StoredCompensator};
use rotorlead_records::files::{AcceptedRange, make_folder, write_file};
use rotorlead_report::svg;
use rotorlead_results::paper::{CONTRADICTIONS, PAPER, PaperRow, table_1};
use rotorlead_results::{
    BandwidthResult, Curve, IdentifyResult, MeasuredRecords, RESAMPLES, bode, design_section, excitation_section,
    flight_section, validation_answer,
};
use serde::Serialize;

use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::number;
use super::report_option::{ReportOption, check_folder};
use super::simulate::simulate;
use super::{progress, report_pages};

/// Nominal commands in the Bode plot: one in the middle, where compensation helps by half, and the fastest.
const DRAWN: [f64; 2] = [0.50, 0.65];
/// Highest frequency of a line in the Bode plot, rad/s: the top line of the compensated run.
const DRAWN_UP_TO_RAD_S: f64 = 282.0;

/// Runs the paper's method from end to end on simulated actuators
///
/// The actuators have the lags of the paper's Table 1, and thrust noise of 0.02 N. They are driven by the code that runs
/// on the controller: its excitation, its filter in integers. What is identified, designed and measured is printed
/// beside what the paper prints. With --open a report is made too, in the folder of --out unless --report names another place.
#[derive(Args, Debug)]
pub struct Demo {
    /// Where the model, the compensators and the figures go; those of an earlier run are replaced
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    pub(super) out: PathBuf,
    /// Seed of the thrust noise
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u64).range(..1 << 63), allow_negative_numbers = true)]
    seed: u64,
    /// Most by which the command of C(s) changes per second: 20 is 2 % per millisecond; no limit unless given, as in the paper
    #[arg(long, value_name = "PER_S", value_parser = number(AcceptedRange::SLEW_PER_S), allow_negative_numbers = true)]
    slew: Option<f64>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What the stand measured of one actuator, without and with the compensator.
struct MeasuredActuator {
    uncompensated: EtfeBandwidth,
    compensated: EtfeBandwidth,
    /// What the compensated one would be without noise: section, holds and lag in closed form.
    predicted: Bandwidth,
}

impl MeasuredActuator {
    /// Whether what it should be lies in its interval.
    fn holds_its_prediction(&self) -> bool {
        let Some(predicted) = self.predicted.rad_s() else { return false };
        self.compensated.lower.rad_s().is_none_or(|lower| lower <= predicted)
            && self.compensated.upper.rad_s().is_none_or(|upper| predicted <= upper)
    }
}

/// All that came of it.
struct Demonstrated<'a> {
    model: &'a Model,
    validated: &'a [RecordValidation],
    compensator: &'a Section,
    /// By the lags of the paper and its compensator.
    simulated: &'a [BandwidthPoint],
    measured: &'a [MeasuredActuator],
    inverse: &'a InverseDemonstration,
}

/// What came out, for programs.
#[derive(Serialize)]
struct DemoJson<'a> {
    points: &'a [Point],
    validation: &'a [RecordValidation],
    compensator: StoredCompensator,
    bandwidth: Vec<BandwidthRow>,
    inverse: Vec<inverse::Row>,
    contradictions: [&'static str; CONTRADICTIONS.len()],
    bode: &'a Path,
    steps: &'a Path,
}

/// The bandwidths at one nominal command, without and with the compensator.
#[derive(Serialize)]
struct BandwidthRow {
    nominal: f64,
    paper: PaperPair,
    simulated_rad_s: [Bandwidth; 2],
    measured_rad_s: [Bandwidth; 2],
    measured_compensated_interval_rad_s: [Bandwidth; 2],
    predicted_compensated_rad_s: Bandwidth,
}

/// Those that the paper prints.
#[derive(Serialize)]
struct PaperPair {
    simulated_rad_s: (f64, f64),
    measured_rad_s: (f64, f64),
}

impl BandwidthRow {
    fn from_point(paper: &PaperRow, simulated: &BandwidthPoint, measured: &MeasuredActuator) -> Self {
        let PaperRow { nominal, simulated_rad_s, measured_rad_s, .. } = *paper;
        Self {
            nominal,
            paper: PaperPair { simulated_rad_s, measured_rad_s },
            simulated_rad_s: [simulated.uncompensated, simulated.compensated],
            measured_rad_s: [measured.uncompensated.bandwidth, measured.compensated.bandwidth],
            measured_compensated_interval_rad_s: [measured.compensated.lower, measured.compensated.upper],
            predicted_compensated_rad_s: measured.predicted,
        }
    }
}

impl Demo {
    /// Runs the command, says what came out, and opens its report where that is asked.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        let report = self.report.in_folder(&self.out)?;
        self.json.answer(Some(&self.out), || self.run(&report), verbosity)?;
        report.open();
        Ok(())
    }

    fn run(&self, report: &ReportOption) -> miette::Result<Outcome> {
        check_folder(&self.out)?;
        let actuators = table_1();
        let plan = Plan { seed: self.seed, ..Plan::paper(&actuators) };
        let stand = simulate(&plan, &actuators, None)?;
        let bar = progress::spinner("identifying");
        let identified = IdentifyResult::identify(&stand, &IdentifyOptions::default())?;
        let found = identified.identification.lags.in_frequency().expect("the paper's plan has multisines");
        let model = &identified.identification.model;
        let validated = validate(&stand, model)?;
        let design = design(model, &DesignOptions { slew_per_s: self.slew, ..DesignOptions::default() })?;
        bar.finish_and_clear();

        let compensated_plan = plan.clone().compensated("compensator.toml");
        let compensator = CompensatorDesign::from(design).designed_for(model);
        let compensated_stand = simulate(&compensated_plan, &actuators, Some(&compensator))?;
        let bar = progress::spinner("measuring");
        let compensated = identify_periodic(&compensated_stand, &PeriodicOptions::default())?;
        let [before, after] = [found, &compensated].map(|found| found.bandwidths(RESAMPLES, self.seed));
        let (before, after) = (before?, after?);
        bar.finish_and_clear();
        let measured = measured(&actuators, &compensated_plan, &compensator, &before, &after)?;
        let of_records = [before, after].concat();
        // The paper's own simulation: the lags of Table 1 and the compensator that they give.
        let papers_design = rotorlead_design::design(&actuators, &DesignOptions::default())?;
        let papers_chain = Chain::Continuous(papers_design.lead());
        let latency = Latency::standard(papers_design.loop_rate_hz());
        let mut simulated = BandwidthResult::predict(&actuators, papers_chain, latency)?;
        let nominals = [&found.nominals[..], &compensated.nominals].concat();
        simulated.measured = Some(MeasuredRecords { bandwidths: of_records, nominals });

        let inverse = InverseDemonstration::run(&actuators, model, &plan, &compensator)?;

        let (figure, steps) = (self.out.join("bode.svg"), self.out.join("demonstrated_steps.svg"));
        make_folder(&self.out)?;
        model.write(&self.out.join("model.toml"))?;
        compensator.write(&self.out.join("compensator.toml"))?;
        let of_design = design_section(&compensator, model);
        let drawn = bode_plot(&design, found, &compensated);
        write_file(&figure, svg(&drawn)?.as_bytes())?;
        inverse.design.write(&self.out.join("inverse.toml"))?;
        write_file(&steps, svg(&inverse.figure)?.as_bytes())?;

        let result = Demonstrated {
            model,
            validated: &validated,
            compensator: &of_design,
            simulated: &simulated.points,
            measured: &measured,
            inverse: &inverse,
        };
        let written = report.write(|| {
            let mut bandwidth = simulated.section(papers_chain);
            bandwidth.figures.push(drawn);
            bandwidth.tables.push(inverse.table());
            bandwidth.figures.push(inverse.figure.clone());
            let recommended = identified.assessment.recommendation.iter().map(flight_section);
            let parts = [
                identified.answer(&stand).section(),
                excitation_section(&stand),
                validation_answer(&validated, &identified.assessment.judgement, None, stand.output).section(),
                of_design.clone(),
                bandwidth,
                result.beside_the_paper(),
            ];
            let sections = recommended.chain(parts).collect();
            let facts = report_pages::records(&stand, &self.out);
            let title = "The paper's method on simulated actuators";
            Report { facts, sections, ..report_pages::report("Demonstration", title, result.verdict()) }
        })?;
        let text = result.text(&self.out, [&figure, &steps]).into_diagnostic()?;
        let said = Answer { verdict: result.verdict(), ..Answer::default() }.text();
        let detail = said.detail.trim_start().to_owned() + "\n" + &Demonstrated::contradictions();
        let bandwidth = PAPER.iter().zip(&simulated.points).zip(&measured);
        let values = DemoJson {
            points: &model.points,
            validation: &validated,
            compensator: compensator.stored(),
            bandwidth: bandwidth
                .map(|((paper, simulated), measured)| BandwidthRow::from_point(paper, simulated, measured))
                .collect(),
            contradictions: CONTRADICTIONS,
            inverse: inverse.rows(),
            bode: &figure,
            steps: &steps,
        };
        Ok(Outcome { detail, verdict: said.verdict + &written, ..Outcome::new(text, &values) })
    }
}

/// Bandwidths of the ETFEs, and what the compensated ones should be.
fn measured(
    actuators: &Model,
    plan: &Plan,
    design: &CompensatorDesign,
    before: &[MeasuredBandwidth],
    after: &[MeasuredBandwidth],
) -> miette::Result<Vec<MeasuredActuator>> {
    before
        .iter()
        .zip(after)
        .map(|(before, after)| {
            let prediction = Prediction::new(plan, actuators, after.nominal, Some(design))?;
            Ok(MeasuredActuator {
                uncompensated: before.bandwidth,
                compensated: after.bandwidth,
                predicted: compute_bandwidth(|omega| prediction.response(omega), DRAWN_UP_TO_RAD_S),
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
            curves.push(Curve::from_model(format!("{name}, model"), Mark::Line, color, ends, model).under(&name));
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
