//! TOML files with a `format` number, read strictly.

use std::fs;
use std::ops::Range;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::did_you_mean::{alike, did_you_mean};
use super::fault::Step;
use super::{Fault, FileError, KeyPath, TextFile, write_file};

/// The layout that this version reads and writes.
const FORMAT: u32 = 1;

/// Bytes of the longest TOML file: a description of ten thousand records is shorter.
const LONGEST_TOML: usize = 4_000_000;

/// Lines among which one at least of a TOML file says something.
const HEAD: usize = 100;

/// The text of a TOML file, kept to show faults in.
#[derive(Clone, Debug)]
pub struct TomlFile {
    text: TextFile,
}

impl TomlFile {
    /// Reads a file with `format = 1` into `T`. What `T` accepts, it decides: types in this
    /// crate refuse unknown keys.
    ///
    /// # Errors
    /// Those of [`TextFile::read`]; text that is not TOML; another format; a key that is unknown,
    /// missing, double, or holds a value of the wrong kind.
    pub fn read<T: DeserializeOwned>(path: &Path) -> Result<(T, Self), FileError> {
        let text = TextFile::read(path).map_err(|error| match error {
            FileError::Located(_) => Self::log::<T>(path).unwrap_or(error),
            error => error,
        })?;
        Self::parse(text)
    }

    /// As [`Self::read`], of a text that is here already.
    ///
    /// # Errors
    /// As [`Self::read`], but for those of [`TextFile::read`].
    pub fn parse<T: DeserializeOwned>(text: TextFile) -> Result<(T, Self), FileError> {
        let file = Self { text };
        let is_of_settings = |line: &str| DeTable::parse(line).is_ok_and(|table| !table.get_ref().is_empty());
        if !file.text.text().lines().take(HEAD).any(is_of_settings)
            && let Some(error) = Self::log::<T>(file.text.path())
        {
            return Err(error);
        }
        if file.text.text().len() > LONGEST_TOML {
            return Err(FileError::TooLong { path: file.text.path().to_owned(), most: LONGEST_TOML as u64 });
        }
        file.check_format()?;
        file.check_lines()?;
        let value = toml::from_str(file.text.text()).map_err(|error| file.refused(&error))?;
        Ok((value, file))
    }

