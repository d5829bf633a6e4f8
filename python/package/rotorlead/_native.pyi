from collections.abc import Mapping
from os import PathLike
from typing import Any, Final, Literal, Optional, Union

# A file or a folder, or what it would hold: a dict with the same keys, and NumPy arrays for the columns of a record.
_Given = Union[str, PathLike[str], Mapping[str, Any]]
_Path = Union[str, PathLike[str]]

__all__ = ["Error", "__version__", "design", "diagnose", "identify", "simulate"]

__version__: Final[str]

class Error(ValueError): ...

def identify(
    data: _Given,
    *,
    delay: Literal["auto", "none", "fit"] = "auto",
    output: Optional[Literal["thrust_n", "rpm"]] = None,
    out: Optional[_Path] = None,
) -> dict[str, Any]: ...
def simulate(
    model: _Given,
    plan: Optional[_Given] = None,
    *,
    compensator: Optional[_Given] = None,
    seed: Optional[int] = None,
    out: Optional[_Path] = None,
) -> dict[str, Any]: ...
def diagnose(
    data: _Given,
    model: Optional[_Given] = None,
    *,
    out_model: Optional[_Path] = None,
    out_plan: Optional[_Path] = None,
) -> dict[str, Any]: ...
def design(
    model: _Given,
    *,
    kind: Literal["lead", "inverse"] | None = None,
    purpose: Literal["force", "rate_loop"] = "force",
    omega_g_rad_s: Optional[float] = None,
    damping: Optional[float] = None,
    loop_rate_hz: Optional[float] = None,
    prewarp_rad_s: Optional[float] = None,
    natural_rad_s: Optional[float] = None,
    setting: Optional[Literal["exact", "robust"]] = None,
    slew_per_s: Optional[float] = None,
    output_range: Optional[tuple[float, float]] = None,
    compensate_range: Optional[tuple[float, float]] = None,
    out: Optional[_Path] = None,
) -> dict[str, Any]: ...
