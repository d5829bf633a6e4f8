//! From a planned record to the command of every tick.

use rotorlead::excitation::{Multisine, ODD_LINES_30_HZ, ODD_LINES_45_HZ};
use rotorlead::throttle::Command;
use rotorlead_records::Excitation;
use rotorlead_records::files::{Fault, KeyPath};

use super::multisine::{DetectionRecipe, DetectionSet};
use super::{Plan, PlannedRecord};

/// A record is at most this many ticks long (an hour at 5 kHz), warm-up included: a slip of the decimal point in a plan is to be an error,
/// not a full memory. Chosen: the commands of one take 80 MB at most, and no stand runs as long.
const MOST_TICKS: f64 = 2e7;

/// How much a duration may miss a whole number of rows, relative. Chosen: more than the 1e-16 that the product of two decimals loses, and
/// less than a row of the longest record, 5e-8.
const WHOLE_TOLERANCE: f64 = 1e-9;

/// How many sets of phases a plan can choose from. All are scaled by the highest peak among them, so that records with different phases
/// have lines of the same amplitude. Chosen: 8 know the variance at a line to 38 %, `1 / sqrt(7)`; more lower that scale.
const REALIZATIONS: u32 = 8;

/// The command of every tick of one record.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Signal {
    /// Where everything is at rest before the first tick.
    pub start: Command,
    /// One period, or the whole record where nothing repeats: tick `k` has `samples[k % samples.len()]`.
    pub samples: Vec<Command>,
    /// Ticks that are run before the recorded ones.
    pub warm_up_ticks: usize,
    /// Ticks that are recorded.
    pub ticks: usize,
    /// Period in seconds, where there is one.
    pub period_s: Option<f64>,
    /// Largest deviation from the nominal command.
    pub amplitude: f64,
}

impl Signal {
    /// The command of every tick of `record`, whose place in the plan is `place`.
    pub(super) fn new(plan: &Plan, record: &PlannedRecord, place: &KeyPath) -> Result<Self, Fault> {
        let shape = Shape::from_record(plan, record, place)?;
        let ticks_per_row = (plan.loop_rate_hz / plan.sample_rate_hz) as usize;
        let level = |value: f64| Command::saturating_from_f64(value);
        let hold = |levels: &[f64], rows: usize| -> Vec<Command> {
            levels.iter().flat_map(|&l| std::iter::repeat_n(level(l), rows * ticks_per_row)).collect()
        };
        let nominal = record.nominal;
        let (start, samples, amplitude, repetition) = match shape {
            Shape::Multisine { amplitude, mut multisine, repetition } => {
                multisine.start(None);
                // It repeats bit for bit, so one period is enough.
                let samples = (0..multisine.ticks_per_period()).map(|_| multisine.update()).collect();
                (nominal, samples, amplitude, Some(repetition))
            }
            Shape::Detection { amplitude, recipe, realization, repetition } => {
                let set = DetectionSet::new(&recipe)
                    .map_err(|error| place.key("realization").fault(error.to_string(), "use 150 or 225 lines"))?;
                let ticks = (f64::from(plan.loop_rate_hz) * recipe.period_s).round() as usize;
                let scale = amplitude / set.peak;
                let wave = set.realizations[realization].waveform(ticks);
                (nominal, wave.iter().map(|x| level(nominal + scale * x)).collect(), amplitude, Some(repetition))
            }
            Shape::Square { amplitude, half_rows, repetition } => {
                let levels = [nominal + amplitude, nominal - amplitude];
                (nominal, hold(&levels, half_rows), amplitude, Some(repetition))
            }
            Shape::Triangle { amplitude, half_rows, repetition } => {
                let ticks = 2 * half_rows * ticks_per_row;
                let wave = |tick: usize| level(nominal + amplitude * triangle(tick as f64 / ticks as f64));
                (nominal, (0..ticks).map(wave).collect(), amplitude, Some(repetition))
            }
            Shape::Step { amplitude, hold_rows } => {
                (nominal, hold(&[nominal, nominal + amplitude], hold_rows), amplitude.abs(), None)
            }
            Shape::Staircase { levels, hold_rows } => {
                let amplitude = levels.iter().fold(0.0, |largest: f64, l| largest.max((l - nominal).abs()));
                (levels[0], hold(levels, hold_rows), amplitude, None)
            }
        };
        let length = samples.len();
        let (warm_up_ticks, ticks, period_s) = match repetition {
            Some(Repetition { periods, warm_up }) => {
                (warm_up * length, periods * length, Some(length as f64 / f64::from(plan.loop_rate_hz)))
            }
            None => (0, length, None),
        };
        Ok(Self { start: level(start), samples, warm_up_ticks, ticks, period_s, amplitude })
    }

