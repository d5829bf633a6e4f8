//! What the reports of single commands say at their top, and of what parts they are made.

use std::path::Path;

use rotorlead_answer::{Fact, Report, Tone, Verdict};
use rotorlead_identify::design::BandwidthPoint;
use rotorlead_identify::{Bandwidth, EtfeBandwidth, MeasuredBandwidth};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_results::experiment_facts;

use super::report_option::this_command;

/// A report without parts.
pub fn report(kind: &str, title: impl Into<String>, verdict: Verdict) -> Report {
    Report {
        kind: kind.to_owned(),
        title: title.into(),
        verdict,
        facts: Vec::new(),
        warnings: Vec::new(),
        sections: Vec::new(),
        commands: vec![this_command()],
    }
}

/// A fact about a file.
pub fn file(name: &str, path: &Path) -> Fact {
    Fact::new(name, path.display().to_string())
}

/// The version, for reports that rest on no records.
pub fn version() -> Fact {
    Fact::new("Version", format!("Rotorlead {}", env!("CARGO_PKG_VERSION")))
}

/// Facts about an experiment that was read from `source`, a folder or a log.
pub fn records(experiment: &Experiment, source: &Path) -> Vec<Fact> {
    let mut facts = experiment_facts(experiment, &source.display().to_string());
    facts.extend(Experiment::checksum(source).map(|sum| Fact::new("CRC-32 of these files", sum)));
    facts
}

/// The lags of a model, in a phrase.
pub fn lags(model: &Model) -> String {
    if model.points.is_empty() {
        return "a static map alone, and no lag".to_owned();
    }
    let (low, high) = ends(model.points.iter().map(|point| point.time_constant_s));
    if let [_] = model.points.as_slice() {
        return format!("one lag, time constant {:.1} ms, a pole at {:.2} rad/s", 1e3 * low, 1.0 / low);
    }
    format!(
        "{} lags, time constants from {:.1} to {:.1} ms, poles from {:.2} to {:.2} rad/s",
        model.points.len(),
        1e3 * low,
        1e3 * high,
        1.0 / high,
        1.0 / low
    )
}

/// The same verdict where there may be warnings below.
pub fn warned(verdict: Verdict, warnings: usize) -> Verdict {
    let said = match warnings {
        0 => return verdict,
        1 => "There is a warning: read it before the model is used.".to_owned(),
        count => format!("There are {count} warnings: read them before the model is used."),
    };
    let sentences = [verdict.sentences, vec![said]].concat();
    Verdict { tone: verdict.tone.max(Tone::Attention), sentences, ..verdict }
}

/// What a compensator does to the bandwidths, in a sentence.
pub fn faster(points: &[BandwidthPoint]) -> String {
    let before = ends(points.iter().filter_map(|point| point.uncompensated.rad_s()));
    let after = ends(points.iter().filter_map(|point| point.compensated.rad_s()));
    if !(before.0.is_finite() && after.0.is_finite()) {
        return "The bandwidth is beyond what was searched.".to_owned();
    }
    format!("Predicted bandwidth: {} rad/s without, {} rad/s with the compensator.", span(before), span(after))
}

/// The lowest and the highest bandwidth, in rad/s.
pub fn extent(points: &[BandwidthPoint], of: impl Fn(&BandwidthPoint) -> Bandwidth) -> String {
    span(ends(points.iter().filter_map(|point| of(point).rad_s())))
}

/// Both ends in words, or one where they are the same.
fn span((low, high): (f64, f64)) -> String {
    if high > low { format!("{low:.1} to {high:.1}") } else { format!("{low:.1}") }
}

/// A measured bandwidth is as predicted within this share, or where its interval holds the prediction.
const AS_PREDICTED: f64 = 0.1;

