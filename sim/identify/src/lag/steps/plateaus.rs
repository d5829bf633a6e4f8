//! Where the command stands still, and where the motor runs.

use std::ops::Range;

use rotorlead_numerics::sample::{mean, median, variance};
use rotorlead_records::{CommandLog, Output, Record};

use crate::rows::gaps::rows_after_gaps;
use crate::rows::resolution::{common_std, reading_std, resolution};

/// Shortest time in seconds that counts as a plateau. Chosen: five time constants of a quick motor, 50 ms; a shorter one has not settled,
/// and a longer limit leaves out quick staircases.
pub(super) const MIN_PLATEAU_S: f64 = 0.25;
/// Fewest rows that count as a plateau. Derived: the least with which each of the [`BATCHES`] of the settled half has two rows.
pub(super) const MIN_PLATEAU_ROWS: usize = 20;
/// Commands closer than this are the same level. Chosen: above rounding, and far below the step of a command, 5e-4 of DSHOT.
pub const SAME_LEVEL: f64 = 1e-6;
/// A running motor's settled speed varies by less than this share of its mean. Chosen: noise and ripple are a few percent, a start or a
/// motor out of step tens of percent.
const STEADY_SHARE: f64 = 0.05;
/// Or by less than this many times what is usual in the record. Chosen: it admits a noisy sensor, whose plateaus differ by less than a
/// factor of 4.
const STEADY_TIMES_USUAL: f64 = 4.0;
/// A running motor turns at least at this share of its fastest plateau, where nothing else says that it runs. Chosen: commutation without
/// a sensor works from a few percent of full speed.
const RUNNING_SPEED_SHARE: f64 = 0.05;
/// And at least at this share where its speed is above that at a lower command. Chosen: no sensorless ESC commutates so slowly; the last
/// turns of a motor that stops are slower.
const SLOWEST_SPEED_SHARE: f64 = 0.01;
/// A response that follows the command below zero changes there by this share of its largest value... Chosen: more than the zero of a
/// sensor drifts by, less than a step of a staircase.
const FOLLOWS_SHARE: f64 = 0.05;
/// ...and by this many standard errors, as a speed that is not that of standstill does. Derived: by Student's t with the 8 degrees of freedom of twice five batches, noise alone exceeds 6
/// once in 6000 times.
const FOLLOWS_TIMES_STD: f64 = 6.0;
/// Batches whose means tell how well a plateau's mean is known. Chosen: their 4 degrees of freedom know a standard error to 35 %,
/// `1 / sqrt(8)`; more batches are shorter and miss slow drift.
const BATCHES: usize = 5;

/// Which way the command went to reach a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Direction {
    /// From a lower command.
    Up,
    /// From a higher command.
    Down,
}

/// What the response does on a plateau.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlateauState {
    /// The motor runs steadily.
    Running,
    /// The response is steady, and not above that of a motor that stands still or idles.
    Idle,
    /// The plateau is too short to tell what the response settles to.
    Short,
    /// The response is not steady.
    NotSteady,
    /// The command is zero and the reading stands exactly on another value: it is an old one.
    Frozen,
}

/// A segment of constant command and what the response settles to.
#[derive(Clone, Debug, PartialEq)]
pub struct Plateau {
    /// Its rows; the first is the one on which the command changes.
    pub rows: Range<usize>,
    /// Command that is held.
    pub command: f64,
    /// When the command changed to it, seconds: by its own stamps, half an interval before where they repeat, or at the first of the rows.
    pub change_s: f64,
    /// The gap in the command's stamps, seconds, in which that was, where it was in one.
    pub change_gap_s: Option<f64>,
    /// `None` for a plateau that begins the record.
    pub direction: Option<Direction>,
    /// Mean of the response over the settled rows.
    pub mean: f64,
    /// Standard deviation of the response over the settled rows.
    pub std: f64,
    /// Standard deviation of a reading: the same, and not below that by its resolution.
    pub noise_std: f64,
    /// Standard error of `mean`, from the scatter of the means of batches, which includes slow drift, and with `common_std`.
    pub mean_std: f64,
    /// Standard deviation of the error that its readings have in common, by their resolution.
    pub common_std: f64,
    /// Rows at its end in which the next command may be in force already: as many as its stamp may be late.
    pub late_rows: usize,
    /// Whether its response settled.
    pub state: PlateauState,
    /// Whether the response stands on a limit there: it is then no response of the motor.
    pub limited: bool,
}

