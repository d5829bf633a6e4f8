//! The actuators that are compared: what stands between the flight controller's command and the ESC.

use num_complex::Complex64;
use rotorlead::compensator::Compensator;
use rotorlead::throttle::Command;
use rotorlead_design::{DesignOptions, InverseOptions, design, design_inverse};
use rotorlead_plant::{CompensatorDesign, Model};
use serde::Serialize;

use crate::airframe::Airframe;
use crate::rotor::Rotor;
use crate::{TICK_HZ, VehicleError};

/// What stands before the ESC.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MotorControlKind {
    /// Nothing.
    None,
    /// The paper's compensator, with one zero.
    Lead,
    /// The conditioned inverse.
    Inverse {
        /// Natural frequency of its reference model, rad/s.
        omega_f_rad_s: f64,
    },
    /// A controller of the rotor's measured speed.
    SpeedFeedback {
        /// Its pole at hover, rad/s.
        pole_rad_s: f64,
    },
}

impl MotorControlKind {
    /// Whether it measures the rotor.
    #[must_use]
    pub fn needs_a_sensor(self) -> bool {
        matches!(self, Self::SpeedFeedback { .. })
    }

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::None => "none".to_owned(),
            Self::Lead => "lead".to_owned(),
            Self::Inverse { omega_f_rad_s } => format!("inverse {omega_f_rad_s:.0}"),
            Self::SpeedFeedback { pole_rad_s } => format!("speed loop {pole_rad_s:.0}"),
        }
    }
}

/// An actuator as it is designed for a model.
#[derive(Clone, Debug)]
pub struct MotorControl {
    /// Which one.
    pub kind: MotorControlKind,
    design: Design,
    range: (f64, f64),
}

#[derive(Clone, Debug)]
enum Design {
    None,
    Compensator(Box<CompensatorDesign>),
    /// `u = r + gain (r - v)`.
    SpeedFeedback {
        gain: f64,
    },
}

/// An actuator, or why there is none: its kind, and the reason.
pub type MotorControlResult = Result<MotorControl, (MotorControlKind, String)>;

/// Every actuator that `airframe` compares, the bare one first. A compensator that cannot be designed from the model is refused
/// alone, as an inverse whose time constants are not known well enough.
///
/// # Errors
/// When the speed loop is none.
pub fn designed(airframe: &Airframe, model: &Model, rotor: &Rotor) -> Result<Vec<MotorControlResult>, VehicleError> {
    let options = &airframe.actuators;
    let range = (options.min, options.max);
    let plain = |kind, design| Ok(MotorControl { kind, design, range });
    let lead = match design(model, &DesignOptions { loop_rate_hz: TICK_HZ, ..DesignOptions::default() }) {
        Ok(lead) => plain(MotorControlKind::Lead, Design::Compensator(Box::new(lead.into()))),
        Err(error) => Err((MotorControlKind::Lead, error.to_string())),
    };
    let mut all = vec![plain(MotorControlKind::None, Design::None), lead];
    for &omega_f_rad_s in &options.inverse_rad_s {
        let kind = MotorControlKind::Inverse { omega_f_rad_s };
        let options = InverseOptions {
            omega_f_rad_s: Some(omega_f_rad_s),
            loop_rate_hz: TICK_HZ,
            range,
            // Over the whole range: what is assumed beyond the measured commands is what the rotor here does.
            compensated: Some((0.0, 1.0)),
            ..InverseOptions::default()
        };
        all.push(match design_inverse(model, &options) {
            Ok(inverse) => plain(kind, Design::Compensator(Box::new(inverse.compensator.into()))),
            Err(error) => Err((kind, error.to_string())),
        });
    }
    let pole_rad_s = options.speed_loop_rad_s;
    let motor_rad_s = rotor.pole_rad_s(airframe.hover.command);
    if pole_rad_s <= motor_rad_s {
        return Err(VehicleError::SlowSpeedLoop { loop_rad_s: pole_rad_s, motor_rad_s });
    }
    // Chosen: a fourth of 2 per tick, from which on sampling makes the loop unstable; up to here it decays much as a lag does.
    if pole_rad_s > 0.5 * TICK_HZ {
        return Err(VehicleError::FastSpeedLoop { loop_rad_s: pole_rad_s });
    }
    let gain = pole_rad_s / motor_rad_s - 1.0;
    all.push(plain(MotorControlKind::SpeedFeedback { pole_rad_s }, Design::SpeedFeedback { gain }));
    Ok(all)
}

impl MotorControl {
    /// None, of an ESC that gets commands from the first to the second.
    #[must_use]
    pub fn bare(range: (f64, f64)) -> Self {
        Self { kind: MotorControlKind::None, design: Design::None, range }
    }

    /// A compensator of that kind.
    #[must_use]
    pub fn compensated(kind: MotorControlKind, compensator: CompensatorDesign, range: (f64, f64)) -> Self {
        Self { kind, design: Design::Compensator(Box::new(compensator)), range }
    }

