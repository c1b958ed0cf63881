"""Joint states of a bag: the meaning of `effort` is inferred from the data, if possible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from acquisition.proposals.proposal import Proposal
from benchmarks.layout_files import Source, bag_writer
from config.load import load_robot, to_yaml
from config.refusals import PLACEHOLDER
from rid_daq.operations.experiment.map_proposal import propose_checked_map

UR10_BAG = "ur10_exciting_trajectory.db3"


@pytest.fixture(scope="module")
def source(real_robot: Path) -> Source:
    """Return a part of a recording of a UR10e, whose masses and torque constants are known."""
    path = real_robot / "ur-20_02_12-50sec_12harm.csv"
    return Source.of(np.loadtxt(path, delimiter=",", skiprows=354, max_rows=2000))


def propose(folder: Path, source: Source, robot: str = "ur10e") -> Proposal:
    (bag,) = bag_writer(StoragePlugin.MCAP)(folder, source)
    return propose_checked_map(bag, robot)


def meaning(proposal: Proposal) -> tuple[Any, Any]:
    return proposal.keys["joint_states"]["effort"], proposal.keys["torques"]


def test_torques_of_motors_carry_the_arm(source: Source, tmp_path: Path) -> None:
    proposal = propose(tmp_path, source)
    assert meaning(proposal) == ("torque", "motor_torque")
    assert proposal.missing == ()
    assert proposal.recording is not None


def test_currents_are_too_small_to_carry_the_arm(source: Source, tmp_path: Path) -> None:
    currents = replace(source, torque=source.current)
    proposal = propose(tmp_path, currents)
    assert meaning(proposal) == ("current", "motor_current")
    assert proposal.missing == ()


def test_currents_need_torque_constants(source: Source, tmp_path: Path) -> None:
    known = load_robot("ur10e")
    bare = known.model_copy(
        update={
            "joints": tuple(
                joint.model_copy(update={"torque_constant_nm_per_a": None})
                for joint in known.joints
            )
        }
    )
    (tmp_path / "bare.yaml").write_text(to_yaml(bare))
    currents = replace(source, torque=source.current)
    proposal = propose(tmp_path, currents, str(tmp_path / "bare.yaml"))
    assert meaning(proposal) == ("current", "motor_current")
    assert proposal.missing == ("torque_constant_nm_per_a",)


def test_torques_without_friction_are_not_currents(source: Source, tmp_path: Path) -> None:
    """`target_moment` is computed by the controller's own model."""
    proposal = propose(tmp_path, replace(source, torque=source.rows[:, 25:31]))
    assert meaning(proposal) == ("torque", PLACEHOLDER)
    assert proposal.missing == ("torques",)


def test_a_person_decides_if_the_weight_of_the_arm_is_unknown(real_robot: Path) -> None:
    proposal = propose_checked_map(real_robot.parent / "ur10" / UR10_BAG, "ur10")
    assert meaning(proposal) == (PLACEHOLDER, PLACEHOLDER)
    (doubt,) = proposal.doubts
    assert "motor_current" in doubt
    assert "motor_torque" in doubt


def test_noise_shows_no_meaning(source: Source, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0.0, 20.0, source.torque.shape)
    proposal = propose(tmp_path, replace(source, torque=noise))
    assert meaning(proposal) == (PLACEHOLDER, PLACEHOLDER)
