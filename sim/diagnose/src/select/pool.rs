//! Sets of kinds that were fitted, the best first.

use rotorlead_plant::effect::Kind;

use crate::estimate::fit::Fit;

/// A set of kinds with its fit.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub fit: Fit,
    pub evidence: f64,
}

impl Member {
    /// Its kinds, sorted.
    pub fn kinds(&self) -> Vec<&'static Kind> {
        let mut kinds: Vec<&'static Kind> = self.fit.hypothesis.effects.iter().map(|effect| effect.kind).collect();
        kinds.sort_by_key(|kind| kind.id);
        kinds
    }

    /// Whether the records do not exclude it.
    pub fn is_possible(&self) -> bool {
        self.evidence.is_finite()
    }

    /// How many.
    pub fn size(&self) -> usize {
        self.fit.hypothesis.effects.len()
    }
}

/// The best member of each set.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pool(pub(super) Vec<Member>);

impl Pool {
    /// Puts a member in the place of that of the same kinds.
    pub fn replace(&mut self, member: Member) {
        let kinds = member.kinds();
        self.0.retain(|other| other.kinds() != kinds);
        self.add(member);
    }

    /// Adds a member, unless there is a better one of the same kinds.
    pub fn add(&mut self, member: Member) {
        let kinds = member.kinds();
        match self.0.iter_mut().find(|other| other.kinds() == kinds) {
            Some(other) if other.evidence < member.evidence => *other = member,
            Some(_) => {}
            None => self.0.push(member),
        }
        self.0.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    }

    /// All of them, the best first.
    pub fn members(&self) -> &[Member] {
        &self.0
    }

    /// Those of so many kinds, the best first.
    pub fn with_size(&self, size: usize) -> impl Iterator<Item = &Member> {
        self.0.iter().filter(move |member| member.size() == size)
    }

    /// That of these kinds, sorted as [`Member::kinds`].
    pub fn get(&self, kinds: &[&'static Kind]) -> Option<&Member> {
        self.0.iter().find(|member| member.kinds() == kinds)
    }
}

/// The kinds but one.
pub(crate) fn without(kinds: &[&'static Kind], one: &Kind) -> Vec<&'static Kind> {
    kinds.iter().copied().filter(|kind| kind.id != one.id).collect()
}
