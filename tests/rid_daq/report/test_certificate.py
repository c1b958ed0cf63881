"""The certificate of a payload: contents, page, PDF, and refused sessions."""

from __future__ import annotations

import html
import json
import re
import shutil
from pathlib import Path

import pytest
from pypdf import PdfReader

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, RunStatus
from config.errors import ConfigError, DataQualityError, RecordingError
from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from identification.payload.file import read_payload
from rid_daq.app import run
from rid_daq.operations.payload.certified_session import certificate_of, write_certificate
from rid_daq.operations.payload.payload_certificate import PayloadCertificateRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.report.certificate import Certificate
from rid_daq.report_page.printed_page import BROWSERS, print_pdf
from rid_daq.report_page.render import render_certificate
from rid_daq.terminal.choices import CERTIFICATE
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.job_events import SessionState
from tests.builders.certified import (
    Session,
    certified_session,
    note_payload,
    with_unseen_inertia,
    without_checks,
)
from tests.builders.raised_codes import raises_code

NAME = "Jörg Łukasz Ωmega Дарья 山田"


@pytest.fixture(scope="module")
def stored_session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return certified_session(tmp_path_factory.mktemp("kept") / "runs")


@pytest.fixture
def session(stored_session: Session, tmp_path: Path) -> Session:
    """Return a copy of the session that a test can change."""
    runs = shutil.copytree(stored_session.folder.path.parent, tmp_path / "runs")
    folder = RunFolder.open(runs / stored_session.folder.run_id)
    return Session(folder, SessionFile.read(folder), stored_session.payload)


@pytest.fixture(scope="module")
def text(stored_session: Session) -> str:
    return page_text(certificate_of(stored_session.folder, NAME))


def page_text(certificate: Certificate) -> str:
    page = render_certificate(certificate).partition("</head>")[2]
    page = re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)
    shown = html.unescape(re.sub(r"<[^>]*>", " ", page))
    return " ".join(shown.replace("\N{MINUS SIGN}", "-").split())


def row_of(text: str, quantity: str) -> tuple[float, float]:
    """Return value and interval of the first row of a quantity [kg or mm]."""
    found = re.search(rf"{quantity} (-?[\d.]+) ± ([\d.]+) (?:kg|mm)", text)
    assert found is not None, quantity
    return float(found[1]), float(found[2])


def test_the_residual_of_every_axis_has_noise_and_grade(text: str) -> None:
    for joint in ("axis1", "axis6"):
        assert f"{joint} N m 0.5 0.5 5 good" in text


def test_the_numbers_equal_those_of_the_payload_file(stored_session: Session, text: str) -> None:
    estimate = read_payload(stored_session.folder.file("payload.json")).estimate
    names = ["mass m", *(f"centre of gravity {name}" for name in REPORTED[1:4])]
    names += [f"inertia {name}" for name in REPORTED[4:]]
    rows = zip(names, REPORTED_UNITS, estimate.reported, estimate.sigma, strict=True)
    for name, unit, expected, sigma in rows:
        factor = 1e3 if unit == "m" else 1.0
        value, interval = row_of(text, name)
        two_sigma = 2.0 * factor * sigma
        assert interval == pytest.approx(two_sigma, rel=0.05)
        assert value == pytest.approx(factor * expected, abs=0.05 * two_sigma)


def test_load_data_equal_those_of_the_exported_payload(stored_session: Session, text: str) -> None:
    text = text.partition("Load data for a controller")[2]
    body = stored_session.payload.estimate.body
    assert f"mass m {body.mass_kg:.6g} kg" in text
    for name, value in zip(REPORTED[1:4], body.centre_m, strict=True):
        assert f"centre of gravity {name} {1e3 * value:.6g} mm" in text
    for name, value in zip(REPORTED[4:], body.reported[4:], strict=True):
        assert f"inertia {name} {value:.6g} kg m²" in text
    for moment in body.principal[0]:
        assert re.search(rf"principal moment about \([^)]+\) {moment:.6g} kg m²", text)
    assert "Frame: the flange, which is the tool frame of the robot file" in text


