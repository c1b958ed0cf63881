"""A payload that is estimated as on rigid gears, although the gears bend, has a finding."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from acquisition.processing.torque_channel import TorqueChannel
from config.load import load_cell
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.payload.equations import Procedure
from identification.payload.procedures import PayloadOptions
from rid_daq.operations.payload.payload_estimate import PayloadRequest, gear_findings
from tests.builders.elastic_model import links_model
from tests.builders.known_model import known_estimate

CELL = load_cell("ir361")
LINKS, MOTORS = links_model(CELL), known_estimate(CELL, {})
CODE = "RID-MODEL-RIGID-GEARS"


def findings(
    robot: RobotDescription, model: Estimate | None = None, *, periodic: bool = True
) -> str:
    run: Any = SimpleNamespace(robot=robot, is_periodic=periodic)
    procedure: Procedure = "together" if model is None else "model"
    request = PayloadRequest(PayloadOptions(procedure, robot=model))
    return " ".join(gear_findings([run], request))


def test_a_model_that_was_fitted_to_the_motors_is_named() -> None:
    assert CODE in findings(LINKS.robot, MOTORS)
    assert "fitted to the motors" in findings(LINKS.robot, MOTORS)


def test_runs_that_cannot_be_converted_are_named() -> None:
    assert "not periodic" in findings(LINKS.robot, LINKS, periodic=False)
    assert "not periodic" in findings(LINKS.robot, periodic=False)
    channel = replace(TorqueChannel.none(3), width_s=TorqueChannel.none(3).width_s + 0.1)
    assert "low-pass" in findings(LINKS.robot, replace(LINKS, channel=channel))


def test_converted_runs_and_rigid_gears_have_no_finding() -> None:
    assert findings(LINKS.robot, LINKS) == ""
    assert findings(CELL.robot, LINKS) == ""
    assert findings(LINKS.robot) == ""
    assert findings(CELL.robot, MOTORS) == findings(CELL.robot) == ""
