//! From records to linear models: spectra, frequency responses, fits and bandwidths.

mod error;
mod estimate;
mod etfe;
mod first_order;
mod hold;
mod noise;
mod spectra;
mod statistics;
mod transient;

pub use error::IdentifyError;
pub use estimate::Estimate;
pub use etfe::{Etfe, ResponsePoint};
pub use first_order::{FirstOrderFit, FirstOrderOptions, FitLine, fit_first_order};
pub use hold::{HoldChain, Image};
pub use spectra::{Line, NoiseSource, Spectrum, SpectrumOptions};
pub use transient::TransientTest;
