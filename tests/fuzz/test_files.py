"""Randomly changed files are read, or refused with one of the project's own errors.

Files of many kinds are changed with a seed: bytes are flipped, cut, doubled, or replaced by text
that has broken parsers before. Other exceptions and long run times are failures.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.journal.plate import read_plate_journal
from acquisition.maps.import_map import load_import_map
from acquisition.motion.motion_file import load_motion
from acquisition.runs.folder import RunFolder
from acquisition.session.repair import examine_journal
from benchmarks.closed_loop import true_loops
from compensation.feedforward.file import read_feedforward
from compensation.loops.loop_file import read_loops, write_loops
from config.errors import RidDaqError
from config.load import load_cell, load_faults, load_robot
from identification.choices import LoadFormat
from identification.estimation.file import read_estimate, write_estimate
from identification.payload.body import PayloadBody
from identification.payload.controllers.formats import load_data, read_load_data
from identification.payload.file import read_payload, write_payload
from identification.payload.verdict import PayloadCheck, PayloadResult
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.start.init import InitRequest
from rid_daq.operations.start.urdf_starter import starting_robot
from rid_daq.report.result_file import read_result
from tests.builders.certified import estimate_of
from tests.builders.known_model import known_estimate
from tests.compensation.feedforward.test_feedforward_file import content

pytestmark = pytest.mark.slow

BUNDLED = Path(__file__).resolve().parents[2] / "config" / "bundled"
RESULT = Path(__file__).resolve().parents[1] / "rid_daq/report/results/recording.json"
LONGEST_S = 30.0  # processor time: detects an endless loop
NASTY = (
    b"NaN", b"-Infinity", b"1e999", b"-1e308", b"9" * 400, b"0x1F", b"1_0", b"true", b"null",
    b"{", b"}", b"[" * 5000, b"]", b"&a [*a, *a]", b"*a", b"!!python/object/apply:os.system ['x']",
    b"<<: *x", b"\x00", b"\xff\xfe", b"\x1b[2J", b"\r", b"\n\n", b"\t", b'"', b"'", b",", b";",
    b": ", b"-", b"<!ENTITY a 'b'>", b"&a;", b"=cmd()", b"../../etc/passwd", b"\xf0\x9f\xa4\x96",
    b"\\ud800",
)  # fmt: skip
NOTHING = (
    b"", b"\n", b"null", b"[]", b"{}", b"1", b'"x"', b"\xff" * 1000, b"\x00" * 1000, b"[" * 100_000,
    b'{"a":' * 50_000, b"- " * 50_000, b"<a>" * 50_000, b"time_s\n", b"9" * 100_000,
)  # fmt: skip


def mutations(data: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Yield the given number of randomly changed copies of a file."""
    chance = random.Random(seed)
    for _ in range(count):
        changed = bytearray(data)
        for _ in range(chance.choice((1, 1, 2, 5))):
            at, size = chance.randrange(len(changed) + 1), chance.choice((1, 2, 8, 64))
            match chance.randrange(6):
                case 0:
                    changed[at : at + size] = b""
                case 1:
                    changed[at:at] = changed[at : at + size]
                case 2:
                    changed[at:at] = chance.choice(NASTY)
                case 3:
                    changed[at : at + size] = chance.choice(NASTY)
                case 4 if at < len(changed):
                    changed[at] ^= 1 << chance.randrange(8)
                case _:
                    del changed[at:]
            if not changed:
                break
        yield bytes(changed)


def refusals_of_changed(read: Callable[[Path], Any], path: Path, data: bytes, count: int) -> int:
    """Read unsuitable texts and changed copies of a file.

    Returns:
        Number of refused copies; one less if the reader accepts one of the texts.
    """
    messages = []
    for changed in (*NOTHING, *mutations(data, count, seed=1)):
        path.write_bytes(changed)
        begun_s = time.process_time()
        try:
            read(path)
        except RidDaqError as error:
            messages.append(str(error))
        assert time.process_time() - begun_s < LONGEST_S
    assert (
        len(messages) >= len(NOTHING) - 1
    )  # some readers accept one of the texts as an empty file
    assert all(messages)
    return len(messages) - len(NOTHING)


