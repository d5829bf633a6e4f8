//! A chain over a whole record.

use super::{Actuator, PlantError, Segment};

/// Commands and the moments at which they take effect.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// When each command takes effect, seconds, increasing. The first is where the clock of the rows starts too.
    pub time_s: &'a [f64],
    /// The commands, 0..1; each holds until the next, the last one for ever.
    pub command: &'a [f64],
}

/// What was before the first command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Rest: the given command has been there for ever.
    Rest(f64),
    /// The drive is one or more periods, and the end of one has just run, beginning at rest at its mean command: enough for
    /// what forgets faster than that.
    Running {
        /// The period, seconds.
        period_s: f64,
        /// How much of its end, seconds, at most all of it.
        lead_s: f64,
    },
    /// The drive is one or more periods, the first of which has run some times before, beginning at rest at its mean command.
    Periodic {
        /// The period, seconds.
        period_s: f64,
        /// How often.
        periods: u32,
    },
}

/// What the rows of a record show, without noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The response: newtons or revolutions per minute, as the model has it.
    pub response: Vec<f64>,
    /// The speed, as the command that would keep it; affine to revolutions per minute.
    pub speed: Vec<f64>,
    /// Volts, where an effect of the supply says the voltage without load; else empty.
    pub voltage_v: Vec<f64>,
    /// Amperes; with `voltage_v`.
    pub current_a: Vec<f64>,
}

/// Runs `actuator`, which is new, on `drive` and gives what a logger sees at `rows_s` (increasing, on the clock of the drive:
/// a record's own `time_s` where each row has a command). The ESC's frames count from the first command.
///
/// A row at the moment of a change sees the response that the change has not yet moved. Rows of a logger whose clock is
/// another one ([`clock_skew`](super::effect)) are taken when that clock says so; before the first command there is the
/// start.
///
/// # Errors
/// [`PlantError::Setting`] for a drive without commands or with a time per command missing, and for a period that is not
/// above 0.
pub fn simulate(actuator: &mut Actuator, drive: Drive, start: Start, rows_s: &[f64]) -> Result<Trace, PlantError> {
    begin(actuator, (drive, Course::Held), start)?;
    let (count, zero_s) = (drive.time_s.len(), drive.time_s[0]);
    let mut trace = Trace::default();
    trace.response.reserve(rows_s.len());
    trace.speed.reserve(rows_s.len());
    let mut next = 0;
    let mut command = drive.command[0];
    for &row_s in rows_s {
        let moment_s = actuator.moment_of_row(row_s - zero_s);
        // Commands that begin at or before the row; that at the row itself moves nothing yet.
        while next < count && drive.time_s[next] - zero_s <= moment_s {
            actuator.advance(command, drive.time_s[next] - zero_s);
            command = drive.command[next];
            next += 1;
        }
        actuator.advance(command, moment_s);
        trace.take(actuator);
    }
    Ok(trace)
}

/// How a command gets from one of a drive to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Course {
    /// It holds.
    Held,
    /// In a straight line.
    Straight,
}

/// [`simulate`] for the response alone. What is integrated in steps need not stop at every row, and goes over many of them
/// at a time where the command stays; the response in between is off by less than the steps are.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_response(
    actuator: &mut Actuator,
    drive: Drive,
    start: Start,
    rows_s: &[f64],
) -> Result<Vec<f64>, PlantError> {
    simulate_course(actuator, (drive, Course::Held), start, rows_s)
}

/// The same on another course.
pub(crate) fn simulate_course(
    actuator: &mut Actuator,
    (drive, course): (Drive, Course),
    start: Start,
    rows_s: &[f64],
) -> Result<Vec<f64>, PlantError> {
    begin(actuator, (drive, course), start)?;
    let zero_s = drive.time_s[0];
    let moments: Vec<f64> = rows_s.iter().map(|row_s| actuator.moment_of_row(row_s - zero_s)).collect();
    let now_s = actuator.now_s();
    let early = moments.partition_point(|moment_s| *moment_s <= now_s);
    let mut response = Vec::with_capacity(rows_s.len());
    response.resize(early, actuator.response());
    let Some(&end_s) = moments[early..].last() else { return Ok(response) };
    // Up to the last row, which may be before the last command, or after it.
    let begun = drive.time_s.partition_point(|time_s| time_s - zero_s < end_s);
    let pieces = (0..begun).map(|place| {
        let piece = piece(drive, course, place, f64::INFINITY);
        Segment { until_s: piece.until_s.min(end_s), ..piece }
    });
    actuator.pass(pieces, &moments[early..], &mut response);
    Ok(response)
}

/// The piece that begins with a command, on the clock of the drive; the last one ends at `end_s`.
#[inline]
fn piece(drive: Drive, course: Course, place: usize, end_s: f64) -> Segment {
    let zero_s = drive.time_s[0];
    let level = drive.command[place];
    let until_s = drive.time_s.get(place + 1).map_or(end_s, |time_s| time_s - zero_s);
    let slope_per_s = match course {
        Course::Held => 0.0,
        // What repeats goes back to its first command.
        Course::Straight if until_s.is_finite() => {
            let next = drive.command.get(place + 1).unwrap_or(&drive.command[0]);
            (next - level) / (until_s - (drive.time_s[place] - zero_s))
        }
        Course::Straight => 0.0,
    };
    Segment { level, slope_per_s, until_s }
}

