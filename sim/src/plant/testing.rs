//! Models for tests.

use super::{Lag, Model, Point};

/// A model with the given (nominal, gain, time constant, delay).
pub(crate) fn model(points: &[(f64, f64, f64, f64)]) -> Model {
    Model {
        format: 1,
        points: points
            .iter()
            .map(|&(nominal, gain, time_constant_s, delay_s)| {
                Point::new(nominal, Lag { gain, time_constant_s, delay_s })
            })
            .collect(),
        static_map: None,
        effects: Vec::new(),
        provenance: None,
    }
}

/// Table 1 of the paper, with the time constants as 1 / omega_s.
pub(crate) fn table_1() -> Model {
    model(&[
        (0.40, 9.9955, 1.0 / 6.2758, 0.0),
        (0.45, 10.4556, 1.0 / 7.3524, 0.0),
        (0.50, 10.1718, 1.0 / 9.2889, 0.0),
        (0.55, 10.9196, 1.0 / 9.9130, 0.0),
        (0.60, 13.4519, 1.0 / 11.7439, 0.0),
        (0.65, 16.1063, 1.0 / 14.1275, 0.0),
    ])
}
