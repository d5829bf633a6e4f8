//! A staircase fit as a model file.

use rotorlead_plant::{Lag, Model, Point, Provenance, StaticMap};

use super::levels::map_response;
use super::{StaircaseFit, StepsError};

impl StaircaseFit {
    /// The model: a point at each level that has a rising map and lies within the curve of time constants, and the static map
    /// over all levels.
    ///
    /// A point's `time_constant_s` is the curve's, so that no single step decides a design; those of single steps in both
    /// directions stand beside it. Its delay is the record's, but not below zero. `fit_step_percent` is that of the
    /// direction with the worse fit. The static map has what lags.
    ///
    /// # Errors
    /// [`StepsError::NoUsableLevel`] when there would be no point.
    pub fn to_model(&self, version: &str) -> Result<Model, StepsError> {
        let points: Vec<Point> = self.levels.iter().filter_map(|l| self.point(l)).collect();
        if points.is_empty() {
            return Err(StepsError::NoUsableLevel { record: self.record.clone() });
        }
        let command: Vec<f64> = self.levels.iter().map(|l| l.command).collect();
        let response = command.iter().map(|&u| map_response(&self.levels, self.main_direction, u)).collect();
        Ok(Model {
            format: 1,
            points,
            static_map: Some(StaticMap { command: command.clone(), response, lagged: self.lagged, polynomial: None }),
            time_constant_curve: self.curve.as_ref().map(|curve| curve.band(command.iter().copied())),
            effects: Vec::new(),
            provenance: Some(Provenance {
                experiment: None,
                records_crc32: None,
                records: vec![self.record.clone()],
                version: version.into(),
                output: self.output,
                excitation: None,
                command_rate_hz: None,
                esc_frame_hz: None,
                judgement: None,
            }),
        })
    }

    fn point(&self, level: &super::Level) -> Option<Point> {
        let gain = level.gain?;
        let time_constant = level.time_constant_s?;
        let of = |branch: Option<super::Branch>| branch.and_then(|b| b.time_constant_s);
        let percent = |branch: Option<super::Branch>| branch.and_then(|b| b.fit_percent);
        let fit_step_percent = [percent(level.up), percent(level.down)].into_iter().flatten().reduce(f64::min);
        let delay_s = self.delay_s.value.max(0.0);
        Some(Point {
            gain_std: Some(gain.std),
            time_constant_s_std: Some(time_constant.std),
            delay_s_std: Some(self.delay_s.std),
            time_constant_up_s: of(level.up).map(|e| e.value),
            time_constant_down_s: of(level.down).map(|e| e.value),
            fit_step_percent,
            ..Point::new(level.command, Lag { gain: gain.value, time_constant_s: time_constant.value, delay_s })
        })
    }
}
