//! The ULog container (PX4, *ULog File Format*): a header, then messages of a length, a type and data.
//! Formats name the fields of a topic, subscriptions give a topic a number, data carry that number.
//!
//! A log often ends within a message, because the battery went: what is whole is taken, and said so.
//! Nested types are followed one level deep, which `esc_status` needs.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use super::mat5::Damage;

const MAGIC: &[u8] = b"ULog\x01\x12\x35";
pub(super) const HEADER: usize = 16;
/// The one incompatible flag that is known: data were appended after the log was closed.
const DATA_APPENDED: u8 = 1;

/// Whether `bytes` begin as a ULog.
pub(super) fn is_ulog(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// A log, as far as it is needed.
pub(super) struct UlogLog<'a> {
    formats: HashMap<&'a str, Vec<Field<'a>>>,
    pub(super) topics: Vec<Topic<'a>>,
    /// By their names; of those that are changed the last value.
    parameters: HashMap<&'a str, f64>,
    /// Gaps that the logger itself wrote down.
    pub(super) dropouts: usize,
    /// Whether it ends within a message.
    pub(super) cut: bool,
    /// Whether anything was logged behind the definitions.
    pub(super) logged: bool,
}

/// One instance of a logged topic.
pub(super) struct Topic<'a> {
    pub(super) name: &'a str,
    pub(super) instance: u8,
    /// The messages' data, without their number.
    pub(super) rows: Vec<&'a [u8]>,
}

/// A field of a format: `float[16] output`.
struct Field<'a> {
    kind: &'a str,
    count: usize,
    name: &'a str,
}

/// Where a number is in a topic's data, and its type.
#[derive(Clone, Copy)]
pub(super) struct UlogNumber<'a> {
    kind: &'a str,
    offset: usize,
}

impl UlogNumber<'_> {
    /// The number; `None` where the message is too short.
    pub(super) fn read(self, row: &[u8]) -> Option<f64> {
        let data = row.get(self.offset..)?;
        macro_rules! number {
            ($type:ty) => {
                <$type>::from_le_bytes(*data.first_chunk()?) as f64
            };
        }
        Some(match self.kind {
            "int8_t" => number!(i8),
            "uint8_t" | "bool" | "char" => number!(u8),
            "int16_t" => number!(i16),
            "uint16_t" => number!(u16),
            "int32_t" => number!(i32),
            "uint32_t" => number!(u32),
            "int64_t" => number!(i64),
            "uint64_t" => number!(u64),
            "float" => number!(f32),
            "double" => number!(f64),
            _ => return None,
        })
    }
}

/// Name and value of a parameter: the length of its key, which has its type and its name, and the value.
pub(super) fn parameter(data: &[u8]) -> Option<(&str, f64)> {
    let (length, rest) = data.split_first()?;
    let (key, value) = rest.split_at_checked(usize::from(*length))?;
    let (kind, name) = str::from_utf8(key).ok()?.split_once(' ')?;
    Some((name, UlogNumber { kind, offset: 0 }.read(value)?))
}

fn width(kind: &str) -> Option<usize> {
    Some(match kind {
        "int8_t" | "uint8_t" | "bool" | "char" => 1,
        "int16_t" | "uint16_t" => 2,
        "int32_t" | "uint32_t" | "float" => 4,
        "int64_t" | "uint64_t" | "double" => 8,
        _ => return None,
    })
}

impl<'a> UlogLog<'a> {
    /// Reads the messages of the topics that are `wanted`; of others the name alone is kept.
    pub(super) fn read(bytes: &'a [u8], wanted: &[&str]) -> Result<Self, Damage> {
        let mut log = Self {
            formats: HashMap::new(),
            topics: Vec::new(),
            parameters: HashMap::new(),
            dropouts: 0,
            cut: false,
            logged: false,
        };
        let mut numbers: HashMap<u16, usize> = HashMap::new();
        log.cut = each_message(bytes, |kind, data| log.message(kind, data, wanted, &mut numbers))?;
        Ok(log)
    }

