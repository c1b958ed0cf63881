"""Validation messages describe a required text format in words and not as a pattern."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import config
from acquisition.maps.import_map import load_import_map
from config.errors import ConfigError
from config.refusals import WRITTEN

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
