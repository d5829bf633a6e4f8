//! Simulates an actuator over a whole record.

use super::command_signal::{CommandSignal, Interpolation};
use super::pieces::Pieces;
use super::{Actuator, Memory, PlantError};

/// Levels that differ by no more, as commands, are the same but for rounding. Chosen: half the controller's own step of a command, 2^-29,
/// and far above what rounding makes of one.
const SAME_LEVEL: f64 = 1e-9;
/// The part of a period after which most commands have put what is kept where it would be anyway. Chosen: where it suffices it saves seven
/// eighths of the run-in, and where not it costs an eighth more.
const SHORTER_LEAD: f64 = 0.125;

/// What was before the first command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Rest: the given command has been there for ever.
    Rest(f64),
    /// The drive is one or more periods, and the end of one has just run, beginning at rest at its mean command: enough for
    /// what forgets faster than that.
    PartOfPeriod {
        /// The period, seconds.
        period_s: f64,
        /// How much of its end, seconds, at most all of it.
        lead_s: f64,
    },
    /// The drive is one or more periods, the first of which has run some times before, beginning at rest at its mean command.
    WholePeriods {
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
///
/// # Examples
///
/// A step, and the response after one time constant:
///
/// ```
/// use rotorlead_plant::{Actuator, CommandSignal, EscTiming, Law, Model, Start, simulate};
///
/// let motor: Model = toml::from_str("
///     format = 1
///     [[point]]
///     nominal = 0.5
///     gain = 10.0
///     time_constant_s = 0.1
/// ")?;
/// let mut actuator = Actuator::new(&motor, Law::LinearAround(0.5), EscTiming::default())?;
/// let step = CommandSignal { time_s: &[0.0], command: &[0.6] };
///
/// let trace = simulate(&mut actuator, step, Start::Rest(0.5), &[0.0, 0.1])?;
/// assert!((trace.response[1] - trace.response[0] - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate(
    actuator: &mut Actuator,
    drive: CommandSignal,
    start: Start,
    rows_s: &[f64],
) -> Result<Trace, PlantError> {
    begin(actuator, (drive, Interpolation::ZeroOrderHold), start)?;
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

/// [`simulate`] for the response alone. What is integrated in steps need not stop at every row, and goes over many of them
/// at a time where the command stays; the response in between is off by less than the steps are.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_response(
    actuator: &mut Actuator,
    drive: CommandSignal,
    start: Start,
    rows_s: &[f64],
) -> Result<Vec<f64>, PlantError> {
    simulate_interpolated(actuator, (drive, Interpolation::ZeroOrderHold), start, rows_s)
}

/// The same with another interpolation of the commands.
pub fn simulate_interpolated(
    actuator: &mut Actuator,
    (drive, interpolation): (CommandSignal, Interpolation),
    start: Start,
    rows_s: &[f64],
) -> Result<Vec<f64>, PlantError> {
    Ok(Run::begin(actuator, (drive, interpolation), start, rows_s)?.finished())
}

/// [`simulate_response`] where the command signal is whole periods of `period_rows` rows. Once the response repeats, further periods are
/// copied, not simulated. With [`Start::PartOfPeriod`] the pre-roll is shortened if the stages with turning-point memory then repeat after
/// one period.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_periodic_response(
    actuator: &mut Actuator,
    drive: CommandSignal,
    start: Start,
    rows_s: &[f64],
    period_rows: usize,
) -> Result<Vec<f64>, PlantError> {
    simulate_periodic_interpolated(actuator, (drive, Interpolation::ZeroOrderHold), start, rows_s, period_rows)
}

