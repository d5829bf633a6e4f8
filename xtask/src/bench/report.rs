//! The tables, the JSON, and what is held of the figures.

use std::fmt;

use serde_json::{Value, json};

use rotorlead::controller::load::{
    BYTE_CYCLES, BYTE_TAKEN_CYCLES, CAPTURE_CYCLES, EXCITATION_TICK_CYCLES, LINE_CYCLES, TICK_CYCLES,
};
use rotorlead::link::BYTES_PER_S;

use super::application::{Costs, Interrupts};
use super::cycles::{ENTRY, INTERRUPT};
use super::filters::{Filter, INVERSE_KEY, LIMITED_KEY};

/// Frequency of the core with its crystal, and without one and its PLL.
const CORE_HZ: f64 = 168e6;
const SLOW_CORE_HZ: f64 = 16e6;
/// A wait that does not end within this many cycles does not end while the link is busy.
const ENDLESS_CYCLES: u64 = 1_000_000;
/// Longest lock of the inputs, for a request that needs every motor at rest: 50 µs.
const LONGEST_LOCK_CYCLES: u32 = (59e-6 * CORE_HZ) as u32;
/// What says how long the interrupts wait.
const PAGE: &str = include_str!("../../../docs/firmware.md");
/// What the project holds of its own section and tick.
const MOST_INSTRUCTIONS_CALL: u32 = 22;
/// Of a block, with the loop, and a 32nd part of what the function needs to enter and return.
const MOST_INSTRUCTIONS_SAMPLE: f64 = 13.1;
const MOST_BYTES: u32 = 40;
/// A tick of four motors with leads that have no slew limit. Of these some 20 tell a lead with a slew limit from one without, some 10 keep what
/// a flight needs over a reset, and some 10 are the measured rate and the debounce of the inputs: 1 % of a tick at 5 kHz and 168 MHz.
const MOST_INSTRUCTIONS_TICK: u32 = 710;
/// The same with a slew limit in each lead, which limits some outputs: 9 instructions more for each lead, and 17 for each that it limits.
const MOST_INSTRUCTIONS_TICK_SLEW: u32 = 740;
/// Of a filter that has the limits of its output in its state: a call, and a call in which a limit changes the output.
const MOST_INSTRUCTIONS_WITH_LIMITS: [(&str, u32, u32); 2] = [(LIMITED_KEY, 32, 50), (INVERSE_KEY, 60, 80)];
/// A tick of four motors with inverses: 901 were counted, and 924 since each asks for the gain of a correction by speed.
const MOST_INSTRUCTIONS_TICK_INVERSE: u32 = 950;

/// Everything that was measured.
pub struct Report {
    /// This project's section first.
    pub filters: Vec<Filter>,
    /// The application.
    pub interrupts: Interrupts,
}

impl Report {
    /// Share of the core's time that four armed motors take at most, estimated.
    fn cpu_share(&self, tick: &Costs) -> f64 {
        let cycles = f64::from(tick.worst.cycles + INTERRUPT);
        cycles * f64::from(self.interrupts.loop_rate_hz) / CORE_HZ
    }

    /// For how long each interrupt may be kept waiting while motors fly: its name, what it waits for, and cycles at both
    /// clocks, `None` where bytes at the full rate of the line, both ways, leave it no time.
    fn waits(&self) -> [Wait; 3] {
        let Interrupts { tick_4ch, tick_4ch_inverse, excitations, excitation_inverse, .. } = &self.interrupts;
        let Interrupts { capture_4, link_both, requests, .. } = &self.interrupts;
        let cycles = |costs: &Costs| u64::from(costs.worst.cycles + INTERRUPT);
        let [(_, few), (_, many)] = excitations;
        let in_tick = [tick_4ch_inverse, few, many, &excitation_inverse.1, capture_4]
            .into_iter()
            .fold(tick_4ch.locked, |longest, costs| longest.max(costs.locked));
        let (bytes, captures) = (in_tick.bytes.max(requests.bytes), in_tick.captures.max(requests.captures));
        // The control tick does not wait for its own locks.
        let ticks = requests.ticks;
        let wait = |name, of, first: u32, further: u64| {
            let first = u64::from(first) + further;
            Wait {
                name,
                of,
                cycles: [CORE_HZ, SLOW_CORE_HZ].map(|core_hz| with_bytes(first, cycles(link_both), core_hz)),
            }
        };
        let alone = Wait { name: "USART3", of: "the longest lock", cycles: [Some(u64::from(bytes)); 2] };
        [
            alone,
            wait("TIM2", "bytes both ways, a lock of the inputs", captures, 0),
            wait("SysTick", "bytes both ways, captures of four edges, a lock", ticks, cycles(capture_4)),
        ]
    }

