//! The comparison: every actuator, at hover and over the range, at each latency.

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_plant::{Model, OperatingCurve};
use rotorlead_records::Output;
use serde::Serialize;

use crate::TICK_HZ;
use crate::VehicleError;
use crate::airframe::Airframe;
use crate::lateral::{Allocation, ForcePerformance, force_n, performance};
use crate::motor_control::{MotorControl, MotorControlKind, MotorControlResult, designed};
use crate::open_loop::LoopCurve;
use crate::response::{Margins, PointResponse};
use crate::roll::{RollAxis, peak_deg};
use crate::rotor::Rotor;
use crate::tuning::{Gains, TuningRule, tuned};

/// Operating points of a range, both ends among them. Chosen: over the default range these are the six of Table 1, between which the pole
/// is linear; fewer miss a bend, more take time.
const RANGE_POINTS: usize = 6;
/// How long the vehicle is simulated after the step of the disturbance torque, seconds. Chosen: 60 times the inverse of the lowest
/// bandwidth of `docs/vehicle.md`, 15 rad/s; the peak comes within a few of these.
const DISTURBED_S: f64 = 4.0;
/// How much of a disturbed angle is kept for figures, seconds. Chosen: the peak, and 2.7 integral times of the way back; more makes the
/// peak narrow.
const DRAWN_S: f64 = 0.8;
/// How much of a force step is kept for figures, seconds. Chosen: 1.7 times the rise of the bare motor, 238 ms (`docs/vehicle.md`); more
/// makes the quick ones narrow.
const DRAWN_FORCE_S: f64 = 0.4;
/// One of so many ticks is kept for figures. Chosen: a point every 4 ms, 200 to a curve of 0.8 s; fewer show corners, more make the file
/// large.
const DRAWN_EVERY: usize = 20;

/// Everything that came out.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// What every gain set keeps.
    pub rule: TuningRule,
    /// One per latency of the airframe, in its order.
    pub latencies: Vec<AtLatency>,
    /// Lateral force per actuator; empty where the airframe has no hexarotor.
    pub lateral: Vec<ForceRow>,
    /// Actuators that cannot be designed from the model, and why.
    pub refused: Vec<Refused>,
}

/// The roll axis at one latency.
#[derive(Clone, Debug, Serialize)]
pub struct AtLatency {
    /// From the gyro's sample to the ESC's new command, seconds.
    pub latency_s: f64,
    /// Tuned at the hover command alone.
    pub hover: Vec<Row>,
    /// One gain set for the range, the worst of its operating points.
    pub range: Vec<Row>,
    /// Tuned at the hover command without a D term.
    pub without_d: Vec<Row>,
    /// Largest sensitivity at hover with the gains of the first latency, by actuator; `None` where that loop is not stable.
    pub kept_gains: Vec<KeptGains>,
}

/// One actuator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Which one.
    pub actuator: MotorControlKind,
    /// What it reaches; `None` where no gain set keeps the rule.
    pub performance: Option<Performance>,
}

/// What a gain set reaches: of several operating points the worst of each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// The gain set.
    pub gains: Gains,
    /// Margins by frequency response, the worst of each.
    pub margins: Margins,
    /// Largest angle after the step of the disturbance torque, degrees, simulated.
    pub disturbance_peak_deg: f64,
    /// Settling of a step of the attitude setpoint to 2 %, seconds, simulated; `None` where it does not settle.
    pub settling_s: Option<f64>,
    /// Time in seconds and angle in degrees after the step of the disturbance torque, for figures, where the angle is largest.
    #[serde(skip)]
    pub disturbed: Vec<(f64, f64)>,
    /// The open rate loop where its phase margin is least, for figures.
    #[serde(skip)]
    pub open: Option<LoopCurve>,
}

/// What becomes of gains at a latency that they were not tuned for.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct KeptGains {
    /// Which actuator.
    pub actuator: MotorControlKind,
    /// Largest sensitivity; `None` where the loop is not stable.
    pub max_sensitivity: Option<f64>,
}

