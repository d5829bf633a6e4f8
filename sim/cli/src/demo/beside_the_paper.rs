//! What came out beside what the paper prints, for the report.

use rotorlead_answer::{Cell, Column, Section, Table, Tone, Verdict, with_std};
use rotorlead_assess::{SMALLEST_ERROR_PERCENT, records_with_model_error};
use rotorlead_design::BandwidthPoint;
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;
use rotorlead_identify::validate::{FitBesideCeiling, table_2};
use rotorlead_results::paper::{CONTRADICTIONS, PAPER};
use rotorlead_results::{bandwidth_cell, bandwidth_range, lags};

use super::Demonstrated;

impl Demonstrated<'_> {
    /// How near the paper it is, in sentences.
    pub(super) fn verdict(&self) -> Verdict {
        let farthest_pole = PAPER
            .iter()
            .zip(&self.model.points)
            .map(|(paper, point)| (1.0 / point.time_constant_s / paper.omega_s_rad_s - 1.0).abs())
            .fold(0.0, f64::max);
        let outside = self.measured.iter().filter(|one| !one.holds_its_prediction()).count();
        let sentences = vec![
            format!(
                "Identified: {}; no pole farther than {:.2} % from the one simulated, which is the paper's.",
                lags(self.model),
                100.0 * farthest_pole
            ),
            match records_with_model_error(self.validated).map(|wrong| !wrong.is_empty()) {
                Some(false) => format!("The model leaves no more than noise, or than {SMALLEST_ERROR_PERCENT} % of the response."),
                Some(true) => "The model leaves more than noise.".to_owned(),
                None => "No record shows its noise.".to_owned(),
            },
            format!(
                "Measured with the filter in integers in the loop: {} of {} compensated bandwidths have their noise-free \
                 value inside their 95 % interval.",
                self.measured.len() - outside,
                self.measured.len()
            ),
            "The paper's own measured bandwidths lie elsewhere: its actuators are more than a lag, those simulated here are not."
                .to_owned(),
        ];
        let compensated = |points: &[BandwidthPoint]| bandwidth_range(points, |point| point.compensated);
        let headline = format!(
            "Bandwidth: {} rad/s without a compensator, {} with the paper's lead, {} with the inverse.",
            bandwidth_range(self.simulated, |point| point.uncompensated),
            compensated(self.simulated),
            compensated(&self.inverse.simulated),
        );
        Verdict::new(Tone::Plain, headline).with(sentences)
    }

    /// Tables 1 to 3 of the paper with a column for each number that was found here.
    pub(super) fn beside_the_paper(&self) -> Section {
        let mut text = vec!["The actuators that are simulated have the lags of the paper's Table 1.".to_owned()];
        text.push("Where the paper contradicts itself:".to_owned());
        text.extend(CONTRADICTIONS.map(str::to_owned));
        Section { text, tables: self.tables().into(), ..Section::new("paper", "Beside the paper") }
    }

    /// Identified lags, validation, and bandwidths simulated and measured.
    pub(super) fn tables(&self) -> [Table; 4] {
        [self.lags(), self.fits(), self.simulated_bandwidths(), self.measured_bandwidths()]
    }

    fn lags(&self) -> Table {
        let rows = PAPER.iter().zip(&self.model.points).map(|(paper, point)| {
            vec![
                Cell::number(paper.nominal, 2),
                Cell::number(paper.gain, 4),
                Cell::shown(point.gain, with_std(point.gain, point.gain_std, 1.0, 4)),
                Cell::number(1e3 / paper.omega_s_rad_s, 1),
                Cell::shown(
                    1e3 * point.time_constant_s,
                    with_std(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
                ),
                Cell::number(paper.omega_s_rad_s, 4),
                Cell::number(1.0 / point.time_constant_s, 4),
            ]
        });
        table(
            "paper_table_1",
            "Identified lags K / (tau s + 1), beside those simulated (the paper's Table 1)",
            vec![
                Column::new("paper_gain_n", "K, paper", "N"),
                Column::new("gain_n", "here", "N"),
                Column::new("paper_time_constant_ms", "tau, paper", "ms"),
                Column::new("time_constant_ms", "here", "ms"),
                Column::new("paper_pole_rad_s", "1/tau, paper", "rad/s"),
                Column::new("pole_rad_s", "here", "rad/s"),
            ],
            rows,
        )
    }

    fn fits(&self) -> Table {
        let rows = PAPER.iter().zip(table_2(self.validated)).map(|(paper, row)| {
            let here = |found: Option<FitBesideCeiling>| {
                let ceiling = found.and_then(|found| found.ceiling_percent);
                [Cell::optional(found.map(|found| found.fit_percent), 2), Cell::optional(ceiling, 2)]
            };
            let mut cells = vec![Cell::number(paper.nominal, 2), Cell::number(paper.fit_frequency_percent, 2)];
            cells.extend(here(row.frequency));
            cells.push(Cell::number(paper.fit_square_percent, 2));
            cells.extend(here(row.square));
            cells
        });
        table(
            "paper_table_2",
            "Validation, and what noise leaves a perfect model (the paper's Table 2); squares are held out",
            vec![
                Column::new("paper_fit_frequency_percent", "in frequency, paper", "% fit"),
                Column::new("fit_frequency_percent", "here", "% fit"),
                Column::new("ceiling_frequency_percent", "ceiling", "% fit"),
                Column::new("paper_fit_square_percent", "on squares, paper", "% fit"),
                Column::new("fit_square_percent", "here", "% fit"),
                Column::new("ceiling_square_percent", "ceiling", "% fit"),
            ],
            rows,
        )
    }

    fn simulated_bandwidths(&self) -> Table {
        let cell = |bandwidth: Bandwidth| Cell::optional(bandwidth.rad_s(), 4);
        let rows = PAPER.iter().zip(self.simulated).map(|(paper, simulated)| {
            vec![
                Cell::number(paper.nominal, 2),
                Cell::number(paper.simulated_rad_s.0, 4),
                cell(simulated.uncompensated),
                Cell::number(paper.simulated_rad_s.1, 4),
                cell(simulated.compensated),
            ]
        });
        table(
            "paper_table_3_simulated",
            "Bandwidth without and with the compensator, simulated: C(s) and the lag (the paper's Table 3)",
            vec![
                Column::new("paper_uncompensated_rad_s", "without, paper", "rad/s"),
                Column::new("uncompensated_rad_s", "here", "rad/s"),
                Column::new("paper_compensated_rad_s", "with, paper", "rad/s"),
                Column::new("compensated_rad_s", "here", "rad/s"),
            ],
            rows,
        )
    }

    fn measured_bandwidths(&self) -> Table {
        let cell = |bandwidth| bandwidth_cell(bandwidth, 2);
        let rows = PAPER.iter().zip(self.measured).map(|(paper, measured)| {
            vec![
                Cell::number(paper.nominal, 2),
                Cell::number(paper.measured_rad_s.0, 2),
                cell(measured.uncompensated.bandwidth),
                Cell::number(paper.measured_rad_s.1, 2),
                cell(measured.compensated.bandwidth),
                cell(measured.compensated.lower),
                cell(measured.compensated.upper),
                cell(measured.predicted),
            ]
        });
        table(
            "paper_table_3_measured",
            "The same, measured: ETFE, the filter in integers in the loop, 95 % interval",
            vec![
                Column::new("paper_uncompensated_rad_s", "without, paper", "rad/s"),
                Column::new("uncompensated_rad_s", "here", "rad/s"),
                Column::new("paper_compensated_rad_s", "with, paper", "rad/s"),
                Column::new("compensated_rad_s", "here", "rad/s"),
                Column::new("lower_rad_s", "from", "rad/s"),
                Column::new("upper_rad_s", "to", "rad/s"),
                Column::new("noise_free_rad_s", "noise-free", "rad/s"),
            ],
            rows,
        )
    }
}

/// One of the paper's tables, by nominal command.
fn table(name: &str, caption: &str, columns: Vec<Column>, rows: impl Iterator<Item = Vec<Cell>>) -> Table {
    let nominal = Column::new("u_nom", "u_nom", "duty");
    Table {
        name: name.to_owned(),
        caption: caption.to_owned(),
        columns: std::iter::once(nominal).chain(columns).collect(),
        rows: rows.collect(),
        ..Table::default()
    }
}
