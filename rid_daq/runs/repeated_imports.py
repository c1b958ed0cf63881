"""Recordings that were imported twice: they must not count as two runs, or validate themselves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from acquisition.recording.recording import Recording
from config.errors import ConfigError
from rid_daq.runs.run_data import RunData

RowHashes = npt.NDArray[np.uint64]

FEWEST_ROWS: Final = 100
"""Smallest number of different rows in common that are no coincidence."""
COMMON_SHARE: Final = 0.9
"""Smallest fraction of equal rows where two imports overlap; damaged rows can be left out."""
SAMPLED_ROWS: Final = 256
"""Number of rows by which a model recognises the imports from which it was identified."""
FEWEST_SAMPLED: Final = 8
"""Smallest number of these rows in another run that are no coincidence."""


def refuse_repeated_imports(data: Sequence[RunData]) -> None:
    """Refuse imported runs with the same positions and torques, whatever their names and times are.

    Two runs of a real robot never have equal noise. This also holds for a part of a run. Runs that
    rid-daq recorded are distinguished by their ids.

    Raises:
        ConfigError: Two runs have the same data; intervals would be too narrow, and differences
            between the runs would be zero.
        RecordingError: A recording cannot be read.
    """
    imported = [each for each in data if each.import_report is not None]
    if len(imported) < 2:
        return
    hashes = [row_hashes(each.parts()) for each in imported]
    for one, other in combinations(range(len(imported)), 2):
        if rows := rows_in_common(hashes[one], hashes[other]):
            pair = [imported[number].folder for number in (one, other)]
            names = [each.manifest().label or each.run_id for each in pair]
            raise ConfigError(
                f"runs {names[0]} and {names[1]} ({pair[0].run_id}, {pair[1].run_id}) have"
                f" {rows} equal rows of positions and torques, so they are one recording or"
                " overlapping parts of one: give each row once",
                code="RID-OPTION-EXCLUSIVE",
            )


def sample_row_hashes(data: Sequence[RunData]) -> tuple[int, ...]:
    """Return hashes of rows that represent all rows of the imported runs; empty without imports.

    They are the smallest hashes, so that every part of a run contains its share of them. Each has
    at most 53 bits, which every JSON reader keeps.
    """
    hashes = [row_hashes(each.parts()) for each in data if each.import_report is not None]
    if not hashes:
        return ()
    return tuple((np.unique(np.concatenate(hashes))[:SAMPLED_ROWS] >> np.uint64(11)).tolist())


def share_of_samples(sampled: Sequence[int], data: RunData) -> float:
    """Return the fraction of sampled rows that an imported run contains; 0 if it is negligible."""
    if not sampled or data.import_report is None:
        return 0.0
    own = row_hashes(data.parts()) >> np.uint64(11)
    common = np.count_nonzero(np.isin(np.array(sampled, dtype=np.uint64), own))
    return common / len(sampled) if common >= min(FEWEST_SAMPLED, len(sampled)) else 0.0


def row_hashes(parts: Iterable[Recording]) -> RowHashes:
    """Return a hash of the positions and torques of each row, shape (rows,)."""
    found = [np.zeros(0, dtype=np.uint64)]
    for part in parts:
        bits = np.hstack([part.position, part.torque_nm]).view(np.uint64)
        bits = (bits ^ (bits >> np.uint64(29))) * np.uint64(0x9E3779B97F4A7C15)
        weights = np.random.default_rng(0).integers(1 << 63, size=bits.shape[1], dtype=np.uint64)
        found.append(((bits ^ (bits >> np.uint64(32))) * (2 * weights + 1)).sum(axis=1))
    return np.concatenate(found)


def rows_in_common(one: RowHashes, other: RowHashes) -> int:
    """Return the number of equal rows in the overlap of two runs; 0 if they do not overlap."""
    _, first, second = np.intersect1d(one, other, return_indices=True)
    if len(first) == 0:
        return 0
    offsets, counts = np.unique(first - second, return_counts=True)
    offset = int(offsets[np.argmax(counts)])
    begin, end = max(offset, 0), min(len(one), len(other) + offset)
    equal = one[begin:end] == other[begin - offset : end - offset]
    is_whole = end - begin == len(one) == len(other) and bool(equal.all())
    if not is_whole and (equal.mean() < COMMON_SHARE or counts.max() < FEWEST_ROWS):
        return 0
    return int(np.count_nonzero(equal))
