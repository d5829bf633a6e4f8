//! Motor parameters of simulators, read from their sources.

use std::f64::consts::TAU;

use super::definition::{Definition, StackParameter, definition};
use super::rotor::RPM;

/// A number of a simulator, which is written as `written` says.
const fn written(written: &'static str, definition: Definition) -> Definition {
    Definition { written: Some(written), ..definition }
}

/// N/(rad/s)^2 as N/(revolutions per second)^2.
const PER_RPS2: f64 = TAU * TAU;
/// N/(rad/s)^2 as N/rpm^2.
const PER_RPM2: f64 = RPM * RPM;

const ISAAC_LAB_SOURCE: &str =
    "isaac-sim/IsaacLab isaaclab_contrib/actuators/thruster.py and thruster_cfg.py of isaaclab 3.0.0 and 2.3.2.post1";
const ISAAC_LAB_RANGE: &str = "{name}=({low}, {high}),";

pub(super) const ISAAC_LAB: [Definition; 5] = [
    written(
        "{name}=(0.0, {value}),",
        definition(
            "thrust_range",
            "N",
            StackParameter::TopThrust,
            "commands and thrusts of one rotor are clipped to this interval, whose upper end is the thrust at the highest motor output",
            ISAAC_LAB_SOURCE,
        ),
    ),
    written(
        "{name}={value},",
        Definition {
            scale: 1.0 / TAU,
            ..definition(
                "max_thrust_rate",
                "rps/s",
                StackParameter::SpeedRate,
                "highest rate of the rotor speed sqrt(thrust/k), whatever the docstring's N/s says",
                ISAAC_LAB_SOURCE,
            )
        },
    ),
    written(
        ISAAC_LAB_RANGE,
        Definition {
            scale: PER_RPS2,
            // Standard: a smaller one is raised to it in silence. The other end is far above any rotor.
            bounds: Some((1e-6, 1e3)),
            ..definition(
                "thrust_const_range",
                "N/rps^2",
                StackParameter::MotorConstant,
                "thrust = k (revolutions per second)^2, k drawn from this interval for each rotor; below 1e-6 it is raised to 1e-6",
                ISAAC_LAB_SOURCE,
            )
        },
    ),
    written(
        ISAAC_LAB_RANGE,
        definition(
            "tau_inc_range",
            "s",
            StackParameter::TimeConstantUp,
            "time constant of the rotor speed while the thrust rises, drawn from this interval for each rotor",
            ISAAC_LAB_SOURCE,
        ),
    ),
    written(
        ISAAC_LAB_RANGE,
        definition(
            "tau_dec_range",
            "s",
            StackParameter::TimeConstantDown,
            "time constant of the rotor speed while the thrust falls, drawn from this interval for each rotor",
            ISAAC_LAB_SOURCE,
        ),
    ),
];

const AERIAL_GYM_SOURCE: &str = "ntnu-arl/aerial_gym_simulator aerial_gym/control/motor_model.py at 0f446332 and \
                                 aerial_gym/config/robot_config/base_quad_config.py, version 2.0.0";
const AERIAL_GYM_RANGE: &str = "{name}_min = {low}\n{name}_max = {high}";

pub(super) const AERIAL_GYM: [Definition; 5] = [
    written(
        AERIAL_GYM_RANGE,
        Definition {
            scale: PER_RPS2,
            ..definition(
                "motor_thrust_constant",
                "N/rps^2",
                StackParameter::MotorConstant,
                "thrust = k (revolutions per second)^2, k drawn from this interval for each rotor",
                AERIAL_GYM_SOURCE,
            )
        },
    ),
    written(
        AERIAL_GYM_RANGE,
        definition(
            "motor_time_constant_increasing",
            "s",
            StackParameter::TimeConstantUp,
            "time constant of the rotor speed (use_rps = True) while the thrust rises, drawn from this interval for each rotor",
            AERIAL_GYM_SOURCE,
        ),
    ),
    written(
        AERIAL_GYM_RANGE,
        definition(
            "motor_time_constant_decreasing",
            "s",
            StackParameter::TimeConstantDown,
            "time constant of the rotor speed (use_rps = True) while the thrust falls, drawn from this interval for each rotor",
            AERIAL_GYM_SOURCE,
        ),
    ),
    definition(
        "max_thrust",
        "N",
        StackParameter::TopThrust,
        "commands of one rotor are clipped to it",
        AERIAL_GYM_SOURCE,
    ),
    Definition {
        scale: 1.0 / TAU,
        ..definition(
            "max_thrust_rate",
            "rps/s",
            StackParameter::SpeedRate,
            "highest rate of the rotor speed sqrt(thrust/k) with use_rps = True; N/s without",
            AERIAL_GYM_SOURCE,
        )
    },
];

const CRAZYFLOW_SOURCE: &str = "learnsyslab/crazyflow crazyflow/dynamics/first_principles/dynamics.py and params.toml of crazyflow 0.4.0; the law is \
                                that of 026350dd";

