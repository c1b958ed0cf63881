"""What the verdict says of two runs of the same motion."""

from __future__ import annotations

from pathlib import Path

import pytest

from rid_daq.report.result import Result
from rid_daq.report.sections.tracking import TrackingSection

RESULT = Path(__file__).parent / "results" / "tracking.json"


def compared(*ratios: float | None) -> TrackingSection:
    """Return a section whose motions have become so many times closer."""
    section = Result.model_validate_json(RESULT.read_text(encoding="utf-8")).tracking
    assert section is not None
    (motion,) = section.motions
    changed = tuple(motion.model_copy(update={"mean_ratio": ratio}) for ratio in ratios)
    return section.model_copy(update={"motions": changed})


@pytest.mark.parametrize(
    ("ratios", "words"),
    [
        ((111.0,), "Mean distance from the path 0.0245 mm: error reduced 111 times"),
        (
            (30.0, 8.0),
            "Mean distance from the path 0.0245 mm at most: error reduced 8 times at least",
        ),
        ((0.01,), "Mean distance from the path 0.0245 mm: error grew 100 times"),
        ((0.5, 4.0), "Mean distance from the path 0.0245 mm at most: error grew 2 times at most"),
        ((0.0,), "Mean distance from the path 0.0245 mm: error grew 1·10¹² times"),
        ((None,), "Mean distance from the path 0.0245 mm"),
    ],
)
def test_an_error_is_reduced_or_has_grown(ratios: tuple[float | None, ...], words: str) -> None:
    assert compared(*ratios).verdict.headline == words
