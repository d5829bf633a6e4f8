//! Frames: from a message to bytes, and from whatever arrives to messages.

use core::fmt;
use core::marker::PhantomData;

use postcard_schema::Schema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::checksum::CHECKSUM;

/// Version of the messages, the first byte of every frame.
pub const VERSION: u8 = 9;
/// First byte of a notice, which is the same in all versions from 8 on: its body is the version that its sender speaks. It answers a
/// frame of another version, and is not answered itself.
pub const NOTICE_VERSION: u8 = 0;
/// Largest envelope: version, tag, body and checksum. The longest messages are settings with the curves of each motor, of some
/// 800 bytes, and a [`Record`](super::Record) of noise, of some 680.
pub const PAYLOAD_BYTES: usize = 1024;
/// Largest frame: the envelope, a byte of COBS for every 254, and the zeros around it.
pub const FRAME_BYTES: usize = 2 + PAYLOAD_BYTES + PAYLOAD_BYTES / 254 + 1;

const HEADER_BYTES: usize = 2;
const CHECKSUM_BYTES: usize = 4;

/// A message that does not fit a frame. None of this crate's is so long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the message does not fit a frame of {PAYLOAD_BYTES} bytes")
    }
}

impl core::error::Error for TooLong {}

/// Writes `message` as one frame into `frame`, and gives how many bytes it takes.
///
/// # Errors
/// [`TooLong`].
pub fn encode<T: Serialize>(tag: u8, message: &T, frame: &mut [u8; FRAME_BYTES]) -> Result<usize, TooLong> {
    encode_as(VERSION, tag, message, frame)
}

/// Writes the notice that this end speaks [`VERSION`] as one frame, and gives how many bytes it takes.
pub fn encode_notice(tag: u8, frame: &mut [u8; FRAME_BYTES]) -> usize {
    // A byte fits.
    encode_as(NOTICE_VERSION, tag, &VERSION, frame).unwrap_or(0)
}

fn encode_as<T: Serialize>(version: u8, tag: u8, message: &T, frame: &mut [u8; FRAME_BYTES]) -> Result<usize, TooLong> {
    let mut payload = [0; PAYLOAD_BYTES];
    payload[0] = version;
    payload[1] = tag;
    let room = &mut payload[HEADER_BYTES..PAYLOAD_BYTES - CHECKSUM_BYTES];
    let body = postcard::to_slice(message, room).map_err(|_| TooLong)?.len();
    let end = HEADER_BYTES + body;
    let checksum = CHECKSUM.checksum(&payload[..end]).to_le_bytes();
    payload[end..end + CHECKSUM_BYTES].copy_from_slice(&checksum);

    frame[0] = 0;
    let coded =
        cobs::try_encode(&payload[..end + CHECKSUM_BYTES], &mut frame[1..FRAME_BYTES - 1]).map_err(|_| TooLong)?;
    frame[1 + coded] = 0;
    Ok(coded + 2)
}

/// A frame on its way out, handed over byte by byte, as an interrupt of a UART takes it.
#[derive(Debug)]
pub struct Writer {
    frame: [u8; FRAME_BYTES],
    length: usize,
    sent: usize,
}

impl Writer {
    /// Nothing to send.
    #[must_use]
    pub const fn new() -> Self {
        Self { frame: [0; FRAME_BYTES], length: 0, sent: 0 }
    }

    /// Whether a new message may be loaded.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.sent >= self.length
    }

    /// Takes a message in place of what has not been sent yet; ask [`Self::is_empty`] first.
    ///
    /// # Errors
    /// [`TooLong`]; then there is nothing to send.
    pub fn load<T: Serialize>(&mut self, tag: u8, message: &T) -> Result<(), TooLong> {
        self.sent = 0;
        self.length = 0;
        self.length = encode(tag, message, &mut self.frame)?;
        Ok(())
    }

    /// Takes the notice of [`encode_notice`] in place of what has not been sent yet.
    pub fn load_notice(&mut self, tag: u8) {
        self.sent = 0;
        self.length = encode_notice(tag, &mut self.frame);
    }

    /// The next byte.
    pub fn next_byte(&mut self) -> Option<u8> {
        let byte = *self.frame.get(..self.length)?.get(self.sent)?;
        self.sent += 1;
        Some(byte)
    }
}

impl Default for Writer {
    fn default() -> Self {
        Self::new()
    }
}

/// A message with the tag of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Tagged<T> {
    /// The tag.
    pub tag: u8,
    /// The message.
    pub message: T,
}

