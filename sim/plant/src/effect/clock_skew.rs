//! Two clocks.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};

/// What it is called in files.
pub const ID: &str = "clock_skew";

/// The logger's clock runs differently from the controller's.
pub static KIND: Kind = Kind {
    id: ID,
    title: "skew between the clocks of controller and logger",
    site: Site::Logger,
    equation: "the response stamped t (from the record's first row) is that of t (1 + 1e-6 skew_ppm) on the controller's clock, \
               which the commands keep to",
    parameters: &[Parameter::fitted("skew_ppm", "ppm", "how much slower the logger's clock is than the controller's")
        .possible(-1e5, 1e5)
        .linear(-3000.0, 3000.0, &[-300.0, 300.0])
        .smooth()],
    signature: "A phase that grows with frequency and with the time in the record: late periods lead (or lag) early ones in \
                proportion to the frequency.",
    confusions: &[Confusion {
        with: super::transport_delay::ID,
        recipe: &Recipe::LONG,
        experiment: "Compare early and late periods of a long record: a delay stays, skew grows from nothing.",
    }],
    remedy: "a fault of the logging, not of the motor: stamp commands and responses with one clock, and record again",
    sources: &["crystals differ by 10 to 100 ppm, ceramic resonators and RC oscillators by up to 2000"],
    linearity: Linearity::Absent,
    shows: Shows::BetweenClocks,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        skew_ppm => Part::Clock { skew: 1e-6 * skew_ppm },
    },
    response: Kind::unity,
};
