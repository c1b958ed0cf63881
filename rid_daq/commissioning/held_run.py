"""`record_held`: record a run that moves only while a key is held."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from acquisition.hold_to_run.dead_man import DeadMan
from acquisition.hold_to_run.dead_man_thread import (
    AlwaysHeldKey,
    DeadManThread,
    KeySource,
    LinePlanner,
)
from acquisition.hold_to_run.held_motion import HeldMotion
from acquisition.session.outcome import RecordOutcome
from config.arrays import FloatArray
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import Record, RunRequest
from rid_daq.recording.run_session import RunSession
from rid_daq.terminal.context import Context


@dataclass(frozen=True, eq=False)
class HeldRun:
    """Definition of a run that moves only while a key is held.

    Attributes:
        label: Name of the run.
        sentence: Sentence on the motion, for the report.
        role: Purpose of the run.
        plan: Function that returns the path on which a held key moves the robot.
        tapped: Function that is called with every pressed key; the run ends if it returns True.
        ready: Function that is called with the pose whenever the robot rests and waits for a key.
        once: True if the run ends after the first press.
        until: Shape (joints,). Pose that ends the run when the robot rests there [rad or m].
        unattended: Key that counts as held all the time, for a simulated cell without a person;
            empty if a person holds keys.
        tested_joint: Joint that moves in an axis test; None in other motions.
    """

    label: str
    sentence: str
    role: str
    plan: LinePlanner
    tapped: Callable[[str], bool] = lambda _key: False
    ready: Callable[[FloatArray], None] = lambda _pose: None
    once: bool = False
    until: FloatArray | None = None
    unattended: str = ""
    tested_joint: str | None = None


def record_held(session: RunSession, context: Context, definition: HeldRun) -> RecordedRun:
    """Record a run that moves only while a key is held.

    Raises:
        PreflightError: There is no keyboard, or `RunSession.recording` raises this error.
        RidDaqError: Any other error of `RunSession.recording`.
    """
    robot = session.loaded.robot
    dead_man = DeadMan.create()
    motion = HeldMotion(
        session.cell,
        robot,
        dead_man,
        once=definition.once,
        unattended=bool(definition.unattended),
    )

    def drive(record: Record) -> RecordOutcome:
        with (
            _open_keys(context, definition, dead_man) as keys,
            DeadManThread(
                dead_man,
                len(robot.joints),
                keys,
                definition.plan,
                definition.until,
                definition.ready,
            ),
        ):
            return record(motion)

    # the run is recorded without the force plate, whose amplifier may still be in reset
    bare = replace(session, cell=session.cell.model_copy(update={"plate": None}))
    request = RunRequest(
        definition.label,
        definition.sentence,
        None,
        drive,
        role=definition.role,
        held=True,
        tested_joint=definition.tested_joint,
    )
    return bare.record(request)


@contextlib.contextmanager
def _open_keys(context: Context, definition: HeldRun, dead_man: DeadMan) -> Iterator[KeySource]:
    if definition.unattended:
        yield AlwaysHeldKey(definition.unattended)
        return

    def tapped(key: str) -> None:
        if definition.tapped(key):
            dead_man.finish()

    with context.keys(tapped) as keys:
        yield keys
