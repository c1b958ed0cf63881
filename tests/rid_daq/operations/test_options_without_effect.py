"""Options without effect and outputs that would replace a file are refused at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from rid_daq.app import run

DESIGN = "design ir361 -o motion.yaml"
NO_EFFECT = "RID-OPTION-NO-EFFECT"


@pytest.mark.parametrize(
    ("words", "option", "code"),
    [
        (f"{DESIGN} --tries 9", "--tries", NO_EFFECT),
        (f"{DESIGN} --method two-harmonic --for sx3", "--for", NO_EFFECT),
        (f"{DESIGN} --method two-harmonic --given m.json", "--given", NO_EFFECT),
        (f"{DESIGN} --method two-harmonic --model m.json", "--model", NO_EFFECT),
        (f"{DESIGN} --no-slow", "--slow", NO_EFFECT),
        (f"{DESIGN} --kind reversed --band 1:2", "--band", NO_EFFECT),
        (f"{DESIGN} --kind multisine --harmonics 4", "--harmonics", NO_EFFECT),
        (f"{DESIGN} --kind constant-velocity --period 5", "--period", NO_EFFECT),
        (f"{DESIGN} --for sx3 --criterion condition", "--for", "RID-OPTION-EXCLUSIVE"),
        ("validate m.json latest --mass 9", "--mass", "RID-REQUEST-INVALID"),
        ("validate m.json latest --cell ir361", "--cell", NO_EFFECT),
        ("validate m.json here.yaml --limits 9", "--limits", NO_EFFECT),
        ("sensitivity --doubt-links 5", "--doubt-links", "RID-REQUEST-INVALID"),
        ("export m.json --to json -o table.csv", "table.csv", "RID-OUTPUT-ENDING"),
        ("export m.json --to csv -o arm.urdf", "arm.urdf", "RID-OUTPUT-ENDING"),
        ("payload ir361 --motion here.yaml --periods 3", "--motion", "RID-REQUEST-INVALID"),
        ("payload ir361 --resume latest --periods 18", "--resume", "RID-REQUEST-INVALID"),
        ("tracking latest --point 1,2,3", "--point", "RID-REQUEST-INVALID"),
        ("stiffness latest --point 1,2,3", "--point", "RID-REQUEST-INVALID"),
        (
            "compensate ir361 here.yaml --model m --loop l -o x --unfinished",
            "--unfinished",
            "RID-REQUEST-INVALID",
        ),
        (
            "stream ir361 here.yaml --model m --loop l --wait 9",
            "--wait",
            NO_EFFECT,
        ),
    ],
)
def test_an_option_without_effect_is_refused(
    words: str,
    option: str,
    code: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("here.yaml").write_text("kind: fourier")
    assert run(words.split()) == 2
    refused = capsys.readouterr().err
    assert option in refused
    assert f"[{code}]" in refused
    assert [path.name for path in tmp_path.iterdir()] == ["here.yaml"]


@pytest.mark.parametrize(
    "words",
    [
        "design ir361 -o",
        "identify latest -o",
        "payload identify --loaded latest -o",
        "payload export p.json --to kuka -o",
        "export m.json --to c -o",
        "loop latest -o",
        "compensate ir361 m.yaml --model m --loop l -o",
        "refine latest --model m --loop l -o",
        "sensitivity -o",
    ],
)
@pytest.mark.parametrize(
    ("name", "exit_code", "code"),
    [
        ("mine", 2, "RID-OUTPUT-EXISTS"),
        ("folder", 7, "RID-FILE-WRITE"),
        ("nowhere/mine", 7, "RID-FILE-WRITE"),
    ],
)
def test_an_unsuitable_output_is_refused_before_the_computation(
    words: str,
    name: str,
    exit_code: int,
    code: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine").write_text("a week's work")
    Path("folder").mkdir()
    assert run([*words.split(), name]) == exit_code
    refused = capsys.readouterr().err
    assert f"{name}: " in refused
    assert f"[{code}]" in refused
    assert Path("mine").read_text() == "a week's work"
