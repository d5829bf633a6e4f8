"""What an answer has as a dict is what the command prints as JSON, from a folder and from records in memory."""

import pathlib
import pickle
import re

import numpy as np
import pandas

import rotorlead
from stand import ROOT, Stand, answer, columns


def in_memory(folder, entries, **of_all):
    """The records of a folder, made of their columns."""
    return rotorlead.Records([rotorlead.Record(**entry, **columns(pathlib.Path(folder, entry["file"]))) for entry in entries], **of_all)


SIM = [
    {"file": "u050_multisine.csv", "nominal": 0.5, "excitation": "multisine", "period_s": 10.0, "amplitude": 0.05},
    {"file": "u050_square.csv", "nominal": 0.5, "excitation": "square", "period_s": 5.0, "amplitude": 0.05},
]


class Identify(Stand):
    def test_a_simulated_folder(self):
        expected = answer("identify", "sim", "--out", "a.toml")
        found = rotorlead.identify("sim", out="b.toml")
        self.assert_same(found.to_dict(), expected)
        self.assert_same_file("b.toml", "a.toml")
        # The model of the result is the one that is written.
        found.model.write("c.toml")
        self.assert_same_file("c.toml", "a.toml")
        self.assertEqual(rotorlead.Model.read("a.toml"), found.model)
        self.assertEqual(rotorlead.Model.from_dict(found.model.to_dict()), found.model)
        # What is not known is None, never a number.
        self.assertIsNone(found.to_dict()["static_map"])

    def test_a_real_log(self):
        for folder in ("real", pathlib.Path("real")):
            self.assert_same(rotorlead.identify(folder).to_dict(), answer("identify", "real", "--out", "a.toml"))

    def test_the_chirps_of_an_autopilots_log(self):
        answer("import", ROOT / "sim/records/tests/data/chirp.bin", "--out", "chirps")
        found = rotorlead.identify("chirps")
        self.assert_same(found.to_dict(), answer("identify", "chirps", "--out", "a.toml"))
        self.assertTrue(found.to_dict()["frequency_responses"])

    def test_its_options(self):
        for delay in ("none", "fit"):
            expected = answer("identify", "sim", "--out", "a.toml", "--delay", delay)
            self.assert_same(rotorlead.identify("sim", delay=delay).to_dict(), expected)

    def test_records_in_memory_are_a_folder(self):
        expected = rotorlead.identify("sim").to_dict()
        self.assert_same(rotorlead.identify(rotorlead.Records.read("sim")).to_dict(), expected)
        of_all = {"name": "two records", "esc_frame_hz": 600.0, "sample_rate_hz": 1000, "command_rate_hz": 5000}
        self.assert_same(rotorlead.identify(in_memory("sim", SIM, **of_all)).to_dict(), expected)
        # Lists, and numbers of NumPy, are columns and numbers too.
        read = [columns(pathlib.Path("sim", entry["file"])) for entry in SIM]
        records = [
            rotorlead.Record(**{**entry, "nominal": np.float64(entry["nominal"])}, **{**each, "thrust_n": each["thrust_n"].tolist()})
            for entry, each in zip(SIM, read)
        ]
        self.assert_same(rotorlead.identify(rotorlead.Records(records, **{**of_all, "sample_rate_hz": np.int64(1000)})).to_dict(), expected)

    def test_records_are_written_as_they_were_read(self):
        rotorlead.Records.read("sim").write("again")
        self.assert_same_folder("again", "sim")
        copied = pickle.loads(pickle.dumps(rotorlead.Records.read("sim")))
        self.assert_same(rotorlead.diagnose(copied).to_dict(), rotorlead.diagnose("sim").to_dict())

    def test_the_response_that_is_asked_for(self):
        expected = rotorlead.identify("sim")
        of_all = {"name": "two records", "esc_frame_hz": 600.0, "sample_rate_hz": 1000, "command_rate_hz": 5000}
        both = [columns(pathlib.Path("sim", entry["file"])) for entry in SIM]
        records = [rotorlead.Record(**entry, **each, rpm=1000 * each["thrust_n"]) for entry, each in zip(SIM, both)]
        self.assert_same(rotorlead.identify(rotorlead.Records(records, response="thrust", **of_all)).to_dict(), expected.to_dict())
        # Speeds that are a thousand times the thrust have its time constants, and a thousand times the gains.
        of_speed = rotorlead.identify(rotorlead.Records(records, response="thrust", **of_all), response="rpm")
        self.assertEqual(of_speed.response, "rpm")
        self.assertAlmostEqual(of_speed.points.gain[0] / expected.points.gain[0], 1000, places=6)
        self.assertAlmostEqual(of_speed.points.time_constant_s[0], expected.points.time_constant_s[0], places=9)

    def test_a_simulation_is_taken_as_it_is(self):
        simulated = rotorlead.identify(rotorlead.simulate("motor.toml", "plan.toml"))
        self.assert_same(simulated.to_dict(), rotorlead.identify("sim").to_dict())


