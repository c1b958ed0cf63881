"""Torque delays too long for any bus; they are reported, and the model does not use them.

A bus and a logger can delay a torque relative to the position:
- A drive samples torque and position in the same cycle or in two consecutive cycles, and may send
  one of them a cycle later than the other. Cycles for motion on CANopen, and on the monitoring
  interfaces of controllers, usually take at most 10 ms (125 Hz or faster). Therefore a bus explains
  up to two cycles of 10 ms.
- A logger that polls adds up to one of its own periods to each of these two cycles.

A longer delay comes from a wrong clock, or from an effect that the model does not contain.
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


def split_implausible_delays(
    channel: TorqueChannel, sample_period_s: float
) -> tuple[TorqueChannel, FloatArray]:
    """Split the delays of a torque channel into plausible and implausible ones.

    Args:
        channel: The estimated channel.
        sample_period_s: Time between rows of the recording [s].

    Returns:
        `channel`. The channel with a delay of 0 for the joints whose delay is implausible.
        `refused_s`, shape (n,). The delays that were removed; 0 for the other joints [s].
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
        refused_s: The joints' removed delays, 0 if none; empty if no joint has one [s].
    """
    return tuple(
        f"The recorded torque of {name} seems to be {1e3 * abs(delay_s):.3g} ms"
        f" {'late' if delay_s > 0.0 else 'early'}. No bus explains this delay, so the model does"
        " not use it. Check the recording's clock, or add terms that the model may lack."
        for name, delay_s in zip(joint_names, refused_s, strict=False)
        if delay_s
    )
