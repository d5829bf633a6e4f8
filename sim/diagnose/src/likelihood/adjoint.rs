//! A residual run backward through the chain: what each moment of the command had to do with it.
//!
//! With the white residual `z` and the filter `F` from command to white response, the inner product of `z` with the white
//! response to any signal `x` is `sum x_n g_n`, where `g` is the inverse transform of `conj(F) z`. Signals that are functions of
//! time or of the command then have their products in one transform.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rotorlead_fourier as fourier;

use crate::data::dataset::{PreparedRecord, Segment};
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// The residual of one record, run backward.
pub(crate) struct Adjoint<'a> {
    /// Its segment of the record: the fitted one, or else the held-out one.
    pub segment: &'a Segment,
    /// `g`, by row of the segment, for a signal that is an impulse at each row: of unit area times its number, command times
    /// seconds.
    pub g: Vec<f64>,
    /// Inner products of the white responses to two such impulses, by the rows between them.
    pub lags: Vec<f64>,
}

impl<'a> Adjoint<'a> {
    /// Of what is fitted or else of what is held out.
    pub fn new(likelihood: &'a Likelihood, record: &'a PreparedRecord, hypothesis: &Hypothesis) -> Option<Self> {
        Self::for_split(likelihood, record, hypothesis, record.segments.first()?.split)
    }

    /// The same of what is in a split. `None` where nothing is.
    pub fn for_split(
        likelihood: &'a Likelihood,
        record: &'a PreparedRecord,
        hypothesis: &Hypothesis,
        split: Split,
    ) -> Option<Self> {
        let (segment, whitening) = likelihood.periodic(record)?.segments(split).next()?;
        let white = likelihood.residual(record, hypothesis, split)?;
        let rows = segment.rows.len();
        let weights = whitening.weights();
        // The rate of rows turns an impulse of unit area into its samples.
        let filter = |line: usize| {
            let omega = TAU * line as f64 * record.rate_hz / rows as f64;
            hypothesis.frequency_response(record, omega) * (weights[line] * record.rate_hz)
        };
        let mut g = vec![Complex64::ZERO; rows];
        let mut lags = vec![Complex64::ZERO; rows];
        for (index, z) in white.iter().enumerate().take(rows / 2) {
            let line = index + 1;
            let filter = filter(line);
            // Half to either side of the mirror.
            g[line] = 0.5 * filter.conj() * z;
            g[rows - line] = g[line].conj();
            lags[line] = Complex64::from(0.5 * filter.norm_sqr());
            lags[rows - line] = lags[line];
        }
        let inverse = fourier::inverse(rows);
        inverse.process(&mut g);
        inverse.process(&mut lags);
        let real = |all: Vec<Complex64>| all.into_iter().map(|value| value.re).collect();
        Some(Self { segment, g: real(g), lags: real(lags) })
    }

    /// Whether it is of what is fitted.
    pub fn is_fitted(&self) -> bool {
        self.segment.split == Split::Train
    }
}

/// The command applied at each row of a segment, and before the first, as the clock of `hypothesis` has it.
pub(crate) fn applied(record: &PreparedRecord, segment: &Segment, hypothesis: &Hypothesis) -> (f64, Vec<f64>) {
    let (clock, last) = (hypothesis.clock(record), record.command.len() - 1);
    let at = |row: usize| {
        let place = (clock * row as f64).round() as usize * record.commands_per_row;
        record.command[place.min(last)]
    };
    let first = segment.rows.start;
    let before = if first > 0 { at(first - 1) } else { record.nominal };
    (before, segment.rows.clone().map(at).collect())
}
