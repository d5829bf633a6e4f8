"""SINDy as its documentation starts: polynomials of response and command, without and with a delay of each."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import pysindy as ps
from numpy.typing import NDArray

from models import LEAST_GAIN, Fit, fitted
from records import Array, Lag, Record, gap

# Chosen: steps in a time constant, so that the 11 of the smoothed differences are a quarter of it.
DIFFERENTIATED_STEPS, DELAYED_STEPS = 40, 10
# Chosen: the default of 0.1, a tenth of it and three times it; what each leaves of rows that it was not fitted to decides.
THRESHOLDS = (0.01, 0.1, 0.3)
# Chosen: how many values and how many steps apart; those of the public records are among them (2 and 2; 6 and 5).
DELAYS = ((2, 1), (2, 2), (6, 5))
# Beyond it a simulation has run away.
LARGEST = 1e3

# What a polynomial's term can mean, in powers of the response and of the command: generously, each effect whose law has that term.
CURVED = ("quadratic_thrust", "operating_point_lag", "asymmetric_lag", "saturation")
DELAYED = ("second_pole", "transport_delay", "moving_average", "esc_frame_hold", "inflow_lead", "stand_resonance")


class Scaled:
    """A record in units of its lag: time in time constants, commands in amplitudes."""

    def __init__(self, record: Record, lag: Lag, steps: int) -> None:
        self.record, self.gain = record, lag.gain
        self.amplitude = float(np.abs(record.command - record.nominal).max())
        self.step_rows = max(lag.time_constant_s / steps / record.step_s, 1.0)
        before = slice(0, record.fitted_rows() or len(record.command))
        command = record.command - record.nominal
        self.offset = float(record.response[before].mean() - lag.gain * command[before].mean())
        count = int((len(command) - 1) / self.step_rows)
        self.moments = np.arange(count + 1) * self.step_rows
        rows = np.arange(len(command) + 1)
        self.v = np.diff(np.interp(self.moments, rows, np.concatenate([[0.0], np.cumsum(command)]))) / self.step_rows / self.amplitude
        # The response at a step's end is the mean over the step around it: a row's noise is not the motion.
        response = (record.response - self.offset) / (lag.gain * self.amplitude)
        total = np.concatenate([[0.0], np.cumsum(response)])
        half = 0.5 * self.step_rows
        low, high = np.maximum(self.moments + 0.5 - half, 0.0), np.minimum(self.moments + 0.5 + half, len(response))
        self.z = (np.interp(high, rows, total) - np.interp(low, rows, total)) / (high - low)
        self.fitted = min(int(record.fitted_rows() / self.step_rows), count - 1)

    def by_row(self, z: Array) -> Array:
        at_rows = np.interp(np.arange(len(self.record.command)), self.moments, z)
        return self.offset + self.gain * self.amplitude * at_rows


@dataclass(frozen=True)
class Form:
    """A polynomial of the last values of response and command, so many of each and so many steps apart; `None`: of the present ones."""

    degree: int
    delays: tuple[int, int] | None


def regressors(one: Scaled, form: Form, share: float) -> tuple[Array, Array]:
    """The response and what goes with it, at each step that is fitted, and the next response or nothing."""
    end = int(share * one.fitted)
    if form.delays is None:
        return np.stack([one.z[:end], one.v[:end]], axis=1), one.z[:0]
    count, apart = form.delays
    first = (count - 1) * apart
    places = np.arange(first, end)[:, None] - apart * np.arange(count)
    return np.concatenate([one.z[places], one.v[places]], axis=1), one.z[first + 1 : end + 1]


def run(scaled: Sequence[Scaled], form: Form, powers: Array, coefficients: Array, step: float) -> list[Array]:
    """Simulates all records at once: Heun's method, or the next value from the last ones."""
    count = max(len(one.v) for one in scaled)
    v = np.stack([np.pad(one.v, (0, count - len(one.v)), mode="edge") for one in scaled], axis=1)
    out = np.empty((count + 1, len(scaled)))
    out[0] = z = np.array([one.z[0] for one in scaled])
    # Each product's factors, as places in a row that starts with a one.
    factors = np.array([[*np.repeat(np.arange(1, len(row) + 1), row), *[0] * (form.degree - sum(row))] for row in powers]).T
    row = np.ones((powers.shape[1] + 1, len(scaled)))

    def value(*inputs: Array) -> Array:
        row[1:] = np.concatenate(inputs)
        return coefficients @ reduce(np.multiply, (row[factor] for factor in factors))

    for k in range(count):
        if form.delays:
            past = np.maximum(k - form.delays[1] * np.arange(form.delays[0]), 0)
            z = value(out[past], v[past])
        else:
            first = value(z[None], v[k : k + 1])
            z = z + 0.5 * step * (first + value((z + step * first)[None], v[k : k + 1]))
        out[k + 1] = z = np.clip(z, -LARGEST, LARGEST)
    return [out[: len(one.z), place] for place, one in enumerate(scaled)]


