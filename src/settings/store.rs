//! Settings in flash: two copies, of which one is whole at any time.
//!
//! Each copy has an erase sector of its own, which is written as a log: a save goes to the first slot of
//! [`SLOT_BYTES`] behind the last used one, and the sector is erased only when it is full (a 128 KiB sector of an
//! STM32F405 stalls the core for up to two seconds; with this, once in 256 saves). The copy is what the last used slot
//! holds.
//!
//! ```text
//! slot: magic u32 | layout u16 | length u16 | sequence u32 | settings (postcard) | crc32 u32     little-endian
//! ```
//!
//! The checksum (CRC-32/ISCSI, as on the link) runs from `magic` to the end of the settings. A save writes the copy
//! that is not the newest, reads it back, and only then the other: wherever the power goes, one of the two sectors
//! holds the old set or the new one. A set whose two copies are both bad is not replaced by an older one from the
//! logs, which nobody would expect to come back, but by the defaults, and that is reported.
//!
//! # Why not a general store
//!
//! Two sectors of 128 KiB are all there is, and general stores need both for one map: all copies of a key lie in one
//! sector but for the moment of a move, behind one page marker. `sequential-storage` 8.0.2 (its map, uncached, a pair of
//! keys for the two copies, each with a number of its own) under the flash that the tests of this module cut and corrupt:
//!
//! | | `sequential-storage` | this module |
//! |---|---|---|
//! | one wrong byte, of all that are not blank, with any of 4 values | the first byte of the page: both copies are gone, as if nothing had ever been saved | the set that was stored, always |
//! | power cut at any byte of a save that erases nothing | the old or the new set | the same |
//! | power cut at any byte of an erase from the first byte on | the old or the new set | the same |
//! | power cut at any byte of an erase from the last byte on, 2 KiB sectors | neither set in 1803 of 2536 places; no save works after 2047 of them | the old or the new set |
//! | the same, 128 KiB sectors, every 997th place | neither set in 131 of 132, nor does a save work after | the old or the new set |
//!
//! Nothing says in which order a flash loses the bits of a sector that it erases. With a map for each copy, and so four
//! sectors of which the program would lose two, the first row would not stand against it; the last two would.

use core::fmt;

use embedded_storage::nor_flash::NorFlash;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Settings, Validated};
use crate::link::CHECKSUM;

/// Bytes of a slot.
pub const SLOT_BYTES: usize = 512;

/// `RLST`, little-endian.
const MAGIC: [u8; 4] = *b"RLST";
/// Number of the settings' layout. Settings of another layout are bad: a new firmware starts from its defaults.
const LAYOUT: u16 = 1;
const HEADER_BYTES: usize = 12;
const CHECKSUM_BYTES: usize = 4;
/// An erased byte.
const ERASED: u8 = 0xff;

/// Where the settings in use come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Origin {
    /// Both copies in flash are whole and the same.
    Stored,
    /// One copy is bad, or older than the other: a save was interrupted, or the flash has lost bits. The next save
    /// mends it.
    StoredOnce,
    /// Nothing was ever saved: the defaults.
    DefaultsBlank,
    /// Both copies are bad: the defaults.
    DefaultsBad,
}

/// What [`Store::load`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The settings to use.
    pub settings: Validated,
    /// Where they come from.
    pub origin: Origin,
}

/// Why a save failed. The old settings are still stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// The flash driver refused to read, write or erase.
    Flash,
    /// What was written does not read back: worn out, or write protected.
    ReadBack,
    /// The flash's write size does not divide a slot, or a sector holds no slot.
    Geometry,
}

impl fmt::Display for SaveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Flash => "the flash refused the operation",
            Self::ReadBack => "the flash does not hold what was written: worn out, or write protected",
            Self::Geometry => "the sectors of this flash do not suit",
        })
    }
}

impl core::error::Error for SaveError {}

/// The settings' place in flash.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    sectors: [u32; 2],
}

/// What a sector holds.
#[derive(Clone, Debug, PartialEq)]
enum Copy {
    Blank,
    Bad,
    Whole { sequence: u32, settings: Validated },
}

/// A sector, as far as a save needs to know it.
struct Sector {
    copy: Copy,
    /// The slot behind the last used one; the number of slots when there is none.
    free: u32,
}