/// The same with another interpolation of the commands.
pub fn simulate_periodic_interpolated(
    actuator: &mut Actuator,
    (drive, interpolation): (CommandSignal, Interpolation),
    start: Start,
    rows_s: &[f64],
    period_rows: usize,
) -> Result<Vec<f64>, PlantError> {
    let Some(period_s) = rows_s.get(period_rows).map(|row_s| row_s - rows_s[0]) else {
        return simulate_interpolated(actuator, (drive, interpolation), start, rows_s);
    };
    let lead_s = match start {
        Start::Rest(_) => 0.0,
        Start::PartOfPeriod { lead_s, .. } => lead_s,
        Start::WholePeriods { periods, .. } => f64::from(periods) * period_s,
    };
    let Some(fades_s) = actuator.fades_in_s(period_s) else {
        return simulate_interpolated(actuator, (drive, interpolation), start, rows_s);
    };
    let memory = actuator.memory();
    if matches!(memory, Memory::TurningPoints(_))
        && let Start::PartOfPeriod { period_s: of_s, lead_s } = start
    {
        // What is kept mostly comes of the last few commands: then the end of the period says the same as all of it. Not so of
        // the stairs of a dead band, which may come back to any of several ways.
        let shorter_s = fades_s + SHORTER_LEAD * of_s;
        if shorter_s < lead_s {
            let start = Start::PartOfPeriod { period_s: of_s, lead_s: shorter_s };
            let mut run = Run::begin(actuator, (drive, interpolation), start, rows_s)?;
            if run.memory_repeats(0.0, period_s) == Some(true) {
                return Ok(run.repeated(0.0, period_rows));
            }
        }
    }
    let mut run = Run::begin(actuator, (drive, interpolation), start, rows_s)?;
    let after_s = match memory {
        Memory::Seconds(_) => Some((fades_s - lead_s).max(0.0)),
        Memory::TurningPoints(_) | Memory::Lasting => run.repeat_from_s(period_s, fades_s, lead_s),
    };
    Ok(match after_s {
        Some(after_s) => run.repeated(after_s, period_rows),
        None => run.finished(),
    })
}

/// A drive that has begun.
struct Run<'a> {
    actuator: &'a mut Actuator,
    commands: Pieces<'a>,
    /// When rows are taken, seconds.
    moments_s: Vec<f64>,
    /// The response at those that are past.
    response: Vec<f64>,
}

