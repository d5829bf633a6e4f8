//! One answer against the truth.

use super::diagnosis::{Diagnosis, Named, Tried, Verdict, WeakEvidence};
use super::folder::{Hidden, Truth};
use super::kind::Kind;

/// A case and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Scored {
    /// The truth.
    pub truth: Truth,
    /// The answer; the error in words when there is none that can be read.
    pub answer: Result<Diagnosis, String>,
}

/// A parameter whose interval can be compared with the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Interval {
    /// Kind's name.
    pub kind: String,
    /// Parameter's name.
    pub parameter: String,
    /// How far the value is from the truth, in standard deviations.
    pub off: f64,
}

impl Interval {
    /// Within 1.96 standard deviations.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.off.abs() <= 1.96
    }
}

impl Scored {
    fn names(&self) -> &[Named] {
        self.answer.as_ref().map_or(&[], |answer| &answer.effects)
    }

    /// The names, and then the kinds that are said not to matter.
    fn mentioned(&self) -> impl Iterator<Item = &Named> {
        self.answer.iter().flat_map(|answer| answer.effects.iter().chain(&answer.minor))
    }

    /// What the table calls the answer: the first name, or `agrees`, `unknown`, `error`.
    #[must_use]
    pub fn first(&self) -> &str {
        match &self.answer {
            Err(_) => "error",
            Ok(answer) => match (answer.verdict, self.mentioned().next()) {
                (_, Some(effect)) => &effect.kind,
                (Verdict::Agrees, None) => "agrees",
                (_, None) => "unknown",
            },
        }
    }

    fn is_hidden(&self, name: &str) -> bool {
        self.truth.effects.iter().any(|hidden| hidden.kind == name)
    }

    /// The first name is a hidden effect's, or the first kind that is said not to matter where there is no name.
    #[must_use]
    pub fn first_is_right(&self) -> bool {
        self.mentioned().next().is_some_and(|named| self.is_hidden(&named.kind))
    }

    /// The first name is right, or the truth stands among its alternatives.
    #[must_use]
    pub fn first_or_alternative(&self) -> bool {
        let alternative = |named: &Named| named.alternatives.iter().any(|name| self.is_hidden(name));
        self.mentioned().next().is_some_and(|named| self.is_hidden(&named.kind) || alternative(named))
    }

    /// The truth is the first name, stands among its alternatives, or is what the records are said to lean to; `None` where the tool
    /// does not say that.
    #[must_use]
    pub fn first_alternative_or_evidence(&self) -> Option<bool> {
        let leans_to_it = self.weak_evidence()?.iter().any(|evidence| self.is_hidden(&evidence.kind));
        Some(self.first_or_alternative() || leans_to_it)
    }

    /// What the records are said to lean to.
    #[must_use]
    pub fn weak_evidence(&self) -> Option<&[WeakEvidence]> {
        self.answer.as_ref().ok()?.weak_evidence.as_deref()
    }

    /// Both effects of a pair, and everything hidden in general, are named, or said not to matter.
    #[must_use]
    pub fn all_named(&self) -> bool {
        self.truth.effects.iter().all(|hidden| self.mentioned().any(|named| named.kind == hidden.kind))
    }

    /// Everything hidden is a name or stands among the alternatives of one.
    #[must_use]
    pub fn all_named_or_alternatives(&self) -> bool {
        let says =
            |named: &Named, hidden: &Hidden| named.kind == hidden.kind || named.alternatives.contains(&hidden.kind);
        self.truth.effects.iter().all(|hidden| self.mentioned().any(|named| says(named, hidden)))
    }

    /// Some name is neither hidden nor has a hidden one among its alternatives.
    #[must_use]
    pub fn has_wrong_name(&self) -> bool {
        self.names()
            .iter()
            .any(|named| !self.is_hidden(&named.kind) && !named.alternatives.iter().any(|name| self.is_hidden(name)))
    }

    /// It agrees, though a kind that was tried scores enough for a name, and none is said not to matter.
    #[must_use]
    pub fn agrees_against_evidence(&self) -> bool {
        self.answer.as_ref().is_ok_and(|answer| {
            let is_over = answer.tried.iter().any(Tried::scores_enough);
            answer.verdict == Verdict::Agrees && answer.minor.is_empty() && is_over
        })
    }

