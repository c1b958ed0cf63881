"""A force plate's rows, events and header as they stand in its journal.

As `cycle_row`: one layout for file and numpy, fields of fixed size, the widest first, so that a
packed numpy record is the CDR body of the ROS 2 message beside it.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.header import HeaderModel
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import CHANNELS, PlateConfig

ROW_TOPIC: Final = "/plate"
ROW_NAME: Final = "rid_daq/msg/Plate"
EVENT_TOPIC: Final = "/plate_event"
EVENT_NAME: Final = "rid_daq/msg/PlateEvent"

SATURATION: Final = 0.95
"""Share of its range from which a channel counts as overloaded (faults: row 28)."""

LINE_LOST: Final = 0x100
LINE_RESTORED: Final = 0x101
"""Events of this computer; the amplifier's own have one byte."""

_ROW = (
    ("arrival_s", "f8", 1, "when it was here, on the clock of SYNC [s]"),
    ("device_s", "f8", 1, "when it was measured, on the amplifier's clock [s]"),
    ("sequence", "i8", 1, "number of the row; a gap is a loss"),
    ("force_n", "f4", CHANNELS, "fx12 fx34 fy14 fy23 fz1 fz2 fz3 fz4 [N]"),
    ("stream", "u4", 1, "grows where the amplifier's clock began anew"),
    ("status", "u2", 1, "bits 0 to 7 overload of a channel, others as the profile says"),
    ("counts", "i2", CHANNELS, "as received"),
)
_EVENT = (
    ("arrival_s", "f8", 1, "when it was here, on the computer's monotonic clock [s]"),
    ("asked_s", "f8", 1, "when a mark was asked for, on the same clock [s]; NaN otherwise"),
    ("device_s", "f8", 1, "when it happened, on the amplifier's clock [s]"),
    ("sequence", "i8", 1, "the row before which it came"),
    ("stream", "u4", 1, "as in the rows"),
    ("kind", "u2", 1, "number in the profile; 256 the line was lost, 257 it is back"),
    ("detail", "u2", 1, "what the profile says of it"),
)
_MESSAGE_TYPE = {
    "f8": "float64", "f4": "float32", "i8": "int64", "u4": "uint32", "u2": "uint16", "i2": "int16",
}  # fmt: skip

Fields = tuple[tuple[str, str, int, str], ...]


class PlateHeader(HeaderModel):
    """Everything needed to read the rows, even without the run folder.

    `identity` is what the amplifier said about itself, escaped. `simulated_time` is true where
    arrivals are a simulated cell's time and not the computer's.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    identity: str = ""
    simulated_time: bool = False
    cell_name: str = ""
    run_id: str = ""


def _dtype(fields: Fields) -> np.dtype[Any]:
    return np.dtype(
        [
            (name, "<" + kind, (count,)) if count > 1 else (name, "<" + kind)
            for name, kind, count, _ in fields
        ]
    )


def _definition(fields: Fields) -> str:
    return "".join(
        f"{_MESSAGE_TYPE[kind]}{f'[{count}]' if count > 1 else ''} {name}  # {text}\n"
        for name, kind, count, text in fields
    )


def overloaded(rows: NDArray[Any], full_scale_counts: int) -> NDArray[np.bool_]:
    """Return which channels are not to be believed, (rows, 8).

    Parameters
    ----------
    rows : ndarray with `status` and `counts`, shape (rows,)
        As received, or as written.
    full_scale_counts : int
        Counts that stand for the range.
    """
    flagged = (rows["status"][:, np.newaxis] >> np.arange(CHANNELS)) & 1 == 1
    high = np.abs(rows["counts"].astype(np.int64)) >= SATURATION * full_scale_counts
    return np.asarray(flagged | high)


ROW_DTYPE: Final = _dtype(_ROW)
EVENT_DTYPE: Final = _dtype(_EVENT)
ROW_DEFINITION: Final = _definition(_ROW)
EVENT_DEFINITION: Final = _definition(_EVENT)
