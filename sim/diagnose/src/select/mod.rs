//! Which effects the records ask for: a beam over sets of kinds, by their evidence, and the choice of the set that is named.

pub(crate) mod auxiliary;
mod beam;
mod choose;
pub(crate) mod decision;
mod evidence;
pub(crate) mod explanation;
mod finish;
pub(crate) mod folds;
mod pool;
pub(crate) mod prior_model;
pub(crate) mod screen;
pub(crate) mod search;
pub(crate) mod starts;
pub(crate) mod tried;
pub(crate) mod weak_evidence;
mod worth;
