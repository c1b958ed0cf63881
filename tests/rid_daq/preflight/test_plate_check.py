"""The force plate's lines of the preflight, on the simulated amplifier alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from acquisition.session.plate_preparation import prepare_plate
from config.cell.cell import CellConfig
from config.cell.plate import PlateZero
from config.errors import TransportError
from config.load import load_cell
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.amplifier import open_amplifier
from rid_daq.app import run
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.plate_check import PlateCheck
from tests.builders.raised_codes import raises_code

Serve = Callable[..., Any]
SENSITIVITIES = (-7.5,) * 4 + (-3.8,) * 4


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 20.0)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", ())


def cell_on(plate: Any) -> CellConfig:
    return load_cell("ir361").config.model_copy(update={"plate": plate, "simulated": False})


def lines_of(served: Any, **changes: object) -> dict[str, CheckLine]:
    plate = served.plate.model_copy(update=changes)
    check = PlateCheck(cell_on(plate), served.profile)
    return {line.what: line for line in [*check.before(), *check.after()]}


def red_subjects(lines: dict[str, CheckLine]) -> list[str]:
    return [what for what, line in lines.items() if line.verdict == "red"]


def test_a_zeroed_plate_gives_no_red_line(serve_amplifier: Serve) -> None:
    served = serve_amplifier()
    prepare_plate(served.plate, served.profile, operate=True)
    lines = lines_of(served)
    assert red_subjects(lines) == []
    assert lines["amplifier"].found.startswith("rid-daq,simulated")
    assert lines["settings read back"].found == "21"
    assert "force at rest" in lines


def test_an_overloaded_serial_line_is_red(
    serve_amplifier: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rid_daq.preflight.plate_check.LINE_LOAD_LIMIT", 0.01)
    served = serve_amplifier()
    prepare_plate(served.plate, served.profile, operate=True)
    assert red_subjects(lines_of(served)) == ["line load"]


def test_an_amplifier_in_reset_is_red_and_stays_in_reset(serve_amplifier: Serve) -> None:
    served = serve_amplifier()
    lines = lines_of(served)
    assert red_subjects(lines) == ["channels measure"]
    assert "plate zero" in lines["channels measure"].next_action
    assert "force at rest" not in lines
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        assert not amplifier.is_operating()


def test_a_changed_range_makes_the_zero_invalid(serve_amplifier: Serve) -> None:
    served = serve_amplifier()
    prepare_plate(served.plate, served.profile, operate=True)
    other = served.plate.amplifier.model_copy(
        update={"range_n": (2500.0, *served.plate.amplifier.range_n[1:])}
    )
    lines = lines_of(served, amplifier=other)
    assert red_subjects(lines) == ["channels measure"]
    assert "reset the charge" in lines["channels measure"].found


def stream_some(served: Any) -> None:
    """Read 500 rows, so that simulated time advances."""
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.start()
        rows = 0
        while rows < 500:
            rows += len(amplifier.read(amplifier._link.clock.now_s() + 20.0).rows)


@pytest.mark.fault(29)
def test_a_force_beyond_five_newtons_is_red_by_channel(
    serve_amplifier: Serve, measured: Callable[[str], None]
) -> None:
    jump = (0.0, 0.0, 45.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    truth = SimulatedPlate(sensitivity_pc_n=SENSITIVITIES, zero_jump_pc=jump)
    served = serve_amplifier(truth=truth)
    prepare_plate(served.plate, served.profile, operate=True)
    stream_some(served)
    lines = lines_of(served)
    assert red_subjects(lines) == ["force at rest"]
    channel, newtons, _ = lines["force at rest"].found.split()
    assert channel == "fy14"
    assert float(newtons) == pytest.approx(-6.0, abs=0.1)
    zero = PlateZero(offset_n=(0.0, 0.0, -6.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert red_subjects(lines_of(served, zero=zero)) == []
    measured("a force of 6 N at rest: red")


def test_an_overload_is_red_and_named_once(serve_amplifier: Serve) -> None:
    jump = (0.0, 0.0, 0.0, 0.0, 0.0, 60_000.0, 0.0, 0.0)
    truth = SimulatedPlate(sensitivity_pc_n=SENSITIVITIES, zero_jump_pc=jump)
    served = serve_amplifier(truth=truth)
    prepare_plate(served.plate, served.profile, operate=True)
    stream_some(served)
    lines = lines_of(served)
    assert "overloads" in red_subjects(lines)
    assert lines["overloads"].found == "fz2"


def test_a_missing_plate_is_refused_by_its_address(serve_amplifier: Serve, tmp_path: Any) -> None:
    served = serve_amplifier()
    gone = served.plate.amplifier.model_copy(update={"address": str(tmp_path / "none")})
    with raises_code(TransportError, "RID-SERIAL-OPEN", "plate.amplifier.address"):
        lines_of(served, amplifier=gone)


@pytest.mark.slow
def test_checking_the_bundled_cell_includes_its_plate(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "ir361", "--seconds", "0.3", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    found = {line["what"]: line["verdict"] for line in document["lines"]}
    assert found["channels measure"] == "ok"
    assert found["settings read back"] == "ok"
    assert found["force at rest, plate never zeroed"] == "shown"
