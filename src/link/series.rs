//! Samples that follow each other, in few bytes.

use core::fmt;

use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType};
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::ser::SerializeSeq as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Up to `N` samples in a row.
///
/// On the wire: their number, then for each its second difference `x[n] - 2 x[n-1] + x[n-2]` (modulo 2^32, with
/// `x[-1] = x[-2] = 0`) as a zigzag LEB128 integer. Any numbers survive exactly, in 5 bytes each at worst; a signal that
/// is smooth from tick to tick, as a multisine at 5 kHz is, takes 2 to 3 bytes a sample, and a constant one 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Series<const N: usize>(heapless::Vec<i32, N>);

/// A sample more than a [`Series`] holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl<const N: usize> Series<N> {
    /// No samples.
    #[must_use]
    pub const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    /// Appends a sample.
    ///
    /// # Errors
    /// [`Full`], when there are `N` already.
    pub fn push(&mut self, sample: i32) -> Result<(), Full> {
        self.0.push(sample).map_err(|_| Full)
    }

    /// The samples.
    #[must_use]
    pub fn as_slice(&self) -> &[i32] {
        &self.0
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether there are `N`.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.0.is_full()
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

impl<const N: usize> TryFrom<&[i32]> for Series<N> {
    type Error = Full;

    fn try_from(samples: &[i32]) -> Result<Self, Full> {
        heapless::Vec::from_slice(samples).map(Self).map_err(|_| Full)
    }
}

impl<const N: usize> Schema for Series<N> {
    const SCHEMA: &'static NamedType = &NamedType { name: "Series", ty: &DataModelType::Seq(i32::SCHEMA) };
}

/// What the next sample is expected to be: the straight line through the last two.
#[derive(Default)]
struct Line {
    last: i32,
    before: i32,
}

impl Line {
    fn next(&self) -> i32 {
        self.last.wrapping_add(self.last.wrapping_sub(self.before))
    }

    fn push(&mut self, sample: i32) {
        self.before = self.last;
        self.last = sample;
    }
}

impl<const N: usize> Serialize for Series<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut sequence = serializer.serialize_seq(Some(self.0.len()))?;
        let mut line = Line::default();
        for &sample in &self.0 {
            sequence.serialize_element(&sample.wrapping_sub(line.next()))?;
            line.push(sample);
        }
        sequence.end()
    }
}

impl<'de, const N: usize> Deserialize<'de> for Series<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Samples<const N: usize>;

        impl<'de, const N: usize> Visitor<'de> for Samples<N> {
            type Value = Series<N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "at most {N} samples")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Series<N>, A::Error> {
                let mut series = Series::new();
                let mut line = Line::default();
                while let Some(difference) = sequence.next_element::<i32>()? {
                    let sample = line.next().wrapping_add(difference);
                    line.push(sample);
                    // One too many ends the loop, however many the length claims.
                    series.push(sample).map_err(|_| A::Error::invalid_length(N + 1, &self))?;
                }
                Ok(series)
            }
        }

        deserializer.deserialize_seq(Samples)
    }
}
