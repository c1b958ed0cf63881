"""A simulated cell in lock-step within the test's process: hub, drives, plant and cyclic task.

Frames of the master go through the hub's socket and its simulated bus, as between processes. Tests
check the frames on the bus and the motion of the simulated axes.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.set_points import PlannedMotion
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.errors import RidDaqError, TransportError
from config.load import LoadedCell, load_cell
from config.simulation.faults import NO_SCRIPT, FaultScript
from drivers.canopen.frames import NMT_COB_ID, SYNC_COB_ID, sdo_request_cob_id
from drivers.cell import Cell, open_cell
from mock_hw.bus.embedded_client import EmbeddedClient
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import listening_socket
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.host.fault_clock import controlword_places
from mock_hw.rack import DriveRack
from mock_hw.rack_loop import RackLoop

T = 0.008
QUICK_STOP, ENABLE, DISABLE = 0x0002, 0x000F, 0x0000
RPDO, TPDO = 0x200, 0x180
NODES = (1, 2, 3)


class Logged(NamedTuple):
    """A frame on the bus, and the time at which its transmission ended [s]."""

    time_s: float
    can_id: int
    data: bytes

    @property
    def word(self) -> int:
        """The controlword of a command."""
        return int.from_bytes(self.data[:2], "little")

    @property
    def velocity(self) -> int:
        """The target velocity of a command, 60FFh, as it is on the bus."""
        return int.from_bytes(self.data[2:6], "little", signed=True)


def parse_log(text: str) -> list[Logged]:
    """Return the frames of a log in candump's format, without remote frames."""
    frames = []
    for line in text.splitlines():
        time_text, _, frame = line.split(" ")
        identifier, data = frame.split("#")
        if not data.startswith("R"):
            frames.append(Logged(float(time_text[1:-1]), int(identifier, 16), bytes.fromhex(data)))
    return frames


class Truth:
    """True motion of the simulated axes over time; the simulation calls `write` in every step."""

    def __init__(self) -> None:
        self.payload = 0
        self.time_s: list[float] = []
        self.position: list[NDArray[np.float64]] = []
        self.velocity: list[NDArray[np.float64]] = []
        self.powered: list[list[bool]] = []

    def write(
        self,
        time_s: float,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        _torque: object,
        powered: list[bool],
        _temperature: object,
    ) -> None:
        self.time_s.append(time_s)
        self.position.append(np.array(position))
        self.velocity.append(np.array(velocity))
        self.powered.append(list(powered))

    def speed_after(self, time_s: float) -> float:
        """Return the largest speed of any axis from a time on [rad/s]."""
        after = [v for t, v in zip(self.time_s, self.velocity, strict=True) if t >= time_s]
        return float(np.abs(after).max())

    def rest_s(self, slow: float = 1e-3) -> float:
        """Return the time after which all axes stay slower than `slow` [s]; infinite if never."""
        fast = [i for i, v in enumerate(self.velocity) if np.abs(v).max() > slow]
        return self.time_s[fast[-1] + 1] if fast[-1] + 1 < len(self.time_s) else float("inf")

    def at(self, time_s: float) -> int:
        """Return the index of the first state at or after a time [s]."""
        return int(np.searchsorted(self.time_s, time_s))


@dataclass
class Run:
    """Outcome of one motion."""

    reason: StopReason | None
    rows: NDArray[Any]
    notes: tuple[str, ...]
    frames: list[Logged]
    truth: Truth
    error: RidDaqError | None = None
    syncs_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        enabled = next((f.time_s for f in self.frames if _is(f, ENABLE)), float("inf"))
        self.syncs_s = [f.time_s for f in self.frames if f.can_id == 0x80 and f.time_s > enabled]

    def cycle(self, time_s: float) -> int:
        """Return the number of the cycle that contains a time, counted as in fault scripts."""
        return int(np.searchsorted(self.syncs_s, time_s, side="right"))

    def quick_stops(self) -> dict[int, float]:
        """Return the time of the first quick stop on the bus for each node [s]."""
        first: dict[int, float] = {}
        for frame in self.frames:
            if _is(frame, QUICK_STOP):
                first.setdefault(frame.can_id - RPDO, frame.time_s)
        return first

    def quick_stop_cycle(self) -> int:
        """Return the cycle of the quick stop, which must be the same for every node."""
        stops = self.quick_stops()
        assert set(stops) == set(NODES), "not every axis got a quick stop"
        (cycle,) = {self.cycle(time_s) for time_s in stops.values()}
        return cycle

    def assert_at_rest(self, moved_before_s: float = 5 * T) -> float:
        """Assert that the axes moved, came to rest, and have no power.

        Returns:
            Time from quick stop to rest [s].
        """
        stop_s = min(self.quick_stops().values())
        moving = self.truth.velocity[self.truth.at(stop_s - moved_before_s)]
        assert np.abs(moving).max() > 0.05, "no axis moved before the fault"
        rest_s = self.truth.rest_s()
        assert rest_s < stop_s + 0.3
        assert not any(self.truth.powered[-1])
        assert self.motion_frames_after(stop_s) == []
        return rest_s - stop_s

    def motion_frames_after(self, time_s: float) -> list[Logged]:
        """Return the commands after a time [s] that enable operation."""
        return [f for f in self.frames if f.time_s > time_s and _is(f, ENABLE)]


def _is(frame: Logged, word: int) -> bool:
    return RPDO < frame.can_id < RPDO + 0x80 and len(frame.data) == 6 and frame.word == word


