"""`friction` and `loop` end with exit code 6 if no model explains a joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.load import load_robot
from identification.friction.curve import FrictionCurve
from identification.friction.fits import fit_friction
from identification.regression.fit_grade import Grade
from rid_daq.app import run
from rid_daq.blocks.block import Verdict
from rid_daq.operations.identify import friction_measurement
from rid_daq.operations.identify.friction import FrictionResult
from rid_daq.operations.identify.friction_measurement import FrictionMeasurement
from rid_daq.operations.path import loop_measurement
from rid_daq.operations.path.loop import LoopResult
from rid_daq.operations.path.loop_measurement import MeasuredLoops
from rid_daq.report.result import Result
from rid_daq.report.sections.friction import FrictionSection

RESULTS = Path(__file__).parents[1] / "report" / "results"
SPEED = np.array([0.1, 0.2, 0.4, 0.8, 1.2, 1.6])


def verdicts(result: FrictionResult | LoopResult) -> list[bool | None]:
    """Return the verdicts of a result as a page shows them: True, False or None."""
    return [block.passed for block in result.blocks() if isinstance(block, Verdict)]


@pytest.mark.parametrize(
    ("torque", "code", "message"),
    [
        (30.0 + 8.0 * SPEED, 0, "in the robot file: friction: [coulomb, viscous]"),
        (
            np.array([40.0, 5.0, 60.0, 3.0, 70.0, 10.0]),
            6,
            "axis1: no model fits; cube root is closest. Check the curve in the report",
        ),
    ],
)
def test_friction_that_no_model_explains_gives_exit_code_6(
    torque: np.ndarray,
    code: int,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    robot = load_robot("ir361")
    curve = FrictionCurve("axis1", SPEED, torque, np.full(len(SPEED), 0.1))
    section = FrictionSection.of([curve], [fit_friction(curve, robot)], robot)
    found = FrictionMeasurement("a-run", section, Path("report.html"), [])
    monkeypatch.setattr(friction_measurement, "measure_friction", lambda request: found)
    assert run(["friction", "a-run"]) == code
    assert message in " ".join(capsys.readouterr().out.split())
    assert (False in verdicts(FrictionResult(found))) is (code == 6)


@pytest.mark.parametrize(("grade", "code"), [(Grade.DOUBTFUL, 0), (Grade.BAD, 6)])
def test_a_loop_model_that_does_not_fit_gives_exit_code_6(
    grade: Grade, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (RESULTS / "velocity_loops.json").read_text(encoding="utf-8")
    section = Result.model_validate_json(text).velocity_loops
    assert section is not None
    first, *others = section.axes
    first = first.model_copy(update={"grade": grade, "reason": "40 % is left"})
    section = section.model_copy(update={"axes": (first, *others)})
    found = MeasuredLoops("a-run", section, Path("loops.json"), Path("report.html"), [], "ir361")
    monkeypatch.setattr(loop_measurement, "measure_velocity_loops", lambda request: found)
    assert run(["loop", "a-run"]) == code
    output = " ".join(capsys.readouterr().out.split())
    assert f"{first.joint}: inertia and damping leave" in output
    assert f"; the fit is {grade}, 40 % is left." in output
    assert (False in verdicts(LoopResult(found))) is (code == 6)
