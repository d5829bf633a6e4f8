//! What each stack defines, where it says so, and which of a model's numbers that is.

use serde::Serialize;

use super::betaflight::{BOOST_BOUNDS, BOOST_RELEASES, SERIES_BOUNDS, SERIES_RELEASES};
use super::law::ThrustLaw;
use super::rotor::RPM;
use super::stepping::{self, Stepping};
use super::{remarks, simulators};

/// A flight stack or simulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stack {
    /// Betaflight.
    Betaflight,
    /// PX4.
    Px4,
    /// ArduPilot.
    Ardupilot,
    /// Paparazzi.
    Paparazzi,
    /// Indiflight.
    Indiflight,
    /// Gazebo's multicopter motor plugins.
    Gazebo,
    /// Isaac Lab's thruster.
    IsaacLab,
    /// Aerial Gym.
    AerialGym,
    /// crazyflow, first principles.
    Crazyflow,
    /// `RotorPy`.
    Rotorpy,
    /// gym-pybullet-drones, which has no lag.
    GymPybulletDrones,
    /// PX4's simulation in hardware (SIH).
    Px4Sih,
    /// `MuJoCo`'s general actuator.
    Mujoco,
    /// Flightmare.
    Flightmare,
}

impl Stack {
    /// Every one.
    pub const ALL: [Self; 14] = [
        Self::Betaflight,
        Self::Px4,
        Self::Ardupilot,
        Self::Paparazzi,
        Self::Indiflight,
        Self::Gazebo,
        Self::IsaacLab,
        Self::AerialGym,
        Self::Crazyflow,
        Self::Rotorpy,
        Self::GymPybulletDrones,
        Self::Px4Sih,
        Self::Mujoco,
        Self::Flightmare,
    ];

    /// What it is called.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Betaflight => "betaflight",
            Self::Px4 => "px4",
            Self::Ardupilot => "ardupilot",
            Self::Paparazzi => "paparazzi",
            Self::Indiflight => "indiflight",
            Self::Gazebo => "gazebo",
            Self::IsaacLab => "isaac-lab",
            Self::AerialGym => "aerial-gym",
            Self::Crazyflow => "crazyflow",
            Self::Rotorpy => "rotorpy",
            Self::GymPybulletDrones => "gym-pybullet-drones",
            Self::Px4Sih => "px4-sih",
            Self::Mujoco => "mujoco",
            Self::Flightmare => "flightmare",
        }
    }

    /// What is written for it.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Betaflight => "`thrust_linear`, of each of the two laws that releases have",
            Self::Px4 => "`THR_MDL_FAC`",
            Self::Ardupilot => "`MOT_THST_EXPO`",
            Self::Paparazzi => "`ACT_FREQ`",
            Self::Indiflight => "`indi_act_time_constant_ms`, `indi_act_nonlinearity`, `indi_act_max_rpm`",
            Self::Gazebo => {
                "`timeConstantUp`, `timeConstantDown`, `maxRotVelocity`, `motorConstant` of the motor plugin"
            }
            Self::IsaacLab => {
                "`thrust_range`, `max_thrust_rate`, `thrust_const_range`, `tau_inc_range`, `tau_dec_range` of `ThrusterCfg`"
            }
            Self::AerialGym => {
                "`motor_thrust_constant`, `motor_time_constant_increasing` and `_decreasing`, `max_thrust`, `max_thrust_rate`"
            }
            Self::Crazyflow => "`rotor_dyn_coef`, `rpm2thrust`, `thrust_max`",
            Self::Rotorpy => "`tau_m`, `k_eta`, `rotor_speed_max`",
            Self::GymPybulletDrones => "`kf`",
            Self::Px4Sih => "`SIH_T_TAU`, `SIH_T_MAX`",
            Self::Mujoco => "`dynprm`, `gainprm`, `delay`, `nsample` of a general actuator",
            Self::Flightmare => "`motor_tau`, `motor_omega_max`, `thrust_map`",
        }
    }

    /// What it is asked for.
    #[must_use]
    pub fn definitions(self) -> &'static [Definition] {
        match self {
            Self::Betaflight => &BETAFLIGHT,
            Self::Px4 => &PX4,
            Self::Ardupilot => &ARDUPILOT,
            Self::Paparazzi => &PAPARAZZI,
            Self::Indiflight => &INDIFLIGHT,
            Self::Gazebo => &GAZEBO,
            Self::IsaacLab => &simulators::ISAAC_LAB,
            Self::AerialGym => &simulators::AERIAL_GYM,
            Self::Crazyflow => &simulators::CRAZYFLOW,
            Self::Rotorpy => &simulators::ROTORPY,
            Self::GymPybulletDrones => &simulators::GYM_PYBULLET_DRONES,
            Self::Px4Sih => &simulators::PX4_SIH,
            Self::Mujoco => &simulators::MUJOCO,
            Self::Flightmare => &simulators::FLIGHTMARE,
        }
    }

    /// The commands that are its lowest and highest motor output as it is delivered; `None` for a stack none of whose
    /// parameters depends on them.
    #[must_use]
    pub fn output_range(self) -> Option<(f64, f64)> {
        match self {
            // Standard: `dshot_idle_value`, later `motor_idle`, is 550: 5.5 %.
            Self::Betaflight => Some((0.055, 1.0)),
            // Standard: the defaults of MOT_SPIN_MIN and MOT_SPIN_MAX.
            Self::Ardupilot => Some((0.15, 0.95)),
            Self::Paparazzi => None,
            _ => Some((0.0, 1.0)),
        }
    }

    /// Whether one of its parameters is taken at a command.
    #[must_use]
    pub fn has_time_constant(self) -> bool {
        self.definitions().iter().any(|definition| definition.quantity.is_lag())
    }

    /// How it steps its motors, where it is a simulator: each version that differs, the one that the parameters are for first.
    #[must_use]
    pub fn steppings(self) -> &'static [Stepping] {
        stepping::for_stack(self)
    }

    /// Whether one of its parameters depends on the step of its simulation.
    #[must_use]
    pub fn has_step(self) -> bool {
        !self.steppings().is_empty()
    }

    /// What to know of it before its parameters are used.
    #[must_use]
    pub fn remarks(self) -> &'static [&'static str] {
        remarks::for_stack(self)
    }

    /// Whether it takes one value for each motor.
    #[must_use]
    pub fn is_per_motor(self) -> bool {
        matches!(self, Self::Paparazzi | Self::Indiflight)
    }
}

