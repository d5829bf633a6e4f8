//! UF2: the form of an image that a chip's boot ROM takes when it shows itself as a drive.
//!
//! A file is a row of blocks of 512 bytes, of which each says where its 256 bytes of data belong, so that they may come in any order.
//! Source: the specification, microsoft/uf2 on GitHub.

use serde::Deserialize;

use crate::run::Result;

/// Words at the beginning of a block, and at its end.
const MAGIC: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const MAGIC_END: u32 = 0x0AB1_6F30;
/// The flag that says that a block names a family.
const HAS_FAMILY: u32 = 0x2000;
const BLOCK_BYTES: usize = 512;
const HEADER_BYTES: usize = 32;
/// Data in a block: what the flash of an RP2040 writes at once.
const PAGE_BYTES: usize = 256;
/// Value of an erased byte.
const ERASED: u8 = 0xFF;

/// The identifier of the chips that take a file: one of the specification's list of families.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub struct Family(u32);

/// A file that puts content at an address. The last page is filled up as erased.
pub fn encode(family: Family, start: u32, content: &[u8]) -> Vec<u8> {
    let pages = content.chunks(PAGE_BYTES);
    let count = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * BLOCK_BYTES);
    for (number, page) in (0..).zip(pages) {
        let address = start + number * PAGE_BYTES as u32;
        let [first, second] = MAGIC;
        let header = [first, second, HAS_FAMILY, address, PAGE_BYTES as u32, number, count, family.0];
        let block_start = file.len();
        file.extend(header.iter().flat_map(|word| word.to_le_bytes()));
        file.extend_from_slice(page);
        file.resize(block_start + HEADER_BYTES + PAGE_BYTES, ERASED);
        file.resize(block_start + BLOCK_BYTES - 4, 0);
        file.extend(MAGIC_END.to_le_bytes());
    }
    file
}

/// The pages of a file, each with its address.
///
/// # Errors
/// Where it is no such file, is for another chip, or lacks a block.
pub fn decode(family: Family, file: &[u8]) -> Result<Vec<(u32, &[u8])>> {
    let (blocks, rest) = file.as_chunks::<BLOCK_BYTES>();
    if !rest.is_empty() || blocks.is_empty() {
        return Err(format!("{} bytes are no whole blocks of UF2", file.len()));
    }
    let mut pages = Vec::new();
    for (number, block) in blocks.iter().enumerate() {
        let (words, _) = block.as_chunks::<4>();
        let word = |place: usize| u32::from_le_bytes(words[place]);
        let problem = |what: &str| format!("block {number} of the UF2 file: {what}");
        if [word(0), word(1)] != MAGIC || word(BLOCK_BYTES / 4 - 1) != MAGIC_END {
            return Err(problem("it does not begin and end as a block"));
        }
        if word(2) & HAS_FAMILY == 0 || word(7) != family.0 {
            return Err(problem("it is for another chip"));
        }
        if word(5) as usize != number || word(6) as usize != blocks.len() {
            return Err(problem("its number, or that of all blocks, is wrong"));
        }
        if word(4) as usize != PAGE_BYTES {
            return Err(problem("it has not 256 bytes"));
        }
        pages.push((word(3), &block[HEADER_BYTES..HEADER_BYTES + PAGE_BYTES]));
    }
    Ok(pages)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RP2040.
    const FAMILY: Family = Family(0xE48B_FF56);
    const START: u32 = 0x1000_0000;

    #[test]
    fn a_file_has_every_byte_at_its_address_and_is_filled_up_as_erased() {
        for length in [1, 255, 256, 257, 100_000] {
            let content: Vec<u8> = (0..length).map(|index| (index * 31 % 251) as u8).collect();
            let file = encode(FAMILY, START, &content);
            let pages = decode(FAMILY, &file).unwrap();
            assert_eq!(pages.len(), content.len().div_ceil(PAGE_BYTES));
            for (number, (address, bytes)) in (0..).zip(&pages) {
                assert_eq!(*address, START + number * 256);
                for (index, byte) in (number as usize * 256..).zip(*bytes) {
                    assert_eq!(*byte, content.get(index).copied().unwrap_or(ERASED));
                }
            }
        }
    }

    #[test]
    fn a_block_is_the_one_of_the_specification() {
        let file = encode(FAMILY, START, &[7]);
        assert_eq!(file[..4], *b"UF2\n");
        let words = [0x5157, 0x9E5D].map(u16::to_le_bytes).concat();
        assert_eq!(file[4..8], words);
        assert_eq!(file[28..32], 0xE48B_FF56_u32.to_le_bytes());
        assert_eq!(file[508..], 0x0AB1_6F30_u32.to_le_bytes());
    }

    #[test]
    fn a_file_that_is_damaged_is_refused() {
        let good = encode(FAMILY, START, &[7; 600]);
        for place in [0, 5, 9, 17, 20, 24, 29, 508, 512 + 3] {
            let mut bad = good.clone();
            bad[place] ^= 0x20;
            assert!(decode(FAMILY, &bad).is_err(), "byte {place}");
        }
        assert!(decode(FAMILY, &good[..good.len() - 1]).is_err());
        assert!(decode(FAMILY, &good[512..]).is_err());
        assert!(decode(FAMILY, &[]).is_err());
    }
}
