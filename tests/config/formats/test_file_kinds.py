"""Error messages for a file of the wrong kind name its actual kind."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.maps.import_map import load_import_map
from acquisition.motion.motion_file import load_motion
from config.errors import ConfigError
from config.load import bundled_names, load_bundled_or_path, load_cell, load_robot, read_named
from config.simulation.faults import FaultScript
from config.simulation.plant import PlantConfig
from identification.estimation.file import read_estimate
from tests.builders.raised_codes import raises_code


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Return files of four kinds, by kind; their names do not show the kind."""
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


def test_the_error_names_the_actual_and_the_expected_kind(files: dict[str, str]) -> None:
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
                with raises_code(
                    ConfigError, "RID-FILE-TYPE", f"{path}: ", f"{kind} file", f"{wanted} file"
                ):
                    read(path)


def test_an_error_in_a_file_of_the_right_kind_names_its_key(files: dict[str, str]) -> None:
    path = Path(files["a cell"])
    path.write_text(path.read_text() + "surplus: 1\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", "surplus"):
        load_cell(str(path))


MODEL = json.dumps({"software": "0.1", "kind": "rid-daq estimate", "robot": {}}).encode()
PAYLOAD = json.dumps({"kind": "rid-daq payload", "robot": {"kinematics": {"kind": "dh"}}}).encode()
LOOPS = json.dumps({"format": "rid-daq velocity loops 3"}).encode()


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"kind: multipoint\nrobot: ir361\n", "motion file"),
        (read_named("ir361", "cells", None)[0], "cell file"),
        (LOOPS, "`loop`"),
        (PAYLOAD, "`payload identify`"),
        (b"<!DOCTYPE html>\n<html>", "(HTML)"),
        (b"\x89MCAP0\r\n\xff", "(MCAP)"),
        (b"<?xml version='1.0'?>\n<!-- made by xacro -->\n<robot name='r'>", "URDF"),
    ],
)
def test_the_actual_kind_of_a_file_given_as_a_model_is_named(
    content: bytes, kind: str, tmp_path: Path
) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with raises_code(ConfigError, "RID-FILE-TYPE", f"{path}: ", kind, "`rid-daq identify`"):
        read_estimate(path)


@pytest.mark.parametrize(
    ("content", "kinds"),
    [
        (MODEL, ("`identify`", "import map")),
        (b"kind: circle\nrobot: ir361\n", ("motion file", "import map")),
        (b"<html><p>a: b: c</p>", ("(HTML)", "YAML")),
        (b"\x89MCAP0\r\n\xff", ("(MCAP)", "UTF-8")),
    ],
)
def test_the_actual_kind_of_a_file_given_as_a_map_is_named(
    content: bytes, kinds: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "file.yaml"
    path.write_bytes(content)
    with raises_code(ConfigError, "RID-FILE-TYPE", f"{path}: ", *kinds):
        load_import_map(str(path))


def test_a_map_given_as_a_cell_is_named_and_a_damaged_model_stays_a_model(
    tmp_path: Path,
) -> None:
    path = tmp_path / "file.yaml"
    path.write_bytes(read_named(bundled_names("maps")[0], "maps", None)[0])
    with raises_code(ConfigError, "RID-FILE-TYPE"):
        load_cell(str(path))
    path.write_bytes(MODEL)
    with raises_code(ConfigError, "RID-FILE-VALUE"):
        read_estimate(path)


def test_a_map_with_an_extra_bracket_is_reported_with_its_position(tmp_path: Path) -> None:
    """The file is an import map, as required: its kind is not the problem."""
    path = tmp_path / "map.yaml"
    path.write_text("name: a\nrobot: ir361\ncolumns: 13\ntime: {column: Time [ms], unit: ms}\n")
    with raises_code(ConfigError, "RID-FILE-SYNTAX", f"{path}:4:21: ", "'['", "quotes"):
        load_import_map(str(path))


@pytest.mark.parametrize("head", ["", '<?xml version="1.0"?>\n<!-- my arm -->\n'])
def test_a_urdf_instead_of_a_robot_file_is_named(tmp_path: Path, head: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(f'{head}<robot name="arm"> <link name="base"/> </robot>')
    with raises_code(ConfigError, "RID-FILE-TYPE", "arm.urdf: ", "URDF", "from_urdf"):
        load_robot(str(path))
