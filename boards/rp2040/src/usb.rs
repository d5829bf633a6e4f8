//! USB: a serial port with the link's bytes, in and out, through two queues.
//!
//! Not `usb-device` with `usbd-serial`: they index by counts that they read and call their classes through pointers, so nothing could show
//! that their interrupt does not panic, and the bus of `rp2040-hal` waits in a loop without an end.
//!
//! The host asks for every packet, and waits for as long as the device has none or no room: nothing here has a deadline, and no byte is
//! lost. Unplugged, or with a host that reads nothing, the packets stay where they are.
//!
//! Source: RP2040 datasheet, 4.1.

use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::{Consumer, Producer};
use rotorlead_rp2040::generated::USB_RESERVED;
use rotorlead_rp2040::usb_control::{Change, Control, DATA_ENDPOINT, NOTICE_ENDPOINT, PACKET_BYTES, Step};
use rp2040_hal::pac::{IO_BANK0, PADS_BANK0, SYSINFO, USBCTRL_DPRAM, USBCTRL_REGS};

use crate::wire::{RECEIVE_QUEUE, SEND_QUEUE};

/// The handler is to be called again though no interrupt asks for it: a packet waits for room in the queue, or the end of a reset is to be
/// seen.
pub static IS_WAITING: AtomicBool = AtomicBool::new(false);

/// Where the buffers of the packets are in the controller's memory: that of endpoint 0 is fixed, the others are 64 bytes each.
const CONTROL_BUFFER: usize = 0x100;
const NOTICE_BUFFER: usize = 0x180;
const IN_BUFFER: usize = 0x1c0;
const OUT_BUFFER: usize = 0x200;

/// Bits of a buffer's control: the packet is to be sent, its number's parity, the transfer is refused, the controller has the buffer.
const FULL: u32 = 1 << 15;
const ODD: u32 = 1 << 13;
const STALL: u32 = 1 << 11;
const AVAILABLE: u32 = 1 << 10;
const LENGTH: u32 = 0x3ff;
/// Bits of an endpoint's control: on, an interrupt for each packet, and its kind.
const ENABLE: u32 = 1 << 31 | 1 << 29;
const BULK: u32 = 2 << 26;
const INTERRUPT: u32 = 3 << 26;
/// The function by which a pin stands for a line of the bus (datasheet, 2.19.2 does not list it; `rp2040-hal` and the vendor's code use it).
const DEBUG_FUNCTION: u8 = 8;
/// Cycles of the core from all other bits of a buffer's control to that which gives it away (4.1.2.5.1): three of the 48 MHz, and some.
const SETTLE_CYCLES: u32 = 12;

/// A buffer of an endpoint, by its number in the row of their controls.
#[derive(Clone, Copy)]
struct Buffer(usize);

const CONTROL_IN: Buffer = Buffer(0);
const CONTROL_OUT: Buffer = Buffer(1);
const DATA_IN: Buffer = Buffer(2 * DATA_ENDPOINT as usize);
const DATA_OUT: Buffer = Buffer(2 * DATA_ENDPOINT as usize + 1);

impl Buffer {
    /// Its bit in the list of those that are done with.
    const fn bit(self) -> u32 {
        1 << self.0
    }
}

/// The fault E5 of the steppings B0 and B1: where the bus is never quiet for 800 µs after a reset, as behind some hubs, they do not notice
/// its end. GPIO 15 is the only way by which a quiet bus can be feigned to them (datasheet, appendix B).
#[derive(Clone, Copy)]
enum Erratum {
    None,
    /// The bus is still in its reset.
    AwaitsEnd,
    /// The controller looks at a feigned bus; what the pin's pad and function were.
    Feigns {
        pad: u32,
        function: u32,
    },
}

