"""Every operation has one declaration, and the same limits and descriptions at every entry
point.
"""

from __future__ import annotations

import importlib.util
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from enum import EnumType
from pathlib import Path
from typing import Any, get_args, get_origin

import click
import pytest
from pydantic import BaseModel

from config.errors import ConfigError
from rid_daq.command_line.operation_command import OperationCommand
from rid_daq.operations.catalogue import CATALOGUE, GROUPS, SECTIONS, operation
from rid_daq.requests.request import Request, ShownField, shown_fields
from rid_daq.service.job_kinds import JobKind
from tests.builders.raised_codes import raises_code

NAMES = pytest.mark.parametrize("name", CATALOGUE)


def fields(name: str) -> list[ShownField]:
    return list(shown_fields(operation(name).request))


def with_nested_value(
    values: dict[str, object], path: tuple[str, ...], value: object
) -> dict[str, object]:
    """Return `values` with one more value at a path, which can lead into a nested model."""
    if len(path) == 1:
        return {**values, path[0]: value}
    inner = values.get(path[0], {})
    assert isinstance(inner, dict)
    return {**values, path[0]: with_nested_value(inner, path[1:], value)}


def shortest_text(kind: Any) -> str:
    """Return a short text that the type of a field accepts."""
    return str(next(iter(kind))) if isinstance(kind, EnumType) else "a.yaml"


def required_values(name: str) -> dict[str, object]:
    """Return the required values of a request as texts from the command line."""
    values: dict[str, object] = {}
    for each in fields(name):
        if each.info.is_required():
            text = shortest_text(each.type)
            values = with_nested_value(values, each.path, (text,) if each.is_repeated else text)
    return values


def numeric_fields(name: str) -> Iterator[ShownField]:
    for each in fields(name):
        if each.type in (int, float) or (each.is_repeated and float in each.type.__args__):
            yield each


@NAMES
def test_an_operation_declares_label_request_section_and_job_kind(name: str) -> None:
    found = operation(name)
    assert found.name == name
    assert found.label
    assert issubclass(found.request, Request)
    assert found.request.__doc__
    assert found.label
    first, *inner = name.split()
    assert (GROUPS[first] if inner else CATALOGUE[name]).section in SECTIONS
    assert CATALOGUE[name].is_job == (found.kind in {kind.value for kind in JobKind})
    if CATALOGUE[name].is_job:
        assert JobKind(found.kind).operation is found


@NAMES
def test_every_field_has_a_separate_description(name: str) -> None:
    for each in fields(name):
        assert str(each.info.description).endswith("."), each.path


@NAMES
def test_every_example_is_a_valid_command_line_of_its_operation(name: str) -> None:
    found = operation(name)
    assert len(found.examples) >= 2
    for example in found.examples:
        assert f"{example} ".startswith(f"{name} ")
        command = OperationCommand(found)
        context = command.make_context(name, shlex.split(example.removeprefix(name)))
        given = {key: value for key, value in context.params.items() if value not in (None, ())}
        assert len(given) >= 2


@NAMES
def test_an_option_has_a_unit_and_a_section(name: str) -> None:
    found = operation(name)
    context = click.Context(OperationCommand(found), info_name=name)
    text = " ".join(context.get_help().split())
    for each in fields(name):
        if each.option.hidden:
            continue
        assert each.flag in text
        assert each.option.positional or f"{each.option.group}:" in text
        assert f"[{each.option.unit}]" in text or not each.option.unit


@NAMES
def test_an_invalid_number_is_refused_with_the_name_of_its_option(name: str) -> None:
    for each in numeric_fields(name):
        for odd in ("nan", "inf", "-inf", "1e300", "-1e300", "", "1,5", "one"):
            value = (odd,) if each.is_repeated else odd
            with pytest.raises(ConfigError) as caught:
                operation(name).request.of(
                    with_nested_value(required_values(name), each.path, value), flags=True
                )
            assert caught.value.refusal in ("RID-OPTION-RANGE", "RID-REQUEST-INVALID")
            assert str(caught.value).startswith(f"{each.flag}: ")


