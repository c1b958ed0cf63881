"""Time from a fault to the quick stop, in real time: `python -m benchmarks.reactions`.

A simulated cell and the whole program run in real time. Faults occur repeatedly, at times that the
program does not know. The reaction time is measured in the log of the simulated bus: from the frame
that is faulty (or the unanswered SYNC, or the interrupt) until the last axis's quick stop.

Then 1,000 emergency messages a second are sent, which do not stop the motion. The lateness of the
cycles is compared with and without these messages (p99 of windows of 2 s, lower quartile).

`--rounds N` sets how often each fault occurs (default: 25); `--quick` uses 3 occurrences and sends
emergency messages for a shorter time.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from can.io import CanutilsLogReader
from numpy.typing import NDArray

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.states import TaskProgress
from benchmarks.lateness import calm_p99
from config.load import LoadedCell, load_cell
from config.simulation.faults import DriveFault, FaultScript, FrameFault
from drivers.canopen.frames import (
    SYNC_COB_ID,
    emcy_cob_id,
    heartbeat_cob_id,
    rpdo_cob_id,
    tpdo_cob_id,
)
from drivers.cell import open_cell
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.cell import SimulatedCell
from mock_hw.host.device_process import request_exact_timing
from mock_hw.simulation import CellSimulation

EVERY_S: Final = 9.0
"""Time between two faults; long enough for the next session to start its motion."""

MOTION_S: Final = 60.0
SHARE_BAR, FLOOD_BAR = 0.99, 1.2
QUICK_STOP: Final = b"\x02\x00"
NO_ERROR: Final = bytes(8)
FLOOD_PER_S: Final = 1000
FLOOD_MOTIONS: Final = 3
CALM_S: Final = 2.0
FLOODED: Final = 2
"""Node id in the emergency messages that flood the bus."""


@dataclass(frozen=True)
class Frame:
    """A frame on the wire, with its time [s]."""

    time_s: float
    cob_id: int
    data: bytes


Mark = Callable[[list[Frame]], float]
"""Function of the frames in the last second before the quick stop: the time of the fault [s]."""


@dataclass(frozen=True)
class Kind:
    """A fault, its trace on the wire, and the time allowed until the quick stop.

    Attributes:
        name: Description of the fault.
        mark: Function that finds the time of the fault in the frames.
        cycles: Time allowed from the detection until the last axis's quick stop [cycles]; see
            docs/faults.md.
        waits_s: Additional time allowed from the fault until its detection [s].
    """

    name: str
    mark: Mark
    cycles: float
    waits_s: float = 0.0


def _last(cob_id: int) -> Mark:
    return lambda frames: [frame.time_s for frame in frames if frame.cob_id == cob_id][-1]


def _unanswered(cob_id: int) -> Mark:
    """Return a function for the time of the first SYNC after a drive's last answer."""
    answered = _last(cob_id)
    return lambda frames: next(
        frame.time_s
        for frame in frames
        if frame.cob_id == SYNC_COB_ID and frame.time_s > answered(frames)
    )


def _kinds(loaded: LoadedCell) -> dict[StopCode, Kind]:
    silence_s = 1e-3 * loaded.config.drive_safety.drive_heartbeat_timeout_ms
    one, two, three = (axis.node_id for axis in loaded.config.axes)
    return {
        StopCode.EMERGENCY: Kind("an emergency message", _last(emcy_cob_id(one)), 2.0),
        StopCode.DRIVE_RESTARTED: Kind("a drive boots", _last(heartbeat_cob_id(three)), 2.0),
        StopCode.MISSED_FRAMES: Kind("three answers are lost", _unanswered(tpdo_cob_id(one)), 4.0),
        StopCode.HEARTBEAT_LOST: Kind(
            "a heartbeat ends", _last(heartbeat_cob_id(two)), 1.0, silence_s
        ),
    }


def _script(rounds: int, names: tuple[str, ...]) -> FaultScript:
    one, two, three = names
    bus: list[FrameFault] = []
    drives: list[DriveFault] = []
    times_s = iter(EVERY_S * (1.0 + k) for k in range(4 * rounds))
    for _ in range(rounds):
        drives.append(DriveFault(kind="emergency", joint=one, at_s=next(times_s)))
        bus.append(FrameFault(kind="drop", joint=one, at_s=next(times_s), count=3))
        drives.append(DriveFault(kind="reset", joint=three, at_s=next(times_s)))
        drives.append(
            DriveFault(kind="heartbeat_stops", joint=two, at_s=next(times_s), duration_s=2.0)
        )
    return FaultScript(bus=tuple(bus), drives=tuple(drives))


@dataclass(frozen=True)
class Session:
    """A stopped motion: its time span by the log's clock [s], its stop and the interrupt's time."""

    begun_s: float
    ended_s: float
    code: StopCode
    text: str
    asked_s: float = 0.0


