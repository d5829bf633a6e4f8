//! The files that a flashing tool takes: what a linked image stores in flash, as raw binary and as Intel HEX.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use ihex::{Reader, Record};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, elf};

use crate::run::Result;

/// Flash that the image may take, sectors 0 to 9: the region `FLASH` of board.x.
pub const FLASH: Range<u32> = 0x0800_0000..0x080C_0000;
/// Flash that holds the settings, sectors 10 and 11: see src/board/settings_flash.rs.
const SETTINGS: Range<u32> = 0x080C_0000..0x0810_0000;
/// Value of an erased byte.
const ERASED: u8 = 0xFF;
/// Data bytes in a HEX record. It divides 64 KiB, so no record crosses into the next upper address.
const RECORD_BYTES: usize = 16;

/// One of the two files.
#[derive(Debug)]
pub struct FlashFile {
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: usize,
}

/// Both files.
#[derive(Debug)]
pub struct FlashFiles {
    /// The flash's content from its first address on, gaps filled with 0xff.
    pub bin: FlashFile,
    /// The same as Intel HEX.
    pub hex: FlashFile,
}

/// Writes both files beside the linked image, reads them back and checks them.
///
/// # Errors
/// When a file cannot be written, a segment lies outside of the image's flash, or what was written is not the image.
pub fn write(file: &[u8], path: &Path, stack_start: u32) -> Result<FlashFiles> {
    remove(path)?;
    let content = content(file)?;
    let text = to_hex(&content)?;
    let [bin, hex] = paths(path);
    fs::write(&bin, &content).map_err(|error| format!("{}: {error}", bin.display()))?;
    fs::write(&hex, &text).map_err(|error| format!("{}: {error}", hex.display()))?;
    if let Err(error) = check(&bin, &hex, stack_start) {
        remove(path)?;
        return Err(error);
    }
    Ok(FlashFiles {
        bin: FlashFile { path: bin, bytes: content.len() },
        hex: FlashFile { path: hex, bytes: text.len() },
    })
}

