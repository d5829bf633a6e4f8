//! The ends of a wire to the host that the lowest priority has: the UART, or USB.

use heapless::spsc::{Consumer, Producer};
use rotorlead::settings::DEAD_MAN_MS;
use rp2040_hal::pac::Interrupt;

/// Size of the queue of received bytes, a power of two. Holds what a host that sends one request after another can send while the idle
/// task is busy, which is longest during a filter design.
pub const RECEIVE_QUEUE: usize = 2048;
/// Size of the queue of bytes to be sent, a power of two.
pub const SEND_QUEUE: usize = 1024;
/// How long a host may take no byte before what is for it is dropped, so that another wire may have the link. Derived: twice the
/// dead-man's time, so that what such a host has started is over.
const DEAF_US: u32 = 2 * DEAD_MAN_MS * 1000;

/// How many there are, by their numbers to the server.
pub const WIRES: usize = 2;

/// A wire.
pub struct Wire {
    received: Consumer<'static, u8, RECEIVE_QUEUE>,
    to_send: Producer<'static, u8, SEND_QUEUE>,
    interrupt: Interrupt,
    /// When there was room last.
    ready_us: u32,
}

impl Wire {
    /// Between these queues and the handler of that interrupt.
    pub const fn new(
        received: Consumer<'static, u8, RECEIVE_QUEUE>,
        to_send: Producer<'static, u8, SEND_QUEUE>,
        interrupt: Interrupt,
    ) -> Self {
        Self { received, to_send, interrupt, ready_us: 0 }
    }

    /// The next byte from the host.
    pub fn receive(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    /// Passes bytes of a frame on to the host: as many as there is room for, or all, to be lost, where there has been none for long.
    pub fn send(&mut self, mut next_byte: impl FnMut() -> Option<u8>, now_us: u32) {
        if self.to_send.ready() {
            self.ready_us = now_us;
        }
        let is_deaf = now_us.wrapping_sub(self.ready_us) > DEAF_US;
        let mut is_new = false;
        while is_deaf || self.to_send.ready() {
            let Some(byte) = next_byte() else { break };
            is_new |= self.to_send.enqueue(byte).is_ok();
        }
        if is_new {
            rtic::pend(self.interrupt);
        }
    }
}
