"""Section on path errors: verdict, deflection of the gears, and errors measured at the tool."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from compensation.feedforward.deflection import deflection
from compensation.feedforward.tracking_error import tracking_error
from config.load import load_robot
from dynamics.geometry.kinematics import Chain
from rid_daq.report.result import Result
from rid_daq.report.sections.tracking import FollowedMotion, FollowedRun, TrackingSection
from rid_daq.report.tool_error_entries import ToolDeflection, ToolSideSize

MEAN = "Mean distance from the path at the motor encoders"
RESULT = Path(__file__).parent / "results" / "tracking.json"


def tracking_with_ratios(*ratios: float | None) -> TrackingSection:
    """Return a section with one motion for each error ratio."""
    section = Result.model_validate_json(RESULT.read_text(encoding="utf-8")).tracking
    assert section is not None
    (motion,) = section.motions
    changed = tuple(motion.model_copy(update={"mean_ratio": ratio}) for ratio in ratios)
    return section.model_copy(update={"motions": changed})


@pytest.mark.parametrize(
    ("ratios", "words"),
    [
        (
            (111.0,),
            f"{MEAN} 0.0245 mm: error reduced 111-fold",
        ),
        (
            (30.0, 8.0),
            f"{MEAN} 0.0245 mm at most: error reduced 8-fold at least",
        ),
        (
            (0.01,),
            f"{MEAN} 0.0245 mm: error increased 100-fold",
        ),
        (
            (0.5, 4.0),
            f"{MEAN} 0.0245 mm at most: error increased 2-fold at most",
        ),
        (
            (0.0,),
            f"{MEAN} 0.0245 mm: error increased 1·10¹²-fold",
        ),
        ((None,), f"{MEAN} 0.0245 mm"),
    ],
)
def test_the_verdict_states_if_an_error_is_reduced_or_has_grown(
    ratios: tuple[float | None, ...], words: str
) -> None:
    assert tracking_with_ratios(*ratios).verdict.headline == words


def test_every_verdict_names_the_errors_that_encoders_do_not_measure() -> None:
    for ratios in ((111.0,), (None,)):
        section = tracking_with_ratios(*ratios)
        assert section.unseen in section.verdict.sentence


def run_with_deflection(*stiffness: float | None) -> TrackingSection:
    """Return the section of a run with errors of 0.1 mrad at each joint, and loaded gears.

    `stiffness` contains the stiffness of each gear [N m/rad], or None if it is unknown.
    """
    robot = load_robot("ir361")
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": each})
        for joint, each in zip(robot.joints, stiffness, strict=True)
    )
    robot = robot.model_copy(update={"joints": joints})
    position = np.tile([0.1, -0.2, 0.4], (20, 1))
    error = tracking_error(Chain.from_description(robot), position + 1e-4, position)
    bent = deflection(robot, position, np.tile([20.0, 200.0, -60.0], (20, 1)))
    run = FollowedRun(error, slice(None), 0.008, bent)
    return TrackingSection.of([FollowedMotion.of("A pose.", "plain", run, None)], robot)


def test_the_estimated_deflection_is_shown_with_the_distance() -> None:
    section = run_with_deflection(None, 6e4, 2e4)
    (motion,) = section.motions
    assert motion.after.bending is not None
    assert motion.after.bending.max_m == pytest.approx(motion.after.bending.rms_m)
    assert motion.after.bending.max_m > 5.0 * motion.after.max_m
    assert (section.with_stiffness, section.without_stiffness) == (("axis2", "axis3"), ("axis1",))
    assert section.unseen is not None
    assert "mm RMS" in section.unseen
    assert "The stiffness of axis1 is not known" in section.unseen


def test_an_unknown_stiffness_is_reported() -> None:
    section = run_with_deflection(None, None, None)
    assert section.motions[0].after.bending is None
    assert section.without_stiffness == ("axis1", "axis2", "axis3")
    assert "not known" in (section.unseen or "")


def test_the_headline_states_the_change_at_the_motors_and_at_the_tool() -> None:
    section = tracking_with_ratios(0.97)
    (motion,) = section.motions
    assert motion.before is not None
    sizes = [
        size.model_copy(
            update={"bending": ToolDeflection(rms_m=1e-3, max_m=2e-3, tool_mean_m=tool_m)}
        )
        for size, tool_m in ((motion.before, 2.4e-3), (motion.after, 2e-4))
    ]
    motion = motion.model_copy(update={"before": sizes[0], "after": sizes[1]})
    headline = section.model_copy(update={"motions": (motion,)}).verdict.headline
    assert re.findall(r"([\d.]+)-fold", headline) == ["1.03", "12"]
    half = motion.model_copy(update={"before": sizes[0].model_copy(update={"bending": None})})
    headline = section.model_copy(update={"motions": (half,)}).verdict.headline
    assert re.findall(r"([\d.]+)-fold", headline) == ["1.03"]


def measured(mean_m: float, share: float = 0.95) -> ToolSideSize:
    """Return errors at the tool as an instrument measured them.

    `share` is the fraction of the motion that was measured.
    """
    return ToolSideSize(
        run="a",
        file="t.csv",
        rows=9,
        share=share,
        mean_m=mean_m,
        max_m=2.0 * mean_m,
        motor_mean_m=1e-4,
        clock_offset_s=0.0,
        clock_ppm=0.0,
        residual_m=1e-3,
    )


def test_the_headline_states_which_part_of_the_motion_was_measured() -> None:
    section = tracking_with_ratios(None)
    part = section.model_copy(update={"tool_side": (measured(1e-3, 0.7),)})
    assert "70 %" in part.verdict.headline
    whole = section.model_copy(update={"tool_side": (measured(1e-3),)})
    assert "%" not in whole.verdict.headline


@pytest.mark.parametrize(("mean_m", "is_contradicted"), [(1.5e-3, True), (2.5e-4, False)])
def test_a_measured_error_replaces_the_estimate(mean_m: float, is_contradicted: bool) -> None:
    section = tracking_with_ratios(0.97)
    (motion,) = section.motions
    assert motion.before is not None
    bent = ToolDeflection(rms_m=1e-3, max_m=2e-3, tool_mean_m=2e-4)
    motion = motion.model_copy(
        update={
            "before": motion.before.model_copy(update={"bending": bent}),
            "after": motion.after.model_copy(update={"bending": bent}),
        }
    )
    update = {"motions": (motion,), "tool_side": (measured(mean_m),)}
    section = section.model_copy(update=update)
    assert re.findall(r"([\d.]+)-fold", section.verdict.headline) == ["1.03"]
    assert bool(section.contradiction) == is_contradicted
    assert ("1.5 mm" in section.contradiction) == is_contradicted
