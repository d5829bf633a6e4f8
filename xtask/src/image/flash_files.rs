//! The files that flash an image: what it stores, as raw binary, and as Intel HEX for a flashing tool or as UF2 for a boot ROM that
//! shows itself as a drive.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use ihex::{Reader, Record};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, elf};
use serde::Deserialize;

use super::uf2;
use crate::run::Result;

/// What is where in a board's flash: the image from its start on, and the settings behind it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlashMap {
    /// First address.
    pub start: u32,
    /// How much of the image is the second stage of a boot, in front of the vector table.
    #[serde(default)]
    pub boot_bytes: u32,
    /// What the image may take.
    pub image_bytes: u32,
    /// What the settings have.
    pub settings_bytes: u32,
    /// The form beside the raw binary.
    pub form: Form,
}

impl FlashMap {
    /// The image may take this.
    pub const fn image(&self) -> Range<u32> {
        self.start..self.start + self.image_bytes
    }

    /// Where the settings are.
    pub const fn settings(&self) -> Range<u32> {
        let start = self.image().end;
        start..start + self.settings_bytes
    }

    /// Where the image's vector table is.
    pub const fn vectors(&self) -> u32 {
        self.start + self.boot_bytes
    }
}

/// A form of the flash's content.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// Intel HEX.
    Hex,
    /// UF2, for a chip of this family.
    Uf2(uf2::Family),
}

impl Form {
    /// How the name of such a file ends.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Hex => "hex",
            Self::Uf2(_) => "uf2",
        }
    }

    fn encode(self, start: u32, content: &[u8]) -> Result<Vec<u8>> {
        match self {
            Self::Hex => to_hex(start, content).map(String::into_bytes),
            Self::Uf2(family) => Ok(uf2::encode(family, start, content)),
        }
    }

    /// The content of such a file from the start of the flash on.
    fn decode(self, map: &FlashMap, file: &[u8]) -> Result<Vec<u8>> {
        match self {
            Self::Hex => from_hex(map, std::str::from_utf8(file).map_err(|error| error.to_string())?),
            Self::Uf2(family) => {
                let mut content = Vec::new();
                for (address, bytes) in uf2::decode(family, file)? {
                    append(map, &mut content, address, bytes)?;
                }
                Ok(content)
            }
        }
    }
}

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
    /// The same in the board's form.
    pub formed: FlashFile,
}

/// Writes both files beside the linked image, reads them back and checks them.
///
/// # Errors
/// When a file cannot be written, a segment lies outside of the image's flash, or what was written is not the image.
pub fn write(map: &FlashMap, file: &[u8], path: &Path, stack_start: u32) -> Result<FlashFiles> {
    remove(map, path)?;
    let content = content(map, file)?;
    let encoded = map.form.encode(map.start, &content)?;
    let [bin, formed] = paths(map, path);
    fs::write(&bin, &content).map_err(|error| format!("{}: {error}", bin.display()))?;
    fs::write(&formed, &encoded).map_err(|error| format!("{}: {error}", formed.display()))?;
    if let Err(error) = check(map, &bin, &formed, stack_start) {
        remove(map, path)?;
        return Err(error);
    }
    Ok(FlashFiles {
        bin: FlashFile { path: bin, bytes: content.len() },
        formed: FlashFile { path: formed, bytes: encoded.len() },
    })
}

