//! Two sets of JSON answers, side by side.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Map, Value};

use super::Answers;

/// How far a number may move.
#[derive(Clone, Copy)]
pub struct Tolerance {
    /// Of the larger of both.
    relative: f64,
    /// Of the number's standard deviation, where the answer has one.
    of_std: f64,
    /// Whatever the number is.
    absolute: f64,
}

impl Tolerance {
    /// For a change that touches no calculation.
    pub const EQUAL: Self = Self { relative: 1e-9, of_std: 0.0, absolute: 0.0 };
    /// For another solver of the same problem, which stops elsewhere in the same valley.
    pub const ESTIMATES: Self = Self { relative: 1e-4, of_std: 0.05, absolute: 0.0 };
    /// For the same code on another processor: what is zero but for rounding has other digits there.
    pub const ELSEWHERE: Self = Self { absolute: 1e-9, ..Self::ESTIMATES };

    fn allows(self, before: f64, after: f64, std: f64) -> bool {
        let apart = (before - after).abs();
        apart <= (self.relative * before.abs().max(after.abs())).max(self.of_std * std).max(self.absolute)
    }
}

/// Keys and names that were renamed since the freeze.
///
/// A line of its file is `OLD NEW`; `OLD -` is a key that is gone and `- NEW` one that came. `#` begins a comment.
#[derive(Default)]
pub struct Renamed {
    new_names: BTreeMap<String, String>,
    gone: Vec<String>,
    came: Vec<String>,
}

impl Renamed {
    /// Reads the table.
    ///
    /// # Errors
    /// When the file cannot be read or a line has not two words.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        Self::parse(&text).map_err(|line| format!("{}: `{line}` is not OLD NEW", path.display()))
    }

    fn parse(text: &str) -> Result<Self, &str> {
        let mut renamed = Self::default();
        for line in text.lines() {
            let words: Vec<&str> = line.split('#').next().unwrap_or_default().split_whitespace().collect();
            match words.as_slice() {
                [] => {}
                ["-", new] => renamed.came.push((*new).to_owned()),
                [old, "-"] => renamed.gone.push((*old).to_owned()),
                [old, new] => drop(renamed.new_names.insert((*old).to_owned(), (*new).to_owned())),
                _ => return Err(line),
            }
        }
        Ok(renamed)
    }

    fn now<'a>(&'a self, old: &'a str) -> &'a str {
        self.new_names.get(old).map_or(old, String::as_str)
    }
}

/// What differs between frozen answers and those of today.
pub struct Comparison {
    /// Numbers and names that were compared.
    pub values: usize,
    /// Where and how they differ.
    pub differences: Vec<String>,
    /// Largest difference of two numbers, relative to the larger.
    pub largest: f64,
}

impl Comparison {
    /// Compares the answers file by file.
    pub fn compare(before: &Answers, after: &Answers, renamed: &Renamed, tolerance: Tolerance) -> Self {
        let object = |answers: &Answers| Value::Object(answers.clone().into_iter().collect::<Map<_, _>>());
        let mut walk = Walk { renamed, tolerance, found: Self { values: 0, differences: Vec::new(), largest: 0.0 } };
        walk.compare("", &object(before), &object(after), 0.0);
        walk.found
    }
}

struct Walk<'a> {
    renamed: &'a Renamed,
    tolerance: Tolerance,
    found: Comparison,
}

