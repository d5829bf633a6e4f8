//! From records to linear models: spectra, frequency responses, fits and bandwidths.

pub mod alignment;
mod bandwidth;
mod error;
mod estimate;
mod etfe;
mod first_order;
mod fit_percent;
mod hold;
mod least_squares;
mod measured;
mod noise;
mod periodic;
mod simulation;
mod spectra;
pub mod static_map;
mod statistics;
pub mod steps;
mod transient;
mod validate;

pub use bandwidth::{Bandwidth, EtfeBandwidth, StaticValue, THREE_DB, bandwidth_of, bandwidth_of_etfe};
pub use error::IdentifyError;
pub use estimate::Estimate;
pub use etfe::{Etfe, ResponsePoint};
pub use first_order::{FirstOrderFit, FirstOrderOptions, FitLine, fit_first_order};
pub use fit_percent::{Sample, fit_percent};
pub use hold::{HoldChain, Image};
pub use measured::MeasuredBandwidth;
pub use periodic::{
    IdentifyWarning, NominalIdentification, PeriodicIdentification, PeriodicOptions, RecordResponse, SquareValidation,
    identify_periodic,
};
pub use simulation::{align, run_actuator};
pub use spectra::{Line, NoiseSource, Spectrum, SpectrumOptions};
pub use transient::TransientTest;
pub use validate::{Domain, RecordValidation, validate};