/// One parameter as its stack defines it.
#[derive(Debug, PartialEq, Serialize)]
pub struct Definition {
    /// Its name there.
    pub name: &'static str,
    /// The releases of the stack that mean it so, where others do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub releases: Option<&'static str>,
    /// Its unit; `1` for a number.
    pub unit: &'static str,
    /// What it means.
    pub definition: &'static str,
    /// The file that says so.
    pub source: &'static str,
    /// Which of the model's numbers it is.
    #[serde(skip)]
    pub(super) quantity: StackParameter,
    /// What that number, in SI units, is multiplied by.
    #[serde(skip)]
    pub(super) scale: f64,
    /// Whether the stack takes whole numbers alone.
    #[serde(skip)]
    pub(super) is_integer: bool,
    /// What the stack takes at least and at most, where it bounds it.
    #[serde(skip)]
    pub(super) bounds: Option<(f64, f64)>,
    /// How it is written, with `{name}`, `{value}` and the ends of its interval `{low}` and `{high}`, where that is not as its stack
    /// writes every other.
    #[serde(skip)]
    pub written: Option<&'static str>,
}

/// A number of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StackParameter {
    /// The parameter of a law of thrust over motor output.
    ThrustCurve(ThrustLaw),
    /// Time constant, seconds.
    TimeConstant,
    /// Its inverse, rad/s.
    CornerFrequency,
    /// Time constant of a rising speed, seconds.
    TimeConstantUp,
    /// Time constant of a falling speed, seconds.
    TimeConstantDown,
    /// Rotor speed at the highest motor output, rad/s.
    TopSpeed,
    /// Thrust over the square of the rotor speed, N/(rad/s)^2.
    MotorConstant,
    /// Thrust at the highest motor output, N.
    TopThrust,
    /// Highest rate of the rotor speed, rad/s^2.
    SpeedRate,
    /// Inverse of the time constant of a rising speed, 1/s.
    RateUp,
    /// Inverse of the time constant of a falling speed, 1/s.
    RateDown,
    /// Dead time in whole steps of the simulation, seconds.
    DeadTime,
    /// The number of these steps.
    DeadTimeSteps,
}

impl StackParameter {
    pub(super) fn is_lag(self) -> bool {
        matches!(
            self,
            Self::TimeConstant
                | Self::CornerFrequency
                | Self::TimeConstantUp
                | Self::TimeConstantDown
                | Self::RateUp
                | Self::RateDown
                | Self::DeadTime
                | Self::DeadTimeSteps
                | Self::SpeedRate
        )
    }
}

impl Definition {
    /// Its name, and of which releases it is where others mean another thing by it.
    #[must_use]
    pub fn full_name(&self) -> String {
        full_name(self.name, self.releases)
    }
}

pub(super) fn full_name(name: &str, releases: Option<&str>) -> String {
    releases.map_or_else(|| name.to_owned(), |releases| format!("{name} of releases {releases}"))
}

pub(super) const fn definition(
    name: &'static str,
    unit: &'static str,
    quantity: StackParameter,
    definition: &'static str,
    source: &'static str,
) -> Definition {
    Definition {
        name,
        releases: None,
        unit,
        definition,
        source,
        quantity,
        scale: 1.0,
        is_integer: false,
        bounds: None,
        written: None,
    }
}

