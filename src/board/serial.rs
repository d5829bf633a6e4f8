//! USART3: the link's bytes, in and out, through two queues.

use heapless::spsc::{Consumer, Producer};
use stm32f4xx_hal::gpio::{Input, PC10, PC11};
use stm32f4xx_hal::pac::USART3;
use stm32f4xx_hal::prelude::{_embedded_hal_serial_nb_Read, _embedded_hal_serial_nb_Write};
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::config::{Config, InvalidConfig};
use stm32f4xx_hal::serial::{Rx, RxListen, Tx, TxListen};
use stm32f4xx_hal::time::Bps;

/// Divides the bus clocks of all [`super::clocks::Source`]s exactly.
pub const BAUD: u32 = 1_000_000;

/// Size of the queue of received bytes, a power of two: what a design, the longest that the idle task is away, lets come
/// in of a host that sends one request after another.
pub const RECEIVE_QUEUE: usize = 2048;
/// Size of the queue of bytes to be sent, a power of two.
pub const SEND_QUEUE: usize = 1024;

/// The UART and the interrupt's ends of the queues.
pub struct Serial {
    receiver: Rx<USART3>,
    transmitter: Tx<USART3>,
    received: Producer<'static, u8, RECEIVE_QUEUE>,
    to_send: Consumer<'static, u8, SEND_QUEUE>,
    /// Bytes that were lost: noise, overrun, or a full queue. Stops at its highest value.
    pub lost: u32,
}

impl Serial {
    /// Opens the UART.
    ///
    /// # Errors
    /// When the bus clock is too slow for [`BAUD`], which it is for none of the clocks.
    pub fn new(
        uart: USART3,
        pins: (PC10<Input>, PC11<Input>),
        received: Producer<'static, u8, RECEIVE_QUEUE>,
        to_send: Consumer<'static, u8, SEND_QUEUE>,
        rcc: &mut Rcc,
    ) -> Result<Self, InvalidConfig> {
        let serial = stm32f4xx_hal::serial::Serial::new(uart, pins, Config::default().baudrate(Bps(BAUD)), rcc)?;
        let (transmitter, mut receiver) = serial.split();
        receiver.listen();
        Ok(Self { receiver, transmitter, received, to_send, lost: 0 })
    }

    /// The interrupt: at most one byte each way.
    #[inline]
    pub fn exchange(&mut self) {
        match self.receiver.read() {
            Ok(byte) => {
                if self.received.enqueue(byte).is_err() {
                    self.lost = self.lost.saturating_add(1);
                }
            }
            Err(nb::Error::Other(_)) => self.lost = self.lost.saturating_add(1),
            Err(nb::Error::WouldBlock) => {}
        }
        match self.to_send.peek() {
            Some(&byte) => {
                self.transmitter.listen();
                if self.transmitter.write(byte).is_ok() {
                    self.to_send.dequeue();
                }
            }
            None => self.transmitter.unlisten(),
        }
    }
}