/// The same beside what was measured: whether the model says it right.
pub fn faster_as_measured(points: &[BandwidthPoint], measured: &[MeasuredBandwidth]) -> Verdict {
    let predicted = Verdict::new(Tone::Plain, faster(points));
    let found = |compensated: bool| {
        let all = measured.iter().filter(|one| one.compensated == compensated).map(|one| one.bandwidth.bandwidth);
        let is_beyond = all.clone().any(|bandwidth| bandwidth.rad_s().is_none());
        let ends = ends(all.map(least));
        let (with, beyond) = (if compensated { "with" } else { "without" }, if is_beyond { " and beyond" } else { "" });
        ends.0.is_finite().then(|| format!("{} rad/s{beyond} {with}", span(ends)))
    };
    let said = [found(false), found(true)].into_iter().flatten().collect::<Vec<_>>().join(", ");
    if said.is_empty() {
        return predicted;
    }
    let measured_says = vec![format!("Measured: {said}.")];
    let others = measured.iter().filter(|one| is_other(points, one)).count();
    if others == 0 {
        return predicted.with(measured_says);
    }
    let advice = format!(
        "{others} of {} measured bandwidths are not the predicted ones: `rotorlead diagnose` tells what the model lacks.",
        measured.len()
    );
    Verdict { tone: Tone::Attention, ..predicted.with([measured_says, vec![advice]].concat()) }
}

/// A bandwidth, or what it is beyond.
fn least(bandwidth: Bandwidth) -> f64 {
    match bandwidth {
        Bandwidth::At(omega) | Bandwidth::Beyond(omega) => omega,
    }
}

/// Whether a measured bandwidth is not the one that is predicted at its nominal command; one that is not predicted is none.
fn is_other(points: &[BandwidthPoint], measured: &MeasuredBandwidth) -> bool {
    let point = points.iter().find(|point| (point.nominal - measured.nominal).abs() < 1e-6);
    let of = |point: &BandwidthPoint| if measured.compensated { point.compensated } else { point.uncompensated };
    let Some(expected) = point.and_then(|point| of(point).rad_s()) else { return false };
    let EtfeBandwidth { bandwidth, lower, upper, .. } = measured.bandwidth;
    let is_within = least(lower) <= expected && upper.rad_s().is_none_or(|upper| expected <= upper);
    let off = least(bandwidth) / expected - 1.0;
    let is_off = if bandwidth.rad_s().is_some() { off.abs() > AS_PREDICTED } else { off > AS_PREDICTED };
    is_off && !is_within
}

/// What a design gave, in sentences.
pub fn designed(design: &CompensatorDesign, points: &[BandwidthPoint], warnings: usize) -> Verdict {
    let tone = if warnings == 0 { Tone::Good } else { Tone::Attention };
    let room = format!(
        "A step of the command becomes up to {:.2} times as large: leave room for it, or the command is clipped.",
        design.step_peak()
    );
    Verdict::new(tone, faster(points)).with(vec![room])
}

fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINT: BandwidthPoint =
        BandwidthPoint { nominal: 0.5, uncompensated: Bandwidth::At(10.0), compensated: Bandwidth::At(40.0) };

    fn measured(nominal: f64, compensated: bool, bandwidth: Bandwidth, ends: (f64, f64)) -> MeasuredBandwidth {
        let bandwidth =
            EtfeBandwidth { bandwidth, static_value: 1.0, lower: Bandwidth::At(ends.0), upper: Bandwidth::At(ends.1) };
        MeasuredBandwidth { file: "u050.csv".to_owned(), nominal, compensated, bandwidth }
    }

    #[test]
    fn a_bandwidth_that_is_measured_to_be_another_is_told() {
        let as_predicted = [
            measured(0.5, false, Bandwidth::At(10.8), (10.7, 10.9)),
            measured(0.5, true, Bandwidth::At(30.0), (25.0, 41.0)),
            // Of a level that the model has not.
            measured(0.6, true, Bandwidth::At(5.0), (4.0, 6.0)),
        ];
        let verdict = faster_as_measured(&[POINT], &as_predicted);
        assert_eq!((verdict.tone, verdict.sentences.len()), (Tone::Plain, 1));
        assert_eq!(verdict.sentences[0], "Measured: 10.8 rad/s without, 5.0 to 30.0 rad/s with.");
        for other in [
            measured(0.5, false, Bandwidth::At(6.0), (5.9, 6.1)),
            measured(0.5, true, Bandwidth::At(50.0), (49.0, 51.0)),
            measured(0.5, false, Bandwidth::Beyond(180.0), (180.0, 180.0)),
        ] {
            let verdict = faster_as_measured(&[POINT], &[as_predicted[0].clone(), other]);
            assert_eq!(verdict.tone, Tone::Attention, "{:?}", verdict.sentences);
            assert!(verdict.sentences[1].starts_with("1 of 2 measured"), "{:?}", verdict.sentences);
        }
        assert_eq!(faster_as_measured(&[POINT], &[]).sentences, [""; 0]);
    }
}
