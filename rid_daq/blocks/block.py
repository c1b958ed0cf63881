"""Blocks: parts of a result for display, declared once for all renderers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import Field, Strict, model_validator

from config.model import ConfigModel
from rid_daq.blocks.formats import format_measured, number
from rid_daq.blocks.picture import Picture
from rid_daq.blocks.plot import Plot

T = TypeVar("T")
Shown = TypeVar("Shown", contravariant=True)


class Heading(ConfigModel):
    """Title; level 2 begins a section of a report, level 3 a part of a section."""

    kind: Literal["heading"] = "heading"
    text: str
    level: Literal[2, 3] = 2


class Text(ConfigModel):
    """Paragraph.

    Attributes:
        text: The paragraph.
        is_note: True to display it smaller.
        is_for_terminal: True if it contains a path or a command: pages leave it out, because they
            have links and buttons instead.
    """

    kind: Literal["text"] = "text"
    text: str
    is_note: bool = False
    is_for_terminal: bool = False


class Verdict(ConfigModel):
    """Sentence with the main conclusion; `passed` is None if nothing was tested."""

    kind: Literal["verdict"] = "verdict"
    passed: bool | None
    text: str


class Interval(ConfigModel):
    """Value and half width of its 95 % interval."""

    value: float
    reach: float

    @classmethod
    def of(cls, value: float, std: float, factor: float = 1.0) -> Interval:
        """Return a value with two standard deviations, both times a factor, such as 1000 for mm."""
        return cls(value=factor * value, reach=2.0 * factor * std)


class Column(ConfigModel):
    """Column of a table: its title, the unit of its numbers, and their significant digits.

    Text columns are aligned to the left. Narrow terminals leave optional columns out. The workbench
    turns run ids into links.
    """

    title: str
    unit: str = ""
    digits: int = 4
    is_text: bool = False
    is_optional: bool = False
    is_run: bool = False

    @property
    def head(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


Cell = str | int | float | Interval | None
"""Content of a table cell; None is shown as a dash."""


class Table(ConfigModel):
    """Table with units.

    Attributes:
        columns: The columns.
        rows: One cell per column.
        failed: True for each row that is shown in red.
        key: Number of leading columns that identify a row.
    """

    kind: Literal["table"] = "table"
    columns: Annotated[tuple[Column, ...], Strict(False)]
    rows: Annotated[tuple[Annotated[tuple[Cell, ...], Strict(False)], ...], Strict(False)]
    failed: Annotated[tuple[bool, ...], Strict(False)] | None = None
    key: int = 1

    @model_validator(mode="after")
    def _require_whole_rows(self) -> Table:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError("a row has more or fewer cells than there are columns")
        if self.failed is not None and len(self.failed) != len(self.rows):
            raise ValueError("`failed` has another length than the rows")
        return self

    def cells(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows as texts; the digits of a value follow from its interval."""
        for row in self.rows:
            yield tuple(map(_format, row, self.columns))

    def as_texts(self) -> Table:
        """Return the table with all cells as texts."""
        return self.model_copy(update={"rows": tuple(self.cells())})

    def full_values(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows with all digits of the numbers; texts and integers become empty."""
        for row in self.rows:
            yield tuple(map(_full, row))


@dataclass(frozen=True)
class Cells(Generic[Shown]):
    """Column of a table: title, unit and digits as in `Column`, and a function for the cells.

    Attributes:
        of: Function that returns the column's cell for an item.
    """

    title: str
    of: Callable[[Shown], Cell]
    unit: str = ""
    digits: int = 4
    is_optional: bool = False
    is_run: bool = False


def table(
    items: Iterable[T],
    *columns: Cells[T],
    failed: Callable[[T], bool] | None = None,
    key: int = 1,
) -> Table:
    """Return a table with one row per item; a column is a text column if all its cells are texts.

    Args:
        items: Items of the rows.
        columns: Columns with their cells.
        failed: Returns True for an item whose row is shown in red.
        key: Number of leading columns that identify a row.
    """
    items = tuple(items)
    rows = tuple(tuple(column.of(item) for column in columns) for item in items)
    return Table(
        columns=tuple(
            Column(
                title=column.title,
                unit=column.unit,
                digits=column.digits,
                is_text=all(isinstance(row[i], str) for row in rows),
                is_optional=column.is_optional,
                is_run=column.is_run,
            )
            for i, column in enumerate(columns)
        ),
        rows=rows,
        failed=None if failed is None else tuple(map(failed, items)),
        key=key,
    )


class Next(ConfigModel):
    """Suggested next command of this program, as words; `lead` is the text before them."""

    kind: Literal["next"] = "next"
    lead: str = "Next"
    words: Annotated[tuple[str, ...], Strict(False)]


AnyBlock = Annotated[
    Heading | Text | Verdict | Table | Plot | Picture | Next, Field(discriminator="kind")
]


def note_blocks(notes: Iterable[str]) -> Iterator[Text]:
    """Yield the notes of a result, such as missing data in its runs.

    Args:
        notes: One sentence each.
    """
    for note in notes:
        yield Text(text=f"note: {note}")


def _full(cell: Cell) -> str:
    if isinstance(cell, Interval):
        return f"{cell.value} ± {cell.reach}"
    return str(cell) if isinstance(cell, float) else ""


def _format(cell: Cell, column: Column) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Interval):
        return " ± ".join(format_measured(cell.value, cell.reach))
    return number(cell, column.digits)
