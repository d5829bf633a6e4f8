//! How simulators step their motors: the share of the way to the command that one step of each goes.

use serde::Serialize;

use super::Stack;

/// The law that one version of a simulator steps a motor with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stepping {
    /// Version and settings.
    pub name: &'static str,
    /// The step that it has unless it is set, seconds.
    pub step_s: f64,
    /// What lags.
    pub lagging: Lagging,
    /// Whether a rising speed has a time constant of its own.
    pub has_directions: bool,
    /// Whether the rate of the speed is limited.
    pub has_rate_limit: bool,
    /// Whether it holds a dead time, in whole steps.
    pub has_dead_time: bool,
    /// Steps by which its thrust is late for the order of its own work.
    pub late_steps: usize,
    #[serde(skip)]
    scheme: Scheme,
}

/// What a simulator's first-order lag acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lagging {
    /// The rotor speed, as the root of the thrust where the response is a thrust.
    Speed,
    /// The thrust, or a signal that it is proportional to.
    Thrust,
}

/// How a step is integrated, with `a` its length over the time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scheme {
    /// No lag: the command is there at once.
    AtOnce,
    /// `1 - e^-a`.
    Exact,
    /// `a`.
    Euler,
    /// Four stages, whose errors are the one before plus `sign` times the way gone: -1 is Runge and Kutta's.
    Rk4 { sign: f64, over: Over },
}

/// What the error is divided by to become a rate.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Over {
    /// The time constant.
    TimeConstant,
    /// The time constant and the step.
    TimeConstantAndStep,
}

const SPEED: Stepping = Stepping {
    name: "",
    step_s: 0.0,
    lagging: Lagging::Speed,
    has_directions: false,
    has_rate_limit: false,
    has_dead_time: false,
    late_steps: 0,
    scheme: Scheme::Exact,
};

/// Steps, seconds. Standard: those of the simulators' own files, which their definitions name; of SIH 400 Hz, which it takes where the rates
/// of the IMU are not set; of Gazebo 1 ms, that of its worlds unless they say.
static GAZEBO: [Stepping; 1] =
    // It takes the thrust of the speed that its filter had before the step.
    [Stepping {
        name: "MulticopterMotorModel at 061b93b14bc8",
        step_s: 0.001,
        has_directions: true,
        late_steps: 1,
        ..SPEED
    }];
static ISAAC_LAB: [Stepping; 2] = [
    Stepping {
        name: "3.0.0, rk4, use_discrete_approximation=False",
        step_s: 0.01,
        has_directions: true,
        has_rate_limit: true,
        scheme: Scheme::Rk4 { sign: -1.0, over: Over::TimeConstant },
        ..SPEED
    },
    Stepping {
        name: "2.3.2.post1, rk4, use_discrete_approximation=True",
        step_s: 0.01,
        has_directions: true,
        has_rate_limit: true,
        scheme: Scheme::Rk4 { sign: 1.0, over: Over::TimeConstantAndStep },
        ..SPEED
    },
];
static AERIAL_GYM: [Stepping; 1] = [Stepping {
    name: "2.0.0, rk4, use_rps = True, use_discrete_approximation = True",
    step_s: 0.01,
    has_directions: true,
    has_rate_limit: true,
    scheme: Scheme::Rk4 { sign: 1.0, over: Over::TimeConstantAndStep },
    ..SPEED
}];
static CRAZYFLOW: [Stepping; 1] = [Stepping {
    name: "0.4.0, first_principles, euler",
    step_s: 0.002,
    has_directions: true,
    scheme: Scheme::Euler,
    ..SPEED
}];
static ROTORPY: [Stepping; 1] = [Stepping { name: "3.0.0, RK45", step_s: 0.01, ..SPEED }];
static GYM_PYBULLET_DRONES: [Stepping; 1] =
    [Stepping { name: "BaseAviary at 00ca90a9", step_s: 1.0 / 240.0, scheme: Scheme::AtOnce, ..SPEED }];
static PX4_SIH: [Stepping; 1] = [Stepping {
    name: "sih.cpp at 039af95d, quadcopter",
    step_s: 0.0025,
    lagging: Lagging::Thrust,
    scheme: Scheme::Euler,
    ..SPEED
}];
static MUJOCO: [Stepping; 1] = [Stepping {
    name: "4.0.0, filterexact, actearly, integrator Euler",
    step_s: 0.002,
    lagging: Lagging::Thrust,
    has_dead_time: true,
    ..SPEED
}];
static FLIGHTMARE: [Stepping; 1] = [Stepping { name: "quadrotor_dynamics.cpp at 05014828", step_s: 0.0025, ..SPEED }];

pub(super) fn for_stack(stack: Stack) -> &'static [Stepping] {
    match stack {
        Stack::Betaflight | Stack::Px4 | Stack::Ardupilot | Stack::Paparazzi | Stack::Indiflight => &[],
        Stack::Gazebo => &GAZEBO,
        Stack::IsaacLab => &ISAAC_LAB,
        Stack::AerialGym => &AERIAL_GYM,
        Stack::Crazyflow => &CRAZYFLOW,
        Stack::Rotorpy => &ROTORPY,
        Stack::GymPybulletDrones => &GYM_PYBULLET_DRONES,
        Stack::Px4Sih => &PX4_SIH,
        Stack::Mujoco => &MUJOCO,
        Stack::Flightmare => &FLIGHTMARE,
    }
}