    /// What the file is, as people call it; `None` for what this program has nothing to do with.
    #[must_use]
    pub fn kind(path: &Path) -> Option<&'static str> {
        if fs::metadata(path).ok()?.len() > LONGEST_TOML as u64 {
            return None;
        }
        let text = TextFile::read(path).ok()?;
        let root = DeTable::parse(text.text()).ok()?;
        FileKind::from_keys(|key| root.get_ref().contains_key(key)).map(|kind| kind.name)
    }

    /// Whether a file is called as one of settings, such as a model or the description of an experiment.
    #[must_use]
    pub fn is_called_so(path: &Path) -> bool {
        !path.is_dir() && path.extension().is_some_and(|end| end == "toml")
    }

    /// The error for a log given where a TOML file is expected. `None` if the path is no file, the file is called `*.toml`, or `T` is no
    /// known file kind.
    fn log<T: DeserializeOwned>(path: &Path) -> Option<FileError> {
        if !path.is_file() || Self::is_called_so(path) {
            return None;
        }
        // A key that no kind has is refused with those that there are.
        let refused = toml::from_str::<T>("\"\" = 0").err()?;
        let needed = FileKind::from_keys(|key| names(refused.message()).contains(&key))?;
        Some(FileError::Log { path: path.to_owned(), needed: needed.name, remedy: needed.source })
    }

    /// The fault, shown in the text where its place is, or where the nearest place above it is.
    #[must_use]
    pub fn show(&self, fault: &Fault) -> FileError {
        let span = self.span(&fault.place);
        let message = fault.to_string();
        self.text.complaint(span, message, "here", &*fault.help)
    }

    /// Another layout has other keys: it is named as such, before they are called unknown.
    fn check_format(&self) -> Result<(), FileError> {
        let Ok(table) = DeTable::parse(self.text.text()) else {
            return Ok(()); // Read as `T`, the text gives the same error with its place.
        };
        match table.get_ref().get("format").map(|value| value.get_ref()) {
            Some(DeValue::Integer(format)) if format.as_str() != FORMAT.to_string() => {
                let fault = KeyPath::root().key("format").fault(
                    format!("layout {format} is not known to this version"),
                    format!("this version reads layout {FORMAT}; use the version that wrote the file"),
                );
                Err(self.show(&fault))
            }
            _ => Ok(()),
        }
    }

    /// Texts of these files are names, which stand within lines of what is said.
    fn check_lines(&self) -> Result<(), FileError> {
        fn broken(value: &Spanned<DeValue<'_>>) -> Option<Range<usize>> {
            match value.get_ref() {
                DeValue::String(text) => text.contains(['\n', '\r']).then(|| value.span()),
                DeValue::Array(items) => items.iter().find_map(broken),
                DeValue::Table(table) => table.values().find_map(broken),
                _ => None,
            }
        }
        let Ok(root) = DeTable::parse(self.text.text()) else { return Ok(()) };
        let span = root.get_ref().values().find_map(broken);
        let help = "write it in one line; a file that is called so has to be renamed";
        span.map_or(Ok(()), |span| Err(self.text.complaint(span, "a text with a line break", "here", help)))
    }

    fn refused(&self, error: &toml::de::Error) -> FileError {
        let span = error.span().unwrap_or(0..0);
        let message = error.message();
        let root = || DeTable::parse(self.text.text()).ok().map(|root| DeValue::Table(root.into_inner()));
        let place = || root().and_then(|root| find_place(&root, &span, KeyPath::root())).unwrap_or_default();
        if let Some(kinds) = WrongKind::from_message(message) {
            let place = place();
            let fault = place.fault(format!("{} where {} is needed", kinds.found, kinds.needed), kinds.remedy);
            return self.text.complaint(span, fault.to_string(), "here", fault.help);
        }
        if let Some((found, needed)) = self.other_kind(message) {
            let message = format!("this is {}, and {} is needed", found.name, needed.name);
            return self.text.complaint(span, message, "here", format!("give another file: {}", needed.source));
        }
        // An unknown key is shown itself, of a missing one the table that lacks it.
        let fault = if message.starts_with("missing field") { place() } else { KeyPath::root() };
        let fault = fault.fault(message, remedy(message));
        self.text.complaint(span.clone(), fault.to_string(), "here", fault.help)
    }

    /// What the file is and what is needed, where its keys and those that are expected say that these are two things.
    fn other_kind(&self, message: &str) -> Option<(&'static FileKind, &'static FileKind)> {
        let own = if message.starts_with("unknown field") {
            1
        } else if message.starts_with("missing field") {
            0
        } else {
            return None;
        };
        let names = names(message);
        let (wrong, expected) = names.split_at_checked(own)?;
        // A slip of the pen makes no other file of it.
        if wrong.iter().any(|wrong| alike(wrong, expected.iter().copied()).is_some()) {
            return None;
        }
        let root = DeTable::parse(self.text.text()).ok()?;
        let found = FileKind::from_keys(|key| root.get_ref().contains_key(key))?;
        let needed = FileKind::from_keys(|key| expected.contains(&key))?;
        (found.name != needed.name).then_some((found, needed))
    }

    fn span(&self, place: &KeyPath) -> Range<usize> {
        let mut span = 0..0;
        let Ok(root) = DeTable::parse(self.text.text()) else {
            return span;
        };
        let root = DeValue::Table(root.into_inner());
        let mut value = &root;
        for step in &place.0 {
            let next = match step {
                Step::Key(key) => value.get(key.as_str()),
                Step::Item(index) => value.get(*index),
            };
            let Some(next) = next else { break };
            span = next.span();
            value = next.get_ref();
        }
        span
    }
}

/// The names in a message of the TOML reader.
fn names(message: &str) -> Vec<&str> {
    message.split('`').skip(1).step_by(2).collect()
}

/// A kind of file that people have to do with.
struct FileKind {
    /// Keys of which it has one at least.
    keys: &'static [&'static str],
    name: &'static str,
    /// Where such a file comes from.
    source: &'static str,
}

