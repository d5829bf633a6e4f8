//! Writes the MAT-file format, level 5 (MathWorks, *MAT-File Format*), uncompressed: a header of 128 bytes, then an element of tag and data
//! for each variable. MATLAB, Octave and SciPy read it.

/// A full array of doubles.
#[derive(Clone, Debug, PartialEq)]
pub struct MatVariable {
    /// Letters, digits and underscores, a letter first.
    pub name: &'static str,
    /// Its size along each dimension, two or more.
    pub dimensions: Vec<usize>,
    /// The numbers, or their real parts, columns first.
    pub real: Vec<f64>,
    /// Imaginary parts, of a complex array.
    pub imaginary: Option<Vec<f64>>,
}

/// How a file that this writes starts.
pub const MAT5_HEAD: &str = "MATLAB 5.0 MAT-file by rotorlead";
/// Bytes of text in front of the version.
const TEXT: usize = 124;
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
/// The class of arrays of doubles, in the array flags.
const DOUBLE_CLASS: u32 = 6;
/// Set in the array flags of complex numbers.
const COMPLEX: u32 = 0x0800;

/// The bytes of a file with these variables.
#[must_use]
pub fn mat5(variables: &[MatVariable]) -> Vec<u8> {
    let mut bytes = MAT5_HEAD.as_bytes().to_vec();
    bytes.resize(TEXT, b' ');
    // No subsystem data: eight zeros.
    bytes[TEXT - 8..].fill(0);
    bytes.extend([0x00, 0x01, b'I', b'M']);
    for variable in variables {
        bytes.extend(element(MATRIX, matrix(variable)));
    }
    bytes
}

fn matrix(variable: &MatVariable) -> Vec<u8> {
    let complex = if variable.imaginary.is_some() { COMPLEX } else { 0 };
    let dimensions = variable.dimensions.iter().map(|size| *size as u32);
    let mut parts = vec![
        element(UINT32, words([DOUBLE_CLASS | complex, 0])),
        element(INT32, words(dimensions)),
        element(INT8, variable.name.as_bytes().to_vec()),
        element(DOUBLE, doubles(&variable.real)),
    ];
    parts.extend(variable.imaginary.as_deref().map(|imaginary| element(DOUBLE, doubles(imaginary))));
    parts.concat()
}

/// A tag of kind and length, and the data, padded to 8 bytes.
fn element(kind: u32, data: Vec<u8>) -> Vec<u8> {
    let mut bytes = words([kind, data.len() as u32]);
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn words(words: impl IntoIterator<Item = u32>) -> Vec<u8> {
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}
