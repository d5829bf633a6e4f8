//! What to fly on a motor, for people and for programs.

use rotorlead_answer::words::sentence;
use rotorlead_answer::{
    Axis, CellValue, Color, ColumnSpec, Figure, FigureKind, Mark, Panel, Section, Series, Table, Tone, Unit, Verdict,
    build_table,
};
use rotorlead_plant::{Judgement, Readiness};
use rotorlead_vehicle::{Candidate, MotorControlKind, Purpose, Recommendation};
use serde::Serialize;

use super::figures::bode::{Curve, bode};

/// Whether a compensator may be built on a model, and which one is worth it.
#[derive(Serialize)]
pub struct JudgementValues<'a> {
    #[serde(flatten)]
    judgement: &'a Judgement,
    /// Null where nothing can be compared.
    recommend: Option<&'a Recommendation>,
}

impl<'a> JudgementValues<'a> {
    /// Both in one.
    #[must_use]
    pub fn new(judgement: &'a Judgement, recommend: Option<&'a Recommendation>) -> Self {
        Self { judgement, recommend }
    }
}

/// Whether a compensator may be built on a model, with the reasons.
#[must_use]
pub fn judged_verdict(judgement: &Judgement) -> Verdict {
    let reasons = judgement.limits.iter().map(|reason| sentence(reason));
    Verdict::new(tone(judgement.state), format!("Judged: {}.", judgement.state)).with(reasons.collect())
}

/// How good the news of a judgement is.
#[must_use]
pub fn tone(state: Readiness) -> Tone {
    match state {
        Readiness::Ready => Tone::Good,
        Readiness::ReadyWithinLimits => Tone::Plain,
        Readiness::MeasureAgain | Readiness::NotALag => Tone::Attention,
    }
}

/// What to fly, a sentence for each purpose; one for both where nothing is worth it for the same reason.
#[must_use]
pub fn to_fly(recommendation: &Recommendation) -> Vec<String> {
    let Recommendation { force, rate_loop, .. } = recommendation;
    if force == rate_loop && force.actuator == MotorControlKind::None {
        return vec![format!("to fly: nothing, as {}", force.why)];
    }
    let of = |purpose: Purpose| {
        let choice = recommendation.choice(purpose);
        format!("to fly for {}: {}, as {}", purpose.words(), choice.actuator.name(), choice.why)
    };
    [Purpose::Force, Purpose::RateLoop].map(of).into()
}

/// What to fly, in a line.
#[must_use]
pub fn to_fly_in_short(recommendation: &Recommendation) -> String {
    let of = |purpose: Purpose| {
        let actuator = match recommendation.choice(purpose).actuator {
            MotorControlKind::None => "nothing".to_owned(),
            actuator => actuator.name(),
        };
        format!("{actuator} for {}", purpose.words())
    };
    format!("to fly: {}, {}", of(Purpose::Force), of(Purpose::RateLoop))
}

