//! The messages of the link with their fields and wire types, as the host's binary prints them: derived from the types
//! themselves, so that it cannot fall behind them.

use std::fmt;

use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType, NamedValue};
use rotorlead::link::{Message, Request};

/// What the forms of numbers are, for those who read the list alone.
const LEGEND: &str = "
Types on the wire (postcard)
  u8, bool           one byte
  u16, u32           LEB128: 7 bits a byte, lowest first, the top bit set but in the last
  i32                zigzag (0, -1, 1, -2 ... as 0, 1, 2, 3 ...), then LEB128
  f64                8 bytes, little-endian
  Option             a byte 0, or 1 and the value
  [T; n]             n values
  Series             LEB128 length, then the second differences of the samples, modulo 2^32, as i32
  struct             its fields, one after the other
  enum               LEB128 number of the variant, then its fields
";

/// Prints as the list.
pub struct Messages;

impl fmt::Display for Messages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(LEGEND)?;
        let mut types = vec![Request::SCHEMA, Message::SCHEMA];
        let mut next = 0;
        while let Some(&named) = types.get(next) {
            next += 1;
            definition(named, f)?;
            for part in parts(named.ty) {
                let is_new = !types.iter().any(|known| known.name == part.name);
                if is_new && matches!(part.ty, DataModelType::Struct(_) | DataModelType::Enum(_)) {
                    types.push(part);
                }
            }
        }
        Ok(())
    }
}

/// The types that a type is made of, through arrays and options.
fn parts(ty: &'static DataModelType) -> Vec<&'static NamedType> {
    let direct: Vec<&'static NamedType> = match ty {
        DataModelType::Struct(fields) => fields.iter().map(|field| field.ty).collect(),
        DataModelType::Enum(variants) => variants
            .iter()
            .flat_map(|variant| match variant.ty {
                DataModelVariant::UnitVariant => Vec::new(),
                DataModelVariant::NewtypeVariant(inner) => vec![*inner],
                DataModelVariant::TupleVariant(fields) => fields.to_vec(),
                DataModelVariant::StructVariant(fields) => fields.iter().map(|field| field.ty).collect(),
            })
            .collect(),
        DataModelType::Option(inner) | DataModelType::NewtypeStruct(inner) | DataModelType::Seq(inner) => vec![inner],
        DataModelType::Tuple(fields) | DataModelType::TupleStruct(fields) => fields.to_vec(),
        _ => Vec::new(),
    };
    let inner: Vec<_> = direct
        .iter()
        .filter(|part| !matches!(part.ty, DataModelType::Struct(_) | DataModelType::Enum(_)))
        .flat_map(|part| parts(part.ty))
        .collect();
    direct.into_iter().chain(inner).collect()
}

fn definition(named: &NamedType, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match named.ty {
        DataModelType::Struct(fields) => {
            writeln!(f, "\nstruct {}", named.name)?;
            fields.iter().try_for_each(|field| writeln!(f, "  {}: {}", field.name, Name(field.ty)))
        }
        DataModelType::Enum(variants) => {
            writeln!(f, "\nenum {}", named.name)?;
            for (number, variant) in variants.iter().enumerate() {
                write!(f, "  {number:2} {}", variant.name)?;
                match variant.ty {
                    DataModelVariant::UnitVariant => {}
                    DataModelVariant::NewtypeVariant(inner) => write!(f, ": {}", Name(inner))?,
                    DataModelVariant::TupleVariant(fields) => {
                        fields.iter().try_for_each(|field| write!(f, " {}", Name(field)))?;
                    }
                    DataModelVariant::StructVariant(fields) => write!(f, " {{ {} }}", Fields(fields))?,
                }
                writeln!(f)?;
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Prints as the name of a type, as it is written in a field.
struct Name(&'static NamedType);

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.ty {
            DataModelType::Option(inner) => write!(f, "Option<{}>", Name(inner)),
            // Arrays are tuples of the same type.
            DataModelType::Tuple(fields @ [first, ..]) => write!(f, "[{}; {}]", Name(first), fields.len()),
            _ => f.write_str(self.0.name),
        }
    }
}

/// Prints as `name: type` one after the other.
struct Fields(&'static [&'static NamedValue]);

impl fmt::Display for Fields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, field) in self.0.iter().enumerate() {
            let separator = if index == 0 { "" } else { ", " };
            write!(f, "{separator}{}: {}", field.name, Name(field.ty))?;
        }
        Ok(())
    }
}
