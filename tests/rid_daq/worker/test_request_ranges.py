"""Every number of a request has a range; service and worker refuse a number outside it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from config.errors import ConfigError, RidDaqError
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import check_request, parse_request, require_inside
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.promise("ranges-everywhere")

Schema = dict[str, Any]
Place = tuple[str | int, ...]

SCHEMAS: dict[JobKind, Schema] = {kind: kind.operation.schema() for kind in JobKind}
LOW, HIGH = ("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum", "plausible")
ODD = (math.nan, math.inf, -math.inf, -1e300, 1e300)


def resolved(schema: Schema, whole: Schema) -> Schema:
    while "$ref" in schema:
        schema = whole["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def numbers(schema: Schema, whole: Schema, place: Place = ()) -> Iterator[tuple[Place, Schema]]:
    """Yield the place and the schema of every number that a document can contain."""
    schema = resolved(schema, whole)
    for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from numbers(each, whole, place)
    for name, each in schema.get("properties", {}).items():
        yield from numbers(each, whole, (*place, name))
    for number, each in enumerate(schema.get("prefixItems", ())):
        yield from numbers(each, whole, (*place, number))
    if isinstance(schema.get("items"), dict):
        yield from numbers(schema["items"], whole, (*place, 0))
    if schema.get("type") in ("number", "integer"):
        yield place, schema


def smallest_document(schema: Schema, whole: Schema) -> Any:
    """Return a document with only the required values."""
    schema = resolved(schema, whole)
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            return smallest_document(schema[choice][0], whole)
    if "const" in schema or "enum" in schema:
        return schema.get("const", schema.get("enum", [None])[0])
    match schema.get("type"):
        case "object":
            properties = schema["properties"]
            required = schema.get("required", [])
            return {name: smallest_document(properties[name], whole) for name in required}
        case "array":
            inner = schema.get("prefixItems") or [schema["items"]] * schema.get("minItems", 0)
            return [smallest_document(each, whole) for each in inner]
        case "number" | "integer":
            return schema.get("minimum", 1)
        case "boolean":
            return False
    return "a"


def document_with(kind: JobKind, place: Place, value: object) -> dict[str, Any]:
    """Return the smallest request of a job kind with `value` at `place`, a path of keys."""
    whole = SCHEMAS[kind]

    def put(schema: Schema, place: Place, document: Any) -> Any:
        if not place:
            return value
        schema = resolved(schema, whole)
        for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
            if any(found[: len(place)] == place for found, _ in numbers(each, whole)):
                begun = document if isinstance(document, (dict, list)) else None
                return put(each, place, begun or smallest_document(each, whole))
        key, *rest = place
        if isinstance(key, str):
            document = dict(document or {})
            inner = schema["properties"][key]
            document[key] = put(
                inner, tuple(rest), document.get(key, smallest_document(inner, whole))
            )
            return document
        document = list(document or ())
        inner = schema["prefixItems"][key] if "prefixItems" in schema else schema["items"]
        document += [smallest_document(inner, whole)] * (key + 1 - len(document))
        document[key] = put(inner, tuple(rest), document[key])
        return document

    found: dict[str, Any] = put(whole, place, smallest_document(whole, whole))
    return found


NUMBERS: list[Any] = [
    pytest.param(kind, place, schema, id=f"{kind.value}-{'.'.join(map(str, place))}")
    for kind, whole in SCHEMAS.items()
    for place, schema in numbers(whole, whole)
]
OWN = [each for each in NUMBERS if "faults" not in each.values[1]]
"""Numbers of all requests, except those of fault scripts.