impl<'a> Run<'a> {
    fn begin(
        actuator: &'a mut Actuator,
        (drive, interpolation): (CommandSignal<'a>, Interpolation),
        start: Start,
        rows_s: &[f64],
    ) -> Result<Self, PlantError> {
        begin(actuator, (drive, interpolation), start)?;
        let zero_s = drive.time_s[0];
        let moments_s: Vec<f64> = rows_s.iter().map(|row_s| actuator.moment_of_row(row_s - zero_s)).collect();
        let now_s = actuator.now_s();
        let early = moments_s.partition_point(|moment_s| *moment_s <= now_s);
        let mut response = Vec::with_capacity(rows_s.len());
        response.resize(early, actuator.response());
        let commands = Pieces::new(drive, interpolation, (0.0, f64::INFINITY), now_s);
        Ok(Self { actuator, commands, moments_s, response })
    }

    /// Goes on up to `until_s`.
    fn up_to(&mut self, until_s: f64) {
        let rest = &self.moments_s[self.response.len()..];
        let due = &rest[..rest.partition_point(|moment_s| *moment_s <= until_s)];
        self.actuator.pass(&mut self.commands, until_s, due, &mut self.response);
    }

    /// The response at all rows, the last of which may be before the last command, or after it.
    fn finished(mut self) -> Vec<f64> {
        if let Some(&end_s) = self.moments_s.last() {
            self.up_to(end_s);
        }
        self.response
    }

    /// The same where it repeats from `after_s` on, every `period_rows` rows.
    fn repeated(mut self, after_s: f64, period_rows: usize) -> Vec<f64> {
        let all = self.moments_s.len();
        let once = (self.moments_s.partition_point(|moment_s| *moment_s <= after_s) + period_rows).min(all);
        self.up_to(self.moments_s[once - 1]);
        for row in self.response.len()..all {
            self.response.push(self.response[row - period_rows]);
        }
        self.response
    }

    /// Whether stages keep the same after another `period_s` from `from_s` on, up to which it goes on. `None` where a stage does
    /// not say what it keeps.
    fn memory_repeats(&mut self, from_s: f64, period_s: f64) -> Option<bool> {
        self.up_to(from_s);
        let before = self.actuator.kept()?;
        self.up_to(from_s + period_s);
        let after = self.actuator.kept()?;
        Some(before.iter().zip(&after).all(|(before, after)| (before - after).abs() <= SAME_LEVEL))
    }

    /// Seconds after the record's start from which the response repeats every `period_s`. The command has repeated since `lead_s` before
    /// the start; earlier history shows for `fades_s`. Compares the memory of the stages period by period, which advances the actuator.
    /// `None` if the record ends first, or a stage does not tell its memory.
    fn repeat_from_s(&mut self, period_s: f64, fades_s: f64, lead_s: f64) -> Option<f64> {
        let end_s = self.moments_s.last().copied()?;
        let mut from_s = (fades_s - lead_s).max(0.0);
        while from_s + period_s + fades_s < end_s {
            if self.memory_repeats(from_s, period_s)? {
                // What is behind the stages follows them.
                return Some(from_s + fades_s);
            }
            from_s += period_s;
        }
        None
    }
}

/// Brings an actuator to the begin of a record.
fn begin(
    actuator: &mut Actuator,
    (drive, interpolation): (CommandSignal, Interpolation),
    start: Start,
) -> Result<(), PlantError> {
    let count = drive.time_s.len();
    if count == 0 || drive.command.len() != count {
        let value = drive.command.len() as f64;
        return Err(PlantError::Setting { parameter: "commands", value, limit: "one per time, and at least one" });
    }
    match start {
        Start::Rest(command) => actuator.settle(command),
        Start::WholePeriods { period_s, periods } => {
            let period = one_period(drive, period_s)?;
            actuator.settle(mean(period, period_s));
            actuator.begin_at(-f64::from(periods) * period_s);
            for repeat in (1..=periods).rev() {
                run_in(actuator, (period, interpolation), period_s, -f64::from(repeat) * period_s);
            }
        }
        Start::PartOfPeriod { period_s, lead_s } => {
            let period = one_period(drive, period_s)?;
            actuator.settle(mean(period, period_s));
            actuator.begin_at(-lead_s.clamp(0.0, period_s));
            run_in(actuator, (period, interpolation), period_s, -period_s);
        }
    }
    actuator.begin_at(0.0);
    actuator.start_record();
    Ok(())
}

impl Trace {
    fn take(&mut self, actuator: &Actuator) {
        self.response.push(actuator.response());
        self.speed.push(actuator.equivalent_command());
        if let Some(supply) = actuator.supply_measurement() {
            self.voltage_v.push(supply.voltage_v);
            self.current_a.push(supply.current_a);
        }
    }
}

fn one_period(drive: CommandSignal, period_s: f64) -> Result<CommandSignal, PlantError> {
    if !(period_s.is_finite() && period_s > 0.0) {
        return Err(PlantError::Setting { parameter: "period_s", value: period_s, limit: "finite and above 0" });
    }
    // Chosen: 1e-12 is above the rounding of a time, and far below a row of any period.
    let length = drive.time_s.partition_point(|time_s| time_s - drive.time_s[0] < period_s * (1.0 - 1e-12));
    Ok(CommandSignal { time_s: &drive.time_s[..length], command: &drive.command[..length] })
}

/// Lets a period that begins at `begin_s` pass, or what of it is still to come.
fn run_in(
    actuator: &mut Actuator,
    (period, interpolation): (CommandSignal, Interpolation),
    period_s: f64,
    begin_s: f64,
) {
    let end_s = begin_s + period_s;
    let mut commands = Pieces::new(period, interpolation, (begin_s, end_s), actuator.now_s());
    actuator.pass(&mut commands, end_s, &[], &mut Vec::new());
}

/// Mean command over a period.
fn mean(period: CommandSignal, period_s: f64) -> f64 {
    let (zero_s, last) = (period.time_s[0], period.time_s.len() - 1);
    let pairs = period.time_s.windows(2).zip(period.command);
    let inner: f64 = pairs.map(|(pair, command)| command * (pair[1] - pair[0])).sum();
    (inner + period.command[last] * (period_s - (period.time_s[last] - zero_s))) / period_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalog;
    use crate::testing::{active, actuator};

    #[test]
    fn what_stages_keep_tells_when_the_response_repeats() {
        let time_s: Vec<f64> = (0..3000_u32).map(|row| f64::from(row) * 0.01).collect();
        let period_s = 10.0;
        let sine = |time_s: &f64| 0.5 + 0.05 * (std::f64::consts::TAU * 3.0 * time_s / period_s).sin();
        let command: Vec<f64> = time_s[..1000].iter().map(sine).collect::<Vec<_>>().repeat(3);
        let drive = (CommandSignal { time_s: &time_s, command: &command }, Interpolation::ZeroOrderHold);
        // The limit of the rate meets the command late in the first period only, so that takes one more.
        for (kind, value, periods) in [("dead_band", 0.01, 0.0), ("backlash", 0.01, 0.0), ("slew_limit", 0.05, 1.0)] {
            let effects = [active(Catalog::standard().find(kind).unwrap(), &[value])];
            let mut actuator = actuator(&effects);
            let fades_s = actuator.fades_in_s(period_s).unwrap();
            let mut run = Run::begin(&mut actuator, drive, Start::Rest(0.5), &time_s).unwrap();
            let repeats_s = run.repeat_from_s(period_s, fades_s, 0.0);
            assert_eq!(repeats_s, Some(fades_s + periods * period_s + fades_s), "{kind}");
        }
        // A limit so slow that it goes on for periods before it goes to and fro by the same way.
        let mut slow = actuator(&[active(Catalog::standard().find("slew_limit").unwrap(), &[0.002])]);
        let fades_s = slow.fades_in_s(period_s).unwrap();
        let mut run = Run::begin(&mut slow, drive, Start::Rest(0.9), &time_s).unwrap();
        assert_eq!(run.repeat_from_s(period_s, fades_s, 0.0), None);
    }

    #[test]
    fn the_stairs_of_a_dead_band_on_a_triangle_begin_where_all_of_the_period_before_left_them() {
        // On a slow triangle stairs go to and fro on whatever levels they began with: each of these repeats.
        let (period_s, rows) = (10.0, 1000);
        let time_s: Vec<f64> = (0..3 * rows).map(|row| row as f64 * 0.01).collect();
        let triangle = |row: usize| {
            let part = (row % rows) as f64 / rows as f64;
            0.5 + 0.05 * (1.0 - 4.0 * ((part + 0.25) % 1.0 - 0.5).abs())
        };
        let command: Vec<f64> = (0..3 * rows).map(triangle).collect();
        let drive = CommandSignal { time_s: &time_s, command: &command };
        let effects = [active(Catalog::standard().find("dead_band").unwrap(), &[0.0121])];
        let after = |lead_s: f64| {
            simulate_response(&mut actuator(&effects), drive, Start::PartOfPeriod { period_s, lead_s }, &time_s)
                .unwrap()
        };
        let start = Start::PartOfPeriod { period_s, lead_s: period_s };
        let once = simulate_periodic_response(&mut actuator(&effects), drive, start, &time_s, rows).unwrap();
        let apart = |other: &[f64]| once.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let fades_s = actuator(&effects).fades_in_s(period_s).unwrap();
        let (whole, short) = (apart(&after(period_s)), apart(&after(fades_s + SHORTER_LEAD * period_s)));
        assert!(whole < 1e-9 && short > 1e-3, "{whole:e} N, {short:e} N");
    }
}
