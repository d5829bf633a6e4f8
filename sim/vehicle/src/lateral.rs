//! Lateral force of a fully actuated hexarotor: the force follows its command through the actuators alone.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix6, SVector};
use serde::Serialize;

use crate::airframe::{Airframe, Lateral};
use crate::motor_control::{MotorControl, MotorControlState};
use crate::rotor::Rotor;
use crate::{TICK_HZ, VehicleError};

/// Periods of the sine that are compared, after as long as the transient takes. Chosen: settled periods are alike, so that one would do;
/// more only take time.
const PERIODS: f64 = 4.0;
/// For how long a step is simulated, and a sine before it is compared, seconds. Chosen: 12 of the longest time constants of Table 1, 0.16
/// s, after which `e^-12`, 6e-6, is left; a slower motor counts as not rising.
const TRANSIENT_S: f64 = 2.0;
/// From which part of the step to which the rise is counted. Standard: the reference levels of IEEE Std 181.
pub(crate) const RISE: (f64, f64) = (0.1, 0.9);

/// What one actuator makes of lateral force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ForcePerformance {
    /// Rise of a step from 10 to 90 %, seconds; `None` where it does not get there.
    pub rise_s: Option<f64>,
    /// RMS of the tracking error of the sine over the RMS of the sine.
    pub tracking_error: f64,
}

/// The thrusts that make one newton of lateral force and nothing else, and what each newton of thrust gives of it.
#[derive(Clone, Copy, Debug)]
pub struct Allocation {
    /// Thrust of each rotor per newton of lateral force.
    thrust: [f64; 6],
    /// Lateral force per newton of each rotor's thrust.
    force: [f64; 6],
}

impl Allocation {
    /// Rotors at every 60 degrees, turned about their arms by the tilt, one way and the other in turn, and spinning one way and the
    /// other: the inverse of the matrix from six thrusts to force and torque.
    ///
    /// # Errors
    /// When the matrix has no inverse.
    pub fn new(lateral: &Lateral) -> Result<Self, VehicleError> {
        let (sin, cos) = lateral.tilt_deg.to_radians().sin_cos();
        let mut wrench = Matrix6::zeros();
        for rotor in 0..6 {
            let azimuth = PI / 3.0 * rotor as f64;
            let (y, x) = azimuth.sin_cos();
            let side = if rotor % 2 == 0 { 1.0 } else { -1.0 };
            let axis = nalgebra::Vector3::new(-side * sin * y, side * sin * x, cos);
            let arm = nalgebra::Vector3::new(x, y, 0.0) * lateral.arm_m;
            // Drag turns the body against the rotor.
            let torque = arm.cross(&axis) + side * lateral.drag_m * axis;
            wrench.fixed_view_mut::<3, 1>(0, rotor).copy_from(&axis);
            wrench.fixed_view_mut::<3, 1>(3, rotor).copy_from(&torque);
        }
        let inverse = wrench.try_inverse().ok_or(VehicleError::NotFullyActuated)?;
        let mut wanted = SVector::<f64, 6>::zeros();
        wanted[1] = 1.0;
        let thrust = inverse * wanted;
        // Of a singular matrix, rounding leaves an inverse that is none. Chosen: 1e-6 is far above the rounding of a good one, some 1e-15,
        // and far below that of none, about 1.
        let residual = (wrench * inverse - Matrix6::identity()).amax();
        if residual.is_nan() || residual > 1e-6 {
            return Err(VehicleError::NotFullyActuated);
        }
        Ok(Self { thrust: thrust.into(), force: std::array::from_fn(|rotor| wrench[(1, rotor)]) })
    }
}

/// The lateral force at every tick of 5 kHz, newtons, for the commanded force `command_n` of a time in seconds.
#[must_use]
pub fn force_n(
    airframe: &Airframe,
    rotor: &Rotor,
    actuator: &MotorControl,
    allocation: &Allocation,
    duration_s: f64,
    command_n: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let (nominal, range) = (airframe.hover.command, (airframe.actuators.min, airframe.actuators.max));
    let per_control = (TICK_HZ / airframe.controller.rate_hz).round() as usize;
    let hover_n = rotor.thrust_n(nominal);
    let mut motors: [(MotorControlState, f64); 6] = std::array::from_fn(|_| (actuator.started(nominal), nominal));
    let mut commands = [nominal; 6];
    let ticks = (duration_s * TICK_HZ).round() as usize;
    let step = |tick: usize| {
        if tick.is_multiple_of(per_control) {
            let force = command_n(tick as f64 / TICK_HZ);
            commands = allocation.thrust.map(|per_n| rotor.command_for(hover_n + per_n * force, range));
        }
        let mut force = 0.0;
        for (index, (running, v)) in motors.iter_mut().enumerate() {
            *v = rotor.advanced(*v, running.update(commands[index], *v), 1.0 / TICK_HZ);
            force += allocation.force[index] * (rotor.thrust_n(*v) - hover_n);
        }
        force
    };
    (0..ticks).map(step).collect()
}