    /// Checks `record` without computing its samples.
    pub(super) fn check(plan: &Plan, record: &PlannedRecord, place: &KeyPath) -> Result<(), Fault> {
        Shape::from_record(plan, record, place).map(drop)
    }
}

/// One period of a plan's first record, the commands of its ticks, 0..1; the whole record where nothing repeats.
///
/// # Errors
/// Those of [`Plan::check`].
pub fn first_period(plan: &Plan) -> Result<Vec<f64>, Fault> {
    plan.check()?;
    let Some(record) = plan.records.first() else { return Ok(Vec::new()) };
    let signal = Signal::new(plan, record, &KeyPath::root().key("record").item(0))?;
    Ok(signal.samples.into_iter().map(Command::to_f64).collect())
}

/// A triangle of peak 1 at a part of its period, 0..1: from 0 up to 1, down to -1 and back.
fn triangle(part: f64) -> f64 {
    match part {
        p if p < 0.25 => 4.0 * p,
        p if p < 0.75 => 2.0 - 4.0 * p,
        p => 4.0 * p - 4.0,
    }
}

/// How often a periodic record plays its period.
struct Repetition {
    periods: usize,
    warm_up: usize,
}

/// What a record plays, with the keys that its excitation needs.
enum Shape<'a> {
    Multisine {
        amplitude: f64,
        multisine: Multisine<'static>,
        repetition: Repetition,
    },
    /// One of the [`REALIZATIONS`], by its place.
    Detection {
        amplitude: f64,
        recipe: DetectionRecipe,
        realization: usize,
        repetition: Repetition,
    },
    Square {
        amplitude: f64,
        half_rows: usize,
        repetition: Repetition,
    },
    Triangle {
        amplitude: f64,
        half_rows: usize,
        repetition: Repetition,
    },
    Step {
        amplitude: f64,
        hold_rows: usize,
    },
    Staircase {
        levels: &'a [f64],
        hold_rows: usize,
    },
}

