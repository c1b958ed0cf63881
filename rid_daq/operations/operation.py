"""`Operation`: registration of an operation: its name, request, function and result."""

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
"""Address space that numerical libraries reserve [bytes]; about half of this space is used."""


class OperationResult(Protocol):
    """Result of an operation, as its function returns it."""

    def document(self) -> Mapping[str, object]:
        """Return the JSON document of the result, as `--json` prints it."""
        ...

    def blocks(self) -> Iterable[AnyBlock]:
        """Return the blocks that people read, in order."""
        ...


@runtime_checkable
class JudgedResult(Protocol):
    """A result that can be bad: a failed verdict is a result, not an exception."""

    @property
    def exit_code(self) -> int:
        """Exit code of the program: 0 if the result is good."""
        ...


@runtime_checkable
class FailedResult(Protocol):
    """A result that can end its operation with an error after it was shown."""

    @property
    def failure(self) -> RidDaqError | None:
        """Error that ends the operation; None if the result is good."""
        ...


@dataclass(frozen=True)
class Operation:
    """Registration of an operation.

    Attributes:
        name: Name in the catalogue: the words of its command.
        label: Title of the operation's form in the workbench.
        request: Class of its request. The class's docstring is the help of the command.
        run: Function that takes a request and a context, and returns the result.
        examples: At least two command lines, without the program's name.
        opens_cell: True if the operation opens the bus of a cell.
        is_of_cells: True if the operation needs cells of this computer, or their sessions, without
            opening a bus of its own.
        moves: True if the robot moves.
        is_held: True if the robot moves only while a key is held. Such an operation needs no passed
            axis test.
        module: Module that `run` imports if it needs numerical libraries, which need much memory;
            empty if `run` imports little.
    """

    name: str
    label: str
    request: type[Request]
    run: Callable[[Any, Context], OperationResult]
    examples: tuple[str, ...]
    opens_cell: bool = False
    is_of_cells: bool = False
    moves: bool = False
    is_held: bool = False
    module: str = ""

    @property
    def needs_linux(self) -> bool:
        """True if the operation runs on Linux only: buses, simulated cells and sessions."""
        return self.opens_cell or self.is_of_cells

    @property
    def needs_axis_test(self) -> bool:
        """True if a real cell needs a passed axis test before; a request can waive it."""
        return self.moves and not self.is_held

    @property
    def kind(self) -> str:
        """Kind of the operation's job in a service; also the name of its JSON schema."""
        return identifier(self.name)

    def load(self) -> None:
        """Import the module that `run` needs; defer signals, because they can break an import."""
        if self.module:
            with signals_deferred():
                importlib.import_module(self.module)

    @property
    def owned(self) -> frozenset[str]:
        """Names of the fields that only the service sets; a client cannot set them."""
        fields = self.request.model_fields.items()
        return frozenset(name for name, info in fields if option_of(info).owned)

    def refuse_owned(self, request: Mapping[str, object]) -> None:
        """Refuse a client's request that sets a field that only the service sets.

        Raises:
            ConfigError: The request sets such a field (RID-REQUEST-INVALID).
        """
        for name in sorted(self.owned & request.keys()):
            raise ConfigError(
                f"{self.kind}: {name}: only the service sets this field: remove it from the"
                " request",
                code=INVALID,
            )

    @property
    def outputs(self) -> dict[str, tuple[str, ...]]:
        """Fields that name output files, each with the allowed file name endings."""
        options = {name: option_of(info) for name, info in self.request.model_fields.items()}
        return {name: each.endings for name, each in options.items() if each.file == "output"}

    def schema(self) -> dict[str, object]:
        """Return the JSON schema of a client's request, without the service's own fields."""
        schema = self.request.model_json_schema()
        schema["properties"] = {
            name: each for name, each in schema["properties"].items() if name not in self.owned
        }
        schema["required"] = [name for name in schema.get("required", ()) if name not in self.owned]
        found: dict[str, object] = _without_titles(schema)
        return found


def _without_titles(schema: Any) -> Any:
    """Return a schema without the titles that pydantic derives from field names."""
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
