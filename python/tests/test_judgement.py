"""A motor is judged as the command judges it: the same word, limits and recommendations, from a folder of each log."""

import os
import pathlib

import rotorlead
from stand import ROOT, Stand, answer

DATA = pathlib.Path(os.environ.get("ROTORLEAD_DATA", ROOT / "../shared/data"))
OWN = ROOT / "sim/records/tests/data"
STAIRCASE = ("--excitation", "staircase")
DUTY = (*STAIRCASE, "--column", "command=command:duty")
LOGS = [
    (OWN / "rcbenchmark.csv", ()),
    (OWN / "esc32.csv", STAIRCASE),
    (OWN / "chirp.bin", ()),
    (DATA / "alspitz_esc_test/f40_steps_5-2.csv", STAIRCASE),
    (DATA / "alspitz_esc_test/esc32v3_f60-1.csv", STAIRCASE),
    (DATA / "alspitz_esc_test/Log_2019-11-09_181347.csv", STAIRCASE),
    (DATA / "sar_simulation/micro_2023-12-17_162234.csv", STAIRCASE),
    (DATA / "sar_simulation/so_v5_2023-12-13_130935.csv", STAIRCASE),
    (DATA / "cases/ramp-called-usable/log.csv", DUTY),
    (DATA / "cases/thrust-square-called-unequal-lags/log.csv", DUTY),
]


class Judgement(Stand):
    def assert_judged_alike(self, folder):
        found, expected = rotorlead.identify(folder), answer("identify", folder)["judgement"]
        self.assert_same(found.to_dict()["judgement"], expected)
        self.assertEqual(found.judgement, (expected["state"], tuple(expected["limits"])))
        self.assertIn(found.judgement.state, ("ready", "ready within limits", "measure again", "not a lag"))
        self.assertTrue(found.judgement.limits or found.judgement.state == "ready")

    def test_logs(self):
        for index, (log, options) in enumerate(LOGS):
            if not log.exists() and "CI" not in os.environ:
                print(f"skipped: {log} is not there")
                continue
            with self.subTest(log):
                answer("import", log, *options, "--out", f"log{index}")
                self.assert_judged_alike(f"log{index}")

    def test_a_simulation(self):
        self.assert_judged_alike("sim")