class Rig:
    """Hub, drives and robot in a thread; sessions and motions run in the test's own thread.

    Attributes:
        config: The cell with the bus's address.
        truth: Motion of the axes since the start.
    """

    def __init__(self, loaded: LoadedCell, folder: Path, script: FaultScript) -> None:
        assert loaded.plant is not None
        self._loaded = loaded
        self._ended = threading.Event()
        self._log = StringIO()
        self.truth = Truth()
        self.path = folder / "hub.sock"
        served = threading.Event()
        cell, robot, plant = loaded.config, loaded.robot, loaded.plant.without_unmodelled()
        nodes = {axis.joint: axis.node_id for axis in cell.axes}
        faults = BusFaults(
            script, nodes, cell.drive_safety.master_node_id, controlword_places(cell)
        )

        def serve() -> None:
            urgent = [NMT_COB_ID, SYNC_COB_ID, *map(sdo_request_cob_id, nodes.values())]
            with listening_socket(self.path) as listener:
                hub = CanHub(
                    listener, cell.can.bitrate, realtime=False, channel="test", log=self._log,
                    faults=faults,
                )  # fmt: skip
                client = EmbeddedClient(hub, urgent, self._ended.is_set)
                rack = DriveRack(cell, robot, plant, 1, self.truth, 0.0, script)  # type: ignore[arg-type]
                served.set()
                with contextlib.suppress(TransportError):
                    RackLoop(rack, client, None, None, self.path).run()
                hub.close()

        self._thread = threading.Thread(target=serve)
        self._thread.start()
        assert served.wait(120.0)
        channel = cell.can.model_copy(update={"channel": str(self.path)})
        self.config = cell.model_copy(update={"can": channel})

    def frames(self) -> list[Logged]:
        """Return all frames that were on the bus, without remote frames."""
        return parse_log(self._log.getvalue())

    def close(self) -> None:
        self._ended.set()
        with contextlib.suppress(TransportError):  # a new client ends the hub's wait
            HubClient(self.path, HubRole.OBSERVER).close()
        self._thread.join(120.0)
        assert not self._thread.is_alive()

    @contextlib.contextmanager
    def session(self) -> Iterator[Cell]:
        with open_cell(self.config, self._loaded.robot) as cell:
            yield cell

    def let_pass(self, duration_s: float) -> None:
        """Let simulated time pass without commands to the drives.

        While the CAN adapter is lost (unplugged or bus-off), try again.
        """
        tick, tries = threading.Event(), 2000
        while True:
            try:
                with self.session() as cell:
                    cell.clock.sleep_until(cell.clock.now_s() + duration_s)
                return
            except TransportError:
                tries -= 1
                assert tries, "the bus does not come back"
                tick.wait(0.01)

    def move(
        self,
        samples: MotionSamples,
        hook: Callable[[Cell, ControlBlock], None] | None = None,
        config: CellConfig | None = None,
    ) -> Run:
        """Bring up the axes, run the cyclic task for a motion, and close the session."""
        control, ring = ControlBlock.create(), Ring.create(3, 8192)
        reason, error = None, None
        try:
            with open_cell(config or self.config, self._loaded.robot) as cell:
                cell.axes.bring_up()
                cell.axes.start()
                if hook is not None:
                    hook(cell, control)
                reason = CyclicTask(
                    cell.axes, cell.clock, cell.config, self._loaded.robot, ring, control,
                    lockstep=True, orders=StopOrders(control, lambda: False),
                ).run(PlannedMotion(samples))  # fmt: skip
        except RidDaqError as problem:
            error = problem
        self.let_pass(0.4)  # log and plant then also show the axes after the motion
        rows = np.frombuffer(ring.read(8192), dtype=row_dtype(3))
        return Run(reason, rows, control.task.notes, self.frames(), self.truth, error)


Serve = Callable[..., Rig]


@pytest.fixture(scope="session")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="session")
def motion(loaded: LoadedCell) -> MotionSamples:
    """Return one period of 1.6 s between ramps of 0.8 s; every axis moves."""
    return fourier(loaded, periods=1)


@pytest.fixture(scope="session")
def motion_of(loaded: LoadedCell) -> Callable[[str, int], FourierMotion]:
    """Return a function that makes this motion for a robot and a number of periods."""
    return lambda robot, periods: plan_of(loaded, robot, periods)


def fourier(loaded: LoadedCell, periods: int) -> MotionSamples:
    plan = plan_of(loaded, loaded.robot.name, periods)
    return plan.plan(loaded.robot, loaded.config.cycle_time_s)


def plan_of(loaded: LoadedCell, robot: str, periods: int) -> FourierMotion:
    sizes = ((0.2, 0.0), (0.0, 0.2), (0.15, 0.15))  # at least one joint moves at any time
    joints = tuple(
        FourierJoint(joint=name, offset=0.0, sine=(sine,), cosine=(cosine,))
        for name, (sine, cosine) in zip(loaded.robot.joint_names, sizes, strict=True)
    )
    return FourierMotion(
        kind="fourier", robot=robot, period_s=1.6, periods=periods,
        transient_periods=0, ramp_s=0.8, joints=joints,
    )  # fmt: skip


@pytest.fixture
def serve(loaded: LoadedCell, tmp_path: Path) -> Iterator[Serve]:
    """Return a function that serves a cell with faults: ``serve(bus=[{...}], drives=[{...}])``."""
    rigs: list[Rig] = []

    def start(**script: object) -> Rig:
        folder = tmp_path / f"rig{len(rigs)}"
        folder.mkdir()
        faults = NO_SCRIPT
        if script:
            values = {k: tuple(v) if isinstance(v, list) else v for k, v in script.items()}
            faults = FaultScript.model_validate(values)
        rigs.append(Rig(loaded, folder, faults))
        return rigs[-1]

    yield start
    for rig in rigs:
        rig.close()
