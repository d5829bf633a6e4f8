"""The questions, each of which is a command of the command line."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Optional, Union

import numpy as np

from . import _native
from ._answer import STYLE, Answer, Path, _escaped
from ._compensator import Compensator, FrequencyResponse
from ._document import given
from ._json import Object, Table, child, children, copied, number, optional, table, text, texts
from ._model import Judgement, Model, frame, with_intervals
from ._plan import Plan
from ._records import Records, Response
from ._records import given as given_records

if TYPE_CHECKING:
    import control  # type: ignore[import-untyped]
    import pandas

Kind = Literal["lead", "inverse"]
Purpose = Literal["force", "rate_loop"]
Stack = Literal[
    "betaflight",
    "px4",
    "ardupilot",
    "paparazzi",
    "indiflight",
    "gazebo",
    "isaac-lab",
    "aerial-gym",
    "crazyflow",
    "rotorpy",
    "gym-pybullet-drones",
    "px4-sih",
    "mujoco",
    "flightmare",
    "matlab",
    "python-control",
    "csv",
]
_BANDWIDTHS = (
    "nominal",
    "uncompensated_rad_s",
    "compensated_rad_s",
    "uncompensated_phase_deg",
    "compensated_phase_deg",
    "uncompensated_minus_90_rad_s",
    "compensated_minus_90_rad_s",
    "dead_time_s",
)
_FITS = ("nominal", "fit_percent", "ceiling_percent", "left_over_noise", "left_over_p_value", "model_error_percent")


@dataclass(frozen=True, repr=False, eq=False)
class Identification(Answer):
    """What `identify` finds: the lag at each nominal command, and how well it is known."""

    #: What `design`, `simulate`, `validate` and `diagnose` take.
    model: Model

    @cached_property
    def points(self) -> Table:
        """A row for each nominal command, shape (n,): the columns of `Model.points`, and the ends of the 95 % intervals, `_low` and
        `_high`, of `gain`, `time_constant_s` and `delay_s`. What is not known is NaN."""
        return with_intervals(self.model, children(self._values, "points"), children(self._values, "intervals"))

    @property
    def judgement(self) -> Judgement:
        """Whether a compensator may be built on the model."""
        return Judgement._from_json(child(self._values, "judgement"))

    @property
    def response(self) -> str:
        """The column that is the response, `thrust` or `rpm`."""
        return "rpm" if text(self._values, "output") == "rpm" else "thrust"

    def frame(self) -> pandas.DataFrame:
        """The points as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        return frame(self.points)

    def tf(self, nominal: Optional[float] = None, *, pade: int = 2) -> control.TransferFunction:
        """`Model.tf` of the model."""
        return self.model.tf(nominal, pade=pade)

    def _section(self) -> str:
        return "identification"


@dataclass(frozen=True, repr=False, eq=False)
class Design(Answer):
    """What `design` makes of a model: a compensator, and what is predicted of it."""

    compensator: Compensator

    @cached_property
    def points(self) -> Table:
        """A row for each point of the model, shape (n,): `nominal` 0 to 1, bandwidths and the frequencies of -90 degrees in rad/s,
        without and with the compensator, phases there in degrees, and the dead time in s."""
        return table(children(self._values, "points"), _BANDWIDTHS)

    @cached_property
    def frequency_response(self) -> FrequencyResponse:
        """The compensator's response at each point of the model, up to half the rate of its loop."""
        return self.compensator.frequency_response(self.points.nominal)

    def tf(self, nominal: Optional[float] = None) -> control.TransferFunction:
        """`Compensator.tf` of the compensator."""
        return self.compensator.tf(nominal)

    def frame(self) -> pandas.DataFrame:
        """The points as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        return frame(self.points)


@dataclass(frozen=True, repr=False, eq=False)
class Bandwidth(Answer):
    """What `bandwidth` predicts of a model, without and with a compensator, and measures on records."""

    @cached_property
    def points(self) -> Table:
        """As `Design.points`."""
        return table(children(self._values, "points"), _BANDWIDTHS)

    @cached_property
    def measured(self) -> Table:
        """A row for each multisine record: `file`, `nominal` 0 to 1, `bandwidth_rad_s`, and the ends of its 95 % interval, `low_rad_s`
        and `high_rad_s`; NaN where it is beyond what was excited."""
        rows: list[Object] = []
        for row in children(self._values, "measured"):
            ends = row.get("interval_rad_s")
            low, high = ends if isinstance(ends, list) and len(ends) == 2 else (None, None)
            rows.append({**row, "low_rad_s": low, "high_rad_s": high})
        return table(rows, ("nominal", "bandwidth_rad_s", "low_rad_s", "high_rad_s"), ("file",))

    def frame(self) -> pandas.DataFrame:
        """The points as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        return frame(self.points)


