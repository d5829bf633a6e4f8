//! A vehicle, drawn from a seed.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::flight::gaussian;
use crate::motor::Motor;
use crate::pilot::Style;

/// Gravity, m/s^2.
pub const GRAVITY: f64 = 9.81;
/// Share by which motors of one make differ in inertia and resistance.
const UNLIKE: f64 = 0.015;

/// All that is drawn.
#[derive(Clone, Debug)]
pub struct Vehicle {
    /// The motors: front right, back left, back right, front left.
    pub motors: [Motor; 4],
    /// Open-circuit voltage at the beginning and at the end, volts.
    pub open_voltage_v: (f64, f64),
    /// Resistance of battery and leads, ohms.
    pub battery_resistance: f64,
    /// Mass, kg.
    pub mass: f64,
    /// Distance of a rotor from each of the two axes, m.
    pub arm: f64,
    /// Moments of inertia about roll, pitch and yaw, kg m^2.
    pub inertia: [f64; 3],
    /// Command that hovers.
    pub hover: f64,
    /// Time constant of the rate loop's plant at hover, s: what the controller is tuned by.
    pub hover_time_constant_s: f64,
    /// Crossover of the rate loop, rad/s.
    pub crossover: f64,
    /// RMS of the gyroscopes' noise at the loop rate, rad/s.
    pub gyro_noise: f64,
    /// Corner of the gyroscopes' filter and of that of the D term, Hz.
    pub filters_hz: (f64, f64),
    /// RMS of the gust that all rotors have, and of that of each of its own, m/s.
    pub gusts: (f64, f64),
    /// Dead time of the ESC, s.
    pub dead_time_s: f64,
    /// Relative RMS of a report's noise.
    pub jitter: f64,
    /// Share of reports that are lost.
    pub lost: f64,
    /// Loops between two reports.
    pub report_every: usize,
    /// Loops between two rows of the log.
    pub log_every: usize,
    /// Whether the log has the voltage, and the time constant of its filter, s.
    pub voltage_filter_s: Option<f64>,
    /// How it is flown.
    pub style: Style,
    /// How long, s.
    pub lasts_s: f64,
}

impl Vehicle {
    /// The vehicle, pilot and logger of a seed.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let mass = between(0.35, 0.9);
        let hover_speed = between(1000.0, 1800.0);
        let thrust = mass * GRAVITY / 4.0 / hover_speed.powi(2);
        // Torque over thrust of propellers of five inches, and what a climb takes off.
        let drag = thrust * between(0.009, 0.014);
        let thrust_inflow = thrust * hover_speed * between(0.03, 0.05);
        let drag_inflow = drag * hover_speed * between(0.012, 0.025);
        let torque_constant = between(0.004, 0.007);
        let hover_time_constant_s = between(0.018, 0.07);
        // Of the two torques that brake a motor, the share of the propeller at hover.
        let share = between(0.15, 0.5);
        let of_propeller = 2.0 * drag * hover_speed;
        let of_windings = of_propeller * (1.0 - share) / share;
        let resistance = torque_constant.powi(2) / of_windings;
        let inertia = hover_time_constant_s * (of_propeller + of_windings);
        let hover = between(0.22, 0.42);
        let needed_v = torque_constant * hover_speed + resistance / torque_constant * drag * hover_speed.powi(2);
        let voltage = needed_v / hover;
        let arm = between(0.06, 0.11);
        let frame = mass * arm.powi(2) * between(0.4, 0.7);
        let crossover = between(0.45, 0.85) / (hover_time_constant_s + 0.006);
        let (gyro_noise, filters_hz) = (between(0.05, 0.25), (between(90.0, 200.0), between(60.0, 100.0)));
        let gusts = (between(0.2, 1.2), between(0.05, 0.4));
        let dead_time_s = between(0.0004, 0.0015);
        let jitter = between(0.0005, 0.002);
        let lost = between(0.0, 0.04);
        let sag = between(0.06, 0.16);
        let emptied = between(0.02, 0.1);
        let (which, telemetry, logger, filter) =
            (between(0.0, 1.0), between(0.0, 1.0), between(0.0, 3.0), between(0.02, 0.5));
        let lasts_s = between(40.0, 75.0);
        let style = match which {
            x if x < 0.25 => Style::Hover,
            x if x < 0.55 => Style::Cruise,
            x if x < 0.8 => Style::Freestyle,
            _ => Style::Chirp,
        };
        let mut motor = |_| Motor {
            torque_constant,
            resistance: resistance * (1.0 + UNLIKE * gaussian(rng)),
            inertia: inertia * (1.0 + UNLIKE * gaussian(rng)),
            drag,
            drag_inflow,
            thrust,
            thrust_inflow,
        };
        let motors = [0, 1, 2, 3].map(&mut motor);
        let full_a = {
            let full = motors[0].steady_speed(1.0, voltage);
            motors[0].current_a(1.0, voltage, full)
        };
        Self {
            motors,
            open_voltage_v: (voltage * (1.0 + 0.5 * emptied), voltage * (1.0 - 0.5 * emptied)),
            battery_resistance: sag * voltage / (4.0 * full_a),
            mass,
            arm,
            inertia: [frame, 1.2 * frame, 2.0 * frame],
            hover,
            hover_time_constant_s,
            crossover,
            gyro_noise,
            filters_hz,
            gusts,
            dead_time_s,
            jitter,
            lost,
            report_every: if telemetry < 0.12 { 16 + (200.0 * telemetry) as usize } else { 1 },
            log_every: [8, 4, 2][logger as usize],
            voltage_filter_s: (filter > 0.1).then_some(filter),
            style,
            lasts_s: if style == Style::Chirp { 50.0 } else { lasts_s },
        }
    }

    /// The truth: the time constant of small motions of a motor at a command and a supply voltage, the others as fast, s. From
    /// `J dx/dt = K/R (u v - K x) - 2 drag w x` with the voltage `v` that its own current takes from the battery.
    #[must_use]
    pub fn time_constant_s(&self, motor: usize, command: f64, voltage_v: f64) -> f64 {
        let it = &self.motors[motor];
        let speed = it.steady_speed(command, voltage_v);
        let share = self.battery_resistance * command.powi(2) / it.resistance;
        let back = it.torque_constant.powi(2) / it.resistance * (1.0 - share / (1.0 + 4.0 * share));
        it.inertia / (back + 2.0 * it.drag * speed)
    }
}
