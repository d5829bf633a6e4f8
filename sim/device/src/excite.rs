//! A multisine that the controller plays itself, recorded.

use std::time::Duration;

use rotorlead::excitation::Multisine;
use rotorlead::link::{ChannelState, ExciteRequest, LineSet, RECORD_SAMPLES, Request};
use rotorlead::settings::Settings;
use rotorlead::throttle::Command;
use rotorlead_records::{Excitation, Record};
use web_time::Instant;

use super::recording::{Tape, template};
use super::session::done;
use super::{DeviceError, Recording, Sensors, Session};

/// How often it is asked whether a motor is at rest.
const POLL: Duration = Duration::from_millis(50);

/// What to play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Played {
    /// The motor, from 0.
    pub motor: u8,
    /// The lines.
    pub lines: LineSet,
    /// Command around which they are played, 0..1.
    pub nominal: f64,
    /// Peak deviation from it.
    pub amplitude: f64,
    /// Periods that are kept; one more is played before them, for the transient.
    pub periods: u16,
    /// One row in so many ticks.
    pub divisor: u16,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Excited {
    /// All that was recorded, ramps included.
    pub recording: Recording,
    /// The row at which the kept periods begin.
    pub first_row: usize,
    /// How many rows they have.
    pub rows: usize,
    /// Seconds of a period.
    pub period_s: f64,
}

impl Excited {
    /// The kept periods as a record.
    ///
    /// # Errors
    /// [`DeviceError::NoSpeed`], where the speed is wanted and a row has none.
    pub fn to_record(
        &self,
        played: &Played,
        settings: &Settings,
        file: String,
        sensors: &Sensors,
    ) -> Result<Record, DeviceError> {
        let compensated = settings.motors.get(usize::from(played.motor)).is_some_and(|motor| motor.compensate);
        let template = Record {
            period_s: Some(self.period_s),
            amplitude: Some(played.amplitude),
            ..template(file, played.nominal, Excitation::Multisine, compensated)
        };
        self.recording.to_record(self.first_row, self.rows, f64::from(settings.loop_rate_hz), sensors, template)
    }
}

/// Plays a multisine on the controller and records it. The recorded commands are held against the host's generator, bit
/// for bit, which also says where the periods begin.
///
/// # Errors
/// [`DeviceError`]: the controller refuses, the line loses samples, or what was played is not what was asked for. The
/// excitation is stopped in any case, also where one of the `sensors` is silent. `progress` gets the rows that are there and the rows that there will be.
pub fn play(
    session: &mut Session,
    settings: &Settings,
    played: &Played,
    sensors: &Sensors,
    progress: &dyn Fn(usize, usize),
) -> Result<Excited, DeviceError> {
    let dead_man_ends = session.faults()?.dead_man;
    play_and_record(session, settings, played, sensors, progress).map_err(|error| {
        // Either is what a motor leaves that was stopped.
        let is_cut = matches!(error, DeviceError::NoSpeed { .. } | DeviceError::NotPlayed { .. });
        let is_silent = is_cut && session.faults().is_ok_and(|faults| faults.dead_man != dead_man_ends);
        if is_silent { DeviceError::HostSilent } else { error }
    })
}

