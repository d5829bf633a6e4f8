//! The tables, the JSON, and what is held of the figures.

use std::fmt;

use serde_json::{Value, json};

use super::application::{Costs, Interrupts};
use super::cycles::INTERRUPT;
use super::filters::Filter;

/// Frequency of the core with its crystal.
const CORE_HZ: f64 = 168e6;
/// What the project holds of its own section and tick.
const MOST_INSTRUCTIONS_CALL: u32 = 22;
/// Of a block, with the loop, and a 32nd part of what the function needs to enter and return.
const MOST_INSTRUCTIONS_SAMPLE: f64 = 13.1;
const MOST_BYTES: u32 = 40;
const MOST_INSTRUCTIONS_TICK: u32 = 600;

/// Everything that was measured.
pub struct Report {
    /// This project's section first.
    pub filters: Vec<Filter>,
    /// The application.
    pub interrupts: Interrupts,
}

impl Report {
    /// Share of the core's time that four armed motors take at most, estimated.
    fn cpu_share(&self) -> f64 {
        let cycles = f64::from(self.interrupts.tick_4ch.worst.cycles + INTERRUPT);
        cycles * f64::from(self.interrupts.loop_rate_hz) / CORE_HZ
    }

    /// The figures by name.
    pub fn json(&self) -> Value {
        let mut all = serde_json::Map::new();
        for filter in &self.filters {
            let figures = json!({
                "instructions_call": filter.call.instructions,
                "instructions_inlined": filter.per_motor(),
                "instructions_block32": filter.per_sample(),
                "bytes": filter.bytes,
                "steady_error": filter.steady_error,
                "estimated_cycles_call": filter.call.cycles,
                "estimated_cycles_block32": filter.cycles_per_sample(),
            });
            all.insert(filter.key.to_owned(), figures);
        }
        let Interrupts { tick_1ch, tick_4ch, tick_arming, capture_1, capture_4, link_byte, loop_rate_hz } =
            &self.interrupts;
        all.insert(
            "tick".to_owned(),
            json!({
                "instructions_1ch": tick_1ch.worst.instructions,
                "instructions_4ch": tick_4ch.worst.instructions,
                "instructions_arming": tick_arming.worst.instructions,
                "instructions_1ch_mean": tick_1ch.mean(),
                "instructions_4ch_mean": tick_4ch.mean(),
                "estimated_cycles_4ch": tick_4ch.worst.cycles + INTERRUPT,
                "loop_rate_hz": loop_rate_hz,
                "cpu_share": self.cpu_share(),
            }),
        );
        all.insert(
            "interrupts".to_owned(),
            json!({
                "capture_instructions_1ch": capture_1.worst.instructions,
                "capture_instructions_4ch": capture_4.worst.instructions,
                "link_byte_instructions": link_byte.worst.instructions,
            }),
        );
        Value::Object(all)
    }

    /// What does not hold, in words.
    pub fn missed(&self) -> Vec<String> {
        let mut missed = Vec::new();
        let mut hold = |holds: bool, what: String| {
            if !holds {
                missed.push(what);
            }
        };
        let [ours, peers @ ..] = self.filters.as_slice() else { return vec!["there are no filters".to_owned()] };
        let (call, sample) = (ours.call.instructions, ours.per_sample());
        hold(call <= MOST_INSTRUCTIONS_CALL, format!("a call takes {call} instructions"));
        hold(sample <= MOST_INSTRUCTIONS_SAMPLE, format!("a sample of a block takes {sample} instructions"));
        hold(ours.bytes <= MOST_BYTES, format!("state and coefficients are {} bytes", ours.bytes));
        hold(ours.steady_error == 0, format!("the steady output is off by {}", ours.steady_error));
        let tick = self.interrupts.tick_4ch.worst.instructions;
        hold(tick < MOST_INSTRUCTIONS_TICK, format!("a tick of four motors takes {tick} instructions"));
        for peer in peers.iter().filter(|peer| peer.key == "idsp_dither") {
            let no_dearer = call <= peer.call.instructions
                && sample <= peer.per_sample()
                && ours.per_motor() <= peer.per_motor()
                && ours.bytes <= peer.bytes;
            hold(no_dearer, format!("{} is cheaper", peer.name));
        }
        missed
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Instructions on a Cortex-M4F, counted in QEMU; cycles are estimated from the instructions\n")?;
        writeln!(
            f,
            "{:<20} {:>6} {:>8} {:>10} {:>6} {:>13} {:>12} {:>12}",
            "filter, per sample", "call", "inlined", "block 32", "bytes", "steady error", "call, est.", "block, est."
        )?;
        for filter in &self.filters {
            writeln!(
                f,
                "{:<20} {:>6} {:>8.2} {:>10.2} {:>6} {:>13} {:>12} {:>12.1}",
                filter.name,
                filter.call.instructions,
                filter.per_motor(),
                filter.per_sample(),
                filter.bytes,
                filter.steady_error,
                filter.call.cycles,
                filter.cycles_per_sample(),
            )?;
        }
        let Interrupts { tick_1ch, tick_4ch, tick_arming, capture_1, capture_4, link_byte, loop_rate_hz } =
            &self.interrupts;
        writeln!(f, "\n{:<38} {:>6} {:>6} {:>12}", "interrupt of the application", "mean", "worst", "cycles, est.")?;
        let mut row = |name: &str, costs: &Costs| {
            let worst = costs.worst;
            let cycles = worst.cycles + INTERRUPT;
            writeln!(f, "{name:<38} {:>6.0} {:>6} {cycles:>12}", costs.mean(), worst.instructions)
        };
        row("control tick, one motor armed", tick_1ch)?;
        row("control tick, four motors armed", tick_4ch)?;
        row("control tick that arms all four", tick_arming)?;
        row("capture of an edge of one input", capture_1)?;
        row("capture of edges of four inputs at once", capture_4)?;
        row("byte of the link", link_byte)?;
        writeln!(
            f,
            "\nThe worst tick of four motors at {loop_rate_hz} Hz takes {:.1} % of a core at 168 MHz, estimated.",
            100.0 * self.cpu_share()
        )
    }
}
