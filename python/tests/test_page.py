"""The blocks of docs/python.md and the notebook run, and the example draws its figure."""

import base64
import os
import pathlib
import re
import shutil
import subprocess
import sys

import nbclient
import nbformat

from stand import ROOT, Stand, answer

PAGE = ROOT / "docs/python.md"


class Page(Stand):
    def test_every_block_runs(self):
        shutil.copytree("real", "stand")
        rows = [f"{10 * k},{20 + 10 * (k // 100 % 4)},{3000 + 700 * (k // 100 % 4) + k % 3}" for k in range(1200)]
        pathlib.Path("table.csv").write_text("\n".join(["t,throttle,rpm", *rows]) + "\n")
        pathlib.Path("fleet").mkdir()
        pathlib.Path("fleet/fleet.csv").write_text("log,motor,date\n" + "".join(f"{log},M1,\n" for log in ("good", "again", "once more", "bad")))
        # A command is usual where three logs share it.
        for log in ("good", "again", "once more"):
            shutil.copytree("real", f"fleet/{log}")
        pathlib.Path("fleet/bad").mkdir()
        blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        self.assertEqual(len(blocks), 4)
        printed = []
        for block in blocks:
            ended = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, encoding="utf-8")
            self.assertEqual(ended.returncode, 0, f"{block}\n{ended.stderr}")
            printed.append(ended.stdout)
        self.assertIn("measure again", printed[2])
        self.assertIn("bad failed: `fleet/bad/experiment.toml` does not exist", printed[3])
        # What the last wrote is what the command takes.
        self.assertEqual(len(answer("fleet", "fleet")["logs"]), 4)

    def test_the_notebook_runs_and_shows_its_figures(self):
        notebook = nbformat.read(ROOT / "python/notebook.ipynb", as_version=4)
        self.assertFalse(any(cell.get("outputs") for cell in notebook.cells), "it is stored without outputs")
        # What it writes goes here: the log that it names is beside the folder it runs in.
        log = pathlib.Path("sim/records/tests/data")
        log.mkdir(parents=True)
        shutil.copy(ROOT / log / "esc32.csv", log)
        pathlib.Path("python").mkdir()
        nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": "python"}}).execute()
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        # A warning is an output of its own, and there is none.
        self.assertEqual([output for output in outputs if output.output_type == "stream" and output.name == "stderr"], [])
        pictures = [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]
        self.assertEqual(len(pictures), 4)
        folder = os.environ.get("ROTORLEAD_PICTURES")
        for index, picture in enumerate(pictures if folder else []):
            pathlib.Path(folder, f"notebook{index}.png").write_bytes(base64.b64decode(picture))
        shown = [output.data["text/html"] for output in outputs if "text/html" in output.get("data", {})]
        self.assertGreaterEqual(len(shown), 6)

    def test_the_example_draws_its_figure(self):
        example = [sys.executable, str(ROOT / "python/example.py"), "figure.png"]
        ended = subprocess.run(example, capture_output=True, text=True, encoding="utf-8")
        self.assertEqual(ended.returncode, 0, ended.stderr)
        # The lag that the example's motor has, within three standard errors.
        (found,) = re.findall(r"^missing: second_pole, time_constant_s = (\S+) \+- (\S+) s$", ended.stdout, re.MULTILINE)
        value, std = map(float, found)
        self.assertLess(abs(value - 0.012), 3 * std)
        self.assertEqual(pathlib.Path("figure.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