pub(super) const CRAZYFLOW: [Definition; 4] = [
    written(
        "rotor_dyn_coef = [{value}, 0.0,",
        definition(
            "rotor_dyn_coef[0]",
            "1/s",
            StackParameter::RateUp,
            "a of d(rpm)/dt = a (command - rpm) + b (command^2 - rpm^2) while the speed rises: 1 / time constant, with b = 0",
            CRAZYFLOW_SOURCE,
        ),
    ),
    written(
        "                  {value}, 0.0]",
        definition(
            "rotor_dyn_coef[2]",
            "1/s",
            StackParameter::RateDown,
            "c of the same law while the speed falls: 1 / time constant, with d = 0",
            CRAZYFLOW_SOURCE,
        ),
    ),
    written(
        "rpm2thrust = [0.0, 0.0, {value}]",
        Definition {
            scale: PER_RPM2,
            ..definition(
                "rpm2thrust[2]",
                "N/rpm^2",
                StackParameter::MotorConstant,
                "thrust of one rotor = rpm2thrust[0] + rpm2thrust[1] rpm + rpm2thrust[2] rpm^2",
                CRAZYFLOW_SOURCE,
            )
        },
    ),
    definition(
        "thrust_max",
        "N",
        StackParameter::TopThrust,
        "highest thrust of one rotor; since 0.4.0 commands are clipped to the speed that has it",
        CRAZYFLOW_SOURCE,
    ),
];

const ROTORPY_SOURCE: &str =
    "spencerfolk/rotorpy rotorpy/vehicles/multirotor.py at 0375b1e5 and hummingbird_params.py, rotorpy 3.0.0";

pub(super) const ROTORPY: [Definition; 3] = [
    definition(
        "tau_m",
        "s",
        StackParameter::TimeConstant,
        "time constant of the first-order lag of the rotor speed, both directions alike",
        ROTORPY_SOURCE,
    ),
    definition(
        "k_eta",
        "N/(rad/s)^2",
        StackParameter::MotorConstant,
        "thrust of one rotor = k_eta (rotor speed)^2",
        ROTORPY_SOURCE,
    ),
    definition(
        "rotor_speed_max",
        "rad/s",
        StackParameter::TopSpeed,
        "commands and rotor speeds are clipped to it",
        ROTORPY_SOURCE,
    ),
];

pub(super) const GYM_PYBULLET_DRONES: [Definition; 1] = [Definition {
    scale: PER_RPM2,
    ..definition(
        "kf",
        "N/rpm^2",
        StackParameter::MotorConstant,
        "thrust of one rotor = kf rpm^2; an attribute of <properties> in the vehicle's URDF",
        "utiasDSL/gym-pybullet-drones gym_pybullet_drones/envs/BaseAviary.py at 00ca90a9 and assets/cf2x.urdf at 19f3a9df",
    )
}];

const PX4_SIH_SOURCE: &str =
    "PX4/PX4-Autopilot src/modules/simulation/simulator_sih/sih_params.yaml at 1dfff54d and sih.cpp at 039af95d";

pub(super) const PX4_SIH: [Definition; 2] = [
    definition(
        "SIH_T_TAU",
        "s",
        StackParameter::TimeConstant,
        "time constant of the first-order lag of the motor signal, to which a quadcopter's thrust is proportional",
        PX4_SIH_SOURCE,
    ),
    definition(
        "SIH_T_MAX",
        "N",
        StackParameter::TopThrust,
        "thrust of one propeller at the full motor signal",
        PX4_SIH_SOURCE,
    ),
];

const MUJOCO_SOURCE: &str =
    "google-deepmind/mujoco src/engine/engine_forward.c at 0041fdcb and doc/XMLreference.rst of mujoco 4.0.0";

pub(super) const MUJOCO: [Definition; 4] = [
    definition(
        "dynprm",
        "s",
        StackParameter::TimeConstant,
        "time constant of the activation, a share of the full thrust, by the filter `filterexact`",
        MUJOCO_SOURCE,
    ),
    definition(
        "gainprm",
        "N",
        StackParameter::TopThrust,
        "force at a full activation: ctrl is the wanted thrust over it",
        MUJOCO_SOURCE,
    ),
    definition(
        "delay",
        "s",
        StackParameter::DeadTime,
        "dead time of ctrl, in whole steps of the simulation (since 3.5.0)",
        MUJOCO_SOURCE,
    ),
    Definition {
        is_integer: true,
        ..definition(
            "nsample",
            "1",
            StackParameter::DeadTimeSteps,
            "steps that the delay holds, delay = nsample timestep",
            MUJOCO_SOURCE,
        )
    },
];

const FLIGHTMARE_SOURCE: &str = "uzh-rpg/flightmare flightlib/src/dynamics/quadrotor_dynamics.cpp at 05014828 and src/objects/quadrotor.cpp at 082a3cc7";

pub(super) const FLIGHTMARE: [Definition; 3] = [
    Definition {
        // Standard: setMotortauInv refuses a rate below 1/s. A time constant of 0 has no rate.
        bounds: Some((f64::MIN_POSITIVE, 1.0)),
        ..definition(
            "motor_tau",
            "s",
            StackParameter::TimeConstant,
            "time constant of the first-order lag of the rotor speed, both directions alike",
            FLIGHTMARE_SOURCE,
        )
    },
    definition(
        "motor_omega_max",
        "rad/s",
        StackParameter::TopSpeed,
        "highest rotor speed that the motor may be commanded, in the unit of thrust_map: rad/s here, where the file's comment says rpm",
        FLIGHTMARE_SOURCE,
    ),
    written(
        "{name}: [{value}, 0.0, 0.0]",
        definition(
            "thrust_map",
            "N/(rad/s)^2",
            StackParameter::MotorConstant,
            "thrust of one rotor = thrust_map[0] w^2 + thrust_map[1] w + thrust_map[2]",
            FLIGHTMARE_SOURCE,
        ),
    ),
];
