"""The plate recorder: a process that reads the amplifier and writes `plate.mcap`.

It reads many rows at once. After a loss of the connection it continues in the same file with a new
stream, if the amplifier still operates with the same settings.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.mcap_writer import FLUSH_PERIOD_S, SYNC_PERIOD_S
from acquisition.journal.plate import (
    LINE_LOST,
    LINE_RESTORED,
    PlateHeader,
    PlateJournalWriter,
    find_overloads,
)
from acquisition.session.plate_block import PlateBlock, PlateState
from config.cell.amplifier_profile import BITS_PER_BYTE, AmplifierProfile
from config.cell.plate import AmplifierConfig, PlateConfig
from config.errors import DeviceFaultError, DriverError, RecordingError, TransportError
from config.process.shortage import named_error
from config.process.termination import leave_terminal
from drivers.amplifier.amplifier import SerialAmplifier, open_amplifier
from drivers.amplifier.simulated_arrivals import arrivals_path
from drivers.amplifier.stream import StreamCounts
from drivers.interfaces.force_plate import PlateRead

LONGEST_PIECE_S = 0.02
PIECE_BYTES = 2048  # half of the size of a serial port's buffer
PARSE_S = 0.1
BEAT_S = 0.1
MARK_PERIOD_S = 1.0
OVERLOAD_PERIOD_S = 0.2
STOP_PATIENCE_S = 2.0
RETRY_S = 0.2
RETRY_PATIENCE_S = 10.0


@dataclass(frozen=True)
class PlateTask:
    """Arguments of the plate recorder's process.

    Attributes:
        plate: The plate and its amplifier, which must be configured and operating already.
        profile: Protocol of the amplifier.
        path: File to write; it must not exist.
        cell_name, run_id: Provenance.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    path: Path
    cell_name: str = ""
    run_id: str = ""


def run_plate_recorder(task: PlateTask, block: PlateBlock, parent: int) -> None:
    """Run the plate recorder; main function of its process.

    It ends if the program requests it or is gone; errors are reported in `block`.

    Args:
        task: Plate, amplifier and file.
        block: Shared memory for the status.
        parent: Process id of the program.
    """
    leave_terminal()
    try:
        _PlateRecorder(task, block, parent).run()
        block.state = PlateState.FINISHED
    except Exception as error:
        block.fail(named_error(error))


def piece_time_s(baud_rate: int) -> float:
    """Return a time between two reads in which no bytes are lost, at most 20 ms [s]."""
    return min(LONGEST_PIECE_S, PIECE_BYTES * BITS_PER_BYTE / baud_rate)


def require_amplifier_ready(amplifier: SerialAmplifier, config: AmplifierConfig) -> None:
    """Raise an error if an amplifier has wrong settings or does not measure.

    Raises:
        DeviceFaultError: Settings are wrong (the text names them), or the amplifier is in reset.
        DriverError: The amplifier does not answer.
    """
    wrong = [
        f"{setting.name} is {setting.found} instead of {setting.required}"
        for setting in amplifier.settings()
        if setting.verdict == "red"
    ]
    if wrong:
        raise DeviceFaultError(
            f"amplifier at {config.address}: {'; '.join(wrong)}: correct the settings and zero"
            " the plate again",
            code="RID-PLATE-NOT-ZEROED",
        )
    if not amplifier.is_operating():
        raise DeviceFaultError(
            f"amplifier at {config.address} is in reset and does not measure: zero the plate",
            code="RID-PLATE-NOT-ZEROED",
        )


