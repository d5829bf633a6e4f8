//! What the command line would say, as an exception, in Python's words.

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};
use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, create_exception};
use rotorlead_records::files::{Fault, FileError, PrintableReport, printable, printable_line};

create_exception!(
    rotorlead,
    Error,
    PyValueError,
    "What was given cannot be used. The message says what is wrong, where, and what to do about it."
);

/// Options of the command line, and the parameters that are the same. An option that is not here is the command line's alone.
const PARAMETERS: [(&str, &str); 34] = [
    ("amplitude", "amplitude"),
    ("at", "at"),
    ("column", "columns"),
    ("compensate-range", "compensate_range"),
    ("compensator", "compensator"),
    ("damping", "damping"),
    ("delay", "delay"),
    ("esc-frame", "esc_frame_hz"),
    ("excitation", "excitation"),
    ("kind", "kind"),
    ("log", "log"),
    ("loop-rate", "loop_rate_hz"),
    ("model", "model"),
    ("motor", "motor"),
    ("motor-poles", "motor_poles"),
    ("motors", "motors"),
    ("natural", "natural_rad_s"),
    ("no-diagnosis", "diagnosis"),
    ("nominal", "nominal"),
    ("omega-g", "omega_g_rad_s"),
    ("out", "out"),
    ("output-range", "output_range"),
    ("period", "period_s"),
    ("prewarp", "prewarp_rad_s"),
    ("pulse-us", "pulse_us"),
    ("purpose", "purpose"),
    ("rate", "rate_hz"),
    ("records", "records"),
    ("response", "response"),
    ("seconds", "seconds"),
    ("setting", "setting"),
    ("slew", "slew_per_s"),
    ("step-rate", "step_rate_hz"),
    ("tare", "tare"),
];

/// The exception of a report, with the words that the command line prints.
pub fn raised(report: &miette::Report) -> PyErr {
    Error::new_err(in_python(&words(report.as_ref())))
}

/// The exception of a value that breaks a rule.
pub fn refused(fault: &Fault) -> PyErr {
    Error::new_err(in_python(&format!("{}\n  help: {}", printable_line(&fault.to_string()), printable(&fault.help))))
}

/// The exception of a dict that `name` is. Its text in a file is none of the user's.
pub fn refused_dict(name: &str, error: &FileError) -> PyErr {
    let message = error.to_string();
    let (place, rule) = subscripts(&message);
    // Records are a list of their own, and not under a key.
    let place = place.replacen("['record']", "", usize::from(name == "records"));
    let place = if place.is_empty() { String::new() } else { format!("{name}{place}: ") };
    let quoted = |words: &str| words.replace('`', "'");
    let (message, help) = if let Some(key) = rule.strip_prefix("missing field ") {
        (format!("the key {} is missing", quoted(key)), format!("add {} to this dict", quoted(key)))
    } else {
        let help = error.help().map(|help| help.to_string()).unwrap_or_default();
        (quoted(&rule.replacen("unknown field", "unknown key", 1)), quoted(&help))
    };
    let help = if help.is_empty() { help } else { format!("\n  help: {help}") };
    Error::new_err(in_python(&printable(&format!("{place}{message}{help}"))))
}

/// The way to a value at the start of a message, as Python goes it, and what is said of the value: `` `point` 2, `gain`: `` is
/// `['point'][1]['gain']`.
fn subscripts(message: &str) -> (String, &str) {
    let Some((way, rule)) = message.split_once(": ").filter(|(way, _)| way.starts_with('`')) else {
        return (String::new(), message);
    };
    let mut place = String::new();
    for step in way.split(", ") {
        let Some((key, item)) = step.strip_prefix('`').and_then(|step| step.split_once('`')) else {
            return (String::new(), message);
        };
        place.push_str(&format!("['{key}']"));
        match item.trim().parse::<usize>() {
            Ok(item) => place.push_str(&format!("[{}]", item.saturating_sub(1))),
            Err(_) if item.is_empty() => {}
            Err(_) => return (String::new(), message),
        }
    }
    (place, rule)
}

/// Lines as long as they are: what reads them may search them.
fn words(diagnostic: &dyn Diagnostic) -> String {
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor()).with_wrap_lines(false);
    let mut text = String::new();
    handler.render_report(&mut text, &PrintableReport::from_report(diagnostic)).expect("a string takes all");
    text.trim_start_matches([' ', '×']).trim_end().to_owned()
}

/// Options of the command line as the parameters that they are: `--motor-poles` is `motor_poles=`, and one between backticks with
/// a value has it.
fn in_python(text: &str) -> String {
    let mut said = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("--") {
        let (before, option) = rest.split_at(at);
        said.push_str(before);
        let length = option[2..].find(|letter: char| !(letter.is_ascii_lowercase() || letter == '-'));
        let (name, after) = option[2..].split_at(length.unwrap_or(option.len() - 2));
        let is_option = before.is_empty() || before.ends_with([' ', '`', '(', '\n']);
        let parameter = PARAMETERS.iter().find(|(known, _)| is_option && *known == name);
        let Some((_, parameter)) = parameter else {
            said.push_str(&option[..2 + name.len()]);
            rest = after;
            continue;
        };
        said.push_str(&format!("{parameter}="));
        rest = after;
        if before.ends_with('`')
            && let Some((value, after)) = after.split_once('`').filter(|(value, _)| value.starts_with(' '))
        {
            said.push_str(&literal(parameter, value[1..].trim_matches('\'')));
            said.push('`');
            rest = after;
        }
    }
    said + rest
}

/// A value of the command line as Python writes it.
fn literal(parameter: &str, value: &str) -> String {
    match (parameter, value.split_once('='), value.split_once("..")) {
        ("columns", Some((quantity, column)), _) => format!("{{\"{quantity}\": \"{column}\"}}"),
        (_, _, Some((low, high))) => format!("({low}, {high})"),
        _ if value.parse::<f64>().is_ok() || value.chars().all(|letter| letter.is_ascii_uppercase()) => {
            value.to_owned()
        }
        _ => format!("\"{value}\""),
    }
}