class Logs(Stand):
    def test_a_log_is_read_as_the_command_reads_it(self):
        for index, (log, options, keywords) in enumerate([
            ("rcbenchmark.csv", (), {}),
            ("esc32.csv", ("--excitation", "staircase", "--seconds", "0..5"), {"excitation": "staircase", "seconds": (0, 5)}),
            ("chirp.bin", (), {}),
        ]):
            path = ROOT / "sim/records/tests/data" / log
            with self.subTest(log):
                answer("import", path, *options, "--out", f"imported{index}")
                records = rotorlead.Records.from_log(path, **keywords)
                records.write(f"read{index}")
                self.assert_same_folder(f"read{index}", f"imported{index}")
                self.assert_same(records.logs, answer("import", path, *options, "--out", f"other{index}")["logs"])
                # The command identifies the log itself alike.
                expected = answer("identify", path, *options)
                del expected["logs"]
                self.assert_same(rotorlead.identify(records).to_dict(), expected)

    def test_a_frame_is_read_as_the_same_table_in_a_file(self):
        read = columns("sim/u050_square.csv")
        frame = pandas.DataFrame({"t, s": 1000 * read["time_s"], "throttle": 100 * read["command"], "load": read["thrust_n"] / 9.80665e-3})
        frame.loc[7, "load"] = np.nan
        frame.to_csv("frame.csv", index=False, header=["t", "throttle", "load"])
        options = ("--excitation", "square", "--period", "5")
        answer("import", "frame.csv", *options, *(part for one in ("time=t:ms", "command=throttle:percent", "thrust=load:gf")
                                                 for part in ("--column", one)), "--out", "of_file")
        keywords = {"excitation": "square", "period_s": 5.0}
        rotorlead.Records.from_frame(frame, time="t, s:ms", command="throttle:percent", thrust="load:gf", **keywords).write("of_frame")
        self.assert_same_folder("of_frame", "of_file")
        # In the units of a record nothing is to be said, and the index is the time.
        for index in (read["time_s"], pandas.to_timedelta(read["time_s"], unit="s"), pandas.to_datetime(1.7e9 + read["time_s"], unit="s")):
            frame = pandas.DataFrame({"u": read["command"], "f": read["thrust_n"]}, index=index)
            (record,) = rotorlead.Records.from_frame(frame, command="u", thrust="f", **keywords)
            np.testing.assert_allclose(record.time_s, read["time_s"], atol=1e-6)
            np.testing.assert_array_equal(record.thrust_n, read["thrust_n"])
            self.assertEqual((record.nominal, record.excitation, record.period_s), (0.5, "square", 5.0))