Ranges of numbers in fault scripts are checked like those in files.
"""


def test_the_list_of_numbers_covers_the_main_jobs() -> None:
    assert {kind for kind, _, _ in (each.values for each in OWN)} >= {
        JobKind("check"),
        JobKind("jog"),
        JobKind("payload_session"),
        JobKind("stream"),
        JobKind("design"),
        JobKind("plate_zero"),
        JobKind("retime"),
    }


@pytest.mark.parametrize(("kind", "place", "schema"), NUMBERS)
def test_every_number_of_every_request_has_a_range(
    kind: JobKind, place: Place, schema: Schema
) -> None:
    assert any(side in schema for side in LOW), "state the smallest value in the field's type"
    assert any(side in schema for side in HIGH), "state the largest value in the field's type"


def values_outside(schema: Schema) -> Iterator[float]:
    """Yield values just outside a range, and three numbers that are not finite."""
    whole_number = schema["type"] == "integer"
    if "minimum" in schema:
        low = schema["minimum"]
        yield low - 1 if whole_number else math.nextafter(low, -math.inf)
    if "maximum" in schema:
        high = schema["maximum"]
        yield high + 1 if whole_number else math.nextafter(high, math.inf)
    yield from ODD[:3]


@pytest.mark.parametrize(("kind", "place", "schema"), OWN)
def test_a_number_outside_its_range_is_refused_by_service_and_worker(
    kind: JobKind, place: Place, schema: Schema, tmp_path: Path
) -> None:
    for value in values_outside(schema):
        document = document_with(kind, place, value)
        for refuse in (
            lambda document=document: check_request(kind, document, tmp_path),
            lambda document=document: parse_request(
                kind, document, cell="ir361", runs=str(tmp_path / "runs"), cleared=False
            ),
        ):
            with pytest.raises(ConfigError) as caught:
                refuse()
            assert caught.value.refusal == "RID-OPTION-RANGE", (value, str(caught.value))


# ---- random documents


def odd_values() -> st.SearchStrategy[Any]:
    texts = st.one_of(
        st.text(max_size=12),
        st.sampled_from(
            [
                "../x",
                "/etc/passwd",
                "~/x",
                "a\0b",
                ".rid-daq-service/key",
                "m.yaml",
                "\ud800",
                "x/../..",
            ]
        ),
    )
    leaves = st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.sampled_from(ODD), texts
    )
    return st.recursive(
        leaves,
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
        ),
        max_leaves=6,
    )


def values_of(schema: Schema, whole: Schema, depth: int = 0) -> st.SearchStrategy[Any]:
    """Return a strategy for documents of a schema, some of which contain an odd value."""
    schema = resolved(schema, whole)
    if depth > 4:
        return odd_values()
    choices = (*schema.get("anyOf", ()), *schema.get("oneOf", ()))
    if choices:
        usual = st.one_of([values_of(each, whole, depth + 1) for each in choices])
    elif "enum" in schema or "const" in schema:
        usual = st.sampled_from(schema.get("enum", [schema.get("const")]))
    elif schema.get("type") == "object" and "properties" in schema:
        parts = {
            name: values_of(each, whole, depth + 1) for name, each in schema["properties"].items()
        }
        required = {name: parts.pop(name) for name in schema.get("required", ())}
        usual = st.fixed_dictionaries(required, optional=parts)
    elif schema.get("type") == "array":
        if "prefixItems" in schema:
            inner = [values_of(each, whole, depth + 1) for each in schema["prefixItems"]]
            usual = st.tuples(*inner).map(list)
        else:
            usual = st.lists(values_of(schema["items"], whole, depth + 1), max_size=3)
    elif schema.get("type") in ("number", "integer"):
        low, high = schema.get("minimum", 0.001), schema.get("maximum", 1e3)
        make: Any = st.integers if schema["type"] == "integer" else st.floats
        usual = make(low, high)
    elif schema.get("type") == "boolean":
        usual = st.booleans()
    elif schema.get("type") == "null":
        usual = st.none()
    else:
        usual = st.sampled_from(["m.yaml", "out.json", "latest", "a b"])
    return st.one_of(usual, usual, usual, usual, odd_values())


def paths_in(value: object) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from paths_in(getattr(value, name))
    elif isinstance(value, (tuple, list)):
        for each in value:
            yield from paths_in(each)


@pytest.mark.parametrize("kind", JobKind)
def test_a_random_document_is_accepted_or_refused(kind: JobKind, tmp_path: Path) -> None:
    """Service and worker accept a document or refuse it with a `RidDaqError`.

    An accepted document names no file outside the folder.
    """

    @settings(
        max_examples=20,
        deadline=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
    @given(values_of(SCHEMAS[kind], SCHEMAS[kind]))
    def look(document: Any) -> None:
        before = sorted(tmp_path.parent.iterdir())
        try:
            check_request(kind, document, tmp_path)
            request = parse_request(
                kind, document, cell="ir361", runs=str(tmp_path / "runs"), cleared=False
            )
        except RidDaqError:
            return
        finally:
            assert sorted(tmp_path.parent.iterdir()) == before
        json.dumps(document, allow_nan=False)
        for name in type(request).model_fields:
            if name not in kind.operation.owned:
                for path in paths_in(getattr(request, name)):
                    require_inside(str(path), tmp_path)

    look()


@pytest.mark.parametrize(
    ("kind", "place", "schema"), [each for each in OWN if "plausible" in each.values[2]]
)
def test_an_implausible_value_is_refused_by_the_worker(
    kind: JobKind, place: Place, schema: Schema, tmp_path: Path
) -> None:
    document = document_with(kind, place, 1e9)
    with raises_code(ConfigError, "RID-OPTION-RANGE") as caught:
        parse_request(kind, document, cell="ir361", runs="runs", cleared=False)
    assert caught.value.refusal == "RID-OPTION-RANGE"
