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

    A bus whose attribute `simulated_clock` is not None brings its own time; its receive timeouts
    and its frames' times are then in that time.

    A bus that brings back what is sent on it, as UDP multicast does, `hears_itself`: as many frames
    as were sent are left out when they come back, so that a frame of the same identifier that
    somebody else sent is told from them.

    Attributes:
        clock: The time that all deadlines of this link are in.
        simulated: Whether that is a simulated clock.
        time_stamped: Whether the bus says when a frame arrived; otherwise that is when it was read.
        last_time_s: When the last received frame arrived, on `clock` [s].
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
        """How many frames the computer had to drop, as far as the bus counts them."""
        return int(getattr(self._port, "lost_frames", 0))

    def take_remote_frames(self) -> None:
        """Hand remote frames on from now on, with `REMOTE_FLAG`: devices are asked by them."""
        if isinstance(self._port, PythonCanPort | SocketCanPort):
            self._port.takes_remote_frames = True

    def fileno(self) -> int:
        """Return a descriptor to wait at, -1 where there is none."""
        try:
            return -1 if self._descriptor is None else self._descriptor()
        except NotImplementedError:
            return -1

    def send(self, frame: Frame) -> None:
        """Send a frame; raises `TransportError` when the bus does not take it."""
        self.send_frames((frame,))

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames (identifier and data), oldest first; every one is tried.

        Raises:
            TransportError: The bus did not take one of them.
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
        """Return the next classic data frame, or None when `until_s` [s] comes first.

        A deadline that has passed still takes what is waiting, without waiting.

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
        """Return all classic data frames that have come, oldest first.

        Waits for one as `receive` does; empty when `until_s` [s] comes first.
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
        """Return whether a frame is one that was sent here and has come back."""
        echoes = self._echoes
        assert echoes is not None
        count = echoes[frame]
        if count > 1:
            echoes[frame] = count - 1
        else:
            del echoes[frame]
        return count > 0

    def close(self) -> None:
        """Close the bus; raises `TransportError` when even that fails."""
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
        """Let simulated time run; raises `TransportError` when the simulation is gone."""
        try:
            self._clock.sleep_until(time_s)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus_name}: the simulated time stopped ({error})",
                code="RID-MOCK-ENDED",
            ) from error


def open_can(config: CanBusConfig, *, watch_errors: bool = True) -> CanLink:
    """Open the bus that a cell file names; SocketCAN as a raw socket, past python-can.

    Args:
        config: Interface, channel and bit rate.
        watch_errors: Whether bus-off that a SocketCAN interface reports is an error.

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
