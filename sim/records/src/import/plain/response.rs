//! Which of thrust and speed is the response of a record, and which rows it needs.
//!
//! What is asked for by `--response` or `--column` is taken, or the import fails. Otherwise a thrust that is filled in each row is the
//! response, and else the one of both that is filled in more rows. Of a stand whose thrust goes through filters, which delay it
//! more than the speed, it is the speed.

use super::columns::Pick;
use crate::experiment::Output;
use crate::import::ImportError;
use crate::import::table::Table;

/// The columns that may be a response, and those beside them.
pub(super) struct Columns<'a> {
    pub(super) table: &'a Table<'a>,
    /// Which row of the table each of theirs is.
    pub(super) places: &'a [usize],
    pub(super) thrust: Option<(Pick, &'a [f64])>,
    pub(super) speed: Option<(Pick, &'a [f64])>,
    /// All columns, for messages.
    pub(super) listed: &'a str,
    /// Voltage and current.
    pub(super) others: Vec<(Pick, &'a [f64])>,
}

/// What becomes the response.
pub(super) struct Decision {
    pub(super) output: Output,
    /// Why it is this of two.
    pub(super) note: Option<String>,
    /// Columns that need a number in each row taken.
    pub(super) needed: Vec<Pick>,
}

impl Columns<'_> {
    /// What is `stated`, or what the numbers allow; `is_filtered` where the thrust is known to lag behind the speed.
    pub(super) fn decide(&self, stated: Option<Output>, is_filtered: bool) -> Result<Decision, ImportError> {
        let (output, why) = match (stated, self.thrust, self.speed) {
            (Some(output), ..) => (output, String::from("as stated")),
            (None, _, None) => (Output::ThrustN, String::new()),
            (None, None, _) => (Output::Rpm, String::new()),
            (None, Some((_, thrust)), Some((_, speed))) => choose_output(thrust, speed, is_filtered),
        };
        let (name, other, response) = match output {
            Output::ThrustN => ("thrust", "rpm", self.thrust),
            Output::Rpm => ("speed", "thrust", self.speed),
        };
        let Some(response) = response else {
            return Err(ImportError::no_such_output(&self.table.file, output.column(), self.listed));
        };
        let has_both = self.thrust.is_some() && self.speed.is_some();
        let note = match stated {
            _ if !has_both => None,
            Some(_) => Some(format!("the response is the {name}, {why}")),
            None => Some(format!("the response is the {name}: {why}. `--response {other}` takes the other one")),
        };
        let columns = [self.thrust, self.speed].into_iter().flatten().chain(self.others.iter().copied());
        let mut needed = Vec::new();
        for (pick, values) in columns {
            if pick.column == response.0.column || pick.is_stated {
                self.check_blanks(pick, values)?;
                needed.push(pick);
            }
        }
        Ok(Decision { output, note, needed })
    }

    /// Refuses a column with more blanks than numbers.
    fn check_blanks(&self, pick: Pick, values: &[f64]) -> Result<(), ImportError> {
        let filled = values.iter().filter(|value| !value.is_nan()).count();
        let first = values.iter().position(|value| value.is_nan());
        let Some(first) = first.filter(|_| 2 * filled <= values.len()) else { return Ok(()) };
        Err(ImportError::cell(
            &self.table.file,
            self.table.line(self.places[first]),
            &self.table.header[pick.column],
            format!("empty, as in {} of {} rows", values.len() - filled, values.len()),
            "a column that is asked for, or that is the response, needs a number in more than half of the rows: choose another \
             with --response or --column, or record it at the rate of the other columns",
        ))
    }
}

/// Which of both is the response where nobody has said it, and why.
fn choose_output(thrust: &[f64], speed: &[f64], is_filtered: bool) -> (Output, String) {
    let rows = thrust.len();
    let filled = |values: &[f64]| values.iter().filter(|value| !value.is_nan()).count();
    let is_idle = speed.iter().all(|value| *value == 0.0 || value.is_nan());
    let (thrust, speed) = (filled(thrust), filled(speed));
    // A probe that was not connected reads zero.
    if is_idle && 2 * thrust > rows {
        (Output::ThrustN, String::from("the speed is zero or blank in every row"))
    } else if thrust == rows && speed == rows && is_filtered {
        (Output::Rpm, String::from("the stand filters its thrust, which lags behind the speed by that"))
    } else if thrust == rows && speed == rows {
        let why = "both are in every row. Where a stand filters its thrust, the speed is the safer basis of a lag";
        (Output::ThrustN, String::from(why))
    } else if thrust > speed {
        (Output::ThrustN, format!("the speed is in {speed} of {rows} rows alone, the thrust in {thrust}"))
    } else {
        (Output::Rpm, format!("the thrust is in {thrust} of {rows} rows alone"))
    }
}
