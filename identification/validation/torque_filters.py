"""Filters and delays of recorded torques that a model without a torque channel does not contain."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import RefusedChannel, split_implausible_channel
from identification.estimation.options import EstimationOptions
from identification.validation.model_choice import first_channel


def channel_findings(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions,
    known: Collection[str] = (),
) -> tuple[str, ...]:
    """Name joints whose recorded torque is filtered or delayed, as `--choose` would find it.

    Delays that no bus explains are left to `find_late_torques`.

    Args:
        robot: The robot.
        signals: The recordings, not periodic and with a known clock.
        options: The options of the estimate.
        known: Joints whose filter or delay another finding already names.
    """
    try:
        channel = first_channel(robot, signals, options)
    except EstimationError:  # the recording is too short, or does not determine the friction
        return ()
    channel, refused = split_implausible_channel(channel, signals[0].sample_period_s)
    names = robot.joint_names
    new = np.array([name not in known for name in names])
    slow = RefusedChannel(filter_s=tuple(np.where(new, refused.filter_s, 0.0).tolist()))
    filters_s = np.where(new, np.maximum(channel.lag_s, channel.width_s), 0.0)
    delays_s = np.where(new, channel.delay_s, 0.0)
    found = []
    if filters_s.any():
        shown = ", ".join(
            f"{names[j]} {1.0 / (2.0 * np.pi * filters_s[j]):.2g} Hz"
            for j in np.flatnonzero(filters_s)
        )
        found.append(
            f"The recorded torques seem to be low-passed, with a cut-off of about: {shown}. The"
            " parameters contain the filter's effect. Record the torques without this filter, or"
            " estimate it with `rid-daq identify --choose`."
        )
    if delays_s.any():
        shown = ", ".join(
            f"{names[j]} {1e3 * delays_s[j]:.2g} ms" for j in np.flatnonzero(delays_s)
        )
        found.append(
            f"The recorded torques seem to be later than the positions, by about: {shown}. A"
            " negative value means that they are earlier. A bus can explain this, but the"
            " parameters contain its effect. Estimate the delay with `rid-daq identify --choose`."
        )
    return (*found, *slow.findings(names))
