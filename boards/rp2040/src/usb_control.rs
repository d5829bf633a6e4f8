//! What a host asks at endpoint 0 of the USB serial port (CDC-ACM), and what it is answered. Knows no registers, so a host's tests run it.
//!
//! Source: Universal Serial Bus Specification 2.0, chapter 9; Class Definitions for Communications Devices 1.2, and its PSTN subclass.

use rotorlead::link::USB_ID;

/// Bytes of the largest packet, at full speed.
pub const PACKET_BYTES: usize = 64;
/// The endpoint that would say of the lines of a modem, which this has not.
pub const NOTICE_ENDPOINT: u8 = 1;
/// The endpoint of the link's bytes, both ways.
pub const DATA_ENDPOINT: u8 = 2;

const INTO_HOST: u8 = 0x80;
const TO_ENDPOINT: u8 = 0x02;
/// The class's own requests, of any recipient.
const CLASS: u8 = 0x20;
const KIND: u8 = 0x60;

const DEVICE: [u8; 18] = [
    18,
    1,
    // USB 2.0; class CDC, as a whole.
    0x00,
    0x02,
    0x02,
    0,
    0,
    PACKET_BYTES as u8,
    USB_ID.0 as u8,
    (USB_ID.0 >> 8) as u8,
    USB_ID.1 as u8,
    (USB_ID.1 >> 8) as u8,
    // Release 1.0; strings 1 and 2, no serial number; one configuration.
    0x00,
    0x01,
    1,
    2,
    0,
    1,
];

const CONFIGURATION_BYTES: u8 = 67;
#[rustfmt::skip]
const CONFIGURATION: [u8; CONFIGURATION_BYTES as usize] = [
    // Two interfaces, configuration 1, powered by the bus with up to 100 mA.
    9, 2, CONFIGURATION_BYTES, 0, 2, 1, 0, 0x80, 50,
    // The interface of the class: abstract control model, no protocol.
    9, 4, 0, 0, 1, 0x02, 0x02, 0, 0,
    // Its header (1.10), its handling of calls (none), its capabilities (line coding and state), its union of both interfaces.
    5, 0x24, 0x00, 0x10, 0x01,
    5, 0x24, 0x01, 0, 1,
    4, 0x24, 0x02, 0x02,
    5, 0x24, 0x06, 0, 1,
    // 8 bytes at most, interrupt, asked every 255 ms.
    7, 5, INTO_HOST | NOTICE_ENDPOINT, 3, 8, 0, 255,
    // The interface of the data: both ways in bulk.
    9, 4, 1, 0, 2, 0x0a, 0, 0, 0,
    7, 5, INTO_HOST | DATA_ENDPOINT, 2, PACKET_BYTES as u8, 0, 0,
    7, 5, DATA_ENDPOINT, 2, PACKET_BYTES as u8, 0, 0,
];

/// English of the United States.
const LANGUAGES: [u8; 4] = [4, 3, 0x09, 0x04];
const MAKER: [u8; 20] = string(b"Rotorlead");
const PRODUCT: [u8; 34] = string(b"Rotorlead RP2040");

/// A descriptor of a string: UTF-16 of ASCII.
const fn string<const BYTES: usize>(text: &[u8]) -> [u8; BYTES] {
    assert!(BYTES == 2 + 2 * text.len());
    let mut descriptor = [0; BYTES];
    descriptor[0] = BYTES as u8;
    descriptor[1] = 3;
    let mut index = 0;
    while index < text.len() {
        descriptor[2 + 2 * index] = text[index];
        index += 1;
    }
    descriptor
}

/// What endpoint 0 does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<'a> {
    /// Waits for the host.
    Wait,
    /// Has a packet for the host.
    Send(&'a [u8]),
    /// Has a packet for the host, and takes the one with which the host ends the transfer, which it may do early.
    SendUntilEnded(&'a [u8]),
    /// Takes a packet of the host.
    Receive,
    /// Refuses the transfer.
    Stall,
    /// Has this address from now on.
    Address(u8),
}

/// What becomes of the other endpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// They are on, and start anew; or off.
    Configured(bool),
    /// The data's endpoint, to the host or from it, starts anew.
    Restarted {
        /// To the host.
        is_in: bool,
    },
}

#[derive(Clone, Copy, Debug)]
enum Stage {
    Idle,
    /// Packets go to the host.
    Sending {
        rest: &'static [u8],
        /// The host takes more bytes than there are, so a packet that is not full must end them.
        is_short: bool,
    },
    /// The host's line coding is to come.
    Receiving,
    /// The empty packet that ends a transfer goes to the host; then, perhaps, the address counts.
    Ending(Option<u8>),
}

/// Endpoint 0.
pub struct Control {
    stage: Stage,
    /// As the host has set it, which asks for it again. No bit of the link depends on it.
    line_coding: [u8; 7],
    is_configured: bool,
}

impl Control {
    /// Of a device that the host has just reset.
    #[must_use]
    pub const fn new() -> Self {
        // 1 Mbaud, one stop bit, no parity, 8 bits of data.
        Self { stage: Stage::Idle, line_coding: [0x40, 0x42, 0x0f, 0, 0, 0, 8], is_configured: false }
    }

