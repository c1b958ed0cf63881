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
    """A CAN bus with typed errors, absolute receive deadlines and its clock.

    A bus whose attribute `simulated_clock` is not None has its own time; its receive timeouts and
    its frames' times are then in that time.

    A bus that returns frames to their sender, as UDP multicast does, has `hears_itself` True. Each
    sent frame is then ignored once when it returns, so that a frame with the same identifier from
    another sender is still received.

    Attributes:
        clock: Clock of all deadlines of this link.
        simulated: Whether that clock is simulated.
        time_stamped: Whether the bus provides arrival times; otherwise the time of reading is used.
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
        """Number of frames that the computer dropped, if the bus counts them; else 0."""
        return int(getattr(self._port, "lost_frames", 0))

    def take_remote_frames(self) -> None:
        """Also receive remote frames, with `REMOTE_FLAG`; simulated devices need them."""
        if isinstance(self._port, PythonCanPort | SocketCanPort):
            self._port.takes_remote_frames = True

    def fileno(self) -> int:
        """Return a descriptor to wait on; -1 without one."""
        try:
            return -1 if self._descriptor is None else self._descriptor()
        except NotImplementedError:
            return -1

    def send(self, frame: Frame) -> None:
        """Send a frame; raise `TransportError` if the bus does not accept it."""
        self.send_frames((frame,))

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames (identifier and data), oldest first; every one is tried.

        Raises:
            TransportError: The bus did not accept one of them.
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
        """Return the next classic data frame; None if `until_s` [s] comes first.

        After the deadline, frames that are already waiting are still returned.

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

        It waits for a frame as `receive` does; the result is empty if `until_s` [s] comes first.
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
        """Return whether a frame was sent here and has returned."""
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
    """A simulated bus's clock, with typed errors."""

    def __init__(self, clock: Clock, bus_name: str) -> None:
        self._clock = clock
        self._bus_name = bus_name
        self.now_s = clock.now_s

    def sleep_until(self, time_s: float) -> None:
        """Let simulated time run; raise `TransportError` if the simulation has ended."""
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
        watch_errors: Whether bus-off of a SocketCAN interface is an error.

    Raises:
        ConfigError: The interface is unknown.
        TransportError: Its driver is missing or the channel cannot be opened.
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