impl Plateau {
    /// The rows taken as settled: the second half.
    pub fn settled(&self) -> Range<usize> {
        let middle = self.rows.start + self.rows.len() / 2;
        middle..self.held_until().max(middle)
    }

    /// The first row in which the next command may be in force.
    pub fn held_until(&self) -> usize {
        self.rows.end - self.late_rows
    }

    /// Whether it is long enough to settle.
    pub fn is_long(&self, time_s: &[f64]) -> bool {
        is_long(&self.rows, time_s)
    }
}

/// Where the segments of constant command begin, and the end of the last one.
fn changes(command: &[f64]) -> impl Iterator<Item = usize> {
    let mut start = 0;
    (0..=command.len()).filter(move |&k| {
        let changes = k == command.len() || (command[k] - command[start]).abs() > SAME_LEVEL;
        if changes {
            start = k;
        }
        k == 0 || changes
    })
}

/// How many segments of constant command there are: all, and those that are long enough to settle.
pub(super) fn count(time_s: &[f64], command: &[f64]) -> (usize, usize) {
    let mut counts = (0, 0);
    let mut start = 0;
    for end in changes(command).skip(1) {
        counts.0 += 1;
        counts.1 += usize::from(is_long(&(start..end), time_s));
        start = end;
    }
    counts
}

fn is_long(rows: &Range<usize>, time_s: &[f64]) -> bool {
    rows.len() >= MIN_PLATEAU_ROWS && time_s[rows.end - 1] - time_s[rows.start] >= MIN_PLATEAU_S
}

/// All segments of constant command, long or short, in order.
///
/// A plateau is [`PlateauState::Running`] when it is long enough to settle, its settled mean is above a share of the
/// fastest one's, and its settled scatter is small: below a share of its mean or near what is usual in
/// this record. A slower speed will do where a standing motor was seen beside it. That leaves out standstill, the jumps of a start without a sensor, and a motor that
/// fell out of step. At a command of zero a reading other than zero that never changes is [`PlateauState::Frozen`]: telemetry that
/// repeats its last value, where no ESC drives the motor.
pub(super) fn find(record: &Record, y: &[f64], output: Output) -> Vec<Plateau> {
    let (time_s, command) = (&record.time_s, &record.command);
    let changes_at = ChangeTimes::new(record);
    let mut plateaus = Vec::new();
    let mut start = 0;
    for end in changes(command).skip(1) {
        let direction =
            (start > 0).then(|| if command[start] > command[start - 1] { Direction::Up } else { Direction::Down });
        let late_rows = changes_at.late_rows(start..end);
        let plateau = measured(start..end, late_rows, command[start], direction, y);
        plateaus.push(changes_at.timed(plateau));
        start = end;
    }
    for plateau in plateaus.iter_mut().filter(|p| p.is_long(time_s)) {
        let settled = &y[plateau.settled()];
        let is_frozen =
            plateau.command.abs() <= SAME_LEVEL && settled[0] != 0.0 && settled.iter().all(|y| *y == settled[0]);
        if is_frozen {
            (plateau.state, plateau.mean) = (PlateauState::Frozen, settled[0]);
        }
    }
    // A sensor that never scatters may well read the same of a motor that idles.
    let scatters = plateaus.iter().any(|p| p.is_long(time_s) && p.state != PlateauState::Frozen && p.std > 0.0);
    let is_frozen = |p: &Plateau| scatters && p.state == PlateauState::Frozen;
    let long = |p: &Plateau| p.is_long(time_s) && !is_frozen(p);
    let fastest = plateaus.iter().filter(|p| long(p)).map(|p| p.mean).fold(0.0, f64::max);
    let floor = standing_share(output) * fastest;
    let usual = median(plateaus.iter().filter(|p| long(p) && p.mean > floor).map(|p| p.std)).unwrap_or(0.0);
    let resolution = resolution(y);
    let usual = usual.max(reading_std(resolution));
    for p in &mut plateaus {
        let bound = (STEADY_SHARE * p.mean).max(STEADY_TIMES_USUAL * usual);
        p.state = match p.std <= bound {
            _ if is_frozen(p) => PlateauState::Frozen,
            _ if !long(p) => PlateauState::Short,
            true if p.mean > floor => PlateauState::Running,
            true => PlateauState::Idle,
            false => PlateauState::NotSteady,
        };
        p.common_std = common_std(resolution, p.std);
        p.mean_std = p.mean_std.hypot(p.common_std);
        p.noise_std = p.std.max(reading_std(resolution));
    }
    if output == Output::Rpm {
        mark_slow_running(&mut plateaus, SLOWEST_SPEED_SHARE * fastest);
    }
    plateaus
}

