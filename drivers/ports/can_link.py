"""`CanLink`: an open CAN bus, with deadlines and typed errors; `open_can` opens one."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence

from config.cell.cell import CanBusConfig
from config.errors import TransportError
from drivers.canopen.frames import REMOTE_FLAG, Frame
from drivers.ports.can_ports import Arrival, FramePort, PythonCanPort
from drivers.ports.clock import Clock, MonotonicClock
from drivers.ports.python_can import can, not_opened, open_bus
from drivers.ports.socketcan_port import SocketCanPort


class CanLink:
    """An open CAN bus, with receive deadlines as absolute times and errors of our own types.

    A simulated bus may have its own time (its attribute `simulated_clock` is then not None).
    Receive timeouts and arrival times are then in this simulated time.

    Some buses return each frame also to its sender, for example UDP multicast; `hears_itself` is
    then True. The returned copy of each sent frame is discarded, but a frame with the same
    identifier from another sender is received.

    Attributes:
        clock: Clock to which all deadlines of this bus refer.
        simulated: True if `clock` is simulated.
        time_stamped: True if the bus provides arrival times; if False, the time of reading is used
            instead.
        last_time_s: Arrival time of the last received frame, on `clock` [s].
    """

    def __init__(self, bus: can.BusABC | FramePort, *, hears_itself: bool = False) -> None:
        simulated_clock: Clock | None = getattr(bus, "simulated_clock", None)
        self.simulated = simulated_clock is not None
        self._port: FramePort
        if isinstance(bus, FramePort):
            self._port = bus
        else:
            self._port = PythonCanPort(bus, simulated=self.simulated)
        self._name = bus.channel_info
        self._descriptor: Callable[[], int] | None = getattr(bus, "fileno", None)
        self.clock: Clock = (
            MonotonicClock()
            if simulated_clock is None
            else SimulatedClock(simulated_clock, self._name)
        )
        self.time_stamped = self._port.time_stamped
        self.last_time_s = self.clock.now_s()
        self._arrived: deque[Arrival] = deque()
        self._echoes: Counter[tuple[int, bytes]] | None = Counter() if hears_itself else None

    @property
    def lost_frames(self) -> int:
        """Number of received frames that the computer dropped; 0 if the bus does not count them."""
        return int(getattr(self._port, "lost_frames", 0))

    def take_remote_frames(self) -> None:
        """Receive remote frames too, marked by `REMOTE_FLAG`; simulated devices need them."""
        if isinstance(self._port, PythonCanPort | SocketCanPort):
            self._port.takes_remote_frames = True

    def fileno(self) -> int:
        """Return the file descriptor to wait on; -1 if the bus has none."""
        try:
            return -1 if self._descriptor is None else self._descriptor()
        except NotImplementedError:
            return -1

    def send(self, frame: Frame) -> None:
        """Send a frame; raise `TransportError` if the bus does not accept it."""
        self.send_frames((frame,))

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames (identifier and data) in this order; try all, even after an error.

        Raises:
            TransportError: The bus did not accept one of the frames.
        """
        if self._echoes is not None:
            data_frames = (frame for frame in frames if not frame[0] & REMOTE_FLAG)
            self._echoes.update((cob_id, bytes(data)) for cob_id, data in data_frames)
        try:
            self._port.send_frames(frames)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._name}: sending failed ({error});"
                " check the adapter, its cable and the bus termination",
                code="RID-CAN-LOST",
            ) from error

    def receive(self, until_s: float) -> Frame | None:
        """Return the next classic data frame; None if none arrives until `until_s` [s].

        A frame that is already waiting is returned even after the deadline.

        Raises:
            TransportError: The adapter is gone, or reports bus-off.
        """
        if not self._arrived:
            self._arrived.extend(self.receive_all(until_s))
        if not self._arrived:
            return None
        cob_id, data, self.last_time_s = self._arrived.popleft()
        return Frame(cob_id, data)

    def receive_all(self, until_s: float) -> Sequence[Arrival]:
        """Return all classic data frames that have arrived, oldest first.

        If no frame is waiting, wait for one; the result is empty if none arrives until `until_s`
        [s].

        Raises:
            TransportError: The adapter is gone, or reports bus-off.
        """
        if self._arrived:
            arrived = (*self._arrived,)
            self._arrived.clear()
            return arrived
        while True:
            timeout_s = until_s - self.clock.now_s()
            try:
                frames = self._port.receive_frames(timeout_s if timeout_s > 0.0 else 0.0)
            except (can.CanError, OSError, ValueError) as error:
                raise TransportError(
                    f"CAN bus {self._name}: receiving failed ({error});"
                    " check the adapter and its cable",
                    code="RID-CAN-LOST",
                ) from error
            if frames is None:
                return ()
            if self._echoes is not None:
                frames = [frame for frame in frames if not self._is_echo(frame[:2])]
            if frames:
                return frames

    def _is_echo(self, frame: tuple[int, bytes]) -> bool:
        """Return True if a received frame is the returned copy of a frame that this link sent."""
        echoes = self._echoes
        assert echoes is not None
        count = echoes[frame]
        if count > 1:
            echoes[frame] = count - 1
        else:
            del echoes[frame]
        return count > 0

    def close(self) -> None:
        """Close the bus; raise `TransportError` if that fails."""
        try:
            self._port.shutdown()
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._name}: closing failed ({error})", code="RID-CAN-LOST"
            ) from error

    def __enter__(self) -> CanLink:
        """Return the link itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bus."""
        self.close()


class SimulatedClock:
    """Clock of a simulated bus; it raises `TransportError` if the simulation has ended."""

    def __init__(self, clock: Clock, bus_name: str) -> None:
        self._clock = clock
        self._bus_name = bus_name
        self.now_s = clock.now_s

    def sleep_until(self, time_s: float) -> None:
        """Let simulated time advance to `time_s`; raise `TransportError` if it cannot."""
        try:
            self._clock.sleep_until(time_s)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus_name}: the simulated time stopped ({error})",
                code="RID-MOCK-ENDED",
            ) from error


def open_can(config: CanBusConfig, *, watch_errors: bool = True) -> CanLink:
    """Open the bus that a cell file names; SocketCAN is opened as a raw socket, without python-can.

    Args:
        config: Interface, channel and bit rate.
        watch_errors: True to raise an error when a SocketCAN interface is bus-off.

    Raises:
        ConfigError: The interface is unknown.
        TransportError: The interface's driver is missing, or the channel cannot be opened.
    """
    bus: can.BusABC | FramePort
    if config.interface != "socketcan":
        bus = open_bus(config)
    else:
        try:
            bus = SocketCanPort(config.channel, watch_errors=watch_errors)
        except (OSError, ValueError) as error:
            raise not_opened(config, error) from error
    return CanLink(bus, hears_itself=config.interface == "udp_multicast")
