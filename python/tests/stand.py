"""What the tests share: the command line, folders of records, and comparisons."""

import csv
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Where the command is: it is built with the tests of the workspace.
PROGRAM = os.environ["ROTORLEAD"]

MODEL = """
format = 1
[[point]]
nominal = 0.3
gain = 5.2
time_constant_s = 0.110
time_constant_s_std = 0.001
[[point]]
nominal = 0.5
gain = 7.1
time_constant_s = 0.071
time_constant_s_std = 0.001
delay_s = 0.002
"""
# The same, with what one lag does not explain.
EFFECT = """
[[effect]]
kind = "second_pole"
parameters = { time_constant_s = 0.012 }
"""
PLAN = """
format = 1
name = "two records"
seed = 3
esc_frame_hz = 600
noise = { sigma_n = 0.02 }
[[record]]
nominal = 0.5
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 2
[[record]]
nominal = 0.5
excitation = "square"
amplitude = 0.05
half_period_s = 2.5
periods = 2
"""


def command(*arguments):
    """Runs the command line, as a terminal without colors would see it."""
    environment = {**os.environ, "LC_ALL": "C.UTF-8", "NO_COLOR": "1"}
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, encoding="utf-8", env=environment)


def answer(*arguments):
    """The JSON of a command, which has to succeed."""
    ended = command(*arguments, "--json", "-")
    if ended.returncode != 0:
        raise AssertionError(f"{arguments}: {ended.stderr}")
    return json.loads(ended.stdout)


def complaint(*arguments):
    """What a command that has to fail prints, without the mark before it."""
    ended = command(*arguments)
    if ended.returncode == 0:
        raise AssertionError(f"{arguments} succeeds")
    return ended.stderr.strip().removeprefix("× ")


def columns(path):
    """The columns of a CSV file by their names."""
    with open(path, newline="") as file:
        header = next(csv.reader(file))
        rows = np.loadtxt(file, delimiter=",", ndmin=2)
    return {name: rows[:, index].copy() for index, name in enumerate(header)}


class Stand(unittest.TestCase):
    """Has a model, a plan, a simulated experiment `sim` and one from a real log, `real`, in the current folder."""

    @classmethod
    def setUpClass(cls):
        cls.before = os.getcwd()
        cls.folder = tempfile.TemporaryDirectory()
        os.chdir(cls.folder.name)
        pathlib.Path("model.toml").write_text(MODEL)
        pathlib.Path("motor.toml").write_text(MODEL + EFFECT)
        pathlib.Path("plan.toml").write_text(PLAN)
        answer("simulate", "--model", "motor.toml", "--plan", "plan.toml", "--out", "sim")
        answer("import", ROOT / "sim/records/tests/data/rcbenchmark.csv", "--out", "real")

    @classmethod
    def tearDownClass(cls):
        os.chdir(cls.before)
        cls.folder.cleanup()

    def assert_same(self, found, expected, place=""):
        """The same keys, texts and None, and numbers within 1e-12 of the larger."""
        if isinstance(expected, dict):
            self.assertEqual(set(found), set(expected), place)
            for key in expected:
                self.assert_same(found[key], expected[key], f"{place}.{key}")
        elif isinstance(expected, list):
            self.assertEqual(len(found), len(expected), place)
            for index, pair in enumerate(zip(found, expected)):
                self.assert_same(*pair, f"{place}[{index}]")
        elif isinstance(expected, float):
            self.assertIs(type(found), float, place)
            self.assertLessEqual(abs(found - expected), 1e-12 * max(1.0, abs(expected)), place)
        else:
            self.assertEqual(found, expected, place)
            self.assertIs(type(found), type(expected), place)

    def assert_same_folder(self, found, expected):
        """The same files with the same bytes."""
        found, expected = pathlib.Path(found), pathlib.Path(expected)
        names = sorted(path.name for path in expected.iterdir())
        self.assertEqual(sorted(path.name for path in found.iterdir()), names)
        for name in names:
            self.assertEqual((found / name).read_bytes(), (expected / name).read_bytes(), name)

    def assert_same_file(self, found, expected):
        """The same bytes."""
        self.assertEqual(pathlib.Path(found).read_text(), pathlib.Path(expected).read_text())
