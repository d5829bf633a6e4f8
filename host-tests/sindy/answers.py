"""What the lag, each way of SINDy, and the diagnosis say of the same records."""

import json
import os
import subprocess
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from models import Fit, with_catalog
from polynomials import with_polynomials
from records import Lag, Record, fit_lag, gap, lagged

warnings.filterwarnings("ignore")


@dataclass(frozen=True)
class Answer:
    """One tool's answer: each name with those that it may as well be, one parameter of each, and what is left."""

    gap: float
    seconds: float
    names: list[list[str]] = field(default_factory=list)
    minor: list[list[str]] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    detail: str = ""
    noise_floor: float | None = None


def lag_alone(records: list[Record], lags: dict[float, Lag]) -> Fit:
    """The baseline: a first-order lag at each nominal command."""
    simulated = []
    for record in records:
        lag = lags[record.nominal]
        simulated.append(lag.gain * lagged(record.command - record.nominal, lag.time_constant_s, record.step_s))
    return Fit([], {}, "", simulated)


# The parameter of each effect that is compared.
PARAMETERS = {
    "transport_delay": "delay_s",
    "esc_frame_hold": "frame_hz",
    "dead_band": "width",
    "backlash": "half_width",
    "command_quantization": "step",
    "saturation": "max",
    "slew_limit": "rate_per_s",
    "asymmetric_lag": "ratio",
    "operating_point_lag": "exponent",
    "quadratic_thrust": "curvature_per_duty",
    "second_pole": "time_constant_s",
    "inflow_lead": "time_constant_s",
    "supply_sag": "polarization_s",
    "gain_drift": "drift",
    "stand_resonance": "frequency_hz",
    "clock_skew": "skew_ppm",
    "moving_average": "window_s",
}


MODELS: dict[str, Callable[[list[Record], dict[float, Lag]], Fit]] = {
    "lag": lag_alone,
    "polynomial": lambda records, lags: with_polynomials(records, lags, delays=False),
    "delays": lambda records, lags: with_polynomials(records, lags, delays=True),
    "catalog": with_catalog,
}


def ask_sindy(records: list[Record]) -> dict[str, Answer]:
    """The baseline's answer and those of SINDy, with the processor's time of each."""
    start = time.process_time()
    by_nominal: dict[float, list[Record]] = {}
    for record in filter(lambda record: record.is_fitted, records):
        by_nominal.setdefault(record.nominal, []).append(record)
    lags = {nominal: fit_lag(some) for nominal, some in sorted(by_nominal.items())}
    lag_s = time.process_time() - start
    answers = {}
    for name, model in MODELS.items():
        start = time.process_time()
        fit = model(records, lags)
        seconds = lag_s + time.process_time() - start
        error = gap(records, fit.simulated, lambda record: record.is_scored)
        names = [list(one) for one in fit.names]
        answers[name] = Answer(error, seconds, names, values=fit.values, detail=fit.equation)
    return answers


def run(command: list[str | Path]) -> float:
    """Runs a program; gives its processor time in seconds."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as child:
        errors = child.stderr.read() if child.stderr else ""
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}: {errors}")
    return usage.ru_utime + usage.ru_stime


def ask_diagnosis(program: Path, folder: Path, out: Path) -> Answer:
    """The diagnosis of an experiment, which gets no model; its improved model goes beside its answer."""
    answer, model = out.with_suffix(".json"), out.with_suffix(".toml")
    seconds = run([program, "diagnose", folder, "--json", answer, "--out-model", model, "--quiet", "--force"])
    said = json.loads(answer.read_text())
    values = {one["kind"]: one["parameters"].get(PARAMETERS.get(one["kind"]), {}).get("value") for one in said["effects"]}
    return Answer(
        gap=100.0 * said["gap"]["after"],
        seconds=seconds,
        names=[[one["kind"], *one["alternatives"]] for one in said["effects"]],
        minor=[[one["kind"]] for one in said["minor"]],
        values={kind: value for kind, value in values.items() if value is not None},
        detail=said["verdict"],
        noise_floor=100.0 * said["gap"]["noise_floor"],
    )


def simulated_gap(program: Path, folder: Path, model: Path, out: Path, records: list[Record]) -> float:
    """What the improved model leaves of the rows that are scored, as all others are scored."""
    run([program, "validate", folder, "--model", model, "--figures", out, "--quiet", "--force"])
    simulated = []
    for place, record in enumerate(records):
        table = next(out.glob(f"validation_in_time_*{place}.csv"))
        simulated.append(np.loadtxt(table, delimiter=",", skiprows=1, usecols=2))
    return gap(records, simulated, lambda record: record.is_scored)


def as_json(answers: dict[str, Answer]) -> str:
    return json.dumps({name: asdict(answer) for name, answer in answers.items()}, indent=1)


def from_json(text: str) -> dict[str, Answer]:
    return {name: Answer(**answer) for name, answer in json.loads(text).items()}
