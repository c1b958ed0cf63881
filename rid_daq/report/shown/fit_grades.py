"""`doubt_texts`: what makes the fits of axes doubtful or bad."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import Text
from rid_daq.report.sections.section import GradedAxis


def doubt_texts(axes: Iterable[GradedAxis]) -> Iterator[Text]:
    """Yield what decides the grade of each axis whose fit is not good."""
    for axis in axes:
        if axis.grade not in (None, Grade.GOOD):
            yield Text(text=f"{axis.joint}: the fit is {axis.grade}, {axis.reason}.")
