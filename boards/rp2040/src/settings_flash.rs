//! The last two sectors of the flash, where the settings are stored.
//!
//! The boot ROM's functions erase them (45 ms, 400 ms at most) and write them. The flash cannot be read meanwhile, and all code is in
//! RAM. Afterwards the second stage of the boot, which lies in the first 256 bytes of the flash, runs again from a copy: it sets up the
//! fast way of reading, and what the ROM has for that is some eight times slower.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use rotorlead_rp2040::generated::{FLASH_START, SETTINGS_BYTES, SETTINGS_START};
use rp2040_hal::rom_data;

/// Where the flash is read.
const READ_ADDRESS: usize = FLASH_START as usize;
/// The first of the two sectors, behind the image.
const START: u32 = SETTINGS_START - FLASH_START;
const SECTOR_BYTES: u32 = 4096;
const BYTES: u32 = 2 * SECTOR_BYTES;
const _: () = assert!(BYTES == SETTINGS_BYTES);
/// What the flash writes at once.
const PAGE_BYTES: usize = 256;
/// A larger unit of erasing, and its command, which the ROM takes where it can; here it never can.
const BLOCK_BYTES: u32 = 1 << 16;
const BLOCK_ERASE: u8 = 0xD8;

/// Where the two copies of the settings are, as offsets.
pub const COPIES: [u32; 2] = [0, SECTOR_BYTES];

/// The two sectors.
pub struct SettingsFlash(());

impl SettingsFlash {
    /// Once.
    pub const fn new() -> Self {
        Self(())
    }
}

impl ErrorType for SettingsFlash {
    type Error = NorFlashErrorKind;
}

fn check(offset: u32, length: usize, unit: usize) -> Result<(), NorFlashErrorKind> {
    let length = u32::try_from(length).map_err(|_| NorFlashErrorKind::OutOfBounds)?;
    let end = offset.checked_add(length).ok_or(NorFlashErrorKind::OutOfBounds)?;
    if end > BYTES {
        return Err(NorFlashErrorKind::OutOfBounds);
    }
    let unit = unit as u32;
    if offset.is_multiple_of(unit) && length.is_multiple_of(unit) { Ok(()) } else { Err(NorFlashErrorKind::NotAligned) }
}

fn byte(offset: u32) -> u8 {
    // SAFETY: the callers have checked the offset; the flash holds no Rust object there.
    unsafe { ((READ_ADDRESS + (START + offset) as usize) as *const u8).read_volatile() }
}

/// Words of the second stage of the boot.
const BOOT2_WORDS: usize = 64;

/// What runs while the flash is away: the ROM's functions, and a copy of the second stage.
struct Rom {
    connect: unsafe extern "C" fn(),
    exit_xip: unsafe extern "C" fn(),
    erase: unsafe extern "C" fn(u32, usize, u32, u8),
    program: unsafe extern "C" fn(u32, *const u8, usize),
    flush: unsafe extern "C" fn(),
    boot2: [u32; BOOT2_WORDS],
}

/// In the address of a function: its code is Thumb.
const THUMB: usize = 1;

fn boot2_word(place: usize) -> u32 {
    // SAFETY: the first 256 bytes of the flash; no Rust object is there but the stage itself, as bytes.
    unsafe { (READ_ADDRESS as *const u32).add(place % BOOT2_WORDS).read_volatile() }
}

/// What the flash is to do, at an offset from its beginning.
#[derive(Clone, Copy)]
enum Operation {
    Erase { from: u32, length: u32 },
    Program { from: u32, page: *const u8 },
}

/// Runs an operation, with the flash away meanwhile. Interrupts go on: what they need is in RAM.
fn operate(operation: Operation) {
    let rom = Rom {
        connect: rom_data::connect_internal_flash::ptr(),
        exit_xip: rom_data::flash_exit_xip::ptr(),
        erase: rom_data::flash_range_erase::ptr(),
        program: rom_data::flash_range_program::ptr(),
        flush: rom_data::flash_flush_cache::ptr(),
        boot2: core::array::from_fn(boot2_word),
    };
    // SAFETY: no code, constant or vector lies in the flash; the operation was checked.
    unsafe {
        (rom.connect)();
        (rom.exit_xip)();
        match operation {
            Operation::Erase { from, length } => (rom.erase)(from, length as usize, BLOCK_BYTES, BLOCK_ERASE),
            Operation::Program { from, page } => (rom.program)(from, page, PAGE_BYTES),
        }
        (rom.flush)();
        // Its first bytes are its code, and it returns to where it was called from (RP2040 datasheet, 2.8.1.3.1).
        let boot2: unsafe extern "C" fn() = core::mem::transmute(rom.boot2.as_ptr().expose_provenance() | THUMB);
        boot2();
    }
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check(offset, bytes.len(), Self::READ_SIZE)?;
        for (place, to) in (offset..).zip(bytes) {
            *to = byte(place);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES as usize
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = PAGE_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)?;
        check(from, length as usize, Self::ERASE_SIZE)?;
        operate(Operation::Erase { from: START + from, length });
        if (from..to).all(|offset| byte(offset) == 0xff) { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check(offset, bytes.len(), PAGE_BYTES)?;
        let (pages, _) = bytes.as_chunks::<PAGE_BYTES>();
        for (from, page) in (offset..).step_by(PAGE_BYTES).zip(pages) {
            // From RAM: the bytes may lie in the flash.
            let copy = *page;
            operate(Operation::Program { from: START + from, page: copy.as_ptr() });
        }
        if (offset..).zip(bytes).all(|(place, expected)| byte(place) == *expected) {
            Ok(())
        } else {
            Err(NorFlashErrorKind::Other)
        }
    }
}