impl Walk<'_> {
    fn compare(&mut self, path: &str, before: &Value, after: &Value, std: f64) {
        match (before, after) {
            (Value::Object(before), Value::Object(after)) => self.objects(path, before, after),
            (Value::Array(before), Value::Array(after)) if before.len() == after.len() => {
                for (index, (before, after)) in before.iter().zip(after).enumerate() {
                    self.compare(&format!("{path}[{index}]"), before, after, 0.0);
                }
            }
            (Value::Number(before), Value::Number(after)) => {
                let (before, after) = (before.as_f64().unwrap_or(f64::NAN), after.as_f64().unwrap_or(f64::NAN));
                self.found.values += 1;
                if before != after {
                    let relative = (before - after).abs() / before.abs().max(after.abs());
                    self.found.largest = self.found.largest.max(relative);
                }
                if !self.tolerance.allows(before, after, std) {
                    self.found.differences.push(format!("{path}: {before} is now {after}"));
                }
            }
            // Sentences are for people, and may be worded anew; names are not.
            (Value::String(before), Value::String(after)) if before.contains(' ') && after.contains(' ') => {}
            (Value::String(before), Value::String(after)) => {
                self.found.values += 1;
                if self.renamed.now(before) != after {
                    self.found.differences.push(format!("{path}: `{before}` is now `{after}`"));
                }
            }
            (before, after) => {
                self.found.values += 1;
                if before != after {
                    self.found.differences.push(format!("{path}: {} is now {}", short(before), short(after)));
                }
            }
        }
    }

    fn objects(&mut self, path: &str, before: &Map<String, Value>, after: &Map<String, Value>) {
        let renamed = self.renamed;
        for (key, value) in before.iter().filter(|(key, _)| !renamed.gone.contains(key)) {
            let now = renamed.now(key);
            let path = format!("{path}/{now}");
            // `tau` beside `tau_std`, or `value` beside `std`.
            let std = before.get(&format!("{key}_std")).or_else(|| before.get("std").filter(|_| key == "value"));
            match after.get(now) {
                Some(other) => self.compare(&path, value, other, std.and_then(Value::as_f64).unwrap_or(0.0)),
                None => self.found.differences.push(format!("{path}: {} is gone", short(value))),
            }
        }
        let known: Vec<&str> = before.keys().map(|key| renamed.now(key)).collect();
        for (key, value) in
            after.iter().filter(|(key, _)| !known.contains(&key.as_str()) && !renamed.came.contains(key))
        {
            self.found.differences.push(format!("{path}/{key}: {} was not there", short(value)));
        }
    }
}

/// What fits on a line of it.
fn short(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn differences(before: Value, after: Value, renamed: &str, tolerance: Tolerance) -> Vec<String> {
        let answers = |value: Value| Answers::from([("a.json".to_owned(), value)]);
        Comparison::compare(&answers(before), &answers(after), &Renamed::parse(renamed).unwrap(), tolerance).differences
    }

    #[test]
    fn a_number_a_name_or_a_key_that_changes_is_a_difference() {
        let equal = |before, after| differences(before, after, "", Tolerance::EQUAL).len();
        let before = || json!({"tau": 0.1, "verdict": "agrees", "list": [1, null]});
        assert_eq!(equal(before(), before()), 0);
        assert_eq!(equal(before(), json!({"tau": 0.1 * (1.0 + 2e-9), "verdict": "agrees", "list": [1, null]})), 1);
        assert_eq!(equal(before(), json!({"tau": 0.1, "verdict": "named", "list": [1, null]})), 1);
        assert_eq!(equal(before(), json!({"tau": 0.1, "verdict": "agrees", "list": [1, 0]})), 1);
        assert_eq!(equal(before(), json!({"tau": 0.1, "verdict": "agrees", "list": [1]})), 1);
        assert_eq!(equal(before(), json!({"tau": 0.1, "list": [1, null]})), 1);
        assert_eq!(equal(json!({"tau": 0.1}), json!({"tau": 0.1, "more": 1})), 1);
    }

    #[test]
    fn sentences_may_be_worded_anew_and_renamed_keys_are_followed() {
        let (before, after) =
            (json!({"told": 1.0, "next": "Do this."}), json!({"applied": 1.0, "next": "Do that, please."}));
        assert_eq!(differences(before.clone(), after.clone(), "told applied", Tolerance::EQUAL), [""; 0]);
        assert_eq!(differences(before.clone(), after.clone(), "", Tolerance::EQUAL).len(), 2);
        assert_eq!(differences(before, after, "told -\n- applied # new", Tolerance::EQUAL), [""; 0]);
        assert!(Renamed::parse("one two three").is_err());
    }

    #[test]
    fn an_estimate_may_move_by_a_part_of_its_standard_deviation() {
        let point = |tau: f64| json!({"tau": tau, "tau_std": 0.1, "effect": {"value": tau, "std": 0.1}, "fit": 90.0});
        let apart = |tau, tolerance| differences(point(1.0), point(tau), "", tolerance).len();
        assert_eq!((apart(1.004, Tolerance::ESTIMATES), apart(1.004, Tolerance::EQUAL)), (0, 2));
        assert_eq!(apart(1.006, Tolerance::ESTIMATES), 2);
        let zeros_apart =
            |tolerance| differences(json!({"delay_s": 3e-10}), json!({"delay_s": -3e-10}), "", tolerance).len();
        assert_eq!((zeros_apart(Tolerance::ELSEWHERE), zeros_apart(Tolerance::ESTIMATES)), (0, 1));
    }
}
