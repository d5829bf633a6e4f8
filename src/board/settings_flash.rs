//! The last two sectors of the flash, where the settings are stored.
//!
//! The core stands still while a sector is erased (1 s, 2 s at most) or a word is written (16 µs): instructions come from
//! the same flash. The HAL's own driver finds the flash's size in a register that the emulator has not got, and writes
//! by bytes.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use stm32f4xx_hal::pac::FLASH;

use super::generated::{SETTINGS_BYTES, SETTINGS_START};

/// First address of sector 10, behind the image.
const START: usize = SETTINGS_START as usize;
/// Sectors 10 and 11.
const SECTORS: u8 = 2;
const FIRST_SECTOR: u8 = 10;
const SECTOR_BYTES: usize = 128 * 1024;
const BYTES: usize = SECTOR_BYTES * SECTORS as usize;
const _: () = assert!(BYTES == SETTINGS_BYTES as usize);
/// Reads of the status register, at least 6 cycles each, before the flash counts as dead. It stalls such a read for as
/// long as it is busy, so that one or two are the rule.
const PATIENCE: u32 = 10_000_000;

/// Where the two copies of the settings are, as offsets.
pub const COPIES: [u32; 2] = [0, SECTOR_BYTES as u32];

/// The two sectors.
pub struct SettingsFlash(FLASH);

impl SettingsFlash {
    /// The flash's controller belongs to the settings alone.
    pub const fn new(flash: FLASH) -> Self {
        Self(flash)
    }

    fn unlocked(
        &mut self,
        operate: impl FnOnce(&mut Self) -> Result<(), NorFlashErrorKind>,
    ) -> Result<(), NorFlashErrorKind> {
        for key in [0x4567_0123, 0xCDEF_89AB] {
            self.0.keyr().write(|w| w.key().set(key));
        }
        self.clear_errors();
        let result = operate(self);
        self.forget_cached();
        self.0.cr().write(|w| w.lock().set_bit());
        result
    }

    /// An erase, and a write, go past the data cache, which must be flushed after it (RM0090, 3.7.3).
    fn forget_cached(&mut self) {
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
    }

    fn clear_errors(&mut self) {
        self.0.sr().write(|w| {
            w.pgserr().clear_bit_by_one();
            w.pgperr().clear_bit_by_one();
            w.pgaerr().clear_bit_by_one();
            w.wrperr().clear_bit_by_one();
            w.operr().clear_bit_by_one()
        });
    }

    fn finish(&mut self) -> Result<(), NorFlashErrorKind> {
        for _ in 0..PATIENCE {
            let status = self.0.sr().read();
            if status.bsy().bit_is_clear() {
                let bad = status.pgserr().bit()
                    || status.pgperr().bit()
                    || status.pgaerr().bit()
                    || status.wrperr().bit()
                    || status.operr().bit();
                return if bad { Err(NorFlashErrorKind::Other) } else { Ok(()) };
            }
        }
        Err(NorFlashErrorKind::Other)
    }
}

impl ErrorType for SettingsFlash {
    type Error = NorFlashErrorKind;
}

/// The part of the sectors from `offset` on.
fn bounds(offset: u32, length: usize) -> Result<usize, NorFlashErrorKind> {
    let offset = offset as usize;
    let end = offset.checked_add(length).ok_or(NorFlashErrorKind::OutOfBounds)?;
    if end > BYTES { Err(NorFlashErrorKind::OutOfBounds) } else { Ok(START + offset) }
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let start = bounds(offset, bytes.len())? as *const u8;
        for (n, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within the two sectors, which exist on every STM32F405RG and hold no Rust object.
            *byte = unsafe { start.add(n).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)? as usize;
        bounds(from, length)?;
        let (first, count) = (from as usize / SECTOR_BYTES, length / SECTOR_BYTES);
        if !(from as usize).is_multiple_of(SECTOR_BYTES) || !length.is_multiple_of(SECTOR_BYTES) {
            return Err(NorFlashErrorKind::NotAligned);
        }
        self.unlocked(|flash| {
            for sector in first..first + count {
                flash.0.cr().write(|w| {
                    w.psize().psize32();
                    w.ser().set_bit();
                    // SAFETY: `bounds` leaves sectors 10 and 11, which hold no code.
                    unsafe { w.snb().bits(FIRST_SECTOR + sector as u8) }
                });
                // In a write of its own, once the sector is chosen (RM0090, 3.6.3).
                flash.0.cr().modify(|_, w| w.strt().set_bit());
                flash.finish()?;
            }
            Ok(())
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let start = bounds(offset, bytes.len())? as *mut u32;
        let (words, []) = bytes.as_chunks::<4>() else { return Err(NorFlashErrorKind::NotAligned) };
        if !offset.is_multiple_of(4) {
            return Err(NorFlashErrorKind::NotAligned);
        }
        self.unlocked(|flash| {
            flash.0.cr().write(|w| {
                w.psize().psize32();
                w.pg().set_bit()
            });
            for (n, word) in words.iter().enumerate() {
                // SAFETY: as for reading; aligned to a word.
                unsafe { start.add(n).write_volatile(u32::from_le_bytes(*word)) };
                flash.finish()?;
            }
            Ok(())
        })
    }
}
