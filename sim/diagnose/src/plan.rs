//! The experiment that would say more: in words, as a plan that `rotorlead simulate` runs, and as the commands that run it on
//! a controller.
//!
//! What separates two kinds is known from the catalog ([`Confusion`](rotorlead_plant::effect::Confusion)); here it becomes
//! records. Multisines are those that the controller plays itself (`rotorlead device excite`). Square waves and triangles it
//! does not: these are sent by whatever drives its input, and recorded (`rotorlead device record`).

use std::fmt::Write as _;

use rotorlead_plant::Noise;
use rotorlead_plant::bench::{Plan, PlannedRecord};
use rotorlead_plant::effect::esc_frame_hold;
use rotorlead_plant::effect::{Confusion, Kind, Recipe, SQUARE_PERIODS, Site};
use rotorlead_records::{Excitation, Output};

use crate::assess::conditions::{Conditions, StaircaseConditions};
use crate::assess::verdict::Verdict;
use crate::outcome::Diagnosis;

/// Rate of the loop of a plan where those of the records are too low or do not go together, hertz. Standard: the paper's, and the
/// controller's own.
const LOOP_RATE_HZ: u32 = 5000;
/// And of its rows. Standard: the paper's, a fifth of that.
const SAMPLE_RATE_HZ: u32 = 1000;
/// Rows per second that multisines of 225 lines need. Derived: 2.2 in a period of the highest, 44.9 Hz, as residuals are compared up to
/// 0.45 of the rate.
const RATE_FOR_45_HZ: f64 = 100.0;
/// And those of 150. Derived: the same of 29.9 Hz.
const RATE_FOR_30_HZ: f64 = 66.0;
/// Rows of a frame that show its images. Derived: lines are compared up to 1.8 times the frame rate then, beyond the first image on either
/// side of it.
const ROWS_PER_FRAME: f64 = 4.0;
/// Most nominal commands of an experiment that does not need them all. Chosen: the ends and the middle. More cost time on the stand.
const FEW_NOMINALS: usize = 3;
/// A triangle goes over so many widths of what it is to show. Chosen: play is taken up in a tenth of the way then, and a dead band makes
/// ten stairs. Less shows few of them; more leaves the neighborhood of the nominal command.
const WIDTHS: f64 = 10.0;
/// The second triangle is larger by this factor, so that it turns elsewhere between the steps of a grid. Chosen: no ratio of small whole
/// numbers, which would turn at the same place of the next step.
const OTHER_TURN: f64 = 1.37;
/// Half the period of a triangle, seconds. Chosen: sixty time constants of a slow motor, 0.16 s, so that its lag does not round the
/// stairs. Longer costs time on the stand.
const TRIANGLE_HALF_S: f64 = 10.0;
/// Most levels of a staircase that is asked for. Chosen: enough for a map that bends, and up and down within a minute or two. More cost
/// time on the stand.
const MOST_LEVELS: usize = 8;
/// Rows in a time constant that show how a step begins. Derived: in a row the response goes a tenth of the step. Fewer do not tell a delay
/// from a lag; more are harder to log.
const ROWS_PER_LAG: f64 = 10.0;
/// Time constants for which a level is held at least. Derived: `e^-20` of the step is left, 2e-9, and most of the plateau is settled.
const HOLD_LAGS: f64 = 20.0;
/// Seconds for which it is held at least. Chosen: sags and heat show within seconds. Shorter hides them; longer costs time on the stand.
const LEAST_HOLD_S: f64 = 2.0;
/// Smallest amplitude that is worth a record. Chosen: eight steps of a 12-bit command. Smaller is a record of the grid.
const SMALLEST_AMPLITUDE: f64 = 0.002;
/// How much two amplitudes of one nominal command differ. Chosen: 5 %, by which no effect changes that is seen. Lower asks for the same
/// record twice.
const SAME_AMPLITUDE: f64 = 1.05;

/// An experiment that is yet to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct NextExperiment {
    /// What to do and what to look at.
    pub words: String,
    /// The records.
    pub plan: Plan,
    /// What has to be set or wired for it, and the commands for a controller, line by line.
    pub device: Vec<String>,
}

impl Conditions {
    /// A few of the nominal commands, from the first to the last.
    fn few(&self) -> Vec<f64> {
        let last = self.nominals.len() - 1;
        if self.nominals.len() <= FEW_NOMINALS {
            return self.nominals.clone();
        }
        (0..FEW_NOMINALS).map(|k| self.nominals[k * last / (FEW_NOMINALS - 1)]).collect()
    }
}

