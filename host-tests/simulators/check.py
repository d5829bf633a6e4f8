"""Holds what `rotorlead export` writes to the loaders of those who read it.

    python check.py ROTORLEAD [mujoco rotorpy crazyflow control matlab]

Each simulator loads its file and plays the held-out record; its % fit has to be the one that the export prints, to 0.05 %.
"""

from __future__ import annotations

import inspect
import runpy
import sys
import tempfile
from pathlib import Path

import numpy as np
from motors import Numbers, Replay, Stand, fit_percent

# Chosen: what is left of the rounding of the exported digits, and of a simulator's own steps within them.
CLOSE_PERCENT = 0.05
# At rest before a record, seconds: 40 time constants.
SETTLED_S = 2.0
# At full command.
FULL_RPM = 12000.0


def held(columns: dict[str, Numbers], at_s: float) -> float:
    """The command at a time, which holds until the next row; before the record its first one."""
    row = int(np.searchsorted(columns["time_s"], at_s + 1e-9, side="right")) - 1
    return float(columns["command"][max(row, 0)])


def compare(name: str, stand: Stand, replay: Replay, simulated: tuple[Numbers, Numbers]) -> None:
    """Holds what a simulator gives at its steps to what the export says of it."""
    [record] = replay["records"]
    columns = stand.columns(record["file"])
    time_s = columns["time_s"]
    fit = fit_percent(time_s, columns[stand.output], np.interp(time_s, *simulated))
    model = record["model_fit_percent"]
    print(f"{name}: {record['file']} {fit:.2f} % fit, printed {record['fit_percent']:.2f} %, the model {model:.2f} %")
    if not abs(fit - record["fit_percent"]) <= CLOSE_PERCENT:
        raise SystemExit(f"{name} does not do what the export says of it")


def mujoco(thrust: Stand, _: Stand) -> None:
    """A general actuator at a site, as the file has it."""
    import mujoco

    file, export = thrust.export("mujoco")
    actuator = file.read_text()
    xml = actuator.replace("<general ", '<general site="rotor" gear="0 0 1 0 0 0" ')
    body = '<body><freejoint/><geom size=".1"/><site name="rotor"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="0 0 0"/><worldbody>{body}</worldbody><actuator>{xml}</actuator></mujoco>'
    )
    [replay] = export["replays"]
    if model.opt.timestep != replay["step_s"]:
        raise SystemExit(f"MuJoCo steps by {model.opt.timestep} s, the export says {replay['step_s']} s")
    data = mujoco.MjData(model)
    columns = thrust.columns(replay["records"][0]["file"])
    step_s = model.opt.timestep
    begin_s, end_s = columns["time_s"][[0, -1]]
    times, force = [], []
    for step in range(-round(SETTLED_S / step_s), round((end_s - begin_s) / step_s) + 1):
        at_s = begin_s + step * step_s
        data.ctrl[0] = held(columns, at_s)
        mujoco.mj_step(model, data)
        times.append(at_s + step_s)
        force.append(float(data.actuator_force[0]))
    compare("MuJoCo", thrust, replay, (np.array(times), np.array(force)))


