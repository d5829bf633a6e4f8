//! What the diagnosis says, as `rotorlead diagnose --json` writes it. Only what is scored is read.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::kind::Kind;

/// The whole answer.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Diagnosis {
    /// Whether there is a gap, and whether it has a name.
    pub verdict: Verdict,
    /// The named effects, the most important first.
    pub effects: Vec<Named>,
    /// Effects that are significant and do not matter.
    #[serde(default)]
    pub minor: Vec<Named>,
    /// Effects with weak evidence; `None` of a tool that does not say it.
    #[serde(default)]
    pub weak_evidence: Option<Vec<WeakEvidence>>,
    /// Kinds that were tried beside the lags alone.
    #[serde(default)]
    pub tried: Vec<Tried>,
    /// The gap on held-out records.
    pub gap: Gap,
}

/// A kind that was tried.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Tried {
    /// Its name.
    pub kind: String,
    /// By how much the log likelihood grows, less the complexity penalty; `None` of a kind that cannot be had at any.
    pub score: Option<f64>,
    /// What of that is by what was held out.
    pub held_out_gain: Option<f64>,
}

/// Whether there is a gap, and whether it has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No significant gap.
    Agrees,
    /// The gap has a name.
    Named,
    /// Part of the gap has a name.
    PartlyNamed,
    /// Nothing in the catalog explains the gap.
    Unknown,
}

/// A kind that is not named, and next to be.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct WeakEvidence {
    /// Its name.
    pub kind: String,
}

/// A named effect.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Named {
    /// Its kind's name. It may be one that is not hidden in any case.
    pub kind: String,
    /// Its parameters.
    #[serde(default)]
    pub parameters: BTreeMap<String, Value>,
    /// What the data cannot tell from it.
    #[serde(default)]
    pub alternatives: Vec<String>,
}

/// A parameter.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Value {
    /// Its value.
    pub value: f64,
    /// Its standard deviation; none is a fault where an interval is asked for.
    pub std: Option<f64>,
}

/// The gap: RMS of the residual over RMS of the deviation from the mean, on held-out records.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Gap {
    /// With the base model.
    pub before: f64,
    /// With the named effects.
    pub after: f64,
    /// What noise alone leaves.
    pub noise_floor: f64,
}

/// The score from which on a kind may be named, and how much of it has to be by what was fitted, as docs/diagnosis-method.md says.
const ENOUGH: f64 = 7.0;
const ENOUGH_FITTED: f64 = 3.5;

impl Tried {
    /// Whether it may be named.
    #[must_use]
    pub fn scores_enough(&self) -> bool {
        let fitted = |score: f64| score - self.held_out_gain.unwrap_or(0.0);
        self.score.is_some_and(|score| score >= ENOUGH && fitted(score) >= ENOUGH_FITTED)
    }
}

impl Diagnosis {
    /// Reads and checks an answer.
    ///
    /// # Errors
    /// When it is not what the contract says: what is wrong, in words.
    pub fn parse(json: &str) -> Result<Self, String> {
        let diagnosis: Self = serde_json::from_str(json).map_err(|error| format!("the JSON: {error}"))?;
        let names = !diagnosis.effects.is_empty();
        let should = matches!(diagnosis.verdict, Verdict::Named | Verdict::PartlyNamed);
        if names != should {
            return Err(format!("verdict {:?} with {} names", diagnosis.verdict, diagnosis.effects.len()));
        }
        for effect in &diagnosis.effects {
            effect.check()?;
        }
        let gap = diagnosis.gap;
        if !(gap.before >= 0.0 && gap.after >= 0.0 && gap.noise_floor >= 0.0) {
            return Err(format!("a gap is no share: {gap:?}"));
        }
        Ok(diagnosis)
    }
}

impl Named {
    /// Every parameter of a kind that is known here must be there by its name, with a standard deviation.
    fn check(&self) -> Result<(), String> {
        let kind = Kind::named(&self.kind);
        // Wrong parameters are many numbers, by point: only the name is scored.
        for parameter in kind.filter(|kind| *kind != Kind::ParameterError).map_or(&[][..], Kind::parameters) {
            match self.parameters.get(parameter.name) {
                None => {
                    let there: Vec<&str> = self.parameters.keys().map(String::as_str).collect();
                    return Err(format!("{} has no `{}` but {}", self.kind, parameter.name, there.join(", ")));
                }
                Some(Value { std: Some(std), value }) if *std > 0.0 && std.is_finite() && value.is_finite() => {}
                Some(value) => return Err(format!("{}.{} is {value:?}", self.kind, parameter.name)),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// An answer that names these kinds with the parameters at the middle of their ranges, give or take a tenth.
    pub(in super::super) fn naming(verdict: &str, kinds: &[(Kind, &[&str])]) -> String {
        let effects: Vec<serde_json::Value> = kinds
            .iter()
            .map(|(kind, alternatives)| {
                let parameters: serde_json::Map<String, serde_json::Value> = kind
                    .parameters()
                    .iter()
                    .map(|parameter| {
                        let value = parameter.at(0.5);
                        let fields = serde_json::json!({"value": value, "std": value.abs() / 10.0, "unit": "x"});
                        (parameter.name.to_owned(), fields)
                    })
                    .collect();
                serde_json::json!({
                    "kind": kind.name(), "parameters": parameters, "alternatives": alternatives,
                    "gap_before": 0.2, "gap_after": 0.1, "evidence": 12.0
                })
            })
            .collect();
        serde_json::json!({
            "verdict": verdict, "where": [], "effects": effects, "next_experiment": null,
            "gap": {"before": 0.2, "after": 0.1, "noise_floor": 0.095}
        })
        .to_string()
    }

    #[test]
    fn the_contracts_json_is_read() {
        let diagnosis = Diagnosis::parse(&naming("named", &[(Kind::Backlash, &["dead_band"])])).unwrap();
        assert_eq!(diagnosis.verdict, Verdict::Named);
        assert_eq!(diagnosis.effects[0].alternatives, ["dead_band"]);
        assert!(diagnosis.effects[0].parameters["half_width"].std.unwrap() > 0.0);
        assert_eq!(Diagnosis::parse(&naming("agrees", &[])).unwrap().effects, []);
    }

    #[test]
    fn what_breaks_the_contract_is_said() {
        let good = naming("named", &[(Kind::Backlash, &[])]);
        for (from, to, part) in [
            ("half_width", "width", "backlash has no `half_width` but width"),
            ("\"named\"", "\"unknown\"", "verdict Unknown with 1 names"),
            ("\"named\"", "\"perhaps\"", "perhaps"),
            ("\"std\"", "\"sigma\"", "backlash.half_width is"),
            ("\"after\":0.1", "\"after\":-0.1", "no share"),
        ] {
            let error = Diagnosis::parse(&good.replacen(from, to, 1)).unwrap_err();
            assert!(good.contains(from) && error.contains(part), "{error}");
        }
        assert!(Diagnosis::parse(&naming("named", &[])).is_err());
        assert!(Diagnosis::parse("").is_err());
    }
}
