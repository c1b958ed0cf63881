"""The robot executes the motion that the user approved: no file is read after the question.

Motions whose speed or torque with the feedforward exceeds a limit are refused.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.motion_file import load_motion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.file import feedforward_bytes
from compensation.loops.loop_file import write_loops
from config.cell.cell import CellConfig
from config.errors import ConfigError, LimitError
from config.load import LoadedCell, load_cell, to_yaml
from identification.elasticity.limit_torque import limit_torque
from identification.estimation.file import write_estimate
from rid_daq.operations.experiment import recorded_motion
from rid_daq.operations.experiment.record import RecordRequest
from rid_daq.operations.experiment.recorded_motion import record_motion_file
from rid_daq.operations.path.stream import StreamRequest
from rid_daq.operations.path.streamed_path import stream_path
from rid_daq.recording import run_session
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import RunSession
from rid_daq.runs.run_data import FEEDFORWARD, MOTION, ONLINE_LOOPS, ONLINE_MODEL
from rid_daq.terminal.console import Console
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import loops_of
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.promise("driven-as-approved")


class DrivenError(Exception):
    """Raised instead of a motion, with the motion that would have been executed."""

    def __init__(self, request: RunRequest, loaded: LoadedCell) -> None:
        super().__init__("driven")
        self.asked, self.loaded = request, loaded


@contextlib.contextmanager
def reached(loaded: LoadedCell, *_: object) -> Iterator[tuple[CellConfig, None]]:
    yield loaded.config, None


def raise_driven(session: RunSession, request: RunRequest) -> None:
    raise DrivenError(request, session.loaded)


class Person(Console):
    """A user who changes something before confirming that the cell is clear."""

    def __init__(self, meanwhile: Callable[[], None]) -> None:
        super().__init__()
        object.__setattr__(self, "meanwhile", meanwhile)
        object.__setattr__(self, "said", [])

    @property
    def can_ask(self) -> bool:
        return True

    def say(self, text: str = "") -> None:
        observer: Any = self
        observer.said.append(text)

    def ask(self, question: str, understood: Any, choices: Any = ()) -> Any:
        observer: Any = self
        observer.meanwhile()
        return understood("my_cell")

    def confirm(self, question: str) -> bool:
        return True


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a new cell, a motion, its feedforward, a model and velocity loops."""
    monkeypatch.setattr(run_session, "hold_reachable_cell", reached)
    monkeypatch.setattr(run_session.RunSession, "recording", raise_driven)
    bundled = load_cell("ir361")
    for name, content in bundled.files.items():
        (tmp_path / name).write_bytes(content)
    text = (tmp_path / "cell.yaml").read_text()
    for key, old in (("name", "ir361"), ("robot", "ir361"), ("plant", "ir361")):
        new = "my_cell" if key == "name" else f"./{key}.yaml"
        assert f"\n{key}: {old}\n" in f"\n{text}"
        text = f"\n{text}".replace(f"\n{key}: {old}\n", f"\n{key}: {new}\n")[1:]
    (tmp_path / "cell.yaml").write_text(text)
    cell = load_cell(str(tmp_path / "cell.yaml"))
    joints = tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.1,), cosine=(0.0,))
        for name in cell.robot.joint_names
    )
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=1, ramp_s=1.0, joints=joints
    )
    (tmp_path / "motion.yaml").write_text(f"# by hand\n{to_yaml(motion)}")
    samples = motion.plan(cell.robot, cell.config.cycle_time_s).whole()
    ahead = replace(samples, feedforward=samples.velocity)
    (tmp_path / "ahead.json").write_bytes(feedforward_bytes(motion, ahead))
    write_estimate(tmp_path / "model.json", known_estimate(cell, {}))
    write_loops(tmp_path / "loops.json", loops_of(cell), "ir361", "a run")
    return tmp_path


def remove_all(folder: Path) -> Callable[[], None]:
    """Return a function that deletes every file, so that nothing can be read again."""

    def remove() -> None:
        for path in folder.iterdir():
            if path.is_file():
                path.unlink()

    return remove


