"""Blocks: what people see of a result, declared once and drawn by every renderer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import Field, Strict, model_validator

from config.model import ConfigModel
from rid_daq.blocks.formats import format_measured, number
from rid_daq.blocks.plot import Plot

T = TypeVar("T")
Shown = TypeVar("Shown", contravariant=True)


class Heading(ConfigModel):
    """A title; level 2 begins a section of a report, level 3 a part of it."""

    kind: Literal["heading"] = "heading"
    text: str
    level: Literal[2, 3] = 2


class Text(ConfigModel):
    """A paragraph; a note is shown smaller."""

    kind: Literal["text"] = "text"
    text: str
    is_note: bool = False


class Verdict(ConfigModel):
    """The sentence that decides; `passed` is None if nothing was judged."""

    kind: Literal["verdict"] = "verdict"
    passed: bool | None
    text: str


class Interval(ConfigModel):
    """A value and the half width of its 95 % interval."""

    value: float
    reach: float

    @classmethod
    def of(cls, value: float, std: float, factor: float = 1.0) -> Interval:
        """Return a value with two standard deviations, both times a factor, such as 1000 for mm."""
        return cls(value=factor * value, reach=2.0 * factor * std)


class Column(ConfigModel):
    """A column of a table: its title, the unit of its numbers, and their significant digits.

    A column of texts is aligned to the left. A narrow terminal leaves an optional column out. The
    workbench makes ids of runs links.
    """

    title: str
    unit: str = ""
    digits: int = 4
    is_text: bool = False
    is_optional: bool = False
    is_run: bool = False

    @property
    def head(self) -> str:
        """The title with the unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


Cell = str | int | float | Interval | None
"""What a table's cell holds; None is shown as a dash."""


class Table(ConfigModel):
    """Columns with units.

    Attributes:
        columns: The head.
        rows: One cell a column.
        failed: Rows that are shown in red.
        key: Number of first columns that name a row.
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
        """Yield the rows as texts; the digits of a value with an interval follow from it."""
        for row in self.rows:
            yield tuple(map(_shown, row, self.columns))

    def as_texts(self) -> Table:
        """Return the table with its cells as texts."""
        return self.model_copy(update={"rows": tuple(self.cells())})

    def full_values(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows with all digits of their numbers; empty for texts and integers."""
        for row in self.rows:
            yield tuple(map(_full, row))


@dataclass(frozen=True)
class Cells(Generic[Shown]):
    """Cells of a column, and its head as `Column` has it.

    Attributes:
        of: Returns the cell of an item.
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
    """Return a table with one row for each item; a column is of texts if all of its cells are.

    Args:
        items: What the rows show.
        columns: Each with its cells.
        failed: Returns True for an item whose row is shown in red.
        key: Number of first columns that name a row.
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
    """A command of this program that is a sensible next step, as words; `lead` is before them."""

    kind: Literal["next"] = "next"
    lead: str = "Next"
    words: Annotated[tuple[str, ...], Strict(False)]


AnyBlock = Annotated[Heading | Text | Verdict | Table | Plot | Next, Field(discriminator="kind")]


def note_blocks(notes: Iterable[str]) -> Iterator[Text]:
    """Yield the notes of a result, such as what its runs lack.

    Args:
        notes: One sentence each.
    """
    for note in notes:
        yield Text(text=f"note: {note}")


def _full(cell: Cell) -> str:
    if isinstance(cell, Interval):
        return f"{cell.value} ± {cell.reach}"
    return str(cell) if isinstance(cell, float) else ""


def _shown(cell: Cell, column: Column) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Interval):
        return " ± ".join(format_measured(cell.value, cell.reach))
    return number(cell, column.digits)
