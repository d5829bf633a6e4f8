"""A simulated stand with a thrust and one with a rotor speed, identified, and what `rotorlead export` makes of them."""

from __future__ import annotations

import csv
import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]

# One lag with a dead time: what MuJoCo holds wholly. At rest the response goes with the command, as its actuator's force does.
TIME_CONSTANT_S = 0.045
MOTOR = """format = 1
[[point]]
nominal = 0.5
gain = {gain}
time_constant_s = {tau}
delay_s = 0.006
[static_map]
command = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
response = [{levels}]
[time_constant_curve]
nominal = [0.4, 0.6]
time_constant_s = [{tau}, {tau}]
low_s = [{tau}, {tau}]
high_s = [{tau}, {tau}]
down_over_up = 1.0
[provenance]
records = []
version = "0.1.0"
output = "{output}"
"""

PLAN = """format = 1
name = "stand"
seed = 1
loop_rate_hz = 500
sample_rate_hz = 500
[noise]
{noise}
[[record]]
nominal = 0.5
excitation = "multisine"
amplitude = 0.1
lines = 150
periods = 3
[[record]]
nominal = 0.5
excitation = "square"
amplitude = 0.1
half_period_s = 0.5
periods = 4
role = "validate"
"""


class RecordFit(TypedDict):
    """How a simulator explains a record, % fit."""

    file: str
    fit_percent: float
    model_fit_percent: float


class Replay(TypedDict):
    """What an export says of its simulator."""

    step_s: float
    records: list[RecordFit]


class Export(TypedDict):
    """The JSON of an export."""

    replays: list[Replay]


@dataclass(frozen=True)
class Stand:
    """A folder with records of a motor in `stand`, and its model."""

    program: str
    folder: Path
    output: str

    @classmethod
    def simulate(cls, program: str, folder: Path, output: str, full: float) -> Stand:
        """A motor whose response at full command is `full`, with noise of a thousandth of that where it is a thrust."""
        noise = f"sigma_n = {1e-3 * full}" if output == "thrust_n" else ""
        levels = ", ".join(str(full * share / 5) for share in range(6))
        folder.mkdir()
        (folder / "motor.toml").write_text(MOTOR.format(tau=TIME_CONSTANT_S, gain=full, levels=levels, output=output))
        (folder / "plan.toml").write_text(PLAN.format(noise=noise))
        stand = cls(program, folder, output)
        stand.run("simulate", "motor.toml", "--plan", "plan.toml", "--out", "stand")
        return stand

    def run(self, *arguments: str) -> str:
        """What the program prints."""
        done = subprocess.run([self.program, *arguments], cwd=self.folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"rotorlead {' '.join(arguments)}: {done.stderr}")
        return done.stdout

    def export(self, target: str) -> tuple[Path, Export]:
        """The file for a target, and its JSON."""
        out, values = self.folder / target, self.folder / f"{target}.json"
        names = [str(path.relative_to(self.folder)) for path in (out, values)]
        self.run("export", "motor.toml", "--for", target, "--records", "stand", "--out", names[0], "--json", names[1])
        export: Export = json.loads(values.read_text())
        return out, export

    def columns(self, record: str) -> dict[str, Numbers]:
        """A record's columns by their names."""
        with (self.folder / "stand" / record).open(newline="") as file:
            rows = list(csv.DictReader(file))
        return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def fit_percent(time_s: Numbers, measured: Numbers, simulated: Numbers) -> float:
    """100 (1 - |y - s| / |y - mean y|), beside a constant and the unknown state at the start, which decays with the lag."""
    free = np.column_stack([np.ones_like(time_s), np.exp(-(time_s - time_s[0]) / TIME_CONSTANT_S)])
    left = measured - simulated
    left = left - free @ np.linalg.lstsq(free, left, rcond=None)[0]
    return float(100 * (1 - np.linalg.norm(left) / np.linalg.norm(measured - np.mean(measured))))
