"""`render_report`: a result document to one self-contained HTML page."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from typing import Any

import jinja2
from markupsafe import Markup

from config.errors import RecordingError
from rid_daq.report.bode_figure import cascade_figure, controller_figure
from rid_daq.report.figures import (
    friction_figure,
    histogram_figure,
    spectrum_figure,
    torque_figure,
    truth_figure,
)
from rid_daq.report.path_figures import error_figure, path_figure
from rid_daq.terminal.console import printable

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def render_report(result: dict[str, Any]) -> str:
    """Return the report: every number is the result's, every text from outside is escaped.

    Parameters
    ----------
    result
        The content of `result.json` (see `rid_daq.report.result`); sections that it lacks are left
        out.

    Raises
    ------
    RecordingError
        A section is not what its name says: a key is missing, or of another kind.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("rid_daq", "report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    environment.filters["duration"] = duration
    environment.filters["unit"] = unit
    environment.filters["moment"] = moment
    template = environment.get_template("report.html")
    figures = _figures(result)
    with _shown("the document"):
        return template.render(result=result, figures=figures)


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


def _visible(value: Any) -> Any:
    """Return what an expression of the page gave, its invisible characters visible."""
    return printable(value) if type(value) is str else value


@contextlib.contextmanager
def _shown(section: str) -> Iterator[None]:
    """Name the section that cannot be shown.

    Raises
    ------
    RecordingError
        In place of what Python says of data that are not what they should be.
    """
    try:
        yield
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
        jinja2.TemplateError,
    ) as error:
        said = f"the key {error} is missing" if isinstance(error, KeyError) else str(error)
        raise RecordingError(f"{section}: cannot be shown: {said}; was it edited?") from error


def _plain(value: Any) -> Any:
    """Return data whose texts a figure shows as they are: `$` begins no formula."""
    if isinstance(value, str):
        return printable(value).replace("$", r"\$")
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {_plain(key): _plain(item) for key, item in value.items()}
    return value


def _figures(result: dict[str, Any]) -> dict[str, Any]:
    """Draw what the result has curves for: name to inline SVG, or list of such."""
    figures: dict[str, Any] = {"loops": []}
    for section, draw in _DRAWN.items():
        if section in result:
            with _shown(section):
                figures |= draw(_plain(result[section]))
    return figures


def _curves(curves: dict[str, Any]) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    if "torque" in curves:
        torque = curves["torque"]
        figures["torque"] = [
            Markup(torque_figure(torque["time_s"], axis, f"torque{position}"))
            for position, axis in enumerate(torque["axes"])
        ]
    if "spectrum" in curves:
        spectrum = curves["spectrum"]
        figures["spectrum"] = Markup(spectrum_figure(spectrum["frequency_hz"], spectrum["axes"]))
    return figures


def _friction(friction: dict[str, Any]) -> dict[str, Any]:
    return {"friction": Markup(friction_figure(friction["joints"]))}


def _truth(truth: list[dict[str, Any]]) -> dict[str, Any]:
    return {"truth": Markup(truth_figure(truth))}


def _velocity_loops(loops: dict[str, Any]) -> dict[str, Any]:
    axes = loops["axes"]
    return {
        "controllers": [
            Markup(controller_figure(axis["response"] | {"unit": axis["unit"]}, f"controller{k}"))
            for k, axis in enumerate(axes)
        ],
        "cascades": [
            Markup(cascade_figure(axis["cascade"], f"cascade{k}")) for k, axis in enumerate(axes)
        ],
    }


def _tracking(tracking: dict[str, Any]) -> dict[str, Any]:
    return {
        "tracking": [
            (
                Markup(path_figure(motion["drawn"], f"path{position}")),
                Markup(error_figure(motion["drawn"], tracking["joints"], f"error{position}")),
            )
            for position, motion in enumerate(tracking["motions"])
        ]
    }


def _timing(timing: dict[str, Any]) -> dict[str, Any]:
    return {
        "loops": [
            Markup(histogram_figure(loop["edges_us"], loop["counts"], f"loop{position}"))
            for position, loop in enumerate(timing.get("loops", []))
        ]
    }


_DRAWN: dict[str, Callable[[Any], dict[str, Any]]] = {
    "curves": _curves,
    "friction": _friction,
    "truth": _truth,
    "velocity_loops": _velocity_loops,
    "tracking": _tracking,
    "timing": _timing,
}
"""The sections that figures are made of, and what makes them."""