/// The controller and the interrupt's ends of the queues.
pub struct Usb {
    registers: USBCTRL_REGS,
    memory: USBCTRL_DPRAM,
    control: Control,
    is_control_odd: bool,
    received: Producer<'static, u8, RECEIVE_QUEUE>,
    to_send: Consumer<'static, u8, SEND_QUEUE>,
    is_configured: bool,
    is_in_odd: bool,
    is_out_odd: bool,
    /// A packet waits for its host.
    is_sending: bool,
    /// The last packet was full, which does not end what a host reads.
    owes_end: bool,
    /// A packet of the host waits for room in the queue.
    has_received: bool,
    erratum: Erratum,
}

impl Usb {
    /// Connects to the bus. The controller is out of reset, and its clock runs.
    pub fn new(
        registers: USBCTRL_REGS,
        memory: USBCTRL_DPRAM,
        received: Producer<'static, u8, RECEIVE_QUEUE>,
        to_send: Consumer<'static, u8, SEND_QUEUE>,
    ) -> Self {
        let mut usb = Self {
            registers,
            memory,
            control: Control::new(),
            is_control_odd: false,
            received,
            to_send,
            is_configured: false,
            is_in_odd: false,
            is_out_odd: false,
            is_sending: false,
            owes_end: false,
            has_received: false,
            erratum: Erratum::None,
        };
        // A reset leaves the controller's memory as the boot ROM's loader had it.
        usb.memory.ep_control_iter().for_each(|control| control.reset());
        usb.memory.ep_buffer_control_iter().for_each(|control| control.reset());
        usb.reset_endpoints();
        let registers = &usb.registers;
        registers.usb_muxing().write(|w| {
            w.to_phy().set_bit();
            w.softcon().set_bit()
        });
        // A Pico does not connect the plug's 5 V to the pin that could see it.
        registers.usb_pwr().write(|w| {
            w.vbus_detect().set_bit();
            w.vbus_detect_override_en().set_bit()
        });
        registers.main_ctrl().write(|w| w.controller_en().set_bit());
        registers.inte().write(|w| {
            w.buff_status().set_bit();
            w.bus_reset().set_bit();
            w.setup_req().set_bit()
        });
        registers.sie_ctrl().write(|w| {
            w.ep0_int_1buf().set_bit();
            w.pullup_en().set_bit()
        });
        usb
    }

    /// The interrupt: at most one packet of each endpoint and way.
    pub fn handle_interrupt(&mut self) {
        let raised = self.registers.ints().read();
        if raised.bus_reset().bit() {
            self.reset();
        }
        self.look_at_reset();
        let done = self.registers.buff_status().read().bits();
        self.forget_done(done);
        // Before a setup, which may begin with these endpoints anew.
        self.is_sending &= done & DATA_IN.bit() == 0;
        self.has_received |= self.is_configured && done & DATA_OUT.bit() != 0;
        if raised.setup_req().bit() {
            // What was done of the transfer before does not matter any more.
            self.setup();
        } else {
            if done & CONTROL_IN.bit() != 0 {
                let step = self.control.sent();
                self.follow(step);
            }
            if done & CONTROL_OUT.bit() != 0 {
                self.take_control();
            }
        }
        self.receive();
        self.send();
        let is_waiting = self.has_received || !matches!(self.erratum, Erratum::None);
        IS_WAITING.store(is_waiting, Ordering::Relaxed);
    }

    fn reset(&mut self) {
        self.registers.sie_status().write(|w| w.bus_reset().clear_bit_by_one());
        self.registers.addr_endp().reset();
        self.forget_done(u32::MAX);
        self.reset_endpoints();
        self.stop_feigning();
        self.erratum = Erratum::AwaitsEnd;
    }

    /// Only endpoint 0 is there, which takes the beginning of a transfer without a buffer.
    fn reset_endpoints(&mut self) {
        self.control = Control::new();
        self.give(CONTROL_IN, 0);
        self.give(CONTROL_OUT, 0);
        self.configure(false);
    }

