//! The MAT-file format, level 5 (MathWorks, *MAT-File Format*): a header of 128 bytes, then elements
//! of a tag and data. `save -v7` puts each variable into an element of zlib data.
//!
//! Full real numeric arrays and texts are read, also within structs, objects of the kind before `classdef`, and cells; of all others the
//! name, the size and the kind are listed. A length is believed only as far as the bytes behind it go, so memory stays within a
//! multiple of the file.

use std::io::Read;

use flate2::read::ZlibDecoder;

/// Bytes in front of the first element.
const HEADER: usize = 128;
/// What the variables may inflate to, in lengths of the file, beside [`INFLATED_ANYWAY`]. Derived: deflate packs up to 1032 bytes in
/// one, but a time that increases keeps a byte or so of each row, and a row is a number or two of 8 bytes for each of six signals.
const INFLATED_PER_BYTE: usize = 64;
/// What they may inflate to in any file, bytes. Chosen: some thousand rows.
const INFLATED_ANYWAY: usize = 1 << 16;
/// Bytes that hold a variable's name. Derived: the tags, the dimensions, and the 63 letters that MATLAB allows, with room.
const NAMED_WITHIN: usize = 1 << 12;
/// Structs and cells within each other are read to this depth. Chosen: twice what exports have, far from the end of the stack.
const DEEPEST: usize = 8;
/// A cell array or an array of structs is a list of signals up to this length. Chosen: more channels than a stand has; longer ones have
/// a row in each.
const MOST_SIGNALS: usize = 256;

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
/// The class of objects that only MATLAB reads (`classdef`), whose header has no dimensions.
const OPAQUE: u32 = 17;
/// Set in the array flags of complex numbers.
const COMPLEX: u32 = 0x0800;

/// What the file's first 128 bytes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Header {
    /// Level 5, read here.
    Level5,
    /// `save -v7.3`: HDF5 behind a similar header.
    Hdf5,
}

/// A variable of the file, or a part of one, which is called by its path: `run.X.Data`, `run.Y(2).Data`, `z{1}`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variable {
    pub(super) name: String,
    /// Empty of an opaque object, which has none.
    pub(super) dimensions: Vec<usize>,
    pub(super) content: Content,
}

/// What a variable is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// Full real numbers, columns first.
    Real(Vec<f64>),
    /// The same, packed tighter than any recording, so that they were left packed.
    Packed,
    Text(String),
    /// Fields of a struct, or of the class of that name.
    Struct(Option<String>, Vec<Variable>),
    Cell(Vec<Variable>),
    Complex,
    Sparse,
    FunctionHandle,
    /// An object of this class that only MATLAB reads, such as a `timeseries`.
    Object(String),
    /// A class of the format that is newer than this reader.
    Unknown,
}

/// What is wrong with the file, and the byte of it where that shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Damage {
    pub(super) offset: usize,
    pub(super) problem: &'static str,
}

/// Whether `bytes` begin as a MAT-file of level 5 or later; `None`: something else.
pub(super) fn header(bytes: &[u8]) -> Option<Header> {
    match bytes.get(124..HEADER)? {
        [0x00, 0x01, b'I', b'M'] | [0x01, 0x00, b'M', b'I'] => Some(Header::Level5),
        [0x00, 0x02, b'I', b'M'] | [0x02, 0x00, b'M', b'I'] => Some(Header::Hdf5),
        _ => None,
    }
}