class Bench:
    """The simulated cell and the motion that it repeats."""

    def __init__(self, loaded: LoadedCell, simulated: SimulatedCell, folder: Path) -> None:
        self._loaded, self._simulated, self._folder = loaded, simulated, folder
        robot = loaded.robot
        motion = FourierMotion(
            kind="fourier",
            robot=robot.name,
            period_s=2.0,
            periods=round(MOTION_S / 2.0),
            ramp_s=1.0,
            joints=tuple(
                FourierJoint(joint=name, sine=(0.2,), cosine=(0.1,)) for name in robot.joint_names
            ),
        )
        self._samples: MotionSamples = motion.plan(robot, loaded.config.cycle_time_s)

    def move(self, on_progress: Callable[[TaskProgress], None] | None = None) -> RecordOutcome:
        """Run the motion until it ends or is stopped."""
        run = RunFolder.create(self._folder, "reactions")
        cell, robot = self._simulated.cell, self._loaded.robot
        return record_motion(cell, robot, self._samples, run, on_progress=on_progress)

    def session(self, interrupted_after_s: float | None = None) -> Session:
        """Run the motion until a fault stops it, or interrupt it after a given time."""
        asked: list[float] = []
        main_s: list[float] = []

        def interrupt(progress: TaskProgress) -> None:
            if progress.phase is not Phase.MAIN or asked or interrupted_after_s is None:
                return
            main_s.append(time.monotonic())
            if time.monotonic() - main_s[0] > interrupted_after_s:
                asked.append(time.time())
                os.kill(os.getpid(), signal.SIGINT)

        begun_s = time.time()
        outcome = self.move(interrupt)
        if outcome.stop is None:
            raise SystemExit(f"no fault stopped the motion of {MOTION_S:g} s")
        if outcome.interrupted_by is not None and not asked:
            raise SystemExit(128 + outcome.interrupted_by)
        with open_cell(self._simulated.cell, self._loaded.robot) as opened:
            opened.axes.service.reset_faults()
        stop = outcome.stop
        return Session(begun_s, time.time(), stop.code, stop.text, asked[0] if asked else 0.0)


def reactions(log: Path, sessions: list[Session], loaded: LoadedCell) -> dict[str, list[float]]:
    """Return the reaction times as fractions of the allowed time, for each fault."""
    kinds, cycle_s = _kinds(loaded), loaded.config.cycle_time_s
    commands = {rpdo_cob_id(axis.node_id) for axis in loaded.config.axes}
    found: dict[str, list[float]] = {}
    frames = iter(_read_log(log))
    for session in sessions:
        seen: list[Frame] = []
        stops: dict[int, float] = {}
        for frame in frames:
            if frame.time_s > session.ended_s:
                break
            if frame.time_s < session.begun_s:
                continue
            if frame.cob_id in commands and frame.data.startswith(QUICK_STOP):
                stops.setdefault(frame.cob_id, frame.time_s)
            elif not stops:
                seen.append(frame)
        if session.code is StopCode.INTERRUPTED:
            name, mark_s, allowed_s = "Ctrl-C", session.asked_s, 2.0 * cycle_s
        elif session.code in kinds:
            kind = kinds[session.code]
            first_s = min(stops.values())
            latest = [frame for frame in seen if frame.time_s > first_s - 1.0]
            name, mark_s = kind.name, kind.mark(latest)
            allowed_s = kind.waits_s + kind.cycles * cycle_s
        else:
            continue
        if set(stops) != commands:
            raise SystemExit(f"{name}: only {len(stops)} axes received a quick stop")
        found.setdefault(name, []).append((max(stops.values()) - mark_s) / allowed_s)
    return found


def _read_log(log: Path) -> Iterator[Frame]:
    for message in CanutilsLogReader(log):
        yield Frame(message.timestamp, message.arbitration_id, bytes(message.data))


def flood(channel: Path, pipe: Connection) -> None:
    """Send "no error" emergency messages while the pipe permits it; main function of a process."""
    client = HubClient(channel, HubRole.DEVICE)
    request_exact_timing(realtime=True)
    step_ns = 10**9 // FLOOD_PER_S
    flooding = False
    pipe.send(None)
    next_ns = time.monotonic_ns()
    while True:
        while pipe.poll(0):
            word = pipe.recv()
            if word is None:
                client.close()
                return
            flooding = word
            pipe.send(None)
        time.sleep(max(0.0, 1e-9 * (next_ns - time.monotonic_ns())))
        next_ns = max(next_ns, time.monotonic_ns())  # send no burst after a delay
        for _ in range(10):
            next_ns += step_ns
            if flooding:
                client.post(emcy_cob_id(FLOODED), NO_ERROR, len(NO_ERROR), 99, next_ns)
        client.wait(0)