    /// Small-signal response at 5 kHz from the flight controller's command to that of the ESC, at the operating point `nominal` of
    /// `rotor`. The filters have their rounded coefficients.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64, nominal: f64, rotor: &Rotor) -> Complex64 {
        let z = Complex64::cis(omega_rad_s / TICK_HZ);
        match &self.design {
            Design::None => Complex64::ONE,
            Design::Compensator(design) => design.response(nominal, omega_rad_s),
            Design::SpeedFeedback { gain } => {
                // v' = v + a (u - v) with u = r + gain (r - v).
                let part = -(-rotor.pole_rad_s(nominal) / TICK_HZ).exp_m1();
                let speed = part * (1.0 + gain) / (z - 1.0 + part * (1.0 + gain));
                1.0 + gain - gain * speed
            }
        }
    }

    /// The actuator in operation, at rest at `level`.
    #[must_use]
    pub fn started(&self, level: f64) -> MotorControlState {
        let command = Command::saturating_from_f64;
        let path = match &self.design {
            Design::None => Path::None,
            Design::Compensator(design) => {
                let (min, max) = self.range;
                let mut compensator = Compensator::new(design.filter(), command(min), command(max));
                compensator.reset(command(level));
                Path::Compensator(Box::new(compensator))
            }
            Design::SpeedFeedback { gain } => Path::SpeedFeedback(*gain),
        };
        MotorControlState { path, range: self.range }
    }
}

/// An actuator in operation, on one motor.
#[derive(Debug)]
pub struct MotorControlState {
    path: Path,
    range: (f64, f64),
}

#[derive(Debug)]
enum Path {
    None,
    Compensator(Box<Compensator>),
    SpeedFeedback(f64),
}

impl MotorControlState {
    /// One tick of 5 kHz: takes the flight controller's command and the rotor's state, returns the ESC's command. The state is used
    /// by the speed loop alone.
    #[must_use]
    pub fn update(&mut self, input: f64, rotor_state: f64) -> f64 {
        let (min, max) = self.range;
        match &mut self.path {
            Path::None => input.clamp(min, max),
            Path::Compensator(compensator) => compensator.update(Command::saturating_from_f64(input)).to_f64(),
            Path::SpeedFeedback(gain) => (input + *gain * (input - rotor_state)).clamp(min, max),
        }
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::table_1;

    use super::*;

    fn all() -> (Rotor, Vec<MotorControl>) {
        let rotor = Rotor::new(&table_1()).unwrap();
        let all = designed(&Airframe::default(), &table_1(), &rotor).unwrap();
        (rotor, all.into_iter().map(Result::unwrap).collect())
    }

    #[test]
    fn the_response_is_that_of_the_code_that_runs() {
        let (rotor, all) = all();
        for (nominal, cycle_hz) in [(0.45, 5.0), (0.5, 10.0), (0.6, 25.0)] {
            let omega = std::f64::consts::TAU * cycle_hz;
            for actuator in &all {
                let mut running = actuator.started(nominal);
                let (mut v, ticks, settled) = (nominal, 10_000, 5_000);
                let (mut input, mut output) = (Complex64::ZERO, Complex64::ZERO);
                for tick in 0..ticks {
                    let turn = Complex64::cis(omega * f64::from(tick) / TICK_HZ);
                    let r = nominal + 1e-3 * turn.im;
                    let u = running.update(r, v);
                    v = rotor.advanced(v, u, 1.0 / TICK_HZ);
                    if tick >= settled {
                        input += (r - nominal) * turn.conj();
                        output += (u - nominal) * turn.conj();
                    }
                }
                let (seen, expected) = (output / input, actuator.response(omega, nominal, &rotor));
                let off = (seen / expected - 1.0).norm();
                assert!(off < 0.02, "{:?} at {nominal}, {cycle_hz} Hz: {seen} is not {expected}", actuator.kind);
            }
        }
    }

    #[test]
    fn with_the_inverse_the_rotor_is_the_reference_model_everywhere() {
        let (rotor, all) = all();
        let inverse = all.iter().find(|one| one.kind == MotorControlKind::Inverse { omega_f_rad_s: 150.0 }).unwrap();
        for nominal in [0.40, 0.50, 0.65] {
            let lag = Complex64::new(1.0, 150.0 / rotor.pole_rad_s(nominal));
            // 1 / (2 zeta) at the natural frequency.
            let gain = (inverse.response(150.0, nominal, &rotor) / lag).norm();
            // Between its points the table is off by up to 2 %.
            assert!((gain / 0.5_f64.sqrt() - 1.0).abs() < 0.02, "{gain} at {nominal}");
        }
    }

    #[test]
    fn a_speed_loop_is_faster_than_the_motor_and_slower_than_its_ticks() {
        let rotor = Rotor::new(&table_1()).unwrap();
        let with = |speed_loop_rad_s: f64| {
            let mut airframe = Airframe::default();
            airframe.actuators.speed_loop_rad_s = speed_loop_rad_s;
            designed(&airframe, &table_1(), &rotor).map(|_| ())
        };
        assert!(matches!(with(9.0), Err(VehicleError::SlowSpeedLoop { .. })));
        assert!(matches!(with(5000.0), Err(VehicleError::FastSpeedLoop { .. })));
    }
}
