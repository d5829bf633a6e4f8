//! `fleet.csv`: which logs there are of which motor, and from which day.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use csv::StringRecord;
use jiff::civil::Date;

use crate::files::csv_rows::{cell_span, next, quoted, reader, row_span};
use crate::files::{FileError, OutputFolder, TextFile, did_you_mean};

/// The file's name in the fleet's folder.
pub const FLEET_LIST: &str = "fleet.csv";
const COLUMNS: [&str; 3] = ["log", "motor", "date"];
const EXAMPLE: &str = "log,motor,date\nm1_march,M1,2026-03-02\n";

/// The logs of a fleet, in the order of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetList {
    /// At least one.
    pub logs: Vec<FleetLog>,
}

/// One log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetLog {
    /// Its folder, relative to the fleet's.
    pub folder: String,
    /// The motor's name.
    pub motor: String,
    /// When it was measured; `None` where nobody wrote it down.
    pub date: Option<Date>,
}

impl FleetLog {
    /// Days since 1970.
    #[must_use]
    pub fn day(&self) -> Option<f64> {
        let since = |date: Date| date.duration_since(Date::constant(1970, 1, 1)).as_secs_f64() / 86_400.0;
        self.date.map(since)
    }

    /// Where the log is.
    #[must_use]
    pub fn path(&self, fleet: &Path) -> PathBuf {
        fleet.join(&self.folder)
    }
}

impl FleetList {
    /// Reads `fleet.csv` of a folder: a header `log,motor` or `log,motor,date`, in any order, and a row for each log. A date is written
    /// `2026-03-02`, or its cell is empty.
    ///
    /// # Errors
    /// When the file is missing, lacks a column, or has a cell that is none of these; with its place in the file.
    pub fn read(fleet: &Path) -> Result<Self, FileError> {
        Self::parse(&TextFile::read(&fleet.join(FLEET_LIST))?)
    }

    /// The same of a text.
    ///
    /// # Errors
    /// As those of [`Self::read`], of a file that was read.
    pub fn parse(text: &TextFile) -> Result<Self, FileError> {
        let mut reader = reader(text);
        let mut row = StringRecord::new();
        next(&mut reader, &mut row);
        let columns = Columns::from_header(text, &row)?;
        let (mut logs, mut folders) = (Vec::new(), BTreeSet::new());
        while next(&mut reader, &mut row) {
            let log = columns.log(text, &row)?;
            if !folders.insert(log.folder.clone()) {
                return Err(text.complaint(
                    cell_span(text, &row, columns.folder),
                    format!("the log `{}` is listed twice", quoted(&log.folder)),
                    "again here",
                    "remove one of its rows",
                ));
            }
            logs.push(log);
        }
        if logs.is_empty() {
            let help = format!("add a row for each log, for example\n{EXAMPLE}");
            return Err(text.complaint(0..text.text().len().min(1), "the list has no log", "after this header", help));
        }
        Ok(Self { logs })
    }

    /// Writes it as `fleet.csv` of a folder under construction.
    ///
    /// # Errors
    /// When the operating system refuses, or the folder has such a file already.
    pub fn write_into(&self, folder: &OutputFolder) -> Result<(), FileError> {
        let mut table = csv::Writer::from_writer(Vec::new());
        let date = |log: &FleetLog| log.date.map_or_else(String::new, |date| date.to_string());
        let rows = self.logs.iter().map(|log| [log.folder.clone(), log.motor.clone(), date(log)]);
        for row in std::iter::once(COLUMNS.map(str::to_owned)).chain(rows) {
            table.write_record(row).expect("memory takes all, and the rows are alike");
        }
        folder.write(FLEET_LIST, &table.into_inner().expect("memory takes all"))
    }
}

/// Where the columns are.
struct Columns {
    folder: usize,
    motor: usize,
    date: Option<usize>,
    count: usize,
}

