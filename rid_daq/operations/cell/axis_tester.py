"""Axis test: move one axis at a time while a key is held, and ask a person for the motion seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.hold_to_run.line import HoldLine, LineCheck
from acquisition.journal.cycles import read_journal
from acquisition.runs.manifest import RECORDING
from config.arrays import FloatArray
from config.errors import ConfigError, PreflightError
from config.load import load_cell
from config.robot.robot import RobotDescription
from rid_daq.commissioning.axis_motion import AxisMotion, travelled_fraction
from rid_daq.commissioning.axis_stop import suspected_units
from rid_daq.commissioning.axis_torque import wrong_torque
from rid_daq.commissioning.axis_verdict import (
    AxisVerdict,
    ObservedMotion,
    check_axis_motion,
    parse_amount,
)
from rid_daq.commissioning.axis_words import direction_words, tool_displacement
from rid_daq.commissioning.held_run import HeldRun, record_held
from rid_daq.operations.cell.axes import AxesRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.axis_test import AxisTestRule, axis_test_file, sign_axis
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import Clearance, RunSession, open_session

SPEED_SHARE: Final = 0.02
TURN_RAD: Final = np.deg2rad(2.0)
SHIFT_M: Final = 0.005
LEAST_SHARE: Final = 0.5
"""Least fraction of the planned motion that must be driven before the axis is judged."""

HOLD, QUIT = " ", "q"


@dataclass(frozen=True)
class AxisTestOutcome:
    """Verdicts of an axis test.

    Attributes:
        cell: Name of the cell.
        verdicts: One for each axis that was tested.
        stopped: Last run, if it was stopped or the user ended the test in it; otherwise None.
        signed: File with the axes that have passed; None for a bundled cell.
        suspected: Sentence on the keys that the stop makes doubtful; empty if none is.
    """

    cell: str
    verdicts: Sequence[AxisVerdict]
    stopped: RecordedRun | None
    signed: Path | None
    suspected: str = ""

    @property
    def passed(self) -> bool:
        """True if every requested axis matches the files."""
        return self.stopped is None and all(each.passed for each in self.verdicts)


PositionReader = Callable[[], FloatArray]
"""Function that returns a simulated robot's true joint positions, shape (joints,) [rad or m]."""