impl<'a> Shape<'a> {
    fn from_record(plan: &Plan, record: &'a PlannedRecord, place: &KeyPath) -> Result<Self, Fault> {
        let keys = Keys { plan, record, place };
        place.key("nominal").accept(record.nominal)?;
        match record.excitation {
            Excitation::Multisine => {
                keys.only(&["amplitude", "lines", "realization", "periods", "warm_up_periods"])?;
                let lines = match keys.needed("lines", record.lines)? {
                    150 => ODD_LINES_30_HZ,
                    225 => ODD_LINES_45_HZ,
                    other => {
                        let help = "use 150 (0.1 to 29.9 Hz) or 225 (0.1 to 44.9 Hz)";
                        return Err(place.key("lines").fault(format!("there is no multisine of {other} lines"), help));
                    }
                };
                let amplitude = keys.amplitude()?;
                keys.level("amplitude", record.nominal + amplitude)?;
                keys.level("amplitude", record.nominal - amplitude)?;
                let repetition = keys.repetition(f64::from(lines.period_s()), "periods")?;
                if let Some(realization) = record.realization {
                    let top_hz = f64::from(lines.top_harmonic()) / f64::from(lines.period_s());
                    return keys.detection(amplitude, f64::from(lines.period_s()), top_hz, realization, repetition);
                }
                let multisine = Multisine::new(lines, record.nominal, amplitude, f64::from(plan.loop_rate_hz))
                    .map_err(|e| {
                        place.clone().fault(e.to_string(), "choose what the controller's excitation can play")
                    })?;
                Ok(Self::Multisine { amplitude, multisine, repetition })
            }
            Excitation::Square | Excitation::Triangle => {
                keys.only(&["amplitude", "half_period_s", "periods", "warm_up_periods"])?;
                let amplitude = keys.amplitude()?;
                keys.level("amplitude", record.nominal + amplitude)?;
                keys.level("amplitude", record.nominal - amplitude)?;
                let half_s = keys.needed("half_period_s", record.half_period_s)?;
                let half_rows = keys.whole_rows("half_period_s", half_s)?;
                let repetition = keys.repetition(2.0 * half_s, "half_period_s")?;
                Ok(match record.excitation {
                    Excitation::Triangle => Self::Triangle { amplitude, half_rows, repetition },
                    _ => Self::Square { amplitude, half_rows, repetition },
                })
            }
            Excitation::Step => {
                keys.only(&["amplitude", "hold_s"])?;
                let amplitude = keys.needed("amplitude", record.amplitude)?;
                if !(amplitude.is_finite() && amplitude != 0.0) {
                    return Err(place.key("amplitude").fault(
                        format!("a step of {amplitude} is none"),
                        "give how far the command steps: up, or down where negative",
                    ));
                }
                keys.level("amplitude", record.nominal + amplitude)?;
                let hold_rows = keys.hold(2)?;
                Ok(Self::Step { amplitude, hold_rows })
            }
            Excitation::Staircase => {
                keys.only(&["levels", "hold_s"])?;
                let levels = record.levels.as_deref().ok_or_else(|| keys.missing("levels"))?;
                if levels.is_empty() {
                    return Err(place
                        .key("levels")
                        .fault("there are none", "give the levels of the staircase, 0 to 1"));
                }
                for (index, &level) in levels.iter().enumerate() {
                    place.key("levels").item(index).accept(level)?;
                }
                if levels.windows(2).all(|pair| pair[0] == pair[1]) {
                    return Err(place.key("levels").fault(
                        "the command would stand still: no two neighbors differ",
                        "give two levels or more, one after the other",
                    ));
                }
                let hold_rows = keys.hold(levels.len())?;
                Ok(Self::Staircase { levels, hold_rows })
            }
            Excitation::Chirp | Excitation::Random | Excitation::Steady | Excitation::Flight | Excitation::Free => {
                Err(place
                    .key("excitation")
                    .fault("the bench does not play this", "use multisine, square, triangle, step or staircase"))
            }
        }
    }
}

/// The keys of one record of a plan, with the rules that several excitations share.
#[derive(Clone, Copy)]
struct Keys<'a> {
    plan: &'a Plan,
    record: &'a PlannedRecord,
    place: &'a KeyPath,
}

