//! Which effects the records ask for: stepwise forward selection with backward elimination.

pub(crate) mod attempt;
pub(crate) mod auxiliary;
mod beam;
pub(crate) mod decision;
mod evidence;
pub(crate) mod explain;
pub(crate) mod folds;
pub(crate) mod pair_search;
pub(crate) mod plateau_search;
pub(crate) mod policy;
pub(crate) mod prior_model;
pub(crate) mod review;
pub(crate) mod screen;
pub(crate) mod starts;
pub(crate) mod step;
pub(crate) mod tried;
pub(crate) mod tries;
pub(crate) mod weak_evidence;