fn play_and_record(
    session: &mut Session,
    settings: &Settings,
    played: &Played,
    sensors: &Sensors,
    progress: &dyn Fn(usize, usize),
) -> Result<Excited, DeviceError> {
    let sequence = sequence(settings, played)?;
    let divisor = usize::from(played.divisor.max(1));
    let rows = sequence.len() / divisor * usize::from(played.periods);
    let warm_up_rows = sequence.len() / divisor;
    // Stop pulses come first, and the way up takes its share of the ramp; what is recorded beyond them is cut off.
    let loop_rate_hz = f64::from(settings.loop_rate_hz);
    let before_ms = f64::from(settings.excitation.arm_ms) + f64::from(settings.excitation.ramp_ms);
    let rows_before = before_ms / 1000.0 * loop_rate_hz / divisor as f64;

    let mut tape = Tape::start(session, settings, played.motor, played.divisor.max(1))?;
    let request = ExciteRequest {
        motor: played.motor,
        lines: played.lines,
        nominal: Command::saturating_from_f64(played.nominal).to_bits(),
        amplitude: Command::saturating_from_f64(played.amplitude).to_bits(),
        periods: played.periods.saturating_add(1),
    };
    session.keep_alive(true);
    let mut run = || -> Result<(), DeviceError> {
        done("excite", session.ask_once("excite", &Request::Excite(request))?)?;
        // However long it took to get there; and two frames for the rows that are on their way.
        tape.read_waiting(session)?;
        let before = tape.recording.rows() + 2 * RECORD_SAMPLES;
        let most_rows = before + rows_before.ceil() as usize + warm_up_rows + rows;
        while tape.recording.rows() < most_rows {
            let read = tape.recording.rows();
            tape.read(session)?;
            tape.recording.check_limit(read.., sensors)?;
            // From where the motor turns for sure, up to where it still does: it is not to turn for nothing.
            if read as f64 >= before as f64 + rows_before && read < warm_up_rows + rows {
                tape.recording.check_speed(read.., sensors)?;
            }
            progress(tape.recording.rows().min(most_rows), most_rows);
        }
        Ok(())
    };
    let run = run();
    session.keep_alive(false);
    let failure = run.as_ref().err();
    let halted = match failure {
        // Nobody may be left to hear it, and then the dead-man does the same.
        Some(error) if error.is_of_the_line() => session.send(&Request::StopExcitation).map(drop),
        _ => session.stop_excitation(),
    };
    let stopped = tape.stop(session, failure);
    // Whoever reads of a failure may go near the motor, or play again.
    let rested = match failure {
        Some(error) if error.is_of_the_line() => Ok(()),
        _ => come_to_rest(session, settings, played.motor),
    };
    run?;
    halted?;
    stopped?;
    rested?;
    let recording = tape.recording;
    let start = find(&recording.before, &sequence, divisor, warm_up_rows + rows)
        .ok_or(DeviceError::NotPlayed { rows: warm_up_rows + rows })?;
    let period_s = sequence.len() as f64 / loop_rate_hz;
    Ok(Excited { recording, first_row: start + warm_up_rows, rows, period_s })
}

/// Waits until the way down is over, before which nothing else can be played.
fn come_to_rest(session: &mut Session, settings: &Settings, motor: u8) -> Result<(), DeviceError> {
    let limit = session.limit() + Duration::from_millis(u64::from(settings.excitation.ramp_ms)).mul_f64(1.1);
    let end = Instant::now() + limit;
    while session.info()?.motors.get(usize::from(motor)) == Some(&ChannelState::Excitation) {
        if Instant::now() >= end {
            return Err(DeviceError::NotAtRest { motor, seconds: limit.as_secs_f64() });
        }
        session.pause(POLL)?;
    }
    Ok(())
}

/// One period of the host's own generator.
fn sequence(settings: &Settings, played: &Played) -> Result<Vec<i32>, DeviceError> {
    let amplitude = Command::saturating_from_f64(played.amplitude).to_f64();
    let nominal = Command::saturating_from_f64(played.nominal).to_f64();
    let mut multisine = Multisine::new(played.lines.lines(), nominal, amplitude, f64::from(settings.loop_rate_hz))
        .map_err(|error| DeviceError::Option {
            message: error.to_string(),
            help: "change --nominal, --amplitude or loop_rate_hz",
        })?;
    multisine.start(None);
    let ticks = multisine.ticks_per_period() as usize;
    if !ticks.is_multiple_of(usize::from(played.divisor.max(1))) {
        return Err(DeviceError::Option {
            message: format!("a period of {ticks} ticks is no whole number of rows at --divisor {}", played.divisor),
            help: "choose a divisor of the period",
        });
    }
    Ok((0..ticks).map(|_| multisine.update().to_bits()).collect())
}

/// The first row from which `rows` rows hold the sequence, over and over, one tick in `divisor`.
fn find(recorded: &[i32], sequence: &[i32], divisor: usize, rows: usize) -> Option<usize> {
    let last = recorded.len().checked_sub(rows)?;
    (0..=last).find(|&start| {
        (0..divisor).any(|offset| {
            let mut expected = sequence.iter().cycle().skip(offset).step_by(divisor);
            recorded[start..start + rows].iter().all(|bits| Some(bits) == expected.next())
        })
    })
}
