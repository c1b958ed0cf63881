"""`refuse_repeated_imports`: a recording that was imported twice must not count as two runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from acquisition.recording.recording import Recording
from config.errors import ConfigError
from rid_daq.runs.run_data import RunData


def refuse_repeated_imports(data: Sequence[RunData]) -> None:
    """Refuse imported runs with equal positions and torques, whatever their names and times are.

    Two runs of a real robot never have equal noise. Runs that rid-daq recorded are distinguished
    by their ids.

    Raises:
        ConfigError: Two runs have the same data; intervals would be too narrow, and differences
            between the runs would be zero.
        RecordingError: A recording cannot be read.
    """
    imported = [each for each in data if each.import_report is not None]
    for one, other in combinations(imported, 2):
        # a whole run is read only if the first parts are equal
        if _is_same(next(one.parts()), next(other.parts())) and _is_same(
            one.recording, other.recording
        ):
            names = [each.folder.manifest().label or each.folder.run_id for each in (one, other)]
            raise ConfigError(
                f"runs {names[0]} and {names[1]} ({one.folder.run_id}, {other.folder.run_id}) have"
                f" the same {len(one.recording.time_s)} positions and torques, so they are one"
                " recording: give it once",
                code="RID-OPTION-EXCLUSIVE",
            )


def _is_same(one: Recording, other: Recording) -> bool:
    return np.array_equal(one.torque_nm, other.torque_nm, equal_nan=True) and np.array_equal(
        one.position, other.position, equal_nan=True
    )
