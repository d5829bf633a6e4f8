//! Settings in flash: two copies, of which one is whole at any time.
//!
//! Each copy has an erase sector of its own, which is written as a log: a save goes to the first [`PAGE_BYTES`] behind the
//! last used ones, and the sector is erased only when it is full (a 128 KiB sector of an STM32F405 stalls the core for up
//! to two seconds; settings without curves take one page, and this is once in 256 saves). The copy is what the last
//! used pages hold.
//!
//! ```text
//! set: magic u32 | layout u16 | length u16 | sequence u32 | settings (postcard) | crc32 u32     little-endian
//! ```
//!
//! A set begins with a page and takes one or two of them. The checksum (CRC-32/ISCSI, as on the link) runs from `magic` to
//! the end of the settings. A save writes the copy that is not the newest, reads it back, and only then the other:
//! wherever the power goes, one of the two sectors holds the old set or the new one. A set whose two copies are both bad
//! is not replaced by an older one from the logs, which nobody would expect to come back: there are no settings then,
//! and that is reported.
//!
//! A set of an older layout is migrated when it is loaded, and stored in today's layout by the next save.
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

use super::layout_1::{self, Settings1};
use super::layout_2::{self, Settings2};
use super::layout_3::{self, Settings3};
use super::{MOTORS, Settings, Validated};
use crate::checksum::CHECKSUM;

/// Where sets begin: at a multiple of so many bytes.
pub const PAGE_BYTES: usize = 512;
/// Longest set, two pages: with the curves of the four motors some 800 bytes.
const SET_BYTES: usize = 2 * PAGE_BYTES;

/// `RLST`, little-endian.
const MAGIC: [u8; 4] = *b"RLST";
/// Number of the settings' layout.
const LAYOUT: u16 = 5;
/// The one before, which ends before the motors' speeds.
const LAYOUT_WITHOUT_SPEEDS: u16 = 4;
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
    /// Nothing was ever saved. The defaults are there to be changed; nothing goes out until a host has set some.
    DefaultsBlank,
    /// Both copies are bad, or what they hold cannot be used on this clock. As [`Self::DefaultsBlank`].
    DefaultsBad,
    /// A set of an older layout, migrated. The next save stores it in today's.
    Migrated,
    /// A host has set them, and they are not stored.
    Host,
}

impl Origin {
    /// Whether somebody has chosen these settings.
    #[must_use]
    pub const fn is_chosen(self) -> bool {
        !matches!(self, Self::DefaultsBlank | Self::DefaultsBad)
    }
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
    /// The flash's write size does not divide a page, or a sector is smaller than the longest set.
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

/// The settings' place in flash, in pages of `PAGE` bytes, at most 512.
#[derive(Debug)]
pub struct Store<F, const PAGE: usize = PAGE_BYTES> {
    flash: F,
    sectors: [u32; 2],
}

/// What a sector holds.
#[derive(Clone, Debug, PartialEq)]
// One at a time, and nothing here has a heap.
#[allow(clippy::large_enum_variant)]
enum Copy {
    Blank,
    Bad,
    Whole { sequence: u32, layout: u16, settings: Validated },
}

/// A sector, as far as a save needs to know it.
struct Sector {
    copy: Copy,
    /// The page behind the last used one; the number of pages where that is the last.
    free: u32,
}

impl<F: NorFlash> Store<F> {
    /// Settings in the two sectors of [`NorFlash::ERASE_SIZE`] bytes that start at the offsets `sectors` of `flash`.
    pub const fn new(flash: F, sectors: [u32; 2]) -> Self {
        Self::with_pages(flash, sectors)
    }
}

impl<F: NorFlash, const PAGE: usize> Store<F, PAGE> {
    /// The longest set, and pages in a sector.
    const SET: usize = if 2 * PAGE < SET_BYTES { 2 * PAGE } else { SET_BYTES };
    const PAGES: u32 = (F::ERASE_SIZE / PAGE) as u32;

