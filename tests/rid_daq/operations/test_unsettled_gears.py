"""A mistake that prevents the fit to the motion of the links is named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from acquisition.runs.folder import RunFolder
from benchmarks.closed_loop import closed_loop
from config.errors import EstimationError
from config.load import load_cell
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.operations.identify.identified_robot import identify_robot
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.runs.run_data import RunData
from rid_daq.terminal.console import Console
from tests.builders.elastic_model import links_model
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008


@pytest.fixture(scope="module")
def misread(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    """Return a run of an arm with known stiffness; the torque of axis2 is in mN m."""
    cell = load_cell("ir361")
    assert cell.plant is not None
    options = TwoHarmonicOptions(5.0, highest_harmonic=6, tries=50, periods=4, seed=0)
    motion = design_two_harmonic(cell.robot, options, CYCLE_S)
    plan = motion.plan(cell.robot, CYCLE_S)
    recording = closed_loop(cell, cell.plant.without_unmodelled(), plan, 0)
    wrong = replace(recording, torque_nm=recording.torque_nm * [1.0, 1e3, 1.0])
    folder = RunFolder(tmp_path_factory.mktemp("misread"), "excitation")
    return RunData.of(folder, wrong, links_model(cell).robot, None)


def test_a_wrong_unit_is_named_although_the_deflection_does_not_converge(
    misread: RunData,
) -> None:
    request = IdentifyRequest(names=("excitation",))
    with raises_code(EstimationError, "RID-STIFFNESS-UNSETTLED", "axis2", "0.001"):
        identify_robot(request, (misread,), Console())


def test_without_the_search_for_mistakes_only_the_deflection_is_named(misread: RunData) -> None:
    request = IdentifyRequest(names=("excitation",), diagnose=False)
    with raises_code(EstimationError, "RID-STIFFNESS-UNSETTLED") as caught:
        identify_robot(request, (misread,), Console())
    assert "axis2" not in str(caught.value)
