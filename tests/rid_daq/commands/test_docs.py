"""`docs CODE`: explanation of an error code without browser or network."""

from __future__ import annotations

import json

import pytest

from config.error_codes import declared_codes
from rid_daq.app import run


@pytest.mark.parametrize("name", ["RID-FILE-READ", "rid-file-read"])
def test_docs_explains_an_error_code(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = (each for each in declared_codes() if each.name == "RID-FILE-READ")
    assert run(["docs", name]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for text in (code.name, code.cause, code.remedy):
        assert text in shown


def test_docs_with_json_prints_a_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["docs", "RID-FILE-READ", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert set(document) == {"code", "cause", "remedy"}


def test_an_unknown_code_names_similar_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["docs", "RID-FILE-RED"]) == 2
    written = capsys.readouterr().err
    assert "RID-FILE-READ" in written
    assert "[RID-DOCS-PAGE]" in written