/// Lateral force with one actuator.
#[derive(Clone, Debug, Serialize)]
pub struct ForceRow {
    /// Which one.
    pub actuator: MotorControlKind,
    /// What it reaches.
    #[serde(flatten)]
    pub performance: ForcePerformance,
    /// Time in seconds and force in newtons after the step, for figures.
    #[serde(skip)]
    pub step: Vec<(f64, f64)>,
}

/// An actuator that there is none of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Refused {
    /// Which one.
    pub actuator: MotorControlKind,
    /// Why.
    pub reason: String,
}

/// How often [`study`] calls its `progress`.
#[must_use]
pub fn steps(airframe: &Airframe) -> u64 {
    let actuators = 3 + airframe.actuators.inverse_rad_s.len();
    let per_actuator = 3 * airframe.controller.latency_s.len() + usize::from(airframe.lateral.is_some());
    (actuators * per_actuator) as u64
}

/// Tunes and simulates every actuator of `airframe` with the motors of `model`. Calls `progress` after each step.
///
/// # Errors
/// When the model is none of thrust over the hover commands, or the speed loop or the hexarotor is none.
pub fn study(airframe: &Airframe, model: &Model, progress: &(dyn Fn() + Sync)) -> Result<Study, VehicleError> {
    let [from, to] = airframe.hover.range;
    let (first, last) = OperatingCurve::without_effects(model)?.range();
    if from < first || to > last {
        return Err(VehicleError::OutsideModel { from, to, first, last });
    }
    if model.provenance.as_ref().is_some_and(|provenance| provenance.output != Output::ThrustN) {
        return Err(VehicleError::NotThrust);
    }
    let rotor = Rotor::new(model)?;
    let (mut actuators, mut refused) = (Vec::new(), Vec::new());
    for one in designed(airframe, model, &rotor)? {
        sorted(one, &mut actuators, &mut refused);
    }
    let allocation =
        airframe.lateral.as_ref().map(|lateral| Ok::<_, VehicleError>((lateral, Allocation::new(lateral)?)));
    let allocation = allocation.transpose()?;
    let case = StudyCase { airframe, rotor: &rotor, rule: TuningRule::default(), progress };
    let latencies = case.at_latencies(&actuators);
    let lateral = allocation.map_or_else(Vec::new, |(lateral, allocation)| {
        let row = |actuator: &MotorControl| {
            let performance = performance(airframe, &rotor, actuator, lateral, &allocation);
            let step = force_n(airframe, &rotor, actuator, &allocation, DRAWN_FORCE_S, |_| lateral.step_n);
            progress();
            ForceRow { actuator: actuator.kind, performance, step: drawn(&step, DRAWN_FORCE_S, 1.0) }
        };
        actuators.par_iter().map(row).collect()
    });
    Ok(Study { rule: case.rule, latencies, lateral, refused })
}

fn sorted(one: MotorControlResult, actuators: &mut Vec<MotorControl>, refused: &mut Vec<Refused>) {
    match one {
        Ok(actuator) => actuators.push(actuator),
        Err((actuator, reason)) => refused.push(Refused { actuator, reason }),
    }
}

/// What does not change from one actuator to the next.
struct StudyCase<'a> {
    airframe: &'a Airframe,
    rotor: &'a Rotor,
    rule: TuningRule,
    progress: &'a (dyn Fn() + Sync),
}

