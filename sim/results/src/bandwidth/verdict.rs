//! What bandwidths come to, in sentences.

use rotorlead_answer::{Tone, Verdict};
use rotorlead_design::BandwidthPoint;
use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, EtfeBandwidth};
use rotorlead_identify::lag::multisine::MeasuredBandwidth;
use rotorlead_numerics::sample::extent;

/// A measured bandwidth is as predicted within this share, or where its interval holds the prediction. Chosen: 10 % of a lag's bandwidth is
/// 0.4 dB at it; less blames a model for what its time constant scatters by, more hides a wrong level.
const AS_PREDICTED: f64 = 0.1;

/// What a compensator does to the bandwidths, in a sentence.
#[must_use]
pub fn predicted_bandwidth(points: &[BandwidthPoint]) -> String {
    let known = |of: fn(&BandwidthPoint) -> Bandwidth| {
        points.iter().any(|point| of(point).rad_s().is_some()).then(|| bandwidth_range(points, of))
    };
    match known(|point| point.uncompensated).zip(known(|point| point.compensated)) {
        Some((before, after)) => {
            format!("Predicted bandwidth: {before} rad/s without, {after} rad/s with the compensator.")
        }
        None => "The bandwidth is beyond what was searched.".to_owned(),
    }
}

/// The lowest and the highest bandwidth, in rad/s.
#[must_use]
pub fn bandwidth_range(points: &[BandwidthPoint], of: impl Fn(&BandwidthPoint) -> Bandwidth) -> String {
    span(points.iter().filter_map(|point| of(point).rad_s()))
}

/// Both ends in words, or one where they are the same.
fn span(values: impl Iterator<Item = f64>) -> String {
    let (low, high) = extent(&values.collect::<Vec<_>>());
    if high > low { format!("{low:.1} to {high:.1}") } else { format!("{low:.1}") }
}

/// The prediction beside what was measured: whether the model says it right.
pub(super) fn faster_as_measured(points: &[BandwidthPoint], measured: &[MeasuredBandwidth]) -> Verdict {
    let predicted = Verdict::new(Tone::Plain, predicted_bandwidth(points));
    let found = |compensated: bool| {
        let all = || measured.iter().filter(|one| one.compensated == compensated).map(|one| one.bandwidth.bandwidth);
        let beyond = if all().any(|bandwidth| bandwidth.rad_s().is_none()) { " and beyond" } else { "" };
        let with = if compensated { "with" } else { "without" };
        all().next().map(|_| format!("{} rad/s{beyond} {with}", span(all().map(least))))
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
    // Chosen: 1e-6 is above the rounding of decimals, and below any step of a command.
    let point = points.iter().find(|point| (point.nominal - measured.nominal).abs() < 1e-6);
    let of = |point: &BandwidthPoint| if measured.compensated { point.compensated } else { point.uncompensated };
    let Some(expected) = point.and_then(|point| of(point).rad_s()) else { return false };
    let EtfeBandwidth { bandwidth, lower, upper, .. } = measured.bandwidth;
    let is_within = least(lower) <= expected && upper.rad_s().is_none_or(|upper| expected <= upper);
    let off = least(bandwidth) / expected - 1.0;
    let is_off = if bandwidth.rad_s().is_some() { off.abs() > AS_PREDICTED } else { off > AS_PREDICTED };
    is_off && !is_within
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
