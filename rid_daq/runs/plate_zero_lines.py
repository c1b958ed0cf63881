"""Write a force plate's zero into the text of a cell file; keep its comments and order."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from config.cell.cell import CellConfig
from config.cell.plate import PlateZero
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.whole_file import write_whole
from config.formats.yaml_tree import MAX_BYTES, parse_yaml
from config.load import validate

FALLBACK_INDENT = 2

ZERO_FILE = "zero.yaml"
"""File of a run with the measured zero, as lines of a cell file."""

_SOURCE = "measured by `rid-daq plate zero`, run "


def zero_source(run_id: str) -> str:
    """Return the comment behind a zero that a run has measured."""
    return f"{_SOURCE}{run_id}"


def run_of_zero(text: str) -> str:
    """Return the run that measured the zero in a cell file's text; empty without its comment."""
    _, source, after = text.partition(_SOURCE)
    return after.split()[0] if source and after.strip() else ""


def zero_lines(zero: PlateZero, comment: str = "", indent: int = FALLBACK_INDENT) -> str:
    """Return `plate.zero` as lines of a cell file.

    Args:
        zero: The measured offsets.
        comment: Comment behind the key.
        indent: Spaces before the key.
    """
    space = " " * indent
    head = f"{space}zero:" + (f" # {comment}" if comment else "")
    keys = [
        f"{space}  {key}: [{', '.join(_yaml_float(v) for v in getattr(zero, key))}]"
        for key in type(zero).model_fields
    ]
    return "\n".join([head, *keys]) + "\n"


def replace_zero(text: str, zero: PlateZero, name: str, comment: str = "") -> str:
    """Return a cell file's text with `plate.zero` added or replaced.

    Everything else is unchanged, including comments and order; the result is parsed again and
    compared.

    Args:
        text: Text of the file.
        zero: The measured offsets.
        name: Name of the file in messages.
        comment: Comment behind the key.

    Raises:
        ConfigError: `plate` is not a block of lines, or the change would alter another key.
    """
    before = parse_yaml(text.encode(), name)
    plate = _mapping_value(yaml.compose(text, Loader=yaml.SafeLoader), "plate")
    if not isinstance(plate, yaml.MappingNode) or plate.flow_style or not plate.value:
        raise ConfigError(
            f"{name}: `plate` is not written as a block of lines, so it cannot be changed"
            " automatically; enter the zero manually",
            code="RID-PLATE-ZERO-WRITE",
        )
    lines = text.splitlines(keepends=True)
    first_key = plate.value[0][0].start_mark
    start = end = first_key.line
    for key, value in plate.value:
        if key.value == "zero":
            start, end = key.start_mark.line, _last_line(value) + 1
    new = zero_lines(zero, comment, first_key.column)
    if lines[first_key.line].endswith("\r\n"):
        new = new.replace("\n", "\r\n")
    changed = "".join([*lines[:start], new, *lines[end:]])
    after = parse_yaml(changed.encode(), name)
    expected = {**before.data, "plate": {**before.data["plate"]}}
    expected["plate"]["zero"] = {key: list(getattr(zero, key)) for key in type(zero).model_fields}
    if after.data != expected:
        raise ConfigError(
            f"{name}: the change would alter other keys; enter the zero manually",
            code="RID-PLATE-ZERO-WRITE",
        )
    validate(after, CellConfig)
    return changed


def write_zero(path: Path, zero: PlateZero, comment: str = "") -> None:
    """Write a zero into a cell file; the file is replaced completely or not at all.

    Raises:
        ConfigError: The file cannot be read, or cannot be changed safely.
        RecordingError: The file cannot be written.
    """
    target = path.resolve()
    try:
        text = read_file(target, MAX_BYTES).decode("utf-8")
        mode = target.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: the file cannot be read: {error}", code="RID-FILE-READ"
        ) from None
    write_whole(target, replace_zero(text, zero, str(path), comment).encode())
    target.chmod(mode & 0o777)


def _mapping_value(node: yaml.Node | None, name: str) -> yaml.Node | None:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    return next((value for key, value in pairs if key.value == name), None)


def _last_line(node: yaml.Node) -> int:
    """Return the number of the line with a node's last word.

    The end mark of a block in YAML can be in a later line.
    """
    if isinstance(node, yaml.MappingNode) and not node.flow_style and node.value:
        return _last_line(node.value[-1][1])
    if isinstance(node, yaml.SequenceNode) and not node.flow_style and node.value:
        return _last_line(node.value[-1])
    return int(node.end_mark.line)


def _yaml_float(value: float) -> str:
    text = repr(float(value))
    return re.sub(r"^([-+]?\d+)e", r"\1.0e", text)
