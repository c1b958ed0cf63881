"""`PlotTable`: the numbers of a plot as tables; `as_csv`: all tables of a plot as CSV."""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from rid_daq.blocks.plot import Line, Panel, Plot
from rid_daq.terminal.console import make_printable

CSV_DIGITS: Final = 7


@dataclass(frozen=True, eq=False)
class PlotTable:
    """Columns of equal length.

    Attributes:
        name: Name of the quantity, after the name of the panel.
        columns: Numbers or texts by column name, with the unit in brackets. A gap is NaN.
    """

    name: str
    columns: Mapping[str, FloatArray | Sequence[str]]


def plot_tables(plot: Plot) -> Iterator[PlotTable]:
    """Yield the tables of a plot, in the order of drawing. Areas have no table."""
    title = ""
    for panel in plot.panels:
        title = panel.title or title
        for name, columns in _panel_tables(panel):
            yield PlotTable(f"{title} {name}".lstrip(), columns)


def as_csv(plot: Plot) -> str:
    """Return the data of a plot as one CSV table with the names in the first line.

    Tables are side by side; the shorter ones have empty cells at the end. If a plot has several
    tables, each column name begins with the name of its table: "measured: frequency [Hz]". Numbers
    have seven digits; a gap is an empty cell.

    Raises:
        ValueError: Two columns have the same name.
    """
    tables = list(plot_tables(plot))
    columns: dict[str, list[str]] = {}
    for table in tables:
        for name, values in table.columns.items():
            title = f"{table.name}: {name}" if len(tables) > 1 else name
            if title in columns:
                raise ValueError(f"two columns of a figure have the same name {title!r}")
            columns[title] = [_cell(value) for value in values]
    rows = max((len(column) for column in columns.values()), default=0)
    padded = [column + [""] * (rows - len(column)) for column in columns.values()]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(make_printable(name) for name in columns)
    writer.writerows(zip(*padded, strict=True))
    return text.getvalue()


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return make_printable(value)
    return f"{value:.{CSV_DIGITS}g}" if np.isfinite(value) else ""


def _panel_tables(of: Panel) -> Iterator[tuple[str, dict[str, FloatArray | Sequence[str]]]]:
    if of.spans:
        yield (
            of.y.label,
            {
                of.y.label: [span.name for span in of.spans],
                f"begin [{of.x.unit}]": np.array([span.begin for span in of.spans]),
                f"end [{of.x.unit}]": np.array([span.end for span in of.spans]),
            },
        )
        return
    if of.bars:
        values = np.array([bar.value for bar in of.bars])
        yield of.y.label, {of.x.label: [bar.name for bar in of.bars], of.y.text: values}
        return
    same_x: dict[tuple[float, ...], list[Line]] = defaultdict(list)
    for line in of.lines:
        if not line.is_area:
            same_x[line.x].append(line)
    for x, lines in same_x.items():
        columns: dict[str, FloatArray | Sequence[str]] = {of.x.text: np.array(x, dtype=float)}
        for line in lines:
            columns |= _line_columns(line, of)
        yield lines[0].label if len(same_x) > 1 else of.y.label, columns


def _line_columns(line: Line, of: Panel) -> dict[str, FloatArray]:
    x, y = np.array(line.x, dtype=float), np.array(line.y, dtype=float)
    columns = {f"{line.label} [{of.y.unit}]": y}
    if line.reach is not None and np.any(line.reach):
        reach = np.array(line.reach)
        columns[f"{line.label}, least [{of.y.unit}]"] = y - reach
        columns[f"{line.label}, most [{of.y.unit}]"] = y + reach
    if line.reach_x is not None and np.any(line.reach_x):
        reach = np.array(line.reach_x)
        columns[f"{line.label}, x least [{of.x.unit}]"] = x - reach
        columns[f"{line.label}, x most [{of.x.unit}]"] = x + reach
    return columns
