"""What runs between flight controller and ESC."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Optional

import numpy as np
import numpy.typing as npt

from . import _native
from ._document import Document
from ._json import Floats, items, number, text
from ._optional import package

if TYPE_CHECKING:
    import control  # type: ignore[import-untyped]
    import matplotlib.axes

# Angular frequencies of a response unless others are asked for, and the lowest of them.
COUNT, LOWEST_RAD_S = 400, 0.1
# How far below its peak a magnitude is drawn, dB. Chosen: a hundredth, which no loop feels.
DEPTH_DB = 40.0


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """A compensator's response to small signals around nominal commands: the filter with its rounded coefficients, at the rate of its
    loop."""

    #: Nominal commands, 0 to 1, shape (n,).
    nominal: Floats
    #: Angular frequencies, rad/s, shape (m,).
    omega_rad_s: Floats
    #: Complex response, shape (n, m), 1 at rest.
    response: npt.NDArray[np.complex128]

    @property
    def magnitude_db(self) -> Floats:
        """Magnitude in dB, shape (n, m)."""
        found: Floats = 20 * np.log10(np.abs(self.response))
        return found

    @property
    def phase_deg(self) -> Floats:
        """Phase in degrees, unwrapped along the frequencies, shape (n, m)."""
        found: Floats = np.degrees(np.unwrap(np.angle(self.response), axis=1))
        return found

    def plot(self, ax: Optional[Sequence[matplotlib.axes.Axes]] = None) -> tuple[matplotlib.axes.Axes, ...]:
        """Draws magnitude and phase with matplotlib, in the two axes `ax` or in a new figure of pyplot. Returns the axes."""
        if ax is None:
            pyplot = package("matplotlib.pyplot", "a figure")
            ax = tuple(pyplot.subplots(2, 1, sharex=True, layout="constrained", figsize=(7.5, 5))[1])
        upper, lower = ax
        for nominal, magnitude, phase in zip(self.nominal, self.magnitude_db, self.phase_deg):
            # Towards half the rate of the loop it falls to nothing, which would be all that is seen.
            shown = magnitude > magnitude.max() - DEPTH_DB
            upper.plot(self.omega_rad_s[shown], magnitude[shown], label=f"u_nom {nominal:g}")
            lower.plot(self.omega_rad_s[shown], phase[shown])
        upper.set(xscale="log", ylabel="magnitude, dB")
        lower.set(xscale="log", ylabel="phase, degrees", xlabel="frequency, rad/s")
        for each in (upper, lower):
            each.grid(True, color="0.9")
        upper.legend(fontsize="small")
        return upper, lower


class Compensator(Document):
    """A lead or an inverse, with the integers that a controller makes of it: the file `compensator.toml`."""

    _kind: ClassVar[str] = "compensator"

    @property
    def kind(self) -> str:
        """`lead` or `inverse`."""
        return text(self._keys, "kind") or "lead"

    @property
    def loop_rate_hz(self) -> float:
        """Rate at which the filter runs, Hz."""
        return number(self._keys, "loop_rate_hz")

    @property
    def nominal(self) -> tuple[float, ...]:
        """Commands of the table of an inverse, 0 to 1; none of a lead, which is the same at all."""
        return tuple(float(one) for one in items(self._keys, "nominal") if isinstance(one, (int, float)))

    def frequency_response(
        self, nominal: npt.ArrayLike = 0.5, omega_rad_s: Optional[npt.ArrayLike] = None
    ) -> FrequencyResponse:
        """Its response around nominal commands, 0 to 1, at angular frequencies in rad/s; unless given, from 0.1 rad/s up to half the
        rate of its loop."""
        if omega_rad_s is None:
            omega_rad_s = np.geomspace(LOWEST_RAD_S, np.pi * self.loop_rate_hz, COUNT)
        around = np.atleast_1d(np.asarray(nominal, dtype=np.float64))
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
        response = _native.response(self._keys, around.tolist(), omega.tolist())
        return FrequencyResponse(around, omega, response)

    def tf(self, nominal: Optional[float] = None) -> control.TransferFunction:
        """The continuous lead that it is for small signals, equation (3) of the paper, as a transfer function of python-control.

        An inverse is another one at each nominal command, which is needed then; where it is bypassed, it is 1. Raises ImportError
        where there is no python-control.
        """
        library = package("control", "a transfer function")
        if nominal is None and self.kind != "lead":
            raise ValueError("an inverse is another filter at each nominal command: give one, as in tf(nominal=0.5)")
        lead = _native.lead_at(self._keys, 0.5 if nominal is None else nominal)
        made: control.TransferFunction
        if lead is None:
            made = library.tf([1.0], [1.0])
        else:
            zero, pole, damping = lead
            made = library.tf([pole**2 / zero, pole**2], [1.0, 2 * damping * pole, pole**2])
        return made

    def __repr__(self) -> str:
        keys = ("zero_rad_s", "pole_rad_s") if self.kind == "lead" else ("natural_rad_s",)
        said = ", ".join(f"{key}={number(self._keys, key):.4g}" for key in (*keys, "damping"))
        return f"<rotorlead.Compensator: {self.kind}, {said}, at {self.loop_rate_hz:g} Hz>"
