"""Packages that are used where they are there."""

from __future__ import annotations

import importlib
from types import ModuleType


def package(name: str, purpose: str, install: str | None = None) -> ModuleType:
    """The module of that name, or an ImportError that says what it is for and how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        project = install or name.split(".")[0]
        raise ImportError(f"{purpose} needs {project}, which is not there: pip install {project}") from error