def rotorpy(_: Stand, speed: Stand) -> None:
    """The Hummingbird with the exported numbers in the place of its own."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    file, export = speed.export("rotorpy")
    exported = runpy.run_path(str(file))["quad_params"]
    params = {**quad_params, "rotor_speed_min": 0.0, **exported}
    vehicle = Multirotor(params, control_abstraction="cmd_motor_speeds")
    [replay] = export["replays"]
    step_s = replay["step_s"]
    columns = speed.columns(replay["records"][0]["file"])
    begin_s, end_s = columns["time_s"][[0, -1]]
    full_rad_s = float(exported["rotor_speed_max"])
    state = {**vehicle.initial_state, "rotor_speeds": np.full(4, held(columns, begin_s) * full_rad_s)}
    times, rpm = [], []
    for step in range(-round(SETTLED_S / step_s), round((end_s - begin_s) / step_s) + 1):
        at_s = begin_s + step * step_s
        command = np.full(4, held(columns, at_s) * full_rad_s)
        state = vehicle.step(state, {"cmd_motor_speeds": command}, step_s)
        times.append(at_s + step_s)
        rpm.append(float(state["rotor_speeds"][0]) * 60 / (2 * np.pi))
    compare("RotorPy", speed, replay, (np.array(times), np.array(rpm)))


def crazyflow(_: Stand, speed: Stand) -> None:
    """A Crazyflie's first principles with the exported numbers in the place of its own, in the steps that its simulation takes."""
    import tomllib

    from crazyflow.drones import Drone
    from crazyflow.dynamics import Dynamics
    from crazyflow.dynamics.core import load_params
    from crazyflow.dynamics.first_principles.dynamics import dynamics

    file, export = speed.export("crazyflow")
    exported = tomllib.loads(file.read_text())
    params = load_params(Dynamics.first_principles, Drone.cf2x_L250)
    params["rotor_dyn_coef"] = np.reshape(exported["rotor_dyn_coef"], params["rotor_dyn_coef"].shape)
    names = inspect.signature(dynamics).parameters
    params = {name: value for name, value in params.items() if name in names}
    rest = {"pos": np.zeros(3), "quat": np.array([0.0, 0.0, 0.0, 1.0]), "vel": np.zeros(3), "ang_vel": np.zeros(3)}
    [replay] = export["replays"]
    step_s = replay["step_s"]
    columns = speed.columns(replay["records"][0]["file"])
    begin_s, end_s = columns["time_s"][[0, -1]]
    rotor = np.full(4, held(columns, begin_s) * FULL_RPM)
    times, rpm = [], []
    for step in range(round((end_s - begin_s) / step_s) + 1):
        at_s = begin_s + step * step_s
        command = np.full(4, held(columns, at_s) * FULL_RPM)
        *_, rate = dynamics(**rest, cmd=command, rotor_vel=rotor, **params)
        rotor = rotor + step_s * np.asarray(rate)
        times.append(at_s + step_s)
        rpm.append(float(rotor[0]))
    compare("crazyflow", speed, replay, (np.array(times), np.array(rpm)))


def control(thrust: Stand, _: Stand) -> None:
    """`control.FRD` and `control.tf`, of which the second goes through the first within its noise."""
    file, _ = thrust.export("python-control")
    module = runpy.run_path(str(file))
    measured, model = module["measured"], module["model"]
    omega = np.asarray(module["omega"])
    off = np.abs(np.asarray(module["response"]) - model(1j * omega)) ** 2 / np.asarray(module["variance"])
    print(f"python-control: {len(measured.omega)} lines, the model is off by {np.mean(off):.2f} variances")
    # Chosen: of 150 lines whose variances are from three periods the mean scatters by 0.15 around 1.
    if len(measured.omega) != 150 or not 0.6 < np.mean(off) < 1.6:
        raise SystemExit("the model is not in the measured response")


def matlab(thrust: Stand, _: Stand) -> None:
    """The shapes that MathWorks' pages ask of `frd` and `idfrd`, by SciPy's reader: there is no MATLAB here."""
    from scipy.io import loadmat

    file, _ = thrust.export("matlab")
    found = loadmat(file)
    shapes = {name: found[name].shape for name in ("response", "frequency", "coherence", "covariance")}
    print(f"MAT-file: {shapes}")
    lines = found["frequency"].shape[0]
    if shapes["response"] != (lines, 1) or shapes["covariance"] != (1, 1, lines, 2, 2):
        raise SystemExit("frd and idfrd take other shapes")
    if not np.iscomplexobj(found["response"]) or not np.all(np.diff(found["frequency"][:, 0]) > 0):
        raise SystemExit("the response is not complex, or its frequencies do not rise")


CHECKS = {"mujoco": mujoco, "rotorpy": rotorpy, "crazyflow": crazyflow, "control": control, "matlab": matlab}


def main(program: str, *names: str) -> None:
    """Runs the checks of these names, or all."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(program).resolve())
        thrust = Stand.simulate(path, Path(folder) / "thrust", "thrust_n", 8.0)
        speed = Stand.simulate(path, Path(folder) / "speed", "rpm", FULL_RPM)
        for name in names or CHECKS:
            CHECKS[name](thrust, speed)


if __name__ == "__main__":
    main(*sys.argv[1:])
