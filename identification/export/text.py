"""What all exported files have in common: the head that tells where they come from, templates."""

from __future__ import annotations

import re
from importlib import resources
from importlib.metadata import version
from typing import Any

import jinja2

from config.arrays import FloatArray
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


def plain(text: str) -> str:
    """Return a line that ends no comment of XML, C or Python, and has no control characters."""
    visible = "".join(c if c.isprintable() else " " for c in text)
    return visible.replace("*/", "* /").replace("--", "- -").replace('"""', "'''").rstrip("\\")


def identifier(name: str) -> str:
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
