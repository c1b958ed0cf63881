"""A payload is compared with the robot's rated payload before a motion and in the verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import LimitError
from config.load import load_cell, load_robot
from config.robot.robot import RobotDescription
from identification.choices import PayloadLimits
from identification.payload.body import PayloadBody
from identification.payload.rating import HeaviestPayload, refuse_heavier
from identification.payload.verdict import HEAVY, check_payload
from rid_daq.app import run
from tests.builders.certified import estimate_of


def robot(**values: object) -> RobotDescription:
    return load_robot("kr15").model_copy(update=values)


def test_the_rating_has_priority_over_the_drawings() -> None:
    arm = robot()
    assert arm.cad is not None
    drawn = sum(link.mass_kg for link in arm.cad)
    rated = robot(rated_payload_kg=15)
    by_drawings, by_rating = HeaviestPayload.of(arm), HeaviestPayload.of(rated)
    assert by_drawings is not None
    assert by_rating is not None
    assert by_drawings.mass_kg == pytest.approx(drawn)
    assert by_rating.mass_kg == 15


def test_guessed_link_masses_give_no_rating() -> None:
    assert HeaviestPayload.of(robot(cad=None)) is None


def test_a_stated_payload_above_the_rating_is_refused_before_the_motion() -> None:
    arm = robot(rated_payload_kg=15.0)
    refuse_heavier(arm, 15.0)
    with pytest.raises(LimitError) as refused:
        refuse_heavier(arm, 15.1)
    assert refused.value.refusal == "RID-PAYLOAD-HEAVY"


@pytest.mark.parametrize(("mass_kg", "passed"), [(4.0, True), (60.0, False)])
def test_the_verdict_compares_the_identified_mass_with_the_rating(
    mass_kg: float, passed: bool
) -> None:
    loaded = load_cell("kr15")
    estimate = estimate_of(loaded, ())
    body = PayloadBody(mass_kg, estimate.body.centre_m, estimate.body.inertia_kg_m2)
    rated = replace(
        estimate,
        robot=loaded.robot.model_copy(update={"rated_payload_kg": 15.0}),
        values=body.parameters,
    )
    (line,) = (each for each in check_payload(rated, PayloadLimits()) if each.advice == HEAVY)
    assert line.passed is passed
    assert line.value == pytest.approx(100.0 * mass_kg / 15.0, rel=0.2)


def test_a_session_with_a_payload_above_the_rating_ends_before_any_motion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["payload", "kr15", "--known", "m=2000", "--yes", "--runs", str(tmp_path)]
    assert run(words) == 3
    assert "RID-PAYLOAD-HEAVY" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
