//! How the records were taken.

use rotorlead_numerics::sample::median;
use rotorlead_records::{Experiment, Output};

use crate::data::dataset::Dataset;
use crate::likelihood::Likelihood;

/// Levels of a staircase closer than this are one. Chosen: below any step that is asked for, and above the grid of an ESC, 1/256 at most.
const SAME_LEVEL: f64 = 0.005;

/// How the records were taken: what more of them have to have in common with them.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// What the response is.
    pub output: Output,
    /// The nominal commands, increasing.
    pub nominals: Vec<f64>,
    /// Median over the records of the largest deviation of the command.
    pub amplitude: f64,
    /// Rows per second.
    pub sample_rate_hz: f64,
    /// Rate at which the command is updated, hertz, where that is faster.
    pub command_rate_hz: Option<f64>,
    /// Frames of the ESC per second, where the experiment says it.
    pub esc_frame_hz: Option<f64>,
    /// Most periods of a record.
    pub periods: u32,
    /// Standard deviation of the noise of a row, response units, the largest of the records.
    pub noise_std: f64,
    /// How staircases were taken, where nothing repeats.
    pub staircase: Option<StaircaseConditions>,
}

/// How staircases were taken.
#[derive(Clone, Debug, PartialEq)]
pub struct StaircaseConditions {
    /// The levels, increasing.
    pub levels: Vec<f64>,
    /// Median time for which a level is held, seconds.
    pub hold_s: f64,
    /// Columns of supply and speed that are not in the files.
    pub not_logged: Vec<&'static str>,
}

impl StaircaseConditions {
    /// `None` where records repeat: then there is a controller that plays others.
    fn from_experiment(experiment: &Experiment, data: &Dataset) -> Option<Self> {
        let mut levels = Vec::new();
        let mut holds_s = Vec::new();
        for record in &data.records {
            let log = record.log.as_ref()?;
            for group in log.groups.iter().filter(|group| group.plateau.is_some() && !group.rows.is_empty()) {
                levels.push(group.command);
                holds_s.push(record.time_s[group.rows.end - 1] - record.time_s[group.rows.start]);
            }
        }
        levels.sort_by(f64::total_cmp);
        levels.dedup_by(|a, b| (*a - *b).abs() < SAME_LEVEL);
        let sources = || experiment.records.iter().filter(|source| !source.excitation.is_periodic());
        let columns = [
            ("speed", sources().all(|source| source.rpm.is_some())),
            ("voltage", sources().all(|source| source.voltage_v.is_some())),
            ("current", sources().all(|source| source.current_a.is_some())),
        ];
        let not_logged = columns.into_iter().filter(|(_, is_there)| !is_there).map(|(name, _)| name).collect();
        (levels.len() > 1).then_some(Self { levels, hold_s: median(holds_s)?, not_logged })
    }
}

impl Conditions {
    pub(crate) fn from_experiment(experiment: &Experiment, likelihood: &Likelihood) -> Self {
        let data = &*likelihood.data;
        let amplitude = median(data.records.iter().map(|record| record.amplitude));
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        Self {
            output: experiment.output,
            nominals: data.nominals.clone(),
            amplitude: amplitude.expect("there are records"),
            sample_rate_hz: most(&mut data.records.iter().map(|record| record.rate_hz)),
            command_rate_hz: experiment.command_rate_hz,
            esc_frame_hz: data.esc_frame_hz,
            periods: data.records.iter().map(|record| record.periods() as u32).max().unwrap_or(1),
            noise_std: most(&mut data.records.iter().map(|record| likelihood.for_record(record).noise_std())),
            staircase: StaircaseConditions::from_experiment(experiment, data),
        }
    }
}