def check_axes(request: AxesRequest, context: Context) -> AxisTestOutcome:
    """Test a cell's axes, one after the other, each in its own run folder.

    Raises:
        ConfigError: The cell has no such joint.
        PreflightError: There is no keyboard, the user did not answer, or a check before the motion
            failed.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    names = loaded.robot.joint_names
    unknown = [name for name in request.joints if name not in names]
    if unknown:
        raise ConfigError(
            f"cell {loaded.config.name} has no joint {', '.join(unknown)}; it has"
            f" {', '.join(names)}",
            code="RID-CELL-JOINTS",
        )
    if not request.unattended:
        context.require_keys(simulated=loaded.config.simulated)
    elif not loaded.config.simulated:
        raise PreflightError(
            f"cell {loaded.config.name} is real: the axis test needs a person who holds the key"
            " and watches the robot; leave --unattended out",
            code="RID-KEY-NEEDED",
        )
    verdicts: list[AxisVerdict] = []
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise),
        AxisTestRule.HELD,
        simulation=request.simulation,
    ) as session:
        bench = AxisTester(session, context, request.unattended)
        for name in request.joints or names:
            tested = bench.test(names.index(name))
            if tested is None:
                stopped = bench.last
                suspected = suspected_units(stopped.outcome.stop, name, loaded.config)
                signed = axis_test_file(loaded)
                return AxisTestOutcome(loaded.config.name, verdicts, stopped, signed, suspected)
            verdicts.append(tested)
            context.verdict(tested.passed, tested.sentence)
            if tested.passed:
                sign_axis(loaded, name, bench.last.folder.run_id, request.tester)
    return AxisTestOutcome(loaded.config.name, verdicts, None, axis_test_file(loaded))


class AxisTester:
    """Moves the axes of one cell and asks for the motion that a person saw.

    Args:
        session: Session that controls the cell.
        context: Output for the person.
        unattended: True if the true positions of the simulated robot replace the person's answers.
    """

    last: RecordedRun

    def __init__(self, session: RunSession, context: Context, unattended: bool) -> None:
        self._session = session
        self._robot = session.loaded.robot
        self._context = context
        self._unattended = unattended
        self._check = LineCheck(session.cell, self._robot, SPEED_SHARE)
        self._line: HoldLine | None = None
        self._gave_up = False

    def test(self, number: int) -> AxisVerdict | None:
        """Test one axis; return None if its run was stopped or the person ended the test.

        Raises:
            PreflightError: There is no space for the motion, the person did not answer, or the true
                positions of the simulated robot cannot be read.
            RidDaqError: As raised by `RunSession.recording`.
        """
        name = self._robot.joints[number].name
        while True:
            read_positions = true_position_reader(self._session)
            before = None if read_positions is None else read_positions()
            self.last = self._record_move(number).as_step()
            if self.last.outcome.stop is not None or self._gave_up:
                return None
            line, rows = self._line, self._read_rows()
            if line is not None and travelled_fraction(line, rows, number) >= LEAST_SHARE:
                break
            self._context.say(
                f"{name}: the {self._context.controls.kind} was released too early to judge the"
                " motion; the axis is tested again."
            )
        motion = AxisMotion.of(rows, self._robot, number)
        observed = None
        if read_positions is not None and before is not None:
            moved = read_positions() - before
            observed = visible_motion(self._robot, moved)
            if not self._unattended:
                self._context.say(
                    f"Simulated: {_motion_words(observed, self._robot, before, moved)}."
                )
        if not self._unattended:
            observed = self._ask_motion_seen(motion, number, line)
        if observed is None:
            raise PreflightError(
                f"cell {self._session.cell.name}: this process cannot read the simulated robot's"
                " true positions: leave --unattended out",
                code="RID-CELL-NOT-OURS",
            )
        verdict = check_axis_motion(motion, observed, self._session.cell, self._robot)
        return verdict.with_torque(wrong_torque(rows, self._robot, number))

    def _record_move(self, number: int) -> RecordedRun:
        name = self._robot.joints[number].name

        def line(key: str, pose: FloatArray) -> HoldLine | None:
            return self._line if key == HOLD else None

        def ready(pose: FloatArray) -> None:
            self._line = self._plan_small_move(number, pose)
            amount = self._line.goal[number] - pose[number]
            self._context.say(f"{direction_words(self._robot, pose, number, amount)}.")
            if not self._unattended:
                controls = self._context.controls
                self._context.say(
                    f"Hold {controls.hold} until the axis stops, and watch the robot;"
                    f" {controls.end} ends the test."
                )

        def tapped(key: str) -> bool:
            self._gave_up = self._gave_up or key == QUIT
            return key == QUIT

        return record_held(
            self._session,
            self._context,
            HeldRun(
                label=f"axis test {name}",
                sentence=f"Axis test of {name}.",
                role="axis test",
                plan=line,
                tapped=tapped,
                ready=ready,
                once=True,
                unattended=HOLD if self._unattended else "",
                tested_joint=name,
            ),
        )

    def _plan_small_move(self, number: int, pose: FloatArray) -> HoldLine:
        """Return a small motion of one joint, towards the middle of its range.

        Raises:
            PreflightError: An obstacle leaves too little space.
        """
        joint = self._robot.joints[number]
        middle = 0.5 * (joint.limits.position_min + joint.limits.position_max)
        size = TURN_RAD if joint.type == "revolute" else SHIFT_M
        goal = pose.copy()
        goal[number] += size if pose[number] <= middle else -size
        line = self._check(pose, goal)
        if abs(line.goal[number] - pose[number]) < LEAST_SHARE * size:
            raise PreflightError(
                f"{joint.name}: {line.obstacle} prevents a motion of {size:.3g} {joint.unit}: move"
                " the robot to a free pose with `rid-daq jog`",
                code="RID-POSE-OUTSIDE",
            )
        return line

    def _read_rows(self) -> NDArray[Any]:
        return read_journal(self.last.folder.file(RECORDING)).rows

    def _ask_motion_seen(self, motion: AxisMotion, number: int, line: HoldLine) -> ObservedMotion:
        """Ask a person which motion was visible.

        Raises:
            PreflightError: The user did not answer.
        """
        names = self._robot.joint_names

        def which(text: str) -> str:
            word = text.strip()  # the held SPACE key may have typed spaces before the answer
            if word not in ("+", "-", "0", *names):
                raise ConfigError("answer +, -, 0 or a joint's name", code="RID-AXIS-TEST-ANSWER")
            return word

        way = self._context.ask(
            f"How did {motion.joint} move?",
            which,
            [
                ("As announced", "+"),
                ("In the opposite direction", "-"),
                ("Nothing moved", "0"),
                *((f"{name} moved", name) for name in names if name != motion.joint),
            ],
        )
        if way == "0":
            return ObservedMotion("")
        if way in names and way != motion.joint:
            return ObservedMotion(way, motion.commanded)
        tool_m = float(
            np.linalg.norm(
                tool_displacement(
                    self._robot, line.start, number, line.goal[number] - line.start[number]
                )
            )
        )

        amount = self._context.ask(
            f"By about how much, in {motion.unit}"
            + (", or in mm of the tool point (example: 24mm)?" if motion.unit == "°" else "?"),
            lambda text: parse_amount(text, motion, 1e3 * tool_m),
        )
        sign = -1.0 if way == "-" else 1.0
        return ObservedMotion(motion.joint, sign * amount * np.sign(motion.commanded))


def visible_motion(robot: RobotDescription, moved: FloatArray) -> ObservedMotion:
    """Return the visible motion if the joints move by `moved`, (joints,) [rad or m].

    It is that of the joint that moves most; none if that is less than 5 % of a test motion.
    """
    size = np.array(
        [TURN_RAD if joint.type == "revolute" else SHIFT_M for joint in robot.joints], dtype=float
    )
    most = int(np.argmax(np.abs(moved) / size))
    if abs(moved[most]) < 0.05 * size[most]:
        return ObservedMotion("")
    joint = robot.joints[most]
    per = np.rad2deg(1.0) if joint.type == "revolute" else 1e3
    return ObservedMotion(joint.name, float(per * moved[most]))


def true_position_reader(session: RunSession) -> PositionReader | None:
    """Return a reader of a simulated robot's true positions; None if they cannot be read."""
    cell = session.cell
    if not cell.simulated:
        return None
    if session.simulated is not None:
        simulated = session.simulated
        return lambda: simulated.axes().position
    from mock_hw.bus.served_bus import served_name
    from mock_hw.host.runtime_directory import axes_path
    from mock_hw.plant.snapshot import SnapshotReader

    path = axes_path(served_name(cell))
    if not path.exists():
        return None
    return lambda: SnapshotReader(path).read().position


def _motion_words(
    observed: ObservedMotion, robot: RobotDescription, before: FloatArray, moved: FloatArray
) -> str:
    if not observed.joint:
        return "nothing moved"
    number = robot.joint_names.index(observed.joint)
    return direction_words(robot, before, number, float(moved[number]), over=True)
