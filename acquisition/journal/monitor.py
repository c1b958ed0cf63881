"""`MonitorStream`: temperatures and operating times of the drives in a run, for `Recording`."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.journal.header import HeaderModel, first_header
from acquisition.journal.mcap_reader import read_raw_journal
from acquisition.journal.mcap_writer import JournalFile
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN, Fields, message_text, packed_dtype
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, freeze, read_only
from config.errors import RecordingError
from config.robot.robot import RobotDescription
from drivers.interfaces.drive_monitor import MonitorReading

MONITOR = "monitor.mcap"
TOPIC = "/drive_monitor"
MESSAGE_NAME = "rid_daq/msg/DriveMonitor"

FIELDS: Fields = (
    ("time_s", "f8", 1, "time of the query, on the cyclic task's clock [s]"),
    ("temperature_k", "f8", None, "temperature of the motor [K]; NaN without an answer"),
    ("operating_time_s", "f8", None, "time since the drive was switched on, by its own clock [s]"),
    ("valid", "u1", None, "1 if the drive answered, else 0"),
)


class MonitorHeader(HeaderModel):
    """Header of a monitor file."""

    joint_names: tuple[str, ...]
    period_s: float
    cell_name: str = ""
    robot_name: str = ""
    run_id: str = ""


def monitor_body(time_s: float, reading: MonitorReading) -> bytes:
    """Return the bytes of a row; `time_s` is on the cyclic task's clock [s]."""
    n = len(reading.temperature_k)
    valid = np.isfinite(reading.temperature_k).tolist()
    return struct.pack(
        f"<d{n}d{n}d{n}B", time_s, *reading.temperature_k, *reading.operating_time_s, *valid
    )


class MonitorWriter(JournalFile):
    """Writer of the drive monitor's query rounds to a new MCAP file; a context manager."""

    def __init__(self, path: Path, header: MonitorHeader) -> None:
        pairs = header.to_metadata()
        super().__init__(path, pairs)
        definition = message_text(FIELDS, len(header.joint_names))
        self._channel = self.add_channel(TOPIC, MESSAGE_NAME, definition, pairs)

    def append(self, time_s: float, reading: MonitorReading) -> None:
        """Write one round and pass it to the operating system."""
        self.add_message(self._channel, time_s, monitor_body(time_s, reading))
        self.flush()


@dataclass(frozen=True, eq=False)
class MonitorStream:
    """Answers of the drives to the monitor's query rounds, on the cyclic task's clock.

    Attributes:
        joint_names: Base to flange.
        time_s: Shape (rounds,). Times of the queries [s].
        temperature_k, operating_time_s: Shape (rounds, joints). Motor temperatures [K], and times
            since the drives were switched on [s].
        valid: Shape (rounds, joints). True for drives that answered; the values of others are 0.
        notes: Damage of the file, one sentence each.
        run_id: Run of the recording; empty if the file does not name it.
    """

    joint_names: tuple[str, ...]
    time_s: FloatArray
    temperature_k: FloatArray
    operating_time_s: FloatArray
    valid: BoolArray
    notes: tuple[str, ...] = ()
    run_id: str = ""

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        freeze(self, RecordingError, (None,), "time_s", what="monitor ")
        table = (len(self.time_s), n)
        freeze(self, RecordingError, table, "valid", what="monitor ", dtype=np.bool_)
        for name in ("temperature_k", "operating_time_s"):
            values = np.where(self.valid, np.nan_to_num(getattr(self, name)), 0.0)
            array = read_only(f"monitor {name}", values, float, table, RecordingError)
            object.__setattr__(self, name, array)

    @property
    def known_until_s(self) -> float:
        """Earliest of the drives' last answers [s]: all temperatures are known until then."""
        return float(min(self.time_s[good][-1] for good in self.valid.T))

    def temperatures_at(self, time_s: FloatArray) -> FloatArray:
        """Return temperatures [K], (samples, joints), linear between rounds, constant outside."""
        columns = [
            np.interp(time_s, self.time_s[good], column[good])
            for column, good in zip(self.temperature_k.T, self.valid.T, strict=True)
        ]
        return np.column_stack(columns)


