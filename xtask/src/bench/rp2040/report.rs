//! The table, the JSON, and what is held of the figures.

use std::fmt;

use emulator::rp2040::CYCLES_PER_S;
use serde_json::{Value, json};

/// What the project holds: four motors take less than this share of the core, in the longest tick, too.
const MOST_SHARE: f64 = 0.40;
/// The page with these figures.
const PAGE: &str = include_str!("../../../../docs/board-rp2040.md");
/// How far its figures may be off.
const PAGE_TOLERANCE: f64 = 0.05;
/// A tick at either end of the count may be in it or not.
const TICKS_AT_ENDS: u64 = 1;

/// What a handler takes.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    pub calls: u64,
    /// Cycles of all calls together, and of the longest.
    pub total: u64,
    pub most: u64,
}

impl Cost {
    /// Cycles of a call.
    fn mean(&self) -> f64 {
        self.total as f64 / self.calls.max(1) as f64
    }
}

/// A case as it was measured.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub key: &'static str,
    pub name: &'static str,
    /// From the start of the core to the first control tick, with the design of the filters before it; and what is held, seconds.
    pub start_cycles: u64,
    pub latest_start_s: f64,
    /// From one control tick to the next.
    pub tick_cycles: u64,
    /// How long calls were counted.
    pub counted_cycles: u64,
    /// The control task, and the link's bytes.
    pub tick: Cost,
    pub link: Cost,
    /// Cycles of all handlers together.
    pub all_cycles: u64,
}

impl Row {
    /// Share of the core's time that all handlers take, with the link's requests.
    fn share(&self) -> f64 {
        self.all_cycles as f64 / self.counted_cycles as f64
    }

    /// Share of the time from tick to tick that the longest tick takes.
    fn most_share(&self) -> f64 {
        self.tick.most as f64 / self.tick_cycles as f64
    }

    fn start_s(&self) -> f64 {
        self.start_cycles as f64 / CYCLES_PER_S as f64
    }

    /// What the table of the page has of it: cycles of a tick, mean and most, shares in percent, and the start in milliseconds.
    fn figures(&self) -> [f64; 5] {
        let percent = |share: f64| 100.0 * share;
        let (mean, most) = (self.tick.mean(), self.tick.most as f64);
        [mean, most, percent(self.share()), percent(self.most_share()), 1e3 * self.start_s()]
    }

    /// As a row of that table.
    fn written(&self) -> String {
        let [mean, most, share, most_share, start] = self.figures();
        format!("| {} | {mean:.0} | {most:.0} | {share:.1} % | {most_share:.1} % | {start:.0} ms |", self.name)
    }

    /// Whether a page has such a row.
    fn is_written(&self, page: &str) -> bool {
        let head = format!("| {} |", self.name);
        let rows = page.lines().filter_map(|line| line.strip_prefix(&head));
        let numbers = |row: &str| -> Vec<f64> { row.split_whitespace().filter_map(|word| word.parse().ok()).collect() };
        let is_near = |(written, found): (&f64, f64)| (written - found).abs() <= PAGE_TOLERANCE * found;
        rows.map(numbers).any(|row| row.len() == 5 && row.iter().zip(self.figures()).all(is_near))
    }

    fn json(&self) -> Value {
        json!({
            "ticks": self.tick.calls,
            "tick_cycles_mean": self.tick.mean(),
            "tick_cycles_most": self.tick.most,
            "link_calls": self.link.calls,
            "link_cycles_mean": self.link.mean(),
            "link_cycles_most": self.link.most,
            "core_share": self.share(),
            "core_share_longest_tick": self.most_share(),
            "start_s": self.start_s(),
        })
    }
}

/// Everything that was measured.
pub struct Report {
    pub rows: Vec<Row>,
}

impl Report {
    /// The figures by name.
    pub fn json(&self) -> Value {
        Value::Object(self.rows.iter().map(|row| (row.key.to_owned(), row.json())).collect())
    }

    /// What does not hold, in words.
    pub fn missed(&self) -> Vec<String> {
        self.missed_beside(PAGE)
    }