def test_the_certificate_states_person_time_cell_method_and_files(
    stored_session: Session, text: str
) -> None:
    manifest = stored_session.folder.manifest()
    assert manifest.finished_utc is not None
    for stamp in (manifest.created_utc, manifest.finished_utc):
        assert f"{stamp[:19].replace('T', ' ')} UTC" in text
    assert "Passed: the payload's mass is" in text
    assert "interval of the mass (2σ)" in text
    assert f"gripper 4 ({stored_session.folder.run_id})" in text
    assert f"By {NAME}" in text
    assert f"{NAME} Date Signature" in text
    assert "robot kr15 not recorded" in text
    assert "(node 5) 7005" in text
    assert "(node 6) not recorded" in text
    for step, run_id in stored_session.state.done.items():
        used = "yes" if run_id in stored_session.payload.estimate.run_ids else "no"
        assert f"{step} {run_id} {used}" in text
        entry = (
            RunFolder.open(stored_session.folder.path.parent / run_id)
            .manifest()
            .files["recording.mcap"]
        )
        assert f"{run_id} recording.mcap {entry.sha256}" in text
    assert f"payload.json {manifest.files['payload.json'].sha256}" in text
    assert "Recorded with rid-daq 0.1.0" in text


def test_every_page_of_a_simulated_cell_is_marked_and_numbered(
    session: Session, tmp_path: Path
) -> None:
    if not any(map(shutil.which, BROWSERS)):
        pytest.skip("no Chromium is installed")
    page, output = tmp_path / "page.html", tmp_path / "page.pdf"
    page.write_text(render_certificate(certificate_of(session.folder, None)), encoding="utf-8")
    print_pdf(page, output)
    pages = [each.extract_text() for each in PdfReader(output).pages]
    assert len(pages) > 1
    for number, each in enumerate(pages, start=1):
        assert "SIMULATED" in each
        assert f"page {number} of {len(pages)}" in each


