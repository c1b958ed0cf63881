"""Statements of guides, decisions and the changelog that are checked against the code."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Final, get_args

import numpy as np

from config.errors import ConfigError
from config.formats.eds import parse_eds
from config.load import load_cell
from config.robot.friction_terms import FrictionTerm
from dynamics.model.robot_model import RobotModel
from identification.model.base_parameters import base_parameters
from tests.builders.raised_codes import raises_code

ROOT: Final = Path(__file__).parents[1]
LONGEST_CHANGELOG: Final = 120


def read(path: str) -> str:
    return (ROOT / "docs" / path).read_text(encoding="utf-8")


def test_the_guide_to_models_lists_every_friction_term() -> None:
    guide = read("guide/choose-the-model.md")
    words = set(re.findall(r"[a-z_]+", guide))
    assert not [term for term in get_args(FrictionTerm) if term not in words]


def test_a_coupled_wrist_is_recorded_on_the_bus_as_the_guide_describes() -> None:
    loaded = load_cell("kr15")
    assert loaded.robot.coupling is not None
    assert len(loaded.config.axes) == len(loaded.robot.joints)
    assert "is recorded on the bus" in " ".join(read("guide/choose-the-model.md").split())


def test_heads_of_base_parameters_do_not_depend_on_the_samples() -> None:
    model = RobotModel.from_description(load_cell("ir361").robot)
    found = [base_parameters(model, seed=seed) for seed in (0, 1, 2)]
    assert len({each.names for each in found}) == 1
    np.testing.assert_allclose(found[0].combination, found[1].combination, atol=1e-6)
    assert "in a fixed order" in read("theory.md")


def test_the_changelog_of_the_unreleased_version_is_at_most_one_page() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased = re.split(r"^## ", text, flags=re.MULTILINE)[1]
    assert len(unreleased.splitlines()) <= LONGEST_CHANGELOG, (
        "CHANGELOG.md: a merge has restored deleted lines; keep the summary and your own lines"
    )


def test_the_decision_on_dependencies_lists_each_of_them() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [each for extra in project["optional-dependencies"].values() for each in extra]
    names = [re.split(r"[\[<>=]", each)[0] for each in (*project["dependencies"], *extras)]
    decision = read("decisions/0063-dependencies-and-their-reasons.md")
    listed = {
        name.split()[0]
        for row in re.findall(r"^\| ([^|]+) \|", decision, re.MULTILINE)
        for name in row.split(", ")
    }
    assert not [name for name in names if name not in listed]


SHEET: Final = """[FileInfo]
FileName=d.eds
[DeviceInfo]
VendorNumber=1
[OptionalObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=maker's own
ObjectType=0x7
DataType=0x7
AccessType=rw
DefaultValue={value}
[Nonsense]
anything=goes here
"""


def test_an_eds_file_contains_unread_keys_only_where_allowed() -> None:
    parse_eds(SHEET.format(value="0").encode(), "d.eds")
    unreadable = parse_eds(SHEET.format(value="0x12G").encode(), "d.eds")
    assert any(found.faults for found in unreadable.objects)
    other_access = parse_eds(SHEET.format(value="0").replace("=rw", "=r/w").encode(), "d.eds")
    assert any("'r/w'" in fault.text for fault in other_access.faults)
    with raises_code(ConfigError, "RID-EDS-INVALID", "d.eds:", "'0x3'"):
        parse_eds(
            SHEET.format(value="0").replace("ObjectType=0x7", "ObjectType=0x3").encode(), "d.eds"
        )
