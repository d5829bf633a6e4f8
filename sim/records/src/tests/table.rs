use super::{CSV, MANIFEST, edited, read, refuses_csv};
use crate::files::testing::assert_report;

#[test]
fn forms_that_mean_the_same_read_the_same() {
    let plain = read(MANIFEST, CSV).unwrap();
    for other in [
        CSV.replace('\n', "\r\n"),
        format!("\u{feff}{CSV}"),
        CSV.trim_end().to_owned(),
        CSV.replace(',', " , "),
        CSV.replace("command", "\"command\"").replace("3.2", "\"3.2\""),
        CSV.replace("0.45", "4.5e-1"),
        format!("\n{CSV}\n\n"),
    ] {
        assert_eq!(read(MANIFEST, &other).unwrap(), plain, "{other:?}");
    }
}

#[test]
fn a_missing_column_is_named() {
    for (column, remedy) in [
        ("time_s", "every record has"),
        ("command", "every record has"),
        ("thrust_n", "correct `output` in experiment.toml"),
    ] {
        let csv = CSV.replace(column, "rpm");
        let parts = ["u050.csv:1:1", &format!("column `{column}` is missing"), remedy];
        refuses_csv(&csv, &parts);
    }
}

#[test]
fn a_column_that_is_there_twice_is_refused() {
    let csv = CSV.replace("thrust_n", "command");
    refuses_csv(&csv, &["u050.csv:1:16", "duplicate column `command`", "remove one"]);
}

#[test]
fn an_unknown_column_is_refused() {
    let csv = CSV.replace("thrust_n", "thrust");
    refuses_csv(&csv, &["u050.csv:1:16", "`thrust` is not known", "did you mean `thrust_n`?", "voltage_v, current_a"]);
    let csv = CSV.replace("thrust_n", "thrust_n,");
    refuses_csv(&csv, &["u050.csv:1:25", "column 4 has no name", "remove it"]);
}

#[test]
fn other_separators_and_a_missing_header_are_recognized() {
    refuses_csv(&CSV.replace(',', ";"), &["u050.csv:1:1", "columns with commas"]);
    refuses_csv(&CSV.replace(',', "\t"), &["u050.csv:1:1", "columns with commas"]);
    let numbers = &CSV[CSV.find('\n').unwrap() + 1..];
    refuses_csv(numbers, &["u050.csv:1:1", "`0.000` is not known", "with a header line"]);
}

#[test]
fn a_cell_that_is_no_number_is_shown() {
    let parts = ["u050.csv:3:12", "line 3, column `thrust_n`", "`3.2 N`", "plain number"];
    refuses_csv(&CSV.replace("3.2", "3.2 N"), &parts);
    refuses_csv(&CSV.replace("3.2", "0x10"), &["u050.csv:3:12", "is not a number"]);
}

#[test]
fn the_place_is_right_with_line_ends_of_two_bytes_blank_lines_and_quotes() {
    let csv = CSV.replace('\n', "\r\n").replace("3.2", "abc");
    refuses_csv(&csv, &["u050.csv:3:12", "line 3,", "`abc`"]);
    let csv = CSV.replace('\n', "\n\n").replace("3.2", "abc");
    refuses_csv(&csv, &["u050.csv:5:12", "line 5,", "`abc`"]);
    let csv = CSV.replace("0.001", "\"0.001\"").replace("3.2", "\"a,b\"");
    refuses_csv(&csv, &["u050.csv:3:14", "`a,b`"]);
}

#[test]
fn an_unclosed_quote_quotes_no_whole_file() {
    let rows: String = (0..1000).map(|k| format!("{k},0,0\n")).collect();
    let csv = format!("time_s,command,thrust_n\n-1,0,\"{rows}");
    refuses_csv(&csv, &["u050.csv:2:6", "…` is not a number"]);
}

#[test]
fn an_empty_cell_is_shown() {
    refuses_csv(&CSV.replace("0.55", ""), &["u050.csv:3:7", "column `command`", "empty", "fill"]);
    refuses_csv(&CSV.replace("3.3", ""), &["u050.csv:4:12", "`thrust_n`", "empty", "fill"]);
}

