//! From received bytes to sent ones.

use embedded_storage::nor_flash::NorFlash;

use super::{ControlAccess, RequestHandler};
use crate::link::{Foreign, FrameFaults, Message, Receiver, Request, Tagged, Writer};

/// Bytes of each wire that are looked at in one poll at most.
const POLL_BYTES: usize = 256;

/// A [`RequestHandler`] with the link around it.
///
/// Requests and what the handler sends unasked (records, outputs of injected commands) take turns. Were either served first
/// whenever there is any, the other would starve: a recording that is faster than the line could not be stopped, nor an
/// excitation beside it kept alive; and a host that asks without a pause would get no records.
///
/// Of several wires, the one that the last request came on has the link: what is sent unasked goes there.
pub struct Server<F, const WIRES: usize = 1> {
    handler: RequestHandler<F>,
    receivers: [Receiver<Request>; WIRES],
    writer: Writer,
    /// The wire that has the link.
    wire: usize,
    /// The wire that the message in the writer is for.
    written_to: usize,
    /// The last message was unasked for.
    has_streamed: bool,
}

impl<F: NorFlash, const WIRES: usize> Server<F, WIRES> {
    /// With nothing received or to be sent.
    pub const fn new(handler: RequestHandler<F>) -> Self {
        let receivers = [const { Receiver::new() }; WIRES];
        Self { handler, receivers, writer: Writer::new(), wire: 0, written_to: 0, has_streamed: false }
    }

    /// The next byte to the host, for the wire [`Self::written_to`].
    pub fn next_byte(&mut self) -> Option<u8> {
        self.writer.next_byte()
    }

    /// The wire that the next byte is for, up to the next [`Self::poll`].
    pub const fn written_to(&self) -> usize {
        self.written_to
    }

    /// Whether the board is to call its boot loader, a while from now on, so that the host gets its answer.
    pub const fn is_leaving(&self) -> bool {
        self.handler.is_leaving()
    }

    /// When everything was sent, finds the next message to send: `received` gives the bytes from the host at a wire, `None` when
    /// there are no more for now. Whether there is one to send; if not, there is nothing to do until an interrupt has come.
    // One copy: on a board it may be in RAM.
    #[inline(never)]
    pub fn poll(&mut self, mut received: impl FnMut(usize) -> Option<u8>, board: &mut impl ControlAccess) -> bool {
        if !self.writer.is_empty() {
            return false;
        }
        let unasked = if self.has_streamed { None } else { self.handler.poll() };
        self.has_streamed = unasked.is_some();
        let mut message = unasked.or_else(|| self.receive(&mut received, board));
        if message.is_none() {
            message = self.handler.poll();
            self.has_streamed = message.is_some();
        }
        if let Some(Tagged { tag, message }) = message {
            self.written_to = self.wire;
            // Every message fits a frame.
            let _ = self.writer.load(tag, &message);
        } else if let Some((wire, tag)) = self.foreign() {
            self.written_to = wire;
            self.writer.load_notice(tag);
        }
        !self.writer.is_empty()
    }

    /// A wire with a frame of another version, and its tag.
    fn foreign(&mut self) -> Option<(usize, u8)> {
        self.receivers.iter_mut().enumerate().find_map(|(wire, receiver)| match receiver.take_foreign() {
            Some(Foreign::Message { tag, .. }) => Some((wire, tag)),
            _ => None,
        })
    }

    /// Looks at the wire that has the link last, so that it cannot keep the others from it.
    fn receive(
        &mut self,
        received: &mut impl FnMut(usize) -> Option<u8>,
        board: &mut impl ControlAccess,
    ) -> Option<Tagged<Message>> {
        for wire in (self.wire + 1..WIRES).chain(0..=self.wire) {
            for _ in 0..POLL_BYTES {
                let Some(byte) = received(wire) else { break };
                if let Some(request) = self.receivers.get_mut(wire).and_then(|receiver| receiver.push(byte)) {
                    self.wire = wire;
                    let none = FrameFaults::default();
                    let faults = self.receivers.iter().fold(none, |sum, receiver| sum.plus(receiver.faults()));
                    return self.handler.answer(request, faults, board);
                }
            }
        }
        None
    }
}
