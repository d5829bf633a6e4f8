//! What is found out about the records before any effect is looked for.

use std::sync::Arc;

use crate::data::dataset::{Before, Dataset, PreparedRecord};
use crate::estimate::fit::fit;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// A decay at the begin of a record that is more than this part of the response's swing may say that it was taken in another way than the
/// rest. Chosen: above what noise, play or a dead band leave. Lower, these make exceptions; higher, a wrong begin stays.
const DECAYS: f64 = 0.2;
/// It does where it is this many times the one that the record would have otherwise. Chosen: clearly more, for decays that are known to
/// some tenths.
const OTHER_DECAY: f64 = 3.0;

/// The records with what was before each of them, and without mains hum, by a model of the lags alone, which are fitted where `lags` says
/// so. `None` where they cannot be.
pub(crate) fn prepared(data: Dataset, base: &Hypothesis, lags: bool) -> Option<Dataset> {
    if data.records.iter().all(|record| record.log.is_some()) {
        return Some(data);
    }
    without_hum(with_initial_conditions(data, base), base, lags)
}

/// Without mains hum in records that repeat.
fn without_hum(data: Dataset, base: &Hypothesis, lags: bool) -> Option<Dataset> {
    let data = Arc::new(data);
    let lags = fit(&Likelihood::unit(Arc::clone(&data)), base, lags)?.hypothesis;
    let without = |record: &PreparedRecord| match lags.aligned(&data, record).filter(|_| record.log.is_none()) {
        Some((_, residual)) => record.clone().without_hum(&residual),
        None => record.clone(),
    };
    Some(data.with_records(data.records.iter().map(without).collect()))
}

/// With what was before each record: that which leaves less of a decay at their begins. Noise leaves some too, and records
/// of one experiment are taken in one way: only a decay that is large beside the response makes one an exception.
fn with_initial_conditions(mut data: Dataset, hypothesis: &Hypothesis) -> Dataset {
    const EITHER: [Before; 2] = [Before::Rest, Before::Periods];
    let decays_of = |record: &PreparedRecord| {
        let swing = hypothesis.base[record.point].gain.abs() * record.amplitude;
        EITHER.map(|before| {
            let record = PreparedRecord { before, ..record.clone() };
            hypothesis.aligned(&data, &record).map_or(f64::INFINITY, |(decay, _)| decay.abs() / swing)
        })
    };
    let of_periodic = |record: &PreparedRecord| record.log.is_none().then(|| decays_of(record));
    let decays: Vec<Option<[f64; 2]>> = data.records.iter().map(of_periodic).collect();
    let squares = |way: usize| decays.iter().flatten().map(|decays| decays[way] * decays[way]).sum::<f64>();
    let usual = usize::from(squares(1) < squares(0));
    for (record, decays) in data.records.iter_mut().zip(&decays) {
        let Some(decays) = decays else { continue };
        let (own, other) = (decays[usual], decays[1 - usual]);
        let is_other = own > DECAYS && own > OTHER_DECAY * other;
        record.before = EITHER[if is_other { 1 - usual } else { usual }];
    }
    data
}
