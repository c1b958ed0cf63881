"""`--payload bodies.yaml`: known bodies on any link are added to the model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.errors import LimitError
from identification.estimation.file import read_estimate, write_estimate
from rid_daq.app import run
from rid_daq.operations.stated_loads import state_loads
from rid_daq.operations.stated_payload import state_payload
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_body import bodies_text, link_parameters
from tests.builders.known_model import joint_path, write_path_files
from tests.builders.raised_codes import raises_code

SHARE = 0.4  # of link 2: the body of the loaded run
LINK_2 = link_parameters(2)
BODIES = bodies_text("weight", 2, SHARE)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a model, a run with a body on link 2, and a file of this body."""
    root = tmp_path_factory.mktemp("bodies")
    write_path_files(root, joint_path([0.0, 0.0, 0.0], [0.4, 0.3, -0.4]))
    arm = arm_in_motion()
    write_estimate(root / "model.json", identified_run(root / "runs", arm, "empty", 1))
    identified_run(root / "runs", arm, "loaded", 3, **dict.fromkeys(LINK_2, 1.0 + SHARE))
    (root / "bodies.yaml").write_text(BODIES)
    return root


def errors_percent(root: Path, capsys: pytest.CaptureFixture[str], *more: str) -> list[float]:
    words = ["validate", str(root / "model.json"), "loaded", "--runs", str(root / "runs")]
    assert run([*words, *more, "--json"]) in (0, 1)
    axes = document(capsys)["validation"]["axes"]
    return [axis["relative_error_percent"] for axis in axes]


def test_a_run_with_a_body_on_an_inner_link_is_predicted(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alone = errors_percent(root, capsys)
    carried = errors_percent(root, capsys, "--payload", str(root / "bodies.yaml"))
    assert max(alone) > 5.0 * max(carried)
    assert max(carried) < 3.0


def test_an_uncertain_mass_widens_the_intervals(root: Path, tmp_path: Path) -> None:
    model = read_estimate(root / "model.json")
    (tmp_path / "weighed.yaml").write_text(bodies_text("weight", 2, SHARE, mass_sigma_kg=0.5))
    exact, weighed = (
        state_payload(model, "model.json", str(file), root / "runs")
        for file in (root / "bodies.yaml", tmp_path / "weighed.yaml")
    )
    np.testing.assert_allclose(exact.estimate.values, weighed.estimate.values, rtol=1e-12)
    assert (weighed.estimate.sigma >= exact.estimate.sigma).all()
    assert weighed.estimate.sigma.max() > exact.estimate.sigma.max()
    assert len(exact.origin) == 64


@pytest.mark.parametrize("command", ["compensate", "retime"])
def test_commands_accept_bodies(root: Path, command: str, tmp_path: Path) -> None:
    words = [command, "ir361", str(root / "path.yaml"), "--model", str(root / "alone.json")]
    words += ["--loop", str(root / "loops.json")] if command == "compensate" else []
    written = []
    for number, more in enumerate(([], ["--payload", str(root / "bodies.yaml")])):
        out = tmp_path / f"{number}.{'json' if command == 'compensate' else 'yaml'}"
        assert run([*words, "-o", str(out), *more]) == 0
        written.append(out.read_text())
    assert written[0] != written[1]


def test_bodies_are_taken_up_during_a_motion(root: Path) -> None:
    model = read_estimate(root / "model.json")
    changes = root / "changes.yaml"
    changes.write_text("changes:\n- {at_s: 0.5, payload: bodies.yaml, ramp_s: 0.1}\n")
    loads = state_loads(model, root / "model.json", None, changes, root / "runs")
    carried = state_payload(model, "model.json", str(root / "bodies.yaml"), root / "runs")
    first, later = loads.estimates
    np.testing.assert_array_equal(first.values, model.values)
    np.testing.assert_array_equal(later.values, carried.estimate.values)
    assert loads.stated is not None
    assert len(loads.stated.changes.changes[0].payload) == 64


def test_bodies_on_the_last_link_that_are_heavier_than_the_rated_payload_are_refused(
    root: Path, tmp_path: Path
) -> None:
    model = read_estimate(root / "model.json")
    rated = replace(model, robot=model.robot.model_copy(update={"rated_payload_kg": 5.0}))
    for link, masses_kg, is_refused in (
        (3, (4.9,), False),
        (3, (2.6, 2.5), True),
        (2, (40.0,), False),  # a counterweight
    ):
        file = tmp_path / "bodies.yaml"
        file.write_text(
            "bodies:\n"
            + "".join(
                f"  part{number}: {{link: {link}, mass_kg: {mass}, centre_m: [0.1, 0.0, 0.0],"
                " inertia_kg_m2: [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]}\n"
                for number, mass in enumerate(masses_kg)
            )
        )
        if is_refused:
            with raises_code(LimitError, "RID-PAYLOAD-HEAVY"):
                state_payload(rated, "model.json", str(file), root / "runs")
        else:
            state_payload(rated, "model.json", str(file), root / "runs")


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (bodies_text("weight", 2, SHARE, on_link=4), "RID-FILE-VALUE"),
        ("bodies: {}\n", "RID-FILE-VALUE"),
        (BODIES + "loads:\n- {run: loaded, bodies: [weight]}\n", "RID-FILE-VALUE"),
    ],
)
def test_bodies_that_do_not_fit_are_refused(
    root: Path, tmp_path: Path, text: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.yaml").write_text(text)
    words = ["validate", str(root / "model.json"), "loaded", "--runs", str(root / "runs")]
    assert run([*words, "--payload", str(tmp_path / "wrong.yaml")]) == 2
    assert code in capsys.readouterr().err