def read_monitor(path: Path) -> MonitorStream:
    """Read a monitor file, complete or damaged.

    Raises:
        RecordingError: The file cannot be read, or is not a monitor file.
    """
    raw = read_raw_journal(path)
    header = first_header(MonitorHeader, raw.headers)
    if header is None or not raw.payloads:
        raise RecordingError(
            f"{path}: contains no readable values of the drive monitor", code="RID-RECORDING-EMPTY"
        )
    dtype = packed_dtype(FIELDS, len(header.joint_names))
    size = len(CDR_LITTLE_ENDIAN) + dtype.itemsize
    if any(len(payload) != size for payload in raw.payloads):
        raise RecordingError(
            f"{path}: its rows are not those of a drive monitor of this version",
            code="RID-RECORDING-FOREIGN",
        )
    body = b"".join(payload[len(CDR_LITTLE_ENDIAN) :] for payload in raw.payloads)
    rows = np.frombuffer(body, dtype)
    return MonitorStream(
        joint_names=header.joint_names,
        time_s=rows["time_s"],
        temperature_k=rows["temperature_k"],
        operating_time_s=rows["operating_time_s"],
        valid=rows["valid"] != 0,
        notes=raw.damage.notes,
        run_id=header.run_id,
    )


def read_run_temperatures(
    recording: Recording, folder: Path
) -> tuple[MonitorStream | None, tuple[str, ...]]:
    """Return the temperatures that the drives of a run reported.

    Args:
        recording: The recording, or its part so far.
        folder: The run's folder.

    Returns:
        `stream`. Temperatures of every drive; None without a readable monitor file, or if a drive
        never reported its temperature. `notes`. Reason for unreadable or missing temperatures, or
        damage of their file; empty otherwise, and for a run without a monitor.

    Raises:
        RecordingError: The monitor belongs to another robot or run.
    """
    path = folder / MONITOR
    if not path.exists():
        return None, ()
    try:
        stream = read_monitor(path)
    except RecordingError as error:
        return None, (f"without temperatures: {error}",)
    if stream.joint_names != recording.joint_names:
        raise RecordingError(
            f"{path}: has joints {', '.join(stream.joint_names)}, but the recording has"
            f" {', '.join(recording.joint_names)}: the file belongs to another run",
            code="RID-RUN-MIXED",
        )
    if "" not in (stream.run_id, recording.run_id) and stream.run_id != recording.run_id:
        raise RecordingError(
            f"{path}: belongs to run {stream.run_id}, the recording to run {recording.run_id}: put"
            " the original file back",
            code="RID-RUN-MIXED",
        )
    if not stream.valid.any(axis=0).all():
        return None, ("without temperatures: one of the drives never reported its temperature",)
    return stream, tuple(f"{MONITOR}: {note}" for note in stream.notes)


def with_temperature_compensation(
    recording: Recording, monitor: MonitorStream | None, robot: RobotDescription
) -> Recording:
    """Return a recording with temperatures, and with torques corrected for them.

    Drives compute the torque with the torque constant at the reference temperature. The constant of
    a warm motor differs from it by the fraction `torque_constant_per_k` per kelvin. Without a
    monitor, the recording is returned unchanged.
    """
    if monitor is None:
        return recording
    temperature_k = monitor.temperatures_at(recording.time_s)
    per_k = np.array([joint.torque_constant_per_k for joint in robot.joints])
    reference_k = np.array([joint.reference_temperature_k for joint in robot.joints])
    factor = 1.0 + per_k * (temperature_k - reference_k)
    torque_nm = recording.torque_nm * factor if per_k.any() else recording.torque_nm
    return replace(recording, temperature_k=temperature_k, torque_nm=torque_nm)
