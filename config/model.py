"""`ConfigModel`: base class of the models of all files, and of the sections of results."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

D = TypeVar("D", bound="DataclassInstance")


class ConfigModel(BaseModel):
    """A frozen model that refuses unknown keys, non-finite numbers and silent conversions."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def from_attributes(cls, source: object, **others: object) -> Self:
        """Return a model; its fields are taken from `others` or from the attributes of `source`.

        Arrays become tuples.
        """
        names = [name for name in cls.model_fields if name not in others and hasattr(source, name)]
        values = {name: getattr(source, name) for name in names} | others
        return cls.model_validate({name: _plain(value) for name, value in values.items()})

    @classmethod
    def for_each(cls, **columns: Iterable[object]) -> tuple[Self, ...]:
        """Return one model per row; each argument is a column, named after its field."""
        rows = zip(*map(_plain, columns.values()), strict=True)
        return tuple(cls.model_validate(dict(zip(columns, row, strict=True))) for row in rows)

    def to_dataclass(self, kind: type[D], **others: object) -> D:
        """Return a dataclass; its fields are taken from `others` or from this model's fields."""
        names = {field.name for field in dataclasses.fields(kind)} - others.keys()
        return kind(
            **{name: getattr(self, name) for name in names if hasattr(self, name)}, **others
        )


def refuse_same_names(names: Iterable[str], what: str) -> None:
    """Refuse a name that occurs twice.

    Raises:
        ValueError: A name occurs twice; the text has the name.
    """
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"two {what} have the name {twice[0]!r}: give each its own name")


def _plain(value: Any) -> Any:
    """Return arrays, and arrays inside lists, as tuples of numbers."""
    import numpy as np  # imported late: commands that compute nothing also import this module

    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, list) else value
