"""What is in a file with keys: read, held to its rules, and written as the command line writes it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, TypeVar, Union

from . import _native
from ._json import Object, copied

Path = Union[str, "os.PathLike[str]"]
Self = TypeVar("Self", bound="Document")


@dataclass(frozen=True, repr=False)
class Document:
    """The keys of a file, which cannot be changed. `read` and `from_dict` make one, `write` and `to_dict` give it back."""

    _keys: Object
    _kind: ClassVar[str] = ""

    @classmethod
    def read(cls: type[Self], path: Path) -> Self:
        """Reads a file. Raises Error, which shows the place, where it is not there or breaks a rule."""
        return cls(_native.document(cls._kind, path))

    @classmethod
    def from_dict(cls: type[Self], keys: Mapping[str, object]) -> Self:
        """Takes a dict with the keys of the file. Raises Error where a key is missing, unknown or breaks a rule, and TypeError
        where a value is no number, text, list or dict."""
        if not isinstance(keys, Mapping):
            raise TypeError(f"a dict is needed, and this is of the type {type(keys).__name__}")
        return cls(_native.document(cls._kind, keys))

    def write(self, path: Path) -> None:
        """Writes the file, complete or not at all. Raises Error where it cannot be written."""
        _native.write_document(self._kind, self._keys, path)

    def to_dict(self) -> Object:
        """The keys of the file. What is not known is None, or has no key."""
        return copied(self._keys)

    def __hash__(self) -> int:
        return hash(repr(self._keys))


def given(document: object, kind: type[Document]) -> Object | str | os.PathLike[str]:
    """What the native part takes for a document: its keys, or the path of its file."""
    if isinstance(document, kind):
        return document._keys
    if isinstance(document, (str, os.PathLike)):
        return document
    name = kind.__name__
    of_dict = f"; {name}.from_dict makes one of a dict" if isinstance(document, Mapping) else ""
    raise TypeError(f"a {name} or the path of its file is needed, and this is of the type {type(document).__name__}{of_dict}")

