//! The parameters of effects as fits see them: where they begin, how they move, and how far.

use super::kind::{Effect, Kind};

/// How far beyond the plausible range a parameter may go in a fit.
const WIDER: f64 = 2.0;

/// Whether small changes of the parameter make jumps.
pub(super) fn is_jagged(kind: Kind) -> bool {
    matches!(kind, Kind::EscFrameHold | Kind::DeadBand | Kind::Backlash | Kind::CommandQuantization | Kind::Saturation)
}

/// The parameters by their effect's place and their own.
pub(super) fn free_parameters(effects: &[Effect]) -> Vec<(usize, usize)> {
    let of = |(index, effect): (usize, &Effect)| (0..effect.values.len()).map(move |parameter| (index, parameter));
    let fitted = effects.iter().enumerate().filter(|(_, effect)| effect.kind != Kind::ParameterError);
    fitted.flat_map(of).collect()
}

/// Whether a parameter moves by parts of itself. The others, small numbers of either sign, move by parts of their range.
fn is_relative(effect: &Effect, parameter: usize) -> bool {
    let range = effect.kind.parameters()[parameter];
    range.logarithmic && !range.unsigned
}

/// The effects with one parameter moved by `part` of itself, or of its range.
pub(super) fn shifted(effects: &[Effect], (index, parameter): (usize, usize), part: f64) -> Vec<Effect> {
    let mut effects = effects.to_vec();
    let effect = &mut effects[index];
    let relative = is_relative(effect, parameter);
    let range = effect.kind.parameters()[parameter];
    let value = &mut effect.values[parameter];
    if relative {
        *value = (*value * part.clamp(-1.0, 1.0).exp()).clamp(range.low / WIDER, range.high * WIDER);
    } else {
        let span = range.high - range.low;
        let (low, high) = match effect.kind {
            Kind::AsymmetricLag => (0.3, 3.0),
            Kind::Saturation => (0.3, 1.2),
            _ => (-range.high * WIDER, range.high * WIDER),
        };
        *value = (*value + part * span).clamp(low, high);
    }
    effects
}

/// Where fits of a kind begin.
pub(super) fn kind_starts(kind: Kind) -> Vec<Effect> {
    let of = |parts: &[f64]| Effect {
        kind,
        values: kind.parameters().iter().zip(parts).map(|(parameter, part)| parameter.at(*part)).collect(),
    };
    let with = |values: &[f64]| Effect { kind, values: values.to_vec() };
    match kind {
        Kind::ParameterError => vec![of(&[0.5, 0.5])],
        Kind::CommandQuantization | Kind::Saturation | Kind::EscFrameHold => {
            (0..9).map(|index| of(&[f64::from(index) / 8.0])).collect()
        }
        Kind::DeadBand | Kind::Backlash => (0..6).map(|index| of(&[f64::from(index) / 5.0 - 0.3])).collect(),
        Kind::SlewLimit => (0..6).map(|index| of(&[f64::from(index) / 5.0])).collect(),
        Kind::TransportDelay | Kind::SecondPole | Kind::MovingAverage => {
            [0.2, 0.5, 0.8].map(|part| of(&[part])).to_vec()
        }
        Kind::AsymmetricLag => vec![with(&[1.05]), with(&[1.5])],
        Kind::OperatingPointLag | Kind::QuadraticThrust => vec![with(&[0.1]), of(&[0.5])],
        Kind::InflowLead => vec![with(&[1.6, 5e-3]), with(&[2.0, 10e-3]), with(&[0.75, 8e-3])],
        Kind::SupplySag => vec![with(&[0.05, 0.4]), with(&[0.05, 2.0])],
        Kind::GainDrift => vec![with(&[0.02, 12.0]), with(&[0.02, 40.0])],
        Kind::StandResonance => (0..7).map(|index| of(&[f64::from(index) / 6.0, 0.5, 0.3])).collect(),
        Kind::ClockSkew => vec![with(&[1.0]), with(&[300.0]), with(&[-300.0])],
    }
}
