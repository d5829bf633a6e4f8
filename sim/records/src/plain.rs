//! Rows of plain numbers, read in one go: nearly all rows of nearly all records.

use super::column::Column;
use super::manifest::CommandKind;

/// Reads rows of nothing but numbers, one for each of `columns`, with commas between them and a line end after them, to the
/// end of `text`. `before` is what stood last in each column before.
///
/// False when there is anything else in the text, or a number that its column does not accept; `values` then end
/// somewhere before it. What it is, and whether it is wrong, is for a reader to say that knows quotes and spaces.
///
/// Numbers are the ones nearest to their decimals, as [`str::parse`] gives them.
pub(super) fn read(
    text: &[u8],
    columns: &[Column],
    kind: CommandKind,
    before: &[Option<f64>],
    values: &mut [Vec<f64>],
) -> bool {
    let Some(last) = columns.len().checked_sub(1) else { return false };
    let mut rest = text;
    let mut previous = before.to_vec();
    while let Some(&byte) = rest.first() {
        if matches!(byte, b'\n' | b'\r') {
            rest = &rest[1..];
            continue;
        }
        for (index, column) in columns.iter().enumerate() {
            let Ok((value, length)) = fast_float2::parse_partial::<f64, _>(rest) else { return false };
            let Ok(value) = column.accept(kind, previous[index], value) else { return false };
            previous[index] = Some(value);
            values[index].push(value);
            rest = &rest[length..];
            match rest.first() {
                Some(b',') if index < last => rest = &rest[1..],
                Some(b'\n' | b'\r') | None if index == last => {}
                _ => return false,
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn parsed(cell: &str) -> Option<f64> {
        let mut values = [Vec::new()];
        let text = format!("{cell}\n");
        let read = read(text.as_bytes(), &[Column::VoltageV], CommandKind::Duty, &[None], &mut values);
        values[0].first().copied().filter(|_| read)
    }

    proptest! {
        #[test]
        fn every_number_is_read_as_the_one_nearest_to_it(bits in any::<u64>()) {
            let number = f64::from_bits(bits);
            // Of the numbers that a column accepts.
            prop_assume!(number.abs() <= 1e6);
            let mut digits = ryu::Buffer::new();
            for text in [digits.format(number).to_owned(), format!("{number}"), format!("{number:.7e}")] {
                prop_assert_eq!(parsed(&text).map(f64::to_bits), text.parse().ok().map(f64::to_bits), "{}", text);
            }
        }

        #[test]
        fn what_is_read_is_a_number_for_the_standard_library_too(cell in "[-+0-9.eE_ xinfa]{1,12}") {
            if let Some(value) = parsed(&cell) {
                prop_assert_eq!(cell.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()));
            }
        }
    }

    #[test]
    fn all_else_is_left_to_another_reader() {
        for cell in ["", " 1", "1 ", "\"1\"", "1,", "1,2", "nan", "inf", "1e999", "0x10", "1e", "1;", "\t1", "é"] {
            assert_eq!(parsed(cell), None, "{cell:?}");
        }
    }
}
