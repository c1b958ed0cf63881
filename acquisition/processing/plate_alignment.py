"""Alignment of a force plate's rows with a recording: converts `PlateRows` to a `Reaction`.

A stream begins when the amplifier starts sending, and ends when the connection is lost. Each stream
has its own clock.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.journal.plate import PlateRows
from acquisition.processing.clipping import clipped_ends
from acquisition.recording.reaction import Reaction, resample_reaction
from acquisition.recording.recording import Recording
from acquisition.signals.clocks import (
    FEWEST_MARKS,
    DeviceClock,
    clock_from_arrivals,
    clock_from_edges,
    clock_from_marks,
    match_edges,
)
from config.arrays import BoolArray, FloatArray
from config.cell.plate import CHANNEL_NAMES
from config.errors import DataQualityError

BITS_A_BYTE = 10
FEWEST_EDGES = 10
GLITCH_SHARE = 0.25
SETTLING_CYCLES = 4.0
"""Settling time of the amplifier's low-pass after an overload, in periods of its cut-off frequency.
"""


def with_plate(recording: Recording, rows: PlateRows) -> Recording:
    """Return a recording with the force plate's measurements.

    The amplifier's clock is mapped to that of the recording. If SYNC is wired to the amplifier and
    at least 10 trigger edges match SYNC, they are used. Otherwise the arrivals of its rows are
    used, or marks if these are more accurate. In simulated time, rows that arrived after the last
    SYNC are left out, because their number depends on the computer.

    Args:
        recording: Recording of the robot.
        rows: Rows of the plate, from the same run.

    Raises:
        DataQualityError: No stream of rows is long enough for alignment.
    """
    if rows.header.simulated_time and len(recording):
        rows = rows.until(float(recording.time_s[-1]))
    parts: list[Reaction] = []
    reason = "it has no row"
    for stream in np.unique(rows.stream):
        try:
            parts.append(_align(recording, rows, rows.stream == stream, int(stream)))
        except DataQualityError as error:
            reason = str(error)
    if not parts:
        raise DataQualityError(
            f"the force plate's recording cannot be used: {reason}", code="RID-PLATE-CLOCK"
        )
    reaction = parts[0]
    for part in parts[1:]:
        channels = np.where(part.valid, part.channels_n, reaction.channels_n)
        reaction = replace(reaction, channels_n=channels, valid=reaction.valid | part.valid)
    return replace(recording, reaction=reaction)


def plate_defects(recording: Recording, rows: PlateRows) -> tuple[str, ...]:
    """Return a sentence on a reset, and one for each overloaded or clipped channel.

    Only rows count that arrived during the recording.

    Args:
        recording: Recording of the robot.
        rows: Rows of the plate, from the same run.
    """
    inside = rows.until(float(recording.time_s[-1]))
    measured = inside.arrival_s >= recording.time_s[0]
    if not measured.any():
        return ()
    operating = inside.operating[measured]
    said = []
    if not operating.all():
        first_s = float(inside.arrival_s[measured][~operating][0] - recording.time_s[0])
        said.append(
            f"the charge amplifier was in reset in {100.0 * np.mean(~operating):.2g} % of the"
            f" recording, first after {first_s:.3g} s, and measured nothing then: switch it to"
            " operate before the motion, and keep the motion within its range"
        )
    counts, over = inside.rows["counts"][measured], inside.overload[measured]
    step = np.abs(np.diff(counts.astype(np.float64), axis=0, prepend=counts[:1])).sum(axis=1)
    moves = operating & (step > 0.1 * float(np.sqrt(np.square(step).mean())))
    for name, own, high in zip(CHANNEL_NAMES, counts.T, over.T, strict=True):
        if high[operating].any():
            said.append(
                f"channel {name} was overloaded in {100.0 * np.mean(high[operating]):.2g} % of the"
                " recording; these readings are not used: choose a larger range, or a smaller"
                " motion"
            )
        elif ends := clipped_ends(own[moves]):
            said.append(
                f"channel {name} reads {ends.phrase} [counts], although its range is larger: the"
                " charge amplifier is saturated, and the plate's readings are wrong; choose a"
                " larger range"
            )
    return tuple(said)


def stream_clock(recording: Recording, rows: PlateRows, stream: int) -> DeviceClock:
    """Return the amplifier's clock during one of its streams.

    Raises:
        DataQualityError: The stream is too short, or its clock is impossible for a quartz.
    """
    use = rows.stream == stream
    amplifier = rows.header.plate.amplifier
    row_s = rows.header.profile.row_bytes(amplifier.format) * BITS_A_BYTE / amplifier.baud_rate
    clock = clock_from_arrivals(rows.device_s[use], rows.arrival_s[use], shortest_delay_s=row_s)
    triggers = rows.of_kind("trigger")
    edges_s = np.asarray(triggers["device_s"][triggers["stream"] == stream], dtype=np.float64)
    if amplifier.trigger and len(edges_s) >= FEWEST_EDGES:
        cycle_s = float(np.median(np.diff(recording.time_s)))
        edges, cycles = match_edges(
            edges_s, recording.time_s, clock, within_s=GLITCH_SHARE * cycle_s
        )
        if len(edges) >= FEWEST_EDGES:
            return clock_from_edges(edges_s[edges], recording.time_s[cycles])
    marks = rows.of_kind("mark")
    marks = marks[(marks["stream"] == stream) & np.isfinite(marks["asked_s"])]
    if len(marks) >= FEWEST_MARKS and not rows.header.simulated_time:
        mark_clock = clock_from_marks(marks["asked_s"], marks["device_s"], marks["arrival_s"])
        middle = np.array([clock.device_s])
        if mark_clock.sigma_s(middle)[0] < clock.sigma_s(middle)[0]:
            return mark_clock
    return clock


def _align(recording: Recording, rows: PlateRows, use: BoolArray, stream: int) -> Reaction:
    """Return the force plate's readings of one stream, at the recording's times.

    Raises:
        DataQualityError: The stream is too short.
    """
    device_s = rows.device_s[use]
    ahead = np.concatenate([[True], np.diff(device_s) > 0.0])  # a row received twice counts once
    amplifier = rows.header.plate.amplifier
    over = find_settling(rows.overload[use], device_s, SETTLING_CYCLES / amplifier.low_pass_hz)
    valid = ~over & rows.operating[use][:, np.newaxis]
    return resample_reaction(
        rows.header.plate,
        stream_clock(recording, rows, stream),
        device_s[ahead],
        rows.channels_n[use][ahead],
        valid[ahead],
        recording.time_s,
    )


def find_settling(over: BoolArray, device_s: FloatArray, settling_s: float) -> BoolArray:
    """Return True for overloaded values and for the settling time after an overload.

    Args:
        over: Shape (rows, channels). True for overloaded values.
        device_s: Shape (rows,). Times of the rows [s].
        settling_s: Settling time [s].
    """
    last_s = np.where(over, device_s[:, np.newaxis], -np.inf)
    return np.asarray(device_s[:, np.newaxis] - np.maximum.accumulate(last_s, axis=0) <= settling_s)
