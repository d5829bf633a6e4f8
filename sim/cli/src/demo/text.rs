//! What the demonstration prints.

use std::fmt::Write as _;
use std::path::Path;

use rotorlead_identify::{Bandwidth, table_2};
use rotorlead_report::paper::{CONTRADICTIONS, PAPER, PaperRow};
use rotorlead_report::{bandwidth_cell, cells, verdict};

use super::Demonstrated;
use crate::design::describe;
use crate::outcome::wrapped;

/// A bandwidth in a column.
fn cell(bandwidth: Bandwidth) -> String {
    bandwidth_cell(bandwidth, 2)
}

impl Demonstrated<'_> {
    /// For people.
    pub(super) fn text(&self, folder: &Path, figure: &Path) -> Result<String, std::fmt::Error> {
        let Self { model, validated, design, simulated, measured } = *self;
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
}
