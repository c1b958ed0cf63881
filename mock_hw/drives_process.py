"""Process of the simulated drives and the robot: connects a `DriveRack` to the bus.

In lock-step the bus (hub) is in this process too: drives and hub exchange frames by function calls.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, TextIO

from config.errors import RidDaqError, TransportError
from config.process.termination import signals_deferred
from drivers.canopen.frames import NMT_COB_ID, SYNC_COB_ID, sdo_request_cob_id
from drivers.ports.can_link import CanLink, open_can
from mock_hw.amplifier.port import AmplifierPort
from mock_hw.bus.bus_client import BusClient
from mock_hw.bus.embedded_client import EmbeddedClient
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import LINGER_NS, open_hub
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.bus.lawicel_port import LawicelPort
from mock_hw.bus.served_bus import adapter_path, hold_served_bus
from mock_hw.drives_settings import DrivesSettings
from mock_hw.host.device_process import leave_signals_to_parent, request_exact_timing
from mock_hw.host.runtime_directory import folder_in_use
from mock_hw.plant.snapshot import SnapshotReader, SnapshotWriter
from mock_hw.plate_service import DeviceClient, PlateService
from mock_hw.rack_loop import LONGEST_WAIT_S, RackLoop, act_on_frames, next_wait
from mock_hw.registers.contents import DriveRegisters
from mock_hw.registers.registers import SimulatedRegisters
from mock_hw.registers.server import RegisterService

if TYPE_CHECKING:
    from mock_hw.rack import DriveRack
    from mock_hw.simulation import CellSimulation

_LOOK_S = 0.1
_FAULT_PATIENCE_S = 5.0


def serve_drives(settings: DrivesSettings, pipe: Connection) -> None:
    """Run a cell's drives until their hub ends.

    If no other process contains their hub, the drives end some seconds after the parent process.
    The function waits for a message in `pipe` before it joins the bus. When the drives are on the
    bus, it sends the TCP port of their registers, or 0 without registers. After an error, it sends
    the error's text instead.
    """
    leave_signals_to_parent()
    signal.signal(signal.SIGTERM, _exit)
    with contextlib.ExitStack() as stack:
        try:
            if settings.simulation.private and not settings.has_hub_process:
                stack.callback(shutil.rmtree, settings.socket.parent, ignore_errors=True)
                stack.enter_context(folder_in_use(settings.socket.parent))
            if settings.bus is not None:
                stack.enter_context(hold_served_bus(settings.bus))
        except (OSError, RidDaqError) as error:
            pipe.send(str(error))
            return
        serve_until(settings, pipe, _parent_ended())


def serve_until(
    settings: DrivesSettings, pipe: Connection, ended: Callable[[], bool], *, alone: bool = True
) -> None:
    """Run a cell's drives until `ended` returns True, or until their hub ends.

    Args:
        pipe: As for `serve_drives`.
        ended: Called at every wait, if the bus has no hub process.
        alone: True if the drives have a process of their own; False in a thread.
    """
    try:
        with (
            _rack_on_bus(settings, pipe, ended) as (rack, client),
            _plate_service(settings, rack, client) as plate,
            _register_service(settings) as port,
        ):
            if alone:
                gc.freeze()
                request_exact_timing(settings.simulation.realtime)
            pipe.send(port)
            orders = pipe if settings.hosts_masters else None
            if orders is None and not settings.simulation.faults.program:
                pipe.close()
            with contextlib.suppress(TransportError):
                if isinstance(client, EmbeddedClient):
                    RackLoop(rack, client, plate, orders, settings.socket).run()
                else:
                    run_rack(rack, client, plate)
    except (EOFError, OSError, RidDaqError) as error:
        with contextlib.suppress(OSError):
            pipe.send(str(error))


@contextlib.contextmanager
def _rack_on_bus(
    settings: DrivesSettings, pipe: Connection, ended: Callable[[], bool]
) -> Iterator[tuple[DriveRack, DeviceClient]]:
    """Build the rack, compile its kernels and join the bus; remove the snapshot file at the end."""
    simulation = settings.simulation
    cell, robot, plant, seed = simulation.cell, simulation.robot, simulation.truth, simulation.seed
    with signals_deferred():  # the compiler would lose signals
        from mock_hw.plant.tracker import Tracker  # imports Pinocchio: only for this process
        from mock_hw.rack import DriveRack

        DriveRack(cell, robot, plant, seed).advance(LONGEST_WAIT_S)
    pipe.recv()
    snapshots = SnapshotWriter(settings.snapshot, len(robot.joints))
    try:
        with _join_bus(settings, ended) as client, _tracker_file(simulation) as tracked:
            now_s = client.now_ns * 1e-9
            announce = _fault_announcer(pipe, client)
            faults = simulation.faults
            rack = DriveRack(cell, robot, plant, seed, snapshots, now_s, faults, announce)
            rack.change_load(simulation.load_transfers)
            if tracked is not None:
                rack.track(Tracker(robot, plant, seed), tracked)
            yield rack, client
    finally:
        settings.snapshot.unlink(missing_ok=True)


@contextlib.contextmanager
def _tracker_file(simulation: CellSimulation) -> Iterator[TextIO | None]:
    """Open the file of the plant's tracker; yield None without a file."""
    if simulation.tracker_file is None:
        yield None
        return
    with simulation.tracker_file.open("w", encoding="ascii") as file:
        yield file