/// Where the catalog has no answer. Chosen: half and twice the amplitude tell what grows with it; twice as long gives evidence twice as
/// large.
const GENERAL: Recipe = Recipe {
    multisines: &[0.5, 1.0, 2.0],
    squares: &[1.0],
    is_fast: true,
    times_longer: 2,
    least_periods: 8,
    needs: "Log the speed, the voltage and the current too.",
    ..Recipe::PLAIN
};

/// Where nothing is named. Chosen: the same by half and twice the amplitude alone, with slow triangles: a record as it was is there
/// already.
const UNKNOWN: Recipe = Recipe { triangles: true, multisines: &[0.5, 2.0], squares: &[0.5, 2.0], ..GENERAL };

/// What the catalog knows of telling two kinds apart.
fn confusion(one: &Kind, other: &Kind) -> Option<&'static Confusion> {
    let of = |kind: &Kind, with: &Kind| kind.confusions.iter().find(|confusion| confusion.with == with.id);
    of(one, other).or_else(|| of(other, one))
}

impl Diagnosis {
    /// The experiment that would say more; `None` where no further experiment is needed.
    #[must_use]
    pub fn next_experiment(&self) -> Option<NextExperiment> {
        if let Some(conditions) = &self.conditions.staircase {
            return self.next_staircase(conditions);
        }
        if !self.timing.is_steady() {
            let words = "Log when each command is sent and when the ESC takes it over, beside the speed, and repeat the records as \
                         they are: what waits differently each time sits in front of the motor, in a driver, a bus or a filter.";
            return Some(self.planned(&UNKNOWN, "untimely", words.to_owned(), None));
        }
        if !self.steadiness.is_noise() {
            let words = "Log the speed, the voltage and the current too, and repeat the records as they are: what comes and goes \
                         in the speed as well is the motor's or the ESC's, else the stand's or the logger's. Look for rows that \
                         repeat and for steps that the motor loses.";
            return Some(self.planned(&UNKNOWN, "unsteady", words.to_owned(), None));
        }
        if self.verdict == Verdict::Unknown {
            let words = "Repeat the records at half and at twice the amplitude, log the speed, the voltage and the current too, \
                         and let each record go on for twice as long: what stays, grows or vanishes says where to look.";
            return Some(self.planned(&UNKNOWN, "unknown", words.to_owned(), None));
        }
        if let Some(most) = self.weak_evidence.first() {
            let times = most.times_longer();
            let words = format!(
                "The evidence for {} is weak: record {times} times as many periods. The evidence for a real effect grows with them, \
                 that of chance does not.",
                self.weak_evidence_in_words()
            );
            // Evidence grows in proportion to the periods, and four of a multisine are the least of a plan.
            let square_periods = SQUARE_PERIODS * times;
            let recipe = Recipe {
                squares: &[1.0],
                square_periods,
                times_longer: times,
                least_periods: 4 * times,
                is_reversed: true,
                ..Recipe::PLAIN
            };
            return Some(self.planned(&recipe, "weak_evidence", words, None));
        }
        let open = self.effects.iter().find(|effect| !effect.alternatives.is_empty())?;
        // The first rival that the catalog has an answer for.
        let rivals = &open.alternatives;
        let known = |other: &&'static Kind| confusion(open.kind, other).map(|known| (*other, known));
        let (other, recipe, words) = match rivals.iter().find_map(known) {
            Some((other, known)) => (other, known.recipe, known.experiment.to_owned()),
            None => {
                let (one, other) = (open.kind.title, rivals[0].title);
                (rivals[0], &GENERAL, format!("To tell {one} from {other}: repeat the records at other amplitudes."))
            }
        };
        // A width in duty says how large a triangle has to be.
        let width = open.parameters.iter().find(|(parameter, _)| parameter.unit == "duty");
        let name = format!("{} or {}", open.kind.id, other.id);
        Some(self.planned(recipe, &name, words, width.map(|(_, estimate)| estimate.value)))
    }

