"""Errors in files that users write say in plain words what to change, and where."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from importlib import resources
from typing import Any

import pytest
from pydantic import BaseModel

from acquisition.maps.import_map import ImportMap
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import validate
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from identification.model.known_loads import KnownLoads
from tests.builders.raised_codes import raises_code

LOADS = {
    "bodies": {"disc": {"link": 3, "mass_kg": 12.5, "centre_m": [0.1, 0.0, 0.2]}},
    "loads": [{"run": "full", "bodies": ["disc"]}],
}
BUNDLED: dict[str, type[BaseModel]] = {
    "cells/kr15": CellConfig,
    "robots/ir361": RobotDescription,
    "plants/ir361": PlantConfig,
    "maps/ur10e_31": ImportMap,
    "servos/elmo_gold": ServoProfile,
    "profiles/kistler_style": AmplifierProfile,
    "profiles/servo_registers": DriveProfile,
}
WRONG: tuple[Any, ...] = ("abc", -1.5, True, None, [], {}, [[1]])
RAW = re.compile(r"Input should|Field required|Extra inputs|after validation|fromhex|Value error")
"""Texts of the validator and of Python that no user should read."""


def documents() -> Iterator[tuple[str, Any, type[BaseModel]]]:
    yield "loads", LOADS, KnownLoads
    for name, model in BUNDLED.items():
        text = (resources.files("config") / "bundled" / f"{name}.yaml").read_bytes()
        yield name, json.loads(parse_yaml(text, name).json()), model


def paths(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of each value; of lists only that of the first element."""
    yield path
    if isinstance(tree, dict | list):
        children = tree.items() if isinstance(tree, dict) else [*enumerate(tree)][:1]
        for key, child in children:
            yield from paths(child, (*path, key))


def changed(tree: Any, path: tuple[Any, ...], value: Any) -> bytes:
    """Return a JSON file in which the value at `path` is replaced."""
    if not path:
        return json.dumps(value).encode()
    wrong = copy.deepcopy(tree)
    place = wrong
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return json.dumps(wrong).encode()


@pytest.mark.parametrize(("name", "tree", "model"), [*documents()])
def test_no_error_in_a_file_is_a_text_of_the_validator(
    name: str, tree: Any, model: type[BaseModel]
) -> None:
    lines: list[str] = []
    for number, path in enumerate(paths(tree)):
        for value in (WRONG[number % len(WRONG)], WRONG[(number + 3) % len(WRONG)]):
            try:
                validate(parse_yaml(changed(tree, path, value), "file.yaml"), model)
            except ConfigError as error:
                lines += str(error).splitlines()
    assert len(lines) > 10
    assert [line for line in lines if RAW.search(line)] == []
    assert [line for line in lines if not line.startswith("file.yaml")] == []


@pytest.mark.parametrize(
    ("text", "details"),
    [
        ("bodies: [disc]\nloads: []", (":1:1: bodies: ", "name: value", "centre_m", "mass_kg")),
        ("bodies: {disc: 5}\nloads: []", (":1:10: bodies.disc: ", "5", "mass_kg")),
        ("bodies: {disc: {link: 1.5}}\nloads: []", (":1:17: bodies.disc.link: ", "1.5")),
        ("bodies: {disc: {mass_kg: '1,5'}}\nloads: []", ("bodies.disc.mass_kg: ", "1.5")),
        ("bodies: {disc: {centre_m: [1.0]}}\nloads: []", ("bodies.disc.centre_m: ", "value 2")),
        ("bodies: {disc: {mass_kg: }}\nloads: []", ("bodies.disc.mass_kg: ", "missing")),
        (
            "bodies: {disc: {mass_kg: -2}}\nloads: []",
            ("bodies.disc.mass_kg: ", "-2", "more than 0"),
        ),
        ("bodies: {disc: {mass_kg: true}}\nloads: []", ("bodies.disc.mass_kg: true ",)),
        ("bodies: {disc: {masss_kg: 1}}\nloads: []", ("disc.masss_kg: ", "mean mass_kg?")),
        ("bodies: {disc: {}}\nloads: []", ("'mass_kg' is missing", "loads: ", "at least 1")),
    ],
)
def test_an_error_names_value_place_and_remedy(text: str, details: tuple[str, ...]) -> None:
    with raises_code(ConfigError, "RID-FILE-VALUE", "loads.yaml", *details):
        validate(parse_yaml(text.encode(), "loads.yaml"), KnownLoads)


def test_a_choice_is_named_with_the_one_that_was_probably_meant() -> None:
    text = b"name: a\nrobot: kr15\nunits: {position: degr}\njoints: []\n"
    with raises_code(ConfigError, "RID-FILE-VALUE", "map.yaml:3:9: units.position", "mean deg?"):
        validate(parse_yaml(text, "map.yaml"), ImportMap)
