//! What is compared: measured bandwidths, and those of a model with one more effect.

use num_complex::Complex64;
use rotorlead::design::LeadParameters;
use rotorlead_identify::bandwidth_of;
use rotorlead_plant::effect::{Kind, Part, Site};
use rotorlead_plant::{ActiveEffect, LinearChain, Model, OperatingCurve, OperatingPoint, RotorBase};

use super::table::{BandwidthTable, Column};
use crate::DiagnoseError;

/// Highest frequency that is searched for a bandwidth, rad/s; far above what a propeller follows.
const SEARCHED_UP_TO_RAD_S: f64 = 1e4;

/// One nominal command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// The model there.
    pub point: OperatingPoint,
    /// Measured bandwidths, in the order of [`Column::ALL`].
    pub measured: [Option<f64>; 2],
    /// Those of the model as it was given.
    pub simulated: [f64; 2],
}

/// The table beside the model.
pub(super) struct Case<'a> {
    pub rows: Vec<Row>,
    /// The model's own effects.
    effects: Vec<ActiveEffect>,
    lead: &'a LeadParameters,
    /// The column that numbers are fitted to.
    pub fitted: Column,
}

impl<'a> Case<'a> {
    pub(super) fn new(
        table: &BandwidthTable,
        model: &Model,
        lead: &'a LeadParameters,
        fitted: Column,
    ) -> Result<Self, DiagnoseError> {
        let mut case = Self { rows: Vec::new(), effects: ActiveEffect::of_model(model)?, lead, fitted };
        for row in &table.rows {
            let point = OperatingCurve::around_without_effects(model, row.nominal)?;
            let simulated = |column: Column| {
                case.bandwidth(point, None, column).ok_or(DiagnoseError::NoBandwidth {
                    nominal: row.nominal,
                    column: column.word(),
                    limit_rad_s: SEARCHED_UP_TO_RAD_S,
                })
            };
            let simulated = [simulated(Column::Uncompensated)?, simulated(Column::Compensated)?];
            case.rows.push(Row { point, measured: row.measured_rad_s, simulated });
        }
        Ok(case)
    }

    /// Whether the model has such an effect already.
    pub(super) fn has(&self, kind: &Kind) -> bool {
        self.effects.iter().any(|effect| effect.kind() == kind)
    }

    /// Bandwidth in rad/s with one more effect; `None` where its values are impossible or nothing is 3 dB down.
    pub(super) fn predicted(&self, row: &Row, column: Column, kind: &'static Kind, values: &[f64]) -> Option<f64> {
        let added = ActiveEffect::new(kind, values.to_vec()).ok()?;
        self.bandwidth(row.point, Some(added), column)
    }

    fn bandwidth(&self, mut point: OperatingPoint, added: Option<ActiveEffect>, column: Column) -> Option<f64> {
        let mut effects = self.effects.clone();
        match added {
            // Other numbers of the lag are those that the model's own effects see, too.
            Some(added) if added.kind().site == Site::Base => {
                if let Part::Base { gain, time_constant } = added.part(&RotorBase::Linear(point)) {
                    point.lag.gain *= gain;
                    point.lag.time_constant_s *= time_constant;
                }
            }
            Some(added) => effects.push(added),
            None => {}
        }
        let chain = LinearChain::new(point, effects);
        let response = |omega: f64| {
            let filter = match column {
                Column::Uncompensated => Complex64::ONE,
                Column::Compensated => self.lead.response(omega),
            };
            filter * chain.frequency_response(omega)
        };
        bandwidth_of(response, SEARCHED_UP_TO_RAD_S).rad_s()
    }

    /// Rows with a value in the fitted column.
    pub(super) fn fitted_rows(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.measured[self.fitted as usize].is_some())
    }

    /// Rows that confirm: with a value in both columns, so that every explanation has something to say of them.
    pub(super) fn held_out_rows(&self) -> impl Iterator<Item = (usize, &Row)> {
        self.rows.iter().enumerate().filter(|(_, row)| row.measured.iter().all(Option::is_some))
    }
}

impl Row {
    /// `ln(measured / simulated)` of the model as it was given.
    pub(super) fn gap(&self, column: Column) -> Option<f64> {
        self.measured[column as usize].map(|measured| (measured / self.simulated[column as usize]).ln())
    }
}
