"""A simulated cell with `--pace` records the same rows as without it."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.runs.folder import RunFolder
from rid_daq.app import run

MOTION = """\
kind: fourier
robot: ir361
period_s: 1.6
periods: 2
ramp_s: 0.8
joints:
  - {joint: axis1, sine: [0.2], cosine: [0.0]}
  - {joint: axis2, sine: [0.1], cosine: [0.0]}
  - {joint: axis3, offset: 0.3, sine: [0.2], cosine: [0.0]}
"""


@pytest.mark.slow
def test_a_recording_does_not_depend_on_the_pace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "motion.yaml").write_text(MOTION)
    files = ["ir361", str(tmp_path / "motion.yaml"), "--runs", str(tmp_path), "--json"]
    recorded = []
    for words in ([], ["--pace", "20"]):
        begun_s = time.monotonic()
        assert run(["record", *files, *words]) == 0
        took_s = time.monotonic() - begun_s
        folder = RunFolder.open(Path(json.loads(capsys.readouterr().out)["folder"]))
        recorded.append(read_journal(folder.file("recording.mcap")).rows)
    free, paced = recorded
    assert took_s > len(paced) * 0.008 / 20.0
    np.testing.assert_array_equal(free, paced)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--pace", "1", "--realtime"], "exclude each other: give one option only"),
        (["--pace", "1000"], "at most 100"),
    ],
)
def test_an_invalid_pace_is_refused(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "motion.yaml").write_text(MOTION)
    assert run(["record", "ir361", str(tmp_path / "motion.yaml"), *words]) == 2
    assert message in " ".join(capsys.readouterr().err.replace("│", " ").split())
