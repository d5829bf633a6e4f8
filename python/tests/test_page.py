"""The blocks of docs/python.md run, and the example draws its figure."""

import pathlib
import re
import shutil
import subprocess
import sys

from stand import ROOT, Stand, answer

PAGE = ROOT / "docs/python.md"


class Page(Stand):
    def test_every_block_runs(self):
        shutil.copytree("real", "stand")
        pathlib.Path("fleet").mkdir()
        pathlib.Path("fleet/fleet.csv").write_text("log,motor,date\n" + "".join(f"{log},M1,\n" for log in ("good", "again", "once more", "bad")))
        # A command is usual where three logs share it.
        for log in ("good", "again", "once more"):
            shutil.copytree("real", f"fleet/{log}")
        pathlib.Path("fleet/bad").mkdir()
        blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        self.assertEqual(len(blocks), 3)
        printed = []
        for block in blocks:
            ended = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, encoding="utf-8")
            self.assertEqual(ended.returncode, 0, f"{block}\n{ended.stderr}")
            printed.append(ended.stdout)
        self.assertIn("measure again", printed[1])
        self.assertIn("bad failed: `fleet/bad/experiment.toml` does not exist", printed[2])
        # What the last wrote is what the command takes.
        self.assertEqual(len(answer("fleet", "fleet")["logs"]), 4)

    def test_the_example_draws_its_figure(self):
        example = [sys.executable, str(ROOT / "python/example.py"), "figure.png"]
        ended = subprocess.run(example, capture_output=True, text=True, encoding="utf-8")
        self.assertEqual(ended.returncode, 0, ended.stderr)
        # The lag that the example's motor has, within three standard errors.
        (found,) = re.findall(r"^missing: second_pole, time_constant_s = (\S+) \+- (\S+) s$", ended.stdout, re.MULTILINE)
        value, std = map(float, found)
        self.assertLess(abs(value - 0.012), 3 * std)
        self.assertEqual(pathlib.Path("figure.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