    /// What can be done where staircases were logged: others, logged at another rate, with another supply.
    fn next_staircase(&self, conditions: &StaircaseConditions) -> Option<NextExperiment> {
        let effects = &self.effects;
        let is_open = matches!(self.verdict, Verdict::Unknown | Verdict::PartlyNamed)
            || !self.weak_evidence.is_empty()
            || effects.iter().any(|effect| !effect.alternatives.is_empty());
        if !is_open && self.lateness.is_none() {
            return None;
        }
        let mut words = Vec::new();
        let rows_hz = self.conditions.sample_rate_hz;
        if self.lateness.is_some() {
            words.push(format!(
                "Log the same steps at half and at twice the {rows_hz:.0} rows a second: a delay that follows the time between rows is \
                 the logger's, one that stays is the ESC's or the motor's."
            ));
        }
        let lag_s = self.model.points.iter().map(|point| point.time_constant_s).fold(f64::INFINITY, f64::min);
        let needed_hz = ROWS_PER_LAG / lag_s;
        let hold_s = (HOLD_LAGS * lag_s).max(LEAST_HOLD_S).max(conditions.hold_s.min(2.0 * LEAST_HOLD_S));
        // What was held for longer is so again, up to twice the least. To a tenth of a second, which is a whole number of rows.
        let hold_s = (10.0 * hold_s).ceil() / 10.0;
        let (low, high) = (conditions.levels[0], conditions.levels[conditions.levels.len() - 1]);
        if is_open {
            let rate = if rows_hz < needed_hz {
                format!("{:.0} rows a second or more ({rows_hz:.0} so far)", 10.0 * (0.1 * needed_hz).ceil())
            } else {
                "as many rows a second as so far".to_owned()
            };
            words.push(format!(
                "Run a staircase up and down again, {} levels from {low:.2} to {high:.2}, each held for {hold_s:.1} s, and large steps up \
                 and down between {low:.2} and {high:.2}, with {rate}: what differs between up and down, or grows with the step, shows \
                 there.",
                conditions.levels.len().min(MOST_LEVELS)
            ));
        }
        let supply = |kind: &Kind| kind.site == Site::Supply;
        if effects.iter().any(|effect| supply(effect.kind) || effect.alternatives.iter().any(|kind| supply(kind))) {
            words.push(
                "Repeat it with another supply, a bench supply in place of a battery or a full battery in place of an empty one: a sag \
                 goes with the supply, heat does not."
                    .to_owned(),
            );
        }
        if is_open && !conditions.not_logged.is_empty() {
            words.push(format!("Log the {} too.", conditions.not_logged.join(" and the ")));
        }
        let nominal = round(0.5 * (low + high));
        let mut up: Vec<f64> = spread(&conditions.levels, MOST_LEVELS);
        let down: Vec<f64> = up.iter().rev().skip(1).copied().collect();
        up.extend(down);
        let staircase = |levels: Vec<f64>| PlannedRecord {
            levels: Some(levels.into_iter().map(round).collect()),
            hold_s: Some(hold_s),
            ..PlannedRecord::new(nominal, Excitation::Staircase)
        };
        let rate_hz = if self.lateness.is_some() { needed_hz.max(2.0 * rows_hz) } else { needed_hz.max(rows_hz) };
        let rate_hz = rate_hz.min(f64::from(SAMPLE_RATE_HZ)) as u32;
        let plan = Plan {
            format: 1,
            name: "staircase".to_owned(),
            seed: 1,
            loop_rate_hz: LOOP_RATE_HZ,
            sample_rate_hz: divisor_from(rate_hz),
            esc_frame_hz: self.conditions.esc_frame_hz,
            esc_frame_phase: 0.0,
            compensator: None,
            noise: Noise::default(),
            records: vec![staircase(up), staircase(vec![low, high, low, high, low])],
        };
        Some(NextExperiment { words: words.join(" "), plan, device: Vec::new() })
    }

    /// The kinds to which the records lean, as an enumeration.
    fn weak_evidence_in_words(&self) -> String {
        let titles: Vec<&str> = self.weak_evidence.iter().map(|suspect| suspect.kind.title).collect();
        titles.join(", or ")
    }

