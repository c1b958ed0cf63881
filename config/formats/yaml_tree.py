"""Conversion of YAML text to plain data with positions, in a strict subset of YAML.

The rules are the YAML 1.2 core schema on top of PyYAML's parser: no tags that change a value, no
duplicate keys, no merge keys, limited size, depth and alias expansion. Text that YAML 1.1 reads in
a surprising way (`010`, `1:30`, `no`) is refused.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from config.errors import ConfigError
from config.formats.bounded_file import encoding_hint
from config.formats.file_kinds import kind_of_text, way_from

MAX_BYTES = 1_000_000
MAX_NODES = 200_000
MAX_DEPTH = 40
_QUOTED = tuple("[]{},:#&*!|>%@`'\"")  # characters that have a special meaning in YAML
WIDTH = 100

Path = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+(\.[0-9_]*)?")
_OTHER_BASE = re.compile(r"[-+]?0[xobXOB][0-9a-fA-F_]+")
_GROUPED = re.compile(r"[-+]?[0-9][0-9_]*_[0-9_]*(\.[0-9_]*)?")
_SEXAGESIMAL = re.compile(r"[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9]*)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF|nan|NaN|NAN)")
_OLD_BOOLEANS = frozenset({"yes", "no", "on", "off", "y", "n"})
_RESOLVER = yaml.SafeLoader("")  # finds the tag that a plain value has without an explicit one


@dataclass(frozen=True)
class YamlTree:
    """Plain data (dict, list, str, int, float, bool, None) with the position of each key or item.

    `positions` maps a path of keys and indices to (line, column), both counted from 1.
    """

    name: str
    data: Any
    positions: dict[Path, tuple[int, int]]

    def where(self, path: Path) -> str:
        """Return `name:line:column` of `path`, or of its closest parent with a known position."""
        for length in range(len(path), -1, -1):
            position = self.positions.get(path[:length])
            if position is not None:
                return f"{self.name}:{position[0]}:{position[1]}"
        return self.name

    def json(self) -> str:
        """Return the data as JSON text: from it, strict models accept lists as tuples."""
        return json.dumps(self.data)


def parse_yaml(text: bytes, name: str) -> YamlTree:
    """Parse one YAML document.

    Args:
        text: The file's bytes, UTF-8.
        name: Name of the file in messages.

    Raises:
        ConfigError: The text is not YAML, or uses a refused feature of YAML; the message has
            `name:line:column`, or only the name if the file is too large or is not UTF-8.
    """
    if len(text) > MAX_BYTES:
        raise ConfigError(
            f"{name}: {len(text)} bytes; at most {MAX_BYTES} are allowed", code="RID-FILE-SIZE"
        )
    try:
        root = yaml.compose(text.decode("utf-8-sig"), Loader=yaml.SafeLoader)
    except UnicodeDecodeError as error:
        kind = kind_of_text(text)
        what = "not UTF-8 text" if kind is None else f"this is {kind}, not UTF-8 text"
        raise ConfigError(
            f"{name}: {what} (byte {error.start}){encoding_hint(text)}", code="RID-FILE-TYPE"
        ) from None
    except yaml.MarkedYAMLError as error:
        kind = kind_of_text(text, by_keys=False)
        if kind is not None:
            raise ConfigError(
                f"{name}: this is {kind}, not a YAML file{way_from(kind)}", code="RID-FILE-TYPE"
            ) from None
        raise ConfigError(_syntax_error(error, text, name), code="RID-FILE-SYNTAX") from None
    except yaml.YAMLError as error:
        raise ConfigError(
            f"{name}: not valid YAML: {str(error).splitlines()[0]}", code="RID-FILE-SYNTAX"
        ) from None
    except RecursionError:
        raise ConfigError(
            f"{name}: not valid YAML: nested too deeply", code="RID-FILE-SIZE"
        ) from None
    except ValueError:
        raise ConfigError(f"{name}: not valid YAML: not readable", code="RID-FILE-SYNTAX") from None
    if root is None:
        raise ConfigError(f"{name}:1:1: the file is empty", code="RID-FILE-EMPTY")
    positions: dict[Path, tuple[int, int]] = {}
    data = _Builder(name, positions).build(root, (), 0)
    return YamlTree(name, data, positions)


def _syntax_error(error: yaml.MarkedYAMLError, text: bytes, name: str) -> str:
    """Return a syntax error with its position, and a hint if quotes are missing."""
    mark = error.problem_mark or error.context_mark
    problem = f"not valid YAML: {error.problem or error.context}"
    if mark is None:
        return f"{name}: {problem}"
    line = text.decode("utf-8-sig").splitlines()[mark.line : mark.line + 1]
    if line and line[0][mark.column : mark.column + 1] in _QUOTED:
        problem += "; put a text with such a character in quotes"
    return f"{name}:{mark.line + 1}:{mark.column + 1}: {problem}"


class _Builder:
    def __init__(self, name: str, positions: dict[Path, tuple[int, int]]) -> None:
        self._name = name
        self._positions = positions
        self._nodes = 0

    def build(self, node: yaml.Node, path: Path, depth: int) -> Any:
        self._nodes += 1
        if self._nodes > MAX_NODES:
            self._refuse(
                node, f"more than {MAX_NODES} values after expanding aliases", "RID-FILE-SIZE"
            )
        if depth > MAX_DEPTH:
            self._refuse(node, f"nested more than {MAX_DEPTH} deep", "RID-FILE-SIZE")
        self._positions.setdefault(path, (node.start_mark.line + 1, node.start_mark.column + 1))
        if isinstance(node, yaml.MappingNode):
            self._check_tag(node, "tag:yaml.org,2002:map")
            return self._mapping(node, path, depth)
        if isinstance(node, yaml.SequenceNode):
            self._check_tag(node, "tag:yaml.org,2002:seq")
            return [self.build(item, (*path, i), depth + 1) for i, item in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        raise ConfigError(f"{self._name}: a YAML node of an unknown kind", code="RID-FILE-SYNTAX")

    def _mapping(self, node: yaml.MappingNode, path: Path, depth: int) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                self._refuse(key_node, "a key must be a plain word", "RID-FILE-SYNTAX")
            key = key_node.value
            if key_node.tag == "tag:yaml.org,2002:merge":
                self._refuse(key_node, "merge keys are not allowed; write the keys", "RID-FILE-TAG")
            if key in result:
                self._refuse(
                    key_node,
                    f"the key {key!r} is a duplicate; remove one",
                    "RID-FILE-DUPLICATE",
                )
            child = (*path, key)
            self._positions[child] = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            result[key] = self.build(value_node, child, depth + 1)
        return result

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        text: str = node.value
        if node.style is not None:
            self._check_tag(node, "tag:yaml.org,2002:str")
            return text
        plain_tag = _RESOLVER.resolve(yaml.ScalarNode, text, (True, False))  # type: ignore[no-untyped-call]
        if node.tag != plain_tag:
            self._refuse(
                node, f"the tag {node.tag!r} is not allowed; write the plain value", "RID-FILE-TAG"
            )
        if text in {"", "~", "null", "Null", "NULL"}:
            return None
        if text in {"true", "True", "TRUE"}:
            return True
        if text in {"false", "False", "FALSE"}:
            return False
        if _INTEGER.fullmatch(text):
            if len(text) > 20:
                self._refuse(
                    node, f"the number {text[:20]}… has too many digits", "RID-FILE-NUMBER"
                )
            return int(text)
        if _FLOAT.fullmatch(text):
            number = float(text)
            if not math.isfinite(number):
                self._refuse(node, f"{text} is too large for a number", "RID-FILE-NUMBER")
            return number
        self._refuse_ambiguous(node, text)
        return text

    def _refuse_ambiguous(self, node: yaml.Node, text: str) -> None:
        if text.lower() in _OLD_BOOLEANS:
            self._refuse(
                node,
                f"{text} could mean a word or a boolean; write true, false or '{text}'",
                "RID-FILE-AMBIGUOUS",
            )
        if _LEADING_ZERO.fullmatch(text):
            self._refuse(
                node,
                f"{text} could mean octal; write it without the leading zero",
                "RID-FILE-AMBIGUOUS",
            )
        if _SEXAGESIMAL.fullmatch(text):
            self._refuse(
                node,
                f"{text} could mean base 60; write a plain number, or '{text}'",
                "RID-FILE-AMBIGUOUS",
            )
        if _OTHER_BASE.fullmatch(text) or _GROUPED.fullmatch(text):
            self._refuse(
                node, f"{text}: write the number in plain decimal digits", "RID-FILE-NUMBER"
            )
        if _NOT_FINITE.fullmatch(text):
            self._refuse(node, f"{text} is not a finite number", "RID-FILE-NUMBER")

    def _check_tag(self, node: yaml.Node, expected: str) -> None:
        if node.tag != expected:
            self._refuse(node, f"the tag {node.tag!r} is not allowed; remove it", "RID-FILE-TAG")

    def _refuse(self, node: yaml.Node, problem: str, code: str) -> None:
        mark = node.start_mark
        raise ConfigError(f"{self._name}:{mark.line + 1}:{mark.column + 1}: {problem}", code=code)


def dump_yaml(data: object, comment: str = "", comments: Mapping[Path, str] | None = None) -> str:
    """Return plain data as YAML text that `parse_yaml` reads back to equal data.

    Args:
        data: Nested dict, list, str, int, finite float, bool, None.
        comment: Text above the data; each line is prefixed by `# `.
        comments: Texts by path; each is written above the line of its key or list item.
    """
    head = "".join(f"# {line}\n" if line else "#\n" for line in comment.splitlines())
    text = yaml.dump(
        data,
        Dumper=_Dumper,
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=None,
        width=WIDTH,
    )
    return head + (_insert_comments(text, comments) if comments else text)


def _insert_comments(text: str, comments: Mapping[Path, str]) -> str:
    """Return YAML text with each comment above the line of its path, equally indented."""
    positions = parse_yaml(text.encode(), "").positions
    above: dict[int, list[str]] = {}
    for path, comment in comments.items():
        above.setdefault(positions[path][0] - 1, []).append(comment)
    lines = []
    for number, line in enumerate(text.splitlines()):
        margin = " " * (len(line) - len(line.lstrip())) + "# "
        for comment in above.get(number, ()):
            lines += textwrap.wrap(comment, WIDTH, initial_indent=margin, subsequent_indent=margin)
        lines.append(line)
    return "".join(f"{line}\n" for line in lines)


class _Dumper(yaml.SafeDumper):
    """PyYAML's dumper that quotes every string that another reader could misread."""


def _dump_string(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    plain = re.fullmatch(r"[A-Za-z_][\w .-]*", text) and text.lower() not in (
        _OLD_BOOLEANS | {"true", "false", "null"}
    )
    style = None if plain and not text.endswith(" ") else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


def _dump_float(dumper: yaml.SafeDumper, number: float) -> yaml.ScalarNode:
    text = repr(number)
    if "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


_Dumper.add_representer(str, _dump_string)
_Dumper.add_representer(float, _dump_float)
