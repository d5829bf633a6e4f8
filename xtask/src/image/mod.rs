//! What the linked image for the controller contains: sizes, calls, depth of the stack.

mod calls;
pub mod flash_files;
mod thumb;
pub mod uf2;

use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, SymbolKind, elf};

pub use calls::Calls;

use crate::run::Result;

/// A function of the image.
#[derive(Clone, Debug)]
pub struct Function {
    /// Its names, demangled; functions that came out alike share an address.
    pub names: Vec<String>,
    /// Where it starts.
    pub address: u32,
    /// Bytes.
    pub size: u32,
}

impl Function {
    /// Its first name.
    pub fn name(&self) -> &str {
        self.names.first().map_or("?", String::as_str)
    }
}

/// The image.
pub struct Image {
    /// Ordered by address.
    pub functions: Vec<Function>,
    /// Address and content of what is loaded.
    sections: Vec<(u32, Vec<u8>)>,
    /// Begins of instructions and of data among them, by address: `true` is data.
    marks: Vec<(u32, bool)>,
    /// Functions whose address is stored or loaded somewhere.
    taken: Vec<u32>,
    /// Bytes of flash.
    pub flash_bytes: u64,
    /// Bytes of RAM that are not stack.
    pub ram_bytes: u64,
    /// Bytes of stack.
    pub stack_bytes: u64,
    /// Initial stack pointer, the symbol `_stack_start`.
    pub stack_start: u32,
}

impl Image {
    /// Reads a linked image.
    ///
    /// # Errors
    /// When it is not a 32-bit ELF file with symbols and relocations.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        let file = ElfFile32::<object::Endianness>::parse(bytes).map_err(|error| error.to_string())?;
        let mut functions: Vec<Function> = Vec::new();
        let mut marks = Vec::new();
        let (mut stack_start, mut stack_end) = (0, 0);
        for symbol in file.symbols() {
            let (Ok(name), address) = (symbol.name(), symbol.address() as u32) else { continue };
            match name {
                "_stack_start" => stack_start = symbol.address(),
                "_stack_end" => stack_end = symbol.address(),
                _ if name == "$t" || name.starts_with("$t.") => marks.push((address, false)),
                _ if name == "$d" || name.starts_with("$d.") => marks.push((address, true)),
                _ if symbol.kind() == SymbolKind::Text && symbol.size() > 0 => functions.push(Function {
                    names: vec![format!("{:#}", rustc_demangle::demangle(name))],
                    address: address & !1,
                    size: symbol.size() as u32,
                }),
                _ => {}
            }
        }
        functions.sort_by_key(|function| function.address);
        functions.dedup_by(|next, first| {
            let same = next.address == first.address;
            if same {
                first.names.append(&mut next.names);
                first.size = first.size.max(next.size);
            }
            same
        });
        marks.sort_unstable();
        if functions.is_empty() {
            return Err("the image has no symbols".to_owned());
        }

        let mut image = Self {
            functions,
            sections: vec![],
            marks,
            taken: vec![],
            flash_bytes: 0,
            ram_bytes: 0,
            stack_bytes: stack_start - stack_end,
            stack_start: stack_start as u32,
        };
        let endian = file.endian();
        for segment in file.elf_header().program_headers(endian, bytes).map_err(|error| error.to_string())? {
            if segment.p_type(endian) == elf::PT_LOAD {
                image.flash_bytes += u64::from(segment.p_filesz(endian));
            }
        }
        let mut relocations = 0;
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
            if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
                continue;
            }
            if section.address() >= 0x2000_0000 {
                image.ram_bytes += section.size();
            }
            if section.kind() != SectionKind::UninitializedData {
                let data = section.data().map_err(|error| error.to_string())?;
                image.sections.push((section.address() as u32, data.to_vec()));
            }
            // The vector table's functions are called by the core alone.
            let vectors = section.name() == Ok(".vector_table");
            for (_, relocation) in section.relocations() {
                relocations += 1;
                let object::RelocationFlags::Elf { r_type } = relocation.flags() else { continue };
                let address = matches!(r_type, elf::R_ARM_ABS32 | elf::R_ARM_THM_MOVW_ABS_NC | elf::R_ARM_REL32);
                let object::RelocationTarget::Symbol(index) = relocation.target() else { continue };
                if address && !vectors {
                    let symbol = file.symbol_by_index(index).map_err(|error| error.to_string())?;
                    if symbol.kind() == SymbolKind::Text {
                        image.taken.push(symbol.address() as u32 & !1);
                    }
                }
            }
        }
        if relocations == 0 {
            return Err("the image was linked without --emit-relocs".to_owned());
        }
        image.taken.sort_unstable();
        image.taken.dedup();
        Ok(image)
    }

    /// The function that begins at or spans an address.
    pub fn function_at(&self, address: u32) -> Option<usize> {
        let next = self.functions.partition_point(|function| function.address <= address);
        let index = next.checked_sub(1)?;
        let function = &self.functions[index];
        (address - function.address < function.size).then_some(index)
    }

    /// The function with this name.
    pub fn function_named(&self, name: &str) -> Option<usize> {
        self.functions.iter().position(|function| function.names.iter().any(|known| known == name))
    }

    /// Two bytes of what is loaded.
    pub fn halfword(&self, address: u32) -> Option<u16> {
        self.sections.iter().find_map(|(start, data)| {
            let at = address.checked_sub(*start)? as usize;
            Some(u16::from_le_bytes(data.get(at..at + 2)?.try_into().ok()?))
        })
    }

    fn is_data(&self, address: u32) -> bool {
        let next = self.marks.partition_point(|(mark, _)| *mark <= address);
        next.checked_sub(1).is_some_and(|index| self.marks[index].1)
    }
}