/// Removes both files, so that none is left of an image that failed its checks.
///
/// # Errors
/// When a file is there and cannot be removed.
pub fn remove(path: &Path) -> Result {
    for file in paths(path) {
        match fs::remove_file(&file) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(format!("{}: {error}", file.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Paths of the raw binary and of the Intel HEX file.
fn paths(path: &Path) -> [PathBuf; 2] {
    ["bin", "hex"].map(|extension| path.with_extension(extension))
}

/// Checks the files as they are on disk: the HEX file decodes to the raw binary, which begins with the vector table.
fn check(bin: &Path, hex: &Path, stack_start: u32) -> Result {
    let content = fs::read(bin).map_err(|error| format!("{}: {error}", bin.display()))?;
    let text = fs::read_to_string(hex).map_err(|error| format!("{}: {error}", hex.display()))?;
    if from_hex(&text)? != content {
        return Err(format!("{} does not decode to {}", hex.display(), bin.display()));
    }
    check_vectors(&content, stack_start)
}

/// Content of the flash, from its first address on, that the segments of a linked image make.
fn content(file: &[u8]) -> Result<Vec<u8>> {
    let header = elf::FileHeader32::<Endianness>::parse(file).map_err(|error| error.to_string())?;
    let endian = header.endian().map_err(|error| error.to_string())?;
    let mut segments = Vec::new();
    for segment in header.program_headers(endian, file).map_err(|error| error.to_string())? {
        if segment.p_type(endian) == elf::PT_LOAD && segment.p_filesz(endian) > 0 {
            // The physical address is where the bytes are stored. The virtual one is where the program finds them: the
            // initial values of variables are stored in flash and copied to RAM at the start.
            let address = segment.p_paddr(endian);
            let data = segment.data(endian, file);
            segments.push((address, data.map_err(|()| format!("the segment for {address:#010x} is cut off"))?));
        }
    }
    if segments.is_empty() {
        return Err("the image has no segment to load".to_owned());
    }
    segments.sort_by_key(|(address, _)| *address);
    let mut content = Vec::new();
    for (address, data) in segments {
        append(&mut content, address, data)?;
    }
    Ok(content)
}

/// Puts data at an address behind what is there, and fills the gap.
fn append(content: &mut Vec<u8>, address: u32, data: &[u8]) -> Result {
    let end = u64::from(address) + data.len() as u64;
    if (FLASH.start..SETTINGS.end).contains(&address) && end > u64::from(SETTINGS.start) {
        return Err(format!(
            "data for {address:#010x} to {end:#010x} would overwrite the settings in sectors 10 and 11, which begin at \
             {:#010x}",
            SETTINGS.start
        ));
    }
    if address < FLASH.start || end > u64::from(FLASH.end) {
        return Err(format!(
            "data for {address:#010x} to {end:#010x} is outside of the image's flash, {:#010x} to {:#010x} (board.x)",
            FLASH.start, FLASH.end
        ));
    }
    let offset = (address - FLASH.start) as usize;
    if offset < content.len() {
        return Err(format!("two pieces of data are for {address:#010x}"));
    }
    content.resize(offset, ERASED);
    content.extend_from_slice(data);
    Ok(())
}

/// The flash's content as Intel HEX.
fn to_hex(content: &[u8]) -> Result<String> {
    let mut records = Vec::new();
    let mut upper = None;
    for (index, value) in content.chunks(RECORD_BYTES).enumerate() {
        let address = FLASH.start + (index * RECORD_BYTES) as u32;
        let high = (address >> 16) as u16;
        if upper.replace(high) != Some(high) {
            records.push(Record::ExtendedLinearAddress(high));
        }
        records.push(Record::Data { offset: address as u16, value: value.to_vec() });
    }
    records.push(Record::EndOfFile);
    ihex::create_object_file_representation(&records).map_err(|error| error.to_string())
}

/// The flash's content from Intel HEX, records in the order of their addresses.
fn from_hex(text: &str) -> Result<Vec<u8>> {
    let mut content = Vec::new();
    let mut upper = 0;
    for (index, record) in Reader::new(text).enumerate() {
        match record.map_err(|error| format!("HEX record {}: {error}", index + 1))? {
            Record::ExtendedLinearAddress(high) => upper = u32::from(high) << 16,
            Record::Data { offset, value } => append(&mut content, upper | u32::from(offset), &value)?,
            Record::EndOfFile => return Ok(content),
            other => return Err(format!("HEX record {}: {other:?} is not expected", index + 1)),
        }
    }
    Err("the HEX file has no end-of-file record".to_owned())
}

/// Checks the first two words of the vector table: the initial stack pointer and the address of the reset handler.
fn check_vectors(content: &[u8], stack_start: u32) -> Result {
    let Some((&[a, b, c, d, e, f, g, h], _)) = content.split_first_chunk() else {
        return Err(format!("the image has {} bytes: too short for a vector table", content.len()));
    };
    let (stack, reset) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    if stack != stack_start {
        return Err(format!("the initial stack pointer is {stack:#010x}, and _stack_start is {stack_start:#010x}"));
    }
    let end = FLASH.start + content.len() as u32;
    if reset % 2 == 0 || !(FLASH.start..end).contains(&reset) {
        return Err(format!(
            "the reset handler is at {reset:#010x}: an odd address (Thumb code) from {:#010x} to {end:#010x} was expected",
            FLASH.start
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use object::elf::{FileHeader32, Ident, PT_LOAD, PT_NOTE, ProgramHeader32};
    use object::endian::{Endianness, U16, U32};
    use object::pod::bytes_of;

    use super::{ERASED, FLASH, SETTINGS, check_vectors, content, from_hex, to_hex, write};

    const LITTLE: Endianness = Endianness::Little;
    const RAM: u32 = 0x2000_0000;
    const STACK: u32 = 0x1001_0000;

    /// Part of a linked image: type, virtual address, physical address, bytes.
    type Segment<'a> = (u32, u32, u32, &'a [u8]);

    /// A linked image with these segments.
    fn linked(segments: &[Segment<'_>]) -> Vec<u8> {
        let word = |value: u32| U32::new(LITTLE, value);
        let half = |value: usize| U16::new(LITTLE, u16::try_from(value).unwrap());
        let (header_bytes, entry_bytes) =
            (size_of::<FileHeader32<Endianness>>(), size_of::<ProgramHeader32<Endianness>>());
        let header = FileHeader32 {
            e_ident: Ident {
                magic: object::elf::ELFMAG,
                class: object::elf::ELFCLASS32,
                data: object::elf::ELFDATA2LSB,
                version: object::elf::EV_CURRENT,
                os_abi: 0,
                abi_version: 0,
                padding: [0; 7],
            },
            e_type: U16::new(LITTLE, object::elf::ET_EXEC),
            e_machine: U16::new(LITTLE, object::elf::EM_ARM),
            e_version: word(1),
            e_entry: word(FLASH.start),
            e_phoff: word(header_bytes as u32),
            e_shoff: word(0),
            e_flags: word(0),
            e_ehsize: half(header_bytes),
            e_phentsize: half(entry_bytes),
            e_phnum: half(segments.len()),
            e_shentsize: half(0),
            e_shnum: half(0),
            e_shstrndx: half(0),
        };
        let mut file = bytes_of(&header).to_vec();
        let mut offset = header_bytes + entry_bytes * segments.len();
        for (kind, virtual_address, physical_address, data) in segments {
            let entry = ProgramHeader32 {
                p_type: word(*kind),
                p_offset: word(offset as u32),
                p_vaddr: word(*virtual_address),
                p_paddr: word(*physical_address),
                p_filesz: word(data.len() as u32),
                p_memsz: word(data.len() as u32),
                p_flags: word(0),
                p_align: word(4),
            };
            file.extend_from_slice(bytes_of(&entry));
            offset += data.len();
        }
        for (.., data) in segments {
            file.extend_from_slice(data);
        }
        file
    }

    /// A vector table of two words.
    fn vectors(stack: u32, reset: u32) -> Vec<u8> {
        [stack.to_le_bytes(), reset.to_le_bytes()].concat()
    }

    #[test]
    fn the_flash_of_the_image_ends_where_the_settings_begin() {
        let driver = include_str!("../../../src/board/settings_flash.rs");
        assert!(driver.contains("const START: usize = 0x080C_0000;"));
        assert_eq!(SETTINGS.start, FLASH.end);
    }

    #[test]
    fn data_is_stored_at_its_physical_address_and_gaps_read_as_erased() {
        let file = linked(&[
            (PT_LOAD, RAM, FLASH.start + 12, &[5, 6, 7]),
            (PT_LOAD, FLASH.start, FLASH.start, &[1, 2, 3, 4]),
            (PT_LOAD, RAM + 3, RAM + 3, &[]),
            (PT_NOTE, 0, 0, &[9]),
        ]);
        let gap = [ERASED; 8];
        assert_eq!(content(&file).unwrap(), [&[1, 2, 3, 4][..], &gap, &[5, 6, 7]].concat());
    }

    #[test]
    fn a_segment_outside_of_the_flash_is_refused() {
        for address in [0, FLASH.start - 2, SETTINGS.end, 0x1000_0000, RAM, u32::MAX - 1] {
            let file = linked(&[(PT_LOAD, FLASH.start, FLASH.start, &[0; 8]), (PT_LOAD, address, address, &[0; 4])]);
            let error = content(&file).unwrap_err();
            assert!(error.contains("outside of the image's flash"), "{error}");
        }
        assert!(content(&linked(&[])).is_err());
    }

    #[test]
    fn a_segment_that_reaches_into_the_settings_is_refused() {
        for address in [SETTINGS.start - 2, SETTINGS.start, SETTINGS.end - 4] {
            let error = content(&linked(&[(PT_LOAD, RAM, address, &[0; 4])])).unwrap_err();
            assert!(error.contains("overwrite the settings"), "{error}");
        }
        let whole = vec![0; FLASH.len()];
        assert_eq!(content(&linked(&[(PT_LOAD, FLASH.start, FLASH.start, &whole)])).unwrap(), whole);
    }

    #[test]
    fn segments_that_overlap_are_refused() {
        let file = linked(&[
            (PT_LOAD, FLASH.start, FLASH.start, &[0; 8]),
            (PT_LOAD, FLASH.start + 7, FLASH.start + 7, &[0; 8]),
        ]);
        assert_eq!(content(&file).unwrap_err(), "two pieces of data are for 0x08000007");
    }

    #[test]
    fn a_hex_file_decodes_to_the_binary() {
        for bytes in [1, 15, 16, 17, 65_536, 65_537, 150_001] {
            let content: Vec<u8> = (0..bytes).map(|index| (index * 31 % 251) as u8).collect();
            let hex = to_hex(&content).unwrap();
            assert!(hex.starts_with(":020000040800F2\n") && hex.ends_with(":00000001FF\n"));
            assert_eq!(from_hex(&hex).unwrap(), content);
        }
    }

    #[test]
    fn a_hex_file_that_is_damaged_does_not_decode() {
        let hex = to_hex(&[0x12; 40]).unwrap();
        assert!(from_hex(&hex.replacen("12", "13", 1)).unwrap_err().contains("checksum"));
        assert!(from_hex(hex.trim_end().trim_end_matches(":00000001FF")).is_err());
    }

    #[test]
    fn the_vector_table_begins_with_the_stack_and_an_odd_address_in_the_image() {
        let file = |stack, reset| [vectors(stack, reset), vec![0; 8]].concat();
        let inside = FLASH.start + 9;
        assert_eq!(check_vectors(&file(STACK, inside), STACK), Ok(()));
        assert!(check_vectors(&file(STACK - 8, inside), STACK).unwrap_err().contains("_stack_start"));
        for reset in [inside - 1, FLASH.start + 17, RAM + 1, u32::MAX] {
            assert!(check_vectors(&file(STACK, reset), STACK).unwrap_err().contains("reset handler"));
        }
        assert!(check_vectors(&[0; 7], STACK).is_err());
    }

    #[test]
    fn both_files_are_written_or_none_is_left() {
        let folder = std::env::temp_dir().join(format!("rotorlead-flash-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("image");
        let table = vectors(STACK, FLASH.start + 9);
        let file = linked(&[(PT_LOAD, FLASH.start, FLASH.start, &table), (PT_LOAD, RAM, FLASH.start + 8, &[7; 8])]);

        let files = write(&file, &path, STACK).unwrap();
        let stored = std::fs::read(&files.bin.path).unwrap();
        assert_eq!(stored, [&table[..], &[7; 8]].concat());
        assert_eq!(files.bin.bytes, stored.len());
        assert_eq!(std::fs::read(&files.hex.path).unwrap().len(), files.hex.bytes);

        assert!(write(&file, &path, STACK + 8).is_err());
        assert!(!files.bin.path.exists() && !files.hex.path.exists());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
