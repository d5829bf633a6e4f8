//! Commands from the host, sample by sample, and what the controller makes of them, beside what the same code makes of
//! them here.

use std::collections::VecDeque;
use std::time::Duration;

use rotorlead::channel::Channel;
use rotorlead::controller::{channels, filters};
use rotorlead::link::{INJECT_SAMPLES, INJECT_WINDOW, InjectRequest, Message, Request, Series, Source};
use rotorlead::settings::Settings;
use rotorlead::throttle::{Command, EscCommand};

use super::{DeviceError, Session};

/// What came of an injection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Injection {
    /// What the controller would have sent to the ESC, one for each command.
    pub outputs: Vec<EscCommand>,
    /// How many of them are not the host's.
    pub different: usize,
    /// The first of those.
    pub first_difference: Option<Difference>,
}

/// An output that is not the host's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Number of the sample, from 0.
    pub sample: usize,
    /// What the host has.
    pub host: EscCommand,
    /// What the controller has.
    pub controller: EscCommand,
}

/// The path of a motor as the controller makes it of `settings`: channel, limits and compensator.
///
/// # Errors
/// [`DeviceError::Option`]: there is no such motor, or a controller could not run with these settings.
pub fn path(settings: &Settings, motor: u8, compensate: bool) -> Result<Channel, DeviceError> {
    let refused = |message: String| DeviceError::Option {
        message: format!("the controller's settings do not make a path here: {message}"),
        help: "flash the firmware that belongs to this program",
    };
    let settings = settings.clone().validate().map_err(|error| refused(error.to_string()))?;
    let filters = filters(&settings).map_err(|error| refused(error.to_string()))?;
    let channels = channels(&settings, filters).ok_or_else(|| refused("limits out of order".into()))?;
    let count = channels.len();
    let mut channel = channels.into_iter().nth(usize::from(motor)).ok_or_else(|| DeviceError::Option {
        message: format!("there is no motor {motor}"),
        help: if count == 4 { "give a motor from 0 to 3" } else { "count motors from 0" },
    })?;
    channel.set_enabled(compensate);
    Ok(channel)
}

/// Sends `commands` to a motor's path, one per control tick, and gives what it would have sent to the ESC, held against
/// [`path`] bit for bit. The path starts afresh, so the motor turns only once a disarmed command was among them, and
/// afterwards is given back to the pulses. `progress` gets the outputs that are there.
///
/// [`INJECT_WINDOW`] requests are kept under way: while the controller works on one, the next one arrives.
///
/// # Errors
/// [`DeviceError`]; also when a frame is lost on the way: the path's state is then not known any more, so nothing is
/// repeated.
pub fn inject(
    session: &mut Session,
    settings: &Settings,
    motor: u8,
    compensate: bool,
    commands: &[Command],
    progress: &dyn Fn(usize),
) -> Result<Injection, DeviceError> {
    let host = path(settings, motor, compensate)?;
    let own = settings.motors.get(usize::from(motor)).is_some_and(|motor| motor.compensate);
    session.set_mode(motor, Source::Inject, compensate)?;
    let streamed = Stream::new(session, settings, motor).run(commands, progress);
    let released = match &streamed {
        Err(error) if error.is_of_the_line() => {
            // Without samples it falls back to its pulses by itself.
            session.send(&Request::SetMode { motor, source: Source::Pulse, compensate: own }).map(drop)
        }
        _ => session.set_mode(motor, Source::Pulse, own),
    };
    let outputs = streamed?;
    released?;
    Ok(compare(host, commands, outputs))
}

fn compare(mut host: Channel, commands: &[Command], outputs: Vec<EscCommand>) -> Injection {
    let (mut different, mut first_difference) = (0, None);
    for (sample, (&command, &controller)) in commands.iter().zip(&outputs).enumerate() {
        let host = host.inject(command);
        if host != controller {
            different += 1;
            first_difference.get_or_insert(Difference { sample, host, controller });
        }
    }
    Injection { outputs, different, first_difference }
}

/// Requests on their way, and the outputs so far.
struct Stream<'a> {
    session: &'a mut Session,
    motor: u8,
    /// How long the controller takes for a full window.
    window: Duration,
    sent: usize,
    /// Tag and length of each request without an answer.
    under_way: VecDeque<(u8, usize)>,
    outputs: Vec<EscCommand>,
}

impl<'a> Stream<'a> {
    fn new(session: &'a mut Session, settings: &Settings, motor: u8) -> Self {
        let window_s = (INJECT_WINDOW * INJECT_SAMPLES) as f64 / f64::from(settings.loop_rate_hz.max(1));
        let window = Duration::from_secs_f64(window_s);
        Self { session, motor, window, sent: 0, under_way: VecDeque::new(), outputs: Vec::new() }
    }

    fn run(mut self, commands: &[Command], progress: &dyn Fn(usize)) -> Result<Vec<EscCommand>, DeviceError> {
        self.outputs.reserve(commands.len());
        for block in commands.chunks(INJECT_SAMPLES) {
            if self.under_way.len() == INJECT_WINDOW {
                self.collect()?;
                progress(self.outputs.len());
            }
            self.send(block)?;
        }
        while !self.under_way.is_empty() {
            self.collect()?;
        }
        progress(self.outputs.len());
        // A controller lets go only of a motor that is at a stop.
        self.send(&[Command::ZERO])?;
        self.collect()?;
        self.outputs.pop();
        Ok(self.outputs)
    }

    fn send(&mut self, block: &[Command]) -> Result<(), DeviceError> {
        let mut samples = Series::new();
        for command in block {
            samples.push(command.to_bits()).expect("a block is as long as a request");
        }
        // Numbers wrap, as the controller's do.
        let request = InjectRequest { motor: self.motor, first: self.sent as u32, samples };
        self.under_way.push_back((self.session.send(&Request::Inject(request))?, block.len()));
        self.sent += block.len();
        Ok(())
    }

    /// Waits for the answer to the oldest request.
    fn collect(&mut self) -> Result<(), DeviceError> {
        let Some((tag, expected)) = self.under_way.pop_front() else { return Ok(()) };
        let limit = self.session.limit() + self.window;
        let Message::Injected(injected) = self.session.answer(tag, limit, "inject")? else {
            return Err(DeviceError::Unexpected { request: "inject" });
        };
        let (got, first) = (injected.outputs.len(), self.outputs.len() as u32);
        if got != expected || injected.first != first {
            return Err(DeviceError::Outputs { first, expected, got });
        }
        self.outputs.extend(injected.outputs.as_slice().iter().map(|&bits| EscCommand::from_bits(bits)));
        Ok(())
    }
}