/// All variables of a file of level 5.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Variable>, Damage> {
    let order = if bytes.get(126) == Some(&b'M') { Order::Big } else { Order::Little };
    let mut elements = Elements { bytes, at: HEADER.min(bytes.len()), order };
    let mut variables = Vec::new();
    let mut budget = INFLATED_ANYWAY.saturating_add(bytes.len().saturating_mul(INFLATED_PER_BYTE));
    while let Some(element) = elements.next_top()? {
        let within = |damage: Damage| Damage { offset: element.offset, ..damage };
        let variable = match element.kind {
            MATRIX => matrix(element.data, order, Wanted::ALL).map_err(within)?,
            COMPRESSED => {
                let inflated =
                    |limit| inflate(element.data, limit).map_err(|problem| within(Damage { offset: 0, problem }));
                let head = inflated(NAMED_WITHIN)?;
                let mut words = head.as_chunks::<4>().0.iter().map(|word| order.word(*word));
                if words.next().is_some_and(|kind| kind != MATRIX) {
                    continue;
                }
                // The tag says the length, so that what is too long need not be inflated to see that.
                let length = words.next().map_or(0, |length| (length as usize).saturating_add(8));
                match budget.checked_sub(length) {
                    Some(rest) => {
                        budget = rest;
                        let whole = inflated(length)?;
                        let inner = Elements { bytes: &whole, at: 0, order }.next().map_err(within)?;
                        matrix(inner.data, order, Wanted::ALL).map_err(within)?
                    }
                    None => matrix(head.get(8..).unwrap_or_default(), order, Wanted::NAME).map_err(within)?,
                }
            }
            _ => continue,
        };
        // Nameless ones are MATLAB's own (the workspace of function handles).
        variables.extend(variable.filter(|v| !v.name.is_empty()));
    }
    Ok(variables)
}

/// What is read of a variable.
#[derive(Clone, Copy)]
struct Wanted {
    /// Whether its numbers are, which may be cut off.
    numbers: bool,
    /// Structs and cells within each other that are still read.
    depth: usize,
}

impl Wanted {
    const ALL: Self = Self { numbers: true, depth: DEEPEST };
    const NAME: Self = Self { numbers: false, depth: 0 };
}

/// The first `limit` bytes, or all.
fn inflate(data: &[u8], limit: usize) -> Result<Vec<u8>, &'static str> {
    let mut inflated = Vec::new();
    match ZlibDecoder::new(data).take(limit as u64).read_to_end(&mut inflated) {
        Ok(_) => Ok(inflated),
        Err(_) => Err("compressed data are damaged"),
    }
}

#[derive(Clone, Copy)]
enum Order {
    Little,
    Big,
}

impl Order {
    fn word(self, bytes: [u8; 4]) -> u32 {
        match self {
            Self::Little => u32::from_le_bytes(bytes),
            Self::Big => u32::from_be_bytes(bytes),
        }
    }
}

/// One element: its type, its data, and where its tag is.
struct Element<'a> {
    kind: u32,
    data: &'a [u8],
    offset: usize,
}

/// Elements one after the other.
struct Elements<'a> {
    bytes: &'a [u8],
    at: usize,
    order: Order,
}

