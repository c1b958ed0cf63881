"""Common parts of all exported files: the header with their origin, and templates."""

from __future__ import annotations

import re
from importlib import resources
from importlib.metadata import version
from typing import Any

import jinja2
import numpy as np

from config.arrays import FloatArray
from config.robot.robot import Joint
from dynamics.model.memory import presliding_of_model
from identification.export.model import ExportModel


def header_lines(model: ExportModel) -> tuple[str, ...]:
    """Return the lines of a file's header, safe in any comment: program and origin."""
    lines = (
        f"Robot {model.robot.name}, identified; written by rid-daq {version('rid-daq')}.",
        *model.origin,
        *_memory(model),
    )
    return tuple(comment_text(line) for line in lines)


def _memory(model: ExportModel) -> tuple[str, ...]:
    """Return a note on presliding, which a file without states cannot represent."""
    numbers = [
        number
        for each in presliding_of_model(model.model)
        for number in (each.distance, each.fraction)
        if number is not None
    ]
    own = ", ".join(
        f"{each.name} = {each.value:.3g}{'' if each.unit == '1' else ' ' + each.unit}"
        for each in numbers
    )
    if not own:
        return ()
    return (
        f"Left out: presliding ({own}). In this file friction depends on the sign of the"
        " speed, which is not valid at standstill and at reversals.",
    )


def temperature_lines(model: ExportModel) -> tuple[str, ...]:
    """Return the lines that explain a function's argument `temperature_k`."""
    warming = model.warming
    if warming is None:
        return ("temperature_k: measured temperatures of the joints' drives in K.",)
    speed = "v the speed of the joint"
    if model.model.coupling is not None:
        speed = "v the speed of the actuator"
    lines = [
        "temperature_k is not a measured temperature. It is computed from the motion since the",
        f"robot was cold (x = 0), with {speed}; x is counted as 1 K per watt:",
        "  T x' = P - x,  P = (f_C + f_v |v|) |v|,  temperature_k = T0 + x.",
        "Over a time step dt: x becomes P + exp(-dt / T) (x - P). Joints that are not listed do"
        " not use temperature_k.",
    ]
    for j in np.flatnonzero(warming.joints):
        joint = model.robot.joints[j]
        coulomb, viscous = friction_units(joint)
        constant_s, coulomb_nm, viscous_nm_s = (
            float(values[j])
            for values in (warming.time_constant_s, warming.coulomb_nm, warming.viscous_nm_s)
        )
        lines.append(
            f"  {joint.name}: T = {constant_s!r} s, f_C = {coulomb_nm!r} {coulomb},"
            f" f_v = {viscous_nm_s!r} {viscous}, T0 = {joint.reference_temperature_k!r} K"
        )
    return tuple(map(comment_text, lines))


def friction_units(joint: Joint) -> tuple[str, str]:
    """Return the units of a joint's Coulomb and viscous friction."""
    return ("N m", "N m s/rad") if joint.type == "revolute" else ("N", "N s/m")


def comment_text(text: str) -> str:
    """Return a line that does not end a comment of XML, C or Python, without control characters."""
    visible = "".join(c if c.isprintable() else " " for c in text)
    visible = re.sub("-(?=-)", "- ", visible)
    return visible.replace("*/", "* /").replace('"""', "'''").rstrip("\\")


def source_name(name: str) -> str:
    """Return a robot's name as an identifier of C and Python."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return text if text[:1].isalpha() else f"robot_{text}"


def numbers(values: FloatArray | tuple[float, ...], separator: str = ", ") -> str:
    """Return numbers with all their digits, rounding errors near zero replaced by zero."""
    clean = (0.0 if abs(value) < 1e-15 else float(value) for value in values)
    return separator.join(map(repr, clean))


def nested_tuples(matrix: FloatArray, left: str = "(", right: str = ")") -> str:
    """Return a matrix or a table as nested tuples, or with other brackets."""
    if matrix.ndim == 1:
        comma = "," if len(matrix) == 1 and left == "(" else ""
        return f"{left}{numbers(matrix)}{comma}{right}"
    rows = ", ".join(nested_tuples(row, left, right) for row in matrix)
    comma = "," if len(matrix) == 1 and left == "(" else ""
    return f"{left}{rows}{comma}{right}"


def render(template: str, **values: Any) -> str:
    """Render a template of `identification/templates`."""
    text = (resources.files("identification") / "templates" / template).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=False,
        autoescape=template.endswith((".urdf.j2", ".sdf.j2", ".mjcf.j2")),
    )
    environment.filters["nested"] = nested_tuples
    environment.filters["braces"] = lambda matrix: nested_tuples(matrix, "{", "}")
    return environment.from_string(text).render(**values)
