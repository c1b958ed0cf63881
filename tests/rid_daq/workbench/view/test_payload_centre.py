"""The centre of gravity of a payload is drawn at its place on the last link."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config.errors import ConfigError
from config.load import load_robot
from identification.payload.body import PARAMETERS
from identification.payload.file import write_payload
from identification.payload.verdict import PayloadResult
from rid_daq.robot_view.scene import RobotScene
from rid_daq.workbench.view.payload_centre import payload_centre
from tests.builders.browser_drawing import Pinhole, drawn_points, wait_for_picture
from tests.builders.certified import MEDIUM, certified_session
from tests.builders.drawn_figures import payload
from tests.builders.raised_codes import raises_code
from tests.rid_daq.robot_view.test_scene import pinocchio_of
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import OpenPage

KR15 = load_robot("kr15")
BALL = """() => {
  const { drawing } = document.getElementById('view').robotView;
  const { camera, canvas, layers: { payload: [ball] } } = drawing;
  const at = camera.target.clone().setFromMatrixPosition(ball.matrixWorld).project(camera.eye);
  return [((at.x + 1) / 2) * canvas.clientWidth, ((1 - at.y) / 2) * canvas.clientHeight];
}"""


def place_by_pinocchio(q: np.ndarray) -> np.ndarray:
    """Return the payload's centre of gravity in the base frame [m]."""
    model, tool = pinocchio_of(KR15)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return np.asarray((data.oMi[-1] * tool).act(MEDIUM.centre_m))


def test_the_centre_is_in_the_frame_of_the_last_link(tmp_path: Path) -> None:
    path = certified_session(tmp_path).folder.file("payload.json")
    _, tool = pinocchio_of(KR15)
    assert payload_centre(KR15, path) == pytest.approx(tool.act(MEDIUM.centre_m))
    with raises_code(ConfigError, "RID-ROBOT-OTHER"):
        payload_centre(load_robot("ur10e"), path)


def test_a_centre_that_the_motion_does_not_determine_is_not_drawn(tmp_path: Path) -> None:
    path = tmp_path / "payload.json"
    write_payload(path, PayloadResult(payload(unseen=PARAMETERS[3]), ()))
    assert payload_centre(load_robot("ur10e"), path) is None


@pytest.fixture(scope="module")
def served_pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """Run a service of the bundled six-axis cell."""
    with serving(tmp_path_factory.mktemp("payload"), cell="kr15") as running:
        yield running


@pytest.mark.slow
def test_the_ball_is_drawn_where_pinocchio_says(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    session = certified_session(served_pages.folder / "runs")
    page = open_page()
    wait_for_picture(page)
    file = f"runs/{session.folder.run_id}/payload.json"
    page.evaluate(
        "(payload) => document.getElementById('view').robotView.reload({ payload })", file
    )
    q = np.array([0.4, 0.3, -0.5, 0.6, 0.7, -0.8])
    camera: Pinhole = drawn_points(page, q[np.newaxis])[0][1]
    wanted = camera.project((RobotScene.of(KR15).upright @ place_by_pinocchio(q))[np.newaxis])[0]
    assert np.linalg.norm(np.array(page.evaluate(BALL)) - wanted) < 0.01
