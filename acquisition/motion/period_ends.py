"""Where a periodic motion may go over to its run-out."""

from __future__ import annotations

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase


def period_ends(samples: MotionSamples) -> dict[int, int]:
    """Return the rows at which a whole number of main periods is over, and that number.

    From each of them the motion may go on with the row of the last one, the run-out, since all lie
    at the same point of the same path. Empty where the motion is not periodic.
    """
    if samples.samples_per_period is None:
        return {}
    begin = int(np.argmax(samples.phase == Phase.MAIN))
    counts = range(1, samples.periods + 1)
    return {begin + count * samples.samples_per_period: count for count in counts}
