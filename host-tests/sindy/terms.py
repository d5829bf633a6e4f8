"""The laws of the catalog as terms of a SINDy library: what each makes of the command, less the command."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.signal import lfilter

from records import Array

# What a term's value is read from: from the place of the term on its grid, that times its coefficient, or the coefficient.
Reading = Literal["grid", "scaled", "coefficient"]

# Laws of the state, `(1 / tau) law(z, v, nominal)`: `z` is the response as a deviation of the command, `v` the command's deviation.
STATE_LAWS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "asymmetric_lag": lambda z, v, nominal: np.maximum(v - z, 0.0),
    "operating_point_lag": lambda z, v, nominal: z * (v - z) / nominal,
    "absolute_response": lambda z, v, nominal: np.abs(z),
}


@dataclass(frozen=True)
class Term:
    """One column of the library: the effect that it stands for, and its value."""

    kind: str
    value: float
    reading: Reading


@dataclass(frozen=True)
class Commands:
    """The commands of several records as columns of deviations from their nominal commands."""

    deviation: Array
    nominal: Array
    step_s: float

    def lagged(self, time_constant_s: float) -> Array:
        decay = np.exp(-self.step_s / time_constant_s)
        before = np.concatenate([self.deviation[:1], self.deviation[:-1]])
        at_rows = lfilter([1.0 - decay], [1.0, -decay], before, axis=0, zi=decay * self.deviation[:1])[0]
        return mean_over_rows(at_rows)

    def shifted(self, shift_s: Array) -> Array:
        """The command as it was so long before each row, in the mean over the row."""
        rows = np.arange(len(self.deviation) + 1)
        total = np.concatenate([0.0 * self.deviation[:1], np.cumsum(self.deviation - self.deviation[0], axis=0)])
        columns = [np.interp(rows - shift_s / self.step_s, rows, column) for column in total.T]
        return np.diff(np.stack(columns, axis=1), axis=0) + self.deviation[0]

    def averaged(self, window_s: float) -> Array:
        rows = np.arange(len(self.deviation), dtype=float)
        total = np.concatenate([0.0 * self.deviation[:1], np.cumsum(self.deviation - self.deviation[0], axis=0)])
        columns = [column[:-1] - np.interp(rows - window_s / self.step_s, np.append(rows, len(rows)), column) for column in total.T]
        return mean_over_rows(np.stack(columns, axis=1) * self.step_s / window_s + self.deviation[0])

    def resonant(self, frequency_hz: float, damping: float = 0.05) -> Array:
        """A mode of unit gain, matched at its poles."""
        radius = np.exp(-2.0 * np.pi * frequency_hz * damping * self.step_s)
        angle = 2.0 * np.pi * frequency_hz * np.sqrt(1.0 - damping**2) * self.step_s
        poles = np.array([1.0, -2.0 * radius * np.cos(angle), radius**2])
        return lfilter([0.0, poles.sum()], poles, self.deviation - self.deviation[0], axis=0) + self.deviation[0]

    def held(self, frame_hz: float) -> Array:
        """The command as it stood at the last frame, with frames from the record's start on."""
        times_s = np.arange(len(self.deviation)) * self.step_s
        frames_s = np.floor(times_s * frame_hz + 1e-9) / frame_hz
        return self.deviation[np.floor(frames_s / self.step_s + 1e-9).astype(int)]

    def rounded(self, step: float) -> Array:
        return np.round((self.deviation + self.nominal) / step) * step - self.nominal

    def clipped(self, most: float) -> Array:
        return np.minimum(self.deviation, most - self.nominal)

    def followed(self, follow: Callable[[Array, Array], Array], count: int) -> Array:
        """What a law with a memory makes of the commands, for several values at once: times by records by values."""
        value = np.repeat(self.deviation[0][:, None], count, axis=1)
        out = np.empty((len(self.deviation), *value.shape))
        for row, wanted in enumerate(self.deviation):
            value = follow(wanted[:, None], value)
            out[row] = value
        return out


def mean_over_rows(at_rows: Array) -> Array:
    """The mean over each row of what is known at its start."""
    return 0.5 * (at_rows + np.concatenate([at_rows[1:], at_rows[-1:]]))


def grid(low: float, high: float, factor: float) -> Array:
    """Values about a factor apart; none of an empty range."""
    if high <= low:
        return np.array([])
    return np.geomspace(low, high, 2 + int(np.log(high / low) / np.log(factor)))


def catalog(commands: Commands, time_constant_s: float) -> Iterator[tuple[Term, Array]]:
    """Every term with its columns, over ranges in parts of the time constant and of the command's swing, which hold those of the catalog.

    Chosen: factors of 1.3 to 1.6 from value to value, since nearer neighbors are nearly the same column.
    """
    v, tau, step_s = commands.deviation, time_constant_s, commands.step_s
    swing = float(np.ptp(v, axis=0).max())
    highest = float((v + commands.nominal).max())
    slews, plays, bands = grid(0.2 * swing / tau, 30 * swing / tau, 1.4), grid(0.02 * swing, 0.25 * swing, 1.3), grid(0.02 * swing, 0.2 * swing, 1.3)

    def single(kind: str, values: Array, reading: Reading, law: Callable[[float], Array]) -> Iterator[tuple[Term, Array]]:
        for value in values.tolist():
            yield Term(kind, value, reading), law(value) - v

    def several(kind: str, values: Array, follow: Callable[[Array, Array], Array]) -> Iterator[tuple[Term, Array]]:
        columns = commands.followed(follow, len(values))
        for place, value in enumerate(values.tolist()):
            yield Term(kind, value, "grid"), columns[:, :, place] - v

    yield from single("transport_delay", grid(0.003 * tau, tau, 1.6), "scaled", lambda x: commands.shifted(np.full(len(v) + 1, x)))
    yield from single("moving_average", grid(0.03 * tau, 2 * tau, 1.6), "scaled", commands.averaged)
    yield from single("second_pole", grid(0.01 * tau, 0.6 * tau, 1.6), "scaled", commands.lagged)
    yield from single("supply_sag", grid(3 * tau, 30 * tau, 1.6), "grid", commands.lagged)
    yield from single("esc_frame_hold", grid(4 / tau, 60 / tau, 1.3), "grid", commands.held)
    yield from single("stand_resonance", grid(1 / tau, min(9 / tau, 0.2 / step_s), 1.2), "grid", commands.resonant)
    yield from single("command_quantization", 1 / np.round(1 / grid(0.01 * swing, 0.2 * swing, 1.3)), "grid", commands.rounded)
    yield from single("saturation", np.linspace(highest - swing, highest, 14)[1:-1], "grid", commands.clipped)
    ramp = np.arange(len(v) + 1) * step_s * 1e-6
    yield from single("clock_skew", np.array([200.0]), "scaled", lambda ppm: commands.shifted(-ppm * ramp))
    yield from several("slew_limit", slews, lambda wanted, last: np.clip(wanted, last - slews * step_s, last + slews * step_s))
    yield from several("backlash", plays, lambda wanted, last: np.clip(last, wanted - plays, wanted + plays))
    yield from several("dead_band", bands, lambda wanted, last: np.where(np.abs(wanted - last) >= bands, wanted, last))
    share = np.linspace(0.0, 1.0, len(v))[:, None]
    yield Term("quadratic_thrust", 1.0, "coefficient"), v * v
    yield Term("gain_drift", 1.0, "coefficient"), v * share
    yield Term("gain_drift", 1.0, "coefficient"), share + 0.0 * v
    yield Term("absolute_command", 1.0, "coefficient"), np.abs(v)