impl Columns {
    fn from_header(text: &TextFile, header: &StringRecord) -> Result<Self, FileError> {
        for (index, name) in header.iter().enumerate() {
            if !COLUMNS.contains(&name) {
                let guess =
                    did_you_mean(name, COLUMNS.iter().copied()).map_or_else(String::new, |guess| format!("; {guess}"));
                return Err(text.complaint(
                    cell_span(text, header, index),
                    format!("unknown column `{}`", quoted(name)),
                    "here",
                    format!("the columns are log, motor and date{guess}"),
                ));
            }
        }
        let find = |wanted: &str| header.iter().position(|name| name == wanted);
        let needed = |wanted: &str| {
            find(wanted).ok_or_else(|| {
                text.complaint(
                    row_span(text, header),
                    format!("the list has no column `{wanted}`"),
                    "in this header",
                    format!("a list looks like this:\n{EXAMPLE}"),
                )
            })
        };
        Ok(Self { folder: needed("log")?, motor: needed("motor")?, date: find("date"), count: header.len() })
    }

    fn log(&self, text: &TextFile, row: &StringRecord) -> Result<FleetLog, FileError> {
        if row.len() != self.count {
            return Err(text.complaint(
                row_span(text, row),
                format!("{} cells under {} columns", row.len(), self.count),
                "this row",
                "write a cell for each column; that of an unknown date stays empty",
            ));
        }
        let word = |index: usize, what: &str| {
            let cell = row.get(index).unwrap_or_default();
            if cell.is_empty() {
                let message = format!("the {what} has no name");
                return Err(text.complaint(row_span(text, row), message, "in this row", format!("name the {what}")));
            }
            Ok(cell.to_owned())
        };
        let date = match self.date.map(|index| (index, row.get(index).unwrap_or_default())) {
            None | Some((_, "")) => None,
            Some((index, cell)) => Some(cell.parse().map_err(|_| {
                text.complaint(
                    cell_span(text, row, index),
                    format!("`{}` is not a date", quoted(cell)),
                    "here",
                    "write year, month and day, as in 2026-03-02, or nothing",
                )
            })?),
        };
        Ok(FleetLog { folder: word(self.folder, "log")?, motor: word(self.motor, "motor")?, date })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    fn read(text: &str) -> Result<FleetList, FileError> {
        let scratch = Scratch::new();
        scratch.file(FLEET_LIST, text);
        FleetList::read(scratch.path())
    }

    #[test]
    fn rows_are_logs() {
        let list = read("date,log,motor\n2026-03-02,a,M1\n,b/c,M 2\n").unwrap();
        assert_eq!(list.logs[0].day(), Some(20_514.0));
        assert_eq!(
            (list.logs[1].folder.as_str(), list.logs[1].motor.as_str(), list.logs[1].date),
            ("b/c", "M 2", None)
        );
        assert_eq!(read("log,motor\na,M1\n").unwrap().logs.len(), 1);
    }

    #[test]
    fn what_is_written_is_read_again() {
        let log = |folder: &str, motor: &str, date| FleetLog { folder: folder.into(), motor: motor.into(), date };
        let list =
            FleetList { logs: vec![log("a, b", "M\"1\"", None), log("c", "M2", Some(Date::constant(2026, 3, 2)))] };
        let scratch = Scratch::new();
        let fleet = scratch.path().join("fleet");
        let folder = OutputFolder::create(&fleet).unwrap();
        list.write_into(&folder).unwrap();
        folder.commit().unwrap();
        assert_eq!(FleetList::read(&fleet).unwrap(), list);
    }

    #[test]
    fn what_is_no_list_is_shown() {
        for (text, parts) in [
            ("log,moter\na,M1\n", ["fleet.csv:1:5", "`moter`", "did you mean `motor`"]),
            ("log,date\na,2026-03-02\n", ["fleet.csv:1:1", "no column `motor`", "log,motor,date"]),
            ("log,motor\n", ["fleet.csv:1:1", "no log", "m1_march"]),
            ("log,motor,date\na,M1,2.3.2026\n", ["fleet.csv:2:6", "2.3.2026", "2026-03-02"]),
            ("log,motor,date\na,M1,2026-02-30\n", ["fleet.csv:2:6", "2026-02-30", "2026-03-02"]),
            ("log,motor,date\na,M1\n", ["fleet.csv:2:1", "2 cells under 3 columns", "stays empty"]),
            ("log,motor\na,\n", ["fleet.csv:2:1", "the motor has no name", "name the motor"]),
            ("log,motor\na,M1\na,M2\n", ["fleet.csv:3:1", "listed twice", "remove one"]),
        ] {
            assert_report(read(text).unwrap_err(), &parts);
        }
    }
}
