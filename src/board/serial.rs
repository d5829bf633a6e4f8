//! USART3: the link's bytes, in and out, through two queues.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer};
use rotorlead::link::BAUD;
use stm32f4xx_hal::gpio::Input;
use stm32f4xx_hal::pac::USART3;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::config::{Config, InvalidConfig};
use stm32f4xx_hal::serial::{RxListen as _, Serial as HalSerial};
use stm32f4xx_hal::time::Bps;

use super::generated::{LinkRx, LinkTx};

/// Size of the queue of received bytes, a power of two. Holds what a host that sends one request after another can send while the idle
/// task is busy, which is longest during a filter design.
pub const RECEIVE_QUEUE: usize = 2048;
/// Size of the queue of bytes to be sent, a power of two.
pub const SEND_QUEUE: usize = 1024;

/// Bytes that were lost since the start: noise, overrun, or a full queue; wraps.
pub static LOST: AtomicU32 = AtomicU32::new(0);

/// The UART and the interrupt's ends of the queues.
pub struct Serial {
    uart: USART3,
    received: Producer<'static, u8, RECEIVE_QUEUE>,
    to_send: Consumer<'static, u8, SEND_QUEUE>,
    /// Whether the UART interrupts when the next byte may be sent. Its own register takes longer to read.
    is_sending: bool,
}

impl Serial {
    /// Opens the UART.
    ///
    /// # Errors
    /// When the bus clock is too slow for [`BAUD`], which it is for none of the clocks.
    pub fn new(
        uart: USART3,
        pins: (LinkTx<Input>, LinkRx<Input>),
        received: Producer<'static, u8, RECEIVE_QUEUE>,
        to_send: Consumer<'static, u8, SEND_QUEUE>,
        rcc: &mut Rcc,
    ) -> Result<Self, InvalidConfig> {
        let serial: HalSerial<USART3> = HalSerial::new(uart, pins, Config::default().baudrate(Bps(BAUD)), rcc)?;
        let (_, mut receiver) = serial.split();
        receiver.listen();
        Ok(Self { uart: registers(), received, to_send, is_sending: false })
    }

    /// The interrupt: at most one byte each way. By the registers, since it is the interrupt that must not be late.
    #[inline]
    pub fn handle_interrupt(&mut self) {
        let status = self.uart.sr().read();
        let overrun = status.ore().bit();
        if status.rxne().bit() || overrun {
            // Read after the status, the data clears what the status said. After an overrun it is the byte before the one
            // that was lost.
            let byte = self.uart.dr().read().dr().bits() as u8;
            let is_spoilt = status.nf().bit() || status.fe().bit();
            if overrun || is_spoilt {
                count_lost();
            }
            if !is_spoilt && self.received.enqueue(byte).is_err() {
                count_lost();
            }
        }
        if status.txe().bit() {
            let next = self.to_send.dequeue();
            if let Some(byte) = next {
                self.uart.dr().write(|w| w.dr().set(u16::from(byte)));
            }
            if self.is_sending != next.is_some() {
                self.is_sending = next.is_some();
                self.uart.cr1().modify(|_, w| w.txeie().bit(next.is_some()));
            }
        }
    }
}

#[cold]
fn count_lost() {
    // Nobody else writes it.
    LOST.store(LOST.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// The UART's registers. The HAL's halves of it take several calls for a byte.
#[allow(unsafe_code)]
fn registers() -> USART3 {
    // SAFETY: the HAL's value has set it up and is gone.
    unsafe { USART3::steal() }
}
