"""Traces of a recording: they have fewer points but every peak, and do not depend on the parts in
which the recording is read.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from config.load import load_robot
from rid_daq.report.section_blocks.curves import traces_plot
from rid_daq.report.sections.curves import TRACE_STEPS, Traces
from rid_daq.report_page.drawings.plot import plot_svg

ROWS = 4001
PEAK = 2345
ROBOT = load_robot("ir361")


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Return a sine of 1 rad at 1 rad/s, behind its set-points by 1 mrad, with a torque peak."""
    time_s = np.arange(ROWS, dtype=np.float64) * 0.004
    position = np.sin(time_s)[:, np.newaxis] * np.ones(3)
    torque = np.zeros_like(position)
    torque[PEAK, 1] = -250.0
    valid = np.ones(ROWS, dtype=np.bool_)
    valid[100:110] = False
    position[100:110] = 99.0  # values of rows that are not valid
    return Recording(
        joint_names=ROBOT.joint_names,
        time_s=time_s,
        position=position,
        torque_nm=torque,
        valid=valid,
        phase=np.ones(ROWS, dtype=np.uint8),
        sample_index=np.arange(ROWS),
        source="cell",
        target_position=position + 0.001,
    )


@pytest.fixture(scope="module")
def traces(recording: Recording) -> Traces:
    return Traces.of([recording], int(recording.valid.sum()), ROBOT)


def test_every_peak_is_kept_and_rows_that_are_not_valid_are_left_out(traces: Traces) -> None:
    assert traces.rows_per_step == 10
    assert len(traces.time_s) <= 2 * TRACE_STEPS
    axis = traces.axes[1]
    assert min(axis.torque) == -250.0
    peak_s = traces.time_s[axis.torque.index(-250.0)]
    assert peak_s == pytest.approx(PEAK * 0.004, abs=10 * 0.004)
    assert (min(axis.position), max(axis.position)) == pytest.approx((-1.0, 1.0), abs=1e-5)


def test_speed_and_following_error_follow_from_position_and_set_point(traces: Traces) -> None:
    axis = traces.axes[0]
    assert axis.following_error == pytest.approx([0.001] * len(traces.time_s), rel=1e-4)
    assert axis.speed == pytest.approx(np.cos(traces.time_s), abs=0.045)


def test_traces_do_not_depend_on_the_parts(recording: Recording, traces: Traces) -> None:
    edges = [0, 1, 105, 1999, 2000, ROWS]
    parts = [recording.part(slice(a, b)) for a, b in itertools.pairwise(edges)]
    assert Traces.of(parts, int(recording.valid.sum()), ROBOT) == traces


def test_a_short_recording_is_not_thinned(recording: Recording) -> None:
    part = recording.part(slice(0, 50))
    short = Traces.of([part], 50, ROBOT)
    assert len(short.time_s) == 49
    assert short.rows_per_step == 1
    assert short.axes[2].position == pytest.approx(part.position[1:, 2], rel=1e-4)


def test_an_import_without_set_points_has_no_following_error(recording: Recording) -> None:
    part = recording.part(slice(0, 50))
    columns = {name: getattr(part, name) for name in part.__dataclass_fields__}
    bare = Traces.of([Recording(**{**columns, "target_position": None})], 50, ROBOT)
    assert bare.axes[0].following_error is None
    assert [panel.y.label for panel in traces_plot(bare).panels] == ["position", "speed", "torque"]


def test_the_traces_are_stored_and_drawn(traces: Traces) -> None:
    assert Traces.model_validate_json(traces.model_dump_json()) == traces
    assert "<svg" in plot_svg(traces_plot(traces), "traces")