impl<'a> Elements<'a> {
    /// The next element of the file; `None` at its end.
    fn next_top(&mut self) -> Result<Option<Element<'a>>, Damage> {
        if self.at >= self.bytes.len() {
            return Ok(None);
        }
        self.next().map(Some)
    }

    fn next(&mut self) -> Result<Element<'a>, Damage> {
        let offset = self.at;
        let cut = Damage { offset, problem: "the file ends within a variable" };
        let rest = self.bytes.get(offset..).unwrap_or_default();
        let (&tag, rest) = rest.split_first_chunk::<4>().ok_or(cut)?;
        let (&second, rest) = rest.split_first_chunk::<4>().ok_or(cut)?;
        let first = self.order.word(tag);
        // Four bytes of data or fewer sit in the tag, their count in the upper half of its first word.
        if first >> 16 != 0 {
            let length = (first >> 16) as usize;
            let start = offset + 4;
            let data = self.bytes.get(start..start + length).filter(|_| length <= 4);
            self.at = offset + 8;
            return Ok(Element { kind: first & 0xffff, data: data.ok_or(cut)?, offset });
        }
        let length = self.order.word(second) as usize;
        let data = rest.get(..length).ok_or(cut)?;
        // Data are padded to 8 bytes, except compressed ones; the last padding may be missing.
        let padding = if first == COMPRESSED { 0 } else { length.wrapping_neg() % 8 };
        self.at = offset + 8 + length + padding;
        Ok(Element { kind: first, data, offset })
    }

    fn expect(&mut self, kind: u32, problem: &'static str) -> Result<&'a [u8], Damage> {
        let element = self.next()?;
        if element.kind == kind { Ok(element.data) } else { Err(Damage { offset: element.offset, problem }) }
    }

    fn text(&mut self, problem: &'static str) -> Result<String, Damage> {
        self.expect(INT8, problem).map(|text| String::from_utf8_lossy(text).into_owned())
    }

    /// So many nameless variables.
    fn cells(&mut self, count: usize, wanted: Wanted) -> Result<Vec<Variable>, Damage> {
        let cell = |index: usize| Ok(self.part(wanted)?.map(|cell| (index, cell)));
        let cells: Vec<_> = (0..count).map(cell).collect::<Result<Vec<_>, Damage>>()?;
        let named = |(index, mut cell): (usize, Variable)| {
            cell.name = if count == 1 { String::new() } else { format!("{{{}}}", index + 1) };
            cell
        };
        Ok(cells.into_iter().flatten().map(named).collect())
    }

    /// The fields of so many structs.
    fn fields(&mut self, count: usize, wanted: Wanted) -> Result<Vec<Variable>, Damage> {
        let problem = "a struct without the names of its fields";
        let longest = self.expect(INT32, problem)?.first_chunk().map_or(0, |word| self.order.word(*word) as usize);
        let names = self.expect(INT8, problem)?;
        let name = |name: &[u8]| String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
        let names: Vec<String> = names.chunks(longest.max(1)).map(name).collect();
        let mut fields = Vec::new();
        for index in 0..count {
            for name in &names {
                let Some(mut field) = self.part(wanted)? else { continue };
                field.name = if count == 1 { format!(".{name}") } else { format!("({}).{name}", index + 1) };
                fields.push(field);
            }
        }
        Ok(fields)
    }

    /// A variable within another.
    fn part(&mut self, wanted: Wanted) -> Result<Option<Variable>, Damage> {
        let part = self.next()?;
        if part.kind != MATRIX {
            return Err(Damage { offset: part.offset, problem: "a part of a variable that is none" });
        }
        matrix(part.data, self.order, wanted)
    }
}

/// A matrix element's variable; `None` for an empty element.
fn matrix(data: &[u8], order: Order, wanted: Wanted) -> Result<Option<Variable>, Damage> {
    if data.is_empty() {
        return Ok(None);
    }
    let mut parts = Elements { bytes: data, at: 0, order };
    let flags = parts.expect(UINT32, "a variable without flags")?;
    let flags = flags.first_chunk::<4>().map(|word| order.word(*word));
    let flags = flags.ok_or(Damage { offset: 0, problem: "a variable without flags" })?;
    let class = flags & 0xff;
    if class == OPAQUE {
        let name = parts.text("a variable without a name")?;
        // In between stands the name of the system of types, always the same.
        parts.text("an object without a type")?;
        let content = Content::Object(parts.text("an object without a class")?);
        return Ok(Some(Variable { name, dimensions: Vec::new(), content }));
    }
    let sizes = parts.expect(INT32, "a variable without dimensions")?;
    let dimensions: Vec<usize> = sizes.as_chunks::<4>().0.iter().map(|word| order.word(*word) as usize).collect();
    let name = parts.text("a variable without a name")?;
    let problem = Damage { offset: 0, problem: "the numbers of a variable do not have its size" };
    let count = || dimensions.iter().try_fold(1_usize, |n, &d| n.checked_mul(d)).ok_or(problem);
    let inner = (wanted.depth > 0).then(|| Wanted { depth: wanted.depth - 1, ..wanted });
    let content = match class {
        1 => match inner.filter(|_| count().is_ok_and(|count| count <= MOST_SIGNALS)) {
            Some(inner) => Content::Cell(parts.cells(count()?, inner)?),
            None => Content::Cell(Vec::new()),
        },
        2 | 3 => {
            let class = match class {
                3 => Some(parts.text("an object without a class")?),
                _ => None,
            };
            match inner.filter(|_| count().is_ok_and(|count| count <= MOST_SIGNALS)) {
                Some(inner) => Content::Struct(class, parts.fields(count()?, inner)?),
                None => Content::Struct(class, Vec::new()),
            }
        }
        5 => Content::Sparse,
        // Double, single and the integers.
        6..=15 if flags & COMPLEX != 0 => Content::Complex,
        4 | 6..=15 if !wanted.numbers => Content::Packed,
        4 | 6..=15 => {
            let numbers = parts.next()?;
            let values = numeric(numbers.kind, numbers.data, order)
                .ok_or(Damage { offset: 0, problem: "numbers of an unknown type" })?;
            if class == 4 {
                let letters = values.iter().map(|code| char::from_u32(*code as u32).unwrap_or('?'));
                Content::Text(letters.collect())
            } else if values.len() == count()? {
                Content::Real(values)
            } else {
                return Err(problem);
            }
        }
        16 => Content::FunctionHandle,
        _ => Content::Unknown,
    };
    Ok(Some(Variable { name, dimensions, content }))
}

