//! From records to linear models: spectra, frequency responses, fits and bandwidths.

mod advice;
pub mod alignment;
mod bandwidth;
mod broadband;
pub mod check;
mod distortion;
mod effects;
mod error;
mod estimate;
mod etfe;
mod even_rows;
mod feedback;
mod first_order;
mod fit_percent;
mod frequency_response;
mod hold;
mod identification;
mod measured;
mod noise;
mod noise_power;
pub mod parametric;
mod periodic;
mod sample;
mod saturation;
mod simulation;
mod spectra;
pub mod stand;
pub mod static_map;
pub mod steps;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
mod transient;
mod uncertainty;
mod validate;

pub use advice::with_advice;
pub use bandwidth::{
    Bandwidth, EtfeBandwidth, StaticValue, THREE_DB, bandwidth_of, bandwidth_of_etfe, first_frequency,
};
pub use broadband::{ChirpIdentification, ChirpResponse, identify_chirps, is_chirp_to_fit};
pub use distortion::{Distortion, DistortionLevel, RobustResponse, STRONG_DISTORTION_DB};
pub use effects::{commands_per_row, upsampled};
pub use error::IdentifyError;
pub use estimate::Estimate;
pub use etfe::{Etfe, ResponsePoint};
pub use first_order::{FirstOrderFit, FirstOrderOptions, FitLine, fit_first_order};
pub use fit_percent::{Sample, fit_percent};
pub use frequency_response::{FrequencyResponse, LocalPolynomial, LocalPolynomialOptions, ResponseLine};
pub use hold::{HoldChain, Image};
pub use identification::{Identification, IdentifyOptions, Lags, identify, step_record};
pub use measured::MeasuredBandwidth;
pub use noise::density;
pub use noise_power::{power_over_noise, times_noise};
pub use periodic::{
    IdentifyWarning, NominalIdentification, PeriodicIdentification, PeriodicOptions, RecordResponse, SquareValidation,
    identify_periodic,
};
pub use simulation::{align, run_actuator};
pub use simulation::{offset_and_start, start_of};
pub use spectra::response_of;
pub use spectra::{
    DisturbanceSign, DisturbedLine, Line, LongRecordError, NoiseSource, RemovedSinusoid, Spectrum, SpectrumOptions,
    UnexcitedLine,
};
pub use transient::TransientTest;
pub use validate::same_output;
pub use validate::{
    ComparedLines, ComparedRow, Comparison, Domain, FitBesideCeiling, LeftOver, RecordValidation, TableRow, table_2,
    validate,
};
