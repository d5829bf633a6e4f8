"""The comparison as Markdown."""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median

from answers import Answer

TOOLS = {
    "lag": "a first-order lag",
    "polynomial": "SINDy, polynomials",
    "delays": "SINDy, polynomials and delays",
    "catalog": "SINDy, the catalog's laws",
    "diagnosis": "`rotorlead diagnose`",
}
# Effects that act nearly alike: a name counts as near where it is of the hidden one's family.
FAMILIES = (
    {"transport_delay", "esc_frame_hold", "moving_average", "second_pole"},
    {"dead_band", "backlash", "command_quantization"},
    {"asymmetric_lag", "operating_point_lag", "quadratic_thrust", "saturation", "absolute_response", "absolute_command"},
    {"inflow_lead", "stand_resonance"},
    {"supply_sag", "gain_drift"},
)


@dataclass(frozen=True)
class Case:
    """A set of records with what is in it and each tool's answer."""

    label: str
    sort: str
    known: tuple[str, ...]
    value: float | None
    noise: float | None
    answers: dict[str, Answer]


def is_near(name: str, hidden: str) -> bool:
    return name == hidden or any(name in family and hidden in family for family in FAMILIES)


def verdict(case: Case, answer: Answer) -> str:
    """`right` by the first name, `near` by any, `wrong` or `none`."""
    names = answer.names
    if not case.known:
        return "wrong" if names else "right"
    (hidden,) = case.known
    if not names:
        return "right" if [hidden] in answer.minor else "none"
    if hidden in names[0]:
        return "right"
    return "near" if any(is_near(name, hidden) for group in names for name in group) else "wrong"


def parameter(case: Case, answer: Answer) -> float | None:
    """By how much the hidden effect's parameter is off, in percent."""
    if case.value is None or not case.known or (found := answer.values.get(case.known[0])) is None:
        return None
    # The sign of a clock is a convention.
    return 100.0 * abs(abs(found) / abs(case.value) - 1.0)


def percent(gap: float, digits: int) -> str:
    """A gap, where the simulation has not run away."""
    return f"{gap:.{digits}f}" if gap < 1000.0 else "runs away"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    head = list(head)
    return [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}", *(f"| {' | '.join(row)} |" for row in rows), ""]


def named(answer: Answer) -> str:
    """The names in order, each once; a group of alternatives with `or`."""
    # Three names at most are printed: a polynomial's term may be more.
    groups = list(dict.fromkeys(" or ".join(group) if len(group) <= 3 else f"one of {len(group)} laws" for group in answer.names))
    said = ", ".join(groups).replace("_", " ")
    return said or ("(minor) " + ", ".join(group[0] for group in answer.minor).replace("_", " ") if answer.minor else "-")


def summary(cases: list[Case]) -> list[str]:
    """How often each tool is right, and what it leaves."""
    hidden = [case for case in cases if case.sort == "effect"]
    others = {sort: [case for case in cases if case.sort == sort] for sort in ("nothing", "outside")}
    rows = []
    for tool, label in TOOLS.items():
        words = [verdict(case, case.answers[tool]) for case in hidden]
        errors = [error for case in hidden if (error := parameter(case, case.answers[tool])) is not None]
        ratios = [case.answers[tool].gap / case.answers["lag"].gap for case in hidden]
        rows.append([
            label,
            *(str(words.count(word)) for word in ("right", "near", "wrong", "none")),
            f"{median(errors):.1f} ({len(errors)})" if errors else "-",
            *(f"{sum(verdict(case, case.answers[tool]) == 'right' for case in some)}/{len(some)}" for some in others.values()),
            f"{100 * median(ratios):.0f}",
            f"{100 * median([c.answers[tool].gap / c.answers['lag'].gap for c in others['outside']] or [1.0]):.0f}",
            f"{median(case.answers[tool].seconds for case in cases if case.sort != 'benchmark'):.1f}",
        ])  # fmt: skip
    head = ["tool", "right", "near", "wrong", "none", "parameter off by (%)", "nothing hidden: no name", "outside: no name",
            "gap left (% of the lag's)", "the same, outside", "time (s)"]  # fmt: skip
    return table(head, rows)


def page(cases: list[Case]) -> str:
    """All tables."""
    tools = list(TOOLS)[1:]
    lines = []
    if benchmarks := [case for case in cases if case.sort == "benchmark"]:
        lines += ["### Public records", ""]
        rows = [
            [case.label, TOOLS[tool], named(answer), percent(answer.gap, 1), f"{answer.seconds:.1f}"]
            for case in benchmarks
            for tool, answer in ((tool, case.answers[tool]) for tool in TOOLS)
        ]
        lines += table(["record", "tool", "named", "held-out gap (%)", "time (s)"], rows)
    blind = sorted((case for case in cases if case.sort != "benchmark"), key=lambda case: (case.sort, case.label))
    lines += ["### Blind records", "", *summary(blind), "### Case by case", ""]
    rows = []
    for case in blind:
        value = "" if case.value is None else f" {case.value:.3g}"
        cells = [f"{case.label.replace('_', ' ')}{value}", f"{100 * (case.noise or 0):.1f}", f"{case.answers['lag'].gap:.2f}"]
        for tool in tools:
            answer = case.answers[tool]
            said = named(answer) if tool in ("catalog", "diagnosis") else verdict(case, answer)
            found = answer.values.get(case.known[0]) if case.known else None
            cells.append(f"{said}{'' if found is None else f' {found:.3g}'}; {percent(answer.gap, 2)}")
        rows.append(cells)
    lines += table(["hidden", "noise (%)", "gap of the lag (%)", *(TOOLS[tool] for tool in tools)], rows)
    return "\n".join(lines)