impl<F: NorFlash> Store<F> {
    /// Settings in the two sectors of [`NorFlash::ERASE_SIZE`] bytes that start at the offsets `sectors` of `flash`.
    pub const fn new(flash: F, sectors: [u32; 2]) -> Self {
        Self { flash, sectors }
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Reads the settings, and never writes. A copy that cannot be read, has the wrong checksum or layout, or holds
    /// settings that are refused, is bad.
    pub fn load(&mut self) -> Loaded {
        let copies = self.sectors.map(|sector| self.sector(sector).copy);
        let loaded = |settings, origin| Loaded { settings, origin };
        match copies {
            [Copy::Whole { sequence: a, settings }, Copy::Whole { sequence: b, settings: other }] => {
                let origin = if a == b && settings == other { Origin::Stored } else { Origin::StoredOnce };
                loaded(if b > a { other } else { settings }, origin)
            }
            [Copy::Whole { settings, .. }, _] | [_, Copy::Whole { settings, .. }] => {
                loaded(settings, Origin::StoredOnce)
            }
            [Copy::Blank, Copy::Blank] => loaded(Validated::default(), Origin::DefaultsBlank),
            [_, _] => loaded(Validated::default(), Origin::DefaultsBad),
        }
    }

    /// Stores the settings, twice. Blocks for the time that the flash takes, which may include an erase of each
    /// sector: only to be called while nothing turns.
    ///
    /// # Errors
    /// [`SaveError`]; what was stored before is then still there, or the new set already is.
    pub fn save(&mut self, settings: &Validated) -> Result<(), SaveError> {
        if !SLOT_BYTES.is_multiple_of(F::WRITE_SIZE) || F::ERASE_SIZE < SLOT_BYTES {
            return Err(SaveError::Geometry);
        }
        let newest = self.sectors.map(|sector| match self.sector(sector).copy {
            Copy::Whole { sequence, .. } => Some(sequence),
            Copy::Blank | Copy::Bad => None,
        });
        let sequence = newest.iter().flatten().max().map_or(1, |sequence| sequence.saturating_add(1));
        // The one that is bad or older first: the other one stays until this one is whole.
        let order = if newest[0] > newest[1] { [1, 0] } else { [0, 1] };
        for index in order {
            self.write(self.sectors[index], settings, sequence)?;
        }
        Ok(())
    }

    fn write(&mut self, start: u32, settings: &Validated, sequence: u32) -> Result<(), SaveError> {
        let mut free = self.sector(start).free;
        if free == slots::<F>() {
            self.flash.erase(start, start + F::ERASE_SIZE as u32).map_err(|_| SaveError::Flash)?;
            free = 0;
        }
        let mut slot = [ERASED; SLOT_BYTES];
        let used = encode(settings, sequence, &mut slot).ok_or(SaveError::Geometry)?;
        let written = used.next_multiple_of(F::WRITE_SIZE);
        let offset = start + free * SLOT_BYTES as u32;
        self.flash.write(offset, &slot[..written]).map_err(|_| SaveError::Flash)?;
        let holds = match self.sector(start).copy {
            Copy::Whole { sequence: stored, settings: read } => stored == sequence && read == *settings,
            Copy::Blank | Copy::Bad => false,
        };
        if holds { Ok(()) } else { Err(SaveError::ReadBack) }
    }

    /// The last used slot of a sector.
    fn sector(&mut self, start: u32) -> Sector {
        let mut slot = [ERASED; SLOT_BYTES];
        for index in (0..slots::<F>()).rev() {
            match self.flash.read(start + index * SLOT_BYTES as u32, &mut slot) {
                Ok(()) if slot.iter().all(|&byte| byte == ERASED) => {}
                Ok(()) => return Sector { copy: decode(&slot).unwrap_or(Copy::Bad), free: index + 1 },
                Err(_) => return Sector { copy: Copy::Bad, free: slots::<F>() },
            }
        }
        Sector { copy: Copy::Blank, free: 0 }
    }
}

/// Slots in a sector.
fn slots<F: NorFlash>() -> u32 {
    (F::ERASE_SIZE / SLOT_BYTES) as u32
}

/// Writes a slot, and gives how many bytes of it are used. `None` when the settings do not fit.
fn encode(settings: &Settings, sequence: u32, slot: &mut [u8; SLOT_BYTES]) -> Option<usize> {
    let (head, tail) = slot.split_at_mut(HEADER_BYTES);
    let length = postcard::to_slice(settings, tail).ok()?.len();
    head[0..4].copy_from_slice(&MAGIC);
    head[4..6].copy_from_slice(&LAYOUT.to_le_bytes());
    head[6..8].copy_from_slice(&u16::try_from(length).ok()?.to_le_bytes());
    head[8..12].copy_from_slice(&sequence.to_le_bytes());
    let end = HEADER_BYTES + length;
    let checksum = CHECKSUM.checksum(&slot[..end]).to_le_bytes();
    slot.get_mut(end..end + CHECKSUM_BYTES)?.copy_from_slice(&checksum);
    Some(end + CHECKSUM_BYTES)
}

/// Reads a slot. `None` when anything about it is wrong.
fn decode(slot: &[u8; SLOT_BYTES]) -> Option<Copy> {
    let (magic, rest) = slot.split_first_chunk::<4>()?;
    let (layout, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = rest.split_first_chunk::<2>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    if *magic != MAGIC || u16::from_le_bytes(*layout) != LAYOUT {
        return None;
    }
    let (settings, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    let (checksum, rest) = rest.split_first_chunk::<CHECKSUM_BYTES>()?;
    let summed = slot.len() - rest.len() - CHECKSUM_BYTES;
    if CHECKSUM.checksum(slot.get(..summed)?) != u32::from_le_bytes(*checksum) {
        return None;
    }
    let (settings, left) = postcard::take_from_bytes::<Settings>(settings).ok()?;
    if !left.is_empty() {
        return None;
    }
    let settings = settings.validate().ok()?;
    Some(Copy::Whole { sequence: u32::from_le_bytes(*sequence), settings })
}
