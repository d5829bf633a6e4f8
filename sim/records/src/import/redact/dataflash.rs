//! DataFlash: the messages that are read, their formats, and the parameters of motors and pulse widths.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Copied, without};
use crate::import::ImportError;
use crate::import::dataflash::{MESSAGES, is_read};
use crate::import::dataflash_messages::{DataFlashLog, is_dataflash, is_format};

/// Messages that say what others look like.
const FORMAT: &str = "FMT";
/// Messages with a parameter's name and value.
const PARAMETER: &str = "PARM";

/// The copy of a DataFlash log.
pub(in crate::import) fn copy(_file: &Path, bytes: &[u8]) -> Result<Option<Copied>, ImportError> {
    if !is_dataflash(bytes) {
        return Ok(None);
    }
    let mut copied = Copied::default();
    let mut kept = BTreeSet::new();
    let log = DataFlashLog::read_and_show(bytes, &[], |messages, message| {
        let name = messages.name;
        let is_kept = MESSAGES.contains(&name);
        if is_format(message) {
            if is_kept || [FORMAT, PARAMETER].contains(&name) {
                copied.bytes.extend(message);
            }
        } else if is_kept {
            copied.bytes.extend(without(message, messages.words()));
            kept.insert(name);
        } else if name == PARAMETER && messages.text("Name", message).is_some_and(is_read) {
            copied.bytes.extend(message);
            kept.insert(name);
        } else {
            let (kind, name) = if name == PARAMETER { ("parameter", "") } else { ("message", name) };
            copied.dropped.add(kind, name, 1);
        }
    });
    copied.dropped.add("damaged byte", "", log.bytes_lost);
    copied.kept = kept.into_iter().map(String::from).collect();
    Ok(Some(copied))
}
