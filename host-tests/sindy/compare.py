"""Puts the diagnosis and SINDy on the same records, and prints a table of what each names: see docs/against-sindy.md."""

import argparse
import json
import os
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# One core for either, before NumPy is loaded.
os.environ["OMP_NUM_THREADS"] = "1"

import answers as ask  # noqa: E402
from page import Case, page  # noqa: E402
from records import Record, read_experiment, read_table  # noqa: E402

ONE_EFFECT = (
    "transport_delay,esc_frame_hold,dead_band,backlash,command_quantization,saturation,slew_limit,asymmetric_lag,operating_point_lag,"
    "quadratic_thrust,second_pole,inflow_lead,supply_sag,gain_drift,stand_resonance,clock_skew,moving_average"
)


@dataclass(frozen=True)
class Benchmark:
    """A public record: the rows that are fitted, those that are held out, and what is known to be in it."""

    name: str
    fit: tuple[tuple[str, slice], ...]
    held_out: tuple[str, slice]
    known: tuple[str, ...]


ALL = slice(None)
BENCHMARKS = (
    Benchmark(
        "cascaded tanks",
        (("cascaded_tanks_estimation.csv", ALL),),
        ("cascaded_tanks_validation.csv", ALL),
        ("second_pole", "saturation", "quadratic_thrust"),
    ),
    Benchmark(
        "coupled drives",
        (("coupled_drives_1.csv", ALL), ("coupled_drives_2.csv", ALL)),
        ("coupled_drives_3.csv", ALL),
        (),
    ),
    # Chosen: the first 2500 of 3499 rows are fitted.
    Benchmark("MR damper", (("mr_damper.csv", slice(0, 2500)),), ("mr_damper.csv", slice(2500, None)), ()),
)


def write_benchmark(benchmark: Benchmark, data: Path, program: Path, folder: Path) -> list[Record]:
    """Writes the parts as an experiment for the program, at one nominal command; gives the records."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    parts = [*benchmark.fit, benchmark.held_out]
    records, tables = [], []
    for place, (file, rows) in enumerate(parts):
        lines = (data / file).read_text().splitlines()
        table = folder / f"part_{place}.csv"
        table.write_text("\n".join([lines[0], *lines[1:][rows]]) + "\n")
        tables.append(table)
        records.append(read_table(data / file, rows, held_out=place == len(benchmark.fit)))
    nominal = round(sum(record.nominal for record in records[:-1]) / (len(records) - 1), 6)
    experiment = folder / "experiment"
    ask.run([program, "import", *tables, "--excitation", "free", "--nominal", str(nominal), "--out", experiment, "--quiet"])
    manifest = (experiment / "experiment.toml").read_text()
    for place, table in enumerate(tables):
        role = "validate" if place == len(benchmark.fit) else "fit"
        manifest = manifest.replace(f'file = "{table.name}"', f'file = "{table.name}"\nrole = "{role}"')
    (experiment / "experiment.toml").write_text(manifest)
    return [Record(nominal, r.step_s, r.command, r.response, r.held_out, r.is_scored) for r in records]


def answer_benchmark(job: tuple[Benchmark, Path, Path, Path]) -> Case:
    """Both tools' answers on a public record, from the folder where they are there already."""
    benchmark, data, program, work = job
    out = work / "benchmarks" / benchmark.name.replace(" ", "_")
    kept = out / "answers.json"
    if not kept.exists():
        records = write_benchmark(benchmark, data, program, out)
        said = ask.ask_diagnosis(program, out / "experiment", out / "diagnosis")
        error = ask.simulated_gap(program, out / "experiment", out / "diagnosis.toml", out / "figures", records)
        said = ask.Answer(**{**vars(said), "gap": error, "noise_floor": None})
        kept.write_text(ask.as_json({**ask.ask_sindy(records), "diagnosis": said}))
    return Case(benchmark.name, "benchmark", benchmark.known, None, None, ask.from_json(kept.read_text()))


def answer_blind(job: tuple[Path, Path, Path]) -> Case:
    """Both tools' answers on a blind case; its truth is read after that."""
    folder, program, work = job
    found = {}
    for name in ("sindy", "diagnosis"):
        out = work / name / f"{folder.name}.json"
        out.parent.mkdir(parents=True, exist_ok=True)
        if not out.exists():
            is_sindy = name == "sindy"
            given = ask.ask_sindy(read_experiment(folder)) if is_sindy else {name: ask.ask_diagnosis(program, folder, work / "said" / folder.name)}
            out.write_text(ask.as_json(given))
        found |= ask.from_json(out.read_text())
    return blind_case(json.loads((work / "truth" / f"{folder.name}.json").read_text()), found)


def blind_case(truth: dict[str, Any], found: dict[str, ask.Answer]) -> Case:
    """The answers beside the truth."""
    hidden = truth["effects"][0] if truth["effects"] else None
    sort = "outside" if truth["outside"] else "effect" if hidden else "nothing"
    label = truth["outside"] or (hidden["kind"] if hidden else "nothing")
    value = dict(hidden["parameters"])[ask.PARAMETERS[hidden["kind"]]] if hidden else None
    return Case(label, sort, (hidden["kind"],) if hidden else (), value, truth["noise_level"], found)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rotorlead", type=Path, required=True, help="the program")
    parser.add_argument("--blind", type=Path, required=True, help="the program that makes blind cases")
    parser.add_argument("--benchmarks", type=Path, help="folder with the public records; none of them unless given")
    parser.add_argument("--work", type=Path, required=True, help="folder for cases and answers; what is there is not asked again")
    parser.add_argument("--seeds", type=int, default=1, help="cases of each effect")
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument("--quick", action="store_true", help="one blind case and the coupled drives")
    parser.add_argument("--page", type=Path, help="writes the tables there too")
    return parser.parse_args()


def main() -> int:
    options = arguments()
    work = options.work.resolve()
    (work / "said").mkdir(parents=True, exist_ok=True)
    kinds = "second_pole" if options.quick else f"{ONE_EFFECT},nothing,outside"
    program = options.rotorlead.resolve()
    ask.run([
        options.blind.resolve(), "--only-ceilings", "--set", "report", "--rivals", "none", "--kinds", kinds,
        "--seeds", str(options.seeds), "--jobs", str(options.jobs), "--keep", work,
    ])  # fmt: skip
    benchmarks = [one for one in BENCHMARKS if not options.quick or one.name == "coupled drives"] if options.benchmarks else []
    with ProcessPoolExecutor(options.jobs) as pool:
        public = pool.map(answer_benchmark, [(one, options.benchmarks, program, work) for one in benchmarks])
        blind = pool.map(answer_blind, [(folder, program, work) for folder in sorted((work / "cases").iterdir())])
        cases = [*public, *blind]
    text = page(cases)
    print(text)
    if options.page:
        options.page.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
