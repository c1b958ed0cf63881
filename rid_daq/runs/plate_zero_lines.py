"""Putting a plate's zero into the text of a cell file, which keeps its comments and its order."""

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


def zero_lines(zero: PlateZero, comment: str = "", indent: int = FALLBACK_INDENT) -> str:
    """Return the lines of `plate.zero` as they stand in a cell file.

    Args:
        zero: What was found.
        comment: Put behind the key.
        indent: Spaces before the key.
    """
    space = " " * indent
    head = f"{space}zero:" + (f" # {comment}" if comment else "")
    keys = [
        f"{space}  {key}: [{', '.join(_number(v) for v in getattr(zero, key))}]"
        for key in type(zero).model_fields
    ]
    return "\n".join([head, *keys]) + "\n"


def with_zero(text: str, zero: PlateZero, name: str, comment: str = "") -> str:
    """Return a cell file's text with `plate.zero` put in, or in the place of an older one.

    Everything else stays as it is, comments and order included; the result is read again.

    Args:
        text: The file's text.
        zero: What was found.
        name: What to call the file in messages.
        comment: Put behind the key.

    Raises:
        ConfigError: The file has no `plate` in lines of its own, or would not say the same
            otherwise.
    """
    before = parse_yaml(text.encode(), name)
    plate = _value(yaml.compose(text, Loader=yaml.SafeLoader), "plate")
    if not isinstance(plate, yaml.MappingNode) or plate.flow_style or not plate.value:
        raise ConfigError(
            f"{name}: plate does not stand there as lines of its own; put the zero in by hand",
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
            f"{name}: cannot be changed safely; put the zero in by hand",
            code="RID-PLATE-ZERO-WRITE",
        )
    validate(after, CellConfig)
    return changed


def write_zero(path: Path, zero: PlateZero, comment: str = "") -> None:
    """Put a zero into a cell file; the file is replaced whole or left as it is.

    Raises:
        ConfigError: The file cannot be read, or cannot take it safely.
        RecordingError: It cannot be written.
    """
    target = path.resolve()
    try:
        text = read_file(target, MAX_BYTES).decode("utf-8")
        mode = target.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}", code="RID-FILE-READ") from None
    write_whole(target, with_zero(text, zero, str(path), comment).encode())
    target.chmod(mode & 0o777)


def _value(node: yaml.Node | None, name: str) -> yaml.Node | None:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    return next((value for key, value in pairs if key.value == name), None)


def _last_line(node: yaml.Node) -> int:
    """Return the line on which a node's last word stands; blocks themselves end further down."""
    if isinstance(node, yaml.MappingNode) and not node.flow_style and node.value:
        return _last_line(node.value[-1][1])
    if isinstance(node, yaml.SequenceNode) and not node.flow_style and node.value:
        return _last_line(node.value[-1])
    return int(node.end_mark.line)


def _number(value: float) -> str:
    """Return a number as YAML reads a float."""
    text = repr(float(value))
    return re.sub(r"^([-+]?\d+)e", r"\1.0e", text)
