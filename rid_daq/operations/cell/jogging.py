"""`JogKeys`: move one joint at a time, or go to the home pose, while a key is held."""

from __future__ import annotations

import numpy as np

from acquisition.hold_to_run.line import HoldLine, LineCheck
from acquisition.runs.manifest import require_label
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from config.robot.robot import RobotDescription
from rid_daq.commissioning.held_run import HeldRun, record_held
from rid_daq.operations.cell.jog import JogRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import Clearance, open_session
from rid_daq.terminal.context import KEYS

FORTH, BACK, HOME, QUIT, HOLD = "+", "-", "h", "q", " "


def jog(request: JogRequest, context: Context) -> RecordedRun:
    """Let a person jog a cell's robot, and record the motion into a new run folder.

    Raises:
        ConfigError: The request asks for the home pose, and the cell file has none.
        PreflightError: There is no keyboard, or a check before the motion failed.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    require_label(request.label)
    home = None if loaded.config.home is None else np.array(loaded.config.home)
    if request.home and home is None:
        raise ConfigError(
            f"cell {loaded.config.name} has no home pose: add one to the cell file, with one"
            " position per joint, as `home: [0.0, …]`",
            code="RID-CELL-VALUE",
        )
    check = LineCheck(loaded.config, loaded.robot, request.speed_percent / 100.0)
    context.require_keys(simulated=loaded.config.simulated)
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise),
        AxisTestRule.HELD,
        simulation=request.simulation,
    ) as session:
        if request.home:
            assert home is not None
            return record_held(session, context, _home_run(request, loaded, home, check, context))
        jogging = JogKeys(loaded.robot, home, check, context)
        if context.controls is KEYS:
            context.say(jogging.help)
        return record_held(
            session,
            context,
            HeldRun(
                request.label,
                "Manual motion (jog).",
                "jog",
                plan=jogging.line,
                tapped=jogging.tapped,
                ready=lambda _pose: _say_ready(context),
            ),
        )


def _home_run(
    request: JogRequest, loaded: LoadedCell, home: FloatArray, check: LineCheck, context: Context
) -> HeldRun:
    controls = context.controls
    context.say(
        f"Hold {controls.hold} to go to the home pose, release it to stop; {controls.end} ends."
    )

    def line(key: str, pose: FloatArray) -> HoldLine | None:
        return (
            _with_obstacle_message(check(pose, home), "the home pose", context)
            if key == HOLD
            else None
        )

    return HeldRun(
        request.label,
        "Manual motion to the home pose.",
        "jog",
        plan=line,
        tapped=lambda key: key == QUIT,
        until=home,
        ready=lambda _pose: _say_ready(context),
    )


def _say_ready(context: Context) -> None:
    context.say(f"Ready: hold the {context.controls.kind}.")


class JogKeys:
    """Meaning of each key while a person jogs a robot.

    Args:
        robot: Robot with the joints to move.
        home: Shape (joints,). The home pose; None if the cell has none.
        check: Shortens a path so that it ends before limits and obstacles.
        context: Output for the person: the chosen joint and obstacles.
    """

    def __init__(
        self, robot: RobotDescription, home: FloatArray | None, check: LineCheck, context: Context
    ) -> None:
        self._joints = robot.joints
        self._home = home
        self._check = check
        self._context = context
        self._chosen = 0

    @property
    def help(self) -> str:
        """Sentences that list the keys and name the chosen joint."""
        numbers = ", ".join(f"{i} {each.name}" for i, each in enumerate(self._joints[:9], start=1))
        home = "" if self._home is None else "hold h to go to the home pose; "
        return (
            f"Choose a joint: {numbers}. Hold + or - to move it; {home}release the key to stop; q"
            f" ends. Chosen: {self._joints[self._chosen].name}."
        )

    def tapped(self, key: str) -> bool:
        """Choose a joint by its digit; return True if the key ends the jog."""
        number = int(key) - 1 if key.isascii() and key.isdigit() else -1
        if 0 <= number < len(self._joints) and number != self._chosen:
            self._chosen = number
            self._context.say(f"Chosen: {self._joints[number].name}.")
        return key == QUIT

    def line(self, key: str, pose: FloatArray) -> HoldLine | None:
        """Return the path from a pose that a held key asks for; None if the key moves nothing.

        A page sends the joint's number with the key (`2+`). A choice that arrives late, or comes
        from another page, can therefore not change the joint that moves.
        """
        if key == HOME and self._home is not None:
            return _with_obstacle_message(
                self._check(pose, self._home), "the home pose", self._context
            )
        named, direction = key[:-1], key[-1:]
        if direction not in (FORTH, BACK) or not (named.isascii() and (named or "1").isdigit()):
            return None
        number = int(named) - 1 if named else self._chosen
        if not 0 <= number < len(self._joints):
            return None
        joint = self._joints[number]
        wanted = pose.copy()
        limits = joint.limits
        wanted[number] = limits.position_max if direction == FORTH else limits.position_min
        return _with_obstacle_message(
            self._check(pose, wanted), f"{joint.name} {direction}", self._context
        )


def _with_obstacle_message(line: HoldLine, where: str, context: Context) -> HoldLine:
    """Return the path; if it cannot begin, report the obstacle."""
    if line.is_empty and line.obstacle:
        context.say(f"{where}: the robot cannot move further: {line.obstacle} is in the way.")
    return line
