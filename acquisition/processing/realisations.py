"""`realisation_starts`: the rows of a multisine run in which each realisation is measured."""

from __future__ import annotations

import numpy as np

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from config.arrays import PhaseArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription


def realisation_starts(
    recording: Recording, motion: MultisineMotion, robot: RobotDescription
) -> dict[int, int]:
    """Return the first row of the measured periods of each complete realisation, by its number.

    The first realisation has the number 0. Realisations with missing or invalid rows are left out.

    Raises:
        DataQualityError: No realisation is complete.
    """
    assert recording.sample_period_s is not None
    length = motion.periods * round(motion.period_s / recording.sample_period_s)
    parts = _main_parts(recording.phase)
    numbers = list(range(len(parts)))
    if len(parts) != motion.realisations:
        # If whole realisations are missing, the sample index shows which ones were recorded.
        planned = motion.plan(robot, recording.sample_period_s).phase
        expected = np.array([first for first, _ in _main_parts(planned)])
        indices = [int(recording.sample_index[first]) for first, _ in parts]
        numbers = [int(np.argmin(np.abs(expected - index))) for index in indices]
    found = {}
    for number, (first, end) in zip(numbers, parts, strict=True):
        index = recording.sample_index[first:end]
        whole = end - first == length and bool((np.diff(index) == 1).all())
        if whole and recording.valid[first:end].all():
            found[number] = first
    if not found:
        raise DataQualityError(
            f"none of the multisine's {motion.realisations} realisations is recorded with all its"
            " rows: record the motion again",
            code="RID-RECORDING-ROWS-LOST",
        )
    return found


def _main_parts(phase: PhaseArray) -> list[tuple[int, int]]:
    """Return the first row and the row after the last of each main phase."""
    main = np.concatenate([[0], (phase == Phase.MAIN).astype(int), [0]])
    edges = np.flatnonzero(np.diff(main)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
