"""`KNOWN_SOURCES`: programs whose recordings are recognised by the names of their columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from acquisition.maps.torque_meaning import (
    GRAVITY_COMPENSATED,
    JOINT_TORQUE,
    MOTOR_CURRENT,
    TorqueMeaning,
)


@dataclass(frozen=True)
class KnownSource:
    """A program that writes recordings, and facts that its column names do not state.

    Attributes:
        title: Name of the program.
        columns: Names of columns by which the recording is recognised.
        time: Column of the time stamps. If several columns have this name, as in exports with
            one time for each channel, all must be equal.
        time_unit: Unit of the time stamps.
        units: Keys of `units` in the import map.
        torques: Meaning of the torques or currents; None if the program does not define it. Torques
            are not used if the meaning is `motor_current`.
        notes: Facts about the recorded quantities that a person must know, one sentence each.
    """

    title: str
    columns: tuple[str, ...]
    time: str
    time_unit: str
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    torques: TorqueMeaning | None = None


_RSI: Final = KnownSource(
    "KUKA RSI, logged by RSIPI",
    ("Send.IPOC", "Send.AIPos.A1", "Send.MACur.A1"),
    "Send.IPOC",
    "ms",
    {"position": "deg", "current": "percent"},
    (
        "MACur is the motor current in percent of the drive's maximum: rated_current_a is the"
        " maximum current of each drive, from the machine data",
    ),
    torques=MOTOR_CURRENT,
)
_OTHER_RSI: Final = "KUKA RSI, logged without the direction of the messages"

KNOWN_SOURCES: Final = (
    KnownSource(
        "Universal Robots RTDE (ur_rtde, or the recorder of UR's Python client)",
        ("timestamp", "actual_q_0", "actual_current_0"),
        "timestamp",
        "s",
        notes=(
            "actual_current is the measured motor current. target_moment is computed by the"
            " controller from its own model and is not used",
            "record with speed_scaling 1 and the right payload set in the controller",
        ),
        torques=MOTOR_CURRENT,
    ),
    KnownSource(
        "Universal Robots RTDE, without the field actual_current",
        ("timestamp", "actual_q_0", "actual_current_as_torque_0"),
        "timestamp",
        "s",
        notes=(
            "actual_current_as_torque contains no gravity: to identify masses, record"
            " actual_current",
        ),
        torques=GRAVITY_COMPENSATED,
    ),
    KnownSource(
        "Franka, libfranka's log",
        ("time", "state.q[0]", "state.tau_J[0]"),
        "time",
        "ms",
        notes=("tau_J is measured by the joint torque sensors, gravity included",),
        torques=JOINT_TORQUE,
    ),
    _RSI,
    replace(_RSI, title=_OTHER_RSI, columns=("IPOC", "AIPos.A1", "MACur.A1"), time="IPOC"),
    replace(_RSI, title=_OTHER_RSI, columns=("IPOC", "AIPos_A1", "MACur_A1"), time="IPOC"),
    KnownSource(
        "ABB EGM, logged by abb_libegm",
        ("TIMESTAMP", "R_FB_POS_RJ1"),
        "TIMESTAMP",
        "ms",
        {"position": "deg", "velocity": "deg/s"},
        (
            "the log has no torques: give those of another logger as a second file"
            " (`further_files` of the map)",
            "EGM's velocities are differences of the positions, not measurements",
        ),
    ),
    KnownSource(
        "PlotJuggler's CSV export",
        ("__time",),
        "__time",
        "s",
        notes=(
            "the efforts of ROS joint states may be torques or motor currents, and may or may not"
            " contain gravity: ask the robot driver's documentation",
        ),
    ),
    KnownSource(
        "TwinCAT Scope View, CSV export",
        ("Name",),
        "Name",
        "ms",
        notes=(
            "the units are those of the scope's channels, if the file has the row Unit. The objects"
            " 6077h and 6078h of a drive are per mille of its rated torque and rated current: then"
            " give units.torque permille and rated_torque_nm, or units.current permille and"
            " rated_current_a",
            "record all channels with one sample time",
        ),
    ),
    KnownSource("rid-daq export", ("time_s", "phase", "sample_index"), "time_s", "s"),
)


def recognise(names: Sequence[str]) -> KnownSource | None:
    """Return the first known source whose columns all exist; None without one."""
    return next(
        (source for source in KNOWN_SOURCES if set(source.columns) <= set(names)),
        None,
    )
