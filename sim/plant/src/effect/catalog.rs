//! The kinds of effects that there are, and the rules for an `[[effect]]` of a model.

use std::borrow::Cow;

use rotorlead_records::files::{Fault, KeyPath, did_you_mean, shown};

use super::{ActiveEffect, Kind, STANDARD};
use crate::model::{Effect, Model};

/// Kinds of effects, in the order of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Catalog {
    kinds: Cow<'static, [&'static Kind]>,
}

impl Catalog {
    /// Every kind of this crate.
    #[must_use]
    pub fn standard() -> Self {
        Self { kinds: Cow::Borrowed(STANDARD) }
    }

    /// The same with the kinds of these identifiers alone.
    #[must_use]
    pub fn only(&self, ids: &[&str]) -> Self {
        Self { kinds: self.kinds().filter(|kind| ids.contains(&kind.id)).collect() }
    }

    /// The kinds, from command to logger.
    pub fn kinds(&self) -> impl Iterator<Item = &'static Kind> {
        self.kinds.iter().copied()
    }

    /// The kind of that identifier.
    #[must_use]
    pub fn find(&self, id: &str) -> Option<&'static Kind> {
        self.kinds().find(|kind| kind.id == id)
    }

    /// Place in the chain, counted from zero.
    fn place(&self, kind: &Kind) -> usize {
        self.kinds.iter().position(|other| *other == kind).unwrap_or(self.kinds.len())
    }

    /// Puts effects into the order of the chain; those of one kind stay in theirs.
    pub fn sort(&self, effects: &mut [ActiveEffect]) {
        effects.sort_by_key(|effect| self.place(effect.kind()));
    }

    /// The effects of `model`, in the order of the chain.
    ///
    /// # Errors
    /// A fault as of [`Catalog::resolve`].
    pub fn active_effects(&self, model: &Model) -> Result<Vec<ActiveEffect>, Fault> {
        let place = KeyPath::root().key("effect");
        let resolved = model.effects.iter().enumerate().map(|(index, effect)| self.resolve(effect, &place.item(index)));
        let mut effects = resolved.collect::<Result<Vec<_>, _>>()?;
        self.sort(&mut effects);
        Ok(effects)
    }

    /// An `[[effect]]`, whose place in the file is `place`, as one of this catalog.
    ///
    /// # Errors
    /// A fault for a kind that is not in the catalog, a parameter that the kind has not got, one that is missing, and a value
    /// that no actuator has.
    pub fn resolve(&self, effect: &Effect, place: &KeyPath) -> Result<ActiveEffect, Fault> {
        let kind = self.find(&effect.kind).ok_or_else(|| self.unknown_kind(&effect.kind, &place.key("kind")))?;
        let names = kind.parameters.iter().map(|parameter| parameter.name);
        let parameters = place.key("parameters");
        if let Some(name) = effect.parameters.keys().find(|name| !names.clone().any(|known| known == *name)) {
            let help = did_you_mean(name, names.clone())
                .unwrap_or_else(|| format!("`{}` has {}", kind.id, list(names.clone())));
            return Err(parameters.key(name).fault(format!("`{}` has no such parameter", kind.id), help));
        }
        let mut values = Vec::with_capacity(kind.parameters.len());
        for parameter in kind.parameters {
            let given = effect.parameters.get(parameter.name).copied();
            values.push(given.or(parameter.default()).ok_or_else(|| {
                let what = format!("`{}` needs `{}`, {}", kind.id, parameter.name, parameter.meaning);
                place.clone().fault(what, format!("add `{}` to its parameters", parameter.name))
            })?);
        }
        Self::check_values(kind, &values, &parameters)?;
        Ok(ActiveEffect::checked(kind, values))
    }

    pub(super) fn check_values(kind: &Kind, values: &[f64], place: &KeyPath) -> Result<(), Fault> {
        for (parameter, &value) in kind.parameters.iter().zip(values) {
            let (from, to) = parameter.bounds();
            let place = place.key(parameter.name);
            // A null value that is infinite is a way to say "none".
            let none = value.is_infinite() && value == parameter.null;
            if !(none || (value.is_finite() && (from..=to).contains(&value))) {
                let (value, from, to) = (shown(value), shown(from), shown(to));
                let message =
                    format!("{value} is not from {from} to {to}: `{}` is {}", parameter.name, parameter.meaning);
                let (low, high) = parameter.plausible;
                return Err(place.fault(message, format!("plausible values are {low} to {high}")));
            }
        }
        (kind.check)(values).map_err(|(index, rule)| {
            let parameter = &kind.parameters[index];
            place.key(parameter.name).fault(format!("{} {rule}", values[index]), "correct one of the two")
        })
    }

    fn unknown_kind(&self, id: &str, place: &KeyPath) -> Fault {
        let ids = || self.kinds().map(|kind| kind.id);
        let help = did_you_mean(id, ids()).unwrap_or_else(|| format!("the kinds are {}", list(ids())));
        place.clone().fault(format!("`{id}` is no kind of effect that this version knows"), help)
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