    #[allow(unsafe_code)]
    fn forget_done(&self, buffers: u32) {
        // SAFETY: a one forgets that a buffer is done with, and a zero does nothing.
        self.registers.buff_status().write(|w| unsafe { w.bits(buffers) });
    }

    fn setup(&mut self) {
        self.registers.sie_status().write(|w| w.setup_rec().clear_bit_by_one());
        self.forget_done(CONTROL_IN.bit() | CONTROL_OUT.bit());
        let [low, high] = [self.memory.setup_packet_low().read().bits(), self.memory.setup_packet_high().read().bits()];
        let ([a, b, c, d], [e, f, g, h]) = (low.to_le_bytes(), high.to_le_bytes());
        self.give(CONTROL_IN, 0);
        self.give(CONTROL_OUT, 0);
        // Behind the beginning of a transfer both ways count from one.
        self.is_control_odd = true;
        let mut control = core::mem::take(&mut self.control);
        let (step, change) = control.setup([a, b, c, d, e, f, g, h]);
        match change {
            Some(Change::Configured(is_on)) => self.configure(is_on),
            Some(Change::Restarted { is_in: true }) => self.restart_in(),
            Some(Change::Restarted { is_in: false }) => self.restart_out(),
            None => {}
        }
        self.follow(step);
        self.control = control;
    }

    fn take_control(&mut self) {
        let mut packet = [0; PACKET_BYTES];
        let length = self.length(CONTROL_OUT);
        let bytes = words(&self.memory, CONTROL_BUFFER).flatten();
        packet.iter_mut().zip(bytes.take(length)).for_each(|(place, byte)| *place = byte);
        let step = self.control.received(packet.get(..length).unwrap_or_default());
        self.follow(step);
    }

    /// Does what endpoint 0 is to do.
    #[allow(unsafe_code)]
    fn follow(&mut self, step: Step<'_>) {
        match step {
            Step::Wait => {}
            Step::Send(packet) => self.send_control(packet),
            Step::SendUntilEnded(packet) => {
                self.give(CONTROL_OUT, AVAILABLE | ODD | PACKET_BYTES as u32);
                self.send_control(packet);
            }
            Step::Receive => self.give(CONTROL_OUT, AVAILABLE | ODD | PACKET_BYTES as u32),
            Step::Stall => {
                self.registers.ep_stall_arm().write(|w| {
                    w.ep0_in().set_bit();
                    w.ep0_out().set_bit()
                });
                self.give(CONTROL_IN, STALL);
                self.give(CONTROL_OUT, STALL);
            }
            // SAFETY: an address has 7 bits.
            Step::Address(address) => self.registers.addr_endp().write(|w| unsafe { w.address().bits(address) }),
        }
    }

    fn send_control(&mut self, packet: &[u8]) {
        let mut bytes = packet.iter().copied();
        let length = fill(&self.memory, CONTROL_BUFFER, || bytes.next());
        let parity = parity(&mut self.is_control_odd);
        self.give(CONTROL_IN, FULL | AVAILABLE | parity | length);
    }

    /// Switches all endpoints but 0 on or off.
    fn configure(&mut self, is_on: bool) {
        let notice = if is_on { ENABLE | INTERRUPT | NOTICE_BUFFER as u32 } else { 0 };
        let [to_host, from_host] =
            if is_on { [ENABLE | BULK | IN_BUFFER as u32, ENABLE | BULK | OUT_BUFFER as u32] } else { [0, 0] };
        self.give(Buffer(2 * NOTICE_ENDPOINT as usize), 0);
        // The row of the endpoints' controls has none for endpoint 0.
        self.set_endpoint(2 * NOTICE_ENDPOINT as usize - 2, notice);
        self.set_endpoint(DATA_IN.0 - 2, to_host);
        self.set_endpoint(DATA_OUT.0 - 2, from_host);
        self.is_configured = is_on;
        self.is_sending = false;
        self.has_received = false;
        self.give(DATA_IN, 0);
        self.give(DATA_OUT, 0);
        self.restart_in();
        self.restart_out();
    }

