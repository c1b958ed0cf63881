"""A plate channel that is constant in many periods is left out of the mean period."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.processing.reaction_average import GapLimits, cut_reaction
from acquisition.recording.reaction import Reaction

PERIODS, SAMPLES, STEP_S = 5, 400, 0.008
NAMES = ("fx", "fy", "fz", "mx")


@pytest.mark.parametrize(("stuck_periods", "used"), [(0, True), (1, True), (3, False), (5, False)])
def test_a_channel_that_is_constant_in_many_periods_is_left_out(
    stuck_periods: int, used: bool
) -> None:
    rows = np.arange(PERIODS * SAMPLES)
    angle = 2.0 * np.pi * rows / SAMPLES
    noise = np.random.default_rng(1).normal(size=(len(rows), len(NAMES)))
    channels_n = 100.0 * np.sin(angle[:, np.newaxis] + np.arange(len(NAMES))) + 0.1 * noise
    begin = len(rows) - stuck_periods * SAMPLES
    channels_n[begin:, 1] = channels_n[min(begin, len(rows) - 1), 1]
    reaction = Reaction(
        channel_names=NAMES,
        channels_n=channels_n,
        valid=np.ones_like(channels_n, dtype=np.bool_),
        base_wrench_matrix=np.zeros((6, len(NAMES))),
    )
    good = np.ones(PERIODS, dtype=np.bool_)
    cut = cut_reaction(reaction, rows, rows, good, SAMPLES, STEP_S, GapLimits(5, 0.02, 5))
    assert cut is not None
    assert cut.used.tolist() == [True, used, True, True]
