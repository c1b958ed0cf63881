"""`FrameRecorder`: every frame on the bus into a BLF file, by a process of its own.

It listens beside the session, through a connection of its own that sends nothing: the cyclic task
does not know of it. A bus whose adapter only one program can open cannot be listened to like that.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from acquisition.session.helper_process import HelperProcess, start_all
from config.cell.cell import CanBusConfig
from config.errors import ConfigError, RecordingError, RidDaqError, TransportError
from config.process.termination import leave_terminal
from drivers.ports.python_can import can, open_bus

LISTENED: Final = ("rid_sim", "socketcan", "udp_multicast")
"""The interfaces that several programs can open at once."""

_START_PATIENCE_S = 30.0
_END_PATIENCE_S = 10.0
_LOOK_S = 0.05


def require_listenable(bus: CanBusConfig) -> None:
    """Raise `ConfigError` where one program alone can open a bus."""
    if bus.interface not in LISTENED:
        raise ConfigError(
            f"can.interface {bus.interface}: its frames cannot be recorded, since one program"
            f" alone can open it; {', '.join(LISTENED)} can be listened to. Leave --frames out",
            code="RID-CAN-INTERFACE",
        )


class FrameRecorder:
    """Listens for as long as the `with` lasts.

    Args:
        bus: The bus, as it is reachable.
        path: The file; it must not exist.

    Raises:
        ConfigError: The interface cannot be listened to.
        TransportError: The bus cannot be opened.
        RecordingError: The file cannot be written.
    """

    def __init__(self, bus: CanBusConfig, path: Path) -> None:
        require_listenable(bus)
        self._path = path
        self._pipe, theirs = multiprocessing.Pipe()
        self._process = HelperProcess(
            "frame recorder", run_frame_recorder, (bus, path, theirs), patience_s=_END_PATIENCE_S
        )
        try:
            start_all([self._process])
        except BaseException:
            self._end()
            raise
        finally:
            theirs.close()

    def __enter__(self) -> FrameRecorder:
        """Wait until it listens."""
        try:
            self._answer(_START_PATIENCE_S)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Let it write what has come, and close the file."""
        self._end()

    def finish(self) -> int:
        """Close the file; return how many frames it holds.

        Raises:
            RecordingError: They could not all be written.
        """
        with contextlib.suppress(OSError):  # it has ended, and has said why, or not
            self._pipe.send(None)
        return self._answer(_END_PATIENCE_S)

    def _answer(self, patience_s: float) -> int:
        try:
            said = self._pipe.recv() if self._pipe.poll(patience_s) else None
        except (EOFError, OSError):
            said = None
        if isinstance(said, int):
            return said
        if isinstance(said, RidDaqError):
            raise said
        raise RecordingError(
            f"{self._path}: the process that writes it does not answer", code="RID-RECORDING-LOST"
        )

    def _end(self) -> None:
        self._pipe.close()
        self._process.end()


def run_frame_recorder(bus: CanBusConfig, path: Path, pipe: Connection) -> None:
    """Run the recorder, the main function of its process, until told to end or left alone.

    Says 0 once it listens, and at the end how many frames it has written; or what went wrong.
    """
    leave_terminal()
    said: int | RidDaqError
    try:
        said = _record(bus, path, pipe)
    except RidDaqError as error:
        said = error
    except OSError as error:
        said = RecordingError(
            f"{path}: cannot be written ({error.strerror or error})", code="RID-RECORDING-LOST"
        )
    with contextlib.suppress(OSError):  # a session that failed does not wait for it
        pipe.send(said)


def _record(config: CanBusConfig, path: Path, pipe: Connection) -> int:
    count = 0
    with (
        open_bus(config, listening=True) as bus,
        path.open("xb") as file,
        can.BLFWriter(file) as writer,
    ):
        pipe.send(0)
        ending = False
        while True:
            try:
                message = bus.recv(0.0 if ending else _LOOK_S)
            except can.CanError as error:
                raise TransportError(
                    f"CAN bus {config.channel}: {error}", code="RID-CAN-LOST"
                ) from error
            if message is not None:
                writer.on_message_received(message)
                count += 1
            elif ending:
                return count
            ending = ending or pipe.poll(0)
