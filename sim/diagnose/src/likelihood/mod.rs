//! How well a hypothesis agrees with the records.
//!
//! A record's likelihood is that of its white residual: numbers that are independent, with variance 1, where only noise is left. What makes
//! it white are weights, which are taken from what a hypothesis leaves: a value beside the records, which do not change.

pub(crate) mod adjoint;
pub(crate) mod excess;
pub(crate) mod hold_delay;
pub(crate) mod isolated_steps;
pub(crate) mod periodic;
pub(crate) mod plateaus;

use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_plant::Trace;
use rotorlead_records::Excitation;

use crate::data::dataset::{Dataset, PreparedRecord};
use crate::data::plateaus::split::{StepSplit, is_fitted};
use crate::data::split::Split;
use crate::model::hypothesis::Hypothesis;
use crate::noise::whitening::dot;
use excess::{Excess, Term};
use periodic::{Periodic, PeriodicWeights};
use plateaus::{PlateauWeights, Plateaus};

/// Groups that each side of a split has to have. Chosen: one group is an accident. More leave short logs without a split.
const LEAST_GROUPS: usize = 2;
/// Part of a row by which the stamps of a record may be off in the mean: a standard deviation. Chosen: jitter of a tenth of a row in a
/// mean of some hundreds. Higher, a short delay passes for alignment; lower, alignment for a delay.
const STAMPS_OFF: f64 = 0.005;

/// What is known of the response at the begin of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InitialCondition {
    /// It may be anything.
    Free,
    /// The steady response to the command before the record ([`Before`](crate::data::dataset::Before)).
    Steady,
}

/// What a record is weighed by.
#[derive(Clone, Debug)]
pub(crate) enum RecordWeights {
    /// One that repeats.
    Periodic(PeriodicWeights),
    /// One that does not.
    Plateaus(PlateauWeights),
}

impl RecordWeights {
    fn unit(record: &PreparedRecord) -> Self {
        match &record.log {
            Some(log) => Self::Plateaus(PlateauWeights::unit(log, record.channels.len())),
            None => Self::Periodic(PeriodicWeights::unit(record)),
        }
    }
}

/// The likelihood of one record.
pub(crate) trait RecordLikelihood {
    /// Up to which row something is compared in a split; 0 where nothing is.
    fn end(&self, split: Split) -> usize;

    /// The white residual over a split. `None` for values that no actuator has.
    fn residual(&self, hypothesis: &Hypothesis, split: Split) -> Option<Vec<Complex64>>;

    /// Derivative of [`Self::residual`], which is `at` with `hypothesis`, by the logarithm of the lag's gain. `None` where the gain has
    /// another part in it.
    fn by_gain(&self, _: &Hypothesis, _: Split, _at: &[Complex64]) -> Option<Vec<Complex64>> {
        None
    }

    /// What a model that was simulated leaves of the columns beside the response. `None` where it says nothing of one.
    fn auxiliary_residuals(&self, trace: &Trace) -> Option<Vec<AuxiliaryResidual>>;

    /// The weights that a hypothesis gives, by what it leaves beside what is free.
    fn weighed(&self, hypothesis: &Hypothesis) -> Option<RecordWeights>;

    /// What a hypothesis leaves over noise, number by number. Empty where it is impossible.
    fn terms(&self, hypothesis: &Hypothesis, split: Split) -> Vec<Term>;

    /// The same row by row over time, where [`Self::terms`] are not. Empty elsewhere.
    fn terms_in_time(&self, _: &Hypothesis, _: Split) -> Vec<Term> {
        Vec::new()
    }

    /// Sum of squares of what a hypothesis leaves, response units, beside a sensor's zero and the state at the begin, which decays with
    /// `tau_s`. `None` where it is impossible.
    fn squares(&self, hypothesis: &Hypothesis, tau_s: f64, split: Split) -> Option<f64>;

    /// Sum of squares of the change from one prediction to another, beside what [`Self::squares`] leaves out. `None` where either is
    /// impossible.
    fn change(&self, one: &Hypothesis, other: &Hypothesis, tau_s: f64, split: Split) -> Option<f64>;

    /// Sums of squares of the response about its mean, and of the noise in it.
    fn power(&self, split: Split) -> Power;

    /// Standard deviation of the noise of a row.
    fn noise_std(&self) -> f64;
}

/// What is left of a column beside the response.
#[derive(Clone, Debug)]
pub(crate) struct AuxiliaryResidual {
    /// Over its standard deviations.
    pub white: Vec<Complex64>,
    /// How many independent numbers that is.
    pub numbers: f64,
}

/// Sums of squares, response units.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Power {
    /// Of the response about its mean.
    pub response: f64,
    /// Of the noise in it.
    pub noise: f64,
}

