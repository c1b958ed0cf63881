"""`FrameRecorder`: records the frames on the bus in a BLF file, in its own process.

It listens on its own connection and sends nothing; the cyclic task is not involved. If only one
program can open the adapter of a bus, its frames cannot be recorded.
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

SHARED_INTERFACES: Final = ("rid_sim", "socketcan", "udp_multicast")
"""Interfaces that several programs can open at the same time."""

_START_PATIENCE_S = 30.0
_END_PATIENCE_S = 10.0
_LOOK_S = 0.05


def require_listenable(bus: CanBusConfig) -> None:
    """Raise `ConfigError` if only one program can open a bus."""
    if bus.interface not in SHARED_INTERFACES:
        raise ConfigError(
            f"can.interface {bus.interface}: frames cannot be recorded, since only one program"
            f" can open this interface; they can be recorded on {', '.join(SHARED_INTERFACES)}."
            " Omit --frames",
            code="RID-CAN-INTERFACE",
        )


class FrameRecorder:
    """Recorder of bus frames while the `with` block is active.

    Args:
        bus: Bus settings.
        path: File to write; it must not exist.

    Raises:
        ConfigError: The interface does not permit a second listener.
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
        """Wait until the process listens."""
        try:
            self._receive_answer(_START_PATIENCE_S)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Let the process write the received frames and close the file."""
        self._end()

    def finish(self) -> int:
        """Close the file and return the number of frames in it.

        Raises:
            RecordingError: Not all frames could be written.
        """
        # Even if the process has already ended, read its answer.
        with contextlib.suppress(OSError):
            self._pipe.send(None)
        return self._receive_answer(_END_PATIENCE_S)

    def _receive_answer(self, patience_s: float) -> int:
        try:
            answer = self._pipe.recv() if self._pipe.poll(patience_s) else None
        except (EOFError, OSError):
            answer = None
        if isinstance(answer, int):
            return answer
        if isinstance(answer, RidDaqError):
            raise answer
        raise RecordingError(
            f"{self._path}: the process that writes it does not answer", code="RID-RECORDING-LOST"
        )

    def _end(self) -> None:
        self._pipe.close()
        self._process.end()


def run_frame_recorder(bus: CanBusConfig, path: Path, pipe: Connection) -> None:
    """Run the frame recorder, the main function of its process, until `finish` or a closed pipe.

    It sends 0 once it listens, and the number of written frames at the end, or the error.
    """
    leave_terminal()
    answer: int | RidDaqError
    try:
        answer = _record_frames(bus, path, pipe)
    except RidDaqError as error:
        answer = error
    except OSError as error:
        answer = RecordingError(
            f"{path}: cannot be written ({error.strerror or error})", code="RID-RECORDING-LOST"
        )
    with contextlib.suppress(OSError):  # if the program has failed, it does not read the answer
        pipe.send(answer)


def _record_frames(config: CanBusConfig, path: Path, pipe: Connection) -> int:
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