    fn message(
        &mut self,
        kind: u8,
        data: &'a [u8],
        wanted: &[&str],
        numbers: &mut HashMap<u16, usize>,
    ) -> Result<(), &'static str> {
        match kind {
            b'F' => {
                let (name, fields) = format(data).ok_or("a message format that cannot be read")?;
                self.formats.insert(name, fields);
            }
            b'A' => {
                let ([instance, low, high], name) =
                    data.split_first_chunk::<3>().ok_or("a subscription that is too short")?;
                let name = str::from_utf8(name).map_err(|_| "a subscription whose topic is no text")?;
                numbers.insert(u16::from_le_bytes([*low, *high]), self.topics.len());
                self.topics.push(Topic { name, instance: *instance, rows: Vec::new() });
            }
            b'D' => {
                self.logged = true;
                let (number, row) = data.split_first_chunk::<2>().ok_or("data of no topic")?;
                // Data without a subscription belong to what was lost.
                let topic = numbers.get(&u16::from_le_bytes(*number)).map(|&at| &mut self.topics[at]);
                if let Some(topic) = topic.filter(|t| wanted.contains(&t.name)) {
                    topic.rows.push(row);
                }
            }
            b'P' => {
                // One that cannot be read is one that is not there.
                if let Some((name, value)) = parameter(data) {
                    self.parameters.insert(name, value);
                }
            }
            b'O' => self.dropouts += 1,
            _ => {}
        }
        Ok(())
    }

    /// A parameter; `None` where the log does not have it.
    pub(super) fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).copied()
    }

    /// The instance of `name` with the lowest number that has data.
    pub(super) fn topic(&self, name: &str) -> Option<&Topic<'a>> {
        self.topics.iter().filter(|t| t.name == name && !t.rows.is_empty()).min_by_key(|t| t.instance)
    }

    /// Where `field[index]` of `topic` is, or `field[index].inner`; `None`: there is none.
    pub(super) fn place(&self, topic: &str, field: &str, index: usize, inner: Option<&str>) -> Option<UlogNumber<'a>> {
        let mut offset = 0_usize;
        // Each type is measured once: a format may have thousands of fields of another such.
        let mut sizes = HashMap::new();
        for part in self.formats.get(topic)? {
            let size = (*sizes.entry(part.kind).or_insert_with(|| self.size(part.kind)))?;
            if part.name == field && index < part.count {
                let start = size.checked_mul(index)?.checked_add(offset)?;
                return match inner {
                    None => width(part.kind).map(|_| UlogNumber { kind: part.kind, offset: start }),
                    Some(inner) => self.inner(part.kind, inner, start),
                };
            }
            offset = offset.checked_add(size.checked_mul(part.count)?)?;
        }
        None
    }

    fn inner(&self, format: &str, field: &str, mut offset: usize) -> Option<UlogNumber<'a>> {
        for part in self.formats.get(format)? {
            if part.name == field {
                return Some(UlogNumber { kind: part.kind, offset });
            }
            offset = offset.checked_add(width(part.kind)?.checked_mul(part.count)?)?;
        }
        None
    }

    /// The formats of these topics and of what is in them, by name.
    pub(super) fn formats_of(&self, topics: &[&'a str]) -> BTreeSet<&'a str> {
        let inner = topics.iter().filter_map(|topic| self.formats.get(topic)).flatten().map(|field| field.kind);
        topics.iter().copied().chain(inner).filter(|name| self.formats.contains_key(name)).collect()
    }

    /// Where the letters of a topic's data are.
    pub(super) fn letters(&self, topic: &str) -> Vec<Range<usize>> {
        let (mut at, mut letters) = (0_usize, Vec::new());
        for field in self.formats.get(topic).into_iter().flatten() {
            let Some(size) = self.size(field.kind).and_then(|size| size.checked_mul(field.count)) else { break };
            let is_of_letters = |field: &Field<'_>| field.kind == "char";
            let has_letters = self.formats.get(field.kind).is_some_and(|inner| inner.iter().any(is_of_letters));
            // Reports with names in them have none of the numbers' places: all of such a field goes.
            if is_of_letters(field) || has_letters {
                letters.push(at..at.saturating_add(size));
            }
            at = at.saturating_add(size);
        }
        letters
    }

    /// Bytes of a type: a number's, or those of a format of numbers.
    fn size(&self, kind: &str) -> Option<usize> {
        width(kind).or_else(|| {
            let parts = self.formats.get(kind)?.iter();
            parts.map(|p| width(p.kind)?.checked_mul(p.count)).try_fold(0_usize, |sum, size| sum.checked_add(size?))
        })
    }
}

/// Shows each whole message of a log to `see`, which says what is wrong with it; whether the log ends within one.
pub(super) fn each_message<'a>(
    bytes: &'a [u8],
    mut see: impl FnMut(u8, &'a [u8]) -> Result<(), &'static str>,
) -> Result<bool, Damage> {
    // Where parts begin that were appended later: a message before may be cut short there.
    let mut starts = appended(bytes)?;
    starts.push(bytes.len());
    let (mut at, mut is_cut) = (HEADER.min(bytes.len()), false);
    for end in starts {
        while let Some(([low, high, kind], rest)) = bytes.get(at..end).and_then(|b| b.split_first_chunk::<3>()) {
            let Some(data) = rest.get(..usize::from(u16::from_le_bytes([*low, *high]))) else {
                break;
            };
            see(*kind, data).map_err(|problem| Damage { offset: at, problem })?;
            at += 3 + data.len();
        }
        is_cut |= at < end && end == bytes.len();
        at = at.max(end);
    }
    Ok(is_cut)
}

/// `topic:float[16] output;uint8_t x;`
fn format(data: &[u8]) -> Option<(&str, Vec<Field<'_>>)> {
    let (name, fields) = str::from_utf8(data).ok()?.split_once(':')?;
    let fields = fields.split(';').filter(|f| !f.is_empty()).map(|field| {
        let (kind, name) = field.split_once(' ')?;
        let (kind, count) = match kind.split_once('[') {
            Some((kind, count)) => (kind, count.strip_suffix(']')?.parse().ok()?),
            None => (kind, 1),
        };
        Some(Field { kind, count, name })
    });
    Some((name, fields.collect::<Option<_>>()?))
}

/// Where appended parts begin, from the flags that follow the header.
fn appended(bytes: &[u8]) -> Result<Vec<usize>, Damage> {
    let Some(message) = bytes.get(HEADER..HEADER + 43).filter(|m| m[2] == b'B') else {
        return Ok(Vec::new());
    };
    let (incompatible, offsets) = (&message[11..19], &message[19..43]);
    if incompatible[0] & !DATA_APPENDED != 0 || incompatible[1..].iter().any(|&b| b != 0) {
        return Err(Damage { offset: HEADER, problem: "flags of a newer ULog, which cannot be read" });
    }
    let starts = offsets.as_chunks::<8>().0.iter().map(|o| u64::from_le_bytes(*o));
    let mut starts: Vec<usize> = starts.filter_map(|o| usize::try_from(o).ok()).collect();
    starts.retain(|&o| o > HEADER && o < bytes.len());
    starts.sort_unstable();
    Ok(starts)
}