    /// The same with pages of another size: of two pages each, sets are what they will be once they have grown.
    pub const fn with_pages(flash: F, sectors: [u32; 2]) -> Self {
        Self { flash, sectors }
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Reads the settings, and never writes. A copy that cannot be read, has the wrong checksum or an unknown layout, or
    /// holds settings that are refused, is bad.
    pub fn load(&mut self) -> Loaded {
        let copies = self.sectors.map(|sector| self.sector(sector).copy);
        let (sequence, layout, settings) = match &copies {
            [Copy::Whole { sequence: a, .. }, Copy::Whole { sequence, layout, settings }] if sequence > a => {
                (*sequence, *layout, settings)
            }
            [Copy::Whole { sequence, layout, settings }, _] | [_, Copy::Whole { sequence, layout, settings }] => {
                (*sequence, *layout, settings)
            }
            [Copy::Blank, Copy::Blank] => {
                return Loaded { settings: Validated::default(), origin: Origin::DefaultsBlank };
            }
            [_, _] => return Loaded { settings: Validated::default(), origin: Origin::DefaultsBad },
        };
        let newest = Copy::Whole { sequence, layout, settings: settings.clone() };
        let origin = if layout != LAYOUT {
            Origin::Migrated
        } else if copies.iter().all(|copy| *copy == newest) {
            Origin::Stored
        } else {
            Origin::StoredOnce
        };
        Loaded { settings: settings.clone(), origin }
    }

    /// Stores the settings, twice. Blocks for the time that the flash takes, which may include an erase of each
    /// sector: only to be called while nothing turns.
    ///
    /// # Errors
    /// [`SaveError`]; what was stored before is then still there, or the new set already is.
    pub fn save(&mut self, settings: &Validated) -> Result<(), SaveError> {
        if !PAGE.is_multiple_of(F::WRITE_SIZE) || F::ERASE_SIZE < Self::SET {
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
        let mut set = [ERASED; SET_BYTES];
        let used = encode(settings, sequence, &mut set[..Self::SET]).ok_or(SaveError::Geometry)?;
        let mut free = self.sector(start).free;
        // One or two.
        if free + used.div_ceil(PAGE) as u32 > Self::PAGES {
            self.flash.erase(start, start + F::ERASE_SIZE as u32).map_err(|_| SaveError::Flash)?;
            free = 0;
        }
        let written = used.next_multiple_of(F::WRITE_SIZE);
        let offset = start + free * PAGE as u32;
        self.flash.write(offset, &set[..written]).map_err(|_| SaveError::Flash)?;
        let holds = match self.sector(start).copy {
            Copy::Whole { sequence: stored, settings: read, .. } => stored == sequence && read == *settings,
            Copy::Blank | Copy::Bad => false,
        };
        if holds { Ok(()) } else { Err(SaveError::ReadBack) }
    }

    /// The set in the last used pages of a sector.
    fn sector(&mut self, start: u32) -> Sector {
        let mut buffer = [ERASED; SET_BYTES];
        let set = &mut buffer[..Self::SET];
        for page in (0..Self::PAGES).rev() {
            let free = page + 1;
            match self.flash.read(start + page * PAGE as u32, &mut set[..PAGE]) {
                Ok(()) if set[..PAGE].iter().all(|&byte| byte == ERASED) => continue,
                Ok(()) => {}
                Err(_) => return Sector { copy: Copy::Bad, free: Self::PAGES },
            }
            if let Some(copy) = decode(&set[..PAGE]) {
                return Sector { copy, free };
            }
            // It may be the second page of a set.
            let first = page.checked_sub(1).map(|first| self.flash.read(start + first * PAGE as u32, set));
            // A set that does not reach so far leaves that page to something else.
            let is_whole = matches!(first, Some(Ok(()))) && length(set) > PAGE;
            let copy = if is_whole { decode(set) } else { None };
            return Sector { copy: copy.unwrap_or(Copy::Bad), free };
        }
        Sector { copy: Copy::Blank, free: 0 }
    }
}

/// Bytes that a set takes, as its header says.
fn length(set: &[u8]) -> usize {
    let body = set.get(6..8).map_or(0, |length| u16::from_le_bytes([length[0], length[1]]));
    HEADER_BYTES + usize::from(body) + CHECKSUM_BYTES
}

/// Writes a set, and gives how many bytes of it are used. `None` when the settings do not fit.
fn encode(settings: &Settings, sequence: u32, set: &mut [u8]) -> Option<usize> {
    let (head, tail) = set.split_at_mut_checked(HEADER_BYTES)?;
    let length = postcard::to_slice(settings, tail).ok()?.len();
    head[0..4].copy_from_slice(&MAGIC);
    head[4..6].copy_from_slice(&LAYOUT.to_le_bytes());
    head[6..8].copy_from_slice(&u16::try_from(length).ok()?.to_le_bytes());
    head[8..12].copy_from_slice(&sequence.to_le_bytes());
    let end = HEADER_BYTES + length;
    let checksum = CHECKSUM.checksum(&set[..end]).to_le_bytes();
    set.get_mut(end..end + CHECKSUM_BYTES)?.copy_from_slice(&checksum);
    Some(end + CHECKSUM_BYTES)
}

/// Reads a set. `None` when anything about it is wrong.
fn decode(set: &[u8]) -> Option<Copy> {
    let (magic, rest) = set.split_first_chunk::<4>()?;
    let (layout, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = rest.split_first_chunk::<2>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    if *magic != MAGIC {
        return None;
    }
    let (body, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    let (checksum, rest) = rest.split_first_chunk::<CHECKSUM_BYTES>()?;
    let summed = set.len() - rest.len() - CHECKSUM_BYTES;
    if CHECKSUM.checksum(set.get(..summed)?) != u32::from_le_bytes(*checksum) {
        return None;
    }
    let layout = u16::from_le_bytes(*layout);
    let settings = match layout {
        layout_1::LAYOUT => whole::<Settings1>(body)?.migrate(),
        layout_2::LAYOUT => whole::<Settings2>(body)?.migrate(),
        layout_3::LAYOUT => whole::<Settings3>(body)?.migrate(),
        LAYOUT_WITHOUT_SPEEDS => without_speeds(body)?,
        LAYOUT => whole::<Settings>(body)?,
        _ => return None,
    };
    let settings = settings.validate().ok()?;
    Some(Copy::Whole { sequence: u32::from_le_bytes(*sequence), layout, settings })
}

/// Settings of [`LAYOUT_WITHOUT_SPEEDS`]: with a zero for each motor, which is no speeds, they are of today's.
fn without_speeds(body: &[u8]) -> Option<Settings> {
    let mut today = [0; SET_BYTES];
    let today = today.get_mut(..body.len() + MOTORS)?;
    today[..body.len()].copy_from_slice(body);
    whole(today)
}

/// A value that takes all of the bytes.
fn whole<T: for<'de> Deserialize<'de>>(body: &[u8]) -> Option<T> {
    let (value, left) = postcard::take_from_bytes(body).ok()?;
    left.is_empty().then_some(value)
}
