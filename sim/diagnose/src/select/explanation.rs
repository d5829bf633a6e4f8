//! Explain: which effects of the catalog the records ask for, and the fit with all of them.

use rotorlead_plant::effect::Kind;

use super::decision::Decision;
use super::search::Search;
use super::tried::Tried;
use super::weak_evidence::{self, WeakEvidence};
use crate::estimate::fit::Fit;
use crate::estimate::profile::profile_non_smooth;
use crate::likelihood::InitialCondition;
use crate::model::hypothesis::Hypothesis;

/// An effect that was found.
#[derive(Clone, Debug)]
pub(crate) struct FoundEffect {
    /// The kind.
    pub kind: &'static Kind,
    /// Its score beside the others that were found.
    pub score: f64,
    /// Others that would do as well in its place.
    pub alternatives: Vec<&'static Kind>,
    /// The odds of it against each of these.
    pub odds: Vec<f64>,
}

/// What was found, with the fit of all of it.
#[derive(Clone, Debug)]
pub(crate) struct Explanation {
    /// The lags alone.
    pub before: Fit,
    /// With the effects, in the order of `found`.
    pub after: Fit,
    /// The effects, the most valuable first.
    pub found: Vec<FoundEffect>,
    /// What was tried beside the lags alone, best first.
    pub tried: Vec<Tried>,
    /// Effects with weak evidence beside the lags alone.
    pub weak_evidence: Vec<WeakEvidence>,
    /// What became of each kind, in records that do not repeat.
    pub decisions: Vec<Decision>,
}

impl Search<'_> {
    /// Finds the effects: in all records, and then their values in what is fitted alone, so that what is held out judges them.
    pub fn explain(&mut self, base: &Hypothesis) -> Option<Explanation> {
        let before = self.settle(&base.clone().limited_by(&self.likelihood.data), self.lags)?;
        let mut all = self.on(self.likelihood.with_all_fitted());
        let (pool, promised) = all.beam(&before.hypothesis)?;
        let tried = all.tried(&pool);
        let (mut chosen, mut found) = all.chosen(&pool)?;
        let decisions =
            if self.likelihood.data.has_logs() { all.decisions(&pool, &chosen, &promised) } else { Vec::new() };
        let weak_evidence = weak_evidence::weak_evidence(promised, &tried);
        if found.is_empty()
            && let Some((member, named)) = all.explain_starts(&chosen.fit)
        {
            (chosen, found) = (member, named);
            self.likelihood.initial_condition = InitialCondition::Steady;
        }
        let after = match found.is_empty() {
            true => before.clone(),
            false => {
                self.likelihood = self.likelihood.weighed(&chosen.fit.hypothesis);
                let settled = self.settle(&chosen.fit.hypothesis, self.lags)?;
                profile_non_smooth(&self.likelihood, settled)?
            }
        };
        Some(Explanation { before, after, found, tried, weak_evidence, decisions })
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::model::candidate::Candidate;
    use crate::testing::{likelihood, records};

    /// What is found in records of a motor with these effects.
    fn found(effects: &str) -> Vec<Candidate> {
        let (likelihood, base) = likelihood(&records(effects, 0.05, 1));
        let catalog = Catalog::standard();
        let mut search = Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true };
        let explanation = search.explain(&Hypothesis::from_lags(base)).unwrap();
        assert_eq!(explanation.found.len(), explanation.after.hypothesis.effects.len());
        explanation.after.hypothesis.effects
    }

    fn effect(kind: &str, parameters: &str) -> String {
        format!("[[effect]]\nkind = \"{kind}\"\nparameters = {{ {parameters} }}\n")
    }

    fn names(found: &[Candidate]) -> Vec<&'static str> {
        let mut names: Vec<&str> = found.iter().map(|effect| effect.kind.id).collect();
        names.sort_unstable();
        names
    }

    #[test]
    fn where_nothing_is_hidden_nothing_is_found() {
        assert_eq!(names(&found("")), Vec::<&str>::new());
    }

    #[test]
    fn two_effects_that_look_like_a_third_are_found_together() {
        let delay = effect("transport_delay", "delay_s = 0.0075");
        let air = effect("inflow_lead", "lead_ratio = 2.2, time_constant_s = 0.012");
        assert_eq!(names(&found(&[delay, air].concat())), ["inflow_lead", "transport_delay"]);
    }

    #[test]
    fn a_law_that_is_bent_keeps_its_name_and_says_its_shape() {
        let found = found(&effect("second_pole", "time_constant_s = 0.015, third_ratio = 0.4"));
        assert_eq!(names(&found), ["second_pole"]);
        let (place, _) = found[0].kind.shape().unwrap();
        assert!(found[0].bends && (found[0].values[place] - 0.4).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn a_dead_band_that_grows_with_the_command_keeps_its_name_and_says_its_shape() {
        let found = found(&effect("dead_band", "width = 0.006, width_growth_per_duty = 4.0"));
        assert_eq!(names(&found), ["dead_band"]);
        let (place, _) = found[0].kind.shape().unwrap();
        let (width, growth) = (found[0].values[0], found[0].values[place]);
        assert!((width / 0.006 - 1.0).abs() < 0.01 && (growth - 4.0).abs() < 0.3, "{found:?}");
    }
}