#[test]
fn what_is_not_finite_is_shown() {
    for cell in ["NaN", "inf", "-inf", "1e999"] {
        let parts = ["u050.csv:3:12", "not a finite number", "remove the row"];
        refuses_csv(&CSV.replace("3.2", cell), &parts);
    }
    let parts = ["u050.csv:2:1", "column `time_s`", "not a finite number"];
    refuses_csv(&CSV.replace("0.000", "nan"), &parts);
}

#[test]
fn time_moves_forward() {
    let parts = ["u050.csv:4:1", "column `time_s`", "runs backwards", "sort the rows"];
    refuses_csv(&CSV.replace("0.002", "0.0005"), &parts);
    let parts = ["u050.csv:4:1", "column `time_s`", "stands still", "repeated row"];
    refuses_csv(&CSV.replace("0.002", "0.001"), &parts);
}

#[test]
fn commands_are_duties() {
    for cell in ["55", "-0.1", "1.0001"] {
        let parts = ["u050.csv:3:7", "column `command`", "outside 0 to 1", "percentage by 100"];
        refuses_csv(&CSV.replace("0.55", cell), &parts);
    }
    let csv = CSV.replace("thrust_n", "thrust_n,esc_command").replace("3.1\n", "3.1,2\n");
    refuses_csv(&csv, &["u050.csv:2:16", "column `esc_command`", "outside 0 to 1"]);
}

#[test]
fn rows_of_another_length_are_shown() {
    let parts = ["u050.csv:3:1", "line 3: 4 cells", "header has 3", "one cell per column"];
    refuses_csv(&CSV.replace("3.2", "3.2,"), &parts);
    refuses_csv(&CSV.replace(",3.2", ""), &["u050.csv:3:1", "line 3: 2 cells", "header has 3"]);
}

#[test]
fn one_row_is_too_few_and_two_are_enough() {
    let rows = |count: usize| CSV.split_inclusive('\n').take(1 + count).collect::<String>();
    refuses_csv(&rows(0), &["u050.csv:1:1", "too few rows of numbers: 0", "record longer"]);
    refuses_csv(&rows(1), &["u050.csv:2:1", "too few rows of numbers: 1", "record longer"]);
    assert_eq!(read(MANIFEST, &rows(2)).unwrap().records[0].time_s.len(), 2);
}

#[test]
fn an_empty_or_binary_file_is_refused() {
    refuses_csv("", &["u050.csv", "is empty", "right file"]);
    refuses_csv("\0\0\n\0", &["u050.csv:1:1", "is not known"]);
}

#[test]
fn rows_that_contradict_the_stated_rate_are_shown() {
    let stated = |rate: f64| edited("[[record]]", &format!("sample_rate_hz = {rate}\n[[record]]"));
    assert!(read(&stated(1000.0), CSV).is_ok());
    let error = read(&stated(500.0), CSV).unwrap_err();
    let parts = ["experiment.toml:5:18", "`u050.csv` come at 1000 Hz, not at 500", "write `sample_rate_hz = 1000`"];
    assert_report(error, &parts);
    let long: String = (0..100).map(|k| format!("{},0,0\n", (k + usize::from(k >= 60)) as f64 / 1000.0)).collect();
    let gap = format!("time_s,command,thrust_n\n{long}");
    let error = read(&stated(1000.0), &gap).unwrap_err();
    let parts = ["u050.csv:62:1", "row 61: 0.002 s after", "cut the record", "without `sample_rate_hz`"];
    assert_report(error, &parts);
    assert!(read(MANIFEST, &gap).is_ok(), "uneven rows are no error where no rate is stated");
}

#[test]
fn a_small_error_of_the_stated_rate_is_found_over_a_long_record() {
    let rows: String = (0..10_000).map(|k| format!("{:.4},0,0\n", k as f64 * 0.007)).collect();
    let csv = format!("time_s,command,thrust_n\n{rows}");
    let stated = |rate: &str| edited("[[record]]", &format!("sample_rate_hz = {rate}\n[[record]]"));
    let error = read(&stated("142.86"), &csv).unwrap_err();
    assert_report(error, &["experiment.toml:5:18", "142.857143 Hz, not at 142.86"]);
    assert!(read(&stated("142.857142857"), &csv).is_ok());
}