def lateness(bench: Bench, channel: Path, segment_s: float) -> tuple[NDArray[np.float64], ...]:
    """Return the lateness of the cycles [s] with and without the flood of emergency messages."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=flood, args=(channel, theirs), daemon=True)
    process.start()
    ours.recv()
    spans: list[tuple[float, bool]] = []

    def change(progress: TaskProgress) -> None:
        now_s = time.monotonic()
        if progress.phase is Phase.MAIN and (not spans or now_s - spans[-1][0] > segment_s):
            there = bool(spans) and not spans[-1][1]
            ours.send(there)
            ours.recv()
            spans.append((time.monotonic(), there))

    outcome = bench.move(change)
    ours.send(None)
    process.join()
    if outcome.stop is not None:
        print(f"the motion was stopped: {outcome.stop.text}")
    rows = read_journal(outcome.path).rows
    with_flood = np.zeros(len(rows), dtype=bool)
    without = np.zeros(len(rows), dtype=bool)
    for (begin_s, there), (end_s, _) in pairwise([*spans, (math.inf, False)]):
        inside = (rows["time_s"] > begin_s + 0.1) & (rows["time_s"] < end_s)
        (with_flood if there else without)[inside] = True
    return rows["lateness_s"][with_flood], rows["lateness_s"][without]


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    rounds = 3 if given.quick else given.rounds
    loaded = load_cell("ir361")
    assert loaded.plant is not None
    config = loaded.config.model_copy(update={"plate": None, "monitor": None})
    rng = np.random.default_rng(1)
    with TemporaryDirectory(prefix="rid-reactions-") as name:
        folder = Path(name)
        log = folder / "frames.log"
        with SimulatedCell(
            CellSimulation(
                config,
                loaded.robot,
                loaded.plant,
                realtime=True,
                seed=1,
                log=log,
                faults=_script(rounds, loaded.robot.joint_names),
            )
        ) as simulated:
            loaded = replace(loaded, config=config)
            bench = Bench(loaded, simulated, folder)
            until_s = time.monotonic() + EVERY_S * 4 * rounds
            sessions = []
            while time.monotonic() < until_s:
                sessions.append(bench.session())
                print(f"{sessions[-1].code.name}: {sessions[-1].text}", flush=True)
            sessions += [bench.session(float(rng.uniform(0.1, 0.5))) for _ in range(rounds)]
            channel = Path(simulated.channel)
            runs = [
                lateness(bench, channel, 4.0) for _ in range(1 if given.quick else FLOOD_MOTIONS)
            ]
            flooded, quiet = (np.concatenate(each) for each in zip(*runs, strict=True))
        found = reactions(log, sessions, loaded)
    shares = np.concatenate(list(found.values()))
    for name, shares_of in found.items():
        print(
            f"{name}, {len(shares_of)} times: quick stop of the last axis after"
            f" {100 * np.median(shares_of):.0f} % of the allowed time in the median,"
            f" {100 * max(shares_of):.0f} % at most"
        )
    counted = set(found)
    own = Counter(s.code.name for s in sessions if s.code not in _kinds(loaded) and not s.asked_s)
    if own:
        print(f"other stops, caused by this computer's own delays: {dict(own)}")
    window = round(CALM_S / config.cycle_time_s)
    if min(len(flooded), len(quiet)) < window:
        raise SystemExit(
            "the motions with the flood of emergency messages were too short for a comparison"
        )
    late, late_quiet = (1e6 * calm_p99(each, window) for each in (flooded, quiet))
    print(
        f"cycles begin late by {late:.0f} us (p99 of calm {CALM_S:g} s) with {FLOOD_PER_S}"
        f" emergency messages a second, by {late_quiet:.0f} us without; of all {len(flooded)} and"
        f" {len(quiet)} cycles {1e6 * np.quantile(flooded, 0.99):.0f} and"
        f" {1e6 * np.quantile(quiet, 0.99):.0f} us"
    )
    within = float(np.mean(shares <= 1.0))
    ratio = late / late_quiet
    holds = within >= SHARE_BAR and ratio <= FLOOD_BAR and len(counted) == 5
    result = {
        "name": "reactions",
        "value": round(float(np.quantile(shares, 0.99)), 3),
        "unit": "fraction of the allowed reaction time, p99",
        "reactions": len(shares),
        "within": round(within, 4),
        "ratios": {"p99 lateness with the flood of messages over that without": round(ratio, 2)},
        "bar": f"{SHARE_BAR:.0%} of all reactions within the time that is allowed; a flood makes"
        f" the lateness of cycles at most {FLOOD_BAR:g} times larger (p99)",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
