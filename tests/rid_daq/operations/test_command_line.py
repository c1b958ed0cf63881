"""The command line of an operation: arguments, exit codes and messages."""

from __future__ import annotations

import json

import pytest

from rid_daq.app import run

WORDS = ["retime", "ir361", "path.yaml", "--model", "model.json", "-o", "fast.yaml"]


@pytest.mark.parametrize(
    ("more", "code"),
    [
        (["--margin", "2"], "RID-OPTION-RANGE"),
        (["--jerk", "1", "--jerk", "-3"], "RID-OPTION-RANGE"),
        (["--jerk", "fast"], "RID-REQUEST-INVALID"),
        (["--mass", "20"], "RID-REQUEST-INVALID"),
        (["--base-limits", "--mass", "1e7"], "RID-OPTION-RANGE"),
    ],
)
def test_a_bad_value_has_a_stable_code(
    more: list[str], code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*WORDS, *more, "--json"]) == 2
    captured = capsys.readouterr()
    problem = json.loads(captured.out)["error"]
    assert (problem["code"], problem["exit_code"]) == (code, 2)
    assert captured.err.startswith(f"rid-daq: {more[-2]}: ")


@pytest.mark.parametrize("words", [WORDS[:2], WORDS[:3], [*WORDS, "--mas", "3"], [*WORDS, "extra"]])
def test_a_mistyped_option_gives_exit_code_2(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*words, "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("Usage: rid-daq retime ")
    assert json.loads(captured.out)["error"]["kind"] == "UsageError"


def test_help_gives_exit_code_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["retime", "--help"]) == 0
    text = capsys.readouterr().out
    titles = ["Arguments:", "Options:", "Limits:", "Files and services:", "Examples:"]
    places = [text.index(f"\n{title}\n") for title in titles]
    assert places == sorted(places)
