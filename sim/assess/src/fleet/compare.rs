//! Logs against each other.

use std::collections::{BTreeMap, HashSet};
use std::fmt;

use rotorlead_numerics::sample::median;
use rotorlead_records::NOMINAL_TOLERANCE;

use super::drift::Drift;
use super::outlying::{OUTLIER_Z_SCORE, modified_z_scores};
use super::{FEWEST_LOGS, FleetMember, FleetParameter};

/// The family-wise probability of calling a drift where no motor has one. Standard: 5 %, the level of the 95 % interval beside it.
const DRIFT_LEVEL: f64 = 0.05;

/// What one quantity does over the logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The commands that enough logs share, increasing, with the usual value of the quantity at each.
    pub levels: Vec<(f64, f64)>,
    /// Of each log, in their order: `None` where it shares no command.
    pub logs: Vec<Option<LogFileDeviation>>,
    /// Of each motor, by name.
    pub motors: BTreeMap<String, MotorDeviation>,
}

/// One log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogFileDeviation {
    /// Mean over the shared commands of `ln(value / median over all logs)`.
    pub deviation: f64,
    /// Distance from its motor's other logs, or from its line where it drifts, in standard deviations of all logs; `None` of
    /// a motor with fewer than three logs, or of too few logs.
    pub score: Option<f64>,
}

/// One motor.
#[derive(Clone, Debug, PartialEq)]
pub struct MotorDeviation {
    /// Logs that were compared.
    pub logs: usize,
    /// Median of their deviations.
    pub deviation: f64,
    /// Distance from the other motors in standard deviations of motors; `None` of too few motors.
    pub score: Option<f64>,
    /// Its change with time; `None` where too few of its logs are dated.
    pub drift: Option<Drift>,
    /// Whether that is more than chance, with all motors in mind (S. Holm, Scandinavian Journal of Statistics 6, 1979, at 5 %).
    pub drifts: bool,
}

/// Whether a score stands out.
pub(super) fn stands_out(score: Option<f64>) -> bool {
    score.is_some_and(|score| score.abs() > OUTLIER_Z_SCORE)
}

impl LogFileDeviation {
    /// Whether it stands out among the logs of its motor.
    #[must_use]
    pub fn stands_out(&self) -> bool {
        stands_out(self.score)
    }
}

impl MotorDeviation {
    /// Whether it stands out among the motors.
    #[must_use]
    pub fn stands_out(&self) -> bool {
        stands_out(self.score)
    }
}

/// No command is shared by enough logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FewLogs;

impl fmt::Display for FewLogs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no command is shared by {FEWEST_LOGS} logs: logs are compared at equal nominal commands, within {NOMINAL_TOLERANCE}"
        )
    }
}

impl std::error::Error for FewLogs {}

/// Compares logs in one quantity.
///
/// # Errors
/// [`FewLogs`].
pub fn compare(logs: &[FleetMember], quantity: FleetParameter) -> Result<Comparison, FewLogs> {
    let levels = levels(logs, quantity);
    if levels.is_empty() {
        return Err(FewLogs);
    }
    let deviations: Vec<Option<f64>> = logs.iter().map(|log| deviation(log, quantity, &levels)).collect();
    let mut motors = motors(logs, &deviations);
    find_drifts(&mut motors);
    let modified_z_scores = log_file_scores(logs, &deviations, &motors);
    let logs = deviations
        .into_iter()
        .zip(modified_z_scores)
        .map(|(deviation, score)| deviation.map(|deviation| LogFileDeviation { deviation, score }))
        .collect();
    let levels = levels.into_iter().map(|(nominal, usual)| (nominal, usual.exp())).collect();
    Ok(Comparison { levels, logs, motors })
}

