//! The statistical claims at full count, and what else takes too long for each run of the tests.

use crate::firmware;
use crate::run::{Result, cargo, run};

/// Package, its target, and what the names of its tests contain: tests that are not run by default since they take from a minute to
/// an hour, and that decide by counting what the documentation claims, or end commands at many times.
const CLAIMS: [(&str, &[&str], &str); 8] = [
    ("host-tests", &["--test", "cli"], "a_signal_at_any_time_of_any_command"),
    ("rotorlead-identify", &["--test", "known_truth"], "full_count"),
    ("rotorlead-identify", &["--test", "known_truth"], "order_8_is_chosen"),
    ("rotorlead-identify", &["--test", "known_truth"], "frequency_response::"),
    ("host-tests", &["--test", "host"], "blind_inverse::"),
    ("rotorlead-identify", &["--test", "known_truth"], "alignment::"),
    ("rotorlead-identify", &["--test", "known_truth"], "static_map::"),
    ("rotorlead-identify", &["--lib"], "frequency_response::"),
];

/// Prints the acceptance table of the conditioned inverse.
pub fn inverse() -> Result {
    let test = ["test", "--release", "--locked", "--package", "host-tests", "--test", "controller"];
    run(cargo(&test).args(["--", "the_acceptance_table", "--nocapture"]))
}

/// Runs all of them in release with what they print, the rest too where one fails.
pub fn all() -> Result {
    let mut failed = Vec::new();
    for (package, target, name) in CLAIMS {
        let mut test = cargo(&["test", "--release", "--locked", "--package", package]);
        test.args(target).args(["--", "--ignored", "--nocapture", "--test-threads", "1"]);
        if !name.is_empty() {
            test.arg(name);
        }
        failed.extend(run(&mut test).err().map(|error| format!("{package} {} {name}: {error}", target.join(" "))));
    }
    failed.extend(firmware::every_level().err().map(|error| format!("every level in the emulator: {error}")));
    if failed.is_empty() { Ok(()) } else { Err(failed.join("\n")) }
}
