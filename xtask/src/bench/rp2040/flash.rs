//! The flash of a controller that has stored its settings.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use emulator::rp2040::Flash;
use rotorlead::settings::{Settings, Store};
use rotorlead_rp2040::generated::{FLASH_START, SETTINGS_START};

use crate::run;

/// Bytes of a sector.
const SECTOR: usize = 4096;

/// What the flash holds when somebody has stored these settings.
pub fn stored(settings: &Settings) -> run::Result<Flash> {
    let settings = settings.clone().validate().map_err(|error| error.to_string())?;
    let mut store = Store::new(Memory(vec![0xFF; 2 * SECTOR]), [0, SECTOR as u32]);
    store.save(&settings).map_err(|error| error.to_string())?;
    Ok(Flash { offset: SETTINGS_START - FLASH_START, bytes: store.into_flash().0 })
}

/// Two sectors that start erased.
struct Memory(Vec<u8>);

impl Memory {
    fn part(&mut self, offset: u32, length: usize) -> Result<&mut [u8], NorFlashErrorKind> {
        self.0.get_mut(offset as usize..offset as usize + length).ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl ErrorType for Memory {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.copy_from_slice(self.part(offset, bytes.len())?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.part(from, (to - from) as usize)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.part(offset, bytes.len())?.copy_from_slice(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rotorlead::settings::Origin;

    use super::*;

    #[test]
    fn what_is_stored_is_loaded() {
        let mut settings = Settings::default();
        settings.motors[2].compensate = true;
        let flash = stored(&settings).unwrap();
        assert_eq!((flash.offset, flash.bytes.len()), (0x1F_E000, 2 * SECTOR));
        let loaded = Store::new(Memory(flash.bytes), [0, SECTOR as u32]).load();
        assert_eq!(loaded.origin, Origin::Stored);
        assert_eq!(loaded.settings, settings.validate().unwrap());
    }

    #[test]
    fn settings_that_are_not_valid_are_refused() {
        assert!(stored(&Settings { loop_rate_hz: 0, ..Settings::default() }).is_err());
    }
}
