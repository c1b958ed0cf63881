"""`judge_efforts`: completes a proposed map of joint states by the meaning of their efforts."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from acquisition.maps.torque_meaning import MEANINGS, MOTOR_CURRENT, MOTOR_TORQUE, TorqueMeaning
from acquisition.proposals.proposal import Proposal
from config.refusals import PLACEHOLDER
from config.robot.robot import RobotDescription
from identification.wiring.torque_origin import TorqueJudgement, judge_torques, weight_of_torques
from identification.wiring.weight import ArmWeight

CONSTANT: Final = "torque_constant_nm_per_a"


def judge_efforts(proposal: Proposal, robot: RobotDescription) -> Proposal:
    """Return a proposal with the quantity and the meaning of the efforts, or `?`.

    Friction, gravity and noise show the meaning of torques. They do not distinguish currents from
    torques of motors. The arm's weight does, if the robot file states it in `cad`.

    Args:
        proposal: Proposed map of joint states, imported as if the efforts were torques.
        robot: The robot that moved.
    """
    recording = proposal.recording
    judged = None if recording is None else judge_torques(recording, robot, currents=False)
    if recording is None or judged is None or not judged.meanings:
        why = "the messages do not state it" if judged is None else judged.reason
        return _with_meaning(proposal, None, None, why, tuple(MEANINGS))
    if judged.meanings != (MOTOR_TORQUE,):
        why = f"{judged.reason}, unlike motor currents"
        return _with_meaning(proposal, "torque", _single_meaning(judged), why, judged.meanings)
    weight = weight_of_torques(recording, robot)
    why = judged.reason if weight is None else f"{judged.reason}, and {weight.sentence}"
    if weight is None or not weight.is_drawn:
        return _with_meaning(proposal, None, None, why, (MOTOR_TORQUE, MOTOR_CURRENT))
    if weight.is_plausible:
        return _with_meaning(proposal, "torque", MOTOR_TORQUE, why, (MOTOR_TORQUE,))
    if not _may_be_currents(weight):
        return _with_meaning(proposal, None, None, why, (MOTOR_TORQUE, MOTOR_CURRENT))
    return _add_constants(
        _with_meaning(proposal, "current", MOTOR_CURRENT, why, (MOTOR_CURRENT,)), robot
    )


def _single_meaning(judged: TorqueJudgement) -> TorqueMeaning | None:
    return judged.meanings[0] if len(judged.meanings) == 1 else None


def _may_be_currents(weight: ArmWeight) -> bool:
    """Return True if the efforts are too small for the arm's weight, as currents usually are."""
    return 0.0 < weight.share < weight.plausible[0]


def _with_meaning(
    proposal: Proposal,
    effort: str | None,
    meaning: TorqueMeaning | None,
    why: str,
    possible: tuple[TorqueMeaning, ...],
) -> Proposal:
    """Return a proposal with a quantity and a meaning; None becomes `?`."""
    choice = "; ".join(f"{name}: {MEANINGS[name]}" for name in possible)
    if effort is None:
        doubt = (
            "effort and torques: replace `?` by current and motor_current, or by torque and its"
            f" meaning, because {why} ({choice})"
        )
    elif meaning is None:
        doubt = f"torques: replace `?` by the meaning of the torques, because {why} ({choice})"
    else:
        doubt = f"effort: {effort} and torques: {choice} are assumed, because {why}"
    states = proposal.keys["joint_states"] | {"effort": effort or PLACEHOLDER}
    keys = proposal.keys | {"joint_states": states, "torques": meaning or PLACEHOLDER}
    return replace(proposal, keys=keys, doubts=(*proposal.doubts, doubt))


def _add_constants(proposal: Proposal, robot: RobotDescription) -> Proposal:
    """Return a proposal with `?` for the torque constants that the robot file does not state."""
    without = [each.name for each in robot.joints if each.torque_constant_nm_per_a is None]
    if not without:
        return proposal
    joints = [{"joint": name, CONSTANT: PLACEHOLDER} for name in without]
    states = proposal.keys["joint_states"] | {"joints": joints}
    doubt = (
        f"{CONSTANT} of {', '.join(without)}: neither the file nor the robot file states it;"
        " replace `?` by the torque per ampere at the link"
    )
    keys = proposal.keys | {"joint_states": states}
    return replace(proposal, keys=keys, doubts=(*proposal.doubts, doubt), report=None)
