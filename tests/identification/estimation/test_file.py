from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.errors import ConfigError, EstimationError, RecordingError
from identification.estimation.estimate import Estimate, predict
from identification.estimation.file import EstimateDocument, read_estimate, write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from tests.builders.changed_json import NASTY, change, places
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm


@pytest.fixture(scope="module")
def estimate(arm: KnownArm, measure: Callable[..., Recording]) -> Estimate:
    return fit_periodic(
        arm.robot,
        [average_periods(measure())],
        EstimationOptions(model=ModelOptions(sign_smoothing_rad_s=0.01)),
    ).estimate(cell_name="ir361", run_ids=("01ABC",))


@pytest.fixture
def path(tmp_path: Path, estimate: Estimate) -> Path:
    write_estimate(tmp_path / "model.json", estimate)
    return tmp_path / "model.json"


def test_an_estimate_is_read_back_as_written(path: Path, estimate: Estimate) -> None:
    found = read_estimate(path)
    for field in fields(Estimate):
        old, new = getattr(estimate, field.name), getattr(found, field.name)
        if field.name == "base":
            assert (new.expressions, new.kept, new.unseen) == (
                old.expressions,
                old.kept,
                old.unseen,
            )
            np.testing.assert_array_equal(new.combination, old.combination)
        elif isinstance(old, np.ndarray):
            np.testing.assert_array_equal(new, old)
        else:
            assert new == old, field.name


@pytest.mark.parametrize("other", [1, 4, 6])
def test_a_file_of_another_format_is_refused(path: Path, other: int) -> None:
    with pytest.raises(ConfigError) as refused:
        read_estimate(edit_file(path, lambda d: d.update(format=other)))
    assert refused.value.refusal == "RID-FILE-FORMAT"
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize("key", EstimateDocument.model_fields)
def test_every_key_of_the_file_is_required(path: Path, key: str) -> None:
    with raises_code(ConfigError, "RID-FILE-VALUE", f"{path}: ", f" {key}: "):
        read_estimate(edit_file(path, lambda d: d.pop(key)))


def test_the_file_alone_suffices_to_predict(path: Path, estimate: Estimate) -> None:
    q, v, a = np.random.default_rng(0).normal(size=(3, 10, 3))
    np.testing.assert_array_equal(predict(read_estimate(path), q, v, a), predict(estimate, q, v, a))


def test_an_estimate_from_residuals_alone_stays_one(tmp_path: Path, estimate: Estimate) -> None:
    bare = replace(estimate, covariance_noise=None, noise_nm=None, method="smoothed", periods=0)
    write_estimate(tmp_path / "model.json", bare)
    found = read_estimate(tmp_path / "model.json")
    assert found.covariance_noise is None
    assert found.noise_nm is None
    np.testing.assert_array_equal(found.sigma, bare.sigma)


def test_the_same_estimate_gives_the_same_bytes(path: Path, tmp_path: Path) -> None:
    write_estimate(tmp_path / "again.json", read_estimate(path))
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_the_file_has_names_descriptions_units_and_both_deviations(path: Path) -> None:
    document = json.loads(path.read_text())
    first = document["parameters"][0]
    assert first["words"] == "Izz1 + Iyy2 + 0.2304 m3 + Iyy3 + 14641 Im1"
    assert first["unit"] == "kg m^2"
    assert first["sigma"] >= first["sigma_noise"] > 0.0
    assert first["sigma_residual"] > 0.0
    assert document["cell"] == "ir361"
    assert document["software"].startswith("rid-daq ")
    assert document["robot"]["name"] == "ir361"


def _both(matrix: list[list[float]], row: int, column: int, value: float) -> None:
    matrix[row][column] = matrix[column][row] = value


def _without_the_last(document: dict[str, Any]) -> None:
    document["parameters"].pop()


