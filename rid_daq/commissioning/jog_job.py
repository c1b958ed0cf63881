"""Jogging: one joint at a time, or to the home pose, while a key is held."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.hold_to_run.line import Line, LineCheck
from acquisition.runs.manifest import require_label
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from config.ranges import JogPercent, Ranged
from config.robot.robot import RobotDescription
from rid_daq.commissioning.held_run import HeldRun, record_held
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import open_session, require_ready
from rid_daq.session.cells import Simulation
from rid_daq.terminal.choices import JOG_PERCENT
from rid_daq.terminal.console import Console

READY: Final = "Ready: hold the key."
FORTH, BACK, HOME, QUIT, HOLD = "+", "-", "h", "q", " "


@dataclass(frozen=True)
class JogRequest(Ranged):
    """What `rid-daq jog` was asked for.

    Attributes
    ----------
    cell : str
        A bundled name or a cell file.
    runs : Path
        The folder of the run folders.
    home : bool
        Whether the robot goes to its home pose and nowhere else.
    speed_percent : float
        Of each joint's velocity limit.
    label : str
        What to call the run.
    simulation : Simulation
        How a simulated cell is.
    cleared : bool
        Whether a person has cleared the cell.
    practise : bool
        Whether a simulated cell is asked about like a real one.
    """

    cell: str
    runs: Path
    home: bool = False
    speed_percent: JogPercent = JOG_PERCENT
    label: str = "jog"
    simulation: Simulation = field(default_factory=Simulation)
    cleared: bool = False
    practise: bool = False


def jog(request: JogRequest, console: Console) -> RecordedRun:
    """Let a person jog a cell's robot, and record it into a new run folder.

    Raises
    ------
    ConfigError
        The home pose was asked for, and the cell file has none.
    PreflightError
        There is no keyboard, or it was refused before anything moved.
    RidDaqError
        As `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    require_label(request.label)
    home = None if loaded.config.home is None else np.array(loaded.config.home)
    if request.home and home is None:
        raise ConfigError(
            f"cell {loaded.config.name}: has no home pose: name one position a joint in the cell"
            " file, as `home: [0.0, …]`",
            code="RID-CELL-VALUE",
        )
    check = LineCheck(loaded.config, loaded.robot, request.speed_percent / 100.0)
    console.require_keys(simulated=loaded.config.simulated)
    require_ready(
        loaded,
        request.runs,
        console,
        AxisTestRule.HELD,
        cleared=request.cleared,
        practise=request.practise,
    )
    with open_session(
        loaded, request.runs, console, request.simulation, axis_test=AxisTestRule.HELD
    ) as session:
        if request.home:
            assert home is not None
            return record_held(session, console, _homing(request, loaded, home, check, console))
        jogging = Jogging(loaded.robot, home, check, console)
        console.say(jogging.help)
        return record_held(
            session,
            console,
            HeldRun(
                request.label,
                "Jogged by hand.",
                "jog",
                plan=jogging.line,
                tapped=jogging.tapped,
                ready=lambda _pose: console.say(READY),
            ),
        )


def _homing(
    request: JogRequest, loaded: LoadedCell, home: FloatArray, check: LineCheck, console: Console
) -> HeldRun:
    console.say("Hold SPACE to go to the home pose; let go to stop; q ends.")

    def line(key: str, pose: FloatArray) -> Line | None:
        return _said(check(pose, home), "the home pose", console) if key == HOLD else None

    return HeldRun(
        request.label,
        "To the home pose, by hand.",
        "jog",
        plan=line,
        tapped=lambda key: key == QUIT,
        until=home,
        ready=lambda _pose: console.say(READY),
    )


class Jogging:
    """What the keys of a jog mean.

    Parameters
    ----------
    robot : RobotDescription
        Its joints.
    home : ndarray, shape (joints,), or None
        The home pose, where there is one.
    check : LineCheck
        Looks at the lines.
    console : Console
        Where a person reads what is chosen and what stands in the way.
    """

    def __init__(
        self, robot: RobotDescription, home: FloatArray | None, check: LineCheck, console: Console
    ) -> None:
        self._joints = robot.joints
        self._home = home
        self._check = check
        self._console = console
        self._chosen = 0

    @property
    def help(self) -> str:
        """Which keys there are."""
        numbers = ", ".join(f"{i} {each.name}" for i, each in enumerate(self._joints[:9], start=1))
        home = "" if self._home is None else "hold h to go home; "
        return (
            f"Choose a joint: {numbers}. Hold + or - to move it; {home}let go to stop; q ends."
            f" Chosen: {self._joints[self._chosen].name}."
        )

    def tapped(self, key: str) -> bool:
        """Choose a joint; return whether the jog is to end."""
        number = int(key) - 1 if key.isascii() and key.isdigit() else -1
        if 0 <= number < len(self._joints) and number != self._chosen:
            self._chosen = number
            self._console.say(f"Chosen: {self._joints[number].name}.")
        return key == QUIT

    def line(self, key: str, pose: FloatArray) -> Line | None:
        """Return where a held key leads from a pose.

        A page says the joint with the key (`2+`), so that no choice which came late, or from
        another page, has a part in what moves.
        """
        if key == HOME and self._home is not None:
            return _said(self._check(pose, self._home), "the home pose", self._console)
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
        return _said(self._check(pose, wanted), f"{joint.name} {direction}", self._console)


def _said(line: Line, where: str, console: Console) -> Line:
    """Say what a line ends in front of, and return it."""
    if line.is_empty and line.obstacle:
        console.say(f"{where}: no further, {line.obstacle} is in the way.")
    return line
