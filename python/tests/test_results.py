"""What a function returns is what the command prints as JSON, from a folder and from columns in memory."""

import pathlib

import numpy as np

import rotorlead
from stand import ROOT, Stand, answer, columns

# Keys of the package alone: what the command writes into files.
OF_IDENTIFY = ["model"]
OF_DIAGNOSE = ["model", "plan"]
OF_DESIGN = ["compensator", "frequency_response"]


def in_memory(folder, entries, **of_all):
    """The records of a folder as dicts of columns."""
    return {**of_all, "records": [{**entry, **columns(pathlib.Path(folder, entry["file"]))} for entry in entries]}


SIM = [
    {"file": "u050_multisine.csv", "nominal": 0.5, "excitation": "multisine", "period_s": 10.0, "amplitude": 0.05},
    {"file": "u050_square.csv", "nominal": 0.5, "excitation": "square", "period_s": 5.0, "amplitude": 0.05},
]


class Identify(Stand):
    def test_a_simulated_folder(self):
        expected = answer("identify", "sim", "--out", "a.toml")
        found = rotorlead.identify("sim", out="b.toml")
        self.assert_same(found, expected, OF_IDENTIFY)
        self.assert_same_file("b.toml", "a.toml")
        # The model of the result is the one that is written.
        of_dict, of_file = (rotorlead.design(model, kind="lead")["compensator"] for model in (found["model"], "a.toml"))
        self.assertEqual(of_dict, of_file)
        # What is not known is None, never a number.
        self.assertIsNone(found["static_map"])

    def test_a_real_log(self):
        for folder in ("real", pathlib.Path("real")):
            self.assert_same(rotorlead.identify(folder), answer("identify", "real", "--out", "a.toml"), OF_IDENTIFY)

    def test_the_chirps_of_an_autopilots_log(self):
        answer("import", ROOT / "sim/records/tests/data/chirp.bin", "--out", "chirps")
        found = rotorlead.identify("chirps")
        self.assert_same(found, answer("identify", "chirps", "--out", "a.toml"), OF_IDENTIFY)
        self.assertTrue(found["frequency_responses"])

    def test_its_options(self):
        for delay in ("none", "fit"):
            expected = answer("identify", "sim", "--out", "a.toml", "--delay", delay)
            self.assert_same(rotorlead.identify("sim", delay=delay), expected, OF_IDENTIFY)

    def test_columns_in_memory_are_a_folder(self):
        expected = rotorlead.identify("sim")
        records = in_memory("sim", SIM, name="two records", esc_frame_hz=600.0, sample_rate_hz=1000, command_rate_hz=5000)
        self.assert_same(rotorlead.identify(records), expected)
        # Lists, and numbers of NumPy, are columns and numbers too.
        for record in records["records"]:
            record["thrust_n"] = record["thrust_n"].tolist()
            record["nominal"] = np.float64(record["nominal"])
        records["sample_rate_hz"] = np.int64(1000)
        self.assert_same(rotorlead.identify(records), expected)

    def test_one_record_of_a_real_log_in_memory(self):
        (path,) = pathlib.Path("real").glob("*.csv")
        manifest = pathlib.Path("real/experiment.toml").read_text().splitlines()
        values = dict(line.split(" = ", 1) for line in manifest if " = " in line)
        record = {"file": path.name, "name": "a log", "excitation": values["excitation"].strip('"')}
        record["output"] = values["output"].strip('"')
        keys = ("nominal", "amplitude", "sample_rate_hz", "esc_frame_hz", "command_rate_hz")
        record.update({key: float(values[key]) for key in keys if key in values})
        expected = rotorlead.identify("real")
        # A record alone does not say what it is called.
        expected["model"]["provenance"]["experiment"] = "a log"
        self.assert_same(rotorlead.identify({**record, **columns(path)}), expected)

    def test_the_response_that_is_asked_for(self):
        records = in_memory("sim", SIM, name="two records", esc_frame_hz=600.0, sample_rate_hz=1000, command_rate_hz=5000)
        expected = rotorlead.identify(records)
        for record in records["records"]:
            record["rpm"] = 1000 * record["thrust_n"]
        self.assert_same(rotorlead.identify(records, output="thrust_n"), expected)
        # Speeds that are a thousand times the thrust have its time constants, and a thousand times the gains.
        of_speed = rotorlead.identify(records, output="rpm")
        self.assertEqual(of_speed["output"], "rpm")
        (thrust,), (speed,) = expected["points"], of_speed["points"]
        self.assertAlmostEqual(speed["gain"] / thrust["gain"], 1000, places=6)
        self.assertAlmostEqual(speed["time_constant_s"], thrust["time_constant_s"], places=9)

    def test_a_simulation_is_taken_as_it_is(self):
        self.assert_same(rotorlead.identify(rotorlead.simulate("motor.toml", "plan.toml")), rotorlead.identify("sim"))