@pytest.mark.parametrize(
    ("kind", "name", "read"),
    [
        ("robots", "ir361", lambda path: load_robot(str(path))),
        ("robots", "kr15", lambda path: load_robot(str(path))),
        ("cells", "ir361", lambda path: load_cell(str(path))),
        ("maps", "ur10e_31", lambda path: load_import_map(str(path))),
    ],
)
def test_changed_yaml_files_are_read_or_refused(
    kind: str, name: str, read: Callable[[Path], Any], tmp_path: Path
) -> None:
    data = (BUNDLED / kind / f"{name}.yaml").read_bytes()
    assert refusals_of_changed(read, tmp_path / "changed.yaml", data, 60) > 15


MOTIONS = {
    "fourier": b"""kind: fourier
robot: ir361
period_s: 4.0
periods: 2
ramp_s: 1.0
joints:
  - {joint: axis1, offset: 0.1, sine: [0.2, 0.01], cosine: [0.1, 0.0]}
  - {joint: axis2, offset: 0.1, sine: [0.2, 0.01], cosine: [0.1, 0.0]}
  - {joint: axis3, offset: 0.1, sine: [0.2, 0.01], cosine: [0.1, 0.0]}
""",
}


@pytest.mark.parametrize("kind", MOTIONS)
def test_changed_motion_files_are_planned_or_refused(kind: str, tmp_path: Path) -> None:
    robot = load_robot("ir361")

    def read(path: Path) -> None:
        load_motion(path).plan(robot, 0.008)

    assert refusals_of_changed(read, tmp_path / "motion.yaml", MOTIONS[kind], 100) > 25


def test_changed_joint_tables_are_read_or_refused(tmp_path: Path) -> None:
    motion = tmp_path / "motion.yaml"
    motion.write_text("kind: joint_table\nrobot: ir361\nfile: table.csv\n")
    rows = [f"{0.1 * i:.2f},{0.01 * i:.3f},0.0,{-0.01 * i:.3f}" for i in range(60)]
    table = "\n".join(["time_s,axis1,axis2,axis3", *rows]).encode()
    robot = load_robot("ir361")

    def read(_path: Path) -> None:
        load_motion(motion).plan(robot, 0.008)

    assert refusals_of_changed(read, tmp_path / "table.csv", table, 100) > 25


def test_changed_fault_scripts_are_read_or_refused(tmp_path: Path) -> None:
    data = b"seed: 3\nbus:\n  - {kind: drop, at_frame: 4, joint: axis1}\n" * 1
    data += b"drives:\n  - {kind: emergency, at_s: 3.0, code: 12}\n"
    cell = load_cell("ir361").config
    assert (
        refusals_of_changed(lambda path: load_faults(path, cell), tmp_path / "f.yaml", data, 80)
        > 25
    )


def test_changed_csv_files_are_imported_or_refused(tmp_path: Path) -> None:
    import_map, robot = load_import_map("ur10e_31")
    rng = np.random.default_rng(2)
    width = 31
    lines = [
        ",".join(f"{x:.5f}" for x in (0.01 * i, *rng.normal(size=width - 1))) for i in range(80)
    ]

    def read(path: Path) -> None:
        import_csv(path, import_map, robot)

    assert refusals_of_changed(read, tmp_path / "r.csv", "\n".join(lines).encode(), 60) > 0


def test_changed_urdfs_are_read_or_refused(tmp_path: Path) -> None:
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0 0 .1"/><mass value="2"/><inertia ixx="1"'
        ' iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for i in range(4)
    )
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<origin xyz="0 .2 .1" rpy="0 1 0"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="10" velocity="2"/></joint>'
        for i in range(3)
    )
    data = f'<?xml version="1.0"?><robot name="r">{links}{joints}</robot>'.encode()
    assert (
        refusals_of_changed(
            lambda path: starting_robot(InitRequest(folder=path.parent), path),
            tmp_path / "r.urdf",
            data,
            60,
        )
        > 20
    )


