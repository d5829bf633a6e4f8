//! Requests and their answers.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read as _, Write as _};
use std::time::Duration;

use rotorlead::link::{FRAME_BYTES, Faults, Foreign, Info, Message, Receiver, Record, Request, Source, Tagged, encode};
use rotorlead::settings::{DEAD_MAN_MS, Settings, Warnings};
use web_time::{Instant, UNIX_EPOCH};

use super::{DeviceError, Port};

/// How often a request that may be repeated is sent before giving up.
const ATTEMPTS: u32 = 3;
/// How often the host says that it is there: four times in the [`DEAD_MAN_MS`] after which an excitation ends.
const KEEP_ALIVE: Duration = Duration::from_millis(DEAD_MAN_MS as u64 / 4);
/// A save may have to erase two sectors, which takes up to 2 s each.
const SAVE_LIMIT: Duration = Duration::from_secs(10);

/// A conversation with a controller.
pub struct Session {
    port: Box<dyn Port>,
    address: String,
    limit: Duration,
    receiver: Receiver<Message>,
    /// Messages that were read and not asked for yet.
    inbox: VecDeque<Tagged<Message>>,
    tag: u8,
    /// When the host last said that it is there, while it has to.
    kept_alive: Option<Instant>,
    /// The recording whose records are kept: those of any other are of one that was left running.
    recording: Option<u8>,
}

impl Session {
    /// A conversation over `port`, which errors call `address`; an answer is waited for as long as `limit`.
    #[must_use]
    pub fn new(port: Box<dyn Port>, address: &str, limit: Duration) -> Self {
        let address = address.to_owned();
        let receiver = Receiver::new();
        // Answers to a program that was ended may still be on their way: hardly any has a tag of this one.
        let tag = UNIX_EPOCH.elapsed().map_or(0, |since| since.subsec_micros() as u8);
        Self { port, address, limit, receiver, inbox: VecDeque::new(), tag, kept_alive: None, recording: None }
    }

    /// Who and how the controller is.
    ///
    /// # Errors
    /// [`DeviceError`], as for all requests: the line broke, no answer came, or the controller refused.
    pub fn info(&mut self) -> Result<Info, DeviceError> {
        match self.ask("info", &Request::Info)? {
            Message::Info(info) => Ok(info),
            _ => Err(DeviceError::Unexpected { request: "info" }),
        }
    }

    /// The settings in use.
    ///
    /// # Errors
    /// [`DeviceError`]; [`DeviceError::Impossible`] where no controller could run with them.
    pub fn settings(&mut self) -> Result<Settings, DeviceError> {
        match self.ask("get", &Request::GetSettings)? {
            Message::Settings(settings) => match settings.clone().validate() {
                Ok(_) => Ok(settings),
                Err(error) => Err(DeviceError::Impossible { error }),
            },
            _ => Err(DeviceError::Unexpected { request: "get" }),
        }
    }