    /// The figures by name.
    pub fn json(&self) -> Value {
        let mut all = serde_json::Map::new();
        for filter in &self.filters {
            let mut figures = json!({
                "instructions_call": filter.call.instructions,
                "instructions_inlined": filter.per_motor(),
                "instructions_block32": filter.per_sample(),
                "bytes": filter.bytes(),
                "state_bytes": filter.state_bytes,
                "coefficient_bytes": filter.coefficient_bytes,
                "steady_error": filter.steady_error,
                "estimated_cycles_call": filter.call.cycles,
                "estimated_cycles_block32": filter.cycles_per_sample(),
            });
            if let Some(limited) = filter.limited {
                figures["instructions_limited"] = json!(limited.instructions);
                figures["estimated_cycles_limited"] = json!(limited.cycles);
            }
            all.insert(filter.key.to_owned(), figures);
        }
        let Interrupts { tick_1ch, tick_4ch, tick_arming, capture_1, capture_4, link_byte, link_both, .. } =
            &self.interrupts;
        let Interrupts { excitations, requests, requests_at_rest, loop_rate_hz, .. } = &self.interrupts;
        let Interrupts { tick_4ch_slew, tick_4ch_inverse, tick_arming_inverse, excitation_inverse, .. } =
            &self.interrupts;
        let excitations = excitations.iter().map(|excitation| ("", excitation));
        for (suffix, (lines, costs)) in excitations.chain([("_inverse", excitation_inverse)]) {
            all.insert(
                format!("excitation_{lines}{suffix}"),
                json!({
                    "instructions": costs.worst.instructions,
                    "instructions_mean": costs.mean(),
                    "estimated_cycles": costs.worst.cycles + INTERRUPT,
                }),
            );
        }
        all.insert("estimated_cycles_per_line".to_owned(), json!(self.interrupts.cycles_per_line()));
        let waits: serde_json::Map<_, _> =
            self.waits().iter().map(|wait| (wait.name.to_owned(), json!(wait.cycles))).collect();
        all.insert("estimated_wait_cycles".to_owned(), Value::Object(waits));
        all.insert(
            "estimated_lock_cycles".to_owned(),
            json!({
                "inputs_in_tick": tick_4ch.locked.captures,
                "inputs_in_request": requests.captures,
                "control_in_request": requests.ticks,
                "inputs_in_request_at_rest": requests_at_rest.captures,
                "control_in_request_at_rest": requests_at_rest.ticks,
            }),
        );
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
                "cpu_share": self.cpu_share(tick_4ch),
            }),
        );
        all.insert(
            "tick_slew".to_owned(),
            json!({
                "instructions_4ch": tick_4ch_slew.worst.instructions,
                "instructions_4ch_mean": tick_4ch_slew.mean(),
                "estimated_cycles_4ch": tick_4ch_slew.worst.cycles + INTERRUPT,
                "cpu_share": self.cpu_share(tick_4ch_slew),
            }),
        );
        all.insert(
            "tick_inverse".to_owned(),
            json!({
                "instructions_4ch": tick_4ch_inverse.worst.instructions,
                "instructions_arming": tick_arming_inverse.worst.instructions,
                "instructions_4ch_mean": tick_4ch_inverse.mean(),
                "estimated_cycles_4ch": tick_4ch_inverse.worst.cycles + INTERRUPT,
                "loop_rate_hz": loop_rate_hz,
                "cpu_share": self.cpu_share(tick_4ch_inverse),
            }),
        );
        all.insert(
            "interrupts".to_owned(),
            json!({
                "capture_instructions_1ch": capture_1.worst.instructions,
                "capture_instructions_4ch": capture_4.worst.instructions,
                "link_byte_instructions": link_byte.worst.instructions,
                "link_byte_both_ways_instructions": link_both.worst.instructions,
                "capture_estimated_cycles_4ch": capture_4.worst.cycles + INTERRUPT,
                "link_byte_estimated_cycles": link_byte.worst.cycles + INTERRUPT,
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
        hold(ours.bytes() <= MOST_BYTES, format!("state and coefficients are {} bytes", ours.bytes()));
        hold(ours.steady_error == 0, format!("the steady output is off by {}", ours.steady_error));
        let tick = self.interrupts.tick_4ch.worst.instructions;
        hold(tick < MOST_INSTRUCTIONS_TICK, format!("a tick of four motors takes {tick} instructions"));
        for (key, most_free, most_limited) in MOST_INSTRUCTIONS_WITH_LIMITS {
            let Some(filter) = self.filters.iter().find(|filter| filter.key == key) else { continue };
            let (name, call) = (filter.name, filter.call.instructions);
            hold(call <= most_free, format!("a call of {name} takes {call} instructions"));
            let limited = filter.limited.map_or(0, |limited| limited.instructions);
            let what = format!("a limited call of {name} takes {limited} instructions, and a free one {call}");
            hold((call + 1..=most_limited).contains(&limited), what);
            let what = format!("the steady output of {name} is off by {}", filter.steady_error);
            hold(filter.steady_error == 0, what);
        }
        let Interrupts { tick_1ch, tick_4ch, capture_1, capture_4, link_byte, link_both, excitations, .. } =
            &self.interrupts;
        let Interrupts { tick_4ch_slew, tick_4ch_inverse, excitation_inverse, .. } = &self.interrupts;
        let tick = tick_4ch_slew.worst.instructions;
        let what = format!("a tick of four motors with slew limits takes {tick} instructions");
        hold(tick < MOST_INSTRUCTIONS_TICK_SLEW, what);
        let tick = tick_4ch_inverse.worst.instructions;
        let what = format!("a tick of four motors with inverses takes {tick} instructions");
        hold(tick < MOST_INSTRUCTIONS_TICK_INVERSE, what);
        for (name, costs, limit) in [
            ("tick of one motor", tick_1ch, TICK_CYCLES),
            ("tick of four motors", tick_4ch, TICK_CYCLES),
            ("tick of four motors with slew limits", tick_4ch_slew, TICK_CYCLES),
            ("tick of four motors with inverses", tick_4ch_inverse, TICK_CYCLES),
            ("capture of one edge", capture_1, CAPTURE_CYCLES),
            ("capture of four edges", capture_4, CAPTURE_CYCLES),
            ("byte of the link", link_byte, BYTE_CYCLES),
        ] {
            let cycles = costs.worst.cycles + INTERRUPT;
            hold(cycles <= limit, format!("a {name} takes {cycles} cycles, and {limit} by src/controller/load.rs"));
        }
        let taken = link_byte.byte_taken.max(link_both.byte_taken) + ENTRY;
        let what =
            format!("a byte is taken after {taken} cycles, and after {BYTE_TAKEN_CYCLES} by src/controller/load.rs");
        hold((ENTRY + 1..=BYTE_TAKEN_CYCLES).contains(&taken), what);
        for (lines, costs) in excitations.iter().chain([excitation_inverse]) {
            let (cycles, limit) = (costs.worst.cycles + INTERRUPT, EXCITATION_TICK_CYCLES + lines * LINE_CYCLES);
            let what =
                format!("a tick with {lines} lines takes {cycles} cycles, and {limit} by src/controller/load.rs");
            hold(cycles <= limit, what);
        }
        let locked = self.interrupts.requests_at_rest.captures;
        let what =
            format!("a request locks the inputs for {locked} cycles, and docs/firmware.md says {LONGEST_LOCK_CYCLES}");
        hold(locked <= LONGEST_LOCK_CYCLES, what);
        let line = self.interrupts.cycles_per_line();
        let what = format!("a line takes {line:.1} cycles, and {LINE_CYCLES} by src/controller/load.rs");
        hold(line <= f64::from(LINE_CYCLES), what);
        for wait in self.waits() {
            let what = format!("docs/firmware.md does not say, to 10 % and no less: {}", wait.row());
            hold(wait.is_stated(PAGE), what);
        }
        for peer in peers.iter().filter(|peer| peer.key == "idsp_dither") {
            let no_dearer = call <= peer.call.instructions
                && sample <= peer.per_sample()
                && ours.per_motor() <= peer.per_motor()
                && ours.bytes() <= peer.bytes();
            hold(no_dearer, format!("{} is cheaper", peer.name));
        }
        missed
    }
}

/// How long an interrupt may be kept waiting.
struct Wait {
    name: &'static str,
    of: &'static str,
    /// At the clock with the crystal, and without.
    cycles: [Option<u64>; 2],
}

impl Wait {
    /// Microseconds at both clocks.
    fn times(&self) -> [String; 2] {
        [(self.cycles[0], CORE_HZ), (self.cycles[1], SLOW_CORE_HZ)].map(|(cycles, core_hz)| match cycles {
            Some(cycles) => format!("{:.1} µs", cycles as f64 / core_hz * 1e6),
            None => "no end".to_owned(),
        })
    }

    /// Whether a page has a row for it with times that are no shorter, and not much longer.
    fn is_stated(&self, page: &str) -> bool {
        let begin = format!("| {} | {} | ", self.name, self.of);
        let Some(row) = page.lines().find_map(|line| line.strip_prefix(&begin)) else { return false };
        let stated: Vec<f64> = row.split(' ').filter_map(|word| word.parse().ok()).collect();
        let found = [(self.cycles[0], CORE_HZ), (self.cycles[1], SLOW_CORE_HZ)];
        stated.len() == found.len()
            && found.into_iter().zip(stated).all(|((cycles, core_hz), stated)| {
                cycles.is_some_and(|cycles| {
                    let us = cycles as f64 / core_hz * 1e6;
                    us <= stated && stated <= 1.1 * us
                })
            })
    }

    /// As a row of the table in `docs/firmware.md`.
    fn row(&self) -> String {
        let [fast, slow] = self.times();
        format!("| {} | {} | {fast} | {slow} |", self.name, self.of)
    }
}

/// A wait for so many cycles, during which bytes come and go at the rate of the line, each pair in an interrupt of so many
/// cycles, one of which was about to come.
fn with_bytes(first: u64, byte: u64, core_hz: f64) -> Option<u64> {
    let cycles_per_byte = (core_hz / f64::from(BYTES_PER_S)) as u64;
    let mut wait = first + byte;
    loop {
        let longer = first + (wait / cycles_per_byte + 1) * byte;
        if longer == wait {
            return Some(wait);
        }
        wait = longer;
        if wait > ENDLESS_CYCLES {
            return None;
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Instructions on a Cortex-M4F, counted in QEMU; cycles are estimated from the instructions\n")?;
        writeln!(
            f,
            "{:<20} {:>6} {:>8} {:>8} {:>10} {:>6} {:>6} {:>13} {:>12} {:>12}",
            "filter, per sample",
            "call",
            "limited",
            "inlined",
            "block 32",
            "state",
            "coeff.",
            "steady error",
            "call, est.",
            "block, est."
        )?;
        for filter in &self.filters {
            writeln!(
                f,
                "{:<20} {:>6} {:>8} {:>8.2} {:>10.2} {:>6} {:>6} {:>13} {:>12} {:>12.1}",
                filter.name,
                filter.call.instructions,
                filter.limited.map_or_else(|| "same".to_owned(), |limited| limited.instructions.to_string()),
                filter.per_motor(),
                filter.per_sample(),
                filter.state_bytes,
                filter.coefficient_bytes,
                filter.steady_error,
                filter.call.cycles,
                filter.cycles_per_sample(),
            )?;
        }
        let Interrupts { tick_1ch, tick_4ch, tick_arming, capture_1, capture_4, link_byte, link_both, .. } =
            &self.interrupts;
        let Interrupts { excitations, requests, requests_at_rest, loop_rate_hz, .. } = &self.interrupts;
        let Interrupts { tick_4ch_slew, tick_4ch_inverse, tick_arming_inverse, excitation_inverse, .. } =
            &self.interrupts;
        writeln!(f, "\n{:<46} {:>6} {:>6} {:>12}", "interrupt of the application", "mean", "worst", "cycles, est.")?;
        let mut row = |name: &str, costs: &Costs| {
            let worst = costs.worst;
            let cycles = worst.cycles + INTERRUPT;
            writeln!(f, "{name:<46} {:>6.0} {:>6} {cycles:>12}", costs.mean(), worst.instructions)
        };
        row("control tick, one motor armed", tick_1ch)?;
        row("control tick, four motors armed", tick_4ch)?;
        row("control tick, four motors armed, slew limit", tick_4ch_slew)?;
        row("control tick that arms all four", tick_arming)?;
        row("control tick, four motors armed, inverse", tick_4ch_inverse)?;
        row("control tick that arms all four, inverse", tick_arming_inverse)?;
        for (lines, costs) in excitations {
            row(&format!("control tick, an excitation of which it sums {lines} lines, recorded"), costs)?;
        }
        let (lines, costs) = excitation_inverse;
        row(&format!("the same with the inverse, {lines} lines"), costs)?;
        row("capture of an edge of one input", capture_1)?;
        row("capture of edges of four inputs at once", capture_4)?;
        row("byte of the link, one way", link_byte)?;
        row("bytes of the link both ways, and one lost", link_both)?;
        writeln!(
            f,
            "\nThe worst tick of four motors at {loop_rate_hz} Hz takes {:.1} % of a core at 168 MHz, estimated, and {:.1} % \
             with the inverse. A line of an excitation takes {:.1} cycles, estimated.",
            100.0 * self.cpu_share(tick_4ch),
            100.0 * self.cpu_share(tick_4ch_inverse),
            self.interrupts.cycles_per_line()
        )?;

        writeln!(f, "\n{:<70} {:>10} {:>10}", "longest lock, cycles, est.", "of inputs", "of control")?;
        let mut row = |name: &str, inputs: u32, control: u32| writeln!(f, "{name:<70} {inputs:>10} {control:>10}");
        row("in a control tick", tick_4ch.locked.captures, 0)?;
        row("for a request in flight", requests.captures, requests.ticks)?;
        let of_rest = "for a request that needs every motor at rest";
        row(of_rest, requests_at_rest.captures, requests_at_rest.ticks)?;

        let head = "longest wait of an interrupt in flight, with the line full, est.";
        writeln!(f, "\n{head:<70} {:>10} {:>10}", "168 MHz", "16 MHz")?;
        for wait in self.waits() {
            let [fast, slow] = wait.times();
            writeln!(f, "{:<70} {fast:>10} {slow:>10}", format!("{}: {}", wait.name, wait.of))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Wait, with_bytes};

    #[test]
    fn a_page_states_a_wait_with_times_that_are_not_shorter_and_not_much_longer() {
        let wait = Wait { name: "TIM2", of: "a lock", cycles: [Some(168), Some(1600)] };
        for (row, is_stated) in [
            ("| TIM2 | a lock | 1.0 µs | 100 µs |", true),
            ("| TIM2 | a lock | 1.1 µs | 109 µs |", true),
            ("| TIM2 | a lock | 0.9 µs | 100 µs |", false),
            ("| TIM2 | a lock | 1.0 µs | 111 µs |", false),
            ("| TIM2 | a lock | 1.0 µs |", false),
            ("| TIM3 | a lock | 1.0 µs | 100 µs |", false),
        ] {
            assert_eq!(wait.is_stated(&format!("| a | b |\n{row}\n")), is_stated, "{row}");
        }
    }

    #[test]
    fn a_wait_is_as_long_as_the_bytes_that_come_in_it_make_it() {
        // 1680 cycles between bytes: the first and the second.
        assert_eq!(with_bytes(500, 100, 168e6), Some(600));
        assert_eq!(with_bytes(1600, 100, 168e6), Some(1800));
        // 160 cycles between bytes, each of which takes more.
        assert_eq!(with_bytes(500, 170, 16e6), None);
    }
}
