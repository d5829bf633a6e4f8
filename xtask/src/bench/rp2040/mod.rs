//! Cycles of the RP2040's handlers, as rp2040js counts them.

mod cases;
mod flash;
mod report;

use emulator::rp2040::{CYCLES_PER_S, Emulator, Handler, Trace};
use rotorlead::settings::MOTORS;
use rotorlead_rp2040::generated::OUTPUT_1;

use self::cases::Case;
pub use self::report::Report;
use self::report::{Cost, Row};
use crate::board::Board;
use crate::firmware;
use crate::run::Result;

/// Numbers of the exceptions: the control task, and the link's bytes (RP2040 datasheet, 2.3.2: IRQ 20).
const SYSTICK: u32 = 15;
const UART0: u32 = 16 + 20;

/// Runs the image in every case.
pub fn measure(board: &'static Board) -> Result<Report> {
    let image = firmware::build_image(board, &[])?;
    let mut rows = Vec::new();
    for case in Case::all()? {
        let trace = Emulator::Node.run(&case.run(&image)?)?;
        check(&case, &trace).map_err(|error| format!("{}: {error}", case.name))?;
        rows.push(row(&case, &trace)?);
    }
    Ok(Report { rows })
}

/// An error where the core went wrong, the controller started too late, or a motor does not turn.
fn check(case: &Case, trace: &Trace) -> Result {
    if let Some(fault) = trace.faults.first() {
        return Err(format!("{} at {:#x}, cycle {}", fault.what, fault.pc, fault.cycle));
    }
    if let Some(reset) = trace.resets.first() {
        return Err(format!("a reset at cycle {}", reset.cycle));
    }
    if trace.handler(SYSTICK).is_none_or(|tick| tick.first_cycle >= case.armed) {
        let ms = case.armed * 1000 / CYCLES_PER_S;
        return Err(format!(
            "no control tick within {ms} ms of the reset, when the motors are armed: too late to measure"
        ));
    }
    // A line that is high at rest does not show it.
    if case.esc {
        return Ok(());
    }
    // A fifth longer than a stop is no rounding.
    match (OUTPUT_1..).take(MOTORS).find(|&pin| longest_high(case, trace, pin) <= case.longest_stop() * 6 / 5) {
        Some(pin) => Err(format!("the motor at GP{pin} does not turn")),
        None => Ok(()),
    }
}

/// The longest time that a pin is high while calls are counted.
fn longest_high(case: &Case, trace: &Trace, pin: u8) -> u64 {
    let mut rise = None;
    let mut longest = 0;
    for edge in trace.edges_on(pin).filter(|edge| edge.cycle >= case.from()) {
        if edge.is_high {
            rise = Some(edge.cycle);
        } else if let Some(rise) = rise.take() {
            longest = longest.max(edge.cycle - rise);
        }
    }
    longest
}

fn row(case: &Case, trace: &Trace) -> Result<Row> {
    let handler = |exception, name: &str| trace.handler(exception).ok_or_else(|| format!("{}: no {name}", case.name));
    let (tick, link) = (handler(SYSTICK, "control task")?, handler(UART0, "interrupt of the link")?);
    Ok(Row {
        key: case.key,
        name: case.name,
        start_cycles: tick.first_cycle,
        latest_start_s: case.latest_start_s,
        tick_cycles: CYCLES_PER_S / u64::from(case.settings.loop_rate_hz),
        counted_cycles: trace.cycles - case.from(),
        tick: tick.into(),
        link: link.into(),
        all_cycles: trace.handlers.iter().map(|handler| handler.total_cycles).sum(),
    })
}

impl From<&Handler> for Cost {
    fn from(handler: &Handler) -> Self {
        Self { calls: handler.calls, total: handler.total_cycles, most: handler.most_cycles }
    }
}

#[cfg(test)]
mod tests {
    use emulator::rp2040::Edge;

    use super::*;

    fn trace(case: &Case, edges: Vec<Edge>) -> Trace {
        let handler =
            |exception, calls| Handler { exception, first_cycle: 125, calls, total_cycles: 40, most_cycles: 9 };
        Trace {
            cycles: case.from() + 1000,
            edges,
            conflicts: Vec::new(),
            uart: Vec::new(),
            resets: Vec::new(),
            faults: Vec::new(),
            handlers: vec![handler(SYSTICK, 5), handler(UART0, 8), handler(3, 1)],
            memory: Vec::new(),
            flash_operations: 0,
            power_is_cut: false,
            unmodelled: Vec::new(),
            usb: Vec::new(),
            usb_set_ups: Vec::new(),
            boot_loader: None,
        }
    }

    /// A high time at each output.
    fn highs(case: &Case, length: u64) -> Vec<Edge> {
        let pins = (OUTPUT_1..).take(MOTORS);
        pins.flat_map(|pin| {
            [(1, true), (1 + length, false)].map(|(at, is_high)| Edge { cycle: case.from() + at, pin, is_high })
        })
        .collect()
    }

    #[test]
    fn a_motor_that_does_not_turn_is_named() {
        let [case, ..] = Case::all().unwrap();
        let mut edges = highs(&case, 2 * case.longest_stop());
        assert_eq!(check(&case, &trace(&case, edges.clone())), Ok(()));
        // The last fall comes with a stop's pulse.
        edges.last_mut().unwrap().cycle -= case.longest_stop();
        assert_eq!(check(&case, &trace(&case, edges)), Err("the motor at GP9 does not turn".to_owned()));
    }

    #[test]
    fn a_controller_that_starts_after_the_motors_are_armed_is_not_measured() {
        let [case, ..] = Case::all().unwrap();
        let mut trace = trace(&case, highs(&case, 2 * case.longest_stop()));
        trace.handlers[0].first_cycle = case.armed;
        let expected = "no control tick within 330 ms of the reset, when the motors are armed: too late to measure";
        assert_eq!(check(&case, &trace), Err(expected.to_owned()));
    }

    #[test]
    fn a_row_has_the_handlers_of_its_trace() {
        let [case, ..] = Case::all().unwrap();
        let row = row(&case, &trace(&case, Vec::new())).unwrap();
        assert_eq!((row.start_cycles, row.tick_cycles, row.counted_cycles, row.all_cycles), (125, 25_000, 1000, 120));
        assert_eq!((row.tick.calls, row.link.calls), (5, 8));
    }
}