/// The numbers as doubles; `None` for an unknown type. MATLAB stores whole numbers in the shortest
/// type that holds them, whatever the array's class.
fn numeric(kind: u32, data: &[u8], order: Order) -> Option<Vec<f64>> {
    macro_rules! read {
        ($type:ty) => {
            data.as_chunks::<{ size_of::<$type>() }>()
                .0
                .iter()
                .map(|bytes| match order {
                    Order::Little => <$type>::from_le_bytes(*bytes) as f64,
                    Order::Big => <$type>::from_be_bytes(*bytes) as f64,
                })
                .collect()
        };
    }
    Some(match kind {
        1 => read!(i8),
        2 | 16 => read!(u8),
        3 => read!(i16),
        4 | 17 => read!(u16),
        5 => read!(i32),
        6 => read!(u32),
        7 => read!(f32),
        9 => read!(f64),
        12 => read!(i64),
        13 => read!(u64),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{MatVariable, mat5};

    #[test]
    fn what_is_written_is_read() {
        let real = |name, dimensions: &[usize], real: &[f64]| MatVariable {
            name,
            dimensions: dimensions.to_vec(),
            real: real.to_vec(),
            imaginary: None,
        };
        let frequency = real("frequency", &[3, 1], &[0.5, -1e-300, f64::MAX]);
        let cube = real("covariance", &[1, 1, 2, 2], &[1.0, 2.0, 3.0, 4.0]);
        let response = MatVariable { imaginary: Some(vec![7.0, 8.0]), ..real("response", &[2, 1], &[5.0, 6.0]) };
        let bytes = mat5(&[frequency.clone(), response.clone(), cube.clone()]);
        assert_eq!(header(&bytes), Some(Header::Level5));
        let read = read(&bytes).unwrap();
        for (variable, written) in read.iter().zip([&frequency, &response, &cube]) {
            assert_eq!((&*variable.name, &variable.dimensions), (written.name, &written.dimensions));
            let content = match written.imaginary {
                Some(_) => Content::Complex,
                None => Content::Real(written.real.clone()),
            };
            assert_eq!(variable.content, content);
        }
        assert_eq!(read.len(), 3);
        // Real parts, then imaginary ones, each behind the tag of its doubles.
        let parts = [5.0_f64, 6.0, 7.0, 8.0].map(f64::to_le_bytes);
        let tag = [9, 0, 0, 0, 16, 0, 0, 0];
        let expected = [&tag, &parts[0], &parts[1], &tag, &parts[2], &parts[3]].map(|part| &part[..]).concat();
        assert!(bytes.windows(expected.len()).any(|window| window == expected));
    }
}
