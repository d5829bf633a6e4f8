"""What cannot be used raises `rotorlead.Error`, with the words of the command line."""

import itertools
import pathlib

import numpy as np

import rotorlead
from stand import Stand, complaint

RECORD = {"time_s": [0.0, 0.1, 0.2], "command": [0.1, 0.2, 0.2], "thrust_n": [1.0, 2.0, 3.0], "nominal": 0.1, "excitation": "step"}


def record(**changes):
    return {key: value for key, value in {**RECORD, **changes}.items() if value is not ...}


class Errors(Stand):
    def assert_refused(self, parts, function, *arguments, **keywords):
        with self.assertRaises(rotorlead.Error) as caught:
            function(*arguments, **keywords)
        for part in parts:
            self.assertIn(part, str(caught.exception))

    def test_it_is_a_value_error_of_the_package(self):
        self.assertTrue(issubclass(rotorlead.Error, ValueError))
        self.assertEqual(f"{rotorlead.Error.__module__}.{rotorlead.Error.__name__}", "rotorlead.Error")

    def test_files_are_refused_in_the_commands_words(self):
        pathlib.Path("wrong.toml").write_text("format = 1\n[[point]]\nnominal = 0.5\ngian = 7\n")
        pathlib.Path("far.toml").write_text('format = 1\nname = "far"\nseed = 1\n[[record]]\nnominal = 0.9\n'
                                            'excitation = "step"\namplitude = 0.05\nhold_s = 1\n')
        pathlib.Path("torn").mkdir()
        pathlib.Path("torn/experiment.toml").write_text(
            'format = 1\nname = "torn"\ncommand = "duty"\noutput = "thrust_n"\n'
            '[[record]]\nfile = "a.csv"\nnominal = 0.5\nexcitation = "step"\n'
        )
        pathlib.Path("torn/a.csv").write_text("time_s,command,thrust_n\n0,0.5,1\n0.1,0.5,nan\n0.2,0.6,1\n")
        pathlib.Path("short").mkdir()
        pathlib.Path("short/experiment.toml").write_text(pathlib.Path("torn/experiment.toml").read_text())
        pathlib.Path("short/a.csv").write_text("time_s,command,thrust_n\n0,0.5,1\n0.1,0.5,1\n0.2,0.5,1\n")
        cases = [
            (["identify", "nowhere", "--out", "m.toml"], rotorlead.identify, ["nowhere"], {}),
            (["identify", "torn", "--out", "m.toml"], rotorlead.identify, ["torn"], {}),
            (["identify", "short", "--out", "m.toml"], rotorlead.identify, ["short"], {}),
            (["identify", "sim", "--out", "no/m.toml"], rotorlead.identify, ["sim"], {"out": "no/m.toml"}),
            (["diagnose", "nowhere"], rotorlead.diagnose, ["nowhere"], {}),
            (["diagnose", "short"], rotorlead.diagnose, ["short"], {}),
            (["diagnose", "sim", "--model", "motor.toml"], rotorlead.diagnose, ["sim", "motor.toml"], {}),
            (["design", "--model", "wrong.toml", "--out", "c.toml"], rotorlead.design, ["wrong.toml"], {}),
            (["design", "--model", "model.toml", "--out", "c.toml", "--omega-g", "100000"], rotorlead.design, ["model.toml"],
             {"omega_g_rad_s": 100000}),
            (["simulate", "--model", "nowhere.toml", "--out", "o"], rotorlead.simulate, ["nowhere.toml"], {}),
            (["simulate", "--model", "model.toml", "--plan", "far.toml", "--out", "o"], rotorlead.simulate,
             ["model.toml", "far.toml"], {}),
            (["simulate", "--model", "model.toml", "--out", "sim"], rotorlead.simulate, ["model.toml"], {"out": "sim"}),
        ]
        for arguments, function, given, keywords in cases:
            with self.subTest(arguments), self.assertRaises(rotorlead.Error) as caught:
                function(*given, **keywords)
            self.assertEqual(str(caught.exception), complaint(*arguments))

    def test_columns_in_memory(self):
        for parts, given in [
            (["`record_1`: `time_s` 3: time runs backwards, from 0.1 to 0.05", "sort the rows"], record(time_s=[0, 0.1, 0.05])),
            (["`thrust_n` 2: NaN is not a finite number", "remove the row"], record(thrust_n=[1, float("nan"), 1])),
            (["`command` 2: 20 is outside 0 to 1", "divide a percentage by 100"], record(command=[0.1, 20, 20])),
            (["`thrust_n`: 2 rows, but 3 times"], record(thrust_n=[1, 2])),
            (["`thrust_n`: the column is missing"], record(thrust_n=...)),
            (["`command`: the column is missing"], record(command=...)),
            (["`command`: the column is missing"], record(command=None)),
            (["`time_s`: too few rows: 1"], record(time_s=[0], command=[0], thrust_n=[0])),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=np.zeros((3, 2)))),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n="1, 2, 3")),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=["1", "2", "3"])),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=np.array([1, 2, 3], "m8[s]"))),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=np.array([True, False, True]))),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=[[1, 2], [3]])),
            (["`thrust_n`: this is no column of numbers"], record(thrust_n=[1, 2j, 3])),
            (["`thrust_n`: these are complex numbers"], record(thrust_n=np.array([1, 2, 3 + 1j]))),
            (["`thrust_n`: values are masked"], record(thrust_n=np.ma.array([1.0, 2, 3], mask=[0, 1, 0]))),
            (["`nominal`: these are complex numbers"], record(nominal=np.complex128(0.1 + 1j))),
            (["`nominal`: values are masked"], record(nominal=np.ma.masked)),
            (["`time_s`: too few rows: 0"], record(time_s=[], command=[], thrust_n=np.array([]))),
            (["missing field `nominal`", "add `nominal`"], record(nominal=...)),
            (["unknown field `excitatoin`", "did you mean `excitation`?"], record(excitation=..., excitatoin="step")),
            (["unknown variant `stpe`", "did you mean `step`?"], record(excitation="stpe")),
            (["missing field `output`"], record(rpm=[1, 2, 3])),
            (["a multisine or square wave has a period"], record(excitation="multisine")),
            (["the times contradict the sampling rate of 100 Hz"], record(sample_rate_hz=100)),
            (["the experiment has no record"], {"records": [], "output": "rpm"}),
            (["`record_1.csv` is named twice"], {"records": [record(file="record_1.csv")] * 2}),
        ]:
            for function in (rotorlead.identify, rotorlead.diagnose):
                with self.subTest(parts):
                    self.assert_refused(parts, function, given)

    def test_columns_are_taken_as_they_lie_in_memory(self):
        real = rotorlead.simulate("model.toml", "plan.toml")
        turned = {**real, "records": [dict(record) for record in real["records"]]}
        for record in turned["records"]:
            for name in ("time_s", "command", "thrust_n"):
                both = np.ma.array(np.column_stack([record[name], record[name] + 1]))
                record[name] = both[::-1, 0][::-1]
        self.assert_same(rotorlead.identify(turned), rotorlead.identify(real))

    def test_what_holds_itself_has_too_many_levels(self):
        own_dict, own_list, deep = {}, [], {}
        own_dict["name"] = own_dict
        own_list.append(own_list)
        for _ in range(20_000):
            deep = {"name": deep}
        for given in (own_dict, {"name": own_list}, deep):
            for function in (rotorlead.identify, rotorlead.diagnose, rotorlead.design, rotorlead.simulate):
                self.assert_refused(["`name`: more than 16 dicts and lists"], function, given)

    def test_options(self):
        self.assert_refused(["`delay`: `often` is not known", "auto, none, fit"], rotorlead.identify, "sim", delay="often")
        self.assert_refused(["`output`: `thrust` is not known"], rotorlead.identify, "sim", output="thrust")
        self.assert_refused(["`output` asks for `rpm`, and `u050_multisine.csv` has no"], rotorlead.identify, "sim", output="rpm")
        self.assert_refused(["`kind`: `led` is not known"], rotorlead.design, "model.toml", kind="led")
        self.assert_refused(["`damping`: -1", "above 0"], rotorlead.design, "model.toml", damping=-1)
        self.assert_refused(["`slew_per_s`: inf"], rotorlead.design, "model.toml", kind="inverse", slew_per_s=float("inf"))
        self.assert_refused(["`output_range`: (1, 0.5)"], rotorlead.design, "model.toml", kind="inverse", output_range=(1, 0.5))
        self.assert_refused(["`natural_rad_s`: no option", "change kind"], rotorlead.design, "model.toml", kind="lead", natural_rad_s=80)
        self.assert_refused(["`prewarp_rad_s`: no option"], rotorlead.design, "model.toml", kind="inverse", prewarp_rad_s=80)
        for seed in (-1, 2**63):
            self.assert_refused([f"`seed`: {seed} is not in 0 to 2^63 - 1"], rotorlead.simulate, "model.toml", seed=seed)

    def test_mappings(self):
        point = {"nominal": 0.5, "gain": 7.0, "time_constant_s": float("nan")}
        self.assert_refused(["`point` 1, `time_constant_s`: NaN"], rotorlead.design, {"point": [point]})
        self.assert_refused(["the model has no point"], rotorlead.simulate, {"format": 1})
        self.assert_refused(["missing field `seed`"], rotorlead.simulate, "model.toml", {"name": "a plan"})
        lead = rotorlead.design("model.toml", kind="lead")["compensator"]
        lead["coefficients"]["k"] += 1
        self.assert_refused(["is stored, but the parameters give"], rotorlead.simulate, "model.toml", compensator=lead)

    def test_what_is_no_path_and_no_mapping_is_a_type_error(self):
        for function in (rotorlead.identify, rotorlead.diagnose, rotorlead.design, rotorlead.simulate):
            with self.assertRaisesRegex(TypeError, "a path or a dict is needed, and this is of the type int"):
                function(3)
        with self.assertRaisesRegex(TypeError, "`point` is of the type object"):
            rotorlead.design({"point": object()})
        with self.assertRaisesRegex(TypeError, "`point` is of the type count"):
            rotorlead.design({"point": itertools.count()})
