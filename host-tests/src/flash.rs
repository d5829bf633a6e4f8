//! A NOR flash in memory whose power can be cut at any byte.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Two sectors of `ERASE` bytes. A byte can only lose bits by being written, and gets them back by an erase.
///
/// Time is counted in bytes written or erased. When [`Self::cut_after`] has run out, the byte at hand is left half done
/// and everything fails until [`Self::power_on`].
#[derive(Clone, Debug)]
pub struct Flash<const ERASE: usize> {
    /// What it holds.
    pub bytes: Vec<u8>,
    /// Bytes until the power is cut; `None` for never.
    pub cut_after: Option<usize>,
    /// Bits that cannot be written any more, by address: they stay set.
    pub worn: Option<(usize, u8)>,
    /// Whether an erase goes from the end of the sector to its start.
    pub erases_backwards: bool,
    /// Bytes written and erased so far.
    pub steps: usize,
    /// Sectors erased so far.
    pub erases: usize,
    /// Whether the power is off.
    pub off: bool,
    /// State of the generator that says which bits of a half-done byte have changed.
    pub noise: u32,
}

/// Why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// There is no power.
    Off,
    /// Outside the flash, or not aligned.
    Place(NorFlashErrorKind),
    /// A byte would have to gain bits without an erase.
    NotErased,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place(kind) => *kind,
            Self::Off | Self::NotErased => NorFlashErrorKind::Other,
        }
    }
}

impl<const ERASE: usize> Flash<ERASE> {
    /// Offsets of its two sectors.
    pub const SECTORS: [u32; 2] = [0, ERASE as u32];

    /// As it leaves the factory.
    #[must_use]
    pub fn blank() -> Self {
        Self::holding(vec![0xff; 2 * ERASE])
    }

    /// With this content.
    ///
    /// # Panics
    /// When it is not two sectors long.
    #[must_use]
    pub fn holding(bytes: Vec<u8>) -> Self {
        assert_eq!(bytes.len(), 2 * ERASE);
        Self {
            bytes,
            cut_after: None,
            worn: None,
            erases_backwards: false,
            steps: 0,
            erases: 0,
            off: false,
            noise: 0x2545_f491,
        }
    }

    /// Gives the power back, for good.
    pub fn power_on(&mut self) {
        self.off = false;
        self.cut_after = None;
    }

    /// One byte of work, from what it is to what it shall be.
    fn step(&mut self, address: usize, target: u8) -> Result<(), FlashError> {
        if self.off {
            return Err(FlashError::Off);
        }
        let old = self.bytes[address];
        if self.cut_after == Some(0) {
            self.off = true;
            // Some of the bits that were to change have changed.
            self.noise ^= self.noise << 13;
            self.noise ^= self.noise >> 17;
            self.noise ^= self.noise << 5;
            self.bytes[address] = old ^ ((old ^ target) & self.noise as u8);
            return Err(FlashError::Off);
        }
        self.cut_after = self.cut_after.map(|left| left - 1);
        self.steps += 1;
        self.bytes[address] = match self.worn {
            Some((worn, bits)) if worn == address => target | bits,
            _ => target,
        };
        Ok(())
    }

    fn check(&self, offset: u32, length: usize, unit: usize) -> Result<usize, FlashError> {
        if self.off {
            return Err(FlashError::Off);
        }
        let offset = offset as usize;
        if !offset.is_multiple_of(unit) || !length.is_multiple_of(unit) {
            return Err(FlashError::Place(NorFlashErrorKind::NotAligned));
        }
        if offset + length > self.bytes.len() {
            return Err(FlashError::Place(NorFlashErrorKind::OutOfBounds));
        }
        Ok(offset)
    }
}

impl<const ERASE: usize> ErrorType for Flash<ERASE> {
    type Error = FlashError;
}

impl<const ERASE: usize> ReadNorFlash for Flash<ERASE> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let offset = self.check(offset, bytes.len(), 1)?;
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const ERASE: usize> NorFlash for Flash<ERASE> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let from = self.check(from, (to - from) as usize, ERASE)?;
        let to = to as usize;
        self.erases += (to - from) / ERASE;
        for index in 0..to - from {
            let address = if self.erases_backwards { to - 1 - index } else { from + index };
            self.step(address, 0xff)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let offset = self.check(offset, bytes.len(), Self::WRITE_SIZE)?;
        for (index, &byte) in bytes.iter().enumerate() {
            if byte & !self.bytes[offset + index] != 0 {
                return Err(FlashError::NotErased);
            }
            self.step(offset + index, byte)?;
        }
        Ok(())
    }
}
