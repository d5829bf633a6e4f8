//! What a table does not say, asked for all at once.

use super::layout::PlainTable;
use super::units;
use crate::files::csv_rows::quoted;
use crate::import::missing::{EXCITATIONS, MissingOption};
use crate::import::quantity::{Quantity, Unit};
use crate::import::{ImportError, ImportOptions};

/// What the names do not say, and the column that would be stated.
pub(super) struct Question {
    quantity: Quantity,
    asks: String,
    /// `HEADER` where no column is known.
    header: String,
    /// Whether no name says which column it is.
    is_unknown: bool,
    /// The option that answers it.
    missing: MissingOption,
}

impl Question {
    pub(super) fn new(quantity: Quantity, header: &str, asks: String) -> Self {
        let missing = MissingOption::column(quantity, header, "UNIT");
        Self { quantity, asks, header: header.to_owned(), is_unknown: false, missing }
    }

    /// A quantity that no column is known to be.
    pub(super) fn nothing(plain: &PlainTable<'_>, quantity: Quantity) -> Self {
        let asks = match quantity {
            Quantity::Thrust | Quantity::Speed => String::from("no column is known to be the thrust, and none the rpm"),
            other => format!("no column is known to be the {}", other.name()),
        };
        let increasing = units::increasing(plain).filter(|_| quantity == Quantity::Time);
        let question = match increasing.map(|column| &plain.table.header[column]) {
            Some(header) => {
                Self::new(quantity, header, format!("{asks}; `{}` increases from row to row", quoted(header)))
            }
            None => Self::new(quantity, "HEADER", asks),
        };
        let is_without = quantity == Quantity::Time && increasing.is_none();
        let missing = if is_without { MissingOption::rate() } else { question.missing };
        Self { is_unknown: true, missing, ..question }
    }

    /// The same with the unit that its numbers fit, to be confirmed.
    pub(super) fn with_unit(self, unit: Unit) -> Self {
        let asks = format!("{}, whose numbers fit {}", self.asks, unit.name);
        Self { missing: MissingOption::column(self.quantity, &self.header, unit.name), asks, ..self }
    }

    /// How many poles the motor has whose electrical speed is in a column.
    pub(super) fn poles(header: &str) -> Self {
        let asks = format!("`{}` is electrical, and turns once for each pair of poles", quoted(header));
        Self { missing: MissingOption::motor_poles(), ..Self::new(Quantity::Speed, header, asks) }
    }

    /// What the answer may be.
    fn answers(&self) -> String {
        match self.missing.name {
            "--column" => format!("{} in {}", self.quantity.name(), self.quantity.units()),
            "--rate" => String::from("--rate: the rows of a second, where they are evenly spaced"),
            name => format!("{name}: the magnets of the motor, as 14"),
        }
    }

    /// What else may be meant where a log has no such column.
    fn otherwise(&self, plain: &PlainTable<'_>) -> Option<String> {
        let said = match self.quantity {
            _ if !self.is_unknown => return None,
            Quantity::Time if self.header == "HEADER" => {
                "Where each row is a steady point, `--excitation steady` needs no time; a time that has another name is `--column \
                 time=HEADER:UNIT`"
            }
            Quantity::Time => {
                "Where that is no time, `--rate HZ` says how many rows there are a second; where each is a steady point, `--excitation \
                 steady` needs no time"
            }
            Quantity::Thrust => {
                let elsewhere =
                    plain.dialect.speed_elsewhere.map(|elsewhere| format!(". {elsewhere}")).unwrap_or_default();
                let (option, units) = (option(Quantity::Speed, "HEADER", "UNIT"), Quantity::Speed.units());
                return Some(format!(". The speed of the rotor does as well: `{option}`, in {units}{elsewhere}"));
            }
            Quantity::Command => {
                "Where the command was logged apart, `rotorlead import --no-command` takes the log without it, and `rotorlead identify \
                 --align LOG` merges the two"
            }
            _ => return None,
        };
        Some(format!(". {said}"))
    }
}

/// `--column` as it is typed in a shell.
pub(super) fn option(quantity: Quantity, header: &str, unit: &str) -> String {
    MissingOption::column(quantity, header, unit).to_string()
}
/// The error that asks all questions at once, and what drove the command with them where nothing says it.
pub(super) fn ask(plain: &PlainTable<'_>, questions: &[Question], options: &ImportOptions) -> ImportError {
    let place = plain.header_line.map(|line| format!(", line {line}")).unwrap_or_default();
    let mut asks: Vec<&str> = questions.iter().map(|question| question.asks.as_str()).collect();
    let mut values: Vec<String> = questions.iter().map(Question::answers).collect();
    let mut missing: Vec<MissingOption> = questions.iter().map(|question| question.missing.clone()).collect();
    let is_driven = !options.without_command && plain.dialect.usual.is_none();
    if is_driven && options.excitation.is_none() {
        asks.push("nothing says what drove the command");
        values.push(format!("--excitation: {EXCITATIONS}"));
        missing.push(MissingOption::excitation());
    }
    ImportError::Unstated {
        file: plain.table.file.clone(),
        problem: format!("{place}: {}", asks.join("; ")),
        remedy: format!(
            "the columns are {}. Say {} with `{}` ({}){}",
            listed(plain),
            if missing.iter().any(|option| option.name == "--column") {
                "which is what, and in which unit,"
            } else {
                "it"
            },
            missing.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
            values.join("; "),
            questions.iter().filter_map(|question| question.otherwise(plain)).collect::<String>()
        ),
        missing,
    }
}

/// The columns' names, for messages.
pub(super) fn listed(plain: &PlainTable<'_>) -> String {
    let names = plain.table.header.iter().enumerate().filter(|(_, name)| !name.is_empty());
    let shown = |(column, name): (usize, &String)| match plain.label(column) {
        Some(label) if !name.ends_with(label) => format!("`{}` (`{}`)", quoted(name), quoted(label)),
        _ => format!("`{}`", quoted(name)),
    };
    let mut columns = names.map(shown).take(MOST_LISTED).collect::<Vec<_>>().join(", ");
    if columns.is_empty() {
        columns.push_str("none");
    }
    let beside = plain.beside.iter().map(|beside| format!("`{}` ({})", quoted(&beside.name), beside.shown));
    let beside = beside.take(MOST_LISTED).collect::<Vec<_>>().join(", ");
    let more = if beside.is_empty() { "" } else { "; no columns are " };
    format!("{columns}{more}{beside}")
}

/// So many columns are listed: a log with more has them in no message.
const MOST_LISTED: usize = 60;
