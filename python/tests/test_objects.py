"""The objects: what they show, that they cannot be changed, and what they give other packages."""

import copy
import os
import pathlib
import pickle
import re
import subprocess
import sys
import unittest
from unittest import mock

import numpy as np

import rotorlead
from stand import Stand

# Widest that a cell of a notebook is shown, pixels.
CELL = 900


class Objects(Stand):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.found = rotorlead.identify("sim")
        cls.lead = rotorlead.design(cls.found.model, kind="lead")
        cls.answers = [cls.found, cls.lead, rotorlead.validate(cls.found.model, "sim"), rotorlead.bandwidth(cls.found.model, records="sim"),
                       rotorlead.diagnose("sim")]

    def test_points(self):
        points = self.found.points
        (row,) = self.found.to_dict()["points"]
        for name in ("nominal", "gain", "gain_std", "time_constant_s", "time_constant_s_std", "delay_s"):
            self.assertEqual(points[name].dtype, np.float64)
            self.assertEqual(points[name].tolist(), [row[name]])
        (interval,) = self.found.to_dict()["intervals"]
        self.assertEqual(points.time_constant_s_low[0], interval["time_constant_s"]["low"])
        # What is not known is NaN.
        self.assertTrue(np.isnan(points.time_constant_up_s[0]))
        frame = self.found.frame()
        self.assertEqual(list(frame.columns), list(points.dtype.names))
        self.assertEqual(frame["gain"].tolist(), points.gain.tolist())

    def test_they_cannot_be_changed(self):
        records = rotorlead.Records.read("sim")
        for array in (self.found.points["gain"], records[0].time_s, self.found.model.points["gain"]):
            with self.assertRaisesRegex(ValueError, "read-only"):
                array[0] = 1.0
        for thing, name in ((self.found, "model"), (self.found.model, "points"), (records, "name"), (records[0], "nominal")):
            with self.assertRaises(AttributeError):
                setattr(thing, name, None)
        self.found.to_dict()["points"].clear()
        self.found.model.to_dict()["point"].clear()
        self.assertEqual(len(self.found.points), 1)

    def test_they_are_copied_and_sent_to_other_processes(self):
        for answer in self.answers:
            for other in (copy.deepcopy(answer), pickle.loads(pickle.dumps(answer))):
                self.assertEqual(other.to_dict(), answer.to_dict())
                self.assertEqual(repr(other), repr(answer))

    def test_a_cell_shows_what_the_terminal_says_in_little_room(self):
        exported = rotorlead.export(self.found.model, "rotorpy")
        for shown in [*self.answers, self.found.model, rotorlead.Records.read("sim"), exported]:
            html = shown._repr_html_()
            self.assertNotIn("<script", html)
            width = int(re.search(r"max-width:(\d+)px", html).group(1))
            self.assertLess(width, CELL)
            self.assertLess(len(repr(shown)), 250)
        self.assertIn(self.lead.headline, self.lead._repr_html_())
        evil = "<img src=x onerror=alert(1)>"
        record = rotorlead.Record(time_s=[0, 0.1, 0.2], command=[0.1, 0.2, 0.2], thrust_n=[1, 2, 3], nominal=0.1, excitation="step")
        self.assertNotIn("<img", rotorlead.Records([record], name=evil)._repr_html_())

    def test_transfer_functions(self):
        motor = rotorlead.Model.read("model.toml")
        omega = np.geomspace(0.1, 50, 20)
        for nominal in (0.3, 0.42):
            lag = motor.lag(nominal)
            exact = lag.gain * np.exp(-1j * omega * lag.delay_s) / (1j * omega * lag.time_constant_s + 1)
            np.testing.assert_allclose(motor.response(omega, nominal), exact)
            np.testing.assert_allclose(motor.tf(nominal)(1j * omega), exact, rtol=1e-4)
            np.testing.assert_allclose(abs(motor.tf(nominal, pade=0)(1j * omega)), abs(exact))
        self.assertAlmostEqual(self.found.tf().dcgain(), self.found.points.gain[0], places=12)
        with self.assertRaisesRegex(ValueError, "which nominal command.*0.3, 0.5"):
            motor.tf()
        with self.assertRaisesRegex(rotorlead.Error, "0.9"):
            motor.tf(0.9)

    def test_figures(self):
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        for answer in self.answers:
            self.assertTrue(answer.figures)
            for figure in answer.figures:
                axes = figure.plot()
                self.assertTrue(all(one.has_data() for one in axes), figure)
                plt.close("all")
        _, ax = plt.subplots()
        self.assertEqual(self.found.plot("responses", ax), (ax,))
        self.assertEqual(ax.get_ylabel(), "magnitude, dB over 1 N per unit of command")
        for axes in (self.lead.frequency_response.plot(), rotorlead.Records.read("sim")[0].plot()):
            self.assertEqual(len(axes), 2)
        plt.close("all")
        with self.assertRaisesRegex(ValueError, "no figure bode: it has responses"):
            self.found.plot("bode")

    def test_a_page_of_each_answer(self):
        for answer in self.answers:
            answer.report("page.html")
            page = pathlib.Path("page.html").read_text(encoding="utf-8")
            self.assertIn("<h1>", page)
            self.assertNotIn("<img", page)
        self.found.report("page.html", pictures=True)
        self.assertEqual(pathlib.Path("page.html").read_text(encoding="utf-8").count("<img"), len(self.found.figures))
        with self.assertRaisesRegex(rotorlead.Error, "there is no folder"):
            self.found.report("nowhere/page.html")

    def test_what_is_not_installed_is_named(self):
        absent = {name: None for name in ("pandas", "control", "matplotlib", "matplotlib.pyplot", "matplotlib.figure")}
        with mock.patch.dict(sys.modules, absent):
            for name, function in (("pandas", self.found.frame), ("matplotlib", self.found.plot), ("control", self.found.tf)):
                with self.assertRaisesRegex(ImportError, f"needs {name}, which is not there: pip install {name}"):
                    function()

    def test_they_need_numpy_alone(self):
        code = "import rotorlead, sys; print([name for name in ('pandas', 'control', 'matplotlib') if name in sys.modules])"
        ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
        self.assertEqual(ended.stdout, "[]\n", ended.stderr)

    def test_everything_is_documented(self):
        for name in rotorlead.__all__:
            thing = getattr(rotorlead, name)
            if callable(thing):
                self.assertTrue(thing.__doc__ and not thing.__doc__.startswith(f"{name}("), name)
                members = vars(thing).items() if isinstance(thing, type) and thing.__module__.startswith("rotorlead.") else ()
                for member, value in members:
                    if callable(value) and not member.startswith("_"):
                        self.assertTrue(value.__doc__, f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
