//! The response at standstill is not the gain of the fitted lag.

use num_complex::Complex64;
use rotorlead_plant::effect::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};

/// A gain that differs between the static value, on which the 3 dB of a bandwidth are counted, and all frequencies that
/// the lag was fitted to: the limit of an infinitely slow change. A lower static gain makes the bandwidth larger without
/// any faster motion.
///
/// No link of a simulated chain: which slow thing it is, a bandwidth cannot say, so it is no kind of the catalog, and no
/// model has it. `supply_sag` is one such thing, with the law over the nominal command that a sag has.
pub(super) static KIND: Kind = Kind {
    id: "low_frequency_gain",
    title: "another static gain than that of the lag",
    site: Site::Supply,
    equation: "G(0) = K gain_ratio, G(s) = K / (tau s + 1) at the frequencies of the fit",
    parameters: &[Parameter::fitted("gain_ratio", "", "static gain over that of the fitted lag")
        .null(1.0)
        .possible(0.0, 20.0)
        .linear(0.5, 1.4, &[0.9, 1.1])],
    signature: "Bandwidths that are all larger (or smaller) than the lag's; the response at and above the pole is the lag's.",
    confusions: &[
        Confusion {
            with: "parameter_error",
            experiment: "Excite down to a hundredth of the pole: a static gain of its own is a step of the magnitude below the \
                         pole, a wrong time constant moves the pole and leaves the level below it flat.",
        },
        Confusion { with: "supply_sag", experiment: "Log the voltage: only a sag shows in it." },
    ],
    sources: &[
        "Charla, Yao & Voyles, on their Table 2: the static gain from frequency response data has a high variance",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: |_| Ok(()),
    part: |_, _| Part::Nothing,
    response: |values, _, omega_rad_s| Complex64::from(if omega_rad_s == 0.0 { values[0] } else { 1.0 }),
};
