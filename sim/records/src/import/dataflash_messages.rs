//! The DataFlash container (ArduPilot): messages that begin with two fixed bytes and their type. Messages `FMT` say how long those
//! of a type are, what they are called, and the kind and label of each field.
//!
//! Between damaged bytes messages are found again by their beginning; a log that ends within a message gives all whole ones.

use std::collections::BTreeMap;
use std::ops::Range;

const HEAD: [u8; 2] = [0xa3, 0x95];
const HEAD_LENGTH: usize = 3;
/// The type of `FMT`, which a log begins with.
const FMT: u8 = 128;
/// Head, type, length, name, kinds and labels.
const FMT_LENGTH: usize = HEAD_LENGTH + 1 + 1 + 4 + 16 + 64;

/// Whether a message says what others look like.
pub(super) fn is_format(message: &[u8]) -> bool {
    message.get(2) == Some(&FMT)
}

/// Whether `bytes` begin as a DataFlash log.
pub(super) fn is_dataflash(bytes: &[u8]) -> bool {
    bytes.starts_with(&[HEAD[0], HEAD[1], FMT])
}

/// A log, as far as it is needed.
pub(super) struct DataFlashLog<'a> {
    messages: Vec<Messages<'a>>,
    parameters: BTreeMap<&'a str, Vec<(f64, f64)>>,
    /// Places where bytes belong to no message.
    pub(super) damaged: usize,
    /// Where the first of them is.
    pub(super) first_damage: usize,
    /// Bytes that belong to no message.
    pub(super) bytes_lost: usize,
    /// Whether it ends within a message.
    pub(super) cut: bool,
}

/// All messages of one name.
pub(super) struct Messages<'a> {
    pub(super) name: &'a str,
    kinds: &'a [u8],
    labels: &'a str,
    length: usize,
    /// Behind their heads; none of messages that nobody asked for.
    pub(super) rows: Vec<&'a [u8]>,
    pub(super) count: usize,
}

/// Where a number is in a message, and its kind.
#[derive(Clone, Copy)]
pub(super) struct DataFlashNumber {
    kind: u8,
    offset: usize,
}

impl DataFlashNumber {
    /// The number; `None` where the message is too short or the field is none.
    pub(super) fn read(self, row: &[u8]) -> Option<f64> {
        let data = row.get(self.offset..)?;
        macro_rules! number {
            ($type:ty) => {
                <$type>::from_le_bytes(*data.first_chunk()?) as f64
            };
        }
        Some(match self.kind {
            b'b' => number!(i8),
            b'B' | b'M' => number!(u8),
            b'h' => number!(i16),
            b'H' => number!(u16),
            b'i' => number!(i32),
            b'I' => number!(u32),
            b'q' => number!(i64),
            b'Q' => number!(u64),
            b'f' => number!(f32),
            b'd' => number!(f64),
            // Hundredths.
            b'c' => number!(i16) / 100.0,
            b'C' => number!(u16) / 100.0,
            b'e' => number!(i32) / 100.0,
            b'E' => number!(u32) / 100.0,
            _ => return None,
        })
    }
}

/// Bytes of a field.
fn width(kind: u8) -> Option<usize> {
    Some(match kind {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'f' | b'e' | b'E' | b'L' | b'n' => 4,
        b'q' | b'Q' | b'd' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => return None,
    })
}

impl<'a> Messages<'a> {
    /// Where the field `label` is.
    pub(super) fn place(&self, label: &str) -> Option<DataFlashNumber> {
        let mut offset = 0;
        for (&kind, found) in self.kinds.iter().zip(self.labels.split(',')) {
            if found == label {
                return Some(DataFlashNumber { kind, offset });
            }
            offset += width(kind)?;
        }
        None
    }

    /// Where the letters and the places on earth are in a message with its head.
    pub(super) fn words(&self) -> Vec<Range<usize>> {
        let (mut at, mut words) = (HEAD_LENGTH, Vec::new());
        for &kind in self.kinds {
            let Some(width) = width(kind) else { break };
            if matches!(kind, b'n' | b'N' | b'Z' | b'L') {
                words.push(at..at + width);
            }
            at += width;
        }
        words
    }

    /// The text of the field `label` in a message with its head.
    pub(super) fn text<'m>(&self, label: &str, message: &'m [u8]) -> Option<&'m str> {
        let DataFlashNumber { kind, offset } = self.place(label)?;
        let text = message.get(HEAD_LENGTH + offset..)?.get(..width(kind)?)?;
        str::from_utf8(trimmed(text)).ok()
    }

    /// What `FMT` says, behind its head.
    fn from_format(format: &'a [u8]) -> Option<(u8, Self)> {
        let ([kind, length], text) = format.split_first_chunk::<2>()?;
        let (name, text) = text.split_at_checked(4)?;
        let (kinds, labels) = text.split_at_checked(16)?;
        let length = usize::from(*length).checked_sub(HEAD_LENGTH)?;
        let (name, labels) = (str::from_utf8(trimmed(name)).ok()?, str::from_utf8(trimmed(labels)).ok()?);
        Some((*kind, Self { name, kinds: trimmed(kinds), labels, length, rows: Vec::new(), count: 0 }))
    }

    fn is_like(&self, other: &Self) -> bool {
        (self.name, self.kinds, self.labels, self.length) == (other.name, other.kinds, other.labels, other.length)
    }
}

