//! Reading and writing `model.toml`.

use std::path::Path;

use rotorlead_records::files::{FileError, TextFile, TomlFile, to_toml, write_file};

use super::Model;

impl Model {
    /// Reads and checks a model.
    ///
    /// # Errors
    /// When the file is missing or is no model: an unknown key, a missing one, a number that
    /// [`Model::check`] refuses, or no point. The error shows the place in the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::with_a_point(TomlFile::read(path)?)
    }

    /// As [`Model::read`], of a text that is here already.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn parse(text: TextFile) -> Result<Self, FileError> {
        Self::with_a_point(TomlFile::parse(text)?)
    }

    fn with_a_point(read: (Self, TomlFile)) -> Result<Self, FileError> {
        let (model, file) = Self::checked(read)?;
        // A table of steady points tells no lag.
        if model.points.is_empty() {
            return Err(file.show(&model.no_point()));
        }
        Ok(model)
    }

    /// As [`Model::read`], also of a model that has a static map and no point.
    ///
    /// # Errors
    /// As [`Model::read`], but for that.
    pub fn read_with_map_alone(path: &Path) -> Result<Self, FileError> {
        Ok(Self::checked(TomlFile::read(path)?)?.0)
    }

    /// As [`Self::read_with_map_alone`], of a text that is here already.
    ///
    /// # Errors
    /// As [`Self::read_with_map_alone`].
    pub fn parse_with_map_alone(text: TextFile) -> Result<Self, FileError> {
        Ok(Self::checked(TomlFile::parse(text)?)?.0)
    }

    fn checked((model, file): (Self, TomlFile)) -> Result<(Self, TomlFile), FileError> {
        model.check().map_err(|fault| file.show(&fault))?;
        Ok((model, file))
    }

    /// Checks a model and writes it, complete or not at all.
    ///
    /// # Errors
    /// When [`Model::check`] refuses it, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        write_file(path, self.text(path)?.as_bytes())
    }

    /// The text of its file, which is to be at `path`.
    ///
    /// # Errors
    /// When [`Model::check`] refuses it.
    pub fn text(&self, path: &Path) -> Result<String, FileError> {
        self.check().map_err(|fault| FileError::refused(path, fault))?;
        Ok(to_toml(self))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;
    use rotorlead_records::Output;
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;
    use crate::actuator::{Actuator, EscTiming, Law};
    use crate::effect::{ActiveEffect, Catalog, Parameter};
    use crate::model::{Effect, Lagged, Point, Provenance, StaticMap};

    const MODEL: &str = r#"format = 1
[[point]]
nominal = 0.4
gain = 6.2
time_constant_s = 0.16
[[point]]
nominal = 0.5
gain = 7.1
gain_std = 0.1
time_constant_s = 0.11
time_constant_s_std = 0.001
delay_s = 0.002
time_constant_up_s = 0.1
fit_square_percent = 95
[static_map]
command = [0.0, 0.5]
response = [0, 3.5]
[[effect]]
kind = "backlash"
parameters = { half_width = 0.01 }
std = { half_width = 0.001 }
[provenance]
experiment = "stand"
records = ["u050.csv"]
records_crc32 = "cbf43926"
version = "0.1.0"
output = "thrust_n"
command_rate_hz = 5000
"#;

    fn read(text: &str) -> Result<Model, FileError> {
        let scratch = Scratch::new();
        Model::read(&scratch.file("model.toml", text))
    }

    #[track_caller]
    fn refuses(from: &str, to: &str, parts: &[&str]) {
        assert!(MODEL.contains(from));
        assert_report(read(&MODEL.replacen(from, to, 1)).unwrap_err(), parts);
    }

    #[test]
    fn a_whole_model_is_read() {
        let model = read(MODEL).unwrap();
        assert_eq!(model.points.len(), 2);
        assert_eq!(model.points[0].delay_s, 0.0);
        assert_eq!(model.points[1].gain_std, Some(0.1));
        assert_eq!(model.static_map.unwrap().response, [0.0, 3.5]);
        assert_eq!(model.effects[0].parameters["half_width"], 0.01);
        let provenance = model.provenance.unwrap();
        assert_eq!(provenance.output, Output::ThrustN);
        assert_eq!(provenance.records_crc32.as_deref(), Some("cbf43926"));
    }

    #[test]
    fn an_effect_may_have_a_shape_and_is_the_catalogs_without() {
        let passed = |text: &str| {
            let model = read(text).unwrap();
            let mut actuator = Actuator::new(&model, Law::LinearAround(0.5), EscTiming::default()).unwrap();
            // Half of the play, which the command does not take up.
            let start = actuator.response();
            actuator.advance(0.505, 10.0);
            let part = (actuator.response() - start) / (7.1 * 0.005);
            (ActiveEffect::from_model(&model).unwrap()[0].value("compliance"), part)
        };
        let bent = MODEL.replacen("half_width = 0.01 ", "half_width = 0.01, compliance = 0.4 ", 1);
        let (value, part) = passed(&bent);
        assert!(value == Some(0.4) && (part - 0.4).abs() < 1e-9, "{value:?}, {part}");
        assert_eq!(passed(MODEL), (Some(0.0), 0.0));
        let error = read(&bent.replacen("= 0.4 ", "= 1.4 ", 1)).unwrap_err();
        assert_report(error, &["model.toml:20:48", "`compliance`", "1.4 is not from 0 to 1", "plausible"]);
    }

    #[test]
    fn what_the_file_says_of_the_actuator_makes_another_checksum() {
        let checksum = |text: &str| read(text).unwrap().checksum();
        let (actuator, provenance) = MODEL.split_once("[provenance]").unwrap();
        let same = [
            actuator.to_owned(),
            format!("# a motor\n{MODEL}"),
            format!("{actuator}[provenance]{}", provenance.replace("stand", "other")),
            MODEL.replace("gain = 7.1\n", "").replace("gain_std = 0.1", "gain_std = 0.1\ngain = 7.10"),
        ];
        for same in same {
            assert_eq!(checksum(&same), checksum(MODEL), "{same}");
        }
        for (from, to) in [("0.16", "0.17"), ("[0, 3.5]", "[0, 3.6]"), ("half_width = 0.01 ", "half_width = 0.02 ")] {
            assert_ne!(checksum(&MODEL.replacen(from, to, 1)), checksum(MODEL), "{to}");
        }
    }

    #[test]
    fn a_missing_or_empty_file_is_named() {
        let scratch = Scratch::new();
        let error = Model::read(&scratch.path().join("model.toml")).unwrap_err();
        assert_report(error, &["model.toml", "does not exist", "check the path"]);
        assert_report(read("").unwrap_err(), &["model.toml", "is empty"]);
    }

    #[test]
    fn a_model_without_points_says_how_to_get_them() {
        let error = read("format = 1\n").unwrap_err();
        assert_report(error, &["model.toml:1:1", "no point", "run `rotorlead identify`"]);
    }

    #[test]
    fn keys_are_those_of_the_layout() {
        let parts = ["model.toml:4:1", "`gian`", "did you mean `gain`"];
        refuses("gain = 6.2", "gian = 6.2", &parts);
        refuses("gain = 6.2\n", "", &["model.toml:2:1", "add `gain`"]);
        refuses("format = 1", "format = 3", &["model.toml:1:10", "layout 3"]);
        refuses("[static_map]", "[map]", &["model.toml:15:2", "`map`", "remove `map`"]);
        refuses("[static_map]", "[statc_map]", &["did you mean `static_map`"]);
    }

    #[test]
    fn points_increase() {
        refuses("0.4", "0.5", &["model.toml:7:11", "`point` 2, `nominal`", "duplicate value", "remove one"]);
        refuses("0.4", "0.6", &["model.toml:7:11", "0.5 comes after 0.6", "increasing order"]);
    }

    #[test]
    fn numbers_have_their_ranges() {
        for (from, to, place, rule) in [
            ("nominal = 0.4", "nominal = -0.1", "3:11", "in the range 0 to 1"),
            ("nominal = 0.4", "nominal = 40", "3:11", "in the range 0 to 1"),
            ("gain = 6.2", "gain = nan", "4:8", "a finite number"),
            ("gain = 6.2", "gain = -inf", "4:8", "a finite number"),
            ("_s = 0.16", "_s = 0", "5:19", "above 0"),
            ("_s = 0.16", "_s = -0.1", "5:19", "above 0"),
            ("_s = 0.16", "_s = inf", "5:19", "above 0"),
            ("gain_std = 0.1", "gain_std = -0.1", "9:12", "0 or more"),
            ("delay_s = 0.002", "delay_s = -0.002", "12:11", "0 or more"),
            ("up_s = 0.1", "up_s = 0.0", "13:22", "above 0"),
            ("percent = 95", "percent = nan", "14:22", "a finite number"),
            ("[0.0, 0.5]", "[0.0, 1.5]", "16:17", "in the range 0 to 1"),
            ("[0.0, 0.5]", "[0.5, 0.0]", "16:17", "comes after"),
            ("[0.0, 0.5]", "[0.5]", "16:11", "two commands"),
            ("[0, 3.5]", "[0]", "17:12", "1 responses for 2 commands"),
            ("[0, 3.5]", "[0, nan]", "17:16", "a finite number"),
            ("half_width = 0.01 ", "half_width = nan ", "20:29", "a finite number"),
            ("half_width = 0.001", "half_width = -1", "21:22", "0 or more"),
            ("half_width = 0.001", "breadth = 1", "21:19", "correct the name"),
            ("hz = 5000", "hz = 0", "28:19", "above 0"),
        ] {
            refuses(from, to, &[&format!("model.toml:{place}]"), rule, "help: "]);
        }
    }

    #[test]
    fn a_model_that_would_not_read_back_is_not_written() {
        let scratch = Scratch::new();
        let path = scratch.path().join("model.toml");
        let mut model = read(MODEL).unwrap();
        model.points[1].time_constant_s = f64::NAN;
        let error = model.write(&path).unwrap_err();
        let parts = ["model.toml", "`point` 2, `time_constant_s`", "NaN", "give a value"];
        assert_report(error, &parts);
        model.points.clear();
        let map = model.static_map.take();
        assert_report(model.write(&path).unwrap_err(), &["no point", "rotorlead identify"]);
        assert!(scratch.names().is_empty());
        // A static map alone is a result, but nothing can be designed from it.
        model.static_map = map;
        model.write(&path).unwrap();
        assert_report(Model::read(&path).unwrap_err(), &["a static map alone", "record a staircase"]);
    }

    fn any_point() -> impl Strategy<Value = Point> {
        let positive = || {
            use prop::num::f64::{NORMAL, POSITIVE, SUBNORMAL};
            POSITIVE | NORMAL | SUBNORMAL
        };
        let std = move || prop::option::of(positive());
        (
            (-1e8..1e8, std(), 1e-5..100.0, std(), 0.0..100.0, std()),
            (prop::option::of(1e-5..100.0), prop::option::of(1e-5..100.0)),
            prop::array::uniform3(prop::option::of(-1e6..100.0)),
        )
            .prop_map(|(linear, (up, down), [frequency, square, step])| Point {
                nominal: 0.0,
                gain: linear.0,
                gain_std: linear.1,
                time_constant_s: linear.2,
                time_constant_s_std: linear.3,
                delay_s: linear.4,
                delay_s_std: linear.5,
                time_constant_up_s: up,
                time_constant_down_s: down,
                fit_frequency_percent: frequency,
                fit_square_percent: square,
                fit_step_percent: step,
            })
    }

    prop_compose! {
        fn any_model()(
            mut points in prop::collection::vec(any_point(), 1..8),
            response in prop::option::of(prop::array::uniform2(-1e8..1e8)),
            kind in prop::sample::select(Catalog::standard().kinds().collect::<Vec<_>>()),
            shares in prop::collection::vec(0.0..1.0, 8),
            version in any::<String>(),
            first in 0.0..0.1,
        ) -> Model {
            for (index, point) in points.iter_mut().enumerate() {
                point.nominal = first + index as f64 * 0.1;
            }
            let parameters: BTreeMap<String, f64> = kind
                .fitted()
                .chain(kind.shape())
                .zip(shares)
                .map(|((_, Parameter { name, plausible: (low, high), .. }), share)| {
                    ((*name).to_owned(), low + share * (high - low))
                })
                .collect();
            let std = parameters.keys().take(1).map(|name| (name.clone(), 0.5)).collect();
            Model { time_constant_curve: None,
                format: 1,
                points,
                static_map: response.map(|response| StaticMap {
                    command: vec![first, 1.0],
                    response: response.to_vec(),
                    lagged: Lagged::Response,
                    polynomial: None,
                }),
                effects: vec![Effect { kind: kind.id.to_owned(), parameters, std }],
                provenance: Some(Provenance {
                    experiment: Some(version.clone()),
                    records_crc32: Some(version.clone()),
                    records: vec![version.clone()],
                    version,
                    output: Output::Rpm,
                    excitation: None,
                    command_rate_hz: None,
                    esc_frame_hz: Some(600.0), judgement: None
                }),
            }
        }
    }

    proptest! {
        #[test]
        fn a_model_comes_back_bit_for_bit(model in any_model()) {
            let scratch = Scratch::new();
            let path = scratch.path().join("model.toml");
            model.write(&path).unwrap();
            let back = Model::read(&path).unwrap();
            prop_assert_eq!(format!("{back:?}"), format!("{model:?}"));
        }
    }
}