impl StudyCase<'_> {
    fn at_latencies(&self, actuators: &[MotorControl]) -> Vec<AtLatency> {
        let hover = [self.airframe.hover.command];
        let [from, to] = self.airframe.hover.range;
        let place = |index: usize| from + (to - from) * index as f64 / (RANGE_POINTS - 1) as f64;
        let range: Vec<f64> = (0..RANGE_POINTS).map(place).collect();
        let mut all: Vec<AtLatency> = Vec::new();
        for &latency_s in &self.airframe.controller.latency_s {
            let rows = |nominals: &[f64], has_d: bool| {
                actuators.par_iter().map(|actuator| self.row(actuator, nominals, latency_s, has_d)).collect()
            };
            let hover_rows: Vec<Row> = rows(&hover, true);
            let tuned_for = all.first().map_or(&hover_rows, |first| &first.hover);
            let kept = actuators.iter().zip(tuned_for).filter_map(|(actuator, row)| {
                let gains = row.performance.as_ref()?.gains;
                let margins = self.point(actuator, hover[0], latency_s).margins(gains.rate());
                let most = margins.max_sensitivity;
                Some(KeptGains { actuator: actuator.kind, max_sensitivity: most.is_finite().then_some(most) })
            });
            let kept_gains = kept.collect();
            all.push(AtLatency {
                latency_s,
                range: rows(&range, true),
                without_d: rows(&hover, false),
                kept_gains,
                hover: hover_rows,
            });
        }
        all
    }

    fn point(&self, actuator: &MotorControl, nominal: f64, latency_s: f64) -> PointResponse {
        PointResponse::new(self.airframe, self.rotor, actuator, nominal, latency_s)
    }

    /// One gain set for all of `nominals`.
    fn row(&self, actuator: &MotorControl, nominals: &[f64], latency_s: f64, has_d: bool) -> Row {
        let points: Vec<PointResponse> =
            nominals.iter().map(|&nominal| self.point(actuator, nominal, latency_s)).collect();
        let integral_time_s = self.airframe.controller.integral_time_s;
        let gains = tuned(&points, integral_time_s, has_d, &self.rule);
        let each = |gains: Gains| {
            let here = nominals.iter().zip(&points).map(|(&nominal, point)| {
                let (airframe, rotor) = (self.airframe, self.rotor);
                let axis = RollAxis { airframe, rotor, actuator, nominal, latency_s, gains };
                let motion = axis.disturbed(DISTURBED_S);
                Performance {
                    gains,
                    margins: point.margins(gains.rate()),
                    open: Some(point.open(gains.rate())),
                    disturbance_peak_deg: peak_deg(&motion),
                    settling_s: axis.settling_s(),
                    disturbed: drawn(&motion.angle_rad, DRAWN_S, 1_f64.to_degrees()),
                }
            });
            here.reduce(Performance::worse)
        };
        let performance = gains.and_then(each);
        (self.progress)();
        Row { actuator: actuator.kind, performance }
    }
}

impl Performance {
    /// The worse of each.
    pub(crate) fn worse(self, other: Self) -> Self {
        let (a, b) = (self.margins, other.margins);
        let open = if b.phase_margin_deg < a.phase_margin_deg { other.open } else { self.open };
        Self {
            gains: self.gains,
            margins: Margins {
                max_sensitivity: a.max_sensitivity.max(b.max_sensitivity),
                phase_margin_deg: a.phase_margin_deg.min(b.phase_margin_deg),
                actuator_noise: a.actuator_noise.max(b.actuator_noise),
                bandwidth_rad_s: a.bandwidth_rad_s.min(b.bandwidth_rad_s),
            },
            open,
            settling_s: self.settling_s.zip(other.settling_s).map(|(a, b)| a.max(b)),
            disturbed: if other.disturbance_peak_deg > self.disturbance_peak_deg {
                other.disturbed
            } else {
                self.disturbed
            },
            disturbance_peak_deg: self.disturbance_peak_deg.max(other.disturbance_peak_deg),
        }
    }
}

/// The first `duration_s` of a response at 5 kHz, thinned, with its times.
fn drawn(response: &[f64], duration_s: f64, scale: f64) -> Vec<(f64, f64)> {
    let ticks = (duration_s * TICK_HZ).round() as usize;
    let values = response.iter().enumerate().take(ticks).step_by(DRAWN_EVERY);
    values.map(|(tick, value)| ((tick + 1) as f64 / TICK_HZ, scale * value)).collect()
}