def driven_motion(folder: Path, **more: Any) -> tuple[DrivenError, Person]:
    person = Person(remove_all(folder))
    request = RecordRequest(
        cell=str(folder / "cell.yaml"),
        motion=folder / "motion.yaml",
        runs=folder / "runs",
        practise=True,
        **more,
    )
    with pytest.raises(DrivenError) as caught:
        record_motion_file(request, person)
    return caught.value, person


def test_no_file_of_a_recording_is_read_after_the_question(folder: Path) -> None:
    content = {name: (folder / name).read_bytes() for name in ("motion.yaml", "ahead.json")}
    driven, _ = driven_motion(
        folder, feedforward=folder / "ahead.json", model=folder / "model.json"
    )
    assert driven.asked.files == {
        MOTION: content["motion.yaml"],
        FEEDFORWARD: content["ahead.json"],
    }
    samples = driven.asked.samples
    assert isinstance(samples, MotionSamples)
    assert samples.feedforward is not None
    np.testing.assert_allclose(samples.feedforward, samples.velocity, atol=1e-8)


def test_a_fault_script_is_read_once(folder: Path) -> None:
    (folder / "faults.yaml").write_text("seed: 3\n")
    driven, _ = driven_motion(folder, faults=folder / "faults.yaml")
    assert driven.asked.files["faults.yaml"] == b"seed: 3\n"


def test_the_executed_joint_table_is_the_one_read_before_the_question(folder: Path) -> None:
    way = 0.1 * (1.0 - np.cos(2.0 * np.pi * np.arange(51) / 50)) ** 2
    rows = "\n".join(f"{0.1 * k:g},{at:.9g},0,0" for k, at in enumerate(way))
    (folder / "rows.csv").write_text(f"time_s,axis1,axis2,axis3\n{rows}\n")
    (folder / "motion.yaml").write_text("kind: joint_table\nrobot: ir361\nfile: rows.csv\n")
    expected = load_motion(folder / "motion.yaml")
    driven, _ = driven_motion(folder)
    assert isinstance(driven.asked.samples, MotionSamples)
    cell = load_cell("ir361")
    planned = expected.plan(cell.robot, cell.config.cycle_time_s)
    np.testing.assert_array_equal(driven.asked.samples.position, planned.position)
    (folder / "kept.yaml").write_bytes(driven.asked.files[MOTION])
    assert load_motion(folder / "kept.yaml") == expected


def test_the_hashes_shown_with_the_question_match_the_files_of_the_run(folder: Path) -> None:
    driven, person = driven_motion(folder, feedforward=folder / "ahead.json")
    observer: Any = person
    (shown,) = [line for line in observer.said if "SHA-256" in line]
    kept = {**driven.loaded.files, **driven.asked.files}
    assert {"cell.yaml", "robot.yaml", MOTION, FEEDFORWARD} <= kept.keys()
    for name, content in kept.items():
        assert f"{name} {hashlib.sha256(content).hexdigest()[:12]}" in shown


def test_no_file_of_a_streamed_path_is_read_after_the_question(folder: Path) -> None:
    names = ("motion.yaml", "model.json", "loops.json")
    content = {name: (folder / name).read_bytes() for name in names}
    request = StreamRequest(
        cell=str(folder / "cell.yaml"),
        model=folder / "model.json",
        loop=folder / "loops.json",
        runs=folder / "runs",
        motion=folder / "motion.yaml",
        practise=True,
    )
    person: Any = Person(remove_all(folder))
    with pytest.raises(DrivenError) as caught:
        stream_path(request, person)
    (shown,) = [line for line in person.said if "SHA-256" in line]
    for name, text in caught.value.asked.files.items():
        assert f"{name} {hashlib.sha256(text).hexdigest()[:12]}" in shown
    assert caught.value.asked.files == {
        MOTION: content["motion.yaml"],
        ONLINE_MODEL: content["model.json"],
        ONLINE_LOOPS: content["loops.json"],
    }


