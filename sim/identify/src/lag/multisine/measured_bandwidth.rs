//! The bandwidth that each multisine record shows.

use serde::Serialize;

use crate::error::IdentifyError;
use crate::frequency_response::bandwidth::{EtfeBandwidth, StaticValue, compute_etfe_bandwidth};
use crate::lag::multisine::PeriodicIdentification;

/// The bandwidth of one record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredBandwidth {
    /// The record.
    pub file: String,
    /// The command around which it was run, 0..1.
    pub nominal: f64,
    /// Whether a compensator was in front of the ESC.
    pub compensated: bool,
    /// On the ETFE as the rows show it, holds and compensator included, with its 95 % interval.
    #[serde(flatten)]
    pub bandwidth: EtfeBandwidth,
}

impl PeriodicIdentification {
    /// The bandwidths of all multisine records, by nominal command. The static value is the gain of the lag identified
    /// at that command, with its standard error; `resamples` draws from `seed` give the intervals.
    ///
    /// # Errors
    /// Those of [`compute_etfe_bandwidth`].
    pub fn bandwidths(&self, resamples: usize, seed: u64) -> Result<Vec<MeasuredBandwidth>, IdentifyError> {
        let mut measured = Vec::new();
        for nominal in &self.nominals {
            let gain = nominal.fit.gain;
            let static_value = StaticValue::Estimated { value: gain.value, std: gain.std };
            for response in &nominal.responses {
                measured.push(MeasuredBandwidth {
                    file: response.spectrum.file.clone(),
                    nominal: nominal.nominal,
                    compensated: response.compensated,
                    bandwidth: compute_etfe_bandwidth(&response.etfe, static_value, resamples, seed)?,
                });
            }
        }
        Ok(measured)
    }
}