class _PlateRecorder:
    """Recording of the plate in one motion; each loss of the connection begins a new stream.

    In simulated time no time marks are requested. They depend on the real clock, but the same seed
    must give the same file. Overload flags are cleared in simulated time, too.
    """

    def __init__(self, task: PlateTask, block: PlateBlock, parent: int) -> None:
        self._task = task
        self._block = block
        self._parent = parent
        self._stream = 0
        self._last_stream = 0
        self._before = StreamCounts()
        self._flushed_s = self._synced_s = self._marked_s = self._forgot_s = time.monotonic()

    def run(self) -> None:
        with open_amplifier(self._task.plate.amplifier, self._task.profile) as amplifier:
            header = self._create_header(amplifier)
        with PlateJournalWriter(self._task.path, header) as writer:
            lost = self._open_and_record(writer)
            while lost is not None:
                lost = self._resume(writer, lost)

    def _create_header(self, amplifier: SerialAmplifier) -> PlateHeader:
        task = self._task
        identity = amplifier.connect()
        require_amplifier_ready(amplifier, task.plate.amplifier)
        return PlateHeader(
            plate=task.plate,
            profile=task.profile,
            identity=identity,
            simulated_time=arrivals_path(task.plate.amplifier.address).exists(),
            cell_name=task.cell_name,
            run_id=task.run_id,
        )

    @property
    def _is_over(self) -> bool:
        return self._block.stop or os.getppid() != self._parent

    def _open_and_record(self, writer: PlateJournalWriter) -> DriverError | None:
        """Open the connection and record.

        Return the error if the connection is lost, or None at the end.
        """
        config = self._task.plate.amplifier
        with open_amplifier(config, self._task.profile) as amplifier:
            amplifier.connect()
            require_amplifier_ready(amplifier, config)
            if self._block.state is PlateState.LINE_LOST:
                self._stream = self._last_stream + 1
                now_s = time.monotonic()
                writer.note(kind=LINE_RESTORED, detail=0, arrival_s=now_s, stream=self._stream)
            try:
                self._record_stream(writer, amplifier)
            except TransportError as error:
                return error
            finally:
                self._add_counts(amplifier.stream_counts)
        return None

    def _resume(self, writer: PlateJournalWriter, lost: DriverError) -> DriverError | None:
        """Wait for the connection and continue; return the error if it is lost again."""
        now_s = time.monotonic()
        self._block.count_loss()
        writer.note(kind=LINE_LOST, detail=0, arrival_s=now_s, stream=self._last_stream)
        until_s = now_s + RETRY_PATIENCE_S
        while not self._is_over:
            self._block.count_heartbeat()
            self._flush(writer)
            try:
                return self._open_and_record(writer)
            except DeviceFaultError:
                raise
            except DriverError as error:
                if time.monotonic() > until_s:
                    raise TransportError(
                        f"{lost}; the connection was not restored within {RETRY_PATIENCE_S:g} s"
                        f" ({error})",
                        code="RID-AMPLIFIER-SILENT",
                    ) from error
            time.sleep(RETRY_S)
        return None

    def _record_stream(self, writer: PlateJournalWriter, amplifier: SerialAmplifier) -> None:
        """Record until the end is requested, or the parent process has ended."""
        writer.begin_stream()
        marks = 0
        amplifier.start()
        self._block.state = PlateState.RECORDING
        parse_s = time.monotonic()
        pause_s = piece_time_s(self._task.plate.amplifier.baud_rate)
        while not self._is_over:
            if not writer.simulated_time:
                # wait, so that the rows of several milliseconds are read together
                time.sleep(pause_s)
            now_s = time.monotonic()
            if now_s - self._marked_s >= MARK_PERIOD_S and not writer.simulated_time:
                writer.note_mark_request(marks, amplifier.mark())
                marks, self._marked_s = marks + 1, now_s
            if now_s < parse_s:
                amplifier.gather(now_s + BEAT_S)
            else:
                self._write_rows(writer, amplifier, amplifier.read(now_s + BEAT_S))
                parse_s = now_s + PARSE_S
        for read in amplifier.stop(time.monotonic() + STOP_PATIENCE_S):
            self._write_rows(writer, amplifier, read)

    def _write_rows(
        self, writer: PlateJournalWriter, amplifier: SerialAmplifier, read: PlateRead
    ) -> None:
        block = self._block
        rows = writer.append(read, self._stream)
        if len(rows):
            self._last_stream = int(rows["stream"][-1])
            over = find_overloads(rows, self._task.plate.amplifier.full_scale_counts)
            words = np.packbits(over, axis=1, bitorder="little")[:, 0]
            block.add_rows(rows["force_n"], words, read.read_s)
            self._require_operation(rows["status"])
            self._clear_overloads(amplifier, int(rows["status"][-1]) & 0xFF)
        now, before = amplifier.stream_counts, self._before
        block.count_damage(
            before.rows_lost + now.rows_lost,
            before.bad_frames + now.bad_frames,
            before.garbage_bytes + now.garbage_bytes,
        )
        block.count_heartbeat()
        self._flush(writer)

    def _require_operation(self, status: NDArray[Any]) -> None:
        """Raise `DeviceFaultError` if the amplifier was in reset in a row of this status."""
        if not ((status >> self._task.profile.status_bits.operate) & 1).all():
            raise DeviceFaultError(
                f"amplifier at {self._task.plate.amplifier.address} went into reset during the"
                " recording: check its supply, and zero the plate",
                code="RID-PLATE-NOT-ZEROED",
            )

    def _clear_overloads(self, amplifier: SerialAmplifier, word: int) -> None:
        """Clear overload flags that are still set, so that later rows show new overloads."""
        now_s = time.monotonic()
        if word and now_s - self._forgot_s >= OVERLOAD_PERIOD_S and not self._is_over:
            amplifier.forget_overloads()
            self._forgot_s = now_s

    def _add_counts(self, counts: StreamCounts) -> None:
        """Add the counts of a stream that has ended."""
        self._before.rows_lost += counts.rows_lost
        self._before.bad_frames += counts.bad_frames
        self._before.garbage_bytes += counts.garbage_bytes

    def _flush(self, writer: PlateJournalWriter) -> None:
        now_s = time.monotonic()
        if now_s - self._flushed_s >= FLUSH_PERIOD_S:
            to_disk = now_s - self._synced_s >= SYNC_PERIOD_S
            writer.flush(to_disk=to_disk)
            if trouble := writer.trouble:
                raise RecordingError(f"{writer.path}: {trouble}", code="RID-RECORDING-LOST")
            self._flushed_s = now_s
            self._synced_s = now_s if to_disk else self._synced_s
