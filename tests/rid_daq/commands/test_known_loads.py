"""`identify --loads`: runs with known bodies give the model of the robot alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.load import load_cell
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from rid_daq.app import run
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_body import bodies_text, link_parameters

SHARE = 0.4  # of link 3: the body of the loaded runs
LINK_3 = link_parameters(3)


def loads_text(mass_sigma_kg: float, *runs: str) -> str:
    """Return a load file: in `runs`, link 3 carries a body with `SHARE` of link 3's parameters."""
    loads = "\n".join(f"- {{run: {name}, bodies: [disc]}}" for name in runs)
    return bodies_text("disc", 3, SHARE, mass_sigma_kg=mass_sigma_kg) + f"loads:\n{loads}\n"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of runs without and with the body."""
    root = tmp_path_factory.mktemp("known")
    arm = arm_in_motion()
    identified_run(root / "runs", arm, "empty", 1)
    for seed, label in enumerate(("loaded", "loaded again"), start=2):
        identified_run(root / "runs", arm, label, seed, **dict.fromkeys(LINK_3, 1.0 + SHARE))
    return root


def words_of(root: Path, *runs: str, text: str) -> list[str]:
    (root / "loads.yaml").write_text(text)
    words = ["identify", *runs, "--loads", str(root / "loads.yaml"), "--runs", str(root / "runs")]
    return [*words, "-o", str(root / "model.json"), "--overwrite", "--json"]


def estimate_of(
    root: Path, capsys: pytest.CaptureFixture[str], *runs: str, text: str
) -> dict[str, Any]:
    assert run(words_of(root, *runs, text=text)) == 0
    found = document(capsys)["estimate"]
    assert isinstance(found, dict)
    return found


def values_of(estimate: dict[str, Any]) -> dict[str, tuple[float, float]]:
    return {each["name"]: (each["value"], each["std"]) for each in estimate["parameters"]}


def test_runs_with_known_bodies_give_the_robot_alone(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first run carries the body."""
    found = estimate_of(root, capsys, "loaded", "empty", text=loads_text(0.0, "loaded"))
    cell = load_cell("ir361")
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    truth = dict(
        zip(model.parameter_names, true_parameters(model, cell.robot, cell.plant), strict=True)
    )
    for name in ("sx3", "sy3"):
        value, std = values_of(found)[name]
        assert value == pytest.approx(truth[name], abs=3.0 * std)
        assert abs(SHARE * truth["sx3"]) > 20.0 * std
    assert any("disc" in each and "link 3" in each for each in found["findings"])
    assert found["mistakes"] == []


def test_an_uncertain_mass_widens_the_intervals(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ("loaded", "loaded again")
    exact, weighed = (
        values_of(
            estimate_of(root, capsys, *runs, text=loads_text(sigma, "loaded", "'loaded again'"))
        )
        for sigma in (0.0, 0.5)
    )
    centre = abs(exact["sx3"][0]) / load_cell("ir361").plant.links[2].mass_kg  # type: ignore[union-attr]
    more = np.sqrt(weighed["sx3"][1] ** 2 - exact["sx3"][1] ** 2)
    assert more == pytest.approx(0.5 * centre, rel=0.05)
    assert weighed["sx3"][0] == pytest.approx(exact["sx3"][0], rel=1e-9)


def test_runs_that_all_carry_bodies_are_not_searched_for_mistakes(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = estimate_of(root, capsys, "loaded", text=loads_text(0.0, "loaded"))
    assert "mistakes" not in found
    assert any("mistakes" in each for each in found["findings"])


@pytest.mark.parametrize(
    ("runs", "loaded", "more", "code"),
    [
        (("empty",), ("loaded",), (), "RID-PAYLOAD-RUNS"),
        (("loaded",), ("loaded", "loaded"), (), "RID-FILE-DUPLICATE"),
        (("loaded",), ("loaded",), ("--cross-check",), "RID-PAYLOAD-RUNS"),
        (("empty", "loaded"), ("loaded",), ("--choose",), "RID-OPTION-EXCLUSIVE"),
        (
            ("empty", "loaded"),
            ("loaded",),
            ("--loaded", "loaded", "--load-mass", "5"),
            "RID-OPTION-EXCLUSIVE",
        ),
    ],
)
def test_contradictions_are_refused(
    root: Path,
    capsys: pytest.CaptureFixture[str],
    runs: tuple[str, ...],
    loaded: tuple[str, ...],
    more: tuple[str, ...],
    code: str,
) -> None:
    words = words_of(root, *runs, text=loads_text(0.0, *loaded))
    assert run([*words, *more]) in (2, 6)
    assert code in capsys.readouterr().err