/// Takes slow speeds for those of a running motor where they are above that of a standing or idling one at a lower command. The zero of a
/// load cell drifts, so that a small thrust says no such thing.
fn mark_slow_running(plateaus: &mut [Plateau], slowest: f64) {
    let idle = plateaus.iter().filter(|p| p.state == PlateauState::Idle);
    let Some(lowest) = idle.min_by(|a, b| a.mean.total_cmp(&b.mean)).cloned() else { return };
    let runs = |p: &Plateau| {
        p.command > lowest.command + SAME_LEVEL
            && p.mean > slowest
            && p.mean - lowest.mean > FOLLOWS_TIMES_STD * p.mean_std.hypot(lowest.mean_std)
    };
    for p in plateaus.iter_mut().filter(|p| p.state == PlateauState::Idle) {
        if runs(p) {
            p.state = PlateauState::Running;
        }
    }
}

/// When commands changed, by their own stamps or those of the rows.
struct ChangeTimes<'a> {
    record: &'a Record,
    /// How late a stamp of the command's own may be, seconds.
    resolution_s: f64,
    /// The stamps that come after a gap.
    after_gaps: Vec<usize>,
}

impl<'a> ChangeTimes<'a> {
    fn new(record: &'a Record) -> Self {
        let resolution_s = record.command_log.as_ref().map_or(0.0, CommandLog::resolution_s);
        let after_gaps = match &record.command_log {
            // A log of changes alone stands still in between.
            Some(_) if resolution_s == 0.0 => Vec::new(),
            Some(log) => rows_after_gaps(&log.time_s),
            None => rows_after_gaps(&record.time_s),
        };
        Self { record, resolution_s, after_gaps }
    }

    fn timed(&self, plateau: Plateau) -> Plateau {
        let row = plateau.rows.start;
        let (stamps, at) = match &self.record.command_log {
            Some(log) => (&log.time_s, log.last_change(self.record.time_s[row])),
            None => (&self.record.time_s, row),
        };
        let is_in_gap = self.after_gaps.binary_search(&at).is_ok();
        Plateau {
            change_s: stamps[at] - 0.5 * self.resolution_s,
            change_gap_s: is_in_gap.then(|| stamps[at] - stamps[at - 1]),
            ..plateau
        }
    }

    /// How many of a plateau's rows may have the command that comes after it.
    fn late_rows(&self, rows: Range<usize>) -> usize {
        let (Some(log), Some(next_s)) = (&self.record.command_log, self.record.time_s.get(rows.end)) else { return 0 };
        let earliest_s = log.time_s[log.last_change(*next_s)] - self.resolution_s;
        rows.len() - self.record.time_s[rows].partition_point(|time| *time < earliest_s)
    }
}