@dataclass(frozen=True, repr=False, eq=False)
class Validation(Answer):
    """What `validate` finds: how well a model explains each record."""

    @cached_property
    def records(self) -> Table:
        """A row for each record: `file`, `excitation`, `nominal` 0 to 1, `fit_percent` and what a perfect model would score,
        `ceiling_percent`; the residual's power over that of the noise, `left_over_noise`, how likely noise alone leaves it,
        `left_over_p_value`, and the model's error in percent of the response, `model_error_percent`. NaN where it is not known."""
        return table(children(self._values, "records"), _FITS, ("file", "excitation"))

    @property
    def judgement(self) -> Judgement:
        """Whether a compensator may be built on the model."""
        return Judgement._from_json(child(self._values, "judgement"))

    def frame(self) -> pandas.DataFrame:
        """The records as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        return frame(self.records)


@dataclass(frozen=True)
class Parameter:
    """A number of an effect."""

    value: float
    #: Standard error in the unit of the value; None where it is not known.
    std: Optional[float]
    #: Unit; empty for none.
    unit: str


@dataclass(frozen=True)
class Effect:
    """What a model lacks."""

    #: Its kind in the catalog, such as `second_pole`.
    kind: str
    parameters: Mapping[str, Parameter]
    #: What to do about it.
    to_do: str

    @classmethod
    def _from_json(cls, json: Object) -> Effect:
        parameters = {name: child(child(json, "parameters"), name) for name in child(json, "parameters")}
        made = {
            name: Parameter(number(one, "value"), optional(one, "std"), text(one, "unit")) for name, one in parameters.items()
        }
        return cls(text(json, "kind"), made, text(json, "to_do"))


@dataclass(frozen=True)
class Gap:
    """Residuals on records that were held out, as RMS shares of the response, 0 to 1."""

    #: Of the lags alone.
    before: float
    #: With the effects.
    after: float
    #: Of the noise; NaN where it is not known.
    noise_floor: float


@dataclass(frozen=True)
class Ramp:
    """How fast an ESC lets its command change in one direction, in % of the range in a millisecond."""

    #: As found; NaN where no ramp shows.
    rate_percent_per_ms: float
    #: Ends of its 95 % interval; without a rate a slower ramp than `low` would have been seen. NaN where nothing is known.
    low_percent_per_ms: float
    high_percent_per_ms: float

    @classmethod
    def _from_json(cls, json: Object) -> Ramp:
        return cls(*(number(json, f"{name}_percent_per_ms") for name in ("rate", "low", "high")))


@dataclass(frozen=True)
class EscRamp:
    """The ramps of an ESC."""

    #: Of a command that rises.
    up: Ramp
    #: Of one that falls.
    down: Ramp


@dataclass(frozen=True, repr=False, eq=False)
class Diagnosis(Answer):
    """What `diagnose` finds: the effects that a model lacks."""

    #: The model with the effects.
    model: Model
    #: The experiment that would say more; None where none is needed.
    plan: Optional[Plan] = None

    @property
    def verdict(self) -> str:
        """`agrees`, `named`, or what else docs/diagnosis.md lists."""
        return text(self._values, "verdict")

    @property
    def effects(self) -> tuple[Effect, ...]:
        """What the model lacks, the largest first."""
        return tuple(Effect._from_json(each) for each in children(self._values, "effects"))

    @property
    def gap(self) -> Gap:
        """How much simulation and measurement disagree."""
        gap = child(self._values, "gap")
        return Gap(number(gap, "before"), number(gap, "after"), number(gap, "noise_floor"))

    @property
    def esc_ramp(self) -> EscRamp:
        """What ramp the ESC has."""
        ramp = child(self._values, "esc_ramp")
        return EscRamp(*(Ramp._from_json(child(ramp, direction)) for direction in ("up", "down")))


@dataclass(frozen=True)
class ExportedParameter:
    """A number under the name of a stack."""

    name: str
    value: float
    #: Ends of its 95 % interval; NaN where the model has no uncertainty for it.
    low: float
    high: float
    unit: str
    #: What the stack takes it for.
    definition: str
    #: The releases of the stack that take it so, where others do not; else empty.
    releases: str


@dataclass(frozen=True)
class ReplayedRecord:
    """A record as a simulator explains it with the exported numbers, beside the model."""

    #: Version and settings of the simulator.
    simulator: str
    file: str
    #: % fit of the simulator.
    fit_percent: float
    #: % fit of the model on the same rows.
    model_fit_percent: float


def _of_releases(name: str, releases: str) -> str:
    return f"{name} of releases {releases}" if releases else name


@dataclass(frozen=True, repr=False, eq=False)
class Export:
    """What `export` writes for a flight stack, a simulator or a program."""

    stack: str
    _values: Object
    #: The content of the file.
    content: bytes
    _is_text: bool

    @property
    def text(self) -> str:
        """The content of the file as text. Raises ValueError for a file of MATLAB, which is none."""
        if not self._is_text:
            raise ValueError(f"the file for {self.stack} is no text: write it with `write`, or take `content`")
        return self.content.decode()

    @property
    def parameters(self) -> tuple[ExportedParameter, ...]:
        """The parameters of a stack or a simulator; none of a frequency response."""
        return tuple(
            ExportedParameter(text(one, "name"), number(one, "value"), number(one, "low"), number(one, "high"),
                              text(one, "unit"), text(one, "definition"), text(one, "releases"))
            for one in children(self._values, "parameters")
        )

    @property
    def refused(self) -> Mapping[str, str]:
        """The parameters that the measurements do not tell, and why."""
        return {_of_releases(text(one, "name"), text(one, "releases")): text(one, "why")
                for one in children(self._values, "refused")}

    @property
    def replays(self) -> tuple[ReplayedRecord, ...]:
        """The records of `records` that move their command through the simulator's own law; none without them, or of no simulator."""
        return tuple(
            ReplayedRecord(text(child(replay, "stepping"), "name"), text(one, "file"), number(one, "fit_percent"),
                           number(one, "model_fit_percent"))
            for replay in children(self._values, "replays")
            for one in children(replay, "records")
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be known of the model first."""
        return texts(self._values, "warnings")

    def to_dict(self) -> Object:
        """The keys and values of `--json` of the command."""
        return copied(self._values)

    def write(self, path: Path) -> None:
        """Writes the file."""
        pathlib.Path(path).write_bytes(self.content)

    def __repr__(self) -> str:
        named = ((_of_releases(one.name, one.releases), one.value) for one in self.parameters)
        said = ", ".join(f"{name} = {value:.4g}" for name, value in named) or f"{len(self.content)} bytes"
        return f"<rotorlead.Export for {self.stack}: {said}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{_escaped(_of_releases(one.name, one.releases))}</td><td>{one.value:.4g}</td>"
            f"<td>{'' if one.low != one.low else f'{one.low:.4g} to {one.high:.4g}'}</td>"
            f"<td>{_escaped(one.unit)}</td></tr>"
            for one in self.parameters
        )
        refused = "".join(f"<li>{_escaped(name)}: {_escaped(why)}</li>" for name, why in self.refused.items())
        unknown = f"<details><summary>{len(self.refused)} not known</summary><ul>{refused}</ul></details>" if refused else ""
        return (
            f'<div style="{STYLE}"><table><caption style="text-align:left">Parameters for {self.stack}</caption><thead><tr>'
            f"<th>name</th><th>value</th><th>95 % interval</th><th>unit</th></tr></thead><tbody>{rows}</tbody></table>{unknown}</div>"
        )


@dataclass(frozen=True, repr=False, eq=False)
class Report(Answer):
    """All that records say of a motor: identification, validation, diagnosis and compensator."""

    @property
    def judgement(self) -> Judgement:
        """Whether a compensator may be built on the model."""
        return Judgement._from_json(child(self._values, "judgement"))

    @cached_property
    def points(self) -> Table:
        """As `Model.points`."""
        return with_intervals(Model({}), children(self._values, "points"), [])


def identify(
    records: Union[Records, Path],
    *,
    delay: Literal["auto", "none", "fit"] = "auto",
    response: Optional[Response] = None,
    out: Optional[Path] = None,
) -> Identification:
    """Finds the lag at each nominal command: `rotorlead identify`.

    `records` are Records, or the folder of an experiment, whose longest files stay on disk. `delay` says whether a dead time is part of
    the lag of multisine records: where they show one, never, or wherever the best one is above zero. `response` is the column that is
    fitted, `thrust` or `rpm`; what the records say unless given. `out` is where the model goes.

    Raises Error where the records are wrong or show no lag.

    >>> found = rotorlead.identify("stand")                             # doctest: +SKIP
    >>> found.points.time_constant_s                                    # doctest: +SKIP
    """
    (values, page), model = _native.identify(given_records(records), delay, response, out)
    return Identification(values, page, Model(model))


def simulate(
    model: Union[Model, Path],
    plan: Union[Plan, Path, None] = None,
    *,
    compensator: Union[Compensator, Path, None] = None,
    seed: Optional[int] = None,
    out: Optional[Path] = None,
) -> Records:
    """Runs an experiment on a simulated motor, through the controller's own code: `rotorlead simulate`.

    `plan` is what to run; the paper's experiment unless given. `compensator` is put in front of the ESC. `seed`, from 0 to 2^63 - 1, is
    that of the noise, instead of the plan's: the same arguments give the same numbers. `out` is the folder of the experiment, which
    is made.

    Raises Error where the model does not allow the plan.

    >>> rotorlead.identify(rotorlead.simulate(model, seed=1))           # doctest: +SKIP
    """
    planned = None if plan is None else given(plan, Plan)
    before = None if compensator is None else given(compensator, Compensator)
    return Records._from_native(_native.simulate(given(model, Model), planned, before, seed, out))


def diagnose(
    records: Union[Records, Path],
    model: Union[Model, Path, None] = None,
    *,
    out_model: Optional[Path] = None,
    out_plan: Optional[Path] = None,
) -> Diagnosis:
    """Finds where a model and records disagree, and names the effects that the model lacks: `rotorlead diagnose`.

    `model` is the model to be judged; the lags that the records show unless given. `out_model` is where the model with the effects
    goes, and `out_plan` the plan of the experiment that would say more.

    Raises Error where the records are wrong or cannot be compared.

    >>> [effect.kind for effect in rotorlead.diagnose("stand").effects]  # doctest: +SKIP
    """
    judged = None if model is None else given(model, Model)
    (values, page), improved, plan = _native.diagnose(given_records(records), judged, out_model, out_plan)
    return Diagnosis(values, page, Model(improved), None if plan is None else Plan(plan))


def design(
    model: Union[Model, Path],
    *,
    kind: Optional[Kind] = None,
    purpose: Purpose = "force",
    omega_g_rad_s: Optional[float] = None,
    damping: Optional[float] = None,
    loop_rate_hz: Optional[float] = None,
    prewarp_rad_s: Optional[float] = None,
    natural_rad_s: Optional[float] = None,
    setting: Optional[Literal["exact", "robust"]] = None,
    slew_per_s: Optional[float] = None,
    output_range: Optional[tuple[float, float]] = None,
    compensate_range: Optional[tuple[float, float]] = None,
    out: Optional[Path] = None,
) -> Design:
    """Designs one compensator for all points of a model: `rotorlead design`, whose options these are.

    `kind` is what to design; what is recommended for the `purpose` unless given. `omega_g_rad_s`, the highest frequency to amplify, and
    `prewarp_rad_s` are of a lead; `natural_rad_s`, `setting`, and the commands `output_range` and `compensate_range`, 0 to 1, of an
    inverse. `damping` is that of the poles, `loop_rate_hz` the rate at which the filter runs, and `slew_per_s` the most by which the
    command changes in a second. `out` is where the compensator goes.

    Raises Error where none is recommended, or the kind cannot be designed for this model.

    >>> rotorlead.design(found.model, kind="lead").compensator          # doctest: +SKIP
    """
    (values, page), compensator = _native.design(
        given(model, Model),
        kind,
        purpose,
        omega_g_rad_s,
        damping,
        loop_rate_hz,
        prewarp_rad_s,
        natural_rad_s,
        setting,
        slew_per_s,
        output_range,
        compensate_range,
        out,
    )
    return Design(values, page, Compensator(compensator))


def export(
    model: Union[Model, Path],
    stack: Stack,
    *,
    records: Union[Records, Path, None] = None,
    compensator: Union[Compensator, Path, None] = None,
    at: Optional[float] = None,
    output_range: Optional[tuple[float, float]] = None,
    motors: Optional[int] = None,
    step_rate_hz: Optional[float] = None,
    out: Optional[Path] = None,
) -> Export:
    """Gives a model's parameters as a flight stack or a simulator calls them: `rotorlead export`, whose options these are.

    `records` say what the model does not, are replayed by a simulator's own law, and are needed for the frequency responses of
    `matlab`, `python-control` and `csv`, which may have a `compensator` in them. `at` is the command, 0 to 1, at which a time constant
    is taken, `output_range` the commands of the stack's lowest and highest motor output, `motors` their number, and `step_rate_hz` the
    steps per second of the simulation. `out` is where the file goes.

    Raises Error where the measurements tell none of the parameters.

    >>> print(rotorlead.export(found.model, "px4").text)                # doctest: +SKIP
    """
    values, content, is_text = _native.export(
        given(model, Model),
        stack,
        None if records is None else given_records(records),
        None if compensator is None else given(compensator, Compensator),
        at,
        output_range,
        motors,
        step_rate_hz,
        out,
    )
    return Export(stack, values, content, is_text)


def validate(model: Union[Model, Path], records: Union[Records, Path]) -> Validation:
    """Says how well a model explains each record: `rotorlead validate`.

    Multisine records are compared in the frequency domain, all others in time, by `100 (1 - |y - yhat| / |y - mean y|)` percent.

    Raises Error where the records cannot be compared with the model.

    >>> rotorlead.validate(found.model, "other").records.fit_percent    # doctest: +SKIP
    """
    values, page = _native.validate(given(model, Model), given_records(records))
    return Validation(values, page)


def bandwidth(
    model: Union[Model, Path],
    compensator: Union[Compensator, Path, None] = None,
    *,
    sampled: bool = False,
    esc_frame_hz: Optional[float] = None,
    steps: Sequence[float] = (),
    robustness: bool = False,
    records: Union[Records, Path, Sequence[Union[Records, Path]]] = (),
) -> Bandwidth:
    """Predicts the bandwidth at each point of a model, without and with a compensator: `rotorlead bandwidth`.

    The bandwidth is the smallest frequency in rad/s at which the response is 3 dB below its static value. Without a compensator a lead
    is designed. `sampled` counts the rounded coefficients and the holds of loop and ESC, whose rate `esc_frame_hz` may be given.
    `steps` of these sizes, 0 to 1, and actuators that differ from the model, `robustness`, are simulated too; the bandwidths of
    multisine `records` are measured.

    Raises Error where the model gives no compensator, or records have no multisine.

    >>> rotorlead.bandwidth(found.model, lead.compensator).points.compensated_rad_s  # doctest: +SKIP
    """
    several = [records] if isinstance(records, (str, Records)) or hasattr(records, "__fspath__") else list(records)
    values, page = _native.bandwidth(
        given(model, Model),
        None if compensator is None else given(compensator, Compensator),
        sampled,
        esc_frame_hz,
        np.asarray(steps, dtype=np.float64).ravel().tolist(),
        robustness,
        [given_records(each) for each in several],
    )
    return Bandwidth(values, page)


def report(
    records: Union[Records, Path],
    model: Union[Model, Path, None] = None,
    *,
    kind: Optional[Kind] = None,
    purpose: Purpose = "force",
    diagnosis: bool = True,
    out: Optional[Path] = None,
) -> Report:
    """All that records say, in one page: `rotorlead report`.

    `model` is the model to be judged; unless given `model.toml` in the folder of the records, or else the lags that they show. `kind` and
    `purpose` are those of `design`; `diagnosis` is left out where it is False, since it takes the longest. `out` is where the page
    goes, one HTML file; `report` of the result writes it too.

    Raises Error where nothing comes of the records.

    >>> rotorlead.report("stand", out="stand.html").headline            # doctest: +SKIP
    """
    judged = None if model is None else given(model, Model)
    made = Report(*_native.overview(given_records(records), judged, kind, purpose, diagnosis))
    if out is not None:
        made.report(out)
    return made
