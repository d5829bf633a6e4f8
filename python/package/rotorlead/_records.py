"""Records of a motor: columns over time, and what drove them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, Optional, Protocol, SupportsIndex, Union

import numpy as np
import numpy.typing as npt

from . import _native
from ._answer import STYLE, _escaped
from ._json import Floats, Json, Object, children, optional, plain, text
from ._optional import package

if TYPE_CHECKING:
    import matplotlib.axes
    import pandas

Path = Union[str, "os.PathLike[str]"]
Response = Literal["thrust", "rpm"]
Excitation = Literal[
    "multisine", "square", "triangle", "step", "staircase", "chirp", "random", "steady", "flight", "free"
]
Pair = tuple[float, float]

OUTPUTS: dict[str, Response] = {"thrust_n": "thrust", "rpm": "rpm"}
COLUMNS = ("time_s", "command", "thrust_n", "rpm", "esc_command", "voltage_v", "current_a")
# Units of the columns of a frame where none is said: those of a record.
UNITS = {"time": "s", "command": "duty", "thrust": "N", "rpm": "rpm", "voltage": "V", "current": "A"}


class Frame(Protocol):
    """A DataFrame of pandas, polars or the like: columns by their names."""

    @property
    def columns(self) -> object: ...
    def __getitem__(self, name: str, /) -> object: ...


class Record:
    """One run: columns of one length, shape (n,), `float64` and not to be written to.

    `time_s` rises, in s; `command` is the command before any compensator, 0 to 1, and holds until the next row; `thrust_n` in N and
    `rpm` in 1/min are the responses, of which one is needed; `esc_command` is the command after a compensator, 0 to 1; `voltage_v` and
    `current_a` are those of the supply, in V and A. What was not recorded is None. `nominal` is the command around which it was run, 0
    to 1, `excitation` what drove it, and `period_s` its period, which a multisine, square or triangle needs.

    `Records` checks them. Complex, masked, text and boolean columns are refused.
    """

    __slots__ = ("_columns", "_keys")
    _columns: dict[str, Optional[Floats]]
    _keys: Object

    def __init__(
        self,
        *,
        time_s: npt.ArrayLike,
        command: npt.ArrayLike,
        nominal: float,
        excitation: Excitation,
        thrust_n: Optional[npt.ArrayLike] = None,
        rpm: Optional[npt.ArrayLike] = None,
        esc_command: Optional[npt.ArrayLike] = None,
        voltage_v: Optional[npt.ArrayLike] = None,
        current_a: Optional[npt.ArrayLike] = None,
        period_s: Optional[float] = None,
        amplitude: Optional[float] = None,
        compensated: bool = False,
        role: Optional[Literal["fit", "validate"]] = None,
        file: Optional[str] = None,
    ) -> None:
        columns = dict(zip(COLUMNS, (time_s, command, thrust_n, rpm, esc_command, voltage_v, current_a)))
        keys = {"file": file, "nominal": nominal, "excitation": excitation, "period_s": period_s, "amplitude": amplitude,
                "compensated": compensated, "role": role}
        object.__setattr__(self, "_columns", {name: _numbers(name, column) for name, column in columns.items()})
        object.__setattr__(self, "_keys", {key: plain(value) for key, value in keys.items() if value is not None})

    @classmethod
    def _from_native(cls, keys: Object, columns: dict[str, Optional[Floats]]) -> Record:
        made = cls.__new__(cls)
        for column in columns.values():
            if column is not None:
                column.flags.writeable = False
        object.__setattr__(made, "_columns", columns)
        object.__setattr__(made, "_keys", {key: value for key, value in keys.items() if value is not None})
        return made

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("a Record cannot be changed")

    def _column(self, name: str) -> Floats:
        column = self._columns[name]
        return np.empty(0) if column is None else column

    @property
    def time_s(self) -> Floats:
        return self._column("time_s")

    @property
    def command(self) -> Floats:
        return self._column("command")

    @property
    def thrust_n(self) -> Optional[Floats]:
        return self._columns["thrust_n"]

    @property
    def rpm(self) -> Optional[Floats]:
        return self._columns["rpm"]

    @property
    def esc_command(self) -> Optional[Floats]:
        return self._columns["esc_command"]

    @property
    def voltage_v(self) -> Optional[Floats]:
        return self._columns["voltage_v"]

    @property
    def current_a(self) -> Optional[Floats]:
        return self._columns["current_a"]

    @property
    def file(self) -> str:
        """What it is called: the name of its file."""
        return text(self._keys, "file")

    @property
    def nominal(self) -> float:
        return optional(self._keys, "nominal") or 0.0

    @property
    def excitation(self) -> str:
        return text(self._keys, "excitation")

    @property
    def period_s(self) -> Optional[float]:
        return optional(self._keys, "period_s")

    @property
    def amplitude(self) -> Optional[float]:
        return optional(self._keys, "amplitude")

    @property
    def compensated(self) -> bool:
        """Whether a compensator was in front of the ESC."""
        return self._keys.get("compensated") is True

    def __len__(self) -> int:
        return len(self.time_s)

    def frame(self) -> pandas.DataFrame:
        """The columns that there are as a DataFrame of pandas. Raises ImportError where there is no pandas."""
        columns = {name: column for name, column in self._columns.items() if column is not None}
        made: pandas.DataFrame = package("pandas", "a table as a DataFrame").DataFrame(columns)
        return made

    def plot(self, ax: Optional[Sequence[matplotlib.axes.Axes]] = None) -> tuple[matplotlib.axes.Axes, ...]:
        """Draws command and response over time with matplotlib, in the two axes `ax` or in a new figure of pyplot. Returns the axes."""
        if ax is None:
            pyplot = package("matplotlib.pyplot", "a figure")
            ax = tuple(pyplot.subplots(2, 1, sharex=True, layout="constrained", figsize=(7.5, 4.5))[1])
        upper, lower = ax
        upper.step(self.time_s, self.command, where="post", label="command")
        if self.esc_command is not None:
            upper.step(self.time_s, self.esc_command, where="post", label="ESC command")
        for column, label in ((self.thrust_n, "thrust, N"), (self.rpm, "speed, 1/min")):
            if column is not None:
                lower.plot(self.time_s, column, color="C2", linewidth=0.8)
                lower.set(ylabel=label)
                break
        upper.set(ylabel="command, 0 to 1", title=self.file)
        upper.legend(fontsize="small")
        lower.set(xlabel="time, s")
        for each in (upper, lower):
            each.grid(True, color="0.9")
        return upper, lower

    def __repr__(self) -> str:
        return f"<rotorlead.Record {self.file!r}: {self.excitation} at {self.nominal:g}, {len(self)} rows>"


class Records(Sequence[Record]):
    """Records of one motor, as `identify` and `diagnose` take them. `read`, `from_log` and `from_frame` make some, `simulate` gives some.

    `response` is the column that is the response, `thrust` or `rpm`; it is needed where records have both. `esc_frame_hz` is the rate at
    which the ESC takes over a command, `command_rate_hz` that at which the command is updated where that is faster than the rows, and
    `sample_rate_hz` that of the rows where they are evenly spaced, all in Hz and None where they are not known.

    Raises Error where a record breaks a rule: it says which, where, and what to do.
    """

    __slots__ = ("_experiment", "_keys", "_records")
    _keys: Object
    _experiment: _native.Experiment
    _records: tuple[Record, ...]

    def __init__(
        self,
        records: Sequence[Record],
        *,
        name: str = "records",
        response: Optional[Response] = None,
        sample_rate_hz: Optional[float] = None,
        esc_frame_hz: Optional[float] = None,
        command_rate_hz: Optional[float] = None,
    ) -> None:
        outputs = {shown: output for output, shown in OUTPUTS.items()}
        if response is not None and response not in outputs:
            raise _native.Error(f"`response`: `{response}` is not known\n  help: give one of: thrust, rpm")
        for record in records:
            if not isinstance(record, Record):
                raise TypeError(f"a Record is needed, and this is of the type {type(record).__name__}")
        experiment: dict[str, object] = {
            "name": name,
            "output": None if response is None else outputs[response],
            "sample_rate_hz": sample_rate_hz,
            "esc_frame_hz": esc_frame_hz,
            "command_rate_hz": command_rate_hz,
            "records": [{**record._keys, **record._columns} for record in records],
        }
        self._fill(_native.Experiment.from_dict(experiment))

    def _fill(self, experiment: _native.Experiment) -> None:
        keys = experiment.keys()
        made = [Record._from_native(each, experiment.columns(index)) for index, each in enumerate(children(keys, "records"))]
        object.__setattr__(self, "_keys", keys)
        object.__setattr__(self, "_experiment", experiment)
        object.__setattr__(self, "_records", tuple(made))

    @classmethod
    def _from_native(cls, experiment: _native.Experiment) -> Records:
        made = cls.__new__(cls)
        made._fill(experiment)
        return made

    @classmethod
    def read(cls, folder: Path) -> Records:
        """Reads the folder of an experiment, as `rotorlead import` and `write` make it. Raises Error with the place of what is wrong."""
        return cls._from_native(_native.Experiment.read(folder))

    @classmethod
    def from_log(
        cls,
        *paths: Path,
        columns: Optional[Mapping[str, str]] = None,
        response: Optional[Response] = None,
        excitation: Optional[Excitation] = None,
        period_s: Optional[float] = None,
        nominal: Optional[float] = None,
        amplitude: Optional[float] = None,
        seconds: Optional[Pair] = None,
        pulse_us: Optional[Pair] = None,
        motor_poles: Optional[int] = None,
        rate_hz: Optional[float] = None,
        motor: Optional[int] = None,
        log: Optional[int] = None,
        tare: bool = False,
        name: Optional[str] = None,
    ) -> Records:
        """Takes logs of other tools, a record of each, as `rotorlead import` does, whose options these are.

        `columns` says which column is what where its name does not: a quantity (`time`, `command`, `thrust`, `rpm`, `voltage` or
        `current`) and `HEADER:UNIT`, as in `{"time": "t:ms", "thrust": "load:gf"}`. `excitation` is what drove the command, `period_s`
        its period in s, `nominal` and `amplitude` the command around which it went and how far, 0 to 1; they are found where they can
        be. `seconds` is the part of the log to take, from its first row; `pulse_us` are the pulse widths in us of command 0 and 1;
        `motor_poles` the magnets of the rotor, for electrical revolutions; `rate_hz` the rows a second of a table without times;
        `motor` and `log`, from 1, which to take of several; `tare` subtracts the thrust at rest.

        Raises Error where the log is not recognized, or lacks what an option has to say.

        >>> Records.from_log("log.csv", excitation="staircase")         # doctest: +SKIP
        """
        options: dict[str, object] = {
            "columns": None if columns is None else [(str(key), str(value)) for key, value in columns.items()],
            "response": response,
            "excitation": excitation,
            "period_s": period_s,
            "nominal": nominal,
            "amplitude": amplitude,
            "seconds": seconds,
            "pulse_us": pulse_us,
            "motor_poles": motor_poles,
            "rate_hz": rate_hz,
            "motor": motor,
            "log": log,
            "tare": tare,
            "name": name,
        }
        return cls._from_native(_native.Experiment.from_logs_of(list(paths), options))

    @classmethod
    def from_frame(
        cls,
        frame: Frame,
        *,
        command: str,
        thrust: Optional[str] = None,
        rpm: Optional[str] = None,
        time: Optional[str] = None,
        voltage: Optional[str] = None,
        current: Optional[str] = None,
        excitation: Optional[Excitation] = None,
        period_s: Optional[float] = None,
        nominal: Optional[float] = None,
        amplitude: Optional[float] = None,
        pulse_us: Optional[Pair] = None,
        motor_poles: Optional[int] = None,
        rate_hz: Optional[float] = None,
        response: Optional[Response] = None,
        tare: bool = False,
        name: str = "frame",
    ) -> Records:
        """Takes a DataFrame of pandas or polars as one record, as `from_log` takes the same table in a file.

        Each column is given by its name, or as `NAME:UNIT` with a unit of `from_log`; unless given, `time` is in s, `command` 0 to 1,
        `thrust` in N, `rpm` in 1/min, `voltage` in V and `current` in A. Without `time` and `rate_hz` the index is the time. Times may
        be dates or durations too. Rows in which one of them is NaN are left out.

        Raises Error where the rows are no record, and KeyError where there is no such column.

        >>> Records.from_frame(frame, time="t:ms", command="throttle:percent", thrust="load:gf", excitation="staircase")  # doctest: +SKIP
        """
        named = {"time": time, "command": command, "thrust": thrust, "rpm": rpm, "voltage": voltage, "current": current}
        heads, values, choices = [], [], []
        known = [str(column) for column in frame.columns] if isinstance(frame.columns, (Sequence, np.ndarray)) else _listed(frame.columns)
        if time is None and rate_hz is None:
            heads.append("time")
            values.append(_seconds(getattr(frame, "index", None)))
            choices.append(("time", "time:s"))
        for quantity, column in named.items():
            if column is None:
                continue
            header, unit = (column, UNITS[quantity]) if column in known else _with_unit(column)
            if header not in known:
                raise KeyError(f"{quantity}={column!r}: there is no such column; there are: {', '.join(known)}")
            # What would be no header of a table is called by what it is.
            head = header if not set(header) & set(',;:"\t\n\r') and header.strip() == header and header else quantity
            heads.append(head)
            values.append(_seconds(frame[header]) if quantity == "time" else _series(quantity, frame[header]))
            choices.append((quantity, f"{head}:{unit}"))
        options: dict[str, object] = {
            "columns": choices,
            "excitation": excitation,
            "period_s": period_s,
            "nominal": nominal,
            "amplitude": amplitude,
            "pulse_us": pulse_us,
            "motor_poles": motor_poles,
            "rate_hz": rate_hz,
            "response": response,
            "tare": tare,
            "name": name,
        }
        rows = zip(*(column.tolist() for column in values))
        lines = (",".join("" if value != value else repr(value) for value in row) for row in rows)
        content = "\n".join([",".join(heads), *lines]) + "\n"
        return cls._from_native(_native.Experiment.from_table(f"{name}.csv", content.encode(), options))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("Records cannot be changed")

    @property
    def name(self) -> str:
        """What the experiment is called."""
        return text(self._keys, "name")

    @property
    def response(self) -> Response:
        """Which column is the response."""
        return OUTPUTS[text(self._keys, "output")]

    @property
    def sample_rate_hz(self) -> Optional[float]:
        return optional(self._keys, "sample_rate_hz")

    @property
    def esc_frame_hz(self) -> Optional[float]:
        return optional(self._keys, "esc_frame_hz")

    @property
    def command_rate_hz(self) -> Optional[float]:
        return optional(self._keys, "command_rate_hz")

    @property
    def logs(self) -> Json:
        """What was found in each log, and what of it was taken: `logs` of `rotorlead import --json`. None where they are from none."""
        return self._experiment.logs

    @property
    def notes(self) -> tuple[str, ...]:
        """What was guessed when logs were read."""
        logs = self.logs if isinstance(self.logs, list) else []
        notes = [log.get("notes") for log in logs if isinstance(log, dict)]
        return tuple(note for each in notes if isinstance(each, list) for note in each if isinstance(note, str))

    def write(self, folder: Path) -> None:
        """Writes them as the folder of an experiment, which is made. Raises Error where it is there already."""
        self._experiment.write(folder)

    def frame(self) -> pandas.DataFrame:
        """All rows as one DataFrame of pandas, with the record's file in the outer index. Raises ImportError where there is no pandas."""
        frames = {record.file: record.frame() for record in self}
        made: pandas.DataFrame = package("pandas", "a table as a DataFrame").concat(frames, names=["file", "row"])
        return made

    def __getitem__(self, index: SupportsIndex) -> Record:  # type: ignore[override]
        return self._records[index]

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[Record]:
        return iter(self._records)

    def __reduce__(self) -> tuple[object, tuple[dict[str, bytes]]]:
        return _from_files, (self._experiment.files(),)

    def __repr__(self) -> str:
        return f"<rotorlead.Records {self.name!r}: {len(self)} of {self.response}, {sum(map(len, self))} rows>"

    def _repr_html_(self) -> str:
        heads = ("record", "nominal", "excitation", "rows", "length [s]")
        rows = "".join(
            f"<tr><td>{_escaped(record.file)}</td><td>{record.nominal:g}</td><td>{record.excitation}</td><td>{len(record)}</td>"
            f"<td>{record.time_s[-1] - record.time_s[0]:.1f}</td></tr>"
            for record in self._records[:12]
        )
        return (
            f'<div style="{STYLE}"><table><caption style="text-align:left">{_escaped(repr(self)[1:-1])}</caption><thead><tr>'
            f'{"".join(f"<th>{head}</th>" for head in heads)}</tr></thead><tbody>{rows}</tbody></table></div>'
        )


