"""A payload session on a cell with a force plate records the plate in every run."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.journal.plate import PLATE_RECORDING
from acquisition.runs.folder import RunFolder
from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.told import document


@pytest.mark.slow
def test_every_run_of_a_payload_session_records_the_force_plate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = load_cell("ir361")
    assert cell.config.plate is not None
    asked = design_two_harmonic(
        cell.robot,
        TwoHarmonicOptions(2.0, highest_harmonic=4, tries=8, seed=1, periods=2),
        cell.config.cycle_time_s,
    )
    motion = tmp_path / "motion.yaml"
    motion.write_text(to_yaml(asked))
    words = ["--rehearsal", "0", "--warm-up", "0", "--yes", "--json"]
    files = ["--motion", str(motion), "--runs", str(tmp_path / "runs")]
    assert run(["payload", "ir361", *files, *words]) in (0, 1)
    done = document(capsys)["done"]
    assert list(done) == ["unloaded", "loaded 1"]
    for run_id in done.values():
        folder = RunFolder.open(tmp_path / "runs" / run_id)
        assert PLATE_RECORDING in folder.manifest().files
        reaction = RunData.load(folder).recording.reaction
        assert reaction is not None
        assert reaction.valid.mean() > 0.99
