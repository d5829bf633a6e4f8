//! From received bytes to sent ones.

use embedded_storage::nor_flash::NorFlash;

use super::{ControlAccess, RequestHandler};
use crate::link::{Foreign, Message, Receiver, Request, Tagged, Writer};

/// Bytes that are looked at in one poll at most.
const POLL_BYTES: usize = 256;

/// A [`RequestHandler`] with the link around it.
///
/// Requests and what the handler sends unasked (records, outputs of injected commands) take turns. Were either served first
/// whenever there is any, the other would starve: a recording that is faster than the line could not be stopped, nor an
/// excitation beside it kept alive; and a host that asks without a pause would get no records.
pub struct Server<F> {
    handler: RequestHandler<F>,
    receiver: Receiver<Request>,
    writer: Writer,
    /// The last message was unasked for.
    has_streamed: bool,
}

impl<F: NorFlash> Server<F> {
    /// With nothing received or to be sent.
    pub const fn new(handler: RequestHandler<F>) -> Self {
        Self { handler, receiver: Receiver::new(), writer: Writer::new(), has_streamed: false }
    }

    /// The next byte to the host.
    pub fn next_byte(&mut self) -> Option<u8> {
        self.writer.next_byte()
    }

    /// When everything was sent, finds the next message to send: `received` gives the bytes from the host, `None` when
    /// there are no more for now. Whether there is one to send; if not, there is nothing to do until an interrupt has come.
    pub fn poll(&mut self, mut received: impl FnMut() -> Option<u8>, board: &mut impl ControlAccess) -> bool {
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
            // Every message fits a frame.
            let _ = self.writer.load(tag, &message);
        } else if let Some(Foreign::Message { tag, .. }) = self.receiver.take_foreign() {
            self.writer.load_notice(tag);
        }
        !self.writer.is_empty()
    }

    fn receive(
        &mut self,
        received: &mut impl FnMut() -> Option<u8>,
        board: &mut impl ControlAccess,
    ) -> Option<Tagged<Message>> {
        for _ in 0..POLL_BYTES {
            if let Some(request) = self.receiver.push(received()?) {
                return self.handler.answer(request, *self.receiver.faults(), board);
            }
        }
        None
    }
}
