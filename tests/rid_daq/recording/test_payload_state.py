"""State of a payload session between two starts of the program."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.app import run
from rid_daq.operations.payload.payload_identify import KnownQuantity, VerdictLimits
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.payload.session_steps import rehearsal_motion
from tests.builders.raised_codes import raises_code


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path, "payload", kind="payload session")


def test_every_step_is_written_when_it_is_done(folder: RunFolder) -> None:
    state = SessionFile.begin(folder, "kr15")
    state.note_step("warm-up", "RUN1")
    state.note_fact("warm_up", {"verdict": "settled"})
    state.note_step("unloaded", "RUN2")
    state.note_step("loaded 1", "RUN3")
    again = SessionFile.read(folder)
    assert (again.cell, again.done, again.facts) == ("kr15", state.done, state.facts)
    assert again.measurements == ("unloaded", "loaded 1")


def test_rehearsal_and_warm_up_are_not_used_for_identification(folder: RunFolder) -> None:
    file = SessionFile.begin(folder, "kr15")
    for step in ("rehearsal", "warm-up", "unloaded", "loaded 12"):
        file.note_step(step, "RUN")
    assert file.measurements == ("unloaded", "loaded 12")


def test_a_folder_without_a_session_is_named(folder: RunFolder) -> None:
    with raises_code(ConfigError, "RID-SESSION-STATE"):
        SessionFile.read(folder)


def test_the_wrong_key_of_an_edited_state_is_named(folder: RunFolder) -> None:
    SessionFile.begin(folder, "kr15")
    document = json.loads(folder.read("session.json"))
    document["done"] = 3
    folder.write("session.json", json.dumps(document).encode())
    with raises_code(ConfigError, "RID-SESSION-STATE", "done:"):
        SessionFile.read(folder)


def test_a_rehearsal_is_one_slow_period_of_whole_cycles() -> None:
    cell = load_cell("ir361")
    cycle_s = cell.config.cycle_time_s
    motion = design_two_harmonic(
        cell.robot,
        TwoHarmonicOptions(4.0, highest_harmonic=4, tries=1, limit_fraction=0.3, seed=1),
        cycle_s,
    )
    slow = rehearsal_motion(motion, 0.3, cycle_s)
    assert (slow.periods, slow.transient_periods) == (1, 0)
    assert slow.period_s >= motion.period_s / 0.3
    assert slow.period_s / cycle_s == pytest.approx(round(slow.period_s / cycle_s), abs=1e-9)
    assert slow.period_s < motion.period_s / 0.3 + cycle_s


def test_a_resumed_session_keeps_its_options_unless_given_again(
    folder: RunFolder,
) -> None:
    begun = PayloadSessionRequest(
        cell="kr15",
        runs=folder.path.parent,
        model=Path("model.json"),
        known=(KnownQuantity(name="m", value=2.8, sigma=0.005),),
        warm_up_percent=0.0,
        repeats=2,
        practise=True,
        limits=VerdictLimits(mass_percent=2.0),
    )
    SessionFile.begin(folder, "kr15", begun.choices)
    request = SessionFile.read(folder).request
    again = PayloadSessionRequest(cell="kr15", runs=folder.path.parent, resume="latest", yes=True)
    kept = again.with_original_options(request)
    assert kept.model == Path("model.json").absolute()
    assert (kept.warm_up_percent, kept.repeats, kept.known) == (0.0, 2, begun.known)
    assert (kept.limits, kept.resume, kept.yes) == (begun.limits, "latest", True)
    assert kept.practise
    warm = {"warm_up_percent": 1.0, "limits": VerdictLimits(centre_mm=1.0)}
    kept = again.model_copy(update=warm).with_original_options(request)
    assert (kept.warm_up_percent, kept.repeats) == (1.0, 2)
    assert kept.limits == VerdictLimits(mass_percent=2.0, centre_mm=1.0)
    with raises_code(ConfigError, "RID-SESSION-STATE", "--resume", "latest", "repeats"):
        again.with_original_options({"repeats": "many"})


def test_a_resumed_session_refuses_another_motion(
    folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = load_cell("ir361")
    motion = design_two_harmonic(
        cell.robot,
        TwoHarmonicOptions(4.0, highest_harmonic=4, tries=1, limit_fraction=0.3, seed=1),
        cell.config.cycle_time_s,
    )
    for name, content in cell.files.items():
        folder.write(name, content)
    folder.write("motion.yaml", to_yaml(motion).encode())
    SessionFile.begin(folder, "ir361")
    other = tmp_path / "other.yaml"
    other.write_text(to_yaml(motion.model_copy(update={"periods": motion.periods + 1})))
    words = ["payload", "ir361", "--yes", "--runs", str(tmp_path), "--resume", folder.run_id]
    assert run([*words, "--motion", str(other)]) == 2
    error = capsys.readouterr().err
    assert "RID-OPTION-NO-EFFECT" in error
    assert str(other) in error.replace("\n", "")


def test_an_option_given_again_applies_even_with_its_default_value(folder: RunFolder) -> None:
    begun = PayloadSessionRequest(
        cell="kr15",
        runs=folder.path.parent,
        model=Path("model.json"),
        known=(KnownQuantity(name="m", value=12.0, sigma=0.005),),
        repeats=3,
        limits=VerdictLimits(mass_percent=20.0, centre_mm=30.0),
    )
    again = PayloadSessionRequest(cell="kr15", runs=folder.path.parent, resume="latest")
    usual = VerdictLimits(**VerdictLimits().model_dump())  # each limit is given explicitly
    taken_back = {"known": (), "model": None, "repeats": 1, "limits": usual}
    kept = again.model_copy(update=taken_back).with_original_options(begun.choices)
    assert (kept.known, kept.model, kept.repeats) == ((), None, 1)
    assert kept.limits == VerdictLimits()
    usual = VerdictLimits(mass_percent=VerdictLimits().mass_percent)
    kept = again.model_copy(update={"limits": usual}).with_original_options(begun.choices)
    assert kept.limits == VerdictLimits(centre_mm=30.0)
    assert (kept.known, kept.repeats) == (begun.known, 3)
    without = begun.model_copy(update={"model": None})
    assert again.with_original_options(without.choices).model is None
