//! Writing an experiment's folder.

use std::path::Path;

use super::clock::{Clock, WrongClock};
use super::column::{Column, LEAST_ROWS, TOO_FEW_ROWS};
use super::command_log::{CommandLog, SAME_COMMAND};
use super::manifest::{CommandKind, MANIFEST, Manifest};
use super::sampling::Grid;
use super::{Experiment, Record};
use crate::files::{Fault, FileError, FilesInMemory, KeyPath, OutputFolder, to_toml};

/// Room for one number and its comma, bytes: the shortest text that reads back as the same number.
const CELL: usize = 20;
/// Rows whose text is in memory at a time.
const PART_ROWS: usize = 1 << 14;

impl Experiment {
    /// Writes the experiment as a new folder, which appears when it is complete.
    ///
    /// Numbers are written with as many digits as it takes to read the same ones back. The files of
    /// compensators are not part of an experiment in memory: write those with
    /// [`Experiment::write_into`] and [`OutputFolder::write`].
    ///
    /// # Errors
    /// When reading it back would refuse it (then nothing is written), the folder exists and is not
    /// empty, or the operating system refuses.
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        let folder = OutputFolder::create(folder)?;
        self.write_into(&folder)?;
        folder.commit()
    }

    /// As [`Experiment::write`], for response logs that were recorded apart from their commands: a record may be without a command,
    /// and then its file has no such column. [`Experiment::read_responses`] reads them.
    ///
    /// # Errors
    /// As for [`Experiment::write`].
    pub fn write_responses(&self, folder: &Path) -> Result<(), FileError> {
        let folder = OutputFolder::create(folder)?;
        self.write_columns(&folder, "", &[Column::for_output(self.output)])?;
        folder.commit()
    }

    /// Writes the experiment into a folder under construction, which may hold other files too.
    ///
    /// # Errors
    /// As for [`Experiment::write`].
    pub fn write_into(&self, folder: &OutputFolder) -> Result<(), FileError> {
        self.write_columns(folder, "", &self.needed())
    }

    /// As [`Experiment::write_into`], into a folder `name` of that folder: one of several experiments.
    ///
    /// # Errors
    /// As for [`Experiment::write`].
    pub fn write_below(&self, folder: &OutputFolder, name: &str) -> Result<(), FileError> {
        self.write_columns(folder, &format!("{name}/"), &self.needed())
    }

    /// The files of [`Self::write_into`], in memory.
    ///
    /// # Errors
    /// When reading them back would refuse them.
    pub fn files(&self) -> Result<FilesInMemory, FileError> {
        self.check()?;
        let mut files = FilesInMemory::from([(MANIFEST.to_owned(), to_toml(&Manifest::from_experiment(self)).into())]);
        for record in &self.records {
            let texts = record_files(record).into_iter();
            files.extend(texts.map(|(name, parts)| (name.to_owned(), parts.collect::<String>().into())));
        }
        Ok(files)
    }

    /// Refuses what reading the written files would refuse.
    ///
    /// # Errors
    /// When a value of the experiment or of a record's columns is missing, impossible or out of its range.
    pub fn check(&self) -> Result<(), FileError> {
        self.check_for(&self.needed()).map_err(|(name, fault)| FileError::Faulty { name, fault: Box::new(fault) })
    }

    /// The columns that every record has.
    pub(super) fn needed(&self) -> [Column; 2] {
        [Column::Command, Column::for_output(self.output)]
    }

    /// The names of all files begin with `below`.
    fn write_columns(&self, folder: &OutputFolder, below: &str, needed: &[Column]) -> Result<(), FileError> {
        let within = |name: &str| format!("{below}{name}");
        self.check_for(needed)
            .map_err(|(name, fault)| FileError::refused(&folder.destination().join(within(&name)), fault))?;
        folder.write(&within(MANIFEST), to_toml(&Manifest::from_experiment(self)).as_bytes())?;
        for record in &self.records {
            for (name, parts) in record_files(record) {
                folder.write_parts(&within(name), parts)?;
            }
        }
        Ok(())
    }

    /// The first fault, and the file that would have it.
    fn check_for(&self, needed: &[Column]) -> Result<(), (String, Fault)> {
        Manifest::from_experiment(self).check().map_err(|fault| (MANIFEST.to_owned(), fault))?;
        for record in &self.records {
            self.check_columns(record, needed).map_err(|fault| (record.file.clone(), fault))?;
        }
        Ok(())
    }

    /// What reading checks of a CSV file, for the columns in memory; `needed` are there, beside the times.
    pub(super) fn check_columns(&self, record: &Record, needed: &[Column]) -> Result<(), Fault> {
        let rows = record.time_s.len();
        let place = |column: Column| KeyPath::root().key(column.name());
        if rows < LEAST_ROWS {
            return Err(place(Column::TimeS).fault(format!("too few rows: {rows}"), TOO_FEW_ROWS));
        }
        if let Some(missing) = needed.iter().find(|column| column.values(record).is_none()) {
            let help = match missing {
                Column::Command => "add it: every record has time_s, command and its response",
                _ => "add it, or set the experiment's output to the response that was measured",
            };
            return Err(place(*missing).fault("the column is missing", help));
        }
        for column in Column::ALL {
            let Some(values) = column.values(record) else {
                continue;
            };
            if values.len() != rows {
                return Err(place(column).fault(
                    format!("{} rows, but {rows} times", values.len()),
                    "give every column a value at every time",
                ));
            }
            check_values(column, values, &place(column))?;
        }
        if let Some(log) = &record.command_log {
            check_log(log, record)?;
        }
        if let Some(WrongClock { row, message, help }) = Clock::from_record(record).wrong() {
            return Err(place(Column::TimeS).item(row - 1).fault(message, help));
        }
        match self.sample_rate_hz {
            Some(rate_hz) if !Grid::through(&record.time_s, 1.0 / rate_hz).holds(&record.time_s) => {
                Err(place(Column::TimeS).fault(
                    format!("the times contradict the sampling rate of {rate_hz} Hz"),
                    "correct the rate or the times, or leave the rate out",
                ))
            }
            _ => Ok(()),
        }
    }
}