@NAMES
def test_a_json_request_with_a_text_for_a_number_is_refused(name: str) -> None:
    for each in numeric_fields(name):
        value = ["1"] if each.is_repeated else "1"
        with pytest.raises(ConfigError) as caught:
            operation(name).request.of_json(
                with_nested_value(required_values(name), each.path, value), shown=name
            )
        assert caught.value.refusal == "RID-REQUEST-INVALID"
        assert str(caught.value).startswith(f"{name}: {'.'.join(each.path)}")


@NAMES
def test_an_option_without_effect_is_refused(name: str) -> None:
    for each in fields(name):
        if each.option.needs:
            value: object = "1" if each.type in (bool, int, float) else "a"
            if get_origin(each.type) is tuple:
                value = ("1",) * len(get_args(each.type))
            with pytest.raises(ConfigError) as caught:
                operation(name).request.of(
                    with_nested_value(required_values(name), each.path, value), flags=True
                )
            assert caught.value.refusal == "RID-REQUEST-INVALID"
            assert str(caught.value).startswith(f"{each.flag}: has no effect without --")


@NAMES
def test_the_schema_describes_every_field_that_a_client_can_set(name: str) -> None:
    found = operation(name)
    schema: Any = found.schema()
    assert schema["additionalProperties"] is False
    assert found.owned.isdisjoint(schema["properties"])
    for field, each in schema["properties"].items():
        info = found.request.model_fields[field]
        is_group = isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel)
        assert is_group or each["description"] == info.description


def test_declarations_do_not_import_numpy() -> None:
    names = ", ".join(f"operation({name!r})" for name in CATALOGUE)
    program = (
        "import sys; from rid_daq.operations.catalogue import operation;"
        f"print(len([{names}]), {{'numpy', 'matplotlib'}} & set(sys.modules))"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == f"{len(CATALOGUE)} set()"


def test_a_request_refuses_unknown_fields() -> None:
    request = operation("retime").request.of({**required_values("retime"), "margin": "0.5"})
    assert request.model_dump()["margin"] == 0.5
    with pytest.raises(ConfigError) as caught:
        operation("retime").request.of({**required_values("retime"), "margn": "0.5"})
    assert caught.value.refusal == "RID-REQUEST-INVALID"


@pytest.mark.parametrize(("key", "value"), [("margin", "0.1_5"), ("jerk", ("9.0", "1_0"))])
def test_digits_with_separators_are_no_number(key: str, value: object) -> None:
    request = operation("retime").request
    with raises_code(ConfigError, "RID-REQUEST-INVALID", f"--{key}: '"):
        request.of({**required_values("retime"), key: value}, flags=True)
    files = {**required_values("retime"), "model": "my_model_1_0.json"}
    assert str(request.of(files).model_dump()["model"]) == "my_model_1_0.json"


class EndedError(Exception):
    """A signal has arrived."""


def test_a_signal_takes_effect_after_the_import_of_an_operation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = "import signal\nsignal.raise_signal(signal.SIGTERM)\nWHOLE = True\n"
    (tmp_path / "interrupted_module.py").write_text(program)
    monkeypatch.syspath_prepend(tmp_path)

    def end(*_: object) -> None:
        raise EndedError

    before = signal.signal(signal.SIGTERM, end)
    try:
        with pytest.raises(EndedError):
            replace(operation("check"), module="interrupted_module").load()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert sys.modules.pop("interrupted_module").WHOLE


def test_every_moving_operation_names_a_module_to_import_in_advance() -> None:
    for name in CATALOGUE:
        found = operation(name)
        if found.moves:
            assert found.module, name
            assert importlib.util.find_spec(found.module), name


def test_an_option_sets_two_fields_only_if_one_of_them_applies_to_a_kind_of_motion() -> None:
    shared = set()
    for name in CATALOGUE:
        flags = [each.flag for each in fields(name) if not each.option.positional]
        shared |= {(name, flag) for flag in flags if flags.count(flag) > 1}
    assert shared == {("design", "--period"), ("design", "--periods"), ("design", "--seed")}
