//! Framed, checked messages between a controller and a host.
//!
//! # On the wire
//!
//! ```text
//! frame:    0x00 | COBS( envelope ) | 0x00
//! envelope: version u8 | tag u8 | body | crc32 u32, little-endian
//! body:     one Request (host to controller) or Message (controller to host), as postcard writes it
//! ```
//!
//! - COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999) leaves no zero byte inside a frame, so a
//!   receiver that is out of step is in step again at the next zero. The zero in front keeps garbage before a frame out
//!   of it. Empty frames are nothing.
//! - The checksum is [`CHECKSUM`] over everything in the envelope before it. It lets one in 2^32 of random frames pass.
//! - The version is [`VERSION`]. A frame of another version is counted and dropped; its body is not looked at. A controller answers
//!   it with a notice, which every version reads: the version [`NOTICE_VERSION`], the tag, and as its body a byte, the version that
//!   the controller speaks.
//! - Of several wires, as a UART and USB, the one that the last request came on has the link: what comes unasked goes there.
//! - The tag is the host's: a reply carries the tag of its request. [`Message::Record`] comes unasked, with the tag of
//!   the request that started the recording.
//! - postcard writes an enum's variant as its number, integers as LEB128 (signed ones zigzag), `u8` and `bool` as a byte,
//!   `f64` as its 8 bytes, little-endian, structs and arrays as their fields. [`Series`] has a form of its own.
//! - Every request is answered, by what it asks for, [`Message::Done`] or [`Message::Refused`]. A frame that is not a
//!   whole and valid one is counted ([`FrameFaults`]), dropped and not answered: a host asks again.
//!
//! No layout can change unnoticed: a test holds the bytes of every message against written ones. A change of layout
//! takes a new [`VERSION`].

mod frame;
mod injector;
mod message;
mod recorder;
mod series;

pub use crate::checksum::CHECKSUM;
pub use frame::{
    FRAME_BYTES, Foreign, FrameFaults, NOTICE_VERSION, PAYLOAD_BYTES, Receiver, Tagged, TooLong, VERSION, Writer,
    encode, encode_notice,
};
pub use injector::{INJECT_TIMEOUT_MS, INJECT_WINDOW, Injector};
pub use message::{
    BrownOut, ChannelState, Clock, CrystalCheck, ExciteRequest, Faults, INJECT_SAMPLES, Info, InjectRequest, Injected,
    LineSet, Message, MotorFaults, PANIC_FILE_BYTES, PanicPlace, Path, RECORD_SAMPLES, REST_MS, Record, RecordRequest,
    Refusal, Request, ResetReason, Source,
};
pub use recorder::{NO_INPUT, NO_PULSE, NO_TURN, RecordClock, Recorder, Sample, Sensed};
pub use series::{Full, Series};

/// Bits per second of the link, each way. It divides the bus clocks of the STM32F405's clock sources exactly.
pub const BAUD: u32 = 1_000_000;
/// Vendor and product by which a board shows itself at USB: pid.codes' pair for private tests, which others use, too. A device that is
/// sold or given away needs a pair of its own; pid.codes gives them to open projects.
pub const USB_ID: (u16, u16) = (0x1209, 0x0001);
/// Bytes per second: a start bit, 8 bits of data and a stop bit each.
pub const BYTES_PER_S: u32 = BAUD / 10;
/// Most bytes that a sample of the recorder takes, rounded up: 5 for each of its three commands, 3 for a count of 12 bits and
/// 3 for a turn of 16, and its share of the frame around [`RECORD_SAMPLES`] of them.
pub const RECORD_SAMPLE_BYTES: u32 = 22;
/// Highest part of a control tick that an excitation and the link may take, percent. What is left is for the captures, for
/// cache misses, which the estimate leaves out, and for the lowest priority.
pub const MAX_LOAD_PERCENT: u32 = 80;
