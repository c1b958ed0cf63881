"""What all exported files have in common: the head that tells where they come from, templates."""

from __future__ import annotations

import re
from importlib import resources
from importlib.metadata import version
from typing import Any

import jinja2
import numpy as np

from config.arrays import FloatArray
from config.robot.robot import Joint
from dynamics.model.memory import presliding
from identification.export.model import ExportModel


def head(model: ExportModel) -> tuple[str, ...]:
    """Return who wrote a file and from what, a line each, safe in any comment."""
    lines = (
        f"Robot {model.robot.name}, identified, written by rid-daq {version('rid-daq')}.",
        *model.origin,
        *_memory(model),
    )
    return tuple(plain(line) for line in lines)


def _memory(model: ExportModel) -> tuple[str, ...]:
    """Say of friction with memory what a file without states cannot hold."""
    numbers = [
        number
        for each in presliding(model.model)
        for number in (each.distance, each.share)
        if number is not None
    ]
    own = ", ".join(
        f"{each.name} = {each.value:.3g}{'' if each.unit == '1' else ' ' + each.unit}"
        for each in numbers
    )
    if not own:
        return ()
    return (
        f"Left out: presliding ({own}). Here friction slides by the sign of the speed, which says"
        " nothing of a joint at rest or turning round.",
    )


def temperatures(model: ExportModel) -> tuple[str, ...]:
    """Say what a function's argument `temperature_k` is, a line each."""
    warming = model.warming
    if warming is None:
        return ("temperature_k: measured temperatures of the joints' drives in K.",)
    speed = "v the speed of the joint"
    if model.model.coupling is not None:
        speed = "v the speed of the actuator"
    lines = [
        "temperature_k is not what a thermometer shows. It follows from the motion since the robot",
        f"was cold (x = 0), with {speed}; x is counted as 1 K a watt:",
        "  T x' = P - x,  P = (f_C + f_v |v|) |v|,  temperature_k = T0 + x.",
        "Over a time step dt: x becomes P + exp(-dt / T) (x - P). Joints that are not listed do not"
        " use it.",
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
    return tuple(map(plain, lines))


def friction_units(joint: Joint) -> tuple[str, str]:
    """Return the units of a joint's Coulomb and viscous friction."""
    return ("N m", "N m s/rad") if joint.type == "revolute" else ("N", "N s/m")


def plain(text: str) -> str:
    """Return a line that ends no comment of XML, C or Python, and has no control characters."""
    visible = "".join(c if c.isprintable() else " " for c in text)
    return visible.replace("*/", "* /").replace("--", "- -").replace('"""', "'''").rstrip("\\")


def source_name(name: str) -> str:
    """Return a robot's name as C and Python take one."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return text if text[:1].isalpha() else f"robot_{text}"


def numbers(values: FloatArray | tuple[float, ...], separator: str = ", ") -> str:
    """Return numbers with every digit that they have, less rounding's dust about zero."""
    clean = (0.0 if abs(value) < 1e-15 else float(value) for value in values)
    return separator.join(map(repr, clean))


def nested(matrix: FloatArray, left: str = "(", right: str = ")") -> str:
    """Return a matrix or a table as nested tuples, or as another language's braces."""
    if matrix.ndim == 1:
        comma = "," if len(matrix) == 1 and left == "(" else ""
        return f"{left}{numbers(matrix)}{comma}{right}"
    rows = ", ".join(nested(row, left, right) for row in matrix)
    comma = "," if len(matrix) == 1 and left == "(" else ""
    return f"{left}{rows}{comma}{right}"


def render(template: str, **values: Any) -> str:
    """Fill in a template of `identification/templates`."""
    text = (resources.files("identification") / "templates" / template).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=False,
        autoescape=template.endswith((".urdf.j2", ".sdf.j2")),
    )
    environment.filters["nested"] = nested
    environment.filters["braces"] = lambda matrix: nested(matrix, "{", "}")
    return environment.from_string(text).render(**values)
