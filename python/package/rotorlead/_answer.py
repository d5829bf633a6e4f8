"""What all answers have in common."""

from __future__ import annotations

import base64
import html
import json
import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Union

from . import _native
from ._figure import Axes, Figure
from ._json import Json, Object, child, children, copied, items, number, text, texts
from ._optional import package

if TYPE_CHECKING:
    import matplotlib.axes
    import pandas

Path = Union[str, "os.PathLike[str]"]

# Sentences of the verdict, and rows of a table, that a cell of a notebook shows. Chosen: it fits a screen.
SENTENCES = 3
ROWS = 12
STYLE = "max-width:860px;overflow-x:auto;font-size:90%"


@dataclass(frozen=True, repr=False, eq=False)
class AnswerTable:
    """A table of an answer, as its page shows it. `frame` has the numbers."""

    name: str
    #: What it lists.
    caption: str
    _json: Object

    def __repr__(self) -> str:
        return f"<rotorlead.AnswerTable {self.name!r}: {len(children_rows(self._json))} rows>"

    def frame(self) -> pandas.DataFrame:
        """The numbers as a DataFrame of pandas, whose columns have the unit in their names; standard errors have columns of
        their own, and what is not known is NaN. Raises ImportError where there is no pandas."""
        columns: dict[str, list[Json]] = {}
        rows = children_rows(self._json)
        for index, column in enumerate(children(self._json, "columns")):
            name = text(column, "name")
            cells = [row[index] for row in rows]
            columns[name] = [_value(cell)[0] for cell in cells]
            if any("Estimate" in child(cell, "value") for cell in cells):
                columns[f"{name}_std"] = [_value(cell)[1] for cell in cells]
        made: pandas.DataFrame = package("pandas", "a table as a DataFrame").DataFrame(columns)
        return made

    def _repr_html_(self) -> str:
        return f'<div style="{STYLE}">{self._html(detail=True)}</div>'

    def _html(self, detail: bool = False) -> str:
        """A table of HTML, without what is not known in any row."""
        rows = children_rows(self._json)
        columns = children(self._json, "columns")
        known = [
            index
            for index, column in enumerate(columns)
            if (detail or not column.get("is_detail")) and any(row[index].get("value") != "Unknown" for row in rows)
        ]
        heads = "".join(f"<th>{_escaped(_heading(columns[index]))}</th>" for index in known)
        body = "".join(
            "<tr>" + "".join(f"<td>{_escaped(text(row[index], 'text'))}</td>" for index in known) + "</tr>"
            for row in rows[:ROWS]
        )
        more = f"<p>{len(rows) - ROWS} further rows</p>" if len(rows) > ROWS else ""
        return (
            f'<table><caption style="text-align:left">{_escaped(self.caption)}</caption>'
            f"<thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>{more}"
        )


@dataclass(frozen=True, repr=False, eq=False)
class Answer:
    """What the command of the same name answers: a headline, warnings, tables and figures, and numbers for programs."""

    _values: Object
    _page: str

    @cached_property
    def _parsed(self) -> Object:
        page: Object = json.loads(self._page)
        return page

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return text(child(self._parsed, "verdict"), "headline")

    @property
    def sentences(self) -> tuple[str, ...]:
        """What else is to be known first."""
        return texts(child(self._parsed, "verdict"), "sentences")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with what the answer rests on, each with what to do."""
        return texts(self._parsed, "warnings")

    @property
    def tables(self) -> tuple[AnswerTable, ...]:
        """The tables of the page."""
        tables = [table for section in children(self._parsed, "sections") for table in children(section, "tables")]
        return tuple(AnswerTable(text(table, "name"), text(table, "caption"), table) for table in tables)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """The figures of the page, the one that says most first."""
        sections = sorted(children(self._parsed, "sections"), key=lambda section: text(section, "name") != self._section())
        return tuple(Figure._from_json(figure) for section in sections for figure in children(section, "figures"))

    def _section(self) -> str:
        """The part of the page whose figures come first."""
        return ""

    def to_dict(self) -> Object:
        """The keys and values of `--json` of the command. What is not known is None."""
        return copied(self._values)

    def plot(self, name: str | None = None, ax: Axes | None = None) -> tuple[matplotlib.axes.Axes, ...]:
        """Draws a figure with matplotlib: the one called `name` in `figures`, or else the first.

        `ax` is where: one axes for the first panel, or a sequence of them; a new figure of pyplot unless given. Returns the axes.
        Raises ImportError where there is no matplotlib, and ValueError where there is no such figure.
        """
        figures = self.figures
        for figure in figures:
            if name is None or figure.name == name:
                return figure.plot(ax)
        known = ", ".join(figure.name for figure in figures) or "none"
        raise ValueError(f"there is no figure {name or 'in this answer'}: it has {known}")

    def report(self, path: Path, *, pictures: bool = False) -> None:
        """Writes the page: one HTML file with the verdict, tables and interactive figures, which needs no network.

        With `pictures` each figure is there as a picture too, drawn by matplotlib: for paper, and where scripts do not run. Raises
        Error where the file cannot be written.
        """
        stills: list[str] = []
        if pictures:
            drawn = [Figure._from_json(figure) for section in children(self._parsed, "sections") for figure in children(section, "figures")]
            stills = [
                f'<img alt="{_escaped(figure.title)}" style="max-width:100%" src="data:image/png;base64,'
                f'{base64.b64encode(figure.png()).decode()}">'
                for figure in drawn
            ]
        _native.write_page(self._page, stills, path)

    def __repr__(self) -> str:
        return f"<rotorlead.{type(self).__name__}: {self.headline}>"

    def _repr_html_(self) -> str:
        """For a cell of a notebook: the verdict, the tables that a terminal shows, and the warnings, folded."""
        said = f"<p><b>{_escaped(self.headline)}</b></p>"
        if self.sentences:
            said += "<ul>" + "".join(f"<li>{_escaped(one)}</li>" for one in self.sentences[:SENTENCES]) + "</ul>"
        shown = [table for table in self.tables if text(table._json, "weight") == "Shown" and table.name != "records"]
        said += "".join(table._html() for table in shown[:2])
        if self.warnings:
            listed = "".join(f"<li>{_escaped(one)}</li>" for one in self.warnings)
            said += f"<details><summary>{len(self.warnings)} warnings</summary><ul>{listed}</ul></details>"
        return f'<div style="{STYLE}">{said}</div>'


def children_rows(table: Object) -> list[list[Object]]:
    """The rows of a table, each a list of cells."""
    rows = [row for row in items(table, "rows") if isinstance(row, list)]
    return [[cell for cell in row if isinstance(cell, dict)] for row in rows]


def _value(cell: Object) -> tuple[Json, float]:
    """The number or the words of a cell, and its standard error."""
    value = cell.get("value")
    if isinstance(value, dict):
        pair = items(value, "Estimate") or [value.get("Number"), None]
        of = dict(zip(("value", "std"), pair))
        return number(of, "value"), number(of, "std")
    return (text(cell, "text") if value == "Words" else float("nan")), float("nan")


def _heading(column: Object) -> str:
    unit = text(column, "unit")
    return f"{text(column, 'heading')} [{unit}]" if unit else text(column, "heading")


def _escaped(words: str) -> str:
    return html.escape(words)
