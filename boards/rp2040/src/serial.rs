//! UART0: the link's bytes, in and out, through two queues.
//!
//! The UART holds 32 bytes each way. It interrupts when 8 have come, when fewer have and the line is quiet, and when no more than 8
//! are left to be sent.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer};
use rotorlead::link::BAUD;
use rotorlead_rp2040::generated::{LINK_RX, LINK_TX};
use rp2040_hal::pac::UART0;
use rp2040_hal::pac::io_bank0::gpio::gpio_ctrl::FUNCSEL_A;

use crate::clocks::CORE_HZ;
use crate::pins::{Pins, Pull};
use crate::wire::{RECEIVE_QUEUE, SEND_QUEUE};

/// Bytes that the UART holds each way.
const FIFO_BYTES: usize = 32;
/// The divider of the UART's clock, in 1/64: 16 samples to a bit (RP2040 datasheet, 4.2.7.1).
const DIVIDER: u32 = (CORE_HZ * 4 + BAUD / 2) / BAUD;

/// Bytes that were lost since the start: noise, overrun, or a full queue; wraps.
pub static LOST: AtomicU32 = AtomicU32::new(0);

/// The UART and the interrupt's ends of the queues.
pub struct Serial {
    uart: UART0,
    received: Producer<'static, u8, RECEIVE_QUEUE>,
    to_send: Consumer<'static, u8, SEND_QUEUE>,
}

impl Serial {
    /// Opens the UART, which is out of reset.
    pub fn new(
        uart: UART0,
        pins: &Pins,
        received: Producer<'static, u8, RECEIVE_QUEUE>,
        to_send: Consumer<'static, u8, SEND_QUEUE>,
    ) -> Self {
        uart.uartibrd().write(|w| w.baud_divint().variant((DIVIDER / 64) as u16));
        uart.uartfbrd().write(|w| w.baud_divfrac().variant((DIVIDER % 64) as u8));
        // Takes the divider over, too.
        uart.uartlcr_h().write(|w| {
            w.wlen().variant(0b11);
            w.fen().set_bit()
        });
        // A quarter full, or empty to a quarter.
        uart.uartifls().write(|w| {
            w.rxiflsel().variant(0b001);
            w.txiflsel().variant(0b001)
        });
        uart.uartimsc().write(|w| {
            w.rxim().set_bit();
            w.rtim().set_bit();
            w.txim().set_bit()
        });
        uart.uartcr().write(|w| {
            w.uarten().set_bit();
            w.rxe().set_bit();
            w.txe().set_bit()
        });
        pins.set(LINK_TX, FUNCSEL_A::UART, Pull::None);
        // An open line reads as idle.
        pins.set(LINK_RX, FUNCSEL_A::UART, Pull::Up);
        Self { uart, received, to_send }
    }

    /// The interrupt: what has come, and what there is room for.
    pub fn handle_interrupt(&mut self) {
        // First the flags: what comes from here on raises them anew.
        self.uart.uarticr().write(|w| {
            w.rxic().clear_bit_by_one();
            w.rtic().clear_bit_by_one();
            w.txic().clear_bit_by_one()
        });
        for _ in 0..FIFO_BYTES {
            if self.uart.uartfr().read().rxfe().bit() {
                break;
            }
            let data = self.uart.uartdr().read();
            let is_spoilt = data.fe().bit() || data.be().bit();
            // The bytes after the one that is marked with it found no room.
            if data.oe().bit() || is_spoilt {
                count_lost();
            }
            if !is_spoilt && self.received.enqueue(data.data().bits()).is_err() {
                count_lost();
            }
        }
        for _ in 0..FIFO_BYTES {
            if self.uart.uartfr().read().txff().bit() {
                break;
            }
            let Some(byte) = self.to_send.dequeue() else { break };
            self.uart.uartdr().write(|w| w.data().variant(byte));
        }
    }
}

#[cold]
fn count_lost() {
    // Nobody else writes it.
    LOST.store(LOST.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}