    /// No name is given, nor a kind that does not matter.
    #[must_use]
    pub fn names_nothing(&self) -> bool {
        self.answer.is_ok() && self.mentioned().next().is_none()
    }

    /// `unknown`, or `partly_named` without a wrong name.
    #[must_use]
    pub fn admits(&self) -> bool {
        let Ok(answer) = &self.answer else { return false };
        match answer.verdict {
            Verdict::Unknown => true,
            Verdict::PartlyNamed => !self.has_wrong_name(),
            Verdict::Agrees | Verdict::Named => false,
        }
    }

    /// The gap that is left is at most 1.1 times what noise leaves.
    #[must_use]
    pub fn gap_is_closed(&self) -> bool {
        self.answer.as_ref().is_ok_and(|answer| answer.gap.after <= 1.1 * answer.gap.noise_floor)
    }

    /// Every parameter of a hidden effect that is named by its own name. Wrong parameters are scored by name alone.
    #[must_use]
    pub fn intervals(&self) -> Vec<Interval> {
        let of = |hidden: &Hidden| {
            let named = self.names().iter().find(|named| named.kind == hidden.kind)?;
            let kind = Kind::named(&hidden.kind).filter(|kind| *kind != Kind::ParameterError)?;
            Some(
                kind.parameters()
                    .iter()
                    .zip(&hidden.parameters)
                    .filter_map(|(parameter, (name, truth))| {
                        let value = named.parameters.get(name)?;
                        let (found, truth) =
                            if parameter.unsigned { (value.value.abs(), truth.abs()) } else { (value.value, *truth) };
                        let off = (found - truth) / value.std?;
                        Some(Interval { kind: hidden.kind.clone(), parameter: name.clone(), off })
                    })
                    .collect::<Vec<_>>(),
            )
        };
        self.truth.effects.iter().filter_map(of).flatten().collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::ceiling::{Ceiling, Difference};
    use super::super::diagnosis::tests::naming;
    use super::*;

    /// A case of `class` with these kinds hidden at the middle of their ranges.
    pub(in super::super) fn scored(class: &str, hidden: &[Kind], nothing: f64, rival: f64, json: &str) -> Scored {
        let effects = hidden
            .iter()
            .map(|kind| Hidden {
                kind: kind.name().to_owned(),
                parameters: kind
                    .parameters()
                    .iter()
                    .map(|parameter| (parameter.name.to_owned(), parameter.at(0.5)))
                    .collect(),
            })
            .collect();
        let ceiling = (!hidden.is_empty()).then(|| Ceiling {
            nothing,
            rivals: vec![("slew_limit".to_owned(), Difference::Fitted(rival))],
            exchanges: Vec::new(),
        });
        let truth = Truth {
            class: class.to_owned(),
            number: 0,
            effects,
            outside: (class == "outside").then(|| "echo".to_owned()),
            law: None,
            nuisances: Vec::new(),
            more_columns: false,
            model: "none".to_owned(),
            noise_level: 0.01,
            ceiling,
        };
        Scored { truth, answer: Diagnosis::parse(json) }
    }

    fn single(hidden: Kind, json: &str) -> Scored {
        scored(hidden.name(), &[hidden], -100.0, -50.0, json)
    }

    #[test]
    fn a_right_name_an_alternative_and_a_wrong_name_are_told_apart() {
        let right = single(Kind::Backlash, &naming("named", &[(Kind::Backlash, &[])]));
        assert!(right.first_is_right() && right.first_or_alternative() && !right.has_wrong_name());
        let alternative = single(Kind::Backlash, &naming("named", &[(Kind::DeadBand, &["backlash"])]));
        assert!(!alternative.first_is_right() && alternative.first_or_alternative() && !alternative.has_wrong_name());
        let wrong = single(Kind::Backlash, &naming("named", &[(Kind::DeadBand, &["slew_limit"])]));
        assert!(!wrong.first_or_alternative() && wrong.has_wrong_name() && wrong.first() == "dead_band");
        let extra = single(Kind::Backlash, &naming("named", &[(Kind::Backlash, &[]), (Kind::GainDrift, &[])]));
        assert!(extra.first_is_right() && extra.has_wrong_name());
    }

    #[test]
    fn what_is_weak_evidence_is_no_name() {
        let json = naming("agrees", &[]);
        let leaning = json.replacen('{', r#"{"weak_evidence": [{"kind": "slew_limit"}, {"kind": "backlash"}],"#, 1);
        let right = single(Kind::Backlash, &leaning);
        assert_eq!((right.first_alternative_or_evidence(), right.first_or_alternative()), (Some(true), false));
        assert!(right.names_nothing() && !right.has_wrong_name());
        assert_eq!(single(Kind::DeadBand, &leaning).first_alternative_or_evidence(), Some(false));
        assert_eq!(single(Kind::Backlash, &json).first_alternative_or_evidence(), None);
    }

    #[test]
    fn agreement_against_evidence_is_seen() {
        let tried = |score: f64| {
            naming("agrees", &[]).replacen(
                '{',
                &format!(r#"{{"tried": [{{"kind": "slew_limit", "score": {score}, "held_out_gain": 2.0}}],"#),
                1,
            )
        };
        assert!(single(Kind::SlewLimit, &tried(8.0)).agrees_against_evidence());
        assert!(!single(Kind::SlewLimit, &tried(6.0)).agrees_against_evidence());
        let minor = tried(8.0).replacen('{', r#"{"minor": [{"kind": "slew_limit"}],"#, 1);
        assert!(!single(Kind::SlewLimit, &minor).agrees_against_evidence());
    }

    #[test]
    fn no_answer_is_no_silence() {
        let error = single(Kind::Backlash, "out of memory");
        assert!(error.first() == "error" && !error.names_nothing() && !error.admits() && !error.gap_is_closed());
    }

    #[test]
    fn only_admitting_ignorance_is_right_outside_the_catalog() {
        let outside = |json: &str| scored("outside", &[], 0.0, 0.0, json);
        assert!(outside(&naming("unknown", &[])).admits());
        assert!(!outside(&naming("agrees", &[])).admits());
        assert!(!outside(&naming("partly_named", &[(Kind::GainDrift, &[])])).admits());
        assert!(!outside(&naming("named", &[(Kind::GainDrift, &[])])).admits());
    }

    #[test]
    fn a_pair_needs_both_names_in_any_order() {
        let hidden = [Kind::Backlash, Kind::SecondPole];
        let pair = |json: &str| scored("pair", &hidden, -100.0, -50.0, json);
        let both = pair(&naming("named", &[(Kind::SecondPole, &[]), (Kind::Backlash, &[])]));
        assert!(both.all_named() && both.first_is_right() && !both.has_wrong_name());
        assert_eq!(both.intervals().len(), 2);
        assert!(!pair(&naming("partly_named", &[(Kind::SecondPole, &[])])).all_named());
        let left_open = pair(&naming("named", &[(Kind::TransportDelay, &["second_pole"]), (Kind::Backlash, &[])]));
        assert!(!left_open.all_named() && left_open.all_named_or_alternatives() && !left_open.has_wrong_name());
        assert!(!pair(&naming("named", &[(Kind::TransportDelay, &["second_pole"])])).all_named_or_alternatives());
    }

    #[test]
    fn an_interval_is_two_standard_deviations_wide() {
        let mut right = single(Kind::TransportDelay, &naming("named", &[(Kind::TransportDelay, &[])]));
        assert!(right.intervals()[0].holds() && right.intervals()[0].off.abs() < 1e-9);
        // The made-up standard deviation is a tenth of the value.
        right.truth.effects[0].parameters[0].1 *= 0.81;
        assert!(right.intervals()[0].holds());
        right.truth.effects[0].parameters[0].1 *= 0.98;
        assert!(!right.intervals()[0].holds());
    }

    #[test]
    fn the_sign_of_a_clock_is_not_compared() {
        let mut right = single(Kind::ClockSkew, &naming("named", &[(Kind::ClockSkew, &[])]));
        right.truth.effects[0].parameters[0].1 *= -1.0;
        assert!(right.intervals()[0].holds());
    }

    #[test]
    fn a_gap_is_closed_within_a_tenth_of_the_noise_floor() {
        let mut right = single(Kind::Backlash, &naming("named", &[(Kind::Backlash, &[])]));
        assert!(right.gap_is_closed());
        right.answer.as_mut().unwrap().gap.after = 0.1046;
        assert!(!right.gap_is_closed());
    }
}
