"""Figures show the numbers, names and units of results, as JSON without NaN and as CSV."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
import pytest
from bokeh.models import Axis, ColumnDataSource, HoverTool, Plot, Toolbar
from bokeh.models.ui import UIElement

from config.load import load_cell
from rid_daq.figures.embedding import as_csv, as_item, bokeh_script, figure_script
from rid_daq.figures.palette import INK, to_dark
from rid_daq.figures.panel import panel, plot_text
from rid_daq.figures.plot_figure import plot_figure
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


@pytest.fixture(scope="module")
def figures() -> dict[str, UIElement]:
    return all_figures()


NAMES = (
    *("motion", "tool", "fit", "spectrum", "bode"),
    *("path", "distance", "errors", "friction", "warm-up", "history", "payload"),
    *("stop", "lateness", "truth", "retiming"),
)


def column(table: ColumnDataSource, name: str) -> Any:
    return np.asarray(table.data[name])


def test_there_is_a_figure_of_every_kind(figures: dict[str, UIElement]) -> None:
    assert tuple(figures) == NAMES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dark", [False, True])
def test_a_figure_is_json_without_nan(figures: dict[str, UIElement], name: str, dark: bool) -> None:
    text = json.dumps(as_item(figures[name], dark), allow_nan=False)
    light = INK in text
    assert light is not dark


@pytest.mark.parametrize("name", NAMES)
def test_every_panel_has_zoom_hover_and_units(figures: dict[str, UIElement], name: str) -> None:
    panels = [each for each in figures[name].references() if isinstance(each, Plot)]
    assert panels
    for plot in panels:
        kinds = {type(tool).__name__ for tool in plot.tools}
        assert {"BoxZoomTool", "WheelZoomTool", "PanTool", "ResetTool"} <= kinds
        assert plot.sizing_mode == "stretch_width"
    assert any(isinstance(each, HoverTool) for each in figures[name].references())
    labels = [
        each.axis_label
        for plot in panels
        for each in (*plot.below, *plot.left)
        if isinstance(each, Axis) and each.visible and each.axis_label
    ]
    without = {"period", "parameter number"}
    assert labels
    assert all("[" in str(label) for label in labels if label not in without), labels


@pytest.mark.parametrize("name", NAMES)
def test_no_figure_contains_code(figures: dict[str, UIElement], name: str) -> None:
    assert not [each for each in figures[name].references() if "CustomJS" in type(each).__name__]


@pytest.mark.parametrize("name", NAMES)
def test_every_column_of_a_figures_table_has_a_name(
    figures: dict[str, UIElement], name: str
) -> None:
    head, *rows = csv.reader(io.StringIO(as_csv(figures[name])))
    assert len(head) == len(set(head)) > 1
    assert rows
    assert {len(row) for row in rows} == {len(head)}
    drawn = tables(figures[name]).values()
    assert len(rows) == max(
        len(column(table, str(key))) for table in drawn for key in list(table.data)
    )
    assert not {"nan", "inf"} & {cell for row in rows for cell in row}


def test_a_table_has_seven_digits_and_empty_cells_for_gaps() -> None:
    from rid_daq.figures.panel import csv_source, figure_layout

    plot = panel("two", "time [s]", "torque [N m]")
    rows = csv_source("two", {"time [s]": [0.0, 0.1], "torque [N m]": [1.2345678, np.nan]})
    plot.line("time [s]", "torque [N m]", source=rows)
    plot.add_tools(HoverTool())
    assert (
        as_csv(figure_layout("two", [plot], [plot])) == "time [s],torque [N m]\n0,1.234568\n0.1,\n"
    )


def test_fit_and_residual_equal_those_of_the_result() -> None:
    curves = invented_result().curves
    assert curves is not None
    assert curves.torque is not None
    drawn = tables(plot_figure(torque_plot(curves.torque)))
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
    panels = [
        each
        for each in plot_figure(torque_plot(curves.torque)).references()
        if isinstance(each, Plot)
    ]
    assert len(panels) == 2 * len(curves.torque.axes)
    assert len({each.x_range.id for each in panels}) == 1


def test_the_spectrum_equals_that_of_the_result() -> None:
    curves = written("identification").curves
    assert curves is not None
    assert curves.spectrum is not None
    spectrum = curves.spectrum
    drawn = tables(plot_figure(spectrum_plot(spectrum)))
    for axis in spectrum.axes:
        found = column(drawn[f"{axis.joint} RMS torque"], "residual [N m]")
        np.testing.assert_allclose(found, axis.residual_nm, rtol=1e-6)


def test_bode_shows_the_margins_of_the_result() -> None:
    loops = written("velocity_loops").velocity_loops
    assert loops is not None
    axis = loops.axes[0]
    figure = plot_figure(bode_plot(axis))
    texts = [
        text
        for each in figure.references()
        if isinstance(each, ColumnDataSource)
        for text in (each.data.get("text") or ())
    ]
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


def test_texts_are_not_rendered_as_formulas_and_invisible_characters_are_escaped() -> None:
    assert plot_text("$$x$$") == "$ $x$ $"
    assert "\u202e" not in plot_text("a\u202eb")


def test_dark_colours_replace_light_ones_and_nothing_else() -> None:
    assert to_dark({"a": [INK, "other", 3]}) == {"a": ["#e9eef3", "other", 3]}


def test_scripts_are_local_files() -> None:
    assert bokeh_script().stat().st_size > 1_000_000
    assert "export function showFigure" in figure_script().read_text(encoding="utf-8")


def test_dragging_zooms_in_every_panel(figures: dict[str, UIElement]) -> None:
    """Each panel needs its own zoom tool: BokehJS ignores that of the whole figure."""
    panels = [each for each in figures["fit"].references() if isinstance(each, Plot)]
    assert {type(each.toolbar.active_drag).__name__ for each in panels} == {"BoxZoomTool"}


def test_equal_results_give_identical_figures() -> None:
    curves = invented_result().curves
    assert curves is not None
    assert curves.torque is not None
    first, again = (
        json.dumps(as_item(plot_figure(torque_plot(curves.torque)), False)) for _ in range(2)
    )
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


def test_a_figure_has_one_toolbar_for_all_its_panels(figures: dict[str, UIElement]) -> None:
    shown = [
        each
        for each in figures["fit"].references()
        if isinstance(each, Toolbar) and each.logo is None
    ]
    assert len(shown) == 1