def given(records: object) -> _native.Experiment | str | os.PathLike[str]:
    """What the native part takes for records."""
    if isinstance(records, Records):
        return records._experiment
    if isinstance(records, (str, os.PathLike)):
        return records
    of_one = "; Records([record]) makes some of one" if isinstance(records, Record) else ""
    raise TypeError(f"Records or the path of a folder are needed, and this is of the type {type(records).__name__}{of_one}")


def _from_files(files: dict[str, bytes]) -> Records:
    return Records._from_native(_native.Experiment.from_files(files))


def _numbers(name: str, values: Optional[npt.ArrayLike]) -> Optional[Floats]:
    """A column of its own, which cannot be changed. What NumPy would make other numbers of is refused."""
    if values is None:
        return None
    wrong = f"`{name}`: this is no column of numbers\n  help: give a one-dimensional array, one number for each row"
    try:
        if np.ma.is_masked(values):  # type: ignore[no-untyped-call]
            raise _native.Error(f"`{name}`: values are masked\n  help: leave their rows out of every column")
        array = np.asarray(values)
    except ValueError as error:
        raise error if isinstance(error, _native.Error) else _native.Error(wrong) from error
    if array.dtype.kind == "c":
        raise _native.Error(f"`{name}`: these are complex numbers\n  help: give their real part, if that is what is meant")
    try:
        made = array.astype(np.float64) if array.dtype.kind in "iufO" and array.ndim == 1 else None
    except (TypeError, ValueError) as error:
        raise _native.Error(wrong) from error
    if made is None:
        raise _native.Error(wrong)
    made.flags.writeable = False
    return made


def _series(quantity: str, values: object) -> Floats:
    column = _numbers(quantity, np.asarray(values))
    assert column is not None
    return column


def _listed(columns: object) -> list[str]:
    return [str(column) for column in columns] if hasattr(columns, "__iter__") else []


def _with_unit(column: str) -> tuple[str, str]:
    header, colon, unit = column.rpartition(":")
    return (header, unit) if colon else (column, "")


def _seconds(values: object) -> Floats:
    """Times in s: numbers as they are, and dates and durations from the first on."""
    array = np.asarray(values)
    if array.dtype.kind in "mM":
        made: Floats = (array - array[0]) / np.timedelta64(1, "ns") * 1e-9
        return made
    return _series("time", array)