/// Shared commands, with the median of the logarithm.
fn levels(logs: &[FleetMember], quantity: FleetParameter) -> Vec<(f64, f64)> {
    let of_log = |(number, log): (usize, &'_ FleetMember)| -> Vec<(f64, f64, usize)> {
        log.points.iter().map(|point| (point.nominal, point.logarithm(quantity), number)).collect()
    };
    let mut points: Vec<_> = logs.iter().enumerate().flat_map(of_log).collect();
    points.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut levels = Vec::new();
    let mut rest = &points[..];
    while let Some((first, ..)) = rest.first() {
        let (level, others) = rest.split_at(rest.partition_point(|(nominal, ..)| nominal - first <= NOMINAL_TOLERANCE));
        rest = others;
        let usual = median(level.iter().map(|(_, value, _)| *value));
        let sharing: HashSet<usize> = level.iter().map(|(.., log)| *log).collect();
        if let (true, Some(usual)) = (sharing.len() >= FEWEST_LOGS, usual) {
            levels.push((level.iter().map(|(nominal, ..)| nominal).sum::<f64>() / level.len() as f64, usual));
        }
    }
    levels
}

fn deviation(log: &FleetMember, quantity: FleetParameter, levels: &[(f64, f64)]) -> Option<f64> {
    let differences: Vec<f64> = log
        .points
        .iter()
        .filter_map(|point| {
            let (_, usual) = levels.iter().find(|(nominal, _)| (nominal - point.nominal).abs() <= NOMINAL_TOLERANCE)?;
            Some(point.logarithm(quantity) - usual)
        })
        .collect();
    (!differences.is_empty()).then(|| differences.iter().sum::<f64>() / differences.len() as f64)
}

fn motors(logs: &[FleetMember], deviations: &[Option<f64>]) -> BTreeMap<String, MotorDeviation> {
    let mut by_motor: BTreeMap<&str, Vec<(Option<f64>, f64)>> = BTreeMap::new();
    for (log, deviation) in logs.iter().zip(deviations) {
        if let Some(deviation) = deviation {
            by_motor.entry(&log.motor).or_default().push((log.day, *deviation));
        }
    }
    let medians: Vec<f64> =
        by_motor.values().filter_map(|logs| median(logs.iter().map(|(_, deviation)| *deviation))).collect();
    let modified_z_scores = modified_z_scores(&medians);
    by_motor
        .into_iter()
        .zip(&medians)
        .enumerate()
        .map(|(index, ((motor, logs), deviation))| {
            let dated: Vec<(f64, f64)> =
                logs.iter().filter_map(|(day, deviation)| day.map(|day| (day, *deviation))).collect();
            let motor_deviation = MotorDeviation {
                logs: logs.len(),
                deviation: *deviation,
                score: modified_z_scores.as_ref().map(|modified_z_scores| modified_z_scores[index]),
                drift: Drift::through(&dated),
                drifts: false,
            };
            (motor.to_owned(), motor_deviation)
        })
        .collect()
}

/// Holm's procedure over all motors whose drift is known.
fn find_drifts(motors: &mut BTreeMap<String, MotorDeviation>) {
    let mut known: Vec<_> =
        motors.values_mut().filter_map(|motor| motor.drift.map(|drift| (drift.p_value, &mut motor.drifts))).collect();
    known.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    let count = known.len();
    for (rank, (p_value, drifts)) in known.into_iter().enumerate() {
        if p_value > DRIFT_LEVEL / (count - rank) as f64 {
            break;
        }
        *drifts = true;
    }
}

/// Each log against the median of its motor's others, which it does not pull to itself.
fn log_file_scores(
    logs: &[FleetMember],
    deviations: &[Option<f64>],
    motors: &BTreeMap<String, MotorDeviation>,
) -> Vec<Option<f64>> {
    let residual = |index: usize| {
        let log = &logs[index];
        let motor = motors.get(&log.motor).filter(|motor| motor.logs >= FEWEST_LOGS)?;
        let others = (0..logs.len()).filter(|other| *other != index && logs[*other].motor == log.motor);
        let usual = match (motor.drift, log.day) {
            (Some(drift), Some(day)) if motor.drifts => drift.at(day),
            _ => median(others.filter_map(|other| deviations[other]))?,
        };
        Some(deviations[index]? - usual)
    };
    let residuals: Vec<Option<f64>> = (0..logs.len()).map(residual).collect();
    let known: Vec<f64> = residuals.iter().copied().flatten().collect();
    let Some(modified_z_scores) = modified_z_scores(&known) else { return vec![None; logs.len()] };
    let mut modified_z_scores = modified_z_scores.into_iter();
    residuals.into_iter().map(|residual| residual.and_then(|_| modified_z_scores.next())).collect()
}