/// Records with what they are weighed by.
#[derive(Clone, Debug)]
pub(crate) struct Likelihood {
    /// The records.
    pub data: Arc<Dataset>,
    /// By the place of the record.
    weights: Vec<Arc<RecordWeights>>,
    /// Whether the response at the begin of each record is compared.
    pub initial_condition: InitialCondition,
    /// Whether it is of a part, which may not determine all that is searched: values are then tied to where the effect is not.
    pub is_part: bool,
}

impl Likelihood {
    /// For noise that is not known yet.
    pub fn unit(data: Arc<Dataset>) -> Self {
        let weights = data.records.iter().map(|record| Arc::new(RecordWeights::unit(record))).collect();
        Self { data, weights, initial_condition: InitialCondition::Free, is_part: false }
    }

    /// That of one record.
    pub fn for_record<'a>(&'a self, record: &'a PreparedRecord) -> Box<dyn RecordLikelihood + 'a> {
        match &*self.weights[record.place] {
            RecordWeights::Periodic(weights) => {
                Box::new(Periodic::new(&self.data, record, weights, self.initial_condition))
            }
            RecordWeights::Plateaus(weights) => Box::new(Plateaus::new(&self.data, record, weights)),
        }
    }

    /// The record where it repeats.
    pub fn periodic<'a>(&'a self, record: &'a PreparedRecord) -> Option<Periodic<'a>> {
        match &*self.weights[record.place] {
            RecordWeights::Periodic(weights) => {
                Some(Periodic::new(&self.data, record, weights, self.initial_condition))
            }
            RecordWeights::Plateaus(_) => None,
        }
    }

    /// The record where it does not repeat.
    pub fn plateaus<'a>(&'a self, record: &'a PreparedRecord) -> Option<Plateaus<'a>> {
        match &*self.weights[record.place] {
            RecordWeights::Periodic(_) => None,
            RecordWeights::Plateaus(weights) => Some(Plateaus::new(&self.data, record, weights)),
        }
    }

    /// Whether something of a record is in a split.
    pub fn has(&self, record: &PreparedRecord, split: Split) -> bool {
        self.for_record(record).end(split) > 0
    }

    /// The records of which something is in a split.
    pub fn compared(&self, split: Split) -> Vec<&PreparedRecord> {
        self.data.records.iter().filter(|record| self.has(record, split)).collect()
    }

    /// The white residual of one record over a split.
    pub fn residual(&self, record: &PreparedRecord, hypothesis: &Hypothesis, split: Split) -> Option<Vec<Complex64>> {
        self.for_record(record).residual(hypothesis, split)
    }

    /// Sum of squares of the white residuals over a split. `None` where the hypothesis is impossible.
    pub fn chi_square(&self, hypothesis: &Hypothesis, split: Split) -> Option<f64> {
        self.sum(hypothesis, split, |of| of.residual(hypothesis, split).map(|white| dot(&white, &white)))
    }

    fn sum(
        &self,
        hypothesis: &Hypothesis,
        split: Split,
        of: impl Fn(&dyn RecordLikelihood) -> Option<f64> + Sync,
    ) -> Option<f64> {
        let parts: Option<Vec<f64>> =
            self.compared(split).into_par_iter().map(|record| of(&*self.for_record(record))).collect();
        let sum = parts?.iter().sum::<f64>() + (hypothesis.time_offset_s / self.time_offset_std()).powi(2);
        sum.is_finite().then_some(sum)
    }

    /// What a hypothesis leaves over noise.
    pub fn excess(&self, hypothesis: &Hypothesis, split: Split) -> Excess {
        let mut total = Excess::default();
        let terms = self.data.records.iter().flat_map(|record| self.for_record(record).terms(hypothesis, split));
        terms.for_each(|term| total.add(term.excess));
        total
    }

    /// RMS of what a hypothesis leaves beside noise, over that of the noise. 0 where there is no more than noise.
    pub fn excess_share(&self, hypothesis: &Hypothesis, split: Split) -> f64 {
        let (mut over, mut noise) = (0.0, 0.0);
        for record in self.data.records.iter().filter(|record| self.has(record, split)) {
            let of = self.for_record(record);
            over += of.terms(hypothesis, split).iter().map(|term| term.excess.over() * term.scale).sum::<f64>();
            noise += of.power(split).noise;
        }
        if noise > 0.0 { (over.max(0.0) / noise).sqrt() } else { 0.0 }
    }

    /// How far the rows of the records leave the alignment open. A command takes effect at its row and the response is that of
    /// its row's moment, so what is left is a logger's own jitter, whose mean over a record is small. Of a log nobody knows where
    /// in its interval a row was taken: a uniform error of one row has this standard deviation.
    pub fn time_offset_std(&self) -> f64 {
        let longest = |part: f64, are_logs: bool| {
            let there = self.data.records.iter().filter(|record| record.log.is_some() == are_logs);
            there.map(|record| part / record.rate_hz).reduce(f64::max)
        };
        longest(STAMPS_OFF, false).or_else(|| longest(12_f64.sqrt().recip(), true)).unwrap_or(f64::INFINITY)
    }