/// What a frame of another version says, which is all that is read of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foreign {
    /// A message with this tag in a version that is not ours: a notice is to answer it.
    Message {
        /// The tag.
        tag: u8,
        /// The version.
        version: u8,
    },
    /// The other end speaks this version, and not ours.
    Notice {
        /// The version.
        version: u8,
    },
}

/// How many frames were dropped, and why. The counts wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, serde::Deserialize, Schema)]
pub struct FrameFaults {
    /// Ended too early: shorter than an envelope, or inside a run of COBS.
    pub truncated: u32,
    /// The checksum is wrong.
    pub corrupted: u32,
    /// Longer than [`FRAME_BYTES`].
    pub oversized: u32,
    /// Whole, but of another version.
    pub other_version: u32,
    /// Whole, but the body is no message of this version, or has bytes after it.
    pub unknown: u32,
}

impl FrameFaults {
    /// All of them.
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.truncated
            .wrapping_add(self.corrupted)
            .wrapping_add(self.oversized)
            .wrapping_add(self.other_version)
            .wrapping_add(self.unknown)
    }

    /// Those of two receivers together.
    #[must_use]
    pub const fn plus(&self, other: &Self) -> Self {
        Self {
            truncated: self.truncated.wrapping_add(other.truncated),
            corrupted: self.corrupted.wrapping_add(other.corrupted),
            oversized: self.oversized.wrapping_add(other.oversized),
            other_version: self.other_version.wrapping_add(other.other_version),
            unknown: self.unknown.wrapping_add(other.unknown),
        }
    }
}

/// Takes bytes one by one and gives the messages among them. A byte inside a frame costs a store and two comparisons;
/// the one that ends it costs the decoding of the whole. So where an interrupt may not take that long, it queues bytes
/// and a task of lower priority gives them to the receiver.
#[derive(Debug)]
pub struct Receiver<T> {
    /// The frame so far, still coded.
    buffer: [u8; FRAME_BYTES],
    length: usize,
    /// The frame is too long already: the rest of it is thrown away.
    overrun: bool,
    faults: FrameFaults,
    foreign: Option<Foreign>,
    messages: PhantomData<T>,
}

impl<T: DeserializeOwned> Receiver<T> {
    /// A receiver that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buffer: [0; FRAME_BYTES],
            length: 0,
            overrun: false,
            faults: FrameFaults { truncated: 0, corrupted: 0, oversized: 0, other_version: 0, unknown: 0 },
            foreign: None,
            messages: PhantomData,
        }
    }

    /// What was dropped so far.
    #[must_use]
    pub const fn faults(&self) -> &FrameFaults {
        &self.faults
    }

    /// The newest frame of another version, once.
    pub const fn take_foreign(&mut self) -> Option<Foreign> {
        self.foreign.take()
    }

    /// Takes the next byte, and gives the message that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Tagged<T>> {
        if byte != 0 {
            match self.buffer.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.overrun = true,
            }
            return None;
        }
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.overrun) {
            count(&mut self.faults.oversized);
            return None;
        }
        if length == 0 {
            return None;
        }
        self.decode(length)
    }

    // One copy: on a board it may be in RAM.
    #[inline(never)]
    fn decode(&mut self, length: usize) -> Option<Tagged<T>> {
        let faults = &mut self.faults;
        let coded = self.buffer.get_mut(..length)?;
        let Ok(decoded) = cobs::decode_in_place(coded) else {
            count(&mut faults.truncated);
            return None;
        };
        let Some((summed, checksum)) = coded.get(..decoded)?.split_last_chunk::<CHECKSUM_BYTES>() else {
            count(&mut faults.truncated);
            return None;
        };
        let [version, tag, body @ ..] = summed else {
            count(&mut faults.truncated);
            return None;
        };
        if CHECKSUM.checksum(summed) != u32::from_le_bytes(*checksum) {
            count(&mut faults.corrupted);
            return None;
        }
        if *version != VERSION {
            count(&mut faults.other_version);
            self.foreign = Some(match (*version, body) {
                (NOTICE_VERSION, [version, ..]) => Foreign::Notice { version: *version },
                _ => Foreign::Message { tag: *tag, version: *version },
            });
            return None;
        }
        match postcard::take_from_bytes::<T>(body) {
            Ok((message, [])) => Some(Tagged { tag: *tag, message }),
            _ => {
                count(&mut faults.unknown);
                None
            }
        }
    }
}

impl<T: DeserializeOwned> Default for Receiver<T> {
    fn default() -> Self {
        Self::new()
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