impl FileKind {
    /// In the order of the file: keys count where those before are not there.
    const ALL: &'static [Self] = &[
        Self {
            keys: &["zero_rad_s", "natural_rad_s"],
            name: "a compensator",
            source: "`rotorlead design` writes a compensator",
        },
        Self { keys: &["point"], name: "a model", source: "`rotorlead identify` writes a model" },
        Self { keys: &["pole"], name: "a stand", source: "`rotorlead identify --stand` writes a stand" },
        Self { keys: &["roll"], name: "an airframe", source: "`docs/vehicle.md` has one to begin with" },
        Self {
            keys: &["output", "command"],
            name: "the description of an experiment",
            source: "it lies in the folder of the records",
        },
        Self { keys: &["record"], name: "a plan", source: "`rotorlead new` writes a plan to begin with" },
    ];

    fn from_keys(has: impl Fn(&str) -> bool) -> Option<&'static Self> {
        Self::ALL.iter().find(|kind| kind.keys.iter().any(|key| has(key)))
    }
}

/// The way to the value that stands at `span`.
fn find_place(value: &DeValue<'_>, span: &Range<usize>, place: KeyPath) -> Option<KeyPath> {
    let within = |found: Range<usize>, value: &DeValue<'_>, place: KeyPath| {
        // A table in a list stands where the list does, if it is the first.
        find_place(value, span, place.clone()).or_else(|| (found == *span).then_some(place))
    };
    match value {
        DeValue::Table(table) => {
            table.iter().find_map(|(key, value)| within(value.span(), value.get_ref(), place.key(key.get_ref())))
        }
        DeValue::Array(items) => {
            let mut items = items.iter().enumerate();
            items.find_map(|(index, value)| within(value.span(), value.get_ref(), place.item(index)))
        }
        _ => None,
    }
}

/// A value of another kind than its key takes, in words.
struct WrongKind {
    /// What stands there.
    found: String,
    /// What the key takes.
    needed: &'static str,
    remedy: &'static str,
}

impl WrongKind {
    /// From what the TOML reader says: `invalid type: string "0.4", expected f64`. `None` for anything else.
    fn from_message(message: &str) -> Option<Self> {
        let (is_type, rest) = match message.strip_prefix("invalid type: ") {
            Some(rest) => (true, rest),
            None => (false, message.strip_prefix("invalid value: ")?),
        };
        let (found, expected) = rest.rsplit_once(", expected ")?;
        let (needed, remedy) = match expected {
            "f64" | "f32" => ("a number", "write a number with a decimal point, without quotes and without its unit"),
            "u8" | "u16" | "u32" | "u64" | "usize" => {
                ("a whole number of 0 or more", "write a whole number, without quotes and without a decimal point")
            }
            "i8" | "i16" | "i32" | "i64" => {
                ("a whole number", "write a whole number, without quotes and without a decimal point")
            }
            "a boolean" => ("true or false", "write true or false, without quotes"),
            "a string" => ("a text", "write a text in quotes"),
            "a sequence" => ("a list", "write a list in brackets, such as [0.4, 0.5]; of tables, [[name]] before each"),
            "a map" => ("a table", "write a table: a line [name], and a line for each of its keys"),
            _ if expected.starts_with("struct ") => {
                ("a table", "write a table: a line [name], and a line for each of its keys")
            }
            _ if expected.starts_with("an array of") || expected.starts_with("a tuple") => {
                ("a list of another length", "write as many numbers in brackets as the page of this file says")
            }
            _ => return None,
        };
        let kind = found.split([' ', '`']).next().unwrap_or_default();
        let found = match kind {
            // A number of the right kind, and out of what the key can hold.
            "integer" if !is_type => found.trim_start_matches("integer ").replace('`', ""),
            "integer" => "a whole number".to_owned(),
            "floating" => "a number with decimals".to_owned(),
            "boolean" => "true or false".to_owned(),
            "string" => "a text in quotes".to_owned(),
            "sequence" => "a list".to_owned(),
            "map" => "a table".to_owned(),
            _ => found.to_owned(),
        };
        Some(Self { found, needed, remedy })
    }
}

/// Writes `value` as TOML to `path`, complete or not at all.
///
/// # Errors
/// Those of [`write_file`].
///
/// # Panics
/// Never for the types of this crate: TOML can hold every one of them.
pub fn write_toml<T: Serialize>(path: &Path, value: &T) -> Result<(), FileError> {
    write_file(path, to_toml(value).as_bytes())
}

/// The text of `value` in TOML.
pub fn to_toml<T: Serialize>(value: &T) -> String {
    toml::to_string(value).expect("plain structs of numbers, texts and lists of them are TOML")
}