fn check_values(column: Column, values: &[f64], place: &KeyPath) -> Result<(), Fault> {
    let mut previous = None;
    for (row, value) in values.iter().enumerate() {
        column
            .accept(CommandKind::Duty, previous, *value)
            .map_err(|refusal| place.item(row).fault(refusal.message, refusal.help))?;
        previous = Some(*value);
    }
    Ok(())
}

/// What reading checks of a record's command log.
fn check_log(log: &CommandLog, record: &Record) -> Result<(), Fault> {
    let place = |column: Column| KeyPath::root().key("command_file").key(column.name());
    let (rows, commands) = (log.time_s.len(), log.command.len());
    if rows < LEAST_ROWS || commands != rows {
        let message = format!("{rows} times and {commands} commands");
        return Err(place(Column::TimeS).fault(message, "give two commands or more, each with its time"));
    }
    for (column, values) in [(Column::TimeS, &log.time_s), (Column::Command, &log.command)] {
        check_values(column, values, &place(column))?;
    }
    if log.time_s[0] > record.time_s[0] {
        let message = "the first command is after the record's first row";
        let help = "start it with the command that is in force at the first row";
        return Err(place(Column::TimeS).item(0).fault(message, help));
    }
    let expected = log.at_rows(&record.time_s, record.excitation);
    let mut rows = record.command.iter().zip(&expected);
    rows.position(|(here, there)| (here - there).abs() > SAME_COMMAND).map_or(Ok(()), |row| {
        let message = format!("the row has {}, and its command log {}", record.command[row], expected[row]);
        let help = "take the rows' commands from the log: `CommandLog::at_rows`";
        Err(KeyPath::root().key(Column::Command.name()).item(row).fault(message, help))
    })
}

/// The files of a record: their names and texts, in parts.
pub(super) fn record_files(record: &Record) -> Vec<(&str, Box<dyn Iterator<Item = String> + '_>)> {
    let columns = Column::ALL.into_iter().filter_map(|column| Some((column, column.values(record)?))).collect();
    let mut files: Vec<(&str, Box<dyn Iterator<Item = String>>)> = vec![(&record.file, Box::new(csv_parts(columns)))];
    if let Some(log) = &record.command_log {
        let columns = vec![(Column::TimeS, &log.time_s[..]), (Column::Command, &log.command)];
        files.push((&log.file, Box::new(csv_parts(columns))));
    }
    files
}

/// The CSV text of columns: names and numbers, none of which needs quotes.
fn csv_parts(columns: Vec<(Column, &[f64])>) -> impl Iterator<Item = String> {
    let names: Vec<_> = columns.iter().map(|(column, _)| column.name()).collect();
    let header = format!("{}\n", names.join(","));
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    let parts = (0..rows).step_by(PART_ROWS).map(move |first| {
        let end = rows.min(first + PART_ROWS);
        let mut text = String::with_capacity((end - first) * columns.len() * CELL);
        let mut digits = ryu::Buffer::new();
        for row in first..end {
            for (index, (_, values)) in columns.iter().enumerate() {
                if index > 0 {
                    text.push(',');
                }
                text.push_str(digits.format(values[row]));
            }
            text.push('\n');
        }
        text
    });
    std::iter::once(header).chain(parts)
}
