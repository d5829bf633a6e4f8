"""Figures of an answer: the same panels, series and colors as in its page, drawn by matplotlib."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Union

import numpy as np

from ._json import Floats, Object, children, items, number, optional, text, texts
from ._optional import package

if TYPE_CHECKING:
    import matplotlib.artist
    import matplotlib.axes
    import matplotlib.axis
    import matplotlib.figure

# Inches of a figure's width, and pixels of the page in one. Chosen: a cell of a notebook at its usual width.
WIDTH = 7.5
PIXELS = 100.0
# How much of their color dots have, and how much a band covers; a band widens an axis by so much of what the points span. As in the page.
PALE, BAND, ROOM = 0.6, 0.22, 0.25
# Line or marker of each way in which points are drawn.
STYLES: dict[str, dict[str, Union[str, float]]] = {
    "Line": {"linestyle": "-", "linewidth": 1.6},
    "Dashes": {"linestyle": "--", "linewidth": 1.6},
    "Dots": {"linestyle": "", "marker": "o", "markersize": 3.0, "markeredgewidth": 0.0, "alpha": PALE},
    "Discs": {"linestyle": "", "marker": "o", "markersize": 6.0},
    "Crosses": {"linestyle": "", "marker": "x", "markersize": 6.0, "markeredgewidth": 1.5},
    "Rings": {"linestyle": "", "marker": "o", "markersize": 10.0, "markerfacecolor": "none", "markeredgewidth": 1.5},
    "Ticks": {"linestyle": "", "marker": "|", "markersize": 10.0, "markeredgewidth": 1.5},
}
# Ends of the scale of a heat map, as in the page.
LIGHTEST, DARKEST = "#f6f8fc", "#08306b"

Axes = Union["matplotlib.axes.Axes", Sequence["matplotlib.axes.Axes"]]


@dataclass(frozen=True, repr=False, eq=False)
class Figure:
    """A figure of an answer, in numbers. `plot` draws it."""

    name: str
    title: str
    #: How to read it.
    caption: str
    _json: Object

    @classmethod
    def _from_json(cls, json: Object) -> Figure:
        return cls(text(json, "name"), text(json, "title"), text(json, "caption"), json)

    def __repr__(self) -> str:
        return f"<rotorlead.Figure {self.name!r}: {self.title}>"

    def plot(self, ax: Axes | None = None) -> tuple[matplotlib.axes.Axes, ...]:
        """Draws it with matplotlib, one axes for each panel.

        `ax` is where: one axes for the first panel, or a sequence of them; a new figure of pyplot unless given. Returns the
        axes. Raises ImportError where there is no matplotlib.

        >>> found.figures[0].plot()                                     # doctest: +SKIP
        """
        if ax is None:
            pyplot = package("matplotlib.pyplot", "a figure")
            return self._draw_in(pyplot.figure(figsize=self._size(), layout="constrained"))
        axes: tuple[matplotlib.axes.Axes, ...] = tuple(ax) if isinstance(ax, (Sequence, np.ndarray)) else (ax,)
        self._draw(axes)
        axes[0].set_title(self.title, fontsize="medium")
        handles, labels = self._legend(axes)
        if handles:
            axes[0].legend(handles, labels, fontsize="small")
        return axes

    def png(self) -> bytes:
        """The figure as a picture, without pyplot. Raises ImportError where there is no matplotlib."""
        package("matplotlib.figure", "a picture")
        import matplotlib.figure

        figure = matplotlib.figure.Figure(figsize=self._size(), layout="constrained")
        self._draw_in(figure)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=PIXELS)
        return file.getvalue()

    def _size(self) -> tuple[float, float]:
        return WIDTH, sum(number(panel, "height") for panel in children(self._json, "panels")) / PIXELS + 0.7

    def _draw_in(self, figure: matplotlib.figure.Figure) -> tuple[matplotlib.axes.Axes, ...]:
        heights = [number(panel, "height") for panel in children(self._json, "panels")]
        made = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
        axes: tuple[matplotlib.axes.Axes, ...] = tuple(made[:, 0])
        self._draw(axes)
        figure.suptitle(self.title, fontsize="medium")
        handles, labels = self._legend(axes)
        if handles:
            columns = max(1, min(len(labels), int(96 / (max(map(len, labels)) + 6))))
            figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize="small", frameon=False,
                          markerscale=2.0 if self._has_dots() else 1.0)
        return axes

    def _legend(self, axes: Sequence[matplotlib.axes.Axes]) -> tuple[list[matplotlib.artist.Artist], list[str]]:
        """What stands for each group of series, once."""
        found: dict[str, matplotlib.artist.Artist] = {}
        for each in axes:
            for handle, label in zip(*each.get_legend_handles_labels()):
                found.setdefault(label, handle)
        return list(found.values()), list(found)

    def _has_dots(self) -> bool:
        panels = children(self._json, "panels")
        return any(text(series, "mark") == "Dots" for panel in panels for series in children(panel, "series"))

    def _draw(self, axes: Sequence[matplotlib.axes.Axes]) -> None:
        panels = children(self._json, "panels")
        for index, (panel, ax) in enumerate(zip(panels, axes)):
            # Panels above each other that have one axis name it once.
            is_under = index > 0 and panels[index - 1].get("x") == panel.get("x")
            is_over = index + 1 < len(panels) and panels[index + 1].get("x") == panel.get("x")
            _draw_panel(panel, ax, is_under, is_over)
            if is_under:
                ends = [end for one in (axes[index - 1], ax) for end in one.get_xlim()]
                axes[index - 1].set_xlim(min(ends), max(ends))
                ax.set_xlim(min(ends), max(ends))


def _pairs(of: Object, key: str) -> Floats:
    pairs = [[np.nan if end is None else end for end in pair] for pair in items(of, key) if isinstance(pair, list)]
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def _color(series: Object) -> tuple[float, float, float]:
    red, green, blue = (float(part) / 255 for part in items(series, "color") if isinstance(part, int))
    return red, green, blue


def _is_log(axis: Object) -> bool:
    return text(axis, "scale") == "Log"


def _label(axis: Object) -> str:
    label, unit = text(axis, "label"), text(axis, "unit")
    return f"{label}, {unit}" if unit else label


def _draw_panel(panel: Object, ax: matplotlib.axes.Axes, is_under: bool, is_over: bool) -> None:
    x, y = panel["x"], panel["y"]
    assert isinstance(x, dict) and isinstance(y, dict)
    for axis, letter in ((x, "x"), (y, "y")):
        if letter == "y" or not is_over:
            getattr(ax, f"set_{letter}label")(_label(axis), fontsize="small")
        if _is_log(axis):
            ax.set(**{f"{letter}scale": "log"})
    ax.grid(True, color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    if text(panel, "title"):
        ax.set_title(text(panel, "title"), fontsize="small", loc="left")
    heat = panel.get("map")
    if isinstance(heat, dict):
        _draw_map(heat, ax)
    bands = []
    for series in children(panel, "series"):
        points = _pairs(series, "points")
        shown = np.isfinite(points).all(axis=1)
        for axis, values in ((x, points[:, 0]), (y, points[:, 1])):
            shown &= (values > 0) if _is_log(axis) else True
        color, label = _color(series), text(series, "group")
        if text(series, "mark") == "Bars":
            ax.barh(points[shown, 1], points[shown, 0], height=0.6, color=color, label=label)
        else:
            # What is not drawn breaks a line.
            drawn = np.where(shown[:, None], points, np.nan)
            ax.plot(drawn[:, 0], drawn[:, 1], color=color, label=label, **STYLES[text(series, "mark")])  # type: ignore[arg-type]
        band = _pairs(series, "band")
        if len(band) == len(points) and shown.any():
            bands.append((points[shown, 0], band[shown], color))
    _fill_bands(bands, y, ax)
    for axis, letter in ((x, "x"), (y, "y")):
        scale = axis.get("scale")
        ends = [float(end) for end in items(axis, "range") if isinstance(end, (int, float))]
        if isinstance(scale, dict):
            names = texts(scale, "Names")
            getattr(ax, f"set_{letter}ticks")(range(len(names)), names)
            # The first name is at the top.
            getattr(ax, f"set_{letter}lim")(len(names) - 0.5, -0.5)
            ax.grid(False, axis="x" if letter == "x" else "y")
        elif len(ends) == 2:
            getattr(ax, f"set_{letter}lim")(*ends)
        if scale == "Degrees":
            ticker = package("matplotlib.ticker", "a figure")
            getattr(ax, f"{letter}axis").set_major_locator(ticker.MaxNLocator(nbins=7, steps=[1, 1.5, 3, 4.5, 9, 10]))
        if _is_log(axis):
            _name_log(getattr(ax, f"{letter}axis"), getattr(ax, f"get_{letter}lim")())
        if letter == "y" or not is_under:
            _draw_secondary(axis, letter, ax)


def _name_log(axis: matplotlib.axis.Axis, ends: tuple[float, float]) -> None:
    """Names powers of ten, and where there are few of them values between."""
    ticker = package("matplotlib.ticker", "a figure")
    decades = np.log10(max(ends) / min(ends)) if min(ends) > 0 else 9.0
    if decades < 2.5:
        axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0) if decades > 0.7 else range(1, 10)))
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())


def _draw_secondary(axis: Object, letter: str, ax: matplotlib.axes.Axes) -> None:
    """The same axis in another unit, on its other side."""
    secondary = axis.get("secondary")
    if not isinstance(secondary, dict):
        return
    factor = number(secondary, "factor")
    functions = (lambda value: value * factor, lambda value: value / factor)
    other = ax.secondary_xaxis("top", functions=functions) if letter == "x" else ax.secondary_yaxis("right", functions=functions)
    getattr(other, f"set_{letter}label")(_label(secondary), fontsize="small")
    if _is_log(axis):
        ends = getattr(ax, f"get_{letter}lim")()
        _name_log(getattr(other, f"{letter}axis"), (factor * ends[0], factor * ends[1]))


def _fill_bands(bands: list[tuple[Floats, Floats, tuple[float, float, float]]], y: Object, ax: matplotlib.axes.Axes) -> None:
    """Bands around points. One can be endless where noise hides the response, and widens the axis no further than [`ROOM`]."""
    if not bands:
        return
    along = np.log if _is_log(y) else np.asarray
    back = np.exp if _is_log(y) else np.asarray
    low, high = along(np.array(ax.get_ylim()))
    ends = np.concatenate([band.ravel() for _, band, _ in bands])
    ends = along(ends[np.isfinite(ends) & ((ends > 0) | (not _is_log(y)))])
    room = ROOM * (high - low)
    if len(ends):
        low, high = max(min(low, ends.min()), low - room), min(max(high, ends.max()), high + room)
    bottom, top = float(back(low)), float(back(high))
    for across, band, color in bands:
        lower = np.where(np.isfinite(band[:, 0]) & ((band[:, 0] > 0) | (not _is_log(y))), band[:, 0], bottom)
        upper = np.where(np.isfinite(band[:, 1]), band[:, 1], top)
        ax.fill_between(across, lower, upper, color=color, alpha=BAND, linewidth=0)
    ax.set_ylim(bottom, top)


def _draw_map(heat: Object, ax: matplotlib.axes.Axes) -> None:
    """Rectangles of a row each, whose color follows the logarithm of their value."""
    package("matplotlib.collections", "a figure")
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import LinearSegmentedColormap, LogNorm
    from matplotlib.patches import Rectangle

    cells = children(heat, "cells")
    ends = [tuple(float(end) for end in items(cell, "x") if isinstance(end, (int, float))) for cell in cells]
    rows = [number(cell, "row") for cell in cells]
    patches = [Rectangle((low, row - 0.48), high - low, 0.96) for (low, high), row in zip(ends, rows)]
    least, most = (float(end) for end in items(heat, "range") if isinstance(end, (int, float)))
    scale = LinearSegmentedColormap.from_list("shares", [LIGHTEST, DARKEST])
    drawn = PatchCollection(patches, cmap=scale, norm=LogNorm(least, most, clip=True))
    values = [optional(cell, "value") for cell in cells]
    drawn.set_array(np.array([least if value is None else max(value, least) for value in values]))
    ax.add_collection(drawn)
    ax.autoscale_view()
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(drawn, ax=ax, label=text(heat, "label"))
