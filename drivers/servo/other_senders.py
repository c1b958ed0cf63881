"""`other_senders`: who else sends on a bus, in words."""

from __future__ import annotations

from collections.abc import Sequence

from config.cell.cell import DriveAxis
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.supervision import DriveWatch


def other_senders(
    axes: Sequence[DriveAxis], exchange: CyclicExchange, watch: DriveWatch
) -> tuple[str, ...]:
    """Return a sentence for each drive whose identifier two devices send, and one for nobody's.

    Parameters
    ----------
    axes
        The drives.
    exchange, watch
        Where second answers, and frames of nobody, are counted.
    """
    second, different = exchange.second_answers.tolist(), exchange.contradictions.tolist()
    notes = [
        f"{axis.joint}: node {axis.node_id} answered twice in {cycles} cycle{'s' * (cycles != 1)},"
        f" {differing} of them with other data: two devices send with its identifier, or a gateway"
        " repeats it"
        for axis, cycles, differing in zip(axes, second, different, strict=True)
        if cycles
    ]
    if watch.unexpected_frames:
        notes.append(
            f"{watch.unexpected_frames} frames came with identifiers that nobody in the cell has"
            f" ({watch.unexpected_identifiers}): another device or program sends on this bus"
        )
    return tuple(notes)