/// Rise and tracking of the airframe's step and sine.
#[must_use]
pub fn performance(
    airframe: &Airframe,
    rotor: &Rotor,
    actuator: &MotorControl,
    lateral: &Lateral,
    allocation: &Allocation,
) -> ForcePerformance {
    let step = force_n(airframe, rotor, actuator, allocation, TRANSIENT_S, |_| lateral.step_n);
    let sine = |time_s: f64| lateral.sine_n * (TAU * lateral.sine_hz * time_s).sin();
    let duration_s = TRANSIENT_S + PERIODS / lateral.sine_hz;
    let followed = force_n(airframe, rotor, actuator, allocation, duration_s, sine);
    let compared = (TRANSIENT_S * TICK_HZ).round() as usize;
    let ends = followed.iter().enumerate().skip(compared);
    let (mut error, mut command) = (0.0, 0.0);
    for (tick, force) in ends {
        let wanted = sine((tick + 1) as f64 / TICK_HZ);
        error += (force - wanted) * (force - wanted);
        command += wanted * wanted;
    }
    ForcePerformance { rise_s: rise_s(&step, lateral.step_n), tracking_error: (error / command).sqrt() }
}

/// Time from the first tick at the lower part of a step to the first one at the upper part.
fn rise_s(response: &[f64], step: f64) -> Option<f64> {
    let first = |part: f64| response.iter().position(|force| *force >= part * step);
    Some((first(RISE.1)? - first(RISE.0)?) as f64 / TICK_HZ)
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::{model, table_1};

    use super::*;
    use crate::motor_control::{MotorControlKind, designed};

    fn lateral() -> Lateral {
        Airframe::default().lateral.unwrap()
    }

    fn force(nominal_model: &rotorlead_plant::Model, kind: MotorControlKind) -> ForcePerformance {
        let (airframe, rotor) = (Airframe::default(), Rotor::new(nominal_model).unwrap());
        let all = designed(&airframe, nominal_model, &rotor).unwrap();
        let actuator = all.into_iter().flatten().find(|one| one.kind == kind).unwrap();
        performance(&airframe, &rotor, &actuator, &lateral(), &Allocation::new(&lateral()).unwrap())
    }

    #[test]
    fn the_allocation_gives_one_newton_and_no_collective() {
        let allocation = Allocation::new(&lateral()).unwrap();
        let newtons: f64 = allocation.thrust.iter().zip(allocation.force).map(|(thrust, force)| thrust * force).sum();
        assert!((newtons - 1.0).abs() < 1e-12);
        assert!(allocation.thrust.iter().sum::<f64>().abs() < 1e-12, "the vertical force is left alone");
    }

    #[test]
    fn a_linear_rotor_rises_and_tracks_as_a_lag_does() {
        // Gain and pole do not depend on the command: the pole's time constant is 0.1 s from 0.4 to 0.7, where it stays.
        let linear =
            model(&[(0.2, 10.0, 0.1, 0.0), (0.4, 10.0, 0.1, 0.0), (0.7, 10.0, 0.1, 0.0), (0.9, 10.0, 0.1, 0.0)]);
        let found = force(&linear, MotorControlKind::None);
        assert!((found.rise_s.unwrap() - 0.1 * 9.0_f64.ln()).abs() < 4e-4, "{:?}", found.rise_s);
        // |1 - 1 / (1 + j x)|, and the hold of the controller's millisecond, which lags by half of one.
        let x = TAU * lateral().sine_hz * 0.1;
        let expected = x / 1.0_f64.hypot(x);
        assert!((found.tracking_error - expected).abs() < 0.005, "{} is not {expected}", found.tracking_error);
    }

    #[test]
    fn with_the_inverse_the_force_rises_as_the_reference_model() {
        // 2.15 / omega_f for a damping of 0.71.
        for omega_f_rad_s in [94.0, 150.0, 200.0] {
            let found = force(&table_1(), MotorControlKind::Inverse { omega_f_rad_s }).rise_s.unwrap();
            assert!((found * omega_f_rad_s / 2.15 - 1.0).abs() < 0.05, "{found} s at {omega_f_rad_s} rad/s");
        }
    }

    #[test]
    fn a_tilt_that_its_drag_undoes_is_refused() {
        let (tilt_deg, arm_m) = (20.0, 0.275);
        // Yaw torque of the tilt, arm sin, against that of the drag, drag cos: none is left.
        let drag_m = -arm_m * (tilt_deg * PI / 180.0).tan();
        assert!(Allocation::new(&Lateral { drag_m, tilt_deg, arm_m, ..lateral() }).is_err());
    }
}
