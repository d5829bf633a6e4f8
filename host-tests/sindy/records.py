"""Records of one actuator, the first-order lag that fits them, and the score that all models share."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """One record: command and response by row, and which rows nothing may be fitted to."""

    nominal: float
    step_s: float
    command: Array
    response: Array
    held_out: NDArray[np.bool_]
    is_scored: NDArray[np.bool_]

    @property
    def is_fitted(self) -> bool:
        """Whether the record has rows to fit."""
        return not bool(self.held_out.all())

    def fitted_rows(self) -> int:
        """Rows before those that are held out."""
        return int((~self.held_out).sum())


@dataclass(frozen=True)
class Lag:
    """`response = gain * lagged(command)`, the mean apart."""

    gain: float
    time_constant_s: float


def read_experiment(folder: Path) -> list[Record]:
    """Reads periodic records; held out are those marked `validate`, or the last third of the periods of each."""
    manifest = tomllib.loads((folder / "experiment.toml").read_text())
    has_roles = any("role" in entry for entry in manifest["record"])
    records = []
    for entry in manifest["record"]:
        time_s, command, response = np.loadtxt(
            folder / entry["file"], delimiter=",", skiprows=1, usecols=(0, 1, 2), unpack=True
        )
        rows = len(time_s)
        if has_roles:
            held_out = np.full(rows, entry.get("role") == "validate")
        else:
            held_out = np.arange(rows) >= 2 * rows // 3
        # What was before the record shows in its first second alone.
        is_scored = held_out & (time_s >= 1.0)
        step_s = float(time_s[1] - time_s[0])
        records.append(Record(entry["nominal"], step_s, command, response, held_out, is_scored))
    return records


def read_table(path: Path, rows: slice, *, held_out: bool) -> Record:
    """Reads a part of a table of time, command and response."""
    time_s, command, response = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    command, response = command[rows], response[rows]
    is_scored = np.full(len(command), held_out)
    # Nobody knows the state in which a record starts.
    is_scored[: len(command) // 10] = False
    step_s = float(np.median(np.diff(time_s)))
    return Record(float(command.mean()), step_s, command, response, np.full(len(command), held_out), is_scored)


def lagged(values: Array, time_constant_s: float, step_s: float) -> Array:
    """A first-order lag at each row's moment; a value holds from its row on, and the first has held for long."""
    decay = float(np.exp(-step_s / time_constant_s))
    before = np.concatenate([values[:1], values[:-1]])
    return lfilter([1.0 - decay], [1.0, -decay], before, zi=[values[0] * decay])[0]


def fit_lag(records: list[Record]) -> Lag:
    """Least squares of the simulated response, over the rows that are not held out."""
    fitted = [record for record in records if record.is_fitted]
    mean_step_s = fitted[0].step_s

    def residual(log_time_constant: float) -> tuple[float, float]:
        pairs = []
        for record in fitted:
            rows = slice(0, record.fitted_rows())
            model = lagged(record.command - record.nominal, float(np.exp(log_time_constant)), record.step_s)[rows]
            pairs.append((model - model.mean(), record.response[rows] - record.response[rows].mean()))
        gain = sum(float(m @ y) for m, y in pairs) / sum(float(m @ m) for m, _ in pairs)
        return sum(float(np.sum((y - gain * m) ** 2)) for m, y in pairs), gain

    # Chosen: from one row to a thousand of them holds the time constant of every record here.
    bounds = (np.log(mean_step_s), np.log(1000 * mean_step_s))
    best = minimize_scalar(lambda value: residual(value)[0], bounds=bounds, method="bounded")
    return Lag(residual(best.x)[1], float(np.exp(best.x)))


def gap(records: list[Record], simulated: list[Array], scored: Callable[[Record], NDArray[np.bool_]]) -> float:
    """RMS of the residual over that of the response, each record's means apart, in percent."""
    residual_power = response_power = 0.0
    for record, model in zip(records, simulated, strict=True):
        rows = scored(record)
        if rows.any():
            residual_power += float(np.sum((d := (record.response - model)[rows]) ** 2) - np.sum(d) ** 2 / len(d))
            response_power += float(np.sum((y := record.response[rows]) ** 2) - np.sum(y) ** 2 / len(y))
    return 100.0 * float(np.sqrt(residual_power / response_power))
