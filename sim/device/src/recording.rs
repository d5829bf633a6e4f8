//! What the controller's recorder sends, as columns.

use std::ops::{Range, RangeFrom};
use std::time::Duration;

use rotorlead::link::{Message, RECORD_SAMPLES, Record as Frame, RecordRequest, Request};
use rotorlead::settings::Settings;
use rotorlead::throttle::Throttle;
use rotorlead_records::{Excitation, Record};

use super::sensors::rpm;
use super::session::done;
use super::{Calibration, DeviceError, Sensors, Session};

/// Samples without a gap, one row each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recording {
    /// Ticks from row to row.
    pub divisor: u32,
    /// The pulse input, Q2.29; negative where there is none.
    pub input: Vec<i32>,
    /// Command before the compensator, Q2.29.
    pub before: Vec<i32>,
    /// Command after it, Q2.29.
    pub after: Vec<i32>,
    /// Counts of the converter.
    pub adc: Vec<i32>,
    /// Microseconds of an electrical turn by the ESC's replies; negative where there is none.
    pub turn_us: Vec<i32>,
}

impl Recording {
    /// Rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.before.len()
    }

    /// Appends a frame of the recorder.
    ///
    /// # Errors
    /// [`DeviceError::SamplesLost`] when it does not follow on the last one: a record with a gap is no record.
    /// [`DeviceError::Unexpected`] when it holds nothing, with which a recording would never end, or is of another rate.
    pub fn append(&mut self, frame: &Frame) -> Result<(), DeviceError> {
        let columns = [&frame.input, &frame.before, &frame.after, &frame.adc, &frame.turn_us];
        let is_whole = frame.divisor > 0 && !frame.before.is_empty();
        let is_of_this = self.rows() == 0 || self.divisor == u32::from(frame.divisor);
        if !is_whole || !is_of_this || columns.iter().any(|column| column.len() != frame.before.len()) {
            return Err(DeviceError::Unexpected { request: "record" });
        }
        self.divisor = u32::from(frame.divisor);
        let expected = (self.rows() as u32).wrapping_mul(self.divisor);
        let gap = frame.first_tick.wrapping_sub(expected);
        if gap != 0 {
            return Err(DeviceError::SamplesLost { missing: gap / self.divisor, tick: expected });
        }
        self.input.extend_from_slice(frame.input.as_slice());
        self.before.extend_from_slice(frame.before.as_slice());
        self.after.extend_from_slice(frame.after.as_slice());
        self.adc.extend_from_slice(frame.adc.as_slice());
        self.turn_us.extend_from_slice(frame.turn_us.as_slice());
        Ok(())
    }

    /// Rows `from..from + rows` as the record of an experiment. The converter is read before the command changes, so a
    /// row is the response at its time, and its command takes effect from then on. The speed is the newest that the ESC had
    /// said by then.
    ///
    /// # Errors
    /// [`DeviceError::NoSpeed`], where the speed is wanted and a row has none.
    pub fn to_record(
        &self,
        from: usize,
        rows: usize,
        loop_rate_hz: f64,
        sensors: &Sensors,
        template: Record,
    ) -> Result<Record, DeviceError> {
        let rows = from.min(self.rows())..(from + rows).min(self.rows());
        let row_s = f64::from(self.divisor) / loop_rate_hz;
        let commands = |bits: &[i32]| bits.iter().map(|&bits| Throttle::from_bits(bits).to_f64()).collect::<Vec<_>>();
        let thrust_n =
            |thrust: Calibration| self.adc[rows.clone()].iter().map(|&count| thrust.thrust_n(count)).collect();
        let rpm = sensors.motor_poles.map(|motor_poles| self.rpm(rows.clone(), motor_poles)).transpose()?;
        Ok(Record {
            time_s: (0..rows.len()).map(|row| row as f64 * row_s).collect(),
            command: commands(&self.before[rows.clone()]),
            command_log: None,
            esc_command: template.compensated.then(|| commands(&self.after[rows.clone()])),
            thrust_n: sensors.thrust.map(thrust_n),
            rpm,
            ..template
        })
    }

    fn rpm(&self, rows: Range<usize>, motor_poles: u8) -> Result<Vec<f64>, DeviceError> {
        rows.map(|row| rpm(self.turn_us[row], motor_poles).ok_or_else(|| self.no_speed(row))).collect()
    }

    /// Whether an ESC whose speed is wanted says it.
    ///
    /// # Errors
    /// [`DeviceError::NoSpeed`], where none of the rows has one.
    pub(super) fn check_speed(&self, rows: RangeFrom<usize>, sensors: &Sensors) -> Result<(), DeviceError> {
        let (first, Some(motor_poles)) = (rows.start, sensors.motor_poles) else { return Ok(()) };
        let is_silent = self.turn_us[rows].iter().all(|&turn_us| rpm(turn_us, motor_poles).is_none());
        if is_silent { Err(self.no_speed(first)) } else { Ok(()) }
    }

    /// Whether the motor is as slow as it has to be.
    ///
    /// # Errors
    /// [`DeviceError::TooFast`], where it is not in one of the rows.
    pub(super) fn check_limit(&self, rows: RangeFrom<usize>, sensors: &Sensors) -> Result<(), DeviceError> {
        let (Some(most_rpm), Some(motor_poles)) = (sensors.most_rpm, sensors.motor_poles) else { return Ok(()) };
        let speeds = self.turn_us[rows].iter().filter_map(|&turn_us| rpm(turn_us, motor_poles));
        match speeds.reduce(f64::max) {
            Some(rpm) if rpm > most_rpm => Err(DeviceError::TooFast { rpm, most_rpm }),
            _ => Ok(()),
        }
    }

    /// The first row of which these sensors say nothing.
    #[must_use]
    pub fn first_without(&self, sensors: &Sensors) -> Option<usize> {
        let motor_poles = sensors.motor_poles?;
        self.turn_us.iter().position(|&turn_us| rpm(turn_us, motor_poles).is_none())
    }

    /// That the ESC gave no speed in this row.
    #[must_use]
    pub fn no_speed(&self, row: usize) -> DeviceError {
        DeviceError::NoSpeed { row, tick: row as u64 * u64::from(self.divisor) }
    }
}

