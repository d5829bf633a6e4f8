//! What the paper prints, to stand beside what comes out here.

use rotorlead_plant::{Lag, Model, Point};

/// One nominal command of the paper's tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperRow {
    /// Command around which the actuator was identified, 0..1.
    pub nominal: f64,
    /// Table 1: static gain, newtons per unit of command.
    pub gain: f64,
    /// Table 1: time constant, seconds, as printed (to four digits).
    pub time_constant_s: f64,
    /// Table 1: cut-off frequency `1 / tau`, rad/s.
    pub omega_s_rad_s: f64,
    /// Table 2: % fit of the frequency response.
    pub fit_frequency_percent: f64,
    /// Table 2: % fit on the square wave.
    pub fit_square_percent: f64,
    /// Table 3, simulated: bandwidth without and with compensator, rad/s.
    pub simulated_rad_s: (f64, f64),
    /// Table 3, measured on the stand: bandwidth without and with compensator, rad/s.
    pub measured_rad_s: (f64, f64),
}

const fn row(
    nominal: f64,
    (gain, time_constant_s, omega_s_rad_s): (f64, f64, f64),
    (fit_frequency_percent, fit_square_percent): (f64, f64),
    simulated_rad_s: (f64, f64),
    measured_rad_s: (f64, f64),
) -> PaperRow {
    PaperRow {
        nominal,
        gain,
        time_constant_s,
        omega_s_rad_s,
        fit_frequency_percent,
        fit_square_percent,
        simulated_rad_s,
        measured_rad_s,
    }
}

/// Tables 1 to 3 of Charla, Yao and Voyles.
pub const PAPER: [PaperRow; 6] = [
    row(0.40, (9.9955, 0.1593, 6.2758), (89.9012, 90.6762), (6.2609, 8.0404), (7.6139, 10.5564)),
    row(0.45, (10.4556, 0.1360, 7.3524), (89.0841, 90.9004), (7.3349, 10.8166), (9.0941, 33.5233)),
    row(0.50, (10.1718, 0.1077, 9.2889), (89.3366, 89.6856), (9.2668, 24.5323), (11.7689, 68.9652)),
    row(0.55, (10.9196, 0.1009, 9.9130), (79.3643, 88.3727), (9.8895, 41.4026), (14.4992, 72.9550)),
    row(0.60, (13.4519, 0.0852, 11.7439), (81.7859, 91.0912), (11.7161, 74.6290), (15.1641, 85.8608)),
    row(0.65, (16.1063, 0.0708, 14.1275), (91.5734, 95.0363), (14.0940, 94.1039), (14.7953, 97.1847)),
];

/// Where the paper contradicts itself, and which side this project takes.
pub const CONTRADICTIONS: [&str; 3] = [
    "Equation (10) prints 66.62 s in the denominator; (3) with (4) needs 2 zeta_f omega_f = 133.24. As printed, the \
     damping is 0.354 and the simulated compensated bandwidth at 0.50 would be 111.8 rad/s, where Table 3 has 24.53. \
     133.24 is used. Its numerator prints 628.46 s, where omega_f^2 / omega_z is 628.32.",
    "Equation (9) prints 16.6811 dB; (5) gives 16.4811 dB. Both are asymptotes: the true peak of |C| is 13.57 dB.",
    "Table 1's time constants are rounded too far to give its own Table 3: 1 / omega_s is used. The text says that \
     0.70 was identified too; no table has it.",
];

/// The actuator of Table 1, with `tau = 1 / omega_s`.
#[must_use]
pub fn table_1() -> Model {
    let point = |row: &PaperRow| {
        Point::new(row.nominal, Lag { gain: row.gain, time_constant_s: 1.0 / row.omega_s_rad_s, delay_s: 0.0 })
    };
    Model {
        format: 1,
        points: PAPER.iter().map(point).collect(),
        static_map: None,
        time_constant_curve: None,
        effects: Vec::new(),
        provenance: None,
    }
}
