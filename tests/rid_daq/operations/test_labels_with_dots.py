"""Run labels that look like file names: commands that accept files or runs find the runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from rid_daq.app import run
from rid_daq.operations.stated_payload import payload_file
from tests.builders.raised_codes import raises_code

LABEL = "ur10 v1.json"


def test_a_payload_is_found_by_a_label_with_a_dot(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, LABEL)
    file = folder.write("payload.json", b"{}")
    assert payload_file(tmp_path, LABEL) == file
    assert payload_file(tmp_path, str(file)) == file
    with raises_code(ConfigError, "RID-RUN-UNKNOWN", "payload.json"):
        payload_file(tmp_path, "tool.json")


def test_compare_finds_a_run_by_a_label_with_a_dot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = RunFolder.create(tmp_path, LABEL).run_id
    assert run(["compare", LABEL, LABEL, "--runs", str(tmp_path)]) == 2
    refusal = capsys.readouterr().err
    assert "RID-OPTION-EXCLUSIVE" in refusal, "both names are the same run"
    assert found in refusal