    /// The same records by the weights that a hypothesis gives; those of a record for which it is impossible stay.
    pub fn weighed(&self, hypothesis: &Hypothesis) -> Self {
        let weighed = |record: &PreparedRecord| match self.for_record(record).weighed(hypothesis) {
            Some(weights) => Arc::new(weights),
            None => Arc::clone(&self.weights[record.place]),
        };
        Self { weights: self.data.records.par_iter().map(weighed).collect(), ..self.clone() }
    }

    /// The same with the errors that a hypothesis leaves of records that do not repeat. `None` where it is impossible.
    pub fn with_errors_from(&self, hypothesis: &Hypothesis) -> Option<Self> {
        let weighed = |record: &PreparedRecord| match self.plateaus(record) {
            Some(plateaus) => plateaus.weighed(hypothesis).map(Arc::new),
            None => Some(Arc::clone(&self.weights[record.place])),
        };
        let weights: Option<Vec<_>> = self.data.records.iter().map(weighed).collect();
        Some(Self { weights: weights?, ..self.clone() })
    }

    /// The same records with all that is compared fitted.
    pub fn with_all_fitted(&self) -> Self {
        let fitted = |weights: &Arc<RecordWeights>| match &**weights {
            RecordWeights::Plateaus(own) => Arc::new(RecordWeights::Plateaus(own.assigned(|_| Split::Train))),
            RecordWeights::Periodic(_) => Arc::clone(weights),
        };
        let records = self.data.records.iter().map(PreparedRecord::with_all_fitted).collect();
        Self {
            data: Arc::new(self.data.with_records(records)),
            weights: self.weights.iter().map(fitted).collect(),
            ..self.clone()
        }
    }

    /// Some records, the first period of what is fitted of them where they repeat.
    pub fn first_period(&self, records: &[&PreparedRecord]) -> Self {
        let mut weights = self.weights.clone();
        for record in records {
            if let RecordWeights::Periodic(own) = &*self.weights[record.place] {
                weights[record.place] = Arc::new(RecordWeights::Periodic(own.first_period(record)));
            }
        }
        let shorter = records.iter().map(|record| record.with_one_period_fitted()).collect();
        Self { data: Arc::new(self.data.with_records(shorter)), weights, ..self.clone() }
    }

    /// A part of the records that shows most of what all of them do, for a first look: one period of each excitation at the lowest and
    /// at the highest nominal command. `None` where that is not much less, and where records do not repeat.
    pub fn for_first_look(&self) -> Option<Self> {
        let mut fitted = self.compared(Split::Train);
        if self.data.has_logs() {
            return None;
        }
        fitted.sort_by(|a, b| a.nominal.total_cmp(&b.nominal));
        let mut chosen: Vec<&PreparedRecord> = Vec::new();
        for excitation in [Excitation::Multisine, Excitation::Square, Excitation::Triangle] {
            let those: Vec<&PreparedRecord> =
                fitted.iter().copied().filter(|record| record.excitation == excitation).collect();
            let mut places: Vec<usize> = [0, those.len().saturating_sub(1)].to_vec();
            places.dedup();
            chosen.extend(places.into_iter().filter_map(|place| those.get(place)));
        }
        (2 * chosen.len() <= fitted.len() && !chosen.is_empty()).then(|| self.first_period(&chosen))
    }

    /// The splits that the records are long enough for, in words and as records with other purposes. Empty where there are no
    /// logs, or the experiment says itself what is held out.
    pub fn folds(&self) -> Vec<(&'static str, Self)> {
        let is_split_up = self.data.records.iter().filter_map(|record| record.log.as_ref()).any(|log| !log.has_role);
        if !is_split_up {
            return Vec::new();
        }
        StepSplit::ALL.into_iter().filter_map(|split| self.fold(split).map(|fold| (split.words(), fold))).collect()
    }

    fn fold(&self, split: StepSplit) -> Option<Self> {
        let mut fold = Self { is_part: true, ..self.clone() };
        let (mut fitted, mut held_out) = (0, 0);
        for (place, record) in self.data.records.iter().enumerate() {
            let Some(log) = record.log.as_ref().filter(|log| !log.has_role) else { continue };
            let RecordWeights::Plateaus(own) = &*self.weights[record.place] else { continue };
            let assigned =
                own.assigned(|group| if is_fitted(split, log, place, group) { Split::Train } else { Split::Holdout });
            fitted += assigned.count(Split::Train);
            held_out += assigned.count(Split::Holdout);
            fold.weights[record.place] = Arc::new(RecordWeights::Plateaus(assigned));
        }
        (fitted >= LEAST_GROUPS && held_out >= LEAST_GROUPS).then_some(fold)
    }
}