/// Everything that was compared, with what it gains and what it costs.
#[must_use]
pub fn recommendation_table(found: &Recommendation) -> Table {
    let ratios = |one: &Candidate| one.rate_loop.ratios(&found.candidates.first()?.rate_loop);
    let rise = |one: &Candidate| match one.rise_s.map(|rise_s| 1e3 * rise_s) {
        Some(rise_ms) if one.is_limited => CellValue::Shown(rise_ms, format!("{rise_ms:.0}, limited")),
        rise_ms => rise_ms.into(),
    };
    let recommended_for = |one: &Candidate| {
        let purposes = [(Purpose::Force, "force"), (Purpose::RateLoop, "rate loop")].into_iter();
        let chosen = purposes.filter(|(purpose, _)| found.choice(*purpose).actuator == one.actuator);
        chosen.map(|(_, name)| name).collect::<Vec<_>>().join(", ")
    };
    let columns = [
        ColumnSpec::new("actuator", "actuator", Unit::NONE, 0, |one: &Candidate| one.actuator.name()),
        ColumnSpec::new("bandwidth_rad_s", "bandwidth", Unit::RAD_S, 1, |one: &Candidate| one.bandwidth_rad_s),
        ColumnSpec::new("minus_90_rad_s", "-90 deg", Unit::RAD_S, 1, |one: &Candidate| one.minus_90_rad_s),
        ColumnSpec::new("rise_ms", "5 % step rises", Unit::plain("ms"), 0, rise),
        ColumnSpec::new("rate_loop_bandwidth_over_none", "loop over none", Unit::NONE, 2, |one: &Candidate| {
            ratios(one).map(|ratios| ratios.bandwidth)
        }),
        ColumnSpec::new("gust_over_none", "gust over none", Unit::NONE, 2, |one: &Candidate| {
            ratios(one).map(|ratios| ratios.disturbance_peak)
        }),
        ColumnSpec::new("noise_gain", "noise gain", Unit::NONE, 1, |one: &Candidate| one.noise_gain),
        ColumnSpec::new("step_peak", "largest step", Unit::NONE, 1, |one: &Candidate| one.step_peak),
        ColumnSpec::new("recommended_for", "for", Unit::NONE, 0, recommended_for),
    ];
    let caption = "What may stand before the ESC, at the slowest operating point: what it gains, and what it costs";
    let refused = found.refused.iter().map(|one| format!("there is no {}: {}", one.actuator.name(), one.reason));
    Table {
        notes: to_fly(found).into_iter().chain(refused).map(|words| sentence(&words)).collect(),
        key: Some("candidates"),
        ..build_table("recommendation", caption, &columns, &found.candidates)
    }
}

/// What to fly, with a step and the frequency response of the bare motor, the lead and an inverse.
#[must_use]
pub fn flight_section(found: &Recommendation) -> Section {
    let drawn: Vec<(Color, &Candidate)> = drawn(found).collect();
    let steps = drawn.iter().map(|(color, one)| {
        let points = one.step.iter().map(|(time_s, part)| (1e3 * time_s, *part)).collect();
        Series::new(one.actuator.name(), *color, Mark::Line, points)
    });
    let step = Panel {
        height: 300,
        ..Panel::new(Axis::linear("time", "ms"), Axis::linear("part of the step", ""), steps.collect())
    };
    let step = Figure::new(
        FigureKind::FlightStep,
        "A step of 5 % of the command, in the middle of the range",
        "Simulated with the code that runs on the controller and this motor's lags. The dead time of the model is in it.",
        vec![step],
    );
    let curves: Vec<Curve> = drawn
        .iter()
        .map(|(color, one)| Curve::new(one.actuator.name(), Mark::Line, *color, one.response.clone()))
        .collect();
    let response = Figure::new(
        FigureKind::FlightResponse,
        "Frequency response in the middle of the range",
        "Motor and compensator relative to the static gain, for small signals. The bandwidth is where it is 3 dB down; a loop around it can \
         use it up to about -90 degrees.",
        bode(&curves, "dB relative to the static gain", &[("-3 dB", -3.0)]),
    );
    Section {
        text: to_fly(found).iter().map(|words| sentence(words)).collect(),
        figures: vec![step, response],
        ..Section::new("to_fly", "What to fly")
    }
}

/// The bare motor, the lead and an inverse: the recommended one, or the first; each kind has its color.
fn drawn(found: &Recommendation) -> impl Iterator<Item = (Color, &Candidate)> {
    let of = |is: fn(MotorControlKind) -> bool| {
        let is_recommended =
            |one: &&Candidate| [&found.force, &found.rate_loop].iter().any(|choice| choice.actuator == one.actuator);
        let all = || found.candidates.iter().filter(move |one| is(one.actuator));
        all().find(is_recommended).or_else(|| all().next())
    };
    [
        (Color::Gray, of(|kind| kind == MotorControlKind::None)),
        (Color::Vermilion, of(|kind| kind == MotorControlKind::Lead)),
        (Color::Blue, of(|kind| matches!(kind, MotorControlKind::Inverse { .. }))),
    ]
    .into_iter()
    .filter_map(|(color, one)| Some((color, one?)))
}