    /// A transfer starts, whatever became of the one before.
    pub fn setup(&mut self, setup: [u8; 8]) -> (Step<'_>, Option<Change>) {
        let [kind, request, value, value_high, index, _, length, length_high] = setup;
        let length = u16::from_le_bytes([length, length_high]);
        self.stage = Stage::Idle;
        let is_in = kind & INTO_HOST != 0;
        let step = match (kind & KIND, request, is_in) {
            // GET_STATUS: no remote wake-up, nothing halted.
            (0, 0, true) => self.answer(&[0, 0], length),
            // CLEAR_FEATURE of an endpoint: it is not halted, and counts its packets anew.
            (0, 1, false) if kind & 0x1f == TO_ENDPOINT && value == 0 => {
                let restarted = Change::Restarted { is_in: index & INTO_HOST != 0 };
                let change = (index & !INTO_HOST == DATA_ENDPOINT).then_some(restarted);
                return (self.end(None), change);
            }
            // SET_ADDRESS
            (0, 5, false) => self.end(Some(value & 0x7f)),
            // GET_DESCRIPTOR
            (0, 6, true) => match (value_high, value) {
                (1, 0) => self.answer(&DEVICE, length),
                (2, 0) => self.answer(&CONFIGURATION, length),
                (3, 0) => self.answer(&LANGUAGES, length),
                (3, 1) => self.answer(&MAKER, length),
                (3, 2) => self.answer(&PRODUCT, length),
                _ => Step::Stall,
            },
            // GET_CONFIGURATION, SET_CONFIGURATION
            (0, 8, true) => self.answer(if self.is_configured { &[1] } else { &[0] }, length),
            (0, 9, false) if value <= 1 => {
                self.is_configured = value == 1;
                let change = Change::Configured(self.is_configured);
                return (self.end(None), Some(change));
            }
            // GET_INTERFACE, SET_INTERFACE: each has one setting.
            (0, 10, true) => self.answer(&[0], length),
            (0, 11, false) if value == 0 => self.end(None),
            // SET_LINE_CODING, GET_LINE_CODING
            (CLASS, 0x20, false) if usize::from(length) == self.line_coding.len() => {
                self.stage = Stage::Receiving;
                Step::Receive
            }
            (CLASS, 0x21, true) => {
                self.stage = Stage::Sending { rest: &[], is_short: false };
                let length = usize::from(length).min(self.line_coding.len());
                Step::SendUntilEnded(self.line_coding.get(..length).unwrap_or_default())
            }
            // SET_CONTROL_LINE_STATE, SEND_BREAK: the link has no use for them.
            (CLASS, 0x22 | 0x23, false) => self.end(None),
            _ => Step::Stall,
        };
        (step, None)
    }

    /// The host has taken a packet.
    pub fn sent(&mut self) -> Step<'static> {
        match self.stage {
            Stage::Sending { rest, is_short } => self.packet(rest, is_short).map_or(Step::Wait, Step::Send),
            Stage::Ending(address) => {
                self.stage = Stage::Idle;
                address.map_or(Step::Wait, Step::Address)
            }
            Stage::Idle | Stage::Receiving => Step::Wait,
        }
    }

    /// A packet of the host has come; of one that ends a transfer of packets to it, nothing follows.
    pub fn received(&mut self, packet: &[u8]) -> Step<'static> {
        if !matches!(self.stage, Stage::Receiving) {
            self.stage = Stage::Idle;
            return Step::Wait;
        }
        match packet.try_into() {
            Ok(coding) => {
                self.line_coding = coding;
                self.end(None)
            }
            Err(_) => {
                self.stage = Stage::Idle;
                Step::Stall
            }
        }
    }

    fn answer(&mut self, data: &'static [u8], length: u16) -> Step<'static> {
        let data = data.get(..usize::from(length)).unwrap_or(data);
        self.packet(data, data.len() < usize::from(length)).map_or(Step::Stall, Step::SendUntilEnded)
    }

    /// The next packet; `None` where all have gone.
    fn packet(&mut self, data: &'static [u8], is_short: bool) -> Option<&'static [u8]> {
        if data.is_empty() && !is_short {
            return None;
        }
        let (packet, rest) = data.split_at_checked(PACKET_BYTES).unwrap_or((data, &[]));
        self.stage = Stage::Sending { rest, is_short: is_short && packet.len() == PACKET_BYTES };
        Some(packet)
    }

    fn end(&mut self, address: Option<u8>) -> Step<'static> {
        self.stage = Stage::Ending(address);
        Step::Send(&[])
    }
}

impl Default for Control {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::String;
    use std::vec::Vec;

    use super::*;

