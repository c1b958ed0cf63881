"""Figures show the numbers, names and units of results, as JSON without NaN and as CSV."""

from __future__ import annotations

import csv
import io
import json
from base64 import b64decode
from typing import Any

import numpy as np
import pytest

from config.load import load_cell
from rid_daq.blocks.plot import Axis, Line, Mark, Panel, Plot
from rid_daq.figures.figure_item import figure_item, figure_script
from rid_daq.figures.palette import DARK, LIGHT
from rid_daq.figures.plot_tables import PlotTable, as_csv
from rid_daq.report.section_blocks.bode import bode_plot
from rid_daq.report.section_blocks.centre_of_gravity import VIEWS, CentreOfGravity, centre_plot
from rid_daq.report.section_blocks.curves import spectrum_plot, torque_plot
from rid_daq.report.section_blocks.tracking import path_plots
from rid_daq.workbench.motion_blocks import limits_plot
from rid_daq.workbench.run_blocks import warm_up_plot
from tests.builders.drawn_figures import (
    JOINTS,
    all_figures,
    invented_result,
    payload,
    six_axes,
    tables,
    written,
)
from tests.builders.javascript_types import assert_declared


@pytest.fixture(scope="module")
def figures() -> dict[str, Plot]:
    return all_figures()


NAMES = (
    *("motion", "tool", "fit", "spectrum", "bode"),
    *("path", "distance", "errors", "friction", "warm-up", "history", "payload"),
    *("stop", "lateness", "truth", "retiming"),
)
WITHOUT_UNIT = (
    *("period", "cycles", "parameter number", "(estimate - truth) / σ"),
    *("speed / speed limit", "torque / limit", "active limit"),
)


def column(table: PlotTable, name: str) -> Any:
    return np.asarray(table.columns[name])


def shown_item(plot: Plot) -> Any:
    """Return what the browser receives: JSON without NaN."""
    return json.loads(json.dumps(figure_item(plot), allow_nan=False))


def test_there_is_a_figure_of_every_kind(figures: dict[str, Plot]) -> None:
    assert tuple(figures) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_is_json_without_nan(figures: dict[str, Plot], name: str) -> None:
    item = shown_item(figures[name])
    assert len(item["panels"]) == len(figures[name].panels)
    assert_declared(item, "FigureItem")
    for panel in item["panels"]:
        assert_declared(panel, "FigurePanel")
        assert_declared(panel["x"], "FigureAxis")
        for line in panel["lines"]:
            assert_declared(line, "FigureLine")


@pytest.mark.parametrize("name", NAMES)
def test_the_browser_receives_the_numbers_of_every_line(
    figures: dict[str, Plot], name: str
) -> None:
    item = shown_item(figures[name])
    columns = [np.frombuffer(b64decode(each), dtype="<f4") for each in item["columns"]]
    for shown, panel in zip(item["panels"], figures[name].panels, strict=True):
        for found, line in zip(shown["lines"], panel.lines, strict=True):
            np.testing.assert_array_equal(columns[found["x"]], np.array(line.x, dtype="<f4"))
            np.testing.assert_array_equal(columns[found["y"]], np.array(line.y, dtype="<f4"))
            if line.reach is not None and any(line.reach):
                np.testing.assert_array_equal(
                    columns[found["reach"]], np.array(line.reach, dtype="<f4")
                )


@pytest.mark.parametrize("name", NAMES)
def test_every_axis_has_its_unit(figures: dict[str, Plot], name: str) -> None:
    for panel in shown_item(figures[name])["panels"]:
        for axis in (panel["x"], panel["y"]):
            has_unit = axis["label"] not in WITHOUT_UNIT
            assert axis["text"] == axis["label"] + (f" [{axis['unit']}]" if has_unit else "")


def test_lines_with_equal_times_share_one_column() -> None:
    lines = tuple(Line(name, x=(0, 1, 2), y=(i, 0, 1), stroke=i) for i, name in enumerate("abc"))
    panel = Panel(x=Axis("time", "s"), y=Axis("torque", "N m"), lines=lines)
    item = shown_item(Plot(name="three", panels=(panel,)))
    assert len(item["columns"]) == 4
    assert {line["x"] for line in item["panels"][0]["lines"]} == {0}


@pytest.mark.parametrize("name", NAMES)
def test_every_column_of_a_figures_table_has_a_name(figures: dict[str, Plot], name: str) -> None:
    head, *rows = csv.reader(io.StringIO(as_csv(figures[name])))
    assert len(head) == len(set(head)) > 1
    assert rows
    assert {len(row) for row in rows} == {len(head)}
    drawn = tables(figures[name]).values()
    assert len(rows) == max(len(values) for table in drawn for values in table.columns.values())
    assert not {"nan", "inf"} & {cell for row in rows for cell in row}


def test_a_table_has_seven_digits_and_empty_cells_for_gaps() -> None:
    line = Line("torque", x=(0.0, 0.1), y=(1.2345678, None), stroke="ink")
    panel = Panel(x=Axis("time", "s"), y=Axis("torque", "N m"), lines=(line,))
    table = as_csv(Plot(name="two", panels=(panel,)))
    assert table == "time [s],torque [N m]\n0,1.234568\n0.1,\n"