/// What to do about a message of the TOML reader.
fn remedy(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    let name = names.next().unwrap_or_default();
    if message.starts_with("unknown field") || message.starts_with("unknown variant") {
        did_you_mean(name, names).unwrap_or_else(|| {
            if message.starts_with("unknown variant") {
                format!("write what is expected instead of `{name}`")
            } else {
                format!("remove `{name}`, or use a key of those expected")
            }
        })
    } else if message.starts_with("missing field") {
        format!("add `{name}`")
    } else if message.starts_with("duplicate key") {
        "keep one of them".to_owned()
    } else if message.starts_with("invalid type") || message.starts_with("invalid value") {
        "give a value of the kind expected: numbers without quotes, texts in quotes".to_owned()
    } else {
        "correct the text: TOML is `key = value`, texts in quotes, tables as [name] or [[name]]".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Example {
        format: u32,
        #[serde(rename = "point")]
        points: Vec<Item>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Item {
        nominal: f64,
        axes: Option<Vec<f64>>,
    }

    const GOOD: &str = "format = 1\n[[point]]\nnominal = 0.4\n[[point]]\nnominal = 2\naxes = [1, 2]\n";

    fn report(text: &str, parts: &[&str]) {
        let scratch = Scratch::new();
        let path = scratch.file("example.toml", text);
        assert_report(TomlFile::read::<Example>(&path).unwrap_err(), parts);
    }

    #[test]
    fn a_wrong_key_is_shown_with_the_right_one() {
        let text = "format = 1\n[[point]]\nnominl = 0.4\n";
        report(text, &["example.toml:3:1", "unknown field `nominl`", "did you mean `nominal`"]);
    }

    #[test]
    fn an_unknown_key_is_shown_with_those_expected() {
        let text = "format = 1\ncolour = 3\npoint = []\n";
        report(text, &["example.toml:2:1", "`colour`", "`format` or `point`", "remove `colour`"]);
    }

    #[test]
    fn a_missing_key_is_shown_at_its_table() {
        let text = "format = 1\n[[point]]\nnominal = 1\n[[point]]\n";
        report(text, &["example.toml:4:1", "missing field `nominal`", "add `nominal`"]);
    }

    #[test]
    fn a_double_key_is_shown() {
        report("format = 1\nformat = 1\n", &["example.toml:2:1", "duplicate key", "keep one"]);
    }

    #[test]
    fn a_value_of_the_wrong_kind_is_shown() {
        let text = "format = 1\n[[point]]\nnominal = \"0.4\"\n";
        report(
            text,
            &["example.toml:3:11", "`point` 1, `nominal`: a text in quotes where a number is needed", "without quotes"],
        );
        let text = "format = 1\n[[point]]\nnominal = 1\naxes = [1, true]\n";
        report(text, &["example.toml:4:12", "`point` 1, `axes` 2: true or false where a number is needed"]);
        let text = "format = 1\npoint = 3\n";
        report(text, &["example.toml:2:9", "`point`: a whole number where a list is needed", "[[name]]"]);
        let text = "format = -1\npoint = []\n";
        report(text, &["example.toml:1:10", "`format`"]);
    }

    #[test]
    fn text_that_is_not_toml_is_shown() {
        report("format = 1\n[[point\n", &["example.toml:2:8", "TOML is `key = value`"]);
    }

    #[test]
    fn another_format_is_named_before_its_keys() {
        let text = "new_key = 1\nformat = 2\n";
        report(text, &["example.toml:2:10", "layout 2", "reads layout 1"]);
        report("point = []\n", &["example.toml:1:1", "add `format`"]);
    }

    #[test]
    fn a_fault_is_shown_at_the_deepest_place_that_the_text_has() {
        let scratch = Scratch::new();
        let path = scratch.file("example.toml", GOOD);
        let (_, file) = TomlFile::read::<Example>(&path).unwrap();
        let second = KeyPath::root().key("point").item(1);
        let shown = |place: KeyPath| file.show(&place.fault("is wrong", "right it"));
        let nominal = second.key("nominal");
        assert_report(shown(nominal), &["example.toml:5:11", "`point` 2, `nominal`: is wrong", "right it"]);
        assert_report(shown(second.key("axes").item(1)), &["example.toml:6:12", "`axes` 2"]);
        assert_report(shown(second.key("absent")), &["example.toml:4:1"]);
        assert_report(shown(KeyPath::root()), &["example.toml:1:1"]);
    }
}