@pytest.mark.promise("sum-verified")
def test_a_feedforward_beyond_the_limits_is_refused_before_the_question(folder: Path) -> None:
    file = json.loads((folder / "ahead.json").read_text())
    for number, row in enumerate(file["feedforward"]):
        row[0] = 0.3 * (-1.0) ** number
    (folder / "ahead.json").write_text(json.dumps(file))

    def fail_if_asked() -> None:
        raise AssertionError("no question about a motion that cannot be executed")

    request = RecordRequest(
        cell=str(folder / "cell.yaml"),
        motion=folder / "motion.yaml",
        runs=folder / "runs",
        feedforward=folder / "ahead.json",
        practise=True,
    )
    with pytest.raises(LimitError) as caught:
        record_motion_file(request, Person(fail_if_asked))
    assert caught.value.refusal == "RID-MOTION-COMMAND"
    assert not (folder / "runs").exists()


@pytest.mark.promise("sum-verified")
def test_a_feedforward_that_alone_exceeds_a_speed_limit_is_refused(folder: Path) -> None:
    file = json.loads((folder / "ahead.json").read_text())
    limit = load_cell("ir361").robot.joints[0].limits.velocity
    for row in file["feedforward"]:
        row[0] = 1.01 * limit
    (folder / "ahead.json").write_text(json.dumps(file))
    request = RecordRequest(
        cell=str(folder / "cell.yaml"),
        motion=folder / "motion.yaml",
        runs=folder / "runs",
        feedforward=folder / "ahead.json",
        practise=True,
    )
    with raises_code(ConfigError, "RID-MOTION-LIMIT", "'axis1'"):
        record_motion_file(request, Person(lambda: None))


@pytest.mark.promise("sum-verified")
def test_the_planned_motion_is_checked_against_torque_limits(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion that the position loop commands is at rest here: only the planned motion exceeds
    the limit.
    """
    robot = (folder / "robot.yaml").read_text()
    (folder / "robot.yaml").write_text(robot.replace("torque: 450.0}", "torque: 1.0}"))

    def at_rest(samples: MotionSamples, _gain: float) -> MotionSamples:
        still = np.zeros_like(samples.velocity)
        return replace(samples, velocity=still, acceleration=still)

    monkeypatch.setattr(recorded_motion, "commanded_motion", at_rest)
    request = RecordRequest(
        cell=str(folder / "cell.yaml"),
        motion=folder / "motion.yaml",
        runs=folder / "runs",
        model=folder / "model.json",
        practise=True,
    )
    with raises_code(LimitError, "RID-MOTION-LIMIT", "'axis1'"):
        record_motion_file(request, Person(lambda: None))


@pytest.mark.promise("sum-verified")
def test_motion_plus_feedforward_is_checked_against_torque_limits(folder: Path) -> None:
    """The planned motion is within the torque limits; with its feedforward it exceeds them."""
    cell = load_cell(str(folder / "cell.yaml"))
    plan = load_motion(folder / "motion.yaml").plan(cell.robot, cell.config.cycle_time_s).whole()
    moved = (plan.position, plan.velocity, plan.acceleration, plan.sample_period_s)
    enough = 1.3 * float(np.abs(limit_torque(known_estimate(cell, {}), *moved)[:, 0]).max())
    file = json.loads((folder / "ahead.json").read_text())
    rows = np.array(file["feedforward"])
    k = np.arange(len(rows))
    rows[:, 0] += 0.28 * np.sin(np.pi * k / (len(k) - 1)) ** 2 * np.sin(0.25 * k)
    (folder / "ahead.json").write_text(json.dumps({**file, "feedforward": rows.tolist()}))
    request = RecordRequest(
        cell=str(folder / "cell.yaml"),
        motion=folder / "motion.yaml",
        runs=folder / "runs",
        feedforward=folder / "ahead.json",
        model=folder / "model.json",
        practise=True,
    )
    robot = (folder / "robot.yaml").read_text()
    assert "torque: 450.0}" in robot
    (folder / "robot.yaml").write_text(robot.replace("torque: 450.0}", f"torque: {enough:.3f}}}"))
    with raises_code(LimitError, "RID-MOTION-LIMIT", "'axis1'"):
        record_motion_file(request, Person(lambda: None))
    with pytest.raises(DrivenError):
        record_motion_file(request.model_copy(update={"feedforward": None}), Person(lambda: None))
