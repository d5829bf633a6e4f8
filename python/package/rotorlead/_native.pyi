from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Final, Optional, Union, final

import numpy as np
import numpy.typing as npt

from ._json import Json, Object

_Path = Union[str, PathLike[str]]
# A file, or what it would hold.
_Given = Union[str, PathLike[str], Mapping[str, object]]
_Records = Union[str, PathLike[str], Experiment]
# What programs read, and the page as JSON.
_Answered = tuple[Object, str]

__all__ = [
    "Error",
    "Experiment",
    "__version__",
    "bandwidth",
    "design",
    "diagnose",
    "document",
    "export",
    "identify",
    "lag_at",
    "lead_at",
    "overview",
    "response",
    "simulate",
    "validate",
    "write_document",
    "write_page",
]

__version__: Final[str]

class Error(ValueError): ...

@final
class Experiment:
    @staticmethod
    def read(folder: _Path) -> Experiment: ...
    @staticmethod
    def from_logs_of(files: Sequence[_Path], options: dict[str, object]) -> Experiment: ...
    @staticmethod
    def from_table(name: _Path, table: bytes, options: dict[str, object]) -> Experiment: ...
    @staticmethod
    def from_dict(mapping: Mapping[str, object]) -> Experiment: ...
    @staticmethod
    def from_files(files: Mapping[str, bytes]) -> Experiment: ...
    def files(self) -> dict[str, bytes]: ...
    def write(self, folder: _Path) -> None: ...
    @property
    def source(self) -> Optional[PathLike[str]]: ...
    @property
    def logs(self) -> Json: ...
    def keys(self) -> Object: ...
    def columns(self, record: int) -> dict[str, Optional[npt.NDArray[np.float64]]]: ...

def identify(
    records: _Records, delay: str, response_name: Optional[str], out: Optional[_Path]
) -> tuple[_Answered, Object]: ...
def simulate(
    model: _Given, plan: Optional[_Given], compensator: Optional[_Given], seed: Optional[int], out: Optional[_Path]
) -> Experiment: ...
def diagnose(
    records: _Records, model: Optional[_Given], out_model: Optional[_Path], out_plan: Optional[_Path]
) -> tuple[_Answered, Object, Optional[Object]]: ...
def design(
    model: _Given,
    kind: Optional[str],
    purpose: str,
    omega_g_rad_s: Optional[float],
    damping: Optional[float],
    loop_rate_hz: Optional[float],
    prewarp_rad_s: Optional[float],
    natural_rad_s: Optional[float],
    setting: Optional[str],
    slew_per_s: Optional[float],
    output_range: Optional[tuple[float, float]],
    compensate_range: Optional[tuple[float, float]],
    out: Optional[_Path],
) -> tuple[_Answered, Object]: ...
def validate(model: _Given, records: _Records) -> _Answered: ...
def bandwidth(
    model: _Given,
    compensator: Optional[_Given],
    sampled: bool,
    esc_frame_hz: Optional[float],
    step_sizes: Sequence[float],
    robustness: bool,
    records: Sequence[_Records],
) -> _Answered: ...
def overview(
    records: _Records, model: Optional[_Given], kind: Optional[str], purpose: str, with_diagnosis: bool
) -> _Answered: ...
def export(
    model: _Given,
    target: str,
    records: Optional[_Records],
    compensator: Optional[_Given],
    at: Optional[float],
    output_range: Optional[tuple[float, float]],
    motors: Optional[int],
    step_rate_hz: Optional[float],
    out: Optional[_Path],
) -> tuple[Object, bytes, bool]: ...
def document(kind: str, given: _Given) -> Object: ...
def write_document(kind: str, given: _Given, path: _Path) -> None: ...
def lag_at(model: _Given, nominal: float) -> tuple[float, float, float]: ...
def lead_at(compensator: _Given, nominal: float) -> Optional[tuple[float, float, float]]: ...
def response(
    compensator: _Given, nominals: Sequence[float], omega_rad_s: Sequence[float]
) -> npt.NDArray[np.complex128]: ...
def write_page(page: str, stills: Sequence[str], path: _Path) -> None: ...