    fn planned(&self, recipe: &Recipe, name: &str, words: String, width: Option<f64>) -> NextExperiment {
        let conditions = &self.conditions;
        let frame_hz = self.effects.iter().find(|effect| effect.kind.id == esc_frame_hold::ID);
        let frame_hz = frame_hz.and_then(|effect| effect.parameters.first()).map(|(_, estimate)| estimate.value);
        let (loop_rate_hz, sample_rate_hz) = rates(conditions, recipe.is_fast, frame_hz);
        let lines = if recipe.is_fast && f64::from(sample_rate_hz) >= RATE_FOR_45_HZ { 225 } else { 150 };
        let least = recipe.least_periods;
        // Chosen: three times the least bounds the time on the stand.
        let periods = (recipe.times_longer * conditions.periods).clamp(least, 3 * least);
        let mut nominals = if recipe.is_reversed { conditions.nominals.clone() } else { conditions.few() };
        if recipe.is_reversed {
            nominals.reverse();
        }
        let mut records: Vec<PlannedRecord> = Vec::new();
        let mut add =
            |nominal: f64, excitation: Excitation, amplitude: f64, half_period_s: Option<f64>, periods: u32| {
                let amplitude = round(amplitude.min(nominal).min(1.0 - nominal));
                let is_alike = |other: &PlannedRecord| {
                    (other.nominal, other.excitation) == (nominal, excitation)
                        && other.amplitude.is_some_and(|other| (other / amplitude).ln().abs() < SAME_AMPLITUDE.ln())
                };
                if amplitude < SMALLEST_AMPLITUDE || records.iter().any(is_alike) {
                    return;
                }
                records.push(PlannedRecord {
                    amplitude: Some(amplitude),
                    lines: (excitation == Excitation::Multisine).then_some(lines),
                    half_period_s,
                    periods: Some(periods),
                    ..PlannedRecord::new(nominal, excitation)
                });
            };
        for &nominal in &nominals {
            let lower = round(nominal - conditions.amplitude);
            let first = conditions.nominals[0];
            for around in [Some(nominal), (recipe.is_lowered && lower >= first).then_some(lower)].into_iter().flatten()
            {
                for factor in recipe.multisines {
                    add(around, Excitation::Multisine, factor * conditions.amplitude, None, periods);
                }
                for factor in recipe.squares {
                    let half_s = Some(recipe.square_half_s);
                    add(around, Excitation::Square, factor * conditions.amplitude, half_s, recipe.square_periods);
                }
            }
            if recipe.triangles {
                // Chosen: a fifth of the range at most, over which a motor is not what it is around one command.
                let amplitude = conditions.amplitude.max(WIDTHS * width.unwrap_or(0.0)).min(0.2);
                for factor in [1.0, OTHER_TURN] {
                    add(nominal, Excitation::Triangle, factor * amplitude, Some(TRIANGLE_HALF_S), SQUARE_PERIODS);
                }
            }
        }
        let sigma_n = if conditions.output == Output::Rpm { 0.0 } else { conditions.noise_std };
        let plan = Plan {
            format: 1,
            name: name.to_owned(),
            seed: 1,
            loop_rate_hz,
            sample_rate_hz,
            esc_frame_hz: conditions.esc_frame_hz,
            esc_frame_phase: 0.0,
            compensator: None,
            noise: Noise { sigma_n: if sigma_n.is_finite() { sigma_n } else { 0.0 }, ..Noise::default() },
            records,
        };
        let device = on_a_device(&plan, recipe.needs);
        NextExperiment { words, plan, device }
    }
}

/// So many of some values at most, from the first to the last.
fn spread(values: &[f64], most: usize) -> Vec<f64> {
    let count = values.len().min(most);
    (0..count).map(|place| values[place * (values.len() - 1) / (count - 1).max(1)]).collect()
}

/// The lowest rate, this or more, that goes into the loop's and has whole tenths of a second.
fn divisor_from(rate_hz: u32) -> u32 {
    let fits = |rate: &u32| LOOP_RATE_HZ.is_multiple_of(*rate) && rate.is_multiple_of(10);
    (rate_hz.max(1)..=LOOP_RATE_HZ).find(fits).unwrap_or(LOOP_RATE_HZ)
}

/// To four decimals, as people write commands.
fn round(value: f64) -> f64 {
    (1e4 * value).round() / 1e4
}

