//! The pages under `docs` say what the code does.

use std::path::Path;

use rotorlead::dshot::LONGEST_TURN_US;
use rotorlead::link::{FRAME_BYTES, Message, RECORD_SAMPLES, Record, Series, encode};
use rotorlead::settings::{Key, Origin, Settings, Store};
use rotorlead_device::{entries, set};

/// A file of the repository.
fn file(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of the table whose head begins with `head`, cells without blanks around them.
fn table(text: &str, head: &str) -> Vec<Vec<String>> {
    let lines: Vec<&str> = text.lines().skip_while(|line| !line.starts_with(head)).skip(2).collect();
    let rows = lines.into_iter().take_while(|line| line.starts_with('|'));
    let cells = |row: &str| row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    let rows: Vec<Vec<String>> = rows.map(cells).collect();
    assert!(!rows.is_empty(), "no table begins with {head}");
    rows
}

/// The name in a cell that is written as code.
fn code(cell: &str) -> &str {
    cell.strip_prefix('`').and_then(|cell| cell.strip_suffix('`')).unwrap_or_else(|| panic!("{cell} is not code"))
}

/// `40 to 4000`, and perhaps more after a comma.
fn range(cell: &str) -> Option<(f64, f64)> {
    let (low, high) = cell.split(',').next()?.split_once(" to ")?;
    Some((low.parse().ok()?, high.parse().ok()?))
}

/// Settings with which any frame rate may be used.
fn with_any_frame() -> Settings {
    let mut settings = Settings::default();
    for key in ["input.protocol", "output.protocol"] {
        set(&mut settings, key, "oneshot125").unwrap();
    }
    settings
}

#[test]
fn the_settings_have_the_names_and_defaults_of_the_code() {
    let rows = table(&file("docs/firmware.md"), "| key ");
    let name = |key: &Key| if key.is_of_a_motor() { format!("motor.N.{}", key.name()) } else { key.name().to_owned() };
    let listed: Vec<&str> = rows.iter().map(|row| code(&row[0])).collect();
    assert_eq!(listed, Key::ALL.iter().map(name).collect::<Vec<_>>());

    let defaults = entries(&Settings::default());
    for row in &rows {
        let name = code(&row[0]).replace('N', "0");
        let (_, value) = defaults.iter().find(|(key, _)| *key == name).unwrap();
        match (row[2].parse::<f64>(), value.parse::<f64>()) {
            (Ok(written), Ok(value)) => {
                // Frequencies and damping are rounded to the digits that are written, levels to a step of 2^-29.
                let digits = row[2].split_once('.').map_or(0, |(_, digits)| digits.len() as i32);
                let own_name = name.strip_prefix("inverse.").unwrap_or(&name);
                let is_rounded = ["omega_z_rad_s", "omega_f_rad_s", "natural_rad_s", "damping"].contains(&own_name);
                let tolerance = if is_rounded { 0.5 * 10_f64.powi(-digits) } else { 2e-9 };
                assert!((written - value).abs() <= tolerance, "{name}: {written} is written, {value} is used");
            }
            _ => assert_eq!(row[2], *value, "{name}"),
        }
    }
}

#[test]
fn every_proof_that_the_page_of_the_rp2040_names_is_a_test() {
    let main = file("host-tests/tests/rp2040/main.rs");
    let modules = main.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
    let sources: Vec<String> = modules.map(|name| file(&format!("host-tests/tests/rp2040/{name}.rs"))).collect();
    let tests: Vec<&str> = sources
        .iter()
        .flat_map(|source| source.split("#[test]").skip(1))
        .filter_map(|test| test.split_once("fn ")?.1.split('(').next())
        .collect();
    let rows = table(&file("docs/board-rp2040.md"), "| scenario ");
    let named: Vec<&str> = rows.iter().map(|row| code(&row[1])).collect();
    for test in &named {
        assert!(tests.contains(test), "{test} is no test");
    }
    for test in &tests {
        assert!(named.contains(test), "the page does not name {test}");
    }
}

#[test]
fn the_settings_are_accepted_in_the_ranges_that_are_written_and_not_beyond() {
    let mut checked = 0;
    for row in table(&file("docs/firmware.md"), "| key ") {
        let name = code(&row[0]).replace('N', "3");
        let accepts = |value: f64| {
            let mut settings = with_any_frame();
            set(&mut settings, &name, &value.to_string()).is_ok() && settings.validate().is_ok()
        };
        let Some((low, high)) = range(&row[1]) else { continue };
        checked += 1;
        let is_whole = !["damping", "excitation.max_command"].contains(&name.as_str());
        let beyond = if is_whole { 1.0 } else { 1e-6 };
        assert!(accepts(low) && accepts(high), "{name} is refused at an end of {}", row[1]);
        assert!(!accepts(low - beyond) && !accepts(high + beyond), "{name} is accepted beyond {}", row[1]);
    }
    assert_eq!(checked, 11, "ranges in numbers");
}

#[test]
fn the_diagram_of_states_is_that_of_the_channel() {
    let source = file("src/channel/mod.rs");
    let diagram: Vec<&str> = source
        .lines()
        .skip_while(|line| *line != "//! ```text")
        .skip(1)
        .take_while(|line| *line != "//! ```")
        .map(|line| line.trim_start_matches("//!").strip_prefix(' ').unwrap_or(""))
        .collect();
    assert!(diagram.len() > 8, "the diagram was not found");
    assert!(file("docs/firmware.md").contains(&diagram.join("\n")), "docs/firmware.md has another diagram");
}

#[test]
fn the_worst_record_of_a_twelve_bit_converter_is_as_long_as_written() {
    let column = |high: i32| {
        let samples: Vec<i32> = (1..=RECORD_SAMPLES as i32).map(|k| (k % 2) * high).collect();
        Series::try_from(&samples[..]).unwrap()
    };
    let command = column(1 << 29);
    let record = Record {
        motor: 3,
        divisor: 1,
        first_tick: u32::MAX,
        input: command.clone(),
        before: command.clone(),
        after: command,
        adc: column(4095),
        turn_us: column(i32::from(LONGEST_TURN_US)),
    };
    let length = encode(255, &Message::Record(record), &mut [0; FRAME_BYTES]).unwrap();
    let bytes_a_sample = length as f64 / RECORD_SAMPLES as f64;
    println!("{bytes_a_sample} bytes a sample");
    let rows = table(&file("docs/firmware.md"), "| | bytes a sample ");
    let written: f64 = rows[1][1].strip_prefix("under ").unwrap().parse().unwrap();
    assert_eq!(bytes_a_sample.ceil(), written);
    assert_eq!(rows[1][2], format!("{} kB/s", written * 5.0));
}

#[test]
fn where_settings_come_from_is_listed_in_full() {
    let listed: Vec<String> =
        table(&file("docs/firmware.md"), "| `settings` ").into_iter().map(|row| row[0].clone()).collect();
    let all = [
        Origin::Stored,
        Origin::StoredOnce,
        Origin::DefaultsBlank,
        Origin::DefaultsBad,
        Origin::Migrated,
        Origin::Host,
    ];
    assert_eq!(listed, all.map(|origin| format!("{origin:?}")));
    // And the first is what a controller says after a save.
    let mut store = Store::new(host_tests::flash::Flash::<2048>::blank(), host_tests::flash::Flash::<2048>::SECTORS);
    store.save(&Settings::default().validate().unwrap()).unwrap();
    assert_eq!(format!("{:?}", store.load().origin), listed[0]);
}