    /// Puts settings to use, without storing them.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn set_settings(&mut self, settings: &Settings) -> Result<Warnings, DeviceError> {
        match self.ask("set", &Request::SetSettings(settings.clone()))? {
            Message::SettingsTaken(warnings) => Ok(warnings),
            _ => Err(DeviceError::Unexpected { request: "set" }),
        }
    }

    /// Stores the settings in use.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn save(&mut self) -> Result<(), DeviceError> {
        let limit = self.limit.max(SAVE_LIMIT);
        let tag = self.send(&Request::SaveSettings)?;
        let answer = self.answer(tag, limit, "save")?;
        done("save", answer)
    }

    /// What went wrong on the controller so far.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn faults(&mut self) -> Result<Faults, DeviceError> {
        match self.ask("faults", &Request::Faults)? {
            Message::Faults(faults) => Ok(faults),
            _ => Err(DeviceError::Unexpected { request: "faults" }),
        }
    }

    /// Says where a motor's command comes from.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn set_mode(&mut self, motor: u8, source: Source, compensate: bool) -> Result<(), DeviceError> {
        let answer = self.ask("mode", &Request::SetMode { motor, source, compensate })?;
        done("mode", answer)
    }

    /// Has the controller call its boot loader, which takes another firmware. It is gone then.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn enter_boot_loader(&mut self) -> Result<(), DeviceError> {
        let answer = self.ask_once("bootloader", &Request::BootLoader)?;
        done("bootloader", answer)
    }

    /// Ramps an excitation down.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn stop_excitation(&mut self) -> Result<(), DeviceError> {
        let answer = self.ask("stop", &Request::StopExcitation)?;
        done("stop", answer)
    }

    /// From now on, says every 50 ms that the host is there, or stops doing so. It is said whenever the session waits
    /// for anything, by the clock and not by what arrives; its answers are not waited for.
    pub(super) fn keep_alive(&mut self, alive: bool) {
        self.kept_alive = alive.then(Instant::now);
    }

    /// Has records of the recording of that tag kept until they are asked for.
    pub(super) fn keep_records(&mut self, tag: Option<u8>) {
        self.recording = tag;
    }

    /// Sends a request that may be repeated, and waits for its answer.
    pub(super) fn ask(&mut self, name: &'static str, request: &Request) -> Result<Message, DeviceError> {
        let mut attempt = 1;
        loop {
            let tag = self.send(request)?;
            match self.answer(tag, self.limit, name) {
                Err(DeviceError::NoAnswer { .. }) if attempt < ATTEMPTS => attempt += 1,
                answer => return answer,
            }
        }
    }

    /// Sends a request that must not be repeated, and waits for its answer.
    pub(super) fn ask_once(&mut self, name: &'static str, request: &Request) -> Result<Message, DeviceError> {
        let tag = self.send(request)?;
        self.answer(tag, self.limit, name)
    }

    /// Sends a request, and gives its tag.
    pub(super) fn send(&mut self, request: &Request) -> Result<u8, DeviceError> {
        self.tag = self.tag.wrapping_add(1);
        let sent = self.port.write_all(&frame(self.tag, request)).and_then(|()| self.port.flush());
        sent.map_err(|error| self.broken(&error))?;
        Ok(self.tag)
    }

    /// Waits for the answer to the request of that tag. Other answers are late ones, and dropped; records are kept.
    pub(super) fn answer(&mut self, tag: u8, limit: Duration, request: &'static str) -> Result<Message, DeviceError> {
        let end = Instant::now() + limit;
        loop {
            let is_answer =
                |tagged: &Tagged<Message>| tagged.tag == tag && !matches!(tagged.message, Message::Record(_));
            if let Some(Tagged { message, .. }) = self.take(is_answer) {
                return match message {
                    Message::Refused(refusal) => Err(DeviceError::Refused { request, refusal }),
                    message => Ok(message),
                };
            }
            if Instant::now() >= end {
                return Err(self.silence(request, limit));
            }
            self.read()?;
        }
    }

    /// The next record of the recording of that tag, waited for as long as an answer and `extra`, the time that it takes
    /// to fill.
    pub(super) fn next_record(&mut self, tag: u8, extra: Duration) -> Result<Record, DeviceError> {
        let limit = self.limit + extra;
        let end = Instant::now() + limit;
        loop {
            if let Some(record) = self.waiting_record(tag) {
                return Ok(record);
            }
            if Instant::now() >= end {
                return Err(self.silence("record", limit));
            }
            self.read()?;
        }
    }

    /// The next record of the recording of that tag that has arrived already.
    pub(super) fn waiting_record(&mut self, tag: u8) -> Option<Record> {
        let is_record = |tagged: &Tagged<Message>| tagged.tag == tag && matches!(tagged.message, Message::Record(_));
        match self.take(is_record)?.message {
            Message::Record(record) => Some(record),
            _ => None,
        }
    }

    /// Lets time pass at the line, where there may be no other way to wait.
    pub(super) fn pause(&mut self, time: Duration) -> Result<(), DeviceError> {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.read()?;
        }
        Ok(())
    }

    /// How long an answer is waited for.
    pub(super) fn limit(&self) -> Duration {
        self.limit
    }

    /// The first message of that kind. What came before it is late and dropped, as the answer to a request that was
    /// given up; but for the records that are kept.
    fn take(&mut self, wanted: impl Fn(&Tagged<Message>) -> bool) -> Option<Tagged<Message>> {
        let index = self.inbox.iter().position(wanted)?;
        let message = self.inbox.remove(index);
        let (mut left, recording) = (index, self.recording);
        self.inbox.retain(|tagged| {
            let is_before = left > 0;
            left = left.saturating_sub(1);
            let is_kept = matches!(tagged.message, Message::Record(_)) && Some(tagged.tag) == recording;
            !is_before || is_kept
        });
        message
    }

    /// Reads what there is, for as long as the port waits: [`READ_LIMIT`](super::READ_LIMIT).
    fn read(&mut self) -> Result<(), DeviceError> {
        if self.kept_alive.is_some_and(|last| last.elapsed() >= KEEP_ALIVE) {
            self.kept_alive = Some(Instant::now());
            self.send(&Request::KeepAlive)?;
        }
        let mut bytes = [0; 4096];
        match self.port.read(&mut bytes) {
            Ok(0) => Err(self.broken(&std::io::Error::from(ErrorKind::UnexpectedEof))),
            Ok(length) => {
                let receiver = &mut self.receiver;
                self.inbox.extend(bytes[..length].iter().filter_map(|&byte| receiver.push(byte)));
                match receiver.take_foreign() {
                    Some(Foreign::Notice { version } | Foreign::Message { version, .. }) => {
                        Err(DeviceError::OtherVersion { address: self.address.clone(), version })
                    }
                    None => Ok(()),
                }
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) =>
            {
                Ok(())
            }
            Err(error) => Err(self.broken(&error)),
        }
    }

    fn broken(&self, error: &std::io::Error) -> DeviceError {
        DeviceError::Line { address: self.address.clone(), reason: error.to_string() }
    }

    fn silence(&self, request: &'static str, limit: Duration) -> DeviceError {
        DeviceError::NoAnswer { address: self.address.clone(), request, seconds: limit.as_secs_f64() }
    }
}

/// The bytes that stop an excitation: for whoever cuts the line of a session, which itself sends nothing any more.
#[must_use]
pub fn stop_frame() -> Vec<u8> {
    // No answer is waited for.
    frame(0, &Request::StopExcitation)
}

fn frame(tag: u8, request: &Request) -> Vec<u8> {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(tag, request, &mut frame).expect("a test holds every message to the frame's size");
    frame[..length].to_vec()
}

/// Accepts [`Message::Done`] alone.
pub(super) fn done(request: &'static str, answer: Message) -> Result<(), DeviceError> {
    match answer {
        Message::Done => Ok(()),
        _ => Err(DeviceError::Unexpected { request }),
    }
}