const BETAFLIGHT: [Definition; 2] = [
    Definition {
        releases: Some(BOOST_RELEASES),
        scale: 100.0,
        is_integer: true,
        // Standard: src/main/cli/settings.c.
        bounds: Some(BOOST_BOUNDS),
        ..definition(
            "thrust_linear",
            "%",
            StackParameter::ThrustCurve(ThrustLaw::Boost),
            "the motor output that gives a share y of the full thrust is y (1 + t (1 - y)^2) with t = thrust_linear/100, both \
             counted from the idle; the other releases have another law under this name: set the value of yours alone",
            "betaflight/betaflight src/main/flight/pid.c, pidApplyThrustLinearization, since pull request 9740 (2020)",
        )
    },
    Definition {
        releases: Some(SERIES_RELEASES),
        scale: 100.0,
        is_integer: true,
        bounds: Some(SERIES_BOUNDS),
        ..definition(
            "thrust_linear",
            "%",
            StackParameter::ThrustCurve(ThrustLaw::InverseSeries),
            "the motor output that gives a share y of the full thrust is y (1 + t (1 - y) (1 + t (1 - 2 y))) with t = thrust_linear/100, \
             both counted from the idle; the other releases have another law under this name: set the value of yours alone",
            "betaflight/betaflight src/main/flight/pid.c, pidApplyThrustLinearization, since pull request 15226 (2026)",
        )
    },
];

const PX4: [Definition; 1] = [Definition {
    bounds: Some((0.0, 1.0)),
    ..definition(
        "THR_MDL_FAC",
        "1",
        StackParameter::ThrustCurve(ThrustLaw::Quadratic),
        "rel_thrust = THR_MDL_FAC rel_signal^2 + (1 - THR_MDL_FAC) rel_signal, both from 0 to 1; the signal \
         between the output's MIN and MAX, or DSHOT_MIN and full throttle",
        "PX4/PX4-Autopilot src/lib/mixer_module/motor_params.yaml at 1cf10fee3b82",
    )
}];

const ARDUPILOT: [Definition; 1] = [Definition {
    bounds: Some((-1.0, 1.0)),
    ..definition(
        "MOT_THST_EXPO",
        "1",
        StackParameter::ThrustCurve(ThrustLaw::Quadratic),
        "thrust = MOT_THST_EXPO r^2 + (1 - MOT_THST_EXPO) r, where r is 0 at MOT_SPIN_MIN and 1 at MOT_SPIN_MAX",
        "ArduPilot/ardupilot libraries/AP_Motors/AP_Motors_Thrust_Linearization.cpp at 04dc0b71a37d",
    )
}];

const PAPARAZZI: [Definition; 1] = [definition(
    "ACT_FREQ",
    "rad/s",
    StackParameter::CornerFrequency,
    "corner frequency of the actuator as a continuous first-order lag, 1 / time constant; in the section whose prefix is \
     STABILIZATION_INDI_",
    "paparazzi/paparazzi sw/airborne/firmwares/rotorcraft/stabilization/stabilization_indi.c, STABILIZATION_INDI_ACT_FREQ",
)];

const INDIFLIGHT_SOURCE: &str = "tudelft/indiflight src/main/flight/indi_init.c at 033c5791ad93";

const INDIFLIGHT: [Definition; 3] = [
    Definition {
        scale: 1000.0,
        is_integer: true,
        // Standard: a byte, of which the firmware takes 1 for 0.
        bounds: Some((1.0, 255.0)),
        ..definition(
            "indi_act_time_constant_ms",
            "ms",
            StackParameter::TimeConstant,
            "time constant of the actuator as a first-order lag",
            INDIFLIGHT_SOURCE,
        )
    },
    Definition {
        scale: 100.0,
        is_integer: true,
        // Standard: the firmware clips it to these.
        bounds: Some((2.5, 70.0)),
        ..definition(
            "indi_act_nonlinearity",
            "%",
            StackParameter::ThrustCurve(ThrustLaw::Quadratic),
            "force = k d^2 + (1 - k) d with k = indi_act_nonlinearity/100, force and motor output d from 0 to 1",
            "tudelft/indiflight src/main/flight/indi.c at f25495626 (indiOutputCurve, updateLinearization)",
        )
    },
    Definition {
        scale: RPM.recip(),
        is_integer: true,
        ..definition(
            "indi_act_max_rpm",
            "rpm",
            StackParameter::TopSpeed,
            "rotor speed at the full motor output",
            INDIFLIGHT_SOURCE,
        )
    },
];

const GAZEBO_SOURCE: &str =
    "gazebosim/gz-sim src/systems/multicopter_motor_model/MulticopterMotorModel.cc at 061b93b14bc8";

const GAZEBO: [Definition; 4] = [
    definition(
        "timeConstantUp",
        "s",
        StackParameter::TimeConstantUp,
        "time constant of the first-order filter of the rotor speed while it rises",
        GAZEBO_SOURCE,
    ),
    definition(
        "timeConstantDown",
        "s",
        StackParameter::TimeConstantDown,
        "time constant of the first-order filter of the rotor speed while it falls",
        GAZEBO_SOURCE,
    ),
    definition(
        "maxRotVelocity",
        "rad/s",
        StackParameter::TopSpeed,
        "highest rotor speed that the motor may be commanded",
        GAZEBO_SOURCE,
    ),
    definition(
        "motorConstant",
        "N/(rad/s)^2",
        StackParameter::MotorConstant,
        "thrust = motorConstant (rotor speed)^2",
        GAZEBO_SOURCE,
    ),
];
