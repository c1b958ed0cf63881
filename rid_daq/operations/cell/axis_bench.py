"""The axis test: one axis at a time, moved by a little while a key is held, and looked at."""

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
from rid_daq.commissioning.axis_motion import AxisMotion, travelled
from rid_daq.commissioning.axis_verdict import AxisVerdict, Seen, judge_axis, parse_amount
from rid_daq.commissioning.axis_words import direction_words, tool_way
from rid_daq.commissioning.held_run import HeldRun, record_held
from rid_daq.operations.cell.axes import AxesRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.axis_test import AxisTestRule, axis_test_file, sign_axis
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import Clearance, RunSession, open_session

SPEED_SHARE: Final = 0.02
TURN: Final = np.deg2rad(2.0)
SHIFT_M: Final = 0.005
ENOUGH: Final = 0.5
"""Which share of the way must be driven to be judged."""

HOLD, QUIT = " ", "q"


@dataclass(frozen=True)
class AxesTested:
    """Verdicts of an axis test.

    Attributes:
        cell: The cell's name.
        verdicts: One an axis that was tested.
        stopped: The run that was stopped, after which no axis was tested.
        signed: Where the axes that passed are signed; None for a bundled cell.
    """

    cell: str
    verdicts: Sequence[AxisVerdict]
    stopped: RecordedRun | None
    signed: Path | None

    @property
    def passed(self) -> bool:
        """Whether every axis that was asked for does what the files say."""
        return self.stopped is None and all(each.passed for each in self.verdicts)


Eyes = Callable[[], FloatArray]
"""Returns where the joints of a simulated robot really are, (joints,) [rad or m]."""


