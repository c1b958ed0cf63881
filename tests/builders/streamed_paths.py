"""Paths that a client streams to a simulated cell, and checks of the robot's state at their end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.multipoint import MultipointMotion
from config.load import load_robot
from dynamics.geometry.kinematics import Chain
from rid_daq.app import run
from tests.builders.json_output import document
from tests.builders.point_client import send_batches

CHAIN = Chain.from_description(load_robot("ir361"))
LIMITS = [joint.limits for joint in load_robot("ir361").joints]


def model_and_loops(workshop: Path) -> list[str]:
    return ["--model", str(workshop / "model.json"), "--loop", str(workshop / "loops.json")]


def joint_path() -> NDArray[np.float64]:
    """Return the points [rad], (points, 3), of a path that did not tune the compensation."""
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=4, seed=11)
    return np.array(motion.plan(load_robot("ir361"), 0.008).position)


def model_of(workshop: Path) -> list[str]:
    """Return the options for the model, the velocity loops and the folder of runs."""
    return [*model_and_loops(workshop), "--runs", str(workshop / "runs")]


def stream_batches(
    workshop: Path,
    capsys: pytest.CaptureFixture[str],
    batches: list[NDArray[np.float64]],
    *,
    end: bool = True,
) -> tuple[int, dict[str, Any] | None, dict[str, Any]]:
    """Stream batches of points from a client.

    Return the exit code, the answer to the client, and the result document.
    """
    path = workshop / "points"
    capsys.readouterr()
    with send_batches(path, batches, end=end) as answers:
        words = ["stream", str(workshop / "arm.yaml"), "--socket", str(path), "--json"]
        code = run([*words, *model_of(workshop)])
    return code, answers[0] if answers else None, document(capsys)


def require_rest_on(path: NDArray[np.float64], printed: dict[str, Any]) -> None:
    """Require that the set-points follow a path and that the robot rests at the end.

    Also require that accelerations of the set-points and measured speeds and torques are within
    their limits.

    Args:
        path: Points [rad], (points, joints).
        printed: Result document of `rid-daq stream`.
    """
    rows = read_journal(Path(printed["folder"]) / "recording.mcap").rows
    moving = rows[rows["sample_index"] >= 0]
    target = moving["target_position"]
    off = np.abs(target[:, np.newaxis] - path[np.newaxis]).max(axis=2).min(axis=1)
    assert off.max() < 1.1 * np.abs(np.diff(path, axis=0)).max()
    bend = np.abs(np.diff(target, n=2, axis=0)) / 0.008**2
    assert (bend <= 1.02 * np.array([limit.acceleration for limit in LIMITS])).all()
    assert not np.diff(target[-5:], axis=0).any()
    speed = np.abs(np.diff(rows["position"], axis=0)) / 0.008
    assert (speed <= 1.1 * np.array([limit.velocity for limit in LIMITS])).all()
    assert speed[-5:].max() < 0.01
    torque = np.abs(moving["torque_nm"])
    assert (torque <= np.array([limit.torque for limit in LIMITS])).all()