def test_fit_and_residual_equal_those_of_the_result() -> None:
    curves = invented_result().curves
    assert curves is not None
    assert curves.torque is not None
    drawn = tables(torque_plot(curves.torque))
    for axis in curves.torque.axes:
        counted = np.array(axis.counted, dtype=bool)
        table = drawn[f"{axis.joint}: {axis.caption} torque"]
        measured = column(table, f"measured [{axis.unit}]")
        predicted = column(table, f"predicted [{axis.unit}]")
        left = column(drawn[f"{axis.joint}: {axis.caption} residual"], f"residual [{axis.unit}]")
        np.testing.assert_allclose(measured, axis.measured, rtol=1e-6)
        np.testing.assert_allclose(predicted[counted], np.array(axis.predicted)[counted], rtol=1e-6)
        assert np.isnan(predicted[~counted]).all()
        np.testing.assert_allclose(
            left[counted], (np.array(axis.measured) - axis.predicted)[counted], rtol=1e-5, atol=1e-4
        )
        assert counted.any()
        assert not counted.all()


def test_all_joints_share_one_time_axis() -> None:
    curves = invented_result().curves
    assert curves is not None
    assert curves.torque is not None
    panels = shown_item(torque_plot(curves.torque))["panels"]
    assert len(panels) == 2 * len(curves.torque.axes)
    assert [panel["zoomsWithPrevious"] for panel in panels] == [False] + [True] * (len(panels) - 1)
    assert [panel["hidesX"] for panel in panels[:-1]] == [True, False] * (len(panels) // 2 - 1) + [
        True
    ]


def test_the_spectrum_equals_that_of_the_result() -> None:
    curves = written("identification").curves
    assert curves is not None
    assert curves.spectrum is not None
    spectrum = curves.spectrum
    drawn = tables(spectrum_plot(spectrum))
    for axis in spectrum.axes:
        found = column(drawn[f"{axis.joint} RMS torque"], "residual [N m]")
        np.testing.assert_allclose(found, axis.residual_nm, rtol=1e-6)


def test_bode_shows_the_margins_of_the_result() -> None:
    loops = written("velocity_loops").velocity_loops
    assert loops is not None
    axis = loops.axes[0]
    figure = bode_plot(axis)
    texts = [mark["text"] for panel in shown_item(figure)["panels"] for mark in panel["marks"]]
    margins = axis.cascade.position.margins
    assert f"{margins.phase_deg:.0f}°" in texts
    assert f"{margins.gain_db:.1f} dB" in texts
    drawn = tables(figure)[f"{axis.joint}: velocity controller measured"]
    gain = column(drawn, f"measured [dB over 1 {axis.unit}]")
    np.testing.assert_allclose(10.0 ** (gain / 20.0), axis.response.magnitude, rtol=1e-5)


def test_path_deviations_are_those_of_the_result_in_millimetres() -> None:
    tracking = invented_result().tracking
    assert tracking is not None
    motion = tracking.motions[0]
    _, _, errors = path_plots(motion, tracking.joints)
    before, after = errors.panels[0].lines
    assert (before.label, after.label) == ("before", "after")
    assert after.y == pytest.approx([1e3 * each for each in motion.drawn.after.deviation_m[0]])


def test_a_path_without_a_reference_run_is_drawn_alone() -> None:
    tracking = invented_result().tracking
    assert tracking is not None
    motion = tracking.motions[0]
    alone = motion.model_copy(update={"drawn": motion.drawn.model_copy(update={"before": None})})
    path, *_ = path_plots(alone, tracking.joints)
    assert [line.label for line in path.panels[0].lines] == ["desired", "after", "scale"]
    assert len(path.panels) == 1