def edit_file(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    ("change", "code", "detail"),
    [
        (lambda d: d.update(kind="something else"), "RID-FILE-VALUE", " kind: "),
        (lambda d: d.pop("robot"), "RID-FILE-VALUE", " robot: "),
        (
            lambda d: d["parameters"][0].update(value="12"),
            "RID-FILE-VALUE",
            " parameters.0.value:",
        ),
        (lambda d: d["parameters"][0].update(name="Izz9"), "RID-MODEL-UNSOUND", " Izz9 "),
        (lambda d: d["standard_parameters"].reverse(), "RID-MODEL-UNSOUND", " Izz1, sy2, "),
        (
            lambda d: d.update(covariance_residual=[[1.0]]),
            "RID-MODEL-UNSOUND",
            " covariance_residual ",
        ),
        (
            lambda d: d["parameters"][5].update(sigma=-1.0),
            "RID-FILE-VALUE",
            " parameters.5.sigma:",
        ),
        (lambda d: d.update(band_hz=-10.0), "RID-FILE-VALUE", " band_hz: "),
        (lambda d: d["residual_nm"].__setitem__(0, -1.0), "RID-FILE-VALUE", " residual_nm.0: "),
        (lambda d: d.update(combination=[[1.0, 2.0], [3.0]]), "RID-MODEL-UNSOUND", "(2,)"),
    ],
)
def test_a_changed_file_is_refused_with_the_position(
    path: Path, change: Callable[[dict[str, Any]], None], code: str, detail: str
) -> None:
    with raises_code(ConfigError, code, f"{path}: ", detail):
        read_estimate(edit_file(path, change))


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["covariance_honest"][3].__setitem__(3, -1.0),
        lambda d: d["covariance_residual"][3].__setitem__(3, -1.0),
        lambda d: d["covariance_noise"][3].__setitem__(3, -1.0),
        lambda d: d["covariance_honest"][3].__setitem__(4, 1e3),
        lambda d: _both(d["covariance_honest"], 3, 4, 1e3),
        lambda d: d["parameters"].__setitem__(slice(0, 2), d["parameters"][1::-1]),
        lambda d: d["parameters"].__setitem__(1, d["parameters"][0]),
        lambda d: d["parameters"][0].update(sigma=2.0 * d["parameters"][0]["sigma"]),
        lambda d: d["parameters"][0].update(sigma_residual=0.0),
        lambda d: d["parameters"][0].update(unit="kg"),
        lambda d: d["combination"].__setitem__(slice(0, 2), d["combination"][1::-1]),
        _without_the_last,
    ],
)
def test_a_contradictory_model_is_refused(
    path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    with pytest.raises(ConfigError) as refused:
        read_estimate(edit_file(path, change))
    assert str(refused.value).startswith(str(path))
    assert refused.value.refusal == "RID-MODEL-UNSOUND"


def test_not_json_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.json").write_text("Izz1 = 3")
    with raises_code(ConfigError, "RID-FILE-SYNTAX"):
        read_estimate(tmp_path / "text.json")
    with raises_code(ConfigError, "RID-FILE-READ"):
        read_estimate(tmp_path / "none.json")
    with raises_code(ConfigError, "RID-FILE-READ"):
        read_estimate(tmp_path)


def test_a_folder_that_is_not_writable_is_an_error(tmp_path: Path, estimate: Estimate) -> None:
    with raises_code(RecordingError, "RID-FILE-WRITE"):
        write_estimate(tmp_path / "nowhere" / "model.json", estimate)


@settings(max_examples=100)
@given(number=st.integers(0, 10_000), nasty=st.sampled_from((None, *NASTY)))
def test_a_changed_model_causes_only_our_errors(
    number: int,
    nasty: str | None,
    estimate: Estimate,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    path = tmp_path_factory.mktemp("changed") / "model.json"
    write_estimate(path, estimate)
    document = json.loads(path.read_text())
    where = places(document)[1:]
    path.write_bytes(change(document, where[number % len(where)], nasty))
    message = str(path)
    try:
        read_estimate(path)
    except ConfigError as error:
        message = str(error)
    assert message.startswith(str(path))


@dataclass(frozen=True)
class MoreOptions(ModelOptions):
    """Options with a field that the file format does not have."""

    backlash: bool = True


def test_an_option_without_a_place_in_the_file_is_refused(
    tmp_path: Path, estimate: Estimate
) -> None:
    options = MoreOptions(**vars(estimate.options))
    with pytest.raises(EstimationError) as refused:
        write_estimate(tmp_path / "model.json", replace(estimate, options=options))
    assert refused.value.refusal == "RID-MODEL-OPTION"
    assert not (tmp_path / "model.json").exists()


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["parameters"][0].update(value=10.0 * d["parameters"][0]["value"]),
        lambda d: d["parameters"][2].update(value=-d["parameters"][2]["value"]),
        lambda d: d["residual_nm"].__setitem__(0, 0.5 * d["residual_nm"][0]),
        lambda d: d["robot"]["joints"][0]["limits"].update(torque=900.0),
        lambda d: d.update(runs=["another run"]),
        lambda d: d.update(sha256=""),
    ],
)
def test_a_plausible_edit_of_one_number_is_refused(
    path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    with raises_code(ConfigError, "RID-MODEL-UNSOUND", f"{path}: sha256: "):
        read_estimate(edit_file(path, change))


def test_a_file_in_another_layout_is_read(path: Path, estimate: Estimate) -> None:
    path.write_text(json.dumps(dict(reversed(json.loads(path.read_text()).items()))))
    np.testing.assert_array_equal(read_estimate(path).values, estimate.values)