class Simulate(Stand):
    def test_a_plan(self):
        expected = answer("simulate", "--model", "motor.toml", "--plan", "plan.toml", "--out", "by_command", "--seed", "7")
        found = rotorlead.simulate("motor.toml", "plan.toml", seed=7, out="by_function")
        self.assert_same_folder("by_function", "by_command")
        for record in found:
            on_disk = columns(pathlib.Path("by_command", record.file))
            for name in ("time_s", "command", "thrust_n", "rpm", "esc_command", "voltage_v", "current_a"):
                column = getattr(record, name)
                if column is None:
                    self.assertNotIn(name, on_disk)
                else:
                    self.assertEqual(column.dtype, np.float64)
                    np.testing.assert_array_equal(column, on_disk[name])
        self.assertEqual([(record.file, record.nominal, len(record)) for record in found],
                         [(record["file"], record["nominal"], record["rows"]) for record in expected["records"]])
        self.assertEqual(found.name, expected["name"])

    def test_the_papers_experiment(self):
        answer("simulate", "--model", "model.toml", "--out", "paper_by_command")
        model = {
            "point": [
                {"nominal": 0.3, "gain": 5.2, "time_constant_s": 0.110, "time_constant_s_std": 0.001},
                {"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071, "time_constant_s_std": 0.001, "delay_s": 0.002},
            ],
            "static_map": None,
        }
        rotorlead.simulate(rotorlead.Model.from_dict(model), out="paper_by_function")
        self.assert_same_folder("paper_by_function", "paper_by_command")

    def test_behind_a_compensator(self):
        answer("design", "--model", "model.toml", "--out", "compensator.toml")
        options = ("--plan", "plan.toml", "--compensator", "compensator.toml")
        answer("simulate", "--model", "model.toml", *options, "--out", "lead_by_command")
        rotorlead.simulate("model.toml", "plan.toml", compensator="compensator.toml", out="lead_by_path")
        self.assert_same_folder("lead_by_path", "lead_by_command")
        lead = rotorlead.design("model.toml").compensator
        found = rotorlead.simulate("model.toml", "plan.toml", compensator=lead, out="lead_by_object")
        self.assert_same_folder("lead_by_object", "lead_by_command")
        self.assertTrue(found[0].compensated)
        self.assertEqual(len(found[0].esc_command), len(found[0]))

    def test_a_seed_decides_the_noise(self):
        one, same, other = (
            rotorlead.simulate("model.toml", "plan.toml", seed=seed)[0].thrust_n for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(one, same)
        self.assertFalse(np.array_equal(one, other))


class Diagnose(Stand):
    def test_a_simulated_folder(self):
        files = ("--out-model", "a.toml", "--out-plan", "a_plan.toml")
        expected = answer("diagnose", "sim", *files)
        found = rotorlead.diagnose("sim", out_model="b.toml", out_plan="b_plan.toml")
        self.assert_same(found.to_dict(), expected)
        self.assertIn("second_pole", [effect.kind for effect in found.effects])
        self.assertEqual(found.gap, rotorlead.Gap(**expected["gap"]))
        self.assert_same_file("b.toml", "a.toml")
        self.assertEqual(pathlib.Path("b_plan.toml").exists(), pathlib.Path("a_plan.toml").exists())
        self.assertEqual(found.plan is None, found.to_dict()["next_experiment"] is None)
        # The improved model has the effect in it, and is a model as any.
        self.assertIn("second_pole", found.model.effects)
        rotorlead.simulate(found.model, "plan.toml")

    def test_the_plan_of_the_next_experiment(self):
        expected = answer("diagnose", "sim", "--model", "model.toml", "--out-plan", "next.toml")
        found = rotorlead.diagnose(rotorlead.Records.read("sim"), rotorlead.Model.read("model.toml"), out_plan="next_b.toml")
        self.assert_same(found.to_dict(), expected)
        if found.plan is not None:
            self.assert_same_file("next_b.toml", "next.toml")
            self.assertEqual(rotorlead.Plan.read("next.toml"), found.plan)
            nominal = {record["nominal"] for record in found.plan.to_dict()["record"]}
            self.assertTrue(nominal <= {0.3, 0.5}, nominal)

    def test_a_real_log(self):
        self.assert_same(rotorlead.diagnose("real").to_dict(), answer("diagnose", "real"))

    def test_records_behind_a_compensator(self):
        lead = rotorlead.design("model.toml").compensator
        found = rotorlead.simulate("motor.toml", "plan.toml", compensator=lead, out="compensated")
        self.assert_same(rotorlead.diagnose(found).to_dict(), answer("diagnose", "compensated"))


class Design(Stand):
    def check(self, options, **keywords):
        expected = answer("design", "--model", "model.toml", "--out", "a.toml", *options)
        found = rotorlead.design("model.toml", out="b.toml", **keywords)
        self.assert_same(found.to_dict(), expected)
        self.assert_same_file("b.toml", "a.toml")
        found.compensator.write("c.toml")
        self.assert_same_file("c.toml", "a.toml")
        return found

    def test_what_is_recommended(self):
        found = self.check([]).to_dict()
        self.assertEqual(found["recommend"]["force"]["kind"], "inverse")
        bare, *others = found["candidates"]
        self.assertEqual(bare["actuator"], "none")
        self.assertTrue(all(one["noise_gain"] > bare["noise_gain"] for one in others))
        self.check(["--purpose", "force"], purpose="force")

    def test_a_lead(self):
        found = self.check(["--kind", "lead"], kind="lead")
        self.check(
            ["--omega-g", "400", "--damping", "0.8", "--loop-rate", "4000", "--prewarp", "30"],
            omega_g_rad_s=400, damping=0.8, loop_rate_hz=4000, prewarp_rad_s=30,
        )
        curve = found.frequency_response
        self.assertEqual(curve.response.shape, (2, len(curve.omega_rad_s)))
        # Far below the loop's rate it is C(s), equation (3) of the paper.
        slow = curve.omega_rad_s < 100
        exact = found.tf()(1j * curve.omega_rad_s[slow])
        np.testing.assert_allclose(curve.response[0][slow], exact, rtol=1e-3)
        np.testing.assert_array_equal(curve.response[0], curve.response[1])

    def test_an_inverse(self):
        found = self.check(["--kind", "inverse"], kind="inverse")
        self.check(
            ["--kind", "inverse", "--setting", "robust", "--natural", "80", "--slew", "20",
             "--output-range", "0.05..1", "--compensate-range", "0.3..0.5"],
            kind="inverse", setting="robust", natural_rad_s=80, slew_per_s=20,
            output_range=(0.05, 1), compensate_range=(0.3, 0.5),
        )
        # It is another filter at each command.
        curve = found.frequency_response
        self.assertFalse(np.allclose(*curve.response))
        slow = curve.omega_rad_s < 100
        for nominal, response in zip(curve.nominal, curve.response):
            np.testing.assert_allclose(response[slow], found.tf(nominal)(1j * curve.omega_rad_s[slow]), rtol=1e-2)
        with self.assertRaisesRegex(ValueError, "give one, as in"):
            found.tf()


class Others(Stand):
    """The other commands."""

    def test_a_validation(self):
        for model, records in (("model.toml", "sim"), (rotorlead.Model.read("model.toml"), rotorlead.Records.read("sim"))):
            found = rotorlead.validate(model, records)
            self.assert_same(found.to_dict(), answer("validate", "sim", "--model", "model.toml"))
        self.assertEqual([str(file) for file in found.records.file], [record["file"] for record in SIM])

    def test_bandwidths(self):
        self.assert_same(rotorlead.bandwidth("model.toml").to_dict(), answer("bandwidth", "model.toml"))
        lead = rotorlead.design("model.toml", kind="lead", out="lead.toml").compensator
        options = ("--compensator", "lead.toml", "--sampled", "--esc-frame", "500", "--steps", "0.05", "--robustness", "--records", "sim")
        found = rotorlead.bandwidth("model.toml", lead, sampled=True, esc_frame_hz=500, steps=[0.05], robustness=True, records="sim")
        self.assert_same(found.to_dict(), answer("bandwidth", "model.toml", *options))
        self.assertEqual(found.points.nominal.tolist(), [0.3, 0.5])
        self.assertEqual(len(found.measured), 1)

    def test_a_report(self):
        found = rotorlead.report("sim", out="found.html")
        self.assert_same(found.to_dict(), answer("report", "sim", "--out", "expected.html"))
        page, expected = (pathlib.Path(name).read_text(encoding="utf-8") for name in ("found.html", "expected.html"))
        # The page of the command has pictures beside its interactive figures, and the command that repeats it.
        bare = re.sub(r'<div class="still">.*?</div>', '<div class="still"></div>', expected, flags=re.DOTALL)
        bare = re.sub(r'\n*<section id="again">.*?</section>', "", bare, flags=re.DOTALL)
        self.assertEqual(re.sub(r"\n+", "\n", page), re.sub(r"\n+", "\n", bare))

    def test_an_export(self):
        rotorlead.identify("real", out="of_real.toml")
        for stack in ("paparazzi", "rotorpy"):
            found = rotorlead.export("of_real.toml", stack, at=0.3, out="b.txt")
            self.assert_same(found.to_dict(), answer("export", "of_real.toml", "--for", stack, "--at", "0.3", "--out", "a.txt"))
            self.assert_same_file("b.txt", "a.txt")
            self.assertEqual(found.text, pathlib.Path("a.txt").read_text())
        found = rotorlead.export("model.toml", "matlab", records="sim")
        answer("export", "model.toml", "--for", "matlab", "--records", "sim", "--out", "a.mat")
        self.assertEqual(found.content, pathlib.Path("a.mat").read_bytes())