/// Removes both files, so that none is left of an image that failed its checks.
///
/// # Errors
/// When a file is there and cannot be removed.
pub fn remove(map: &FlashMap, path: &Path) -> Result {
    for file in paths(map, path) {
        match fs::remove_file(&file) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(format!("{}: {error}", file.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Paths of the raw binary and of the file in the board's form.
fn paths(map: &FlashMap, path: &Path) -> [PathBuf; 2] {
    ["bin", map.form.extension()].map(|extension| path.with_extension(extension))
}

/// Checks the files as they are on disk: the one in the board's form decodes to the raw binary, which has the vector table.
fn check(map: &FlashMap, bin: &Path, formed: &Path, stack_start: u32) -> Result {
    let content = fs::read(bin).map_err(|error| format!("{}: {error}", bin.display()))?;
    let encoded = fs::read(formed).map_err(|error| format!("{}: {error}", formed.display()))?;
    let mut decoded = map.form.decode(map, &encoded)?;
    // UF2 has whole pages.
    if decoded.len() > content.len() && decoded.split_off(content.len()).iter().any(|byte| *byte != ERASED) {
        return Err(format!("{} has more than {}", formed.display(), bin.display()));
    }
    if decoded != content {
        return Err(format!("{} does not decode to {}", formed.display(), bin.display()));
    }
    check_vectors(map, &content, stack_start)
}

/// Content of the flash, from its first address on, that the segments of a linked image make.
fn content(map: &FlashMap, file: &[u8]) -> Result<Vec<u8>> {
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
        append(map, &mut content, address, data)?;
    }
    Ok(content)
}

/// Puts data at an address behind what is there, and fills the gap.
fn append(map: &FlashMap, content: &mut Vec<u8>, address: u32, data: &[u8]) -> Result {
    let (image, settings) = (map.image(), map.settings());
    let end = u64::from(address) + data.len() as u64;
    if (image.start..settings.end).contains(&address) && end > u64::from(settings.start) {
        return Err(format!(
            "data for {address:#010x} to {end:#010x} would overwrite the settings, which begin at {:#010x}",
            settings.start
        ));
    }
    if address < image.start || end > u64::from(image.end) {
        return Err(format!(
            "data for {address:#010x} to {end:#010x} is outside of the image's flash, {:#010x} to {:#010x} (board.x)",
            image.start, image.end
        ));
    }
    let offset = (address - image.start) as usize;
    if offset < content.len() {
        return Err(format!("two pieces of data are for {address:#010x}"));
    }
    content.resize(offset, ERASED);
    content.extend_from_slice(data);
    Ok(())
}

/// The flash's content as Intel HEX.
fn to_hex(start: u32, content: &[u8]) -> Result<String> {
    let mut records = Vec::new();
    let mut upper = None;
    for (index, value) in content.chunks(RECORD_BYTES).enumerate() {
        let address = start + (index * RECORD_BYTES) as u32;
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
fn from_hex(map: &FlashMap, text: &str) -> Result<Vec<u8>> {
    let mut content = Vec::new();
    let mut upper = 0;
    for (index, record) in Reader::new(text).enumerate() {
        match record.map_err(|error| format!("HEX record {}: {error}", index + 1))? {
            Record::ExtendedLinearAddress(high) => upper = u32::from(high) << 16,
            Record::Data { offset, value } => append(map, &mut content, upper | u32::from(offset), &value)?,
            Record::EndOfFile => return Ok(content),
            other => return Err(format!("HEX record {}: {other:?} is not expected", index + 1)),
        }
    }
    Err("the HEX file has no end-of-file record".to_owned())
}

/// Checks the first two words of the vector table: the initial stack pointer and the address of the reset handler.
fn check_vectors(map: &FlashMap, content: &[u8], stack_start: u32) -> Result {
    let table = content.get(map.boot_bytes as usize..).unwrap_or_default();
    let Some((&[a, b, c, d, e, f, g, h], _)) = table.split_first_chunk() else {
        return Err(format!("the image has {} bytes: too short for a vector table", content.len()));
    };
    let (stack, reset) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    if stack != stack_start {
        return Err(format!("the initial stack pointer is {stack:#010x}, and _stack_start is {stack_start:#010x}"));
    }
    let end = map.start + content.len() as u32;
    if reset % 2 == 0 || !(map.vectors()..end).contains(&reset) {
        return Err(format!(
            "the reset handler is at {reset:#010x}: an odd address (Thumb code) from {:#010x} to {end:#010x} was expected",
            map.vectors()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use object::elf::{FileHeader32, Ident, PT_LOAD, PT_NOTE, ProgramHeader32};
    use object::endian::{Endianness, U16, U32};
    use object::pod::bytes_of;

    use super::{ERASED, FlashMap, Form, check_vectors, content, from_hex, to_hex, write};

    const MAP: &FlashMap = &FlashMap {
        start: 0x0800_0000,
        boot_bytes: 0,
        image_bytes: 0xC_0000,
        settings_bytes: 0x4_0000,
        form: Form::Hex,
    };
    const FLASH: std::ops::Range<u32> = MAP.image();
    const SETTINGS: std::ops::Range<u32> = MAP.settings();

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
    fn data_is_stored_at_its_physical_address_and_gaps_read_as_erased() {
        let file = linked(&[
            (PT_LOAD, RAM, FLASH.start + 12, &[5, 6, 7]),
            (PT_LOAD, FLASH.start, FLASH.start, &[1, 2, 3, 4]),
            (PT_LOAD, RAM + 3, RAM + 3, &[]),
            (PT_NOTE, 0, 0, &[9]),
        ]);
        let gap = [ERASED; 8];
        assert_eq!(content(MAP, &file).unwrap(), [&[1, 2, 3, 4][..], &gap, &[5, 6, 7]].concat());
    }

    #[test]
    fn a_segment_outside_of_the_flash_is_refused() {
        for address in [0, FLASH.start - 2, SETTINGS.end, 0x1000_0000, RAM, u32::MAX - 1] {
            let file = linked(&[(PT_LOAD, FLASH.start, FLASH.start, &[0; 8]), (PT_LOAD, address, address, &[0; 4])]);
            let error = content(MAP, &file).unwrap_err();
            assert!(error.contains("outside of the image's flash"), "{error}");
        }
        assert!(content(MAP, &linked(&[])).is_err());
    }

    #[test]
    fn a_segment_that_reaches_into_the_settings_is_refused() {
        for address in [SETTINGS.start - 2, SETTINGS.start, SETTINGS.end - 4] {
            let error = content(MAP, &linked(&[(PT_LOAD, RAM, address, &[0; 4])])).unwrap_err();
            assert!(error.contains("overwrite the settings"), "{error}");
        }
        let whole = vec![0; FLASH.len()];
        assert_eq!(content(MAP, &linked(&[(PT_LOAD, FLASH.start, FLASH.start, &whole)])).unwrap(), whole);
    }

    #[test]
    fn segments_that_overlap_are_refused() {
        let file = linked(&[
            (PT_LOAD, FLASH.start, FLASH.start, &[0; 8]),
            (PT_LOAD, FLASH.start + 7, FLASH.start + 7, &[0; 8]),
        ]);
        assert_eq!(content(MAP, &file).unwrap_err(), "two pieces of data are for 0x08000007");
    }

    #[test]
    fn a_hex_file_decodes_to_the_binary() {
        for bytes in [1, 15, 16, 17, 65_536, 65_537, 150_001] {
            let content: Vec<u8> = (0..bytes).map(|index| (index * 31 % 251) as u8).collect();
            let hex = to_hex(FLASH.start, &content).unwrap();
            assert!(hex.starts_with(":020000040800F2\n") && hex.ends_with(":00000001FF\n"));
            assert_eq!(from_hex(MAP, &hex).unwrap(), content);
        }
    }

    #[test]
    fn a_hex_file_that_is_damaged_does_not_decode() {
        let hex = to_hex(FLASH.start, &[0x12; 40]).unwrap();
        assert!(from_hex(MAP, &hex.replacen("12", "13", 1)).unwrap_err().contains("checksum"));
        assert!(from_hex(MAP, hex.trim_end().trim_end_matches(":00000001FF")).is_err());
    }

    #[test]
    fn the_vector_table_begins_with_the_stack_and_an_odd_address_in_the_image() {
        let file = |stack, reset| [vectors(stack, reset), vec![0; 8]].concat();
        let inside = FLASH.start + 9;
        assert_eq!(check_vectors(MAP, &file(STACK, inside), STACK), Ok(()));
        assert!(check_vectors(MAP, &file(STACK - 8, inside), STACK).unwrap_err().contains("_stack_start"));
        for reset in [inside - 1, FLASH.start + 17, RAM + 1, u32::MAX] {
            assert!(check_vectors(MAP, &file(STACK, reset), STACK).unwrap_err().contains("reset handler"));
        }
        assert!(check_vectors(MAP, &[0; 7], STACK).is_err());
    }

    #[test]
    fn both_files_are_written_or_none_is_left() {
        let folder = std::env::temp_dir().join(format!("rotorlead-flash-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("image");
        let table = vectors(STACK, FLASH.start + 9);
        let file = linked(&[(PT_LOAD, FLASH.start, FLASH.start, &table), (PT_LOAD, RAM, FLASH.start + 8, &[7; 8])]);

        let files = write(MAP, &file, &path, STACK).unwrap();
        let stored = std::fs::read(&files.bin.path).unwrap();
        assert_eq!(stored, [&table[..], &[7; 8]].concat());
        assert_eq!(files.bin.bytes, stored.len());
        assert_eq!(std::fs::read(&files.formed.path).unwrap().len(), files.formed.bytes);

        assert!(write(MAP, &file, &path, STACK + 8).is_err());
        assert!(!files.bin.path.exists() && !files.formed.path.exists());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
