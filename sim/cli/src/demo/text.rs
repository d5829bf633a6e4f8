//! What the demonstration prints.

use std::fmt::Write as _;
use std::path::Path;

use rotorlead_answer::Audience;
use rotorlead_answer::words::paragraph;
use rotorlead_results::paper::CONTRADICTIONS;
use rotorlead_results::validation_in_words;

use super::Demonstrated;

impl Demonstrated<'_> {
    /// For people.
    pub(super) fn text(&self, folder: &Path, [bode, steps]: [&Path; 2]) -> Result<String, std::fmt::Error> {
        let Self { validated, compensator, .. } = *self;
        let mut out = String::new();
        let [lags, fits, simulated, measured] = self.tables();
        writeln!(out, "{}\n{}", lags.text(), fits.text())?;
        let further = ["A real actuator is more than one lag; these are not.", "The paper prints no ceiling."];
        let said = validation_in_words(validated).into_iter().chain(further.map(str::to_owned));
        out.extend(said.map(|sentence| paragraph(&sentence, "  ")));

        for table in compensator.tables.iter().filter(|table| table.weight == Audience::Shown) {
            writeln!(out, "\n{}", table.text())?;
        }

        writeln!(out, "{}\n{}", simulated.text(), measured.text().trim_end())?;
        writeln!(
            out,
            "  From 0.45 to 0.55 the compensated response runs almost level near -3 dB: there\n  \
             0.1 dB moves the bandwidth by a tenth, and the intervals show it. The paper's\n  \
             measured bandwidths are those of its own stand, whose actuators are more than\n  \
             a lag; ours are measured on simulated lags, so they meet the simulation."
        )?;

        writeln!(out, "\n{}", self.inverse.table().text().trim_end())?;
        writeln!(
            out,
            "  Measured with an amplitude of 0.02: by the paper's 0.05 the command of the\n  \
             slowest actuator would meet its limits. Beyond 0.05 outside the commands that\n  \
             were measured the inverse is bypassed."
        )?;

        writeln!(out, "\nBode plot: {}", bode.display())?;
        writeln!(out, "Steps: {}", steps.display())?;
        writeln!(out, "Model and compensators: {}", folder.display())?;
        Ok(out)
    }

    /// Where the paper contradicts itself.
    pub(super) fn contradictions() -> String {
        let listed = CONTRADICTIONS.iter().map(|contradiction| paragraph(&format!("- {contradiction}"), "  "));
        std::iter::once("Where the paper contradicts itself:\n".to_owned()).chain(listed).collect()
    }
}
