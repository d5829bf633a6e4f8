"""JSON with types: what the native part gives is read by these alone."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Dict, List, Tuple, Union

import numpy as np
import numpy.typing as npt

Json = Union[None, bool, int, float, str, List["Json"], Dict[str, "Json"]]
Object = Dict[str, Json]
# A table of numbers: a column is `table["name"]` or `table.name`, a row `table[0]`.
Table = np.recarray[Tuple[int], np.dtype[np.record]]
Floats = npt.NDArray[np.float64]


def plain(value: object) -> Json:
    """A copy in which mappings are dicts, sequences and arrays lists, and numbers of NumPy those of Python."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Sequence):
        return [plain(item) for item in value]
    raise TypeError(f"a number, a text, a list or a dict is needed, and this is of the type {type(value).__name__}")


def copied(value: Object) -> Object:
    """A copy that may be changed."""
    return copy.deepcopy(value)


def text(of: Object, key: str) -> str:
    """The text of a key; empty where there is none."""
    value = of.get(key)
    return value if isinstance(value, str) else ""


def number(of: Object, key: str) -> float:
    """The number of a key; NaN where it is not known."""
    value = of.get(key)
    return float(value) if isinstance(value, (int, float)) else float("nan")


def optional(of: Object, key: str) -> float | None:
    """The number of a key; None where there is none."""
    value = of.get(key)
    return float(value) if isinstance(value, (int, float)) else None


def child(of: Object, key: str) -> Object:
    """The dict of a key; empty where there is none."""
    value = of.get(key)
    return value if isinstance(value, dict) else {}


def items(of: Object, key: str) -> list[Json]:
    """The list of a key; empty where there is none."""
    value = of.get(key)
    return value if isinstance(value, list) else []


def children(of: Object, key: str) -> list[Object]:
    """The dicts in the list of a key."""
    return [item for item in items(of, key) if isinstance(item, dict)]


def texts(of: Object, key: str) -> tuple[str, ...]:
    """The texts in the list of a key."""
    return tuple(item for item in items(of, key) if isinstance(item, str))


def table(rows: Sequence[Object], columns: Sequence[str], named: Sequence[str] = ()) -> Table:
    """A table with a row for each dict: `named` are texts, `columns` numbers, which are NaN where they are not known."""
    width = max([len(text(row, key)) for row in rows for key in named], default=1)
    dtype = np.dtype([(key, f"U{max(width, 1)}") for key in named] + [(key, "f8") for key in columns])
    values = [tuple(text(row, key) for key in named) + tuple(number(row, key) for key in columns) for row in rows]
    made: Table = np.array(values, dtype=dtype).view(np.recarray)
    made.flags.writeable = False
    return made
