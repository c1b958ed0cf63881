"""`Operation`: the registration of an operation, and what its function takes and returns."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

from config.errors import ConfigError, RidDaqError
from config.process.termination import signals_deferred
from rid_daq.operations.catalogue import identifier
from rid_daq.requests.request import INVALID, Request, option_of
from rid_daq.terminal.context import Context as Context

if TYPE_CHECKING:
    from rid_daq.blocks.block import AnyBlock

NUMERICS_BYTES: Final = 750 << 20
"""Address space that numerical libraries take; about half of it is used."""


class OperationResult(Protocol):
    """What an operation returns."""

    @property
    def exit_code(self) -> int:
        """0 if the result is good; a failed verdict is a result too, not an exception."""
        ...

    def document(self) -> Mapping[str, object]:
        """Return the numbers for programs, the document of `--json`."""
        ...

    def blocks(self) -> Iterable[AnyBlock]:
        """Return what people see, in its order."""
        ...


@runtime_checkable
class FailedResult(Protocol):
    """A result that can end its operation with an error, after it was shown."""

    @property
    def failure(self) -> RidDaqError | None:
        """The error; None if the result is good."""
        ...


@dataclass(frozen=True)
class Operation:
    """The registration of an operation.

    Attributes:
        name: Its name in the catalogue: the words of its command.
        label: Title of its form.
        request: The class of its request; the docstring is the help of the command.
        run: Takes a request and a context, and returns the result.
        examples: At least two command lines without the program's name.
        opens_cell, moves: True if it opens the bus of a cell; if the robot moves.
        is_held: True if the robot moves only while a key is held: that needs no axis test before.
        module: Module that `run` imports, with numerical libraries, which need much memory; empty
            if `run` imports little.
    """

    name: str
    label: str
    request: type[Request]
    run: Callable[[Any, Context], OperationResult]
    examples: tuple[str, ...]
    opens_cell: bool = False
    moves: bool = False
    is_held: bool = False
    module: str = ""

    @property
    def needs_axis_test(self) -> bool:
        """True if the axes of a real cell must have been tested before."""
        return self.moves and not self.is_held

    @property
    def kind(self) -> str:
        """The kind of its job, and the name of its schema."""
        return identifier(self.name)

    def load(self) -> None:
        """Import the module that `run` needs; a signal waits, as it would damage an import."""
        if self.module:
            with signals_deferred():
                importlib.import_module(self.module)

    @property
    def owned(self) -> frozenset[str]:
        """The fields that the service sets and a client cannot."""
        fields = self.request.model_fields.items()
        return frozenset(name for name, info in fields if option_of(info).owned)

    def refuse_owned(self, request: Mapping[str, object]) -> None:
        """Refuse a client's request that sets a field of the service.

        Raises:
            ConfigError: It does (RID-REQUEST-INVALID).
        """
        for name in sorted(self.owned & request.keys()):
            raise ConfigError(
                f"{self.kind}: {name}: is set by the service: leave it out", code=INVALID
            )

    @property
    def outputs(self) -> dict[str, tuple[str, ...]]:
        """The fields that name output files, and what their names must end in."""
        options = {name: option_of(info) for name, info in self.request.model_fields.items()}
        return {name: each.endings for name, each in options.items() if each.file == "output"}

    def schema(self) -> dict[str, object]:
        """Return the JSON schema of what a client may ask for."""
        schema = self.request.model_json_schema()
        schema["properties"] = {
            name: each for name, each in schema["properties"].items() if name not in self.owned
        }
        schema["required"] = [name for name in schema.get("required", ()) if name not in self.owned]
        found: dict[str, object] = _without_titles(schema)
        return found


def _without_titles(schema: Any) -> Any:
    """Return a schema without the titles that pydantic makes of field names."""
    if isinstance(schema, list):
        return [_without_titles(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        name: {key: _without_titles(value) for key, value in each.items()}
        if name == "properties"
        else _without_titles(each)
        for name, each in schema.items()
        if name != "title"
    }