@dataclass(frozen=True)
class Polynomial:
    """A fitted polynomial: what it leaves of the rows that were fitted, and the responses."""

    error: float
    form: Form
    threshold: float
    terms: dict[tuple[int, ...], float]
    simulated: list[Array]


def fit(scaled: list[Scaled], form: Form, threshold: float, steps: int, share: float) -> Polynomial:
    """Fits one polynomial with Pysindy, to a share of the rows that may be fitted; the error is that of the others, or of all."""
    library = ps.PolynomialLibrary(degree=form.degree)
    step = 1.0 / steps
    pairs = [regressors(one, form, share) for one in scaled if one.record.is_fitted]
    states, inputs = [row[:, :1] for row, _ in pairs], [row[:, 1:] for row, _ in pairs]
    if form.delays:
        optimizer = ps.STLSQ(threshold=threshold * step, alpha=1e-6)
        model = ps.DiscreteSINDy(optimizer=optimizer, feature_library=library)
        model.fit(states, t=step, u=inputs, x_next=[after[:, None] for _, after in pairs])
    else:
        optimizer = ps.STLSQ(threshold=threshold, alpha=1e-6)
        smoothed = ps.SmoothedFiniteDifference()
        model = ps.SINDy(optimizer=optimizer, feature_library=library, differentiation_method=smoothed)
        model.fit(states, t=step, u=inputs)
    coefficients, powers = np.asarray(model.coefficients())[0], np.asarray(library.powers_)
    responses = run(scaled, form, powers, coefficients, step)
    simulated = [one.by_row(z) for one, z in zip(scaled, responses, strict=True)]
    terms = {tuple(map(int, p)): float(c) for p, c in zip(powers, coefficients, strict=True) if c}

    def judged(record: Record) -> NDArray[np.bool_]:
        rows = fitted(record)
        return rows & (np.arange(len(rows)) >= share * rows.sum()) if share < 1.0 else rows

    return Polynomial(gap([one.record for one in scaled], simulated, judged), form, threshold, terms, simulated)


def with_polynomials(records: list[Record], lags: dict[float, Lag], *, delays: bool) -> Fit:
    """Of degrees, delays and thresholds, those that simulate best the last third of the rows that may be fitted."""
    steps = DELAYED_STEPS if delays else DIFFERENTIATED_STEPS
    scaled = [Scaled(record, lags[record.nominal], steps) for record in records]
    forms = [Form(degree, some) for degree in (1, 2, 3) for some in DELAYS] if delays else [Form(1, None), Form(2, None)]
    # A cubic of twelve values has 455 terms.
    forms = [form for form in forms if form.degree < 3 or form.delays is None or form.delays[0] == 2]
    tried = [fit(scaled, form, threshold, steps, 2 / 3) for form in forms for threshold in THRESHOLDS]
    linear = min((one for one in tried if one.form.degree == 1), key=lambda one: one.error)
    curved = min((one for one in tried if one.form.degree > 1), key=lambda one: one.error)
    is_curved = curved.error < (1.0 - LEAST_GAIN) * linear.error
    best = curved if is_curved else linear
    best = fit(scaled, best.form, best.threshold, steps, 1.0)
    names: list[tuple[str, ...]] = [CURVED] if is_curved else []
    if delays:
        names.append(DELAYED)
    equation = " ".join(f"{c:+.3g} {''.join(map(str, p))}" for p, c in best.terms.items())
    return Fit(names, {}, f"{best.form}; gap of the fitted rows {best.error:.2f} %; {equation}", best.simulated)