impl Keys<'_> {
    /// Refuses keys that the record's excitation has no use for: whoever wrote them expects something of them.
    fn only(&self, allowed: &[&str]) -> Result<(), Fault> {
        let r = self.record;
        let present = [
            ("amplitude", r.amplitude.is_some()),
            ("lines", r.lines.is_some()),
            ("realization", r.realization.is_some()),
            ("half_period_s", r.half_period_s.is_some()),
            ("periods", r.periods.is_some()),
            ("warm_up_periods", r.warm_up_periods.is_some()),
            ("hold_s", r.hold_s.is_some()),
            ("levels", r.levels.is_some()),
        ];
        match present.into_iter().find(|(key, given)| *given && !allowed.contains(key)) {
            Some((key, _)) => Err(self.place.key(key).fault(
                "a record of this excitation has no such key",
                format!("remove it; besides nominal and role it has {}", allowed.join(", ")),
            )),
            None => Ok(()),
        }
    }

    fn missing(&self, key: &str) -> Fault {
        self.place.clone().fault(format!("`{key}` is missing"), format!("add {key} to this [[record]]"))
    }

    fn needed<T: Copy>(&self, key: &str, value: Option<T>) -> Result<T, Fault> {
        value.ok_or_else(|| self.missing(key))
    }

    fn amplitude(&self) -> Result<f64, Fault> {
        let amplitude = self.needed("amplitude", self.record.amplitude)?;
        self.place.key("amplitude").accept(amplitude)?;
        Ok(amplitude)
    }

    /// Refuses a level that the command cannot have, which would otherwise be clipped in silence.
    fn level(&self, key: &str, level: f64) -> Result<(), Fault> {
        // 0.95 + 0.05 may come out above 1 by a rounding, which the command's grid of 2^-29 does not see. Chosen: 1e-12 is far above a
        // rounding of 1 and far below that grid, 2e-9.
        if (-1e-12..=1.0 + 1e-12).contains(&level) {
            return Ok(());
        }
        let message = format!("the command would have to be {level}, outside 0..1");
        Err(self.place.key(key).fault(message, "use a smaller one, or another nominal"))
    }

    fn repetition(&self, period_s: f64, length_key: &str) -> Result<Repetition, Fault> {
        let periods = self.needed("periods", self.record.periods)?;
        if periods == 0 {
            return Err(self.place.key("periods").fault("nothing would be recorded", "record 1 period or more"));
        }
        let warm_up = self.record.warm_up_periods.unwrap_or(1);
        self.bounded(length_key, period_s * (f64::from(periods) + f64::from(warm_up)))?;
        self.whole_rows(length_key, period_s)?;
        Ok(Repetition { periods: periods as usize, warm_up: warm_up as usize })
    }

    fn detection<'b>(
        &self,
        amplitude: f64,
        period_s: f64,
        top_hz: f64,
        realization: u32,
        repetition: Repetition,
    ) -> Result<Shape<'b>, Fault> {
        if !(1..=REALIZATIONS).contains(&realization) {
            let message = format!("there is no realization {realization}");
            return Err(self.place.key("realization").fault(message, format!("use 1 to {REALIZATIONS}")));
        }
        if 2.0 * top_hz >= f64::from(self.plan.loop_rate_hz) {
            let message = format!("lines up to {top_hz} Hz do not fit a loop of {} Hz", self.plan.loop_rate_hz);
            return Err(self.place.key("lines").fault(message, "raise loop_rate_hz, or use fewer lines"));
        }
        let recipe = DetectionRecipe {
            band_hz: (1.0 / period_s, top_hz),
            period_s,
            group: DetectionRecipe::GROUP,
            seed: 1,
            realizations: REALIZATIONS,
        };
        Ok(Shape::Detection { amplitude, recipe, realization: realization as usize - 1, repetition })
    }

    /// Rows of a `hold_s`, of which the record has `count`.
    fn hold(&self, count: usize) -> Result<usize, Fault> {
        let hold_s = self.needed("hold_s", self.record.hold_s)?;
        self.bounded("hold_s", hold_s * count as f64)?;
        self.whole_rows("hold_s", hold_s)
    }

    fn bounded(&self, key: &str, duration_s: f64) -> Result<(), Fault> {
        let most_s = MOST_TICKS / f64::from(self.plan.loop_rate_hz);
        if duration_s > most_s {
            let message = format!("the record would last {duration_s} s");
            return Err(self.place.key(key).fault(message, format!("a record may last {most_s} s at this loop rate")));
        }
        Ok(())
    }

    fn whole_rows(&self, key: &str, duration_s: f64) -> Result<usize, Fault> {
        let place = self.place.key(key);
        place.clone().accept(duration_s)?;
        self.bounded(key, duration_s)?;
        let rows = duration_s * f64::from(self.plan.sample_rate_hz);
        let whole = rows.round();
        if whole < 1.0 || (rows - whole).abs() > WHOLE_TOLERANCE * whole {
            let message = format!("{duration_s} s is no whole number of rows at {} Hz", self.plan.sample_rate_hz);
            return Err(place.fault(message, "use a multiple of the time between rows, or another sample_rate_hz"));
        }
        // Bounded by MOST_TICKS: the cast is exact.
        Ok(whole as usize)
    }
}
