"""SINDy as its documentation starts: polynomials of response and command, without and with a delay of each."""

from collections.abc import Sequence

import numpy as np
import pysindy as ps

from models import LEAST_GAIN, Fit, fitted
from records import Array, Lag, Record, gap

# Chosen: steps in a time constant, so that the 11 of the smoothed differences are a quarter of it, and one delay a tenth.
DIFFERENTIATED_STEPS, DELAYED_STEPS = 40, 10
# Chosen: the default of 0.1, a tenth of it and three times it; what each leaves of the rows that are fitted decides.
THRESHOLDS = (0.01, 0.1, 0.3)

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


def factors(powers: Array) -> tuple[Array, Array]:
    """The two factors of each product of at most two: places in a row that starts with a one."""
    places = [[0, 0, *np.repeat(np.arange(1, len(row) + 1), row)][-2:] for row in powers]
    return np.array(places)[:, 0], np.array(places)[:, 1]


def run(scaled: Sequence[Scaled], powers: Array, coefficients: Array, step: float, *, delays: bool) -> list[Array]:
    """Simulates all records at once: Heun's method, or the next value from the two last ones."""
    count = max(len(one.v) for one in scaled)
    v = np.stack([np.pad(one.v, (0, count - len(one.v)), mode="edge") for one in scaled], axis=1)
    z = np.array([one.z[0] for one in scaled])
    before, out = z, np.empty((count + 1, len(scaled)))
    out[0] = z
    left, right = factors(powers)
    one = np.ones_like(z)

    def value(*inputs: Array) -> Array:
        row = np.stack([one, *inputs])
        return coefficients @ (row[left] * row[right])

    for k in range(count):
        if delays:
            before, z = z, value(z, before, v[k], v[max(k - 1, 0)])
        else:
            first = value(z, v[k])
            z = z + 0.5 * step * (first + value(z + step * first, v[k]))
        z = np.clip(z, -1e3, 1e3)
        out[k + 1] = z
    return [out[: len(one.z), place] for place, one in enumerate(scaled)]


def with_polynomials(records: list[Record], lags: dict[float, Lag], *, delays: bool) -> Fit:
    """Degree 2 and, of thresholds from none on, that which simulates the fitted rows best."""
    steps = DELAYED_STEPS if delays else DIFFERENTIATED_STEPS
    scaled = [Scaled(record, lags[record.nominal], steps) for record in records]
    trained = [one for one in scaled if one.record.is_fitted]
    step = 1.0 / steps

    def fit(threshold: float, degree: int) -> tuple[float, ps.PolynomialLibrary, Array, list[Array]]:
        library = ps.PolynomialLibrary(degree=degree)
        optimizer = ps.STLSQ(threshold=threshold * (step if delays else 1.0), alpha=1e-6)
        if delays:
            states = [np.stack([one.z[1 : one.fitted], one.z[: one.fitted - 1]], axis=1) for one in trained]
            inputs = [np.stack([one.v[1 : one.fitted], one.v[: one.fitted - 1]], axis=1) for one in trained]
            nexts = [np.stack([one.z[2 : one.fitted + 1], one.z[1 : one.fitted]], axis=1) for one in trained]
            model = ps.DiscreteSINDy(optimizer=optimizer, feature_library=library)
            model.fit(states, t=step, u=inputs, x_next=nexts)
        else:
            model = ps.SINDy(
                optimizer=optimizer, feature_library=library, differentiation_method=ps.SmoothedFiniteDifference()
            )
            model.fit([one.z[: one.fitted, None] for one in trained], t=step, u=[one.v[: one.fitted, None] for one in trained])
        coefficients = np.asarray(model.coefficients())[0]
        powers = np.asarray(library.powers_)
        simulated = [one.by_row(z) for one, z in zip(scaled, run(scaled, powers, coefficients, step, delays=delays), strict=True)]
        return gap(records, simulated, fitted), powers, coefficients, simulated

    linear = min((fit(threshold, 1) for threshold in THRESHOLDS), key=lambda one: one[0])
    curved = min((fit(threshold, 2) for threshold in THRESHOLDS), key=lambda one: one[0])
    is_curved = curved[0] < (1.0 - LEAST_GAIN) * linear[0]
    error, powers, coefficients, simulated = curved if is_curved else linear
    names: list[tuple[str, ...]] = [CURVED] if is_curved else []
    if delays and np.any(coefficients[(powers[:, 1] > 0) | (powers[:, 3] > 0)]):
        names.append(DELAYED)
    present = [(p, c) for p, c in zip(powers.tolist(), coefficients.tolist(), strict=True) if c]
    equation = " ".join(f"{c:+.3g} {''.join(map(str, p))}" for p, c in present)
    return Fit(names, {}, f"{equation}; gap of the fitted rows {error:.2f} %", simulated)
