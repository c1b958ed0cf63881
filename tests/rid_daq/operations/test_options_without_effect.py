"""An option without effect, or a file that nobody meant to replace, is refused at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from rid_daq.app import run

DESIGN = "design ir361 -o motion.yaml"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (f"{DESIGN} --tries 9", "--tries: has no effect with --kind excitation"),
        (f"{DESIGN} --method two-harmonic --for sx3", "--for: has no effect with --kind exc"),
        (f"{DESIGN} --method two-harmonic --given m.json", "--given: has no effect"),
        (f"{DESIGN} --method two-harmonic --model m.json", "--model: has no effect"),
        (f"{DESIGN} --no-slow", "--slow: has no effect with --kind excitation"),
        (f"{DESIGN} --kind reversed --band 1:2", "--band: has no effect with --kind reversed"),
        (f"{DESIGN} --kind multisine --harmonics 4", "--harmonics: has no effect with --kind mul"),
        (f"{DESIGN} --kind constant-velocity --period 5", "--period: has no effect with --kind"),
        (f"{DESIGN} --for sx3 --criterion condition", "--for replaces --criterion"),
        ("validate m.json latest --mass 9", "--mass: has no effect without --base-limits"),
        ("validate m.json latest --cell ir361", "--cell: has no effect with a run"),
        ("validate m.json here.yaml --limits 9", "--limits: has no effect with a motion file"),
        ("sensitivity --doubt-links 5", "--doubt-links: has no effect without --draws"),
        (
            "stream ir361 here.yaml --model m --loop l --wait 9",
            "--wait has no effect with a motion file",
        ),
    ],
)
def test_an_option_without_effect_is_refused(
    words: str,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("here.yaml").write_text("kind: fourier")
    assert run(words.split()) == 2
    assert told in capsys.readouterr().err
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
    ("name", "code", "told"),
    [
        ("mine", 2, "mine: the file exists already; give another name, or --overwrite"),
        ("folder", 7, "folder: cannot be written, because it is not a regular file"),
        ("nowhere/mine", 7, "nowhere/mine: cannot be written: folder nowhere does not exist"),
    ],
)
def test_an_output_is_judged_before_anything_is_computed(
    words: str,
    name: str,
    code: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine").write_text("a week's work")
    Path("folder").mkdir()
    assert run([*words.split(), name]) == code
    assert told in capsys.readouterr().err
    assert Path("mine").read_text() == "a week's work"
