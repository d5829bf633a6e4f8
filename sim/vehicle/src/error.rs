//! Why there is no comparison.

use miette::Diagnostic;
use rotorlead_plant::PlantError;
use thiserror::Error;

/// Why a vehicle is not simulated.
#[derive(Debug, Error, Diagnostic)]
pub enum VehicleError {
    /// The model is impossible.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(#[from] PlantError),
    /// More command, less thrust.
    #[error("the gain at command {nominal:.3} is {gain}: thrust has to rise with the command")]
    #[diagnostic(help(
        "give a model of the thrust whose gains are above 0; `rotorlead check` says where a sign is wrong"
    ))]
    FallingThrust {
        /// Command of the point.
        nominal: f64,
        /// Its gain.
        gain: f64,
    },
    /// The response of the model is a speed.
    #[error("the model is one of the motor's speed, and torque needs thrust")]
    #[diagnostic(help("identify with `--response thrust`: `rotorlead vehicle` needs newtons per unit of command"))]
    NotThrust,
    /// The vehicle hovers where the model says nothing.
    #[error("the vehicle hovers at {from} to {to}, and the model holds from {first} to {last}")]
    #[diagnostic(help(
        "choose `range` and `command` of [hover] within the model, or identify the motor at these commands too"
    ))]
    OutsideModel {
        /// Lowest hover command.
        from: f64,
        /// Highest hover command.
        to: f64,
        /// The model's first operating point.
        first: f64,
        /// Its last one.
        last: f64,
    },
    /// The speed loop is slower than the motor.
    #[error("the speed loop of {loop_rad_s} rad/s is not faster than the motor, {motor_rad_s:.2} rad/s at hover")]
    #[diagnostic(help("raise `speed_loop_rad_s` of [actuators]"))]
    SlowSpeedLoop {
        /// Pole asked for.
        loop_rad_s: f64,
        /// Pole of the motor.
        motor_rad_s: f64,
    },
    /// A speed loop that its own sampling makes unstable.
    #[error("the speed loop of {loop_rad_s} rad/s is too fast for a loop of 5 kHz")]
    #[diagnostic(help("lower `speed_loop_rad_s` of [actuators] below 2500 rad/s"))]
    FastSpeedLoop {
        /// Pole asked for.
        loop_rad_s: f64,
    },
    /// The hexarotor's rotors do not make six independent forces and torques.
    #[error("the hexarotor cannot make lateral force alone: its tilt and its drag cancel")]
    #[diagnostic(help("change `tilt_deg` or `drag_m` of [lateral]"))]
    NotFullyActuated,
}
