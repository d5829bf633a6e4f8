"""The lags of a motor at its nominal commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, NamedTuple, Optional

import numpy as np
import numpy.typing as npt

from . import _native
from ._answer import STYLE
from ._document import Document
from ._json import Object, Table, child, children, number, table, text, texts
from ._optional import package

if TYPE_CHECKING:
    import control  # type: ignore[import-untyped]
    import pandas

# Numbers of a point that every model may have; others, of which there are none, are NaN.
COLUMNS = (
    "nominal",
    "gain",
    "gain_std",
    "time_constant_s",
    "time_constant_s_std",
    "delay_s",
    "delay_s_std",
    "time_constant_up_s",
    "time_constant_down_s",
    "fit_frequency_percent",
    "fit_square_percent",
    "fit_step_percent",
)


class Lag(NamedTuple):
    """`gain e^(-s delay_s) / (time_constant_s s + 1)`, equation (1) of the paper."""

    #: Newtons or revolutions per minute, for the whole command.
    gain: float
    time_constant_s: float
    delay_s: float


class Judgement(NamedTuple):
    """Whether a compensator may be built on a model."""

    #: `ready`, `ready within limits`, `measure again` or `not a lag`.
    state: str
    #: What speaks against it, each with what to do.
    limits: tuple[str, ...]

    @classmethod
    def _from_json(cls, json: Object) -> Judgement:
        return cls(text(json, "state"), texts(json, "limits"))


class Model(Document):
    """A motor at its nominal commands: the file `model.toml`.

    >>> motor = Model.from_dict({"point": [{"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071}]})
    >>> motor.points.time_constant_s[0]
    0.071
    """

    _kind: ClassVar[str] = "model"

    @property
    def points(self) -> Table:
        """A row for each nominal command, rising, shape (n,): `nominal` 0 to 1; `gain` in N or 1/min for the whole command;
        `time_constant_s`, `delay_s`, `time_constant_up_s` and `time_constant_down_s` in s; standard errors end in `_std`, fits in
        `_percent`. What is not known is NaN, but for `delay_s`, which is 0."""
        rows = [{"delay_s": 0.0, **point} for point in children(self._keys, "point")]
        return table(rows, COLUMNS)

    @property
    def effects(self) -> tuple[str, ...]:
        """What acts beside the lags, by its kind."""
        return tuple(text(effect, "kind") for effect in children(self._keys, "effect"))

    @property
    def judgement(self) -> Optional[Judgement]:
        """Whether a compensator may be built on it; None where it was not identified."""
        judged = child(child(self._keys, "provenance"), "judgement")
        return Judgement._from_json(judged) if judged else None

    def lag(self, nominal: Optional[float] = None) -> Lag:
        """The lag at a command, 0 to 1, between points along straight lines. A model of one point needs none.

        Raises Error beyond the points, and ValueError where there are several and none is asked for.
        """
        points = self.points
        if nominal is None:
            if len(points) != 1:
                known = ", ".join(f"{one:g}" for one in points.nominal)
                raise ValueError(f"which nominal command? The model has {known or 'none'}: give one, as in lag(nominal=0.5)")
            nominal = float(points.nominal[0])
        return Lag(*_native.lag_at(self._keys, nominal))

    def response(self, omega_rad_s: npt.ArrayLike, nominal: Optional[float] = None) -> npt.NDArray[np.complex128]:
        """Frequency response of the lag at a command, in units of its gain, complex, of the shape of `omega_rad_s`, rad/s.
        Effects are not in it. Raises as `lag` does."""
        gain, time_constant_s, delay_s = self.lag(nominal)
        s = 1j * np.asarray(omega_rad_s, dtype=np.float64)
        found: npt.NDArray[np.complex128] = gain * np.exp(-s * delay_s) / (time_constant_s * s + 1)
        return found

    def tf(self, nominal: Optional[float] = None, *, pade: int = 2) -> control.TransferFunction:
        """The lag at a command as a transfer function of python-control, from command to response.

        Its dead time is Padé's approximation of order `pade`; 0 leaves it out. Of order 2 its phase is within 1 degree while
        `omega delay_s` is below 1.7. Effects are not in it. Raises ImportError where there is no python-control, and as `lag` does.

        >>> model.tf(0.5, pade=3)                                       # doctest: +SKIP
        """
        library = package("control", "a transfer function")
        gain, time_constant_s, delay_s = self.lag(nominal)
        made: control.TransferFunction = library.tf([gain], [time_constant_s, 1.0])
        if pade > 0 and delay_s > 0.0:
            made = made * library.tf(*library.pade(delay_s, pade))
        return made

    def frame(self) -> pandas.DataFrame:
        """The points as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        return frame(self.points)

    def __repr__(self) -> str:
        points = self.points
        said = ", ".join(f"{1e3 * point.time_constant_s:.1f} ms at {point.nominal:g}" for point in points) or "a static map"
        beside = f"; {', '.join(self.effects)}" if self.effects else ""
        return f"<rotorlead.Model: {said}{beside}>"

    def _repr_html_(self) -> str:
        heads = ("nominal", "gain", "time constant [ms]", "dead time [ms]")
        rows = "".join(
            f"<tr><td>{point.nominal:g}</td><td>{_with_std(point.gain, point.gain_std)}</td>"
            f"<td>{_with_std(1e3 * point.time_constant_s, 1e3 * point.time_constant_s_std)}</td>"
            f"<td>{_with_std(1e3 * point.delay_s, 1e3 * point.delay_s_std)}</td></tr>"
            for point in self.points
        )
        return (
            f'<div style="{STYLE}"><table><thead><tr>{"".join(f"<th>{head}</th>" for head in heads)}</tr></thead>'
            f"<tbody>{rows}</tbody></table></div>"
        )


def _with_std(value: float, std: float) -> str:
    return f"{value:.4g}" if np.isnan(std) else f"{value:.4g} ± {std:.2g}"


def frame(points: Table) -> pandas.DataFrame:
    """A table as a DataFrame of pandas."""
    columns = {name: points[name] for name in points.dtype.names or ()}
    made: pandas.DataFrame = package("pandas", "a table as a DataFrame").DataFrame(columns)
    return made


def with_intervals(model: Model, rows: list[Object], intervals: list[Object]) -> Table:
    """The points of an identification with the ends of their intervals."""
    named = ("gain", "time_constant_s", "delay_s")
    ends = {number(each, "nominal"): each for each in intervals}
    joined: list[Object] = []
    for row in rows:
        each = ends.get(number(row, "nominal"), {})
        made: Object = {"delay_s": 0.0, **{key: value for key, value in row.items()}}
        for name in named:
            made[f"{name}_low"], made[f"{name}_high"] = (child(each, name).get(end) for end in ("low", "high"))
        joined.append(made)
    columns = [column for name in COLUMNS for column in [name] + ([f"{name[:-4]}_low", f"{name[:-4]}_high"] if name.endswith("_std") else [])]
    return table(joined, [*columns, "reduced_chi_square"])