/// [`simulate_response`] where the drive is whole periods of `period_rows` rows: what repeats by then is not run again.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_periodic_response(
    actuator: &mut Actuator,
    drive: Drive,
    start: Start,
    rows_s: &[f64],
    period_rows: usize,
) -> Result<Vec<f64>, PlantError> {
    simulate_periodic_course(actuator, (drive, Course::Held), start, rows_s, period_rows)
}

/// The same on another course.
pub(crate) fn simulate_periodic_course(
    actuator: &mut Actuator,
    (drive, course): (Drive, Course),
    start: Start,
    rows_s: &[f64],
    period_rows: usize,
) -> Result<Vec<f64>, PlantError> {
    let all = rows_s.len();
    let Some(period_s) = rows_s.get(period_rows).map(|row_s| row_s - rows_s[0]) else {
        return simulate_course(actuator, (drive, course), start, rows_s);
    };
    let lead_s = match start {
        Start::Rest(_) => 0.0,
        Start::Running { lead_s, .. } => lead_s,
        Start::Periodic { periods, .. } => f64::from(periods) * period_s,
    };
    let Some(after_s) = actuator.repeats_after_s(period_s).map(|after_s| after_s - lead_s) else {
        return simulate_course(actuator, (drive, course), start, rows_s);
    };
    let from_s = drive.time_s.first().map_or(0.0, |first_s| first_s + after_s.max(0.0));
    let once = (rows_s.partition_point(|row_s| *row_s <= from_s) + period_rows).min(all);
    let mut response = simulate_course(actuator, (drive, course), start, &rows_s[..once])?;
    response.reserve(all - once);
    for row in once..all {
        response.push(response[row - period_rows]);
    }
    Ok(response)
}

/// Brings an actuator to the begin of a record.
fn begin(actuator: &mut Actuator, (drive, course): (Drive, Course), start: Start) -> Result<(), PlantError> {
    let count = drive.time_s.len();
    if count == 0 || drive.command.len() != count {
        let value = drive.command.len() as f64;
        return Err(PlantError::Setting { parameter: "commands", value, limit: "one per time, and at least one" });
    }
    match start {
        Start::Rest(command) => actuator.settle(command),
        Start::Periodic { period_s, periods } => {
            let period = one_period(drive, period_s)?;
            actuator.settle(mean(period, period_s));
            actuator.begin_at(-f64::from(periods) * period_s);
            for repeat in (1..=periods).rev() {
                run_in(actuator, (period, course), period_s, -f64::from(repeat) * period_s);
            }
        }
        Start::Running { period_s, lead_s } => {
            let period = one_period(drive, period_s)?;
            actuator.settle(mean(period, period_s));
            actuator.begin_at(-lead_s.clamp(0.0, period_s));
            run_in(actuator, (period, course), period_s, -period_s);
        }
    }
    actuator.begin_at(0.0);
    actuator.start_record();
    Ok(())
}

impl Trace {
    fn take(&mut self, actuator: &Actuator) {
        self.response.push(actuator.response());
        self.speed.push(actuator.speed());
        if let Some(supply) = actuator.supply() {
            self.voltage_v.push(supply.voltage_v);
            self.current_a.push(supply.current_a);
        }
    }
}

fn one_period(drive: Drive, period_s: f64) -> Result<Drive, PlantError> {
    if !(period_s.is_finite() && period_s > 0.0) {
        return Err(PlantError::Setting { parameter: "period_s", value: period_s, limit: "finite and above 0" });
    }
    let length = drive.time_s.partition_point(|time_s| time_s - drive.time_s[0] < period_s * (1.0 - 1e-12));
    Ok(Drive { time_s: &drive.time_s[..length], command: &drive.command[..length] })
}

/// Lets a period that begins at `begin_s` pass, or what of it is still to come.
fn run_in(actuator: &mut Actuator, (period, course): (Drive, Course), period_s: f64, begin_s: f64) {
    let now_s = actuator.now_s();
    let begun = period.time_s.partition_point(|time_s| time_s - period.time_s[0] + begin_s <= now_s);
    let pieces = (begun.saturating_sub(1)..period.command.len()).map(|place| {
        let piece = piece(period, course, place, period_s);
        let late_s = (now_s - (period.time_s[place] - period.time_s[0] + begin_s)).max(0.0);
        Segment { level: piece.level + piece.slope_per_s * late_s, until_s: piece.until_s + begin_s, ..piece }
    });
    actuator.pass(pieces, &[], &mut Vec::new());
}

/// Mean command over a period.
fn mean(period: Drive, period_s: f64) -> f64 {
    let (zero_s, last) = (period.time_s[0], period.time_s.len() - 1);
    let pairs = period.time_s.windows(2).zip(period.command);
    let inner: f64 = pairs.map(|(pair, command)| command * (pair[1] - pair[0])).sum();
    (inner + period.command[last] * (period_s - (period.time_s[last] - zero_s))) / period_s
}