def _fault_announcer(pipe: Connection, client: DeviceClient) -> Callable[[int], None]:
    """Return a function that makes the program's process execute one of its faults.

    In lock-step, simulated time stands still until the fault has taken effect, so that the fault
    happens in the cycle that the script states.
    """

    def announce(number: int) -> None:
        with contextlib.suppress(EOFError, OSError):  # the program's process has ended
            pipe.send(number)
            if client.lockstep and pipe.poll(_FAULT_PATIENCE_S):
                pipe.recv()

    return announce


@contextlib.contextmanager
def _join_bus(settings: DrivesSettings, ended: Callable[[], bool]) -> Iterator[DeviceClient]:
    """Join the bus, or open the hub in lock-step; leave or close it at the end."""
    bus, simulation = settings.bus, settings.simulation
    with contextlib.ExitStack() as stack:
        client: DeviceClient
        if bus is not None:
            if bus.interface == "slcan":
                link = CanLink(LawicelPort(adapter_path(bus.channel), bus.bitrate))
            else:
                link = open_can(bus, watch_errors=False)
            client = BusClient(link, ended)
        else:
            urgent = [NMT_COB_ID, SYNC_COB_ID]
            urgent += [sdo_request_cob_id(axis.node_id) for axis in simulation.cell.axes]
            if settings.has_hub_process:
                client = HubClient(settings.socket, HubRole.DEVICE, urgent)
            else:
                hub = stack.enter_context(open_hub(simulation.hub(settings.socket)))
                client = EmbeddedClient(hub, urgent, ended)
        stack.callback(client.close)
        yield client


def _parent_ended() -> Callable[[], bool]:
    """Return a function that returns True if the parent ended more than `LINGER_NS` ago."""
    parent = multiprocessing.parent_process()
    asked_s = gone_s = 0.0

    def has_ended() -> bool:
        nonlocal asked_s, gone_s
        now_s = time.monotonic()
        if parent is not None and not gone_s and now_s - asked_s > _LOOK_S:
            asked_s = now_s
            gone_s = 0.0 if parent.is_alive() else now_s
        return gone_s > 0.0 and now_s - gone_s > LINGER_NS * 1e-9

    return has_ended


@contextlib.contextmanager
def _plate_service(
    settings: DrivesSettings, rack: DriveRack, client: DeviceClient
) -> Iterator[PlateService | None]:
    """Yield the service of the plate's amplifier, or None without a plate; close it at the end."""
    if settings.plate is None:
        yield None
        return
    if settings.plate.path.is_symlink():
        settings.plate.path.unlink()  # left by a killed process
    with signals_deferred():  # compiles, as in `_rack_on_bus`
        port = AmplifierPort(settings.plate, realtime=not client.lockstep, now_s=rack.time_s)
    service = PlateService(port, rack, client)
    try:
        service.keep_up()
        yield service
    finally:
        service.close()


@contextlib.contextmanager
def _register_service(settings: DrivesSettings) -> Iterator[int]:
    """Serve the drives' registers and yield their TCP port; without a monitor, yield 0."""
    simulation = settings.simulation
    if settings.registers is None:
        yield 0
        return
    with SnapshotReader(settings.snapshot) as snapshots:
        drives = DriveRegisters(
            simulation.cell, simulation.robot, simulation.truth, settings.registers, snapshots
        )
        registers = SimulatedRegisters(drives, settings.registers.faults)
        realtime = simulation.realtime
        with RegisterService(registers, settings.registers, realtime=realtime) as service:
            yield service.port


def run_rack(rack: DriveRack, client: DeviceClient, plate: PlateService | None = None) -> None:
    """Exchange frames with a bus in real time, and serve the plate, until a `TransportError`."""
    wait = client.wait if plate is None else plate.wait
    while True:
        act_on_frames(rack, client, plate, wait(*next_wait(rack)))


def _exit(_number: int, _frame: object) -> None:
    """End the process on SIGTERM; every `with` block cleans up."""
    raise SystemExit(0)
