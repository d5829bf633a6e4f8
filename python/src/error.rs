//! What the command line would say, as an exception.

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};
use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, create_exception};
use rotorlead_records::files::{Fault, PrintableReport, printable, printable_line};

create_exception!(
    rotorlead,
    Error,
    PyValueError,
    "What was given cannot be used. The message is the command line's: what is wrong, where, and what to do about it."
);

/// The exception of a report, with the words that the command line prints.
pub fn raised(report: &miette::Report) -> PyErr {
    Error::new_err(words(report.as_ref()))
}

/// The exception of a value that breaks a rule.
pub fn refused(fault: &Fault) -> PyErr {
    Error::new_err(format!("{}\n  help: {}", printable_line(&fault.to_string()), printable(&fault.help)))
}

/// Lines as long as they are: what reads them may search them.
fn words(diagnostic: &dyn Diagnostic) -> String {
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor()).with_wrap_lines(false);
    let mut text = String::new();
    handler.render_report(&mut text, &PrintableReport::from_report(diagnostic)).expect("a string takes all");
    text.trim_start_matches([' ', '×']).trim_end().to_owned()
}
