"""`propose_map` in Python: the program proposes a map of a file, and a person confirms it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

import rid_daq.api
from benchmarks.layout_files import Source, bag_writer
from config.errors import ConfigError
from rid_daq.api import ProposedMap, Recording, Robot, propose_map, read_recording
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_robot
from tests.builders.raised_codes import raises_code

ROBOT = Robot(two_joint_robot())


def table(folder: Path, quantity: str) -> Path:
    path = folder / f"{quantity}.csv"
    head = f"t,pos_a,pos_b,vel_a,vel_b,{quantity}_a,{quantity}_b"
    path.write_text("\n".join([head, *as_lines(sound_table())]))
    return path


@pytest.fixture
def currents(tmp_path: Path) -> ProposedMap:
    return propose_map(table(tmp_path, "current"), robot=ROBOT)


def test_a_confirmed_proposal_reads_the_file(tmp_path: Path) -> None:
    file = table(tmp_path, "torque")
    proposal = propose_map(file, robot=ROBOT)
    assert not proposal.missing
    for shown in (*proposal.reasons, *proposal.doubts):
        assert shown in str(proposal)
    recording = read_recording(file, map=proposal)
    assert recording.torque_nm[:, 1] == pytest.approx(sound_table()[:, 6], abs=1e-6)
    assert recording.robot.joint_names == ("a", "b")


def test_what_only_a_person_knows_must_be_given(currents: ProposedMap) -> None:
    assert currents.missing == ("torque_constant_nm_per_a",)
    with raises_code(ConfigError, "RID-FILE-PLACEHOLDER"):
        read_recording(currents.source, map=currents)
    complete = currents.with_values(torque_constant_nm_per_a=[1.0, 2.0])
    recording = read_recording(currents.source, map=complete)
    assert recording.torque_nm[:, 1] == pytest.approx(2.0 * sound_table()[:, 6], abs=1e-6)
    assert currents.missing, "the proposal itself is unchanged"


def test_a_wrong_assumption_is_corrected(tmp_path: Path) -> None:
    file = table(tmp_path, "torque")
    proposal = propose_map(file, robot=ROBOT).with_values(units={"torque": "mNm"})
    assert proposal.keys["units"]["position"] == "rad"
    torque_nm = read_recording(file, map=proposal).torque_nm
    assert torque_nm[:, 1] == pytest.approx(1e-3 * sound_table()[:, 6], abs=1e-9)


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"torque_constant": [1.0, 2.0]}, "RID-API-ARGUMENT"),
        ({"torque_constant_nm_per_a": [1.0]}, "RID-API-ARGUMENT"),
        ({"torque_constant_nm_per_a": 1.0}, "RID-API-ARGUMENT"),
        ({"torque_constant_nm_per_a": [1.0, -1.0]}, "RID-FILE-VALUE"),
    ],
)
def test_invalid_values_are_refused(
    values: dict[str, object], code: str, currents: ProposedMap
) -> None:
    with raises_code(ConfigError, code):
        currents.with_values(**values)


def test_a_saved_proposal_is_an_import_map(tmp_path: Path, currents: ProposedMap) -> None:
    complete = currents.with_values(torque_constant_nm_per_a=np.array([1.0, 2.0]))
    complete.save(tmp_path / "arm.yaml")
    recording = read_recording(currents.source, map=tmp_path / "arm.yaml")
    assert recording.torque_nm[:, 0] == pytest.approx(sound_table()[:, 5], abs=1e-6)
    with raises_code(ConfigError, "RID-FILE-EXISTS"):
        currents.save(tmp_path / "arm.yaml")
    (tmp_path / "arm.robot.yaml").unlink()
    with raises_code(ConfigError, "RID-FILE-EXISTS"):
        currents.save(tmp_path / "arm.yaml")
    assert not (tmp_path / "arm.robot.yaml").exists()


def test_a_file_without_a_map_is_not_read(tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-OPTION-NEEDS"):
        read_recording(table(tmp_path, "torque"), robot=ROBOT)


def test_completion_offers_public_names_only() -> None:
    assert dir(rid_daq.api) == sorted(rid_daq.api.__all__)


def test_a_meaning_that_arrays_cannot_have_is_refused() -> None:
    table = sound_table()
    arrays = table[:, 0], table[:, 1:3], table[:, 5:7]
    for wrong in ("motor_current", "measured"):
        with raises_code(ConfigError, "RID-API-ARGUMENT"):
            Recording.from_arrays(*arrays, robot=ROBOT, torques=wrong)  # type: ignore[arg-type]


def test_a_bag_is_read_with_its_proposal(real_robot: Path, tmp_path: Path) -> None:
    path = real_robot / "ur-20_02_12-50sec_12harm.csv"
    source = Source.of(np.loadtxt(path, delimiter=",", skiprows=354, max_rows=800))
    (bag,) = bag_writer(StoragePlugin.MCAP)(tmp_path, source)
    proposal = propose_map(bag, robot="ur10e").with_values(effort="torque", torques="motor_torque")
    recording = read_recording(bag, map=proposal, robot="ur10e")
    assert recording.torque_nm == pytest.approx(source.torque, abs=1e-9)
    assert recording.robot.name == "ur10e"


def test_recordings_of_different_robots_are_named_by_their_labels() -> None:
    table = sound_table()
    other = Robot(ROBOT.description.model_copy(update={"name": "other"}))
    one, two = (
        Recording.from_arrays(table[:, 0], table[:, 1:3], table[:, 5:7], robot=robot, name=name)
        for robot, name in ((ROBOT, "one"), (other, "two"))
    )
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "one", "two") as caught:
        rid_daq.api.identify([one, two])
    assert one.run.folder.run_id not in str(caught.value)
