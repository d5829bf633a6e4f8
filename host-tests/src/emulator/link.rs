//! The host's end of the controller's link.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use rotorlead::link::{
    FRAME_BYTES, Faults, INJECT_SAMPLES, INJECT_WINDOW, Info, InjectRequest, Message, Receiver, Refusal, Request,
    Series, Source, Tagged, encode,
};
use rotorlead::throttle::Command;

use super::{HostLate, PATIENCE};

/// The connection, with what was received of the next message.
pub struct Link {
    stream: TcpStream,
    receiver: Receiver<Message>,
    tag: u8,
}

impl Link {
    pub(super) fn new(stream: TcpStream) -> Self {
        Self { stream, receiver: Receiver::new(), tag: 0 }
    }

    /// What arrives before the UART is switched on is lost, so the first question is repeated until it is answered.
    ///
    /// # Panics
    /// When it is never answered.
    pub fn wait_for_start(&mut self) {
        let start = Instant::now();
        self.stream.set_read_timeout(Some(Duration::from_millis(200))).expect("an open connection");
        let mut byte = [0];
        let mut asked = Instant::now();
        let mut last = self.send(&Request::Info);
        loop {
            assert!(start.elapsed() < PATIENCE, "the controller does not start");
            let read = match self.stream.read(&mut byte) {
                Ok(length) => {
                    assert_eq!(length, 1, "the emulator has closed the link");
                    true
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => false,
                Err(error) => panic!("the emulator's link: {error}"),
            };
            // The answer to the last question, so that no other one is still to come.
            if read && self.receiver.push(byte[0]).is_some_and(|answer| answer.tag == last) {
                break;
            }
            if asked.elapsed() > Duration::from_secs(2) {
                asked = Instant::now();
                last = self.send(&Request::Info);
            }
        }
        self.stream.set_read_timeout(Some(PATIENCE)).expect("an open connection");
    }

    /// Sends a request, and gives its tag.
    pub fn send(&mut self, request: &Request) -> u8 {
        self.tag = self.tag.wrapping_add(1);
        let mut frame = [0; FRAME_BYTES];
        let length = encode(self.tag, request, &mut frame).expect("every request fits a frame");
        self.write(&frame[..length]);
        self.tag
    }

    /// Sends whatever bytes.
    pub fn write(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).expect("the emulator runs");
    }

    /// The next message.
    ///
    /// # Panics
    /// When none comes.
    pub fn receive(&mut self) -> Tagged<Message> {
        let start = Instant::now();
        let mut byte = [0];
        loop {
            self.stream.read_exact(&mut byte).expect("the controller answers");
            if let Some(message) = self.receiver.push(byte[0]) {
                return message;
            }
            assert!(start.elapsed() < PATIENCE, "only garbage from the controller");
        }
    }

    /// Asks, and gives the answer.
    ///
    /// # Panics
    /// When something else comes first.
    pub fn ask(&mut self, request: &Request) -> Message {
        let tag = self.send(request);
        let answer = self.receive();
        assert_eq!(answer.tag, tag, "{:?}", answer.message);
        answer.message
    }

    /// Asks who it is and how.
    ///
    /// # Panics
    /// When it does not say.
    pub fn info(&mut self) -> Info {
        match self.ask(&Request::Info) {
            Message::Info(info) => info,
            other => panic!("{other:?}"),
        }
    }

    /// Asks what went wrong.
    ///
    /// # Panics
    /// When it does not say.
    pub fn faults(&mut self) -> Faults {
        match self.ask(&Request::Faults) {
            Message::Faults(faults) => faults,
            other => panic!("{other:?}"),
        }
    }

    /// Motor 0 takes its commands from here, through its compensator.
    ///
    /// # Panics
    /// When that is refused.
    pub fn take_over(&mut self) {
        let mode = Request::SetMode { motor: 0, source: Source::Inject, compensate: true };
        assert_eq!(self.ask(&mode), Message::Done);
    }

    /// What commands come to for motor 0, of which `first` were sent since it was taken over.
    ///
    /// # Errors
    /// [`HostLate`].
    ///
    /// # Panics
    /// When one is refused otherwise or lost.
    pub fn inject(&mut self, first: u32, commands: &[Command]) -> Result<Vec<i32>, HostLate> {
        let mut outputs = Vec::with_capacity(commands.len());
        let mut blocks = commands.chunks(INJECT_SAMPLES);
        let mut next = first;
        let mut under_way = 0;
        while outputs.len() < commands.len() {
            while under_way < INJECT_WINDOW
                && let Some(block) = blocks.next()
            {
                self.send_commands(next, block);
                next += block.len() as u32;
                under_way += 1;
            }
            outputs.extend(self.injected(first + outputs.len() as u32)?);
            under_way -= 1;
        }
        Ok(outputs)
    }

    /// Sends commands for motor 0, the first of which is number `first`, and does not wait for what they come to.
    ///
    /// # Panics
    /// When they are more than a request has.
    pub fn send_commands(&mut self, first: u32, commands: &[Command]) {
        let bits: Vec<i32> = commands.iter().map(|command| command.to_bits()).collect();
        let samples = Series::try_from(&bits[..]).expect("a block");
        self.send(&Request::Inject(InjectRequest { motor: 0, first, samples }));
    }

    /// What the commands of the oldest request came to, the first of which is number `first`.
    ///
    /// # Errors
    /// [`HostLate`].
    ///
    /// # Panics
    /// When they were refused otherwise or lost.
    pub fn injected(&mut self, first: u32) -> Result<Vec<i32>, HostLate> {
        match self.receive().message {
            Message::Injected(injected) => {
                assert_eq!(injected.first, first);
                Ok(injected.outputs.as_slice().to_vec())
            }
            Message::Refused(Refusal::NotInjecting) => Err(HostLate),
            other => panic!("{other:?}"),
        }
    }
}