    /// The next packet to the host, or that which waits for it, is the first.
    fn restart_in(&mut self) {
        self.is_in_odd = self.is_sending;
        if self.is_sending {
            let length = self.length(DATA_IN) as u32;
            self.give(DATA_IN, FULL | AVAILABLE | length);
        }
    }

    /// The next packet of the host is its first.
    fn restart_out(&mut self) {
        self.is_out_odd = false;
        if self.is_configured && !self.has_received {
            self.await_data();
        }
    }

    fn await_data(&mut self) {
        let parity = parity(&mut self.is_out_odd);
        self.give(DATA_OUT, AVAILABLE | parity | PACKET_BYTES as u32);
    }

    /// Takes the packet that has come, where there is room for it.
    fn receive(&mut self) {
        let room = self.received.capacity().saturating_sub(self.received.len());
        if !self.has_received || room < PACKET_BYTES {
            return;
        }
        self.has_received = false;
        let length = self.length(DATA_OUT);
        for byte in words(&self.memory, OUT_BUFFER).flatten().take(length) {
            let _ = self.received.enqueue(byte);
        }
        self.await_data();
    }

    /// Puts a packet where the host will fetch it.
    fn send(&mut self) {
        if !self.is_configured || self.is_sending || (self.to_send.len() == 0 && !self.owes_end) {
            return;
        }
        let length = fill(&self.memory, IN_BUFFER, || self.to_send.dequeue());
        self.owes_end = length as usize == PACKET_BYTES;
        self.is_sending = true;
        let parity = parity(&mut self.is_in_odd);
        self.give(DATA_IN, FULL | AVAILABLE | parity | length);
    }

    /// Bytes of the packet in a buffer.
    fn length(&self, buffer: Buffer) -> usize {
        let control = self.memory.ep_buffer_control(buffer.0).read().bits();
        PACKET_BYTES.min((control & LENGTH) as usize)
    }

    /// Sets a buffer's control: first all but the bit that gives the buffer to the controller.
    #[allow(unsafe_code)]
    fn give(&self, buffer: Buffer, bits: u32) {
        let register = self.memory.ep_buffer_control(buffer.0);
        // SAFETY: bits that are named above, of a buffer that is ours or not used any more.
        register.write(|w| unsafe { w.bits(bits & !AVAILABLE) });
        if bits & AVAILABLE != 0 {
            cortex_m::asm::delay(SETTLE_CYCLES);
            // SAFETY: as above.
            register.write(|w| unsafe { w.bits(bits) });
        }
    }

    #[allow(unsafe_code)]
    fn set_endpoint(&self, index: usize, bits: u32) {
        // SAFETY: bits that are named above, and a buffer of its own.
        self.memory.ep_control(index).write(|w| unsafe { w.bits(bits) });
    }

    /// Goes on with a reset of the bus, where the controller would not notice its end.
    fn look_at_reset(&mut self) {
        let status = self.registers.sie_status().read();
        match self.erratum {
            Erratum::None => {}
            Erratum::AwaitsEnd if status.connected().bit() || !has_erratum() => self.erratum = Erratum::None,
            Erratum::AwaitsEnd if status.line_state().is_se0() => {}
            Erratum::AwaitsEnd => self.feign(),
            Erratum::Feigns { .. } if status.connected().bit() => self.stop_feigning(),
            Erratum::Feigns { .. } => {}
        }
    }

