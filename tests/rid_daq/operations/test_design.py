"""`design`: options of one kind of motion, and JSON requests."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError
from rid_daq.app import run
from rid_daq.operations.catalogue import operation
from rid_daq.operations.experiment.design import DesignRequest
from rid_daq.operations.experiment.motion_design import design_motion
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code

REQUIRED = {"cell": "ir361", "output": "motion.yaml"}


@pytest.mark.parametrize(
    "words",
    [
        "--tries 4",
        "--kind multisine --tries 4",
        "--kind multisine --for torque",
        "--kind reversed --slow",
        "--kind constant-velocity --period 3",
        "--kind constant-velocity --model model.json",
        "--method two-harmonic --starts 3",
        "--band 1:5",
    ],
)
def test_an_option_of_another_kind_of_motion_is_refused(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "motion.yaml"
    assert run(["design", "ir361", "-o", str(output), *words.split()]) == 2
    assert "[RID-OPTION-NO-EFFECT]" in capsys.readouterr().err
    assert not output.exists()


def test_wanted_parameters_and_a_criterion_exclude_each_other() -> None:
    request = DesignRequest.of(
        {**REQUIRED, "excitation": {"wanted": ("torque",), "criterion": "condition"}}
    )
    with raises_code(ConfigError, "RID-OPTION-EXCLUSIVE"):
        request.refuse_options_without_effect()


@pytest.mark.parametrize(
    ("excitation", "method", "harmonics"),
    [
        ({"period_s": 10.0, "starts": 3, "harmonics": 4}, "optimal", 4),
        ({"period_s": 10.0, "tries": 50}, "two-harmonic", None),
        ({"period_s": 10.0, "highest_harmonic": 6}, "two-harmonic", 6),
        ({"method": "two-harmonic", "harmonics": 6}, "two-harmonic", 6),
    ],
)
def test_a_request_selects_the_method_by_name_or_by_its_options(
    excitation: dict[str, object], method: str, harmonics: int | None
) -> None:
    found = DesignRequest.of_json({**REQUIRED, "excitation": excitation}).excitation
    assert (found.method, found.harmonics) == (method, harmonics)


def test_one_option_sets_all_fields_of_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["design", "ir361", "-o", str(tmp_path / "motion.yaml"), "--kind", "multisine"]
    assert run([*words, "--period", "4", "--periods", "100000"]) == 2
    assert "100000" in capsys.readouterr().err
    assert run([*words, "--period", "9.999"]) == 2
    assert "9.999" in capsys.readouterr().err


@pytest.mark.parametrize("band", ["5", "1:2:3", "low:high", "nan:5", "1:1e9"])
def test_a_band_that_is_not_two_frequencies_is_refused(
    band: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["design", "ir361", "-o", "motion.yaml", "--kind", "multisine", "--band", band]
    assert run(words) == 2
    assert capsys.readouterr().err.startswith("rid-daq: --band: ")


def test_a_client_cannot_set_a_scheduler() -> None:
    assert "scheduler" in operation("design").owned
    assert "scheduler" not in operation("design").schema()["properties"]  # type: ignore[operator]


def test_the_usual_period_is_a_whole_number_of_cycles(tmp_path: Path) -> None:
    output = tmp_path / "motion.yaml"
    quick = {"method": "two-harmonic", "tries": 1, "limit_fraction": 0.1, "periods": 2}
    request = {"cell": "kr15", "output": output, "excitation": quick}
    designed = design_motion(DesignRequest.of(request, shown="design"), Console())
    assert isinstance(designed.motion, FourierMotion)
    assert designed.motion.period_s == 9.996, "833 cycles of 12 ms"
