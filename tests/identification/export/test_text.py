"""Notes in an exported file: a valid comment that lists what the format cannot represent."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from identification.estimation.fitted_signals import fit_smoothed
from identification.export.model import ExportModel
from identification.export.text import comment_text, header_lines
from tests.builders.presliding_arm import iwan, motion, recording, with_presliding


def test_omitted_presliding_distance_and_fraction_are_listed() -> None:
    way = motion(20.0, 1)
    measured = recording({1: iwan(way[0][:, 1], 0.01)}, way)
    estimate = fit_smoothed(with_presliding((1,), 0.01, share=0.5), [measured]).estimate()
    header = " ".join(header_lines(ExportModel.from_estimate(estimate)))
    assert "Left out: presliding (dp_axis2 = 0.01" in header
    assert " rad, sp_axis2 = 0.9" in header or " rad, sp_axis2 = 1)" in header


@pytest.mark.parametrize("dashes", range(1, 7))
def test_a_comment_of_any_number_of_dashes_is_valid_xml(dashes: int) -> None:
    line = comment_text(f"a{'-' * dashes}b")
    assert "--" not in line
    ElementTree.fromstring(f"<robot><!-- {line} --></robot>")
