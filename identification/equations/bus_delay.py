"""Delays of a torque that no bus explains: they are reported, and not put into the model.

A drive samples its torque and its position in the same cycle or in the next one, and each may be
sent a cycle later than the other. 10 ms is the slowest cycle in common use for motion on CANopen
and on controllers' monitoring interfaces (125 Hz or faster), so that the bus explains two such
cycles. A logger that polls adds up to a period of its own for each of the two. A longer delay is
a wrong clock, or a term that the model lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray

SLOWEST_BUS_CYCLE_S: Final = 0.01
CYCLES: Final = 2.0


def longest_delay_s(sample_period_s: float) -> float:
    """Return the longest delay that a bus and a logger explain [s].

    Args:
        sample_period_s: Time between rows of the recording [s].
    """
    return CYCLES * (SLOWEST_BUS_CYCLE_S + sample_period_s)


def without_implausible(
    channel: TorqueChannel, sample_period_s: float
) -> tuple[TorqueChannel, FloatArray]:
    """Return a channel without the delays that no bus explains, and these delays.

    Args:
        channel: As estimated.
        sample_period_s: Time between rows of the recording [s].

    Returns:
        `channel`. With a delay of 0 for the joints whose delay is implausible.
        `refused_s`, shape (n,). The delays that were taken out; 0 for the other joints [s].
    """
    refused = np.abs(channel.delay_s) > longest_delay_s(sample_period_s)
    kept = replace(
        channel,
        delay_s=np.where(refused, 0.0, channel.delay_s),
        delay_sigma_s=np.where(refused, 0.0, channel.delay_sigma_s),
    )
    return kept, np.where(refused, channel.delay_s, 0.0)


def refused_delay_findings(
    joint_names: Sequence[str], refused_s: Sequence[float]
) -> tuple[str, ...]:
    """Return a sentence for each delay that no bus explains.

    Args:
        joint_names: The joints.
        refused_s: Their delays that were taken out, 0 for none; empty if there is none at all [s].
    """
    return tuple(
        f"The torque of {name} seems to be {1e3 * abs(delay_s):.3g} ms"
        f" {'late' if delay_s > 0.0 else 'early'}, which no bus explains: it is not put into"
        " the model. Check the recording's clock, or which terms the model lacks."
        for name, delay_s in zip(joint_names, refused_s, strict=False)
        if delay_s
    )