@pytest.mark.parametrize("name", ["result.json", "session.json"])
def test_changed_result_and_session_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "runs", "fuzz")
    session = SessionFile(cell="kr15", done={"unloaded 1": "r"}, facts={"drift": 1.0})
    data = {
        "result.json": RESULT.read_bytes(),
        "session.json": session.model_dump_json(by_alias=True).encode(),
    }[name]

    def read(path: Path) -> None:
        folder.write(name, path.read_bytes())
        if name == "result.json":
            read_result(folder)
        else:
            SessionFile.read(folder)

    path = tmp_path / "changed.json"
    path.write_bytes(data)
    read(path)  # the unchanged file is accepted
    assert refusals_of_changed(read, path, data, 150) > 100


def test_changed_manifests_are_read_or_refused(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "runs", "fuzz")
    folder.write("robot.yaml", b"name: x\n")
    path = folder.path / "manifest.json"
    data = path.read_bytes()

    def read(_: Path) -> None:
        RunFolder.open(folder.path).verify()

    assert refusals_of_changed(read, path, data, 150) > 50


@pytest.mark.parametrize("form", LoadFormat)
def test_changed_load_data_of_controllers_is_read_or_refused(
    form: LoadFormat, tmp_path: Path
) -> None:
    body = PayloadBody(4.2, np.array([0.01, -0.02, 0.1]), np.diag([0.03, 0.04, 0.02]))
    data = load_data(body, form).encode()

    def read(path: Path) -> None:
        read_load_data(path.read_text(errors="replace"), form)

    assert refusals_of_changed(read, tmp_path / "load", data, 150) > 10


@pytest.mark.parametrize("read", [read_estimate, read_payload, read_loops, read_feedforward])
def test_changed_models_are_used_or_refused(
    read: Callable[[Path], Any], tmp_path: Path, json_files: dict[Any, bytes]
) -> None:
    assert refusals_of_changed(read, tmp_path / "changed.json", json_files[read], 200) > 100


@pytest.fixture(scope="module")
def json_files(tmp_path_factory: pytest.TempPathFactory) -> dict[Any, bytes]:
    """Complete JSON files, by the function that reads them."""
    folder, cell = tmp_path_factory.mktemp("complete"), load_cell("ir361")
    loops, estimate, payload = (folder / name for name in ("loops", "estimate", "payload"))
    write_loops(loops, true_loops(cell), "ir361", "r")
    write_estimate(estimate, known_estimate(cell, {}))
    passed = (PayloadCheck("rank", 10, "≥", 10),)
    write_payload(payload, PayloadResult(estimate_of(cell, ()), passed))
    feedforward = folder / "feedforward"
    feedforward.write_bytes(content())
    files = {
        read_loops: loops,
        read_estimate: estimate,
        read_payload: payload,
        read_feedforward: feedforward,
    }
    for read, path in files.items():
        read(path)  # the unchanged file is accepted
    return {read: path.read_bytes() for read, path in files.items()}


def test_recordings_of_random_content_are_read_or_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    for number in range(30):
        path = tmp_path / f"{number}.mcap"
        header = JournalHeader(joint_names=("a", "b"), sample_period_s=1e-9 if number % 2 else 1e9)
        size = row_dtype(2).itemsize
        with JournalWriter(path, header) as writer:
            writer.append(rng.bytes(size * 20))
        for read in (
            lambda p: read_journal(p).recording(),
            examine_journal,
            read_plate_journal,
        ):
            with pytest.raises(RidDaqError):
                read(path)


def test_changed_recordings_are_read_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "whole.mcap"
    rows = np.zeros(300, dtype=row_dtype(2))
    rows["time_s"] = rows["cycle"] = np.arange(300)
    with JournalWriter(path, JournalHeader(joint_names=("a", "b"), sample_period_s=1.0)) as writer:
        writer.append(rows.tobytes())
    data = path.read_bytes()

    def read(changed: Path) -> None:
        examine_journal(changed)

    refusals_of_changed(read, tmp_path / "changed.mcap", data, 300)
