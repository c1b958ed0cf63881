"""The requests of jobs: what does a kind of job, and what its request may say."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import PydanticOmit

from config.errors import ConfigError
from config.ranges import CODE
from rid_daq.operations.catalogue import OF_KINDS, operation
from rid_daq.operations.perform import perform
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import require_bounded, require_ending
from rid_daq.terminal.console import Console

OWNED: Final = frozenset({"cell", "runs", "cleared", "live", "tester"})
"""Fields of requests that the service fills in."""

_MODULES = {
    JobKind.PAYLOAD: "payload.session",
}
"""Where a kind's performer stands, where its file is not called as the kind is."""

_OUT_OF_RANGE: Final = frozenset(
    {"greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number"}
)


def performer(kind: JobKind) -> Callable[[Any, Console], None]:
    """Return what does a kind of job: an operation, or the `perform` of its performer."""
    if kind.value in OF_KINDS:
        return functools.partial(perform, operation(OF_KINDS[kind.value]))
    module = importlib.import_module(f"rid_daq.performers.{_MODULES.get(kind, kind.value)}")
    found: Callable[[Any, Console], None] = module.perform
    return found


def request_type(kind: JobKind) -> type[Any]:
    """Return the request of a kind of job."""
    if kind.value in OF_KINDS:
        return operation(OF_KINDS[kind.value]).request
    found: type[Any] = get_type_hints(performer(kind))["request"]
    return found


def request_of(
    kind: JobKind,
    told: dict[str, object],
    cell: str,
    runs: Path,
    *,
    cleared: bool,
    owner: str = "",
) -> Any:
    """Return the request of a job.

    Parameters
    ----------
    kind : JobKind
        Its kind.
    told : dict
        What the client says of it.
    cell : str
        The cell, a bundled name or a file.
    runs : Path
        The folder of the run folders.
    cleared : bool
        Whether a person has just said that the cell is clear.
    owner : str
        Who has begun the job.

    Raises
    ------
    ConfigError
        It is not a request of this kind, or a number in it is outside of its range.
    """
    require_bounded(kind, told)
    owned = {"cell": cell, "runs": str(runs), "cleared": cleared, "tester": owner}
    if kind.value in OF_KINDS:
        declared = operation(OF_KINDS[kind.value])
        declared.refuse_owned(told)
        own = {name: value for name, value in owned.items() if name in declared.owned}
        checked = declared.request.of_json({**told, **own}, shown=kind.value)
        require_ending(kind, told)
        return checked
    request = request_type(kind)
    fields = request.__dataclass_fields__
    filled = {**told, **{name: value for name, value in owned.items() if name in fields}}
    try:
        asked = TypeAdapter(request).validate_python(filled)
    except ValidationError as error:
        found = error.errors()
        first = next((each for each in found if each["type"] in _OUT_OF_RANGE), found[0])
        where = ".".join(map(str, first["loc"]))
        code = CODE if first["type"] in _OUT_OF_RANGE else "RID-REQUEST-INVALID"
        raise ConfigError(f"{kind.value}: {where}: {first['msg']}", code=code) from None
    except ConfigError as error:
        raise ConfigError(f"{kind.value}: {error}", code=error.refusal) from None
    require_ending(kind, told)
    return asked


def request_schema(kind: JobKind) -> dict[str, object]:
    """Return the JSON schema of what a client may say of a job; nothing else is taken."""
    if kind.value in OF_KINDS:
        return operation(OF_KINDS[kind.value]).schema()
    schema = TypeAdapter(request_type(kind)).json_schema(schema_generator=_Schema)
    properties = {k: v for k, v in schema["properties"].items() if k not in OWNED}
    required = [name for name in schema.get("required", []) if name not in OWNED]
    closed: dict[str, object] = _closed({**schema, "properties": properties, "required": required})
    return closed


class _Schema(GenerateJsonSchema):
    """Leaves out what only a program in the same process can say."""

    def handle_invalid_for_json_schema(self, schema: Any, error_info: str) -> JsonSchemaValue:
        raise PydanticOmit


def _closed(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_closed(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {name: _closed(each) for name, each in schema.items() if name != "title"}
    if isinstance(schema.get("properties"), dict):
        # a property may be called title
        closed["properties"] = {k: _closed(v) for k, v in schema["properties"].items()}
        closed.setdefault("additionalProperties", False)
    return closed
