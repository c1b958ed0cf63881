"""Torque delays too long for any bus, and filters too slow to estimate: `RefusedChannel`.

They are reported, and the model does not use them.

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
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import BoolArray, FloatArray

SLOWEST_BUS_CYCLE_S: Final = 0.01
CYCLES: Final = 2.0


def longest_delay_s(sample_period_s: float) -> float:
    """Return the longest delay that a bus and a logger explain [s].

    Args:
        sample_period_s: Time between rows of the recording [s].
    """
    return CYCLES * (SLOWEST_BUS_CYCLE_S + sample_period_s)


@dataclass(frozen=True)
class RefusedChannel:
    """Delays and filters of recorded torques that the model does not use.

    Attributes:
        delay_s: Each joint's delay that no bus explains or that is at the end of its search range;
            0 for the other joints [s].
        filter_s: Time constant of each joint's filter that is at the end of its search range; 0 for
            the other joints [s].
        is_bound: True for each joint whose delay is at the end of its search range, so that the
            true delay can be longer.
    """

    delay_s: tuple[float, ...] = ()
    filter_s: tuple[float, ...] = ()
    is_bound: tuple[bool, ...] = ()

    def __bool__(self) -> bool:
        return any(self.delay_s) or any(self.filter_s)

    def findings(self, joint_names: Sequence[str]) -> tuple[str, ...]:
        """Return a sentence for each refused delay, and one for the refused filters."""
        delays = tuple(
            f"The recorded torque of {name} seems to be {'at least ' if is_bound else ''}"
            f"{1e3 * abs(delay_s):.3g} ms {'late' if delay_s > 0.0 else 'early'}. No bus explains"
            " this delay, so the model does not use it. Check the recording's clock, or add terms"
            " that the model may lack."
            for name, delay_s, is_bound in zip(
                joint_names, self.delay_s, self.is_bound, strict=False
            )
            if delay_s
        )
        slow = {
            name: filter_s
            for name, filter_s in zip(joint_names, self.filter_s, strict=False)
            if filter_s
        }
        if not slow:
            return delays
        slowest_hz = 1.0 / (2.0 * np.pi * max(slow.values()))
        return (
            *delays,
            f"The recorded torque of {', '.join(slow)} seems to be low-passed at"
            f" {slowest_hz:.2g} Hz or below. This is the slowest filter that can be estimated, so"
            " the model does not use it, and its parameters contain the filter's effect. Record the"
            " torque without this filter, or with a faster one.",
        )


def split_implausible_channel(
    channel: TorqueChannel, sample_period_s: float
) -> tuple[TorqueChannel, RefusedChannel]:
    """Split a torque channel into its plausible and its refused part.

    If the standard deviation of a value is as large as the value or larger, the value is at the end
    of its search range.

    Args:
        channel: The estimated channel.
        sample_period_s: Time between rows of the recording [s].
    """
    is_bound = _is_bound(channel.delay_s, channel.delay_sigma_s)
    late = is_bound | (np.abs(channel.delay_s) > longest_delay_s(sample_period_s))
    slow = _is_bound(channel.lag_s, channel.lag_sigma_s)
    wide = _is_bound(channel.width_s, channel.width_sigma_s)
    kept = replace(
        channel,
        delay_s=np.where(late, 0.0, channel.delay_s),
        delay_sigma_s=np.where(late, 0.0, channel.delay_sigma_s),
        lag_s=np.where(slow, 0.0, channel.lag_s),
        lag_sigma_s=np.where(slow, 0.0, channel.lag_sigma_s),
        width_s=np.where(wide, 0.0, channel.width_s),
        width_sigma_s=np.where(wide, 0.0, channel.width_sigma_s),
    )
    filters_s = np.maximum(np.where(slow, channel.lag_s, 0.0), np.where(wide, channel.width_s, 0.0))
    delays_s = np.where(late, channel.delay_s, 0.0)
    return kept, RefusedChannel(
        tuple(delays_s.tolist()), tuple(filters_s.tolist()), tuple(is_bound.tolist())
    )


def _is_bound(value_s: FloatArray, sigma_s: FloatArray) -> BoolArray:
    return np.asarray((value_s != 0.0) & (sigma_s >= np.abs(value_s)))