impl Stepping {
    /// Whether it has a lag at all.
    #[must_use]
    pub fn has_lag(&self) -> bool {
        self.scheme != Scheme::AtOnce
    }

    /// How far a step of `step_s` goes towards a command that is `error` away, with the rate limited to `most_per_s`.
    pub(super) fn advance(&self, error: f64, time_constant_s: f64, step_s: f64, most_per_s: f64) -> f64 {
        let rate = |error: f64, over_s: f64| (error / over_s).clamp(-most_per_s, most_per_s);
        match self.scheme {
            Scheme::AtOnce => error,
            Scheme::Exact => -error * (-step_s / time_constant_s).exp_m1(),
            Scheme::Euler => step_s * rate(error, time_constant_s),
            Scheme::Rk4 { sign, over } => {
                let over_s = match over {
                    Over::TimeConstant => time_constant_s,
                    Over::TimeConstantAndStep => time_constant_s + step_s,
                };
                let first = rate(error, over_s);
                let second = rate(error + sign * 0.5 * step_s * first, over_s);
                let third = rate(error + sign * 0.5 * step_s * second, over_s);
                let fourth = rate(error + sign * step_s * third, over_s);
                step_s / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
            }
        }
    }

    /// The share of a small error that one step closes: at 1 the command is reached, beyond 1 steps overshoot, from 2 on they diverge.
    #[must_use]
    pub fn share(&self, time_constant_s: f64, step_s: f64) -> f64 {
        self.advance(1.0, time_constant_s, step_s, f64::INFINITY)
    }

    /// The time constant that steps of `step_s` have in truth, `-step / ln(1 - share)`, seconds; `None` where they overshoot.
    #[must_use]
    pub fn effective_time_constant_s(&self, time_constant_s: f64, step_s: f64) -> Option<f64> {
        let share = self.share(time_constant_s, step_s);
        (share < 1.0).then(|| -step_s / (-share).ln_1p())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Effective time constants in ms of a lag and a step, both ms.
    #[track_caller]
    fn effective(stepping: Stepping, time_constant: f64, step: f64, expected: f64) {
        let found = stepping.effective_time_constant_s(1e-3 * time_constant, 1e-3 * step).unwrap();
        assert!((1e3 * found - expected).abs() < 0.05, "{}: {found} is not {expected} ms", stepping.name);
    }

    #[test]
    fn isaac_labs_two_signs_have_the_time_constants_of_their_closed_forms() {
        let [newer, older] = ISAAC_LAB;
        let with = |stepping: Stepping, sign, over| Stepping { scheme: Scheme::Rk4 { sign, over }, ..stepping };
        let newer_discrete = with(newer, -1.0, Over::TimeConstantAndStep);
        let older_continuous = with(older, 1.0, Over::TimeConstant);
        // Time constant, step, then: 2.3.2 discrete and continuous, 3.0.0 discrete and continuous; ms.
        for [tau, dt, old_discrete, old_continuous, new_discrete, new_continuous] in [
            [40.0, 10.0, 40.0, 29.9, 50.0, 40.0],
            [50.0, 10.0, 50.0, 40.0, 60.0, 50.0],
            [40.0, 5.0, 40.0, 35.0, 45.0, 40.0],
        ] {
            effective(older, tau, dt, old_discrete);
            effective(older_continuous, tau, dt, old_continuous);
            effective(newer_discrete, tau, dt, new_discrete);
            effective(newer, tau, dt, new_continuous);
        }
        effective(older, 5.0, 10.0, 3.4);
        effective(newer, 5.0, 10.0, 9.1);
        // a = 2 of the adding sign: 2 + 2 + 4/3 + 2/3.
        assert!((older_continuous.share(0.005, 0.01) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn euler_is_faster_by_half_a_step_and_exact_is_exact() {
        for (stepping, time_constant, step) in [(CRAZYFLOW[0], 40.0, 2.0), (PX4_SIH[0], 50.0, 2.5)] {
            effective(stepping, time_constant, step, time_constant - 0.5 * step);
        }
        for stepping in [GAZEBO[0], ROTORPY[0], MUJOCO[0], FLIGHTMARE[0]] {
            effective(stepping, 30.0, 2.0, 30.0);
            assert!((stepping.share(0.03, 0.002) - 0.064_493).abs() < 1e-6);
        }
        assert_eq!(PX4_SIH[0].share(0.001, 0.0025), 2.5);
        assert_eq!(PX4_SIH[0].effective_time_constant_s(0.001, 0.0025), None);
        assert_eq!(GYM_PYBULLET_DRONES[0].share(0.03, 0.004), 1.0);
    }

    #[test]
    fn a_rate_limit_holds_over_all_stages() {
        for stepping in ISAAC_LAB {
            assert!((stepping.advance(100.0, 0.05, 0.01, 20.0) - 0.2).abs() < 1e-12);
            assert!((stepping.advance(-100.0, 0.05, 0.01, 20.0) + 0.2).abs() < 1e-12);
        }
    }
}
