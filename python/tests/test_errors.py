"""What cannot be used raises `rotorlead.Error`: of files with the words of the command line, of objects with those of Python."""

import itertools
import pathlib

import numpy as np
import pandas

import rotorlead
from stand import Stand, complaint

RECORD = {"time_s": [0.0, 0.1, 0.2], "command": [0.1, 0.2, 0.2], "thrust_n": [1.0, 2.0, 3.0], "nominal": 0.1, "excitation": "step"}


def record(**changes):
    return rotorlead.Record(**{key: value for key, value in {**RECORD, **changes}.items() if value is not ...})


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
            # Options are named as the parameters that they are.
            expected = complaint(*arguments)
            for option, parameter in (("model", "model"), ("loop-rate", "loop_rate_hz"), ("omega-g", "omega_g_rad_s"), ("damping", "damping")):
                expected = expected.replace(f"--{option}", f"{parameter}=")
            self.assertEqual(str(caught.exception), expected)
        self.assert_refused(["`nowhere` does not exist"], rotorlead.Records.read, "nowhere")

    def test_columns_in_memory(self):
        for parts, given in [
            (["`record_1`: `time_s` 3: time runs backwards, from 0.1 to 0.05", "sort the rows"], {"time_s": [0, 0.1, 0.05]}),
            (["`thrust_n` 2: NaN is not a finite number", "remove the row"], {"thrust_n": [1, float("nan"), 1]}),
            (["`command` 2: 20 is outside 0 to 1", "divide a percentage by 100"], {"command": [0.1, 20, 20]}),
            (["`thrust_n`: 2 rows, but 3 times"], {"thrust_n": [1, 2]}),
            (["`thrust_n`: the column is missing"], {"thrust_n": ...}),
            (["`command`: the column is missing"], {"command": None}),
            (["`time_s`: too few rows: 1"], {"time_s": [0], "command": [0], "thrust_n": [0]}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": np.zeros((3, 2))}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": "1, 2, 3"}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": ["1", "2", "3"]}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": np.array([1, 2, 3], "m8[s]")}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": np.array([True, False, True])}),
            (["`thrust_n`: this is no column of numbers"], {"thrust_n": [[1, 2], [3]]}),
            (["`thrust_n`: these are complex numbers"], {"thrust_n": [1, 2j, 3]}),
            (["`thrust_n`: these are complex numbers"], {"thrust_n": np.array([1, 2, 3 + 1j])}),
            (["`thrust_n`: values are masked"], {"thrust_n": np.ma.array([1.0, 2, 3], mask=[0, 1, 0])}),
            (["`time_s`: too few rows: 0"], {"time_s": [], "command": [], "thrust_n": np.array([])}),
            (["unknown variant 'stpe'", "did you mean 'step'?"], {"excitation": "stpe"}),
            (["`response`: the records have thrust and speed"], {"rpm": [1, 2, 3]}),
            (["a multisine or square wave has a period"], {"excitation": "multisine"}),
        ]:
            with self.subTest(parts):
                self.assert_refused(parts, lambda: rotorlead.Records([record(**given)]))
        with self.assertRaisesRegex(TypeError, "missing 1 required keyword-only argument: 'nominal'"):
            record(nominal=...)
        with self.assertRaisesRegex(TypeError, "unexpected keyword argument 'excitatoin'"):
            record(excitatoin="step")
        self.assert_refused(["the experiment has no record"], rotorlead.Records, [])
        self.assert_refused(["records[1]['file']: 'record_1.csv' is named twice"], rotorlead.Records, [record(file="record_1.csv")] * 2)
        self.assert_refused(["the times contradict the sampling rate of 100 Hz"], rotorlead.Records, [record()], sample_rate_hz=100)
        self.assert_refused(["`thrst` is not known"], rotorlead.Records, [record()], response="thrst")

    def test_columns_are_taken_as_they_lie_in_memory(self):
        real = rotorlead.simulate("model.toml", "plan.toml")
        turned = []
        for one in real:
            columns = {}
            for name in ("time_s", "command", "thrust_n"):
                both = np.ma.array(np.column_stack([getattr(one, name), getattr(one, name) + 1]))
                columns[name] = both[::-1, 0][::-1]
            keys = {key: getattr(one, key) for key in ("file", "nominal", "excitation", "period_s", "amplitude")}
            turned.append(rotorlead.Record(**keys, **columns))
        rates = {key: getattr(real, key) for key in ("name", "esc_frame_hz", "sample_rate_hz", "command_rate_hz")}
        self.assert_same(rotorlead.identify(rotorlead.Records(turned, **rates)).to_dict(), rotorlead.identify(real).to_dict())

    def test_what_holds_itself_is_refused(self):
        own_dict, own_list = {}, []
        own_dict["name"] = own_dict
        own_list.append(own_list)
        for given in (own_dict, {"name": own_list}):
            self.assert_refused(["`name`: more than 16 dicts and lists"], rotorlead.Model.from_dict, given)

    def test_options(self):
        self.assert_refused(["`delay`: `often` is not known", "auto, none, fit"], rotorlead.identify, "sim", delay="often")
        self.assert_refused(["`response`: `thrst` is not known", "thrust, rpm"], rotorlead.identify, "sim", response="thrst")
        self.assert_refused(["`response` asks for `rpm`, and `u050_multisine.csv` has no"], rotorlead.identify, "sim", response="rpm")
        self.assert_refused(["`kind`: `led` is not known"], rotorlead.design, "model.toml", kind="led")
        self.assert_refused(["`damping`: -1", "above 0"], rotorlead.design, "model.toml", damping=-1)
        self.assert_refused(["`slew_per_s`: inf"], rotorlead.design, "model.toml", kind="inverse", slew_per_s=float("inf"))
        self.assert_refused(["`output_range`: (1, 0.5)"], rotorlead.design, "model.toml", kind="inverse", output_range=(1, 0.5))
        self.assert_refused(["`natural_rad_s`: no option", "change kind"], rotorlead.design, "model.toml", kind="lead", natural_rad_s=80)
        self.assert_refused(["`prewarp_rad_s`: no option"], rotorlead.design, "model.toml", kind="inverse", prewarp_rad_s=80)
        self.assert_refused(["`steps`: 2"], rotorlead.bandwidth, "model.toml", steps=[2.0])
        self.assert_refused(["`stack`: `px5` is not known", "px4"], rotorlead.export, "model.toml", "px5")
        self.assert_refused(["at= is the command", "leave at= out"], rotorlead.export, "model.toml", "px4", at=0.5)
        self.assert_refused(["give `records=`"], rotorlead.export, "model.toml", "csv")
        for seed in (-1, 2**63):
            self.assert_refused([f"`seed`: {seed} is not in 0 to 2^63 - 1"], rotorlead.simulate, "model.toml", seed=seed)

    def test_logs(self):
        pathlib.Path("table.csv").write_text("t,u,f\n" + "".join(f"{k},{0.1 + 0.1 * (k // 100 % 2)},{k % 7}\n" for k in range(300)))
        log = "table.csv"
        columns = {"time": "t:ms", "command": "u:duty", "thrust": "f:N"}
        read = rotorlead.Records.from_log
        self.assert_refused(["`columns={"], read, log)
        self.assert_refused(["what drove the command", "`excitation=KIND`", "`period_s=SECONDS`"], read, log, columns=columns)
        self.assert_refused(["excitation= square needs period_s="], read, log, columns=columns, excitation="square")
        self.assert_refused(["motor= does not go with `table.csv`", "leave motor= out"], read, log, columns=columns, excitation="step", motor=1)
        self.assert_refused(["`columns`: `fortnight` is no unit of time"], read, log, columns={"time": "t:fortnight"})
        self.assert_refused(["`motor_poles`: `7` is no number of poles, even from 2 to 100"], read, log, motor_poles=7)
        with self.assertRaisesRegex(KeyError, "thrust='g'.*there are: t, u, f"):
            rotorlead.Records.from_frame(pandas.read_csv(log), time="t:ms", command="u", thrust="g")

    def test_dicts(self):
        point = {"nominal": 0.5, "gain": 7.0, "time_constant_s": 0.1}
        model = rotorlead.Model.from_dict
        self.assert_refused(["model['point'][0]['time_constant_s']: NaN"], model, {"point": [{**point, "time_constant_s": float("nan")}]})
        without = {key: value for key, value in point.items() if key != "nominal"}
        for place, points in (("model['point'][0]", [without]), ("model['point'][1]", [point, without])):
            self.assert_refused([f"{place}: the key 'nominal' is missing", "add 'nominal' to this dict"], model, {"point": points})
        self.assert_refused(["unknown key 'gian'", "did you mean 'gain'?"], model, {"point": [{**point, "gian": 1}]})
        self.assert_refused(["model['point'][0]['gain']: a text in quotes where a number is needed"], model, {"point": [{**point, "gain": "7"}]})
        self.assert_refused(["complex numbers"], model, {"point": [{**point, "gain": np.complex128(1 + 1j)}]})
        self.assert_refused(["the key 'seed' is missing"], rotorlead.Plan.from_dict, {"name": "a plan"})
        lead = rotorlead.design("model.toml", kind="lead").compensator.to_dict()
        lead["coefficients"]["k"] += 1
        self.assert_refused(["is stored, but the parameters give"], rotorlead.Compensator.from_dict, lead)
        with self.assertRaisesRegex(TypeError, "`point` is of the type count"):
            model({"point": itertools.count()})

    def test_what_is_no_path_and_no_object_is_a_type_error(self):
        for function in (rotorlead.identify, rotorlead.diagnose, rotorlead.report):
            with self.assertRaisesRegex(TypeError, "Records or the path of a folder are needed, and this is of the type int"):
                function(3)
        with self.assertRaisesRegex(TypeError, r"of the type Record; Records\(\[record\]\) makes some of one"):
            rotorlead.identify(record())
        for function in (rotorlead.design, rotorlead.simulate, rotorlead.bandwidth):
            with self.assertRaisesRegex(TypeError, "a Model or the path of its file is needed, and this is of the type dict; Model.from_dict"):
                function({"point": []})
        with self.assertRaisesRegex(TypeError, "a dict is needed, and this is of the type list"):
            rotorlead.Model.from_dict([])