    fn missed_beside(&self, page: &str) -> Vec<String> {
        let mut missed = Vec::new();
        for row in &self.rows {
            let mut hold = |holds: bool, what: String| {
                if !holds {
                    missed.push(format!("{}: {what}", row.name));
                }
            };
            let percent =
                |share: f64| format!("{:.1} % of the core, and {:.0} % are held", 100.0 * share, 100.0 * MOST_SHARE);
            hold(row.share() < MOST_SHARE, format!("the handlers take {}", percent(row.share())));
            hold(row.most_share() < MOST_SHARE, format!("the longest tick takes {}", percent(row.most_share())));
            let start = row.start_s();
            let latest = row.latest_start_s;
            let what = format!("the first control tick comes {start:.3} s after the reset, and {latest} s are held");
            hold(start < latest, what);
            let expected = row.counted_cycles / row.tick_cycles;
            let what = format!("{} control ticks came instead of {expected}", row.tick.calls);
            hold(row.tick.calls.abs_diff(expected) <= TICKS_AT_ENDS, what);
            hold(row.is_written(page), format!("docs/board-rp2040.md does not say, to 5 %: {}", row.written()));
        }
        missed
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Cycles of an RP2040 as rp2040js counts them, without flash wait states\n")?;
        writeln!(f, "{:<26} {:>13} {:>15} {:>20}", "", "control tick", "link interrupt", "share of the core")?;
        writeln!(
            f,
            "{:<26} {:>6} {:>6} {:>8} {:>6} {:>8} {:>11} {:>9}",
            "four motors armed", "mean", "most", "mean", "most", "mean", "worst tick", "start"
        )?;
        for row in &self.rows {
            writeln!(
                f,
                "{:<26} {:>6.0} {:>6} {:>8.0} {:>6} {:>6.1} % {:>9.1} % {:>6.0} ms",
                row.name,
                row.tick.mean(),
                row.tick.most,
                row.link.mean(),
                row.link.most,
                100.0 * row.share(),
                100.0 * row.most_share(),
                1e3 * row.start_s(),
            )?;
        }
        writeln!(
            f,
            "\nA handler's cycles have its entry, and not the handlers that interrupt it. The mean share is that of all handlers, \
             while a host asks over the link 100 times a second; start is from the reset to the first control tick."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 ticks of 25 000 cycles, of which the handlers take a fifth.
    const GOOD: Row = Row {
        key: "lead",
        name: "pulses, lead",
        start_cycles: 12_500_000,
        latest_start_s: 0.3,
        tick_cycles: 25_000,
        counted_cycles: 2_500_000,
        tick: Cost { calls: 100, total: 450_000, most: 7500 },
        link: Cost { calls: 50, total: 50_000, most: 1200 },
        all_cycles: 500_000,
    };

    fn missed(row: Row) -> Vec<String> {
        Report { rows: vec![row] }.missed_beside(&row.written())
    }

    #[test]
    fn what_holds_is_not_missed() {
        assert_eq!(missed(GOOD), [""; 0]);
        assert_eq!(missed(Row { tick: Cost { calls: 101, ..GOOD.tick }, ..GOOD }), [""; 0]);
    }

    #[test]
    fn each_limit_is_held_by_itself() {
        for (row, expected) in [
            (Row { all_cycles: 1_000_000, ..GOOD }, "the handlers take 40.0 % of the core, and 40 % are held"),
            (
                Row { tick: Cost { most: 10_100, ..GOOD.tick }, ..GOOD },
                "the longest tick takes 40.4 % of the core, and 40 % are held",
            ),
            (
                Row { start_cycles: 37_500_000, ..GOOD },
                "the first control tick comes 0.300 s after the reset, and 0.3 s are held",
            ),
            (Row { tick: Cost { calls: 98, ..GOOD.tick }, ..GOOD }, "98 control ticks came instead of 100"),
        ] {
            assert_eq!(missed(row), [format!("pulses, lead: {expected}")]);
        }
    }

    #[test]
    fn a_page_with_other_figures_is_missed() {
        let page = "| pulses, lead | 4700 | 7200 | 20.5 % | 30.0 % | 100 ms |";
        assert!(GOOD.is_written(page));
        for (figure, other) in
            [("4700", "4800"), ("7200", "7100"), ("20.5", "21.1"), ("100", "94"), ("lead", "inverse")]
        {
            assert!(!GOOD.is_written(&page.replacen(figure, other, 1)), "{other}");
        }
        let missed = Report { rows: vec![GOOD] }.missed_beside("");
        assert_eq!(missed, [format!("pulses, lead: docs/board-rp2040.md does not say, to 5 %: {}", GOOD.written())]);
    }

    #[test]
    fn the_figures_have_the_names_of_their_cases() {
        let json = Report { rows: vec![GOOD] }.json();
        assert_eq!(json["lead"]["tick_cycles_mean"], 4500.0);
        assert_eq!(json["lead"]["link_cycles_mean"], 1000.0);
        assert_eq!(json["lead"]["core_share"], 0.2);
        assert_eq!(json["lead"]["core_share_longest_tick"], 0.3);
        assert_eq!(json["lead"]["start_s"], 0.1);
    }

    #[test]
    fn every_line_of_the_table_has_its_columns() {
        let table = Report { rows: vec![GOOD] }.to_string();
        let lines: Vec<&str> = table.lines().collect();
        let words: Vec<&str> = lines[4].split_whitespace().collect();
        let expected = ["pulses,", "lead", "4500", "7500", "1000", "1200", "20.0", "%", "30.0", "%", "100", "ms"];
        assert_eq!(words, expected, "{table}");
        assert_eq!(lines[3].chars().count(), lines[4].chars().count(), "{table}");
    }
}
