//! ULog: the topics that are read, their formats, and the parameter that bends a command.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use super::{Copied, without};
use crate::import::ImportError;
use crate::import::ulog::{THRUST_FACTOR, TOPICS};
use crate::import::ulog_messages::{HEADER, UlogLog, each_message, is_ulog, parameter};

/// Flags and offsets of appended parts: a copy has all in one.
const NO_FLAGS: [u8; 40] = [0; 40];
/// Number of a topic in front of its data.
const NUMBER: usize = 2;

/// The copy of a ULog.
pub(in crate::import) fn copy(file: &Path, bytes: &[u8]) -> Result<Option<Copied>, ImportError> {
    if !is_ulog(bytes) {
        return Ok(None);
    }
    let damaged = |damage: crate::import::mat5::Damage| ImportError::Damaged {
        file: file.into(),
        offset: damage.offset,
        problem: damage.problem,
    };
    let log = UlogLog::read(bytes, &TOPICS).map_err(damaged)?;
    let formats = log.formats_of(&TOPICS);
    let letters = TOPICS.map(|topic| log.letters(topic));
    let mut copied = Copied { bytes: bytes[..HEADER.min(bytes.len())].to_vec(), ..Copied::default() };
    let mut topics: HashMap<u16, &str> = HashMap::new();
    let mut kept = BTreeSet::new();
    each_message(bytes, |kind, data| {
        let text = |bytes| str::from_utf8(bytes).unwrap_or_default();
        let mut keep = |data: &[u8]| {
            copied.bytes.extend((data.len() as u16).to_le_bytes());
            copied.bytes.push(kind);
            copied.bytes.extend(data);
        };
        match kind {
            b'B' => keep(&NO_FLAGS[..data.len().min(NO_FLAGS.len())]),
            b'F' if formats.contains(text(data).split(':').next().unwrap_or_default()) => keep(data),
            b'F' => {}
            b'A' => {
                let (head, name) = data.split_at_checked(3).ok_or("a subscription that is too short")?;
                topics.insert(u16::from_le_bytes([head[1], head[2]]), text(name));
                if TOPICS.contains(&text(name)) {
                    keep(data);
                }
            }
            b'D' => {
                let number = data.first_chunk::<NUMBER>().ok_or("data of no topic")?;
                let name = topics.get(&u16::from_le_bytes(*number)).copied().unwrap_or_default();
                match TOPICS.iter().position(|topic| *topic == name) {
                    Some(topic) => {
                        let behind_number = |range: &std::ops::Range<usize>| range.start + NUMBER..range.end + NUMBER;
                        keep(&without(data, letters[topic].iter().map(behind_number)));
                        kept.insert(name);
                    }
                    None => copied.dropped.add("message", name, 1),
                }
            }
            b'P' => match parameter(data) {
                Some((THRUST_FACTOR, _)) => {
                    keep(data);
                    kept.insert(THRUST_FACTOR);
                }
                _ => copied.dropped.add("parameter", "", 1),
            },
            b'O' => keep(data),
            b'I' | b'M' => {
                // The key is behind its length, and in a part of several behind a flag.
                let key = &data[usize::from(kind == b'M').min(data.len())..];
                let key = key.split_first().and_then(|(length, key)| key.get(..usize::from(*length)));
                copied.dropped.add("information", text(key.unwrap_or_default()), 1);
            }
            b'L' | b'C' => copied.dropped.add("logged text", "", 1),
            _ => copied.dropped.add("other message", "", 1),
        }
        Ok(())
    })
    .map_err(damaged)?;
    copied.kept = kept.into_iter().map(String::from).collect();
    Ok(Some(copied))
}