/// Text up to its first zero.
fn trimmed(text: &[u8]) -> &[u8] {
    memchr::memchr(0, text).map_or(text, |end| &text[..end])
}

impl<'a> DataFlashLog<'a> {
    /// Reads the messages that are `wanted`, and the parameters; of others their number is kept.
    pub(super) fn read(bytes: &'a [u8], wanted: &[&str]) -> Self {
        Self::read_and_show(bytes, wanted, |_, _| {})
    }

    /// The same, which shows each message to `see` with what is known of its kind; of a message `FMT`, of the kind that it describes.
    pub(super) fn read_and_show(
        bytes: &'a [u8],
        wanted: &[&str],
        mut see: impl FnMut(&Messages<'a>, &'a [u8]),
    ) -> Self {
        let mut log = Self {
            messages: Vec::new(),
            parameters: BTreeMap::new(),
            damaged: 0,
            first_damage: 0,
            bytes_lost: 0,
            cut: false,
        };
        let mut places = [None::<usize>; 256];
        let (mut at, mut is_whole) = (0, true);
        while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
            let step = log.message(rest, &mut places, wanted);
            if let Some(length) = step {
                is_whole = true;
                let kind = if rest[2] == FMT { rest[HEAD_LENGTH] } else { rest[2] };
                if let Some(place) = places[usize::from(kind)] {
                    see(&log.messages[place], &rest[..length]);
                }
                at += length;
                continue;
            }
            // A head among damaged bytes may promise more than there is; behind whole messages it is the end of the log.
            if is_whole && log.promises_more(rest, &places) {
                log.cut = true;
                break;
            }
            if is_whole {
                log.first_damage = if log.damaged == 0 { at } else { log.first_damage };
                log.damaged += 1;
                is_whole = false;
            }
            let next = memchr::memchr(HEAD[0], &rest[1..]).map_or(rest.len(), |next| next + 1);
            log.bytes_lost += next;
            at += next;
        }
        log
    }

    /// Takes the message that `rest` begins with, and says how long it is; `None` where it begins with none.
    fn message(&mut self, rest: &'a [u8], places: &mut [Option<usize>; 256], wanted: &[&str]) -> Option<usize> {
        let length = self.length(rest, places)?;
        let body = rest.get(HEAD_LENGTH..length)?;
        if rest[2] == FMT {
            let (kind, messages) = Messages::from_format(body)?;
            let place = &mut places[usize::from(kind)];
            if place.is_none_or(|known| !self.messages[known].is_like(&messages)) {
                *place = Some(self.messages.len());
                self.messages.push(messages);
            }
        } else if let Some(place) = places[usize::from(rest[2])] {
            self.take(place, body, wanted);
        }
        Some(length)
    }

    /// How long the message is whose head `rest` begins with; `None` where that is the head of none.
    fn length(&self, rest: &[u8], places: &[Option<usize>; 256]) -> Option<usize> {
        let ([a, b, kind], _) = rest.split_first_chunk()?;
        match *kind {
            _ if [*a, *b] != HEAD => None,
            FMT => Some(FMT_LENGTH),
            kind => Some(HEAD_LENGTH + self.messages[places[usize::from(kind)]?].length),
        }
    }

    /// Whether `rest` is the beginning of a message that is longer.
    fn promises_more(&self, rest: &[u8], places: &[Option<usize>; 256]) -> bool {
        let is_part_of_head = rest.len() < HEAD_LENGTH && HEAD.starts_with(&rest[..rest.len().min(HEAD.len())]);
        is_part_of_head || self.length(rest, places).is_some_and(|length| length > rest.len())
    }

    fn take(&mut self, place: usize, body: &'a [u8], wanted: &[&str]) {
        let messages = &mut self.messages[place];
        messages.count += 1;
        if wanted.contains(&messages.name) {
            messages.rows.push(body);
        } else if messages.name == "PARM"
            && let (Some(name), Some(value)) = (messages.place("Name"), messages.place("Value"))
            && let (Some(name), Some(value)) = (body.get(name.offset..name.offset + 16), value.read(body))
            && let Ok(name) = str::from_utf8(trimmed(name))
        {
            let time_us = messages.place("TimeUS").and_then(|time| time.read(body)).unwrap_or(0.0);
            self.parameters.entry(name).or_default().push((time_us, value));
        }
    }

    /// The messages of this name, of which there is one or more.
    pub(super) fn messages(&self, name: &str) -> Option<&Messages<'a>> {
        self.messages.iter().find(|messages| messages.name == name && !messages.rows.is_empty())
    }

    /// What was logged.
    pub(super) fn logged(&self) -> impl Iterator<Item = &Messages<'a>> {
        self.messages.iter().filter(|messages| messages.count > 0)
    }

    /// The value that a parameter had at this time, microseconds: the last one before, else the first.
    pub(super) fn parameter(&self, name: &str, at_us: f64) -> Option<f64> {
        let values = self.parameters.get(name)?;
        let before = values.iter().rev().find(|(time_us, _)| *time_us <= at_us);
        before.or(values.first()).map(|(_, value)| *value)
    }
}