def test_motion_is_drawn_in_percent_of_its_limits() -> None:
    samples, robot = six_axes().whole(1), load_cell("kr15").robot
    panels = {panel.y.label: panel for panel in limits_plot(samples, robot).panels}
    assert set(panels) == {"position", "velocity", "acceleration"}
    limit = robot.joints[1].limits
    drawn = {name: np.array(panel.lines[1].y, dtype=float) for name, panel in panels.items()}
    step = -(-len(samples.position) // len(drawn["velocity"]))
    speed = samples.velocity[::step, 1]
    np.testing.assert_allclose(drawn["velocity"], 100.0 * speed / limit.velocity)
    middle = 0.5 * (limit.position_min + limit.position_max)
    half = 0.5 * (limit.position_max - limit.position_min)
    found = middle + half * drawn["position"] / 100.0
    np.testing.assert_allclose(found, samples.position[::step, 1], atol=1e-9)


def test_warm_up_shows_the_friction_change_with_its_limit() -> None:
    power = [[10.0, 4.0, 1.0], [9.0, 4.0, 1.0], [8.0, 4.0, 1.0], [7.0, 4.0, 1.0]]
    friction, change = warm_up_plot(JOINTS, power, 1.0).panels
    assert [line.y for line in friction.lines] == [*zip(*power, strict=True)]
    assert [line.x for line in change.lines] == [(4.0,)] * 3
    assert change.lines[0].y == pytest.approx((-100.0 / 8.5,))
    assert change.lines[1].y == pytest.approx((0.0,), abs=1e-9)


def test_warm_up_can_be_drawn_before_its_first_period() -> None:
    friction, _ = warm_up_plot(JOINTS, [], 1.0).panels
    assert [line.x for line in friction.lines] == [()] * 3


def test_the_warm_up_change_has_an_axis_range_before_the_first_value() -> None:
    _, change = warm_up_plot(JOINTS, [[1.0, 1.0, 1.0]], 1.0).panels
    assert (change.y.least, change.y.most) == (-2.0, 2.0)


def test_the_payload_centre_is_drawn_at_the_estimate() -> None:
    estimate = payload()
    plot = centre_plot(CentreOfGravity.of(estimate))
    for view, shown in zip(VIEWS, plot.panels, strict=True):
        (centre,) = (line for line in shown.lines if line.points)
        found = [*centre.x, *centre.y, *(centre.reach_x or ()), *(centre.reach or ())]
        expected = [*(1e3 * estimate.reported[1 + k] for k in view)]
        expected += [2e3 * estimate.sigma[1 + k] for k in view]
        assert found == pytest.approx(expected)


def test_the_ellipse_of_the_centre_equals_the_covariance_of_the_estimate() -> None:
    estimate = payload()
    drawn = CentreOfGravity.of(estimate)
    assert drawn.covariance_mm2 is not None
    np.testing.assert_allclose(
        np.sqrt(np.diagonal(drawn.covariance_mm2)), drawn.sigma_mm, rtol=1e-9
    )
    assert abs(drawn.covariance_mm2[0, 2]) > 0.1 * drawn.covariance_mm2[0, 0]


def test_the_ellipsoid_of_even_density_has_the_payloads_inertia() -> None:
    drawn = CentreOfGravity.of(payload())
    assert drawn.spread_mm2 is not None
    second = 1e-6 * drawn.spread_mm2 * (5.0 / 5.0)  # the mass divided by five
    np.testing.assert_allclose(
        np.trace(second) * np.eye(3) - second, np.diag([0.04, 0.05, 0.02]), atol=1e-9
    )


def test_a_known_centre_coordinate_has_no_uncertainty() -> None:
    drawn = CentreOfGravity.of(payload(held="cx"))
    assert drawn.sigma_mm[0] == 0.0
    assert drawn.covariance_mm2 is not None
    assert not drawn.covariance_mm2[0].any()


def test_a_view_of_an_unidentifiable_coordinate_says_so() -> None:
    estimate = payload(unseen="sz")
    plot = centre_plot(CentreOfGravity.of(estimate))
    assert sum("z not identifiable" in each.title for each in plot.panels) == 2
    assert [any(line.points for line in each.lines) for each in plot.panels] == [
        2 not in view for view in VIEWS
    ]


def test_invisible_characters_are_escaped() -> None:
    hidden = "a\u202eb"
    panel = Panel(
        x=Axis(hidden, "s"),
        y=Axis("y"),
        lines=(Line(hidden, (0.0,), (1.0,), "ink"),),
        marks=(Mark(0.0, 1.0, hidden),),
        title=hidden,
    )
    plot = Plot(name="hidden", panels=(panel,))
    assert hidden not in json.dumps(figure_item(plot), ensure_ascii=False)
    assert hidden not in as_csv(plot)


def test_light_and_dark_pages_have_the_same_colours_by_name() -> None:
    assert set(LIGHT) == set(DARK)
    assert not set(LIGHT.values()) & set(DARK.values())


def test_the_script_exports_the_function_that_pages_import() -> None:
    assert "export function showFigure" in figure_script().read_text(encoding="utf-8")


def test_equal_results_give_identical_figures() -> None:
    curves = invented_result().curves
    assert curves is not None
    assert curves.torque is not None
    first, again = (json.dumps(figure_item(torque_plot(curves.torque))) for _ in range(2))
    assert first == again


def test_the_drawn_centre_and_ellipsoid_equal_those_of_the_result() -> None:
    section = written("payload_session").payload
    assert section is not None
    drawn = CentreOfGravity.of_section(section)
    for k, entry in enumerate(section.parameters[1:4]):
        assert entry.value is not None
        assert entry.std is not None
        assert drawn.centre_mm[k] == pytest.approx(1e3 * entry.value)
        assert drawn.sigma_mm[k] == pytest.approx(1e3 * entry.std)
    assert drawn.spread_mm2 is not None
    assert section.principal is not None
    mass = section.parameters[0].exported
    assert mass is not None
    second = 1e-6 * drawn.spread_mm2 * mass / 5.0
    moments = np.linalg.eigvalsh(np.trace(second) * np.eye(3) - second)
    np.testing.assert_allclose(
        moments, sorted(each.moment for each in section.principal), rtol=1e-6
    )
