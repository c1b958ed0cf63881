"""`rid-daq design --kind multisine`, and the velocity loops from a recording of its motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.motion_file import load_motion
from benchmarks.closed_loop import closed_loop
from compensation.loops.cascade import advise
from compensation.loops.loop_measurement import measure_loops
from compensation.loops.multisine_motion import (
    MultisineOptions,
    limit_use,
    multisine_motion,
    velocity_loop_band_hz,
)
from config.errors import ConfigError
from config.load import load_cell
from rid_daq.app import run
from rid_daq.blocks.block import Text
from rid_daq.report.section_blocks.bode import bode_plot
from rid_daq.report.section_blocks.velocity_loops import loop_blocks
from rid_daq.report.sections.velocity_loops import VelocityLoopsSection
from rid_daq.report_page.drawings.plot import plot_svg
from tests.builders.raised_codes import raises_code

DESIGN = ["design", "ir361", "--kind", "multisine", "--period", "4"]


@pytest.mark.parametrize(
    ("kind", "most"), [("multisine", 1000), ("reversed", 5000), ("excitation", 10000)]
)
def test_too_many_periods_are_refused_before_the_search(
    kind: str, most: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "motion.yaml"
    words = ["--kind", kind, "--periods", str(most + 1), "-o", str(file)]
    assert run(["design", "ir361", *words]) == 2
    output = capsys.readouterr().err
    assert f"--periods {most + 1}: a motion of kind {kind} has at most {most} periods" in output
    assert not file.exists()


def test_the_motion_has_the_requested_band_and_keeps_the_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "motion.yaml"
    words = ["-o", str(file), "--band", "1:12", "--grid", "odd", "--realisations", "2", "--no-slow"]
    assert run([*DESIGN, *words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["band_hz"] == [1.0, 12.0]
    motion = load_motion(file)
    assert isinstance(motion, MultisineMotion)
    assert (motion.grid, motion.period_s, motion.realisations) == ("odd", 4.0, 2)
    assert all(joint.slow_amplitude == 0.0 for joint in motion.joints)
    cell = load_cell("ir361")
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    use = limit_use(samples, cell.robot)
    for axis, shares in zip(result["axes"], use, strict=True):
        assert 30.0 < axis["acceleration_percent"] <= 80.0
        assert axis["velocity_percent"] == pytest.approx(100.0 * shares[0])
        assert axis["crest_factor"] < 3.0
        assert axis["torque_percent"] is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--band", "5"], "RID-REQUEST-INVALID"),
        (["--band", "1:80"], "62.5 Hz [RID-MOTION-BAND]"),
        (["--band", "0.1:5"], "needs a period of at least 20 s"),
        (["--phases", "schroeder", "--realisations", "3"], "RID-OPTION-EXCLUSIVE"),
        (["--grid", "odd", "--realisations", "1"], "RID-LOOP-ONE-REALISATION"),
        (["--grid", "full", "--phases", "schroeder"], "RID-LOOP-ONE-REALISATION"),
    ],
)
def test_invalid_options_give_one_clear_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    assert run([*DESIGN, "-o", str(tmp_path / "x.yaml"), *words]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()


def test_a_multisine_with_too_few_lines_for_a_fit_is_refused() -> None:
    cell = load_cell("kr15")
    with raises_code(ConfigError, "RID-MOTION-BAND", "axis4", "3 lines", "4.008 s"):
        multisine_motion(cell.robot, cell.config, MultisineOptions(period_s=4.008))


def test_the_default_band_is_that_of_the_cell_or_of_its_torque_measurement() -> None:
    cell = load_cell("ir361")
    assert velocity_loop_band_hz(cell.config) == (0.5, 20.0)
    silent = cell.config.model_copy(update={"velocity_loop_band_hz": None})
    assert velocity_loop_band_hz(silent) == (0.5, 20.0)
    open_ended = silent.model_copy(update={"torque_filter": None})
    lowest_hz, highest_hz = velocity_loop_band_hz(open_ended)
    assert lowest_hz == 0.5
    assert highest_hz == pytest.approx(125.0 / 6.0)
    with raises_code(ConfigError, "RID-MOTION-BAND"):
        multisine_motion(cell.robot, cell.config, MultisineOptions(band_hz=(1.0, 70.0)))


def test_the_section_is_json_and_draws_both_figures(capsys: pytest.CaptureFixture[str]) -> None:
    cell = load_cell("ir361")
    assert cell.plant is not None
    options = MultisineOptions(period_s=4.0, periods=2, realisations=2, seed=5)
    motion = multisine_motion(cell.robot, cell.config, options)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    recording = closed_loop(cell, cell.plant, samples, 5)
    found = measure_loops(recording, motion, cell.robot, 15.0)
    section = VelocityLoopsSection.of(cell.robot, found, advise(found.cascades))
    assert VelocityLoopsSection.model_validate_json(section.model_dump_json()) == section
    assert section.position_gain_per_s == 15.0
    assert section.largest_position_gain_per_s is not None
    assert 5.0 < section.largest_position_gain_per_s < 40.0
    for number, axis in enumerate(section.axes):
        margins = axis.position_margins
        assert axis.trials
        assert margins.phase_deg is not None
        assert margins.gain_db is not None
        assert 30.0 < margins.phase_deg < 80.0
        assert 6.0 < margins.gain_db < 25.0
        measured, drawn = axis.cascade.measured, axis.cascade.position
        inside = np.array(measured.frequency_hz) > 3.0
        modelled = np.interp(measured.frequency_hz, axis.cascade.frequency_hz, drawn.magnitude)
        ratio = np.array(measured.magnitude)[inside] / modelled[inside]
        np.testing.assert_allclose(np.median(ratio), 1.0, atol=0.1)
        svg = plot_svg(bode_plot(axis), f"b{number}")
        for words in ("odd distortion", "even distortion", "frequency [Hz]", "σ from noise"):
            assert words in svg
        assert "position loop, measured" in svg
    response = section.axes[0].response
    loud = response.odd.model_copy(update={"level": tuple(120.0 for _ in response.odd.level)})
    axis = section.axes[0].model_copy(
        update={"response": response.model_copy(update={"odd": loud})}
    )
    blocks = loop_blocks(section.model_copy(update={"axes": (axis,)}))
    assert any(", odd 120 (noise " in each.text for each in blocks if isinstance(each, Text))
