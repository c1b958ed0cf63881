"""Decelerations that are too low are refused, or the power is switched off during the stop
(docs/faults.md, rows 37, 38).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.load import LoadedCell, to_yaml
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from tests.builders.obedient_cell import Outcome, one_axis, rows_until

Measured = Callable[[str], None]
AT = 230


@pytest.mark.fault(37)
@pytest.mark.parametrize(
    ("deceleration", "found"),
    [(1e-30, "never stops: the deceleration is 0"), (0.01, "286 s, 409 rad")],
)
@pytest.mark.slow
def test_a_far_too_low_deceleration_is_refused_before_power(
    loaded: LoadedCell,
    motion_of: Callable[[str, int], FourierMotion],
    tmp_path: Path,
    capsys: Any,
    deceleration: float,
    found: str,
    measured: Measured,
) -> None:
    assert loaded.plant is not None
    log = tmp_path / "bus.log"
    (tmp_path / "motion.yaml").write_text(to_yaml(motion_of("ir361", 1)))
    config = loaded.config.model_copy(update={"plate": None})
    with SimulatedCell(
        CellSimulation(config, loaded.robot, loaded.plant, realtime=False, seed=3, log=log)
    ) as simulated:
        cell = simulated.cell.model_dump(mode="json") | {"simulated": False, "plant": None}
        key = "drive_safety.quick_stop_deceleration_rad_s2"
        cell["drive_safety"]["quick_stop_deceleration_rad_s2"] = deceleration
        file = str(tmp_path / "cell.json")
        Path(file).write_text(json.dumps(cell))
        runs = ["--runs", str(tmp_path / "runs")]
        assert run(["check", file, "--i-have-cleared-the-cell", *runs]) == 2
        assert "implausible" in capsys.readouterr().err
        Path(file).write_text(json.dumps(cell | {"implausible_on_purpose": [key]}))
        assert run(["check", file, "--i-have-cleared-the-cell", "--json", *runs]) == 3
        checked = json.loads(capsys.readouterr().out)
        motion = str(tmp_path / "motion.yaml")
        cleared = ["--i-have-cleared-the-cell", "--without-axis-test"]
        assert run(["record", file, motion, *cleared, *runs]) == 3
        refused = capsys.readouterr().err
    red = [line for line in checked["lines"] if line["verdict"] == "red"]
    stop = next(x for x in red if "stop from top speed" in x["what"] and "axis1" in x["where"])
    assert found in stop["found"]
    assert "raise drive_safety.quick_stop_deceleration_rad_s2" in stop["next_action"]
    assert "RID-MOTION-STOP" in refused
    power = [word for word in log.read_text().split() if word.startswith(("201#0F", "202#0F"))]
    assert power == []
    measured(f"{deceleration:g} rad/s²: {found}; allowed 2 s, 5.4 rad: exit 3, 0 motion frames")


@pytest.mark.fault(38)
def test_an_axis_with_a_slower_ramp_than_commanded_is_powered_off(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    """All settings read back correctly, but the drive's clock and ramp are 20 times too slow."""
    slow = {"kind": "clock", "joint": "axis1", "at_cycle": AT, "factor": 0.05}
    run = serve(drives=[slow]).move(motion)
    assert run.reason.code is StopCode.HEARTBEAT_LOST
    assert any("did not decelerate axis1" in note for note in run.notes)
    stop_s = min(run.quick_stops().values())
    off = next(f for f in run.frames if f.can_id == 0x201 and f.word == 0 and f.time_s > stop_s)
    cycles = run.cycle(off.time_s) - run.cycle(stop_s)
    assert cycles <= 12
    run.assert_at_rest()
    measured(f"deceleration 1/20 of the commanded one: power off {cycles} T after the quick stop")


@pytest.mark.fault(38)
@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_that_reaches_its_limit_during_the_stop_is_powered_off(
    sign: int, measured: Measured
) -> None:
    """The preflight accepts the long ramp; the stop is ordered 0.2 rad before the limit."""
    cell, robot = one_axis(deceleration=2.0, velocity=1.5, acceleration=6.0, limit=1.0)
    outcome = Outcome(cell, robot, 65536, rows_until(cell, robot, 0.8), sign)
    assert any("exceeded its limit during the stop" in note for note in outcome.notes)
    high = 1.0 + cell.supervision.following_error_min_rad
    over = [(t, p[0]) for t, p, _, on in outcome.bus.trace if abs(p[0]) > high and on[0]]
    cycles = (over[-1][0] - over[0][0]) / cell.cycle_time_s
    assert cycles <= 3
    farthest = max(abs(p[0]) for _, p, _, _ in outcome.bus.trace)
    measured(
        f"power off {cycles:.0f} T after the limit, at most {farthest - 1.0:.3f} rad beyond it"
    )