    /// Shows the controller a quiet bus: D+ high from the function "USB" of the pin, with its pad left alone, and D- low.
    #[allow(unsafe_code)]
    fn feign(&mut self) {
        let (pads, functions) = pin_registers();
        let (pad, function) = (pads.gpio(USB_RESERVED.into()), functions.gpio(USB_RESERVED.into()).gpio_ctrl());
        self.erratum = Erratum::Feigns { pad: pad.read().bits(), function: function.read().bits() };
        pad.modify(|_, w| {
            w.pue().set_bit();
            w.pde().set_bit()
        });
        // SAFETY: a function that the pin has, and the crate does not name.
        function.modify(|_, w| unsafe {
            w.oeover().disable();
            w.inover().high();
            w.funcsel().bits(DEBUG_FUNCTION)
        });
        // The host goes on seeing the pull-up.
        self.registers.usbphy_direct().modify(|_, w| w.dp_pullup_en().set_bit());
        self.registers.usbphy_direct_override().modify(|_, w| w.dp_pullup_en_override_en().set_bit());
        self.registers.usb_muxing().write(|w| {
            w.to_digital_pad().set_bit();
            w.softcon().set_bit()
        });
    }

    #[allow(unsafe_code)]
    fn stop_feigning(&mut self) {
        let Erratum::Feigns { pad, function } = core::mem::replace(&mut self.erratum, Erratum::None) else { return };
        self.registers.usb_muxing().write(|w| {
            w.to_phy().set_bit();
            w.softcon().set_bit()
        });
        self.registers.usbphy_direct_override().modify(|_, w| w.dp_pullup_en_override_en().clear_bit());
        let (pads, functions) = pin_registers();
        // SAFETY: what was there before.
        unsafe {
            functions.gpio(USB_RESERVED.into()).gpio_ctrl().write(|w| w.bits(function));
            pads.gpio(USB_RESERVED.into()).write(|w| w.bits(pad));
        }
    }
}

/// The parity of the next packet, whose successor has the other one.
const fn parity(is_odd: &mut bool) -> u32 {
    let bits = if *is_odd { ODD } else { 0 };
    *is_odd = !*is_odd;
    bits
}

/// The place of a buffer's word. The controller's memory takes whole words.
fn word(memory: &USBCTRL_DPRAM, buffer: usize, index: usize) -> *mut u32 {
    core::ptr::from_ref(&**memory).cast_mut().cast::<u32>().wrapping_add(buffer / 4 + index)
}

/// The words of a buffer.
#[allow(unsafe_code)]
fn words(memory: &USBCTRL_DPRAM, buffer: usize) -> impl Iterator<Item = [u8; 4]> {
    // SAFETY: 16 words of the controller's memory, which has 4 KiB.
    (0..PACKET_BYTES / 4).map(move |index| unsafe { word(memory, buffer, index).read_volatile() }.to_le_bytes())
}

/// Fills a buffer with up to 64 bytes, and says how many there were.
#[allow(unsafe_code)]
fn fill(memory: &USBCTRL_DPRAM, buffer: usize, mut next: impl FnMut() -> Option<u8>) -> u32 {
    let mut length = 0;
    for index in 0..PACKET_BYTES / 4 {
        let mut bytes = [0; 4];
        let mut is_whole = true;
        for place in &mut bytes {
            if let Some(byte) = next() {
                *place = byte;
                length += 1;
            } else {
                is_whole = false;
                break;
            }
        }
        // SAFETY: a word of a buffer that the controller does not have.
        unsafe { word(memory, buffer, index).write_volatile(u32::from_le_bytes(bytes)) };
        if !is_whole {
            break;
        }
    }
    length
}

/// B0 and B1 say 1.
#[allow(unsafe_code)]
fn has_erratum() -> bool {
    // SAFETY: reads what the chip is.
    let info = unsafe { SYSINFO::steal() };
    info.chip_id().read().revision().bits() < 2
}

/// For the pin that nothing else uses.
#[allow(unsafe_code)]
fn pin_registers() -> (PADS_BANK0, IO_BANK0) {
    // SAFETY: only the registers of that pin are written.
    unsafe { (PADS_BANK0::steal(), IO_BANK0::steal()) }
}