class Simulate(Stand):
    def test_a_plan(self):
        expected = answer("simulate", "--model", "motor.toml", "--plan", "plan.toml", "--out", "by_command", "--seed", "7")
        found = rotorlead.simulate("motor.toml", "plan.toml", seed=7, out="by_function")
        self.assert_same_folder("by_function", "by_command")
        for record in found["records"]:
            on_disk = columns(pathlib.Path("by_command", record["file"]))
            for name in ("time_s", "command", "thrust_n", "rpm", "esc_command", "voltage_v", "current_a"):
                column = record.pop(name)
                if column is None:
                    self.assertNotIn(name, on_disk)
                else:
                    self.assertEqual(column.dtype, np.float64)
                    np.testing.assert_array_equal(column, on_disk[name])
        for expected_record, record in zip(expected["records"], found["records"]):
            self.assert_same({key: record[key] for key in expected_record}, expected_record)
        self.assert_same({key: found[key] for key in ("name", "seed")}, {"name": expected["name"], "seed": 7})

    def test_the_papers_experiment_as_a_mapping(self):
        answer("simulate", "--model", "model.toml", "--out", "paper_by_command")
        model = {
            "point": [
                {"nominal": 0.3, "gain": 5.2, "time_constant_s": 0.110, "time_constant_s_std": 0.001},
                {"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071, "time_constant_s_std": 0.001, "delay_s": 0.002},
            ],
            "static_map": None,
        }
        rotorlead.simulate(model, out="paper_by_function")
        self.assert_same_folder("paper_by_function", "paper_by_command")

    def test_behind_a_compensator(self):
        answer("design", "--model", "model.toml", "--out", "compensator.toml")
        options = ("--plan", "plan.toml", "--compensator", "compensator.toml")
        answer("simulate", "--model", "model.toml", *options, "--out", "lead_by_command")
        rotorlead.simulate("model.toml", "plan.toml", compensator="compensator.toml", out="lead_by_path")
        self.assert_same_folder("lead_by_path", "lead_by_command")
        lead = rotorlead.design("model.toml")["compensator"]
        found = rotorlead.simulate("model.toml", "plan.toml", compensator=lead, out="lead_by_dict")
        self.assert_same_folder("lead_by_dict", "lead_by_command")
        self.assertTrue(found["records"][0]["compensated"])
        self.assertEqual(len(found["records"][0]["esc_command"]), found["records"][0]["rows"])

    def test_a_seed_decides_the_noise(self):
        one, same, other = (
            rotorlead.simulate("model.toml", "plan.toml", seed=seed)["records"][0]["thrust_n"] for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(one, same)
        self.assertFalse(np.array_equal(one, other))


class Diagnose(Stand):
    def test_a_simulated_folder(self):
        files = ("--out-model", "a.toml", "--out-plan", "a_plan.toml")
        expected = answer("diagnose", "sim", *files)
        found = rotorlead.diagnose("sim", out_model="b.toml", out_plan="b_plan.toml")
        self.assert_same(found, expected, OF_DIAGNOSE)
        self.assertIn("second_pole", [effect["kind"] for effect in found["effects"]])
        self.assert_same_file("b.toml", "a.toml")
        self.assertEqual(pathlib.Path("b_plan.toml").exists(), pathlib.Path("a_plan.toml").exists())
        self.assertEqual(found["plan"] is None, found["next_experiment"] is None)
        # The improved model has the effect in it, and is a model as any.
        rotorlead.simulate(found["model"], "plan.toml")

    def test_the_plan_of_the_next_experiment(self):
        expected = answer("diagnose", "sim", "--model", "model.toml", "--out-plan", "next.toml")
        records = in_memory("sim", SIM, name="two records", esc_frame_hz=600.0, sample_rate_hz=1000, command_rate_hz=5000)
        model = {"point": [{"nominal": 0.3, "gain": 5.2, "time_constant_s": 0.110, "time_constant_s_std": 0.001},
                           {"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071, "time_constant_s_std": 0.001, "delay_s": 0.002}]}
        for data, given in (("sim", "model.toml"), (records, model)):
            found = rotorlead.diagnose(data, given, out_plan="next_b.toml")
            self.assert_same(found, expected, OF_DIAGNOSE)
            if found["plan"] is not None:
                self.assert_same_file("next_b.toml", "next.toml")
                nominal = {record["nominal"] for record in found["plan"]["record"]}
                self.assertTrue(nominal <= {0.3, 0.5}, nominal)

    def test_a_real_log(self):
        self.assert_same(rotorlead.diagnose("real"), answer("diagnose", "real"), OF_DIAGNOSE)

    def test_records_behind_a_compensator(self):
        lead = rotorlead.design("model.toml")["compensator"]
        found = rotorlead.simulate("motor.toml", "plan.toml", compensator=lead, out="compensated")
        self.assert_same(rotorlead.diagnose(found), answer("diagnose", "compensated"), OF_DIAGNOSE)


class Design(Stand):
    def check(self, options, **keywords):
        expected = answer("design", "--model", "model.toml", "--out", "a.toml", *options)
        found = rotorlead.design("model.toml", out="b.toml", **keywords)
        self.assert_same(found, expected, OF_DESIGN)
        self.assert_same_file("b.toml", "a.toml")
        return found

    def test_what_is_recommended(self):
        found = self.check([])
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
        curve = found["frequency_response"]
        self.assertEqual(curve["response"].shape, (2, len(curve["omega_rad_s"])))
        # Far below the loop's rate it is C(s), equation (3) of the paper.
        slow = curve["omega_rad_s"] < 100
        s, zero, pole = 1j * curve["omega_rad_s"][slow], found["zero_rad_s"], found["pole_rad_s"]
        exact = pole**2 * (s / zero + 1) / (s**2 + 2 * found["damping"] * pole * s + pole**2)
        np.testing.assert_allclose(curve["response"][0][slow], exact, rtol=1e-3)
        np.testing.assert_array_equal(curve["response"][0], curve["response"][1])

    def test_an_inverse(self):
        found = self.check(["--kind", "inverse"], kind="inverse")
        self.check(
            ["--kind", "inverse", "--setting", "robust", "--natural", "80", "--slew", "20",
             "--output-range", "0.05..1", "--compensate-range", "0.3..0.5"],
            kind="inverse", setting="robust", natural_rad_s=80, slew_per_s=20,
            output_range=(0.05, 1), compensate_range=(0.3, 0.5),
        )
        # It is another filter at each command.
        self.assertFalse(np.allclose(*found["frequency_response"]["response"]))
