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


@pytest.mark.slow
def test_every_run_of_a_payload_session_records_the_force_plate(
    tmp_path: Path,
) -> None:
    cell = load_cell("ir361")
    assert cell.config.plate is not None
    excitation = design_two_harmonic(
        cell.robot,
        TwoHarmonicOptions(2.0, highest_harmonic=4, tries=8, seed=1, periods=2),
        cell.config.cycle_time_s,
    )
    motion = tmp_path / "motion.yaml"
    motion.write_text(to_yaml(excitation))
    words = ["--rehearsal", "0", "--warm-up", "0", "--yes", "--json"]
    files = ["--motion", str(motion), "--runs", str(tmp_path / "runs")]
    # without a payload the estimated mass can be negative, which gives exit code 6
    assert run(["payload", "ir361", *files, *words]) in (0, 1, 6)
    folders = [RunFolder.open(path) for path in sorted((tmp_path / "runs").iterdir())]
    recorded = [folder for folder in folders if "recording.mcap" in folder.manifest().files]
    assert len(recorded) == 2
    for folder in recorded:
        assert PLATE_RECORDING in folder.manifest().files
        reaction = RunData.load(folder).recording.reaction
        assert reaction is not None
        assert reaction.valid.mean() > 0.99