/// Below this share of the fastest plateau's response a motor does not run.
fn standing_share(output: Output) -> f64 {
    match output {
        Output::Rpm => RUNNING_SPEED_SHARE,
        // Thrust goes with the square of the speed.
        Output::ThrustN => RUNNING_SPEED_SHARE * RUNNING_SPEED_SHARE,
    }
}

/// The lowest plateau of a response that is not counted from its own zero: one that follows the command where a motor
/// that stands still would read the same at every command.
pub(super) fn below_zero(plateaus: &[Plateau]) -> Option<&Plateau> {
    let is_steady = |p: &&Plateau| matches!(p.state, PlateauState::Running | PlateauState::Idle);
    let largest = plateaus.iter().filter(is_steady).map(|p| p.mean.abs()).fold(0.0, f64::max);
    let standing = || plateaus.iter().filter(|p| p.state == PlateauState::Idle);
    let lowest = standing().min_by(|a, b| a.mean.total_cmp(&b.mean))?;
    let follows = |p: &Plateau| {
        let apart = p.mean - lowest.mean;
        p.command != lowest.command
            && apart > FOLLOWS_SHARE * largest
            && apart > FOLLOWS_TIMES_STD * p.mean_std.hypot(lowest.mean_std)
    };
    (lowest.mean < 0.0 && standing().any(follows)).then_some(lowest)
}

fn measured(rows: Range<usize>, late_rows: usize, command: f64, direction: Option<Direction>, y: &[f64]) -> Plateau {
    let mut plateau = Plateau {
        rows,
        command,
        change_s: f64::NAN,
        change_gap_s: None,
        direction,
        mean: 0.0,
        std: 0.0,
        noise_std: 0.0,
        mean_std: 0.0,
        common_std: 0.0,
        late_rows,
        state: PlateauState::NotSteady,
        limited: false,
    };
    let settled = &y[plateau.settled()];
    (plateau.mean, plateau.std) = (mean(settled), variance(settled).sqrt());
    let size = settled.len() / BATCHES;
    if size > 0 {
        let means: Vec<f64> = settled.chunks_exact(size).take(BATCHES).map(mean).collect();
        plateau.mean_std = variance(&means).sqrt() / (means.len() as f64).sqrt();
    }
    plateau
}

/// The runs of plateaus on which the motor runs, as indices: each begins and ends on one that settles, may pass ones that
/// are too short for that, and has two or more that settle.
pub(super) fn runs(plateaus: &[Plateau]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut is_open = false;
    for (k, plateau) in plateaus.iter().enumerate() {
        match (plateau.state, runs.last_mut()) {
            (PlateauState::Running, Some(run)) if is_open => run.end = k + 1,
            (PlateauState::Running, _) => {
                runs.push(k..k + 1);
                is_open = true;
            }
            (PlateauState::Short, _) => {}
            (PlateauState::Idle | PlateauState::NotSteady | PlateauState::Frozen, _) => is_open = false,
        }
    }
    runs.retain(|run| plateaus[run.clone()].iter().filter(|p| p.state == PlateauState::Running).count() > 1);
    runs
}

/// The first row of `first` from which the response stays near its mean: what comes before is start-up
/// and of no use to a lag. `None` when it settles only at the end.
pub(super) fn settled_from(first: &Plateau, y: &[f64]) -> Option<usize> {
    // Chosen: normal noise is beyond five standard deviations once in two million rows; 2 % of the mean holds the ripple of a quiet one.
    let near = (5.0 * first.noise_std).max(0.02 * first.mean.abs());
    let outside = |&k: &usize| (y[k] - first.mean).abs() > near;
    // Half a plateau is settled by definition of its mean; single outliers there do not count.
    let unsettled = first.rows.start..first.settled().start;
    let from = unsettled.rev().find(outside).map_or(first.rows.start, |k| k + 1);
    (from < first.settled().start).then_some(from)
}
