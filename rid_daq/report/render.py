"""`render_report`: a result document to one self-contained HTML page."""

from __future__ import annotations

import math
from typing import Any

import jinja2
from markupsafe import Markup

from rid_daq.report.bode_figure import cascade_figure, controller_figure
from rid_daq.report.figures import (
    friction_figure,
    histogram_figure,
    spectrum_figure,
    torque_figure,
    truth_figure,
)
from rid_daq.report.path_figures import error_figure, path_figure

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def render_report(result: dict[str, Any]) -> str:
    """Return the report: every number is the result's, every text from outside is escaped.

    Parameters
    ----------
    result
        The content of `result.json` (see `rid_daq.result`); sections that it lacks are left out.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("rid_daq", "report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    environment.filters["duration"] = duration
    environment.filters["unit"] = unit
    environment.filters["moment"] = moment
    template = environment.get_template("report.html")
    return template.render(result=result, figures=_figures(result))


def number(value: float | int | None, digits: int = 4) -> str:
    """Return a number for people: `digits` significant digits, a dash where there is none."""
    if value is None:
        return "–"
    if isinstance(value, int):
        return str(value)
    if not math.isfinite(value):
        return "not finite"
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < 1e6:
        text = f"{float(text):.0f}"
    elif "e" in text:
        mantissa, exponent = text.split("e")
        power = str(int(exponent)).translate(_SUPERSCRIPT)
        return f"{mantissa}·10{power}".replace("-", "\N{MINUS SIGN}")
    return text.replace("-", "\N{MINUS SIGN}")


def duration(seconds: float) -> str:
    """Return a duration as people say it."""
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {seconds % 60:.0f} s"


def unit(text: str) -> str:
    """Return a unit with its powers raised."""
    return text.replace("^2", "²").replace("^3", "³")


def moment(stamp: str) -> str:
    """Return an ISO 8601 time stamp of UTC to the minute, as people write it."""
    return f"{stamp[:16].replace('T', ' ')} UTC"


def _figures(result: dict[str, Any]) -> dict[str, Any]:
    """Draw what the result has curves for: name to inline SVG, or list of such."""
    figures: dict[str, Any] = {}
    curves = result.get("curves", {})
    if "torque" in curves:
        torque = curves["torque"]
        figures["torque"] = [
            Markup(torque_figure(torque["time_s"], axis, f"torque{position}"))
            for position, axis in enumerate(torque["axes"])
        ]
    if "spectrum" in curves:
        spectrum = curves["spectrum"]
        figures["spectrum"] = Markup(spectrum_figure(spectrum["frequency_hz"], spectrum["axes"]))
    if "friction" in result:
        figures["friction"] = Markup(friction_figure(result["friction"]["joints"]))
    if "truth" in result:
        figures["truth"] = Markup(truth_figure(result["truth"]))
    if "velocity_loops" in result:
        axes = result["velocity_loops"]["axes"]
        figures["controllers"] = [
            Markup(controller_figure(axis["response"] | {"unit": axis["unit"]}, f"controller{k}"))
            for k, axis in enumerate(axes)
        ]
        figures["cascades"] = [
            Markup(cascade_figure(axis["cascade"], f"cascade{k}")) for k, axis in enumerate(axes)
        ]
    if "tracking" in result:
        tracking = result["tracking"]
        figures["tracking"] = [
            (
                Markup(path_figure(motion["drawn"], f"path{position}")),
                Markup(error_figure(motion["drawn"], tracking["joints"], f"error{position}")),
            )
            for position, motion in enumerate(tracking["motions"])
        ]
    figures["loops"] = [
        Markup(histogram_figure(loop["edges_us"], loop["counts"], f"loop{position}"))
        for position, loop in enumerate(result.get("timing", {}).get("loops", []))
    ]
    return figures
