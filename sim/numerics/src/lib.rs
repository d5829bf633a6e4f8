//! Numerical methods that the crates above share: nonlinear least squares, extremes of functions of one variable,
//! colored noise, and statistics of samples. Each is here once, and tested against published reference values.

pub mod autoregression;
pub mod extremum;
pub mod least_squares;
pub mod linear;
pub mod normal_equations;
pub mod sample;
pub mod statistics;
