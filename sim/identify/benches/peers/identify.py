"""From CSV to first-order lags with NumPy and SciPy, in the steps of `rotorlead identify`.

Usage: identify.py FOLDER numpy|pandas

Reads each multisine record of an experiment, transforms it period by period, takes the mean and the variance over the
periods at the excited lines, and fits K / (1 + tau s) behind the hold from row to row, weighted by the noise. Prints the
time constants and the seconds of each stage as JSON.
"""

import time

START = time.perf_counter()

import json
import pathlib
import sys
import tomllib

import numpy as np
from scipy.optimize import least_squares

LINE_THRESHOLD = 0.1
POOL = 11

seconds = {"import_s": time.perf_counter() - START, "read_s": 0.0, "spectra_s": 0.0, "fit_s": 0.0}


def read(path, reader):
    if reader == "pandas":
        import pandas

        # The default parser is fast and may be off in the last digit.
        table = pandas.read_csv(path)
        return [table[name].to_numpy() for name in ("time_s", "command", "thrust_n")]
    with open(path) as file:
        names = file.readline().strip().split(",")
    columns = [names.index(name) for name in ("time_s", "command", "thrust_n")]
    return np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns, unpack=True)


def lines_of(time_s, command, response, period_s):
    """Frequencies, mean spectra and pooled variance of the mean at the excited lines."""
    rate_hz = (len(time_s) - 1) / (time_s[-1] - time_s[0])
    length = round(period_s * rate_hz)
    periods = len(time_s) // length
    rest = len(time_s) - periods * length
    command = 2 / length * np.fft.rfft(command[rest:].reshape(periods, length))
    response = 2 / length * np.fft.rfft(response[rest:].reshape(periods, length))
    mean = np.abs(command.mean(axis=0))
    inner = np.arange(1, len(mean) - 1)
    excited = inner[mean[inner] >= LINE_THRESHOLD * mean[inner].max()]
    omega = 2 * np.pi * rate_hz / length * excited
    u, y = command[:, excited].mean(axis=0), response[:, excited].mean(axis=0)
    if periods > 1:
        variance = response[:, excited].var(axis=0, ddof=1) / periods
    else:
        quiet = np.setdiff1d(inner[inner < excited[-1] + POOL], excited)
        power = np.abs(response[0, quiet]) ** 2
        variance = np.interp(excited, quiet, power)
    # Over neighbours, with ends that keep the width.
    padded = np.pad(variance, POOL // 2, mode="reflect")
    variance = np.convolve(padded, np.full(POOL, 1 / POOL), mode="valid")
    return omega, u, y, variance, rate_hz


def fit(omega, u, y, variance, rate_hz):
    """Gain and time constant."""
    step = omega / rate_hz
    hold = (1 - np.exp(-1j * step)) / (1j * step)
    ratio, std = y / u, np.sqrt(variance) / np.abs(u)

    def misfit(parameters):
        gain, tau_s = parameters
        off = (ratio - hold * gain / (1 + 1j * omega * tau_s)) / std
        return np.concatenate([off.real, off.imag])

    return least_squares(misfit, [np.abs(ratio[0]), 0.1], x_scale=[1.0, 0.01]).x


def main():
    folder, reader = pathlib.Path(sys.argv[1]), sys.argv[2]
    manifest = tomllib.loads((folder / "experiment.toml").read_text())
    found = []
    for record in manifest["record"]:
        laps = [time.perf_counter()]
        columns = read(folder / record["file"], reader)
        laps.append(time.perf_counter())
        lines = lines_of(*columns, record["period_s"])
        laps.append(time.perf_counter())
        found.append(fit(*lines)[1])
        laps.append(time.perf_counter())
        for stage, lap in zip(("read_s", "spectra_s", "fit_s"), np.diff(laps)):
            seconds[stage] += lap
    print(json.dumps({"time_constants_s": found, **seconds}))


main()