/// A record without columns, that names `compensator.toml` when it is compensated.
#[must_use]
pub fn template(file: String, nominal: f64, excitation: Excitation, compensated: bool) -> Record {
    Record {
        file,
        nominal,
        excitation,
        period_s: None,
        amplitude: None,
        compensated,
        compensator: compensated.then(|| "compensator.toml".into()),
        role: None,
        time_s: Vec::new(),
        command: Vec::new(),
        thrust_n: None,
        rpm: None,
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: rotorlead_records::Setpoints::default(),
    }
}

/// What came of a recording.
#[derive(Debug)]
pub struct Recorded {
    /// The rows that arrived, without a gap.
    pub recording: Recording,
    /// Why there are no more of them, where there should be.
    pub ended: Result<(), DeviceError>,
}

/// Records `rows` rows of a motor as it is driven, one in `divisor` ticks (0: as in the settings). Rows come by frames, so
/// there may be up to a frame more. Nothing is repeated: a gap, or a line that breaks, ends the recording, and the rows
/// before it are given all the same. `progress` gets the rows that are there.
///
/// # Errors
/// [`DeviceError`], where it did not start.
pub fn record(
    session: &mut Session,
    settings: &Settings,
    motor: u8,
    divisor: u16,
    rows: usize,
    progress: &dyn Fn(usize),
) -> Result<Recorded, DeviceError> {
    let mut tape = Tape::start(session, settings, motor, divisor)?;
    let mut run = || -> Result<(), DeviceError> {
        while tape.recording.rows() < rows {
            tape.read(session)?;
            progress(tape.recording.rows().min(rows));
        }
        Ok(())
    };
    let ended = run();
    let stopped = tape.stop(session, ended.as_ref().err());
    Ok(Recorded { recording: tape.recording, ended: ended.and(stopped) })
}

/// A recording that runs.
pub(super) struct Tape {
    tag: u8,
    pub(super) recording: Recording,
    /// How long the controller takes to fill a frame.
    frame: Duration,
}

impl Tape {
    /// Starts it.
    pub(super) fn start(
        session: &mut Session,
        settings: &Settings,
        motor: u8,
        divisor: u16,
    ) -> Result<Self, DeviceError> {
        let ticks = if divisor == 0 { settings.recorder_divisor } else { divisor };
        let frame_s = RECORD_SAMPLES as f64 * f64::from(ticks) / f64::from(settings.loop_rate_hz.max(1));
        let tag = session.send(&Request::Record(Some(RecordRequest { motor, divisor })))?;
        let limit = session.limit();
        done("record", session.answer(tag, limit, "record")?)?;
        session.keep_records(Some(tag));
        Ok(Self { tag, recording: Recording::default(), frame: Duration::from_secs_f64(frame_s) })
    }

    /// Takes the next frame. It may take half as long again as it should: a controller in an emulator is as fast as the
    /// machine under it.
    pub(super) fn read(&mut self, session: &mut Session) -> Result<(), DeviceError> {
        let frame = session.next_record(self.tag, self.frame.mul_f64(1.5))?;
        self.recording.append(&frame)
    }

    /// Takes the frames that have arrived already.
    pub(super) fn read_waiting(&mut self, session: &mut Session) -> Result<(), DeviceError> {
        while let Some(frame) = session.waiting_record(self.tag) {
            self.recording.append(&frame)?;
        }
        Ok(())
    }

    /// Stops it. After a `failure` of the line no answer is waited for.
    pub(super) fn stop(&self, session: &mut Session, failure: Option<&DeviceError>) -> Result<(), DeviceError> {
        session.keep_records(None);
        let request = Request::Record(None);
        if failure.is_some_and(DeviceError::is_of_the_line) {
            return session.send(&request).map(drop);
        }
        match session.ask("record", &request)? {
            Message::Done => Ok(()),
            _ => Err(DeviceError::Unexpected { request: "record" }),
        }
    }
}