def check_axes(request: AxesRequest, context: Context) -> AxesTested:
    """Test a cell's axes, one after the other, each in a run folder of its own.

    Raises:
        ConfigError: The cell has no such joint.
        PreflightError: There is no keyboard, nobody answered, or it was refused before anything
            moved.
        RidDaqError: As `RunSession.recording`.
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
            f"cell {loaded.config.name} is real: somebody must hold the key and look at the robot",
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
        bench = AxisBench(session, context, request.unattended)
        for name in request.joints or names:
            tested = bench.test(names.index(name))
            if tested is None:
                return AxesTested(loaded.config.name, verdicts, bench.last, axis_test_file(loaded))
            verdicts.append(tested)
            context.verdict(tested.passed, tested.sentence)
            if tested.passed:
                sign_axis(loaded, name, bench.last.folder.run_id, request.tester)
    return AxesTested(loaded.config.name, verdicts, None, axis_test_file(loaded))


class AxisBench:
    """Moves the axes of one cell and asks what was seen.

    Args:
        session: The cell.
        context: Where a person reads what will move.
        unattended: Whether the simulated robot's truth is the answer.
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
        """Test one axis; return None where its run was stopped, or a person gave up."""
        name = self._robot.joints[number].name
        while True:
            eyes = simulated_eyes(self._session)
            before = None if eyes is None else eyes()
            self.last = self._move(number).as_step()
            if self.last.outcome.stop is not None or self._gave_up:
                return None
            line, rows = self._line, self._rows()
            if line is not None and travelled(line, rows, number) >= ENOUGH:
                break
            self._context.say(f"{name}: the key was let go too early; once more.")
        motion = AxisMotion.of(rows, self._robot, number)
        seen = None
        if eyes is not None and before is not None:
            moved = eyes() - before
            seen = seen_by(self._robot, moved)
            if not self._unattended:
                self._context.say(f"Simulated: {_as_words(seen, self._robot, before, moved)}.")
        if not self._unattended:
            seen = self._answered(motion, number, line)
        if seen is None:
            raise PreflightError(
                f"cell {self._session.cell.name}: its axes cannot be seen here: leave --unattended"
                " out",
                code="RID-CELL-NOT-OURS",
            )
        return judge_axis(motion, seen, self._session.cell, self._robot)

    def _move(self, number: int) -> RecordedRun:
        name = self._robot.joints[number].name

        def line(key: str, pose: FloatArray) -> HoldLine | None:
            return self._line if key == HOLD else None

        def ready(pose: FloatArray) -> None:
            self._line = self._small(number, pose)
            amount = self._line.goal[number] - pose[number]
            self._context.say(f"{direction_words(self._robot, pose, number, amount)}.")
            if not self._unattended:
                self._context.say("Hold SPACE until it rests, and look; q ends the test.")

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
            ),
        )

    def _small(self, number: int, pose: FloatArray) -> HoldLine:
        """Return a small way of one joint, towards the middle of its range.

        Raises:
            PreflightError: There is no room for it.
        """
        joint = self._robot.joints[number]
        middle = 0.5 * (joint.limits.position_min + joint.limits.position_max)
        size = TURN if joint.type == "revolute" else SHIFT_M
        goal = pose.copy()
        goal[number] += size if pose[number] <= middle else -size
        line = self._check(pose, goal)
        if abs(line.goal[number] - pose[number]) < ENOUGH * size:
            raise PreflightError(
                f"{joint.name}: {line.obstacle} is in the way of {size:.3g} rad or m: `rid-daq jog`"
                " leads the robot to where there is room",
                code="RID-POSE-OUTSIDE",
            )
        return line

    def _rows(self) -> NDArray[Any]:
        return read_journal(self.last.folder.file(RECORDING)).rows

    def _answered(self, motion: AxisMotion, number: int, line: HoldLine) -> Seen:
        """Ask a person what was seen.

        Raises:
            PreflightError: Nobody answered.
        """
        names = self._robot.joint_names

        def which(text: str) -> str:
            word = text.strip()  # SPACE was held
            if word not in ("+", "-", "0", *names):
                raise ConfigError("answer +, -, 0 or a joint's name", code="RID-AXIS-TEST-ANSWER")
            return word

        way = self._context.ask(
            f"Did {motion.joint} move as was said (+), the other way (-), did nothing move (0), or"
            " another joint (its name)?",
            which,
            [
                ("As was said", "+"),
                ("The other way", "-"),
                ("Nothing moved", "0"),
                *((f"{name} moved", name) for name in names if name != motion.joint),
            ],
        )
        if way == "0":
            return Seen("")
        if way in names and way != motion.joint:
            return Seen(way, motion.commanded)
        tool_m = float(
            np.linalg.norm(
                tool_way(self._robot, line.start, number, line.goal[number] - line.start[number])
            )
        )

        amount = self._context.ask(
            f"By about how much, in {motion.unit}"
            + (", or in mm of the tool point (24mm)?" if motion.unit == "°" else "?"),
            lambda text: parse_amount(text, motion, 1e3 * tool_m),
        )
        sign = -1.0 if way == "-" else 1.0
        return Seen(motion.joint, sign * amount * np.sign(motion.commanded))


def seen_by(robot: RobotDescription, moved: FloatArray) -> Seen:
    """Return what eyes would have seen of how far joints moved, (joints,) [rad or m]."""
    size = np.array(
        [TURN if joint.type == "revolute" else SHIFT_M for joint in robot.joints], dtype=float
    )
    most = int(np.argmax(np.abs(moved) / size))
    if abs(moved[most]) < 0.05 * size[most]:
        return Seen("")
    joint = robot.joints[most]
    per = np.rad2deg(1.0) if joint.type == "revolute" else 1e3
    return Seen(joint.name, float(per * moved[most]))


def simulated_eyes(session: RunSession) -> Eyes | None:
    """Return what sees where a simulated robot really is; None where that cannot be seen."""
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


def _as_words(seen: Seen, robot: RobotDescription, before: FloatArray, moved: FloatArray) -> str:
    if not seen.joint:
        return "nothing moved"
    number = robot.joint_names.index(seen.joint)
    return direction_words(robot, before, number, float(moved[number]), over=True)
