//! What is kept over a reset: why the firmware could not go on.
//!
//! The record lies in RAM that start-up does not clear, with a checksum: RAM survives every reset but the loss of power. A board
//! owns that memory; what stands in it is the same for all.

use crate::link::{PANIC_FILE_BYTES, PanicPlace, ResetReason};

const PANIC: u32 = 1;
const FAULT: u32 = 2;
const CRYSTAL_LOST: u32 = 3;
const STRAY: u32 = 4;
const SUPPLY_LOW: u32 = 5;

/// Why the firmware ended, in words, and the checksum of these. Any bits are a record, and only those that were written as one
/// have a reason.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Record {
    kind: u32,
    words: [u32; 2],
    file: [u8; PANIC_FILE_BYTES],
    checksum: u32,
}

impl Record {
    const fn new(kind: u32, words: [u32; 2], file: [u8; PANIC_FILE_BYTES]) -> Self {
        let mut record = Self { kind, words, file, checksum: 0 };
        record.checksum = record.sum();
        record
    }

    /// Of a panic. Of the file's name the end is kept, which tells files apart.
    #[must_use]
    pub fn panic(line: u32, file: &str) -> Self {
        let mut name = [0; PANIC_FILE_BYTES];
        for (to, from) in name.iter_mut().rev().zip(file.bytes().rev()) {
            *to = from;
        }
        Self::new(PANIC, [line, 0], name)
    }

    /// Of a fault of the core.
    #[must_use]
    pub const fn fault(program_counter: u32, status: u32) -> Self {
        Self::new(FAULT, [program_counter, status], [0; PANIC_FILE_BYTES])
    }

    /// The crystal stopped.
    #[must_use]
    pub const fn crystal_lost() -> Self {
        Self::new(CRYSTAL_LOST, [0; 2], [0; PANIC_FILE_BYTES])
    }

    /// An interrupt that nobody handles.
    #[must_use]
    pub const fn stray_interrupt(number: i16) -> Self {
        Self::new(STRAY, [number as u32, 0], [0; PANIC_FILE_BYTES])
    }

    /// The supply fell.
    #[must_use]
    pub const fn supply_low() -> Self {
        Self::new(SUPPLY_LOW, [0; 2], [0; PANIC_FILE_BYTES])
    }

    /// What it says; `None` where nothing was recorded.
    #[must_use]
    pub fn reason(&self) -> Option<ResetReason> {
        if self.checksum != self.sum() {
            return None;
        }
        Some(match self.kind {
            PANIC => ResetReason::Panic(PanicPlace { line: self.words[0], file: self.file }),
            FAULT => ResetReason::Fault { program_counter: self.words[0], status: self.words[1] },
            CRYSTAL_LOST => ResetReason::CrystalLost,
            STRAY => ResetReason::StrayInterrupt(self.words[0] as i16),
            SUPPLY_LOW => ResetReason::SupplyLow,
            _ => return None,
        })
    }

    /// FNV-1a over everything before the checksum. Memory that lost its power does not match by accident.
    const fn sum(&self) -> u32 {
        let mut hash: u32 = 0x811C_9DC5;
        let words = [self.kind, self.words[0], self.words[1]];
        let mut n = 0;
        while n < words.len() {
            hash = (hash ^ words[n]).wrapping_mul(0x0100_0193);
            n += 1;
        }
        n = 0;
        while n < PANIC_FILE_BYTES {
            hash = (hash ^ self.file[n] as u32).wrapping_mul(0x0100_0193);
            n += 1;
        }
        hash
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_says_what_was_recorded_and_other_bits_say_nothing() {
        let panic = Record::panic(77, "src/somewhere/with_a_long_name.rs");
        let Some(ResetReason::Panic(PanicPlace { line: 77, file })) = panic.reason() else { panic!("{panic:?}") };
        assert!(file.ends_with(b"name.rs"), "{file:?}");
        assert_eq!(
            Record::fault(0x1000_0123, 5).reason(),
            Some(ResetReason::Fault { program_counter: 0x1000_0123, status: 5 })
        );
        assert_eq!(Record::crystal_lost().reason(), Some(ResetReason::CrystalLost));
        assert_eq!(Record::stray_interrupt(-3).reason(), Some(ResetReason::StrayInterrupt(-3)));
        assert_eq!(Record::supply_low().reason(), Some(ResetReason::SupplyLow));
        for filler in [0, 0xff] {
            let bits = u32::from_ne_bytes([filler; 4]);
            let noise = Record { kind: bits, words: [bits; 2], file: [filler; PANIC_FILE_BYTES], checksum: bits };
            assert_eq!(noise.reason(), None);
        }
        assert_eq!(Record { words: [78, 0], ..panic }.reason(), None);
    }
}
