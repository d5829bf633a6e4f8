//! What a stack's file says.

use std::fmt::Write as _;

use super::super::Parameter;
use super::syntax::Syntax;
use super::{Replay, StackParameters};

/// The parameters in the stack's syntax, below comments in its syntax.
pub(super) fn parameters_text(found: &StackParameters, syntax: &Syntax, motors: u8) -> String {
    let known: Vec<_> = found.parameters.iter().map(|parameter| (about(parameter), parameter)).collect();
    let known = if known.is_empty() { None } else { Some(syntax.parameters(&known, motors)) };
    let unknown = found
        .refused
        .iter()
        .map(|refusal| syntax.comment(&[format!("{} is not known: {}", refusal.full_name(), refusal.why)]));
    known.into_iter().chain(unknown).collect::<Vec<_>>().join("\n")
}

/// How a simulator explains the records.
pub(super) fn about_replay(replay: &Replay, held_out: bool) -> Vec<String> {
    let ms = |seconds: f64| format!("{} ms", digits(1e3 * seconds));
    let step = ms(replay.step_s);
    let [up, down] = replay.effective_time_constant_s;
    let effective = match (replay.stepping.has_lag(), up, down) {
        (false, ..) => String::from("without a lag"),
        (true, Some(up), Some(down)) if up == down => format!("whose time constant is in truth {}", ms(up)),
        (true, Some(up), Some(down)) => {
            format!("whose time constants are in truth {} up and {} down", ms(up), ms(down))
        }
        (true, ..) => String::from("which overshoot: choose shorter ones"),
    };
    let kind = if held_out { "the held-out records" } else { "the records" };
    let mut lines = vec![match replay.records.is_empty() {
        true => format!(
            "{}, with steps of {step}, diverges: choose steps shorter than the time constants",
            replay.stepping.name
        ),
        false => format!("replay of {kind} through {}, with steps of {step} {effective}:", replay.stepping.name),
    }];
    lines.extend(replay.records.iter().map(|record| {
        format!("{}: {:.1} % fit, the model {:.1} %", record.file, record.fit_percent, record.model_fit_percent)
    }));
    if !replay.not_held.is_empty() {
        lines.push(format!("what the simulator does not hold: {}", replay.not_held.join("; ")));
    }
    lines
}

/// The comment above a parameter.
fn about(parameter: &Parameter) -> Vec<String> {
    let unit = if parameter.definition.unit == "1" { String::new() } else { format!(" {}", parameter.definition.unit) };
    let mut of = format!("{} = {}{unit}", parameter.definition.full_name(), digits(parameter.value));
    match (parameter.low, parameter.high) {
        (Some(low), Some(high)) => write!(of, ", 95 % interval {} to {}", digits(low), digits(high)),
        _ => write!(of, ", whose interval is not in the model"),
    }
    .expect("a string takes all");
    if let Some(at) = parameter.at {
        write!(of, ", at a command of {}", command(at)).expect("a string takes all");
    }
    let (low, high) = parameter.measured;
    if low < high {
        write!(of, "; measured at commands from {} to {}", command(low), command(high)).expect("a string takes all");
    }
    if let Some(worst) = parameter.worst_error_percent {
        write!(of, ", where the law errs by at most {worst:.1} % of full thrust").expect("a string takes all");
    }
    let mut lines = vec![of, parameter.definition.definition.to_owned()];
    lines.extend(parameter.notes.iter().cloned());
    lines.push(format!("source: {}", parameter.definition.source));
    lines
}

/// Magnitude below which a number is what rounding leaves of zero.
const ROUNDING: f64 = 1e-12;

/// Four significant digits, or all of a whole number.
pub(super) fn digits(value: f64) -> String {
    let value = if value.abs() < ROUNDING { 0.0 } else { value };
    if value == value.trunc() && value.abs() < 1e9 {
        return format!("{value}");
    }
    let decimals = 3 - value.abs().log10().floor() as i32;
    if decimals > 6 { format!("{value:.3e}") } else { format!("{value:.*}", decimals.max(0) as usize) }
}

/// A command to a thousandth.
fn command(value: f64) -> String {
    format!("{}", (1e3 * value).round() / 1e3)
}