    /// All bytes that the device sends for a request of `length` bytes, and in how many packets.
    fn read(control: &mut Control, setup: [u8; 6], length: u16) -> (Vec<u8>, usize) {
        let [low, high] = length.to_le_bytes();
        let [a, b, c, d, e, f] = setup;
        let (step, change) = control.setup([a, b, c, d, e, f, low, high]);
        assert_eq!(change, None);
        let Step::SendUntilEnded(first) = step else { panic!("{step:?}") };
        let (mut bytes, mut packets) = (first.to_vec(), 1);
        while let Step::Send(packet) = control.sent() {
            bytes.extend(packet);
            packets += 1;
        }
        assert_eq!(control.received(&[]), Step::Wait);
        (bytes, packets)
    }

    #[test]
    fn descriptors_come_in_packets_as_long_as_the_host_wants_them() {
        let mut control = Control::new();
        assert_eq!(read(&mut control, [0x80, 6, 0, 1, 0, 0], 8), (DEVICE[..8].to_vec(), 1));
        assert_eq!(read(&mut control, [0x80, 6, 0, 1, 0, 0], 64), (DEVICE.to_vec(), 1));
        assert_eq!(read(&mut control, [0x80, 6, 0, 2, 0, 0], 9), (CONFIGURATION[..9].to_vec(), 1));
        assert_eq!(read(&mut control, [0x80, 6, 0, 2, 0, 0], 255), (CONFIGURATION.to_vec(), 2));
        // A packet that fills what was asked for needs no other one to end it.
        assert_eq!(read(&mut control, [0x80, 6, 0, 2, 0, 0], 64), (CONFIGURATION[..64].to_vec(), 1));
        let (text, _) = read(&mut control, [0x80, 6, 2, 3, 9, 4], 255);
        assert_eq!(text.len(), usize::from(text[0]));
        assert_eq!(String::from_utf16_lossy(&[u16::from(text[2]), u16::from(text[32])]), "R0");
    }

    #[test]
    fn a_full_last_packet_is_ended_by_an_empty_one_where_the_host_takes_more() {
        const FULL: [u8; PACKET_BYTES] = [7; PACKET_BYTES];
        let mut control = Control::new();
        assert_eq!(control.answer(&FULL, 65), Step::SendUntilEnded(&FULL));
        assert_eq!(control.sent(), Step::Send(&[]));
        assert_eq!(control.sent(), Step::Wait);
    }

    #[test]
    fn the_configuration_is_as_long_as_its_parts_say() {
        let mut rest = &CONFIGURATION[..];
        while let Some(&length) = rest.first() {
            rest = &rest[usize::from(length)..];
        }
    }

    #[test]
    fn an_address_counts_when_the_host_has_taken_the_end_of_its_transfer() {
        let mut control = Control::new();
        assert_eq!(control.setup([0, 5, 9, 0, 0, 0, 0, 0]), (Step::Send(&[]), None));
        assert_eq!(control.sent(), Step::Address(9));
        assert_eq!(control.sent(), Step::Wait);
    }

    #[test]
    fn endpoints_follow_the_configuration() {
        let mut control = Control::new();
        assert_eq!(control.setup([0, 9, 1, 0, 0, 0, 0, 0]), (Step::Send(&[]), Some(Change::Configured(true))));
        assert_eq!(read(&mut control, [0x80, 8, 0, 0, 0, 0], 1).0, [1]);
        let restarted = Some(Change::Restarted { is_in: true });
        assert_eq!(control.setup([2, 1, 0, 0, 0x82, 0, 0, 0]), (Step::Send(&[]), restarted));
        assert_eq!(control.setup([2, 1, 0, 0, 0x81, 0, 0, 0]), (Step::Send(&[]), None));
        assert_eq!(control.setup([0, 9, 0, 0, 0, 0, 0, 0]), (Step::Send(&[]), Some(Change::Configured(false))));
        assert_eq!(control.setup([0, 9, 2, 0, 0, 0, 0, 0]), (Step::Stall, None));
    }

    #[test]
    fn the_line_coding_is_kept_for_the_host() {
        let mut control = Control::new();
        let coding = [1, 2, 3, 4, 5, 6, 7];
        assert_eq!(control.setup([0x21, 0x20, 0, 0, 0, 0, 7, 0]), (Step::Receive, None));
        assert_eq!(control.received(&coding), Step::Send(&[]));
        assert_eq!(control.sent(), Step::Wait);
        assert_eq!(read(&mut control, [0xa1, 0x21, 0, 0, 0, 0], 7), (coding.to_vec(), 1));
        assert_eq!(control.setup([0x21, 0x20, 0, 0, 0, 0, 8, 0]), (Step::Stall, None));
        control.setup([0x21, 0x20, 0, 0, 0, 0, 7, 0]);
        assert_eq!(control.received(&[1]), Step::Stall);
    }

    #[test]
    fn every_request_has_an_answer() {
        let mut control = Control::new();
        for kind in 0..=255 {
            for request in 0..=255 {
                for value in [0, 1, 2, 255] {
                    let (step, _) = control.setup([kind, request, value, value, 2, 0, 9, 0]);
                    assert_ne!(step, Step::Wait, "{kind} {request} {value}");
                    let is_in = kind & INTO_HOST != 0;
                    assert!(!matches!(step, Step::SendUntilEnded(_)) || is_in, "{kind} {request} {value}");
                }
            }
        }
    }
}
