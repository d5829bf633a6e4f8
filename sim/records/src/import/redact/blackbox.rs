//! Blackbox: the headers that say how to read it, and the main frames, bit by bit as they are. Each hangs on those before it, so that all
//! of its fields stay.

use std::path::Path;

use super::Copied;
use crate::import::ImportError;
use crate::import::blackbox::check_firmware;
use crate::import::blackbox_frames::{BlackboxLog, logs};

/// Headers that a reader needs, beside those that begin with [`FIELDS`].
const HEADERS: [&str; 16] = [
    "Product",
    "Data version",
    "I interval",
    "P interval",
    "Firmware type",
    "Firmware revision",
    "blackbox_high_resolution",
    "debug_mode",
    "features",
    "looptime",
    "minthrottle",
    "motorOutput",
    "motor_poles",
    "motor_pwm_protocol",
    "pid_process_denom",
    "vbatref",
];
/// How headers begin that say what a frame has.
const FIELDS: &str = "Field ";
/// What closes a log, behind its mark.
const END: &[u8] = b"E\xffEnd of log\0";

/// The copy of a file of blackbox logs.
pub(in crate::import) fn copy(file: &Path, bytes: &[u8]) -> Result<Option<Copied>, ImportError> {
    let logs = logs(bytes);
    if logs.is_empty() {
        return Ok(None);
    }
    let mut copied = Copied::default();
    let in_front = bytes.len() - logs.iter().map(|log| log.len()).sum::<usize>();
    copied.dropped.add("byte in front of the log", "", in_front);
    let is_alone = logs.len() == 1;
    for bytes_of_log in logs {
        let offset = bytes_of_log.as_ptr() as usize - bytes.as_ptr() as usize;
        let log = match read(file, offset, bytes_of_log) {
            Ok(log) => log,
            Err(error) if is_alone => return Err(error),
            Err(_) => {
                // Its first line stays, by which the others keep their numbers.
                copied.bytes.extend(bytes_of_log.split_inclusive(|byte| *byte == b'\n').next().unwrap_or_default());
                copied.dropped.add("log that cannot be read", "", 1);
                continue;
            }
        };
        let headers = bytes_of_log.len() - log.frames().len();
        for line in bytes_of_log[..headers].split_inclusive(|byte| *byte == b'\n') {
            let name = String::from_utf8_lossy(line.get(2..).unwrap_or_default());
            let name = name.split(':').next().unwrap_or_default();
            if HEADERS.contains(&name) || name.starts_with(FIELDS) {
                copied.bytes.extend(line);
            } else {
                copied.dropped.add("header", name, 1);
            }
        }
        let mut seen = 0;
        let rows = log.rows_and_show([], |frame, is_kept| {
            seen += frame.len();
            match frame[0] {
                b'I' | b'P' | b'E' if is_kept => copied.bytes.extend(frame),
                b'I' | b'P' => copied.dropped.add("frame behind damage", "", 1),
                kind => copied.dropped.add("frame", &char::from(kind).to_string(), 1),
            }
        });
        if rows.closed {
            copied.bytes.extend(END);
            seen += END.len();
        }
        copied.dropped.add("byte of no frame", "", log.frames().len().saturating_sub(seen));
        copied.kept.extend(log.names.iter().map(ToString::to_string));
    }
    copied.kept.sort_unstable();
    copied.kept.dedup();
    Ok(Some(copied))
}

/// A log that begins at `offset` in the file, of Betaflight: others have positions in their main frames.
fn read<'a>(file: &Path, offset: usize, bytes: &'a [u8]) -> Result<BlackboxLog<'a>, ImportError> {
    let log = BlackboxLog::read(bytes).map_err(|damage| ImportError::Damaged {
        file: file.into(),
        offset: offset + damage.offset,
        problem: damage.problem,
    })?;
    check_firmware(file, &log)?;
    Ok(log)
}
