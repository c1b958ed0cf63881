"""Validation messages describe formats in words, and truth values do not count as numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import config
from acquisition.maps.import_map import load_import_map
from config.errors import ConfigError
from config.load import load_cell, to_yaml
from config.refusals import WRITTEN
from tests.builders.raised_codes import raises_code

ROOT = Path(config.__file__).parents[1]
PACKAGES = ("acquisition", "config", "mock_hw", "rid_daq")


def test_every_pattern_of_the_models_has_a_description() -> None:
    texts = [path.read_text() for name in PACKAGES for path in (ROOT / name).rglob("*.py")]
    patterns = {found for text in texts for found in re.findall(r'\bpattern=r"(.*)"', text)}
    assert len(patterns) > 3
    assert patterns == set(WRITTEN)


@pytest.mark.parametrize(
    ("name", "ending"),
    [
        ("my arm", "at most 64; 'my_arm' is valid"),
        ("_arm", "at most 64"),
        ("kräftig (neu)", "at most 64; 'kräftig_neu_' is valid"),
    ],
)
def test_a_refused_name_is_reported_with_a_valid_one(
    name: str, ending: str, tmp_path: Path
) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(f"name: {name}\nrobot: ir361\ncolumns: 4\nrate_hz: 100\njoints: []\n")
    with pytest.raises(ConfigError) as refused:
        load_import_map(str(path))
    first = str(refused.value).splitlines()[0]
    assert first.startswith(f"{path}:1:1: name: {name!r}: a name begins with a letter")
    assert first.endswith(ending)


@pytest.mark.parametrize(
    ("keys", "lines"),
    [
        ("servo: {mode: nonsense, rated_torque: 3}", ["servo.mode: ", "servo.rated_torque: "]),
        ("servo: {torque: {object: '6077h:00', of: rated}}", ["servo.torque.of: "]),
    ],
)
def test_errors_of_keys_are_not_preceded_by_one_of_another_form(
    keys: str, lines: list[str], tmp_path: Path
) -> None:
    """`servo` is the name of a profile or its keys: if it has keys, only their errors help."""
    path = tmp_path / "cell.yaml"
    text = to_yaml(load_cell("ir361").config)
    path.write_text(re.sub(r"(?ms)^servo:.*?(?=^\w)", keys + "\n", text))
    with raises_code(ConfigError, "RID-FILE-VALUE") as refused:
        load_cell(str(path))
    found = str(refused.value).splitlines()
    assert [line for line, key in zip(found, lines, strict=True) if key in line] == found


@pytest.mark.parametrize(
    ("keys", "name"),
    [
        ("direction: true", "axes.0.direction"),
        ("node_id: true", "axes.0.node_id"),
    ],
)
def test_a_truth_value_is_no_number(keys: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    key = keys.split(":")[0]
    text = to_yaml(load_cell("ir361").config)
    path.write_text(re.sub(rf"{key}: -?\d+", keys, text, count=1))
    with raises_code(ConfigError, "RID-FILE-VALUE", name, "rue"):
        load_cell(str(path))


@pytest.mark.parametrize("key", ["position_sign", "torque_sign"])
def test_a_truth_value_is_no_sign(key: str, tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    joints = f"[{{joint: axis1, position: 1, torque: 2, {key}: true}}]"
    path.write_text(f"name: a\nrobot: ir361\ncolumns: 7\nrate_hz: 100\njoints: {joints}\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", f"joints.0.{key}"):
        load_import_map(str(path))
