//! Tables: the columns whose names say what they measure, the line of their names and the one of their units, and their numbers. What
//! stands above, among and behind them is dropped, and so is any text in a cell.

use std::borrow::Cow;
use std::path::Path;

use super::Copied;
use super::clock::Clock;
use crate::import::format::Reader;
use crate::import::plain::PlainTable;
use crate::import::quantity::Quantity;
use crate::import::table::Table;
use crate::import::{ImportError, ImportOptions, esc32, table_format};

/// What stands in place of text.
const TEXT: &str = "text";

/// The copy of a table; columns that are stated are kept.
pub(super) fn copy(file: &Path, text: &str, options: &ImportOptions) -> Result<Copied, ImportError> {
    let mut plain = PlainTable::parse(file, text)?;
    let (format, dialect) = table_format(&plain.table.header);
    plain.dialect = if esc32::table(file, text).is_some() { &esc32::DIALECT } else { dialect };
    let stated: Vec<(usize, Quantity)> = options
        .columns
        .iter()
        .flat_map(|choice| plain.called(&choice.header).into_iter().map(|column| (column, choice.quantity)))
        .collect();
    let quantity = |column: usize| {
        let stated = stated.iter().find(|(of, _)| *of == column).map(|(_, quantity)| *quantity);
        stated.or_else(|| plain.quantity(column))
    };
    let columns = plain.table.header.len();
    let quantities: Vec<Option<Quantity>> = (0..columns).map(quantity).collect();
    // Without such a column the log would be taken for one of another format.
    let is_mark = |column: usize| match format.reader {
        Reader::Table { is_header, .. } => {
            let others = plain.table.header.iter().enumerate().filter(|(at, _)| *at != column);
            !is_header(&others.map(|(_, name)| name.clone()).collect::<Vec<_>>())
        }
        _ => false,
    };
    let kept: Vec<usize> = (0..columns).filter(|&column| quantities[column].is_some() || is_mark(column)).collect();
    if kept.is_empty() {
        let problem = ": no column says what it measures, so that all would be dropped";
        let remedy = "say which columns are what, as in `--column time=t:ms`: these are kept";
        return Err(ImportError::NotRedacted { file: file.into(), problem: problem.into(), remedy: remedy.into() });
    }
    // What is ambiguous is refused by the importer too.
    let _ = plain.table.infer_comma(&kept);
    write(text, &plain, &kept, &quantities)
}

/// Writes these columns. Where columns are called by their place, the others stay as empty ones.
fn write(
    text: &str,
    plain: &PlainTable<'_>,
    kept: &[usize],
    quantities: &[Option<Quantity>],
) -> Result<Copied, ImportError> {
    let table = &plain.table;
    let name = |column: &usize| table.header[*column].as_str();
    let mut copied = Copied { kept: kept.iter().map(|column| name(column).to_owned()).collect(), ..Copied::default() };
    let mut rows = csv::WriterBuilder::new().delimiter(table.separator()).flexible(true).from_writer(Vec::new());
    // Bytes in memory take all.
    let mut add = |cells: &[Cow<'_, str>]| drop(rows.write_record(cells.iter().map(|cell| cell.as_bytes())));
    let places: Vec<Option<usize>> = match plain.header_line {
        Some(_) => kept.iter().copied().map(Some).collect(),
        None => (0..table.header.len()).map(|column| Some(column).filter(|column| kept.contains(column))).collect(),
    };
    let of_columns = |of: &dyn Fn(usize) -> String| -> Vec<Cow<'static, str>> {
        places.iter().map(|place| Cow::Owned(place.map(of).unwrap_or_default())).collect()
    };
    if plain.header_line.is_some() {
        add(&of_columns(&|column| table.header[column].clone()));
    }
    if !plain.units.is_empty() {
        add(&of_columns(&|column| plain.units.get(column).cloned().unwrap_or_default()));
    }
    let above = plain.header_line.unwrap_or(0).saturating_sub(1);
    copied.dropped.add(
        "line above the names",
        "",
        text.lines().take(above).filter(|line| !line.trim().is_empty()).count(),
    );
    copied.dropped.add("remark", "", table.remarks());

    let units: Vec<String> = (0..table.header.len()).map(|column| table.unit_behind_numbers(column)).collect();
    let is_time = |quantity: &Option<Quantity>| *quantity == Some(Quantity::Time);
    let mut clocks: Vec<Option<Clock>> =
        quantities.iter().map(|quantity| is_time(quantity).then(|| Clock::new(table.comma))).collect();
    let mut texts = 0;
    table.each(|row| {
        let mut clean = |column: usize| -> Cow<'_, str> {
            let cell = row.text(column);
            let shifted = clocks[column].as_mut().map(|clock| clock.shift(cell));
            match shifted {
                Some(Some(time)) => time.into(),
                None if Table::is_numeric(cell, &units[column]) => Cow::Owned(cell.to_owned()),
                // The names once more, which the importer tells apart from other text.
                _ if cell.is_empty() || cell == table.header[column] => Cow::Owned(cell.to_owned()),
                _ => {
                    texts += 1;
                    TEXT.into()
                }
            }
        };
        let cells: Vec<Cow<'_, str>> = places.iter().map(|place| place.map_or(Cow::Borrowed(""), &mut clean)).collect();
        add(&cells);
        for column in (0..table.header.len()).filter(|column| !kept.contains(column)) {
            copied.dropped.add("column", name(&column), usize::from(!row.text(column).is_empty()));
        }
        let beyond = (table.header.len()..Table::cells(row)).filter(|&column| !row.text(column).is_empty()).count();
        copied.dropped.add("cell without a column", "", beyond);
        Ok::<(), ImportError>(())
    })?;
    copied.dropped.add("text in a cell", "", texts);
    for (column, clock) in clocks.iter().enumerate() {
        copied
            .changes
            .extend(clock.as_ref().and_then(Clock::change).map(|change| format!("`{}` {change}", name(&column))));
    }
    copied.bytes = rows.into_inner().unwrap_or_default();
    Ok(copied)
}
