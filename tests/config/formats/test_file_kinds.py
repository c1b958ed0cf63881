"""A file of the wrong kind is named as what it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.motion.motion_file import load_motion
from config.errors import ConfigError
from config.load import bundled_names, load_bundled_or_path, load_cell, load_robot, read_named
from config.simulation.faults import FaultScript
from config.simulation.plant import PlantConfig


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Return a file of each kind, none with a name that tells."""
    found: dict[str, str] = {}
    for kind, text in (
        ("a cell", read_named("ir361", "cells", None)[0]),
        ("a robot", read_named("ir361", "robots", None)[0]),
        ("a plant", read_named(bundled_names("plants")[0], "plants", None)[0]),
        ("a motion", b"kind: multipoint\nrobot: ir361\nseed: 1\n"),
    ):
        path = tmp_path / f"file{len(found)}.yaml"
        path.write_bytes(text)
        found[kind] = str(path)
    return found


def test_a_file_of_another_kind_is_named_and_so_is_what_is_wanted(files: dict[str, str]) -> None:
    readers: dict[str, Callable[[str], object]] = {
        "a cell": load_cell,
        "a robot": load_robot,
        "a plant": lambda name: load_bundled_or_path(name, "plants", PlantConfig),
        "a motion": load_motion,
        "a fault script": lambda name: load_bundled_or_path(name, "faults", FaultScript),
    }
    for wanted, read in readers.items():
        for kind, path in files.items():
            if kind != wanted:
                with pytest.raises(ConfigError) as refused:
                    read(path)
                said = f"this is {kind} file; {wanted} file is wanted here"
                assert str(refused.value).endswith(f"{Path(path).name}: {said}")


def test_a_mistake_in_a_file_of_the_right_kind_is_named_by_its_key(files: dict[str, str]) -> None:
    path = Path(files["a cell"])
    path.write_text(path.read_text() + "surplus: 1\n")
    with pytest.raises(ConfigError, match="surplus: unknown key"):
        load_cell(str(path))