def test_without_chromium_the_page_is_written_and_a_pdf_is_refused(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rid_daq.report_page.printed_page.BROWSERS", ("no-such-browser",))
    request = PayloadCertificateRequest(
        session=session.folder.run_id, runs=session.folder.path.parent
    )
    with raises_code(ConfigError, "RID-PDF-BROWSER", "certificate.html"):
        write_certificate(request)
    assert session.folder.file("certificate.html").exists()
    assert not session.folder.file(CERTIFICATE).exists()


def test_a_browser_that_fails_is_named(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rid_daq.report_page.printed_page.BROWSERS", ("false",))
    request = PayloadCertificateRequest(
        session=session.folder.run_id, runs=session.folder.path.parent
    )
    with raises_code(RecordingError, "RID-PDF-FAILED", "false"):
        write_certificate(request)


def test_a_certificate_of_a_real_cell_is_not_marked_as_simulated(tmp_path: Path) -> None:
    real = certified_session(tmp_path / "runs", simulated=False)
    text = page_text(certificate_of(real.folder, None))
    assert "simulated" not in text.lower()
    assert "By not recorded" in text


def test_equal_sessions_give_equal_pages(session: Session) -> None:
    output = session.folder.file("certificate.html")
    runs = session.folder.path.parent
    request = PayloadCertificateRequest(
        session=session.folder.run_id, runs=runs, by=NAME, output=output, overwrite=True
    )
    _, file = write_certificate(request)
    first = file.read_bytes()
    write_certificate(request)
    assert file.read_bytes() == first
    # The certificate now belongs to the run and is not an unknown file.
    assert "certificate.html" in session.folder.manifest().files
    assert session.folder.strays() == ()


def test_latest_selects_the_session_even_if_its_runs_are_newer(session: Session) -> None:
    runs = session.folder.path.parent
    request = PayloadCertificateRequest(
        session="latest", runs=runs, output=runs / "latest.html", overwrite=True
    )
    certificate, _ = write_certificate(request)
    assert certificate.folder.run_id == session.folder.run_id


def test_latest_does_not_skip_an_unfinished_session(tmp_path: Path) -> None:
    certified_session(tmp_path / "runs")
    SessionFile.begin(RunFolder.create(tmp_path / "runs", "later", kind="payload session"), "kr15")
    request = PayloadCertificateRequest(session="latest", runs=tmp_path / "runs")
    with raises_code(DataQualityError, "RID-CERTIFICATE-NOT-READY"):
        write_certificate(request)


def test_a_failed_verdict_is_certified_as_failed_and_gives_no_load_data(tmp_path: Path) -> None:
    failed = certified_session(tmp_path / "runs", mass_percent=0.1)
    text = page_text(certificate_of(failed.folder, None))
    assert "Failed: interval of the mass (2σ)" in text
    assert "Passed" not in text
    assert "No load data: the payload has not passed the verdict." in text
    assert "principal moment" not in text


def test_an_unidentifiable_parameter_has_no_number(session: Session) -> None:
    note_payload(session.folder, with_unseen_inertia(session.payload))
    text = page_text(certificate_of(session.folder, None))
    assert "inertia Izz not identified kg m²" in text
    assert "Failed" in text


@pytest.mark.parametrize("by", ["", "  ", "x" * 201])
def test_an_empty_or_too_long_name_is_refused(by: str) -> None:
    with raises_code(ConfigError, "RID-REQUEST-INVALID", "--by"):
        PayloadCertificateRequest.of({"session": "latest", "by": by}, flags=True)


def test_a_run_of_payload_identify_is_certified(session: Session) -> None:
    loaded = RunFolder.open(session.folder.path.parent / session.state.done["loaded 1"])
    note_payload(loaded, session.payload)
    certificate = certificate_of(loaded, None)
    text = page_text(certificate)
    assert not certificate.is_session
    assert [each.run_id for _, each in certificate.runs] == list(session.payload.estimate.run_ids)
    assert f"gripper 4 3 ({loaded.run_id})" in text


@pytest.mark.parametrize("at", [each for each in SessionState if each is not SessionState.DONE])
def test_a_session_that_is_not_finished_is_refused(
    session: Session, at: SessionState, capsys: pytest.CaptureFixture[str]
) -> None:
    session.state.state = at
    session.state.write()
    assert run(["payload", "certificate", str(session.folder.path)]) == ExitCode.DATA_QUALITY
    output = " ".join(capsys.readouterr().err.split())
    assert f"(state: {at.value}; done: warm-up, unloaded, loaded 1) and has no verdict" in output
    assert f"rid-daq payload kr15 --resume {session.folder.run_id}" in output
    assert not (session.folder.path / CERTIFICATE).exists()


def test_a_session_without_a_verdict_is_refused(session: Session) -> None:
    note_payload(session.folder, without_checks(session.payload))
    with raises_code(DataQualityError, "RID-CERTIFICATE-NOT-READY"):
        certificate_of(session.folder, None)


def test_a_run_without_a_payload_is_refused(session: Session) -> None:
    other = RunFolder.open(session.folder.path.parent / session.state.done["unloaded"])
    with raises_code(DataQualityError, "RID-CERTIFICATE-NOT-READY"):
        certificate_of(other, None)


def test_a_run_that_was_never_finished_is_refused(session: Session) -> None:
    other = RunFolder.open(session.folder.path.parent / session.state.done["loaded 1"])
    begun = other.manifest().model_copy(update={"status": RunStatus.UNFINISHED})
    (other.path / MANIFEST).write_text(begun.model_dump_json(), encoding="utf-8")
    with raises_code(DataQualityError, "RID-RUN-UNFINISHED"):
        certificate_of(session.folder, None)


def test_a_payload_file_that_differs_from_the_result_is_refused(session: Session) -> None:
    result = json.loads(session.folder.read("result.json"))
    result["payload"]["parameters"][0]["value"] *= 1.01
    session.folder.write("result.json", json.dumps(result).encode())
    with raises_code(DataQualityError, "RID-CERTIFICATE-NOT-READY"):
        certificate_of(session.folder, None)


@pytest.mark.parametrize("name", ["recording.mcap", "robot.yaml", "drive_writes.jsonl"])
def test_a_changed_file_is_refused(session: Session, name: str) -> None:
    other = RunFolder.open(session.folder.path.parent / session.state.done["loaded 1"])
    with other.file(name).open("ab") as file:
        file.write(b"\n")
    with raises_code(RecordingError, "RID-RUN-CHANGED", "SHA-256"):
        certificate_of(session.folder, None)


def test_an_existing_file_is_replaced_only_with_overwrite(
    session: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine.html"
    words = ["payload", "certificate", str(session.folder.path), "-o", str(out), "--json"]
    assert run(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["file"] == str(out)
    assert document["simulated"] is True
    assert document["verdict"]["passed"] is True
    assert run(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert run([*words, "--overwrite"]) == 0


def test_a_certificate_with_another_file_type_is_refused(session: Session, tmp_path: Path) -> None:
    request = PayloadCertificateRequest(
        session=session.folder.run_id, runs=session.folder.path.parent, output=tmp_path / "c.txt"
    )
    with raises_code(ConfigError, "RID-OUTPUT-ENDING", "c.txt"):
        write_certificate(request)