/// Rates of loop and rows: those of the records where these go together and are high enough.
fn rates(conditions: &Conditions, is_fast: bool, frame_hz: Option<f64>) -> (u32, u32) {
    let rows_hz = conditions.sample_rate_hz.round();
    let loop_hz = conditions.command_rate_hz.map_or(rows_hz, f64::round);
    let needed = if is_fast { RATE_FOR_45_HZ } else { RATE_FOR_30_HZ };
    let needed = frame_hz.map_or(needed, |frame_hz| needed.max(ROWS_PER_FRAME * frame_hz));
    // Whole but for the rounding of stamps; and a loop as fast as controllers have it.
    let is_whole = (conditions.sample_rate_hz - rows_hz).abs() < 1e-6 * rows_hz && loop_hz % rows_hz == 0.0;
    if is_whole && rows_hz >= needed && (50.0..=100_000.0).contains(&loop_hz) {
        return (loop_hz as u32, rows_hz as u32);
    }
    let sample = (1..=LOOP_RATE_HZ / SAMPLE_RATE_HZ).rev().map(|divisor| LOOP_RATE_HZ / divisor);
    let mut enough = sample.filter(|rate| LOOP_RATE_HZ.is_multiple_of(*rate) && f64::from(*rate) >= needed);
    (LOOP_RATE_HZ, enough.next().unwrap_or(LOOP_RATE_HZ))
}

/// How it is run on a controller.
fn on_a_device(plan: &Plan, needs: &str) -> Vec<String> {
    let mut lines = Vec::new();
    if !needs.is_empty() {
        lines.push(needs.to_owned());
    }
    // Of the controller's own ticks: what is simulated may have another loop.
    let divisor = (LOOP_RATE_HZ / plan.sample_rate_hz).max(1);
    let common = "rotorlead device --port PORT";
    let sensor = "--out DIR --newtons-per-count N --zero-count COUNT";
    // Multisines of one size are one command; the order of the records stays.
    let mut group: Option<(&PlannedRecord, Vec<String>)> = None;
    let say = |(record, nominals): (&PlannedRecord, Vec<String>)| {
        let hz = if record.lines == Some(225) { "45hz" } else { "30hz" };
        format!(
            "{common} excite --nominal {} --amplitude {} --lines {hz} --periods {} --divisor {divisor} {sensor}",
            nominals.join(","),
            record.amplitude.unwrap_or_default(),
            record.periods.unwrap_or_default(),
        )
    };
    let is_multisine = |record: &&PlannedRecord| record.excitation == Excitation::Multisine;
    let mut multisines: Vec<&PlannedRecord> = plan.records.iter().filter(is_multisine).collect();
    // By amplitude, nominal commands in their order.
    multisines.sort_by(|a, b| a.amplitude.unwrap_or_default().total_cmp(&b.amplitude.unwrap_or_default()));
    for record in multisines {
        match &mut group {
            Some((first, nominals)) if first.amplitude == record.amplitude => nominals.push(record.nominal.to_string()),
            _ => lines.extend(group.replace((record, vec![record.nominal.to_string()])).map(say)),
        }
    }
    lines.extend(group.map(say));
    let others: Vec<&PlannedRecord> = plan.records.iter().filter(|record| !is_multisine(record)).collect();
    if !others.is_empty() {
        lines.push(
            "The controller does not play the rest itself: send it from the flight controller or a generator, and record it."
                .to_owned(),
        );
    }
    for record in others {
        let period_s = 2.0 * record.half_period_s.unwrap_or_default();
        let excitation = if record.excitation == Excitation::Triangle { "triangle" } else { "square" };
        lines.push(format!(
            "{common} record --excitation {excitation} --nominal {} --amplitude {} --period {period_s} --seconds {} --divisor \
             {divisor} {sensor}",
            record.nominal,
            record.amplitude.unwrap_or_default(),
            period_s * f64::from(record.periods.unwrap_or_default()),
        ));
    }
    lines
}

impl NextExperiment {
    /// The plan as a file, with what is to be done in its comments.
    ///
    /// # Errors
    /// When the plan cannot be written as TOML, which no plan of this crate is.
    pub fn file(&self) -> Result<String, toml::ser::Error> {
        let mut text = String::new();
        for line in textwrap::wrap(&self.words, 100) {
            let _ = writeln!(text, "# {line}");
        }
        let _ = writeln!(text, "#\n# On a simulated actuator: rotorlead simulate MODEL --plan THIS --out DIR");
        if !self.device.is_empty() {
            let _ = writeln!(text, "# On a controller, records into one folder, which rotorlead diagnose takes:");
        }
        for line in &self.device {
            let _ = writeln!(text, "#   {line}");
        }
        if let Some(frame_hz) = self.plan.esc_frame_hz {
            let _ = writeln!(
                text,
                "# esc_frame_hz is that of the ESC's protocol: say here what it is set to ({frame_hz} so far)."
            );
        }
        text.push('\n');
        text.push_str(&toml::to_string(&self.plan)?);
        Ok(text)
    }
}
