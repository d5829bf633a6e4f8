//! Any bytes as the list of a fleet's logs.

use std::collections::BTreeSet;

use rotorlead_records::files::TextFile;
use rotorlead_records::{FLEET_LIST, FleetList, FleetLog};

/// Any bytes as a list; those that are no UTF-8 are replaced.
///
/// # Panics
/// When the reader does, or takes a list that lacks a log, a name, or lists a log twice, or refuses without saying why, where and
/// what to do.
pub fn fuzz_fleet(bytes: &[u8]) {
    let text = TextFile::in_memory(FLEET_LIST, String::from_utf8_lossy(bytes).into_owned());
    match FleetList::parse(&text) {
        Ok(list) => {
            assert!(!list.logs.is_empty(), "a list without a log");
            let is_named = |log: &FleetLog| !log.folder.is_empty() && !log.motor.is_empty();
            assert!(list.logs.iter().all(is_named), "a log or a motor without a name");
            let folders: BTreeSet<&str> = list.logs.iter().map(|log| log.folder.as_str()).collect();
            assert_eq!(folders.len(), list.logs.len(), "a log that is listed twice");
            let mut days = list.logs.iter().filter_map(FleetLog::day);
            assert!(days.all(f64::is_finite), "a day that is no number");
        }
        Err(error) => {
            let report = format!("{:?}", miette::Report::new(error));
            assert!(report.contains(FLEET_LIST) && report.contains("help: "), "{report}");
        }
    }
}

/// Lists that are right, and one of each fault.
#[must_use]
pub fn fleet_corpus() -> Vec<(&'static str, Vec<u8>)> {
    [
        ("three_columns", "log,motor,date\nm1_march,M1,2026-03-02\nm1_april,M1,\n"),
        ("two_columns_in_another_order", "motor,log\r\nM 1,a/b\r\nM 2,c\r\n"),
        ("quoted", "log,motor\n\"a,b\",\"M \"\"1\"\"\"\n"),
        ("no_log", "log,motor\n"),
        ("no_such_column", "log,moter\na,M1\n"),
        ("no_such_day", "log,motor,date\na,M1,2026-02-30\n"),
        ("a_cell_too_few", "log,motor,date\na,M1\n"),
        ("no_name", "log,motor\na,\n"),
        ("twice", "log,motor\na,M1\na,M2\n"),
    ]
    .map(|(name, text)| (name, text.as_bytes().to_vec()))
    .to_vec()
}
