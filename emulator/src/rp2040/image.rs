//! What is in flash at the start: the image, and over it what the run puts there.

use object::Endianness;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};

use super::{Error, Flash, Run};

/// Where flash is in memory.
const START: u32 = 0x1000_0000;
/// Its size: the chip's limit is 16 MiB, boards have at least 2 MiB.
const SIZE: u32 = 16 << 20;

/// Pieces of the flash, of which later ones overwrite earlier ones.
pub(super) fn flash(run: &Run) -> Result<Vec<Flash>, Error> {
    let problem = |problem: String| Error::Image { image: run.image.clone(), problem };
    let file = std::fs::read(&run.image).map_err(|error| problem(error.to_string()))?;
    let mut flash = segments(&file).map_err(problem)?;
    if flash.is_empty() {
        return Err(problem("nothing of it is in flash".to_owned()));
    }
    flash.extend(run.flash.iter().cloned());
    match flash.iter().find(|piece| piece.offset as usize + piece.bytes.len() > SIZE as usize) {
        Some(piece) => Err(problem(format!("{:#x} is behind the end of the flash", piece.offset))),
        None => Ok(flash),
    }
}

/// What an ELF file loads into flash.
fn segments(file: &[u8]) -> Result<Vec<Flash>, String> {
    let words = |error: object::Error| error.to_string();
    let header = FileHeader32::<Endianness>::parse(file).map_err(words)?;
    let endian = header.endian().map_err(words)?;
    let all = header.program_headers(endian, file).map_err(words)?;
    let mut flash = Vec::new();
    for segment in all.iter().filter(|segment| segment.p_type(endian) == PT_LOAD) {
        let address = segment.p_paddr(endian);
        let bytes = segment.data(endian, file).map_err(|()| format!("the segment at {address:#x} is cut off"))?;
        if !bytes.is_empty() && (START..START + SIZE).contains(&address) {
            flash.push(Flash { offset: address - START, bytes: bytes.to_vec() });
        }
    }
    Ok(flash)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_is_not_there_is_named() {
        let error = flash(&Run::new("no-such-image.elf", 1)).unwrap_err().to_string();
        assert!(error.starts_with("no-such-image.elf: "), "{error}");
        assert!(error.ends_with("; `cargo xtask build` makes images"), "{error}");
    }

    #[test]
    fn a_file_that_is_no_image_is_refused() {
        assert!(segments(b"not an ELF file").is_err());
    }
}
