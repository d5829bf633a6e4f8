//! What to know of a stack before its parameters are used: where its source does something else than its names or pages promise.

use super::Stack;

pub(super) fn for_stack(stack: Stack) -> &'static [&'static str] {
    match stack {
        Stack::IsaacLab => &[
            "for Isaac Lab 3.0.0, whose rk4 has the time constant itself with use_discrete_approximation=False, and one longer by dt with \
             True; for 2.3.2.post1, whose rk4 adds where it has to subtract, write True, which gives the time constant there",
            "max_thrust_rate limits the rate of sqrt(thrust/k) in rps/s, and not the N/s of its docstring",
            "dt is set by the task, thruster_names_expr by the robot; torque_to_thrust_ratio must be given and is read by no code: yaw \
             is row 6 of allocation_matrix",
        ],
        Stack::AerialGym => &[
            "its rk4 adds where it has to subtract: use_discrete_approximation = True gives the time constant itself, False one shorter \
             by nearly a step of 10 ms",
            "the first thrust after a reset is random between min_thrust and max_thrust",
        ],
        Stack::Crazyflow => &[
            "for crazyflow 0.4.0; 0.3.2 has the keys in crazyflow/drones/params.toml and clips no command",
            "explicit Euler steps, by default of 2 ms, are faster than the time constant by half a step; rotor_dyn_coef is left out \
             unless both directions are known",
            "a section needs all keys: those not here are of the vehicle",
        ],
        Stack::Rotorpy => &["k_m and the rest of quad_params are not of the motor's thrust and lag"],
        Stack::GymPybulletDrones => &[
            "this simulator has no motor lag: a commanded speed is there at once, so no time constant is exported",
            "its highest speed is sqrt(thrust2weight 9.8 mass / (4 kf)): write thrust2weight = 4 (highest thrust of one rotor)/(9.8 mass)",
        ],
        Stack::Px4Sih => &[
            "the lag is on the motor signal and a quadcopter's thrust is linear in it: keep THR_MDL_FAC at 0 in simulation; the newer \
             hexacopter squares the signal",
            "steps are forward Euler without a limit: they overshoot where a step is longer than SIH_T_TAU, and diverge beyond twice that",
        ],
        Stack::Mujoco => &[
            "the force is linear in the activation, so what lags is the thrust: ctrl is a share of the full thrust, and the time constant \
             is that of small changes at the command it is taken at",
            "filterexact is exact with the integrators Euler, implicitfast and discrete, and not with RK4; one time constant serves both \
             directions; without actearly the force is one step later",
            "name, site and gear are the vehicle's: gear is \"0 0 1 0 0 K\" with K the yaw torque over the thrust",
        ],
        Stack::Flightmare => &[
            "the thrust is clipped to the highest of the constructor's own numbers, which the file does not change at this commit",
            "mass, arm_l, motor_omega_min, kappa and omega_max are not of the motor's thrust and lag",
        ],
        _ => &[],
    }
}
