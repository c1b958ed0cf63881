"""YAML values follow the core schema; ambiguous text is refused with its position."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ConfigError
from config.formats.json_file import parse_json
from config.formats.yaml_tree import MAX_BYTES, MAX_DEPTH, MAX_NODES, dump_yaml, parse_yaml
from tests.builders.raised_codes import raises_code


def test_plain_values_are_read_by_the_core_schema_of_yaml_1_2() -> None:
    tree = parse_yaml(
        b"a: 1\nb: -2.5\nc: 1e3\nd: true\ne: ~\nf: word\ng: '010'\nh: [1, .5]\ni: 2026-11-21\n", "f"
    )
    assert tree.data == {
        "a": 1,
        "b": -2.5,
        "c": 1000.0,
        "d": True,
        "e": None,
        "f": "word",
        "g": "010",
        "h": [1, 0.5],
        "i": "2026-11-21",
    }


def test_every_value_knows_its_line_and_column() -> None:
    tree = parse_yaml(b"a: 1\nb:\n  - x: 2\n    y: 3\n", "cell.yaml")
    assert tree.where(("b", 0, "y")) == "cell.yaml:4:5"
    assert tree.where(("b", 0, "not there")) == "cell.yaml:3:5"


@pytest.mark.parametrize(
    ("text", "position", "code", "value"),
    [
        (b"node_id: 010", "1:10", "RID-FILE-AMBIGUOUS", "010"),
        (b"time: 1:30", "1:7", "RID-FILE-AMBIGUOUS", "'1:30'"),
        (b"enabled: no", "1:10", "RID-FILE-AMBIGUOUS", "'no'"),
        (b"enabled: On", "1:10", "RID-FILE-AMBIGUOUS", "'On'"),
        (b"count: 0x10", "1:8", "RID-FILE-NUMBER", "0x10"),
        (b"count: 1_000", "1:8", "RID-FILE-NUMBER", "1_000"),
        (b"limit: .inf", "1:8", "RID-FILE-NUMBER", ".inf"),
        (b"limit: 1e999", "1:8", "RID-FILE-NUMBER", "1e999"),
        (b"a: 1\nb: 2\na: 3", "3:1", "RID-FILE-DUPLICATE", "'a'"),
        (b"a: !!python/object/apply:os.system ['ls']", "1:4", "RID-FILE-TAG", "apply:os.system"),
        (b"a: !!python/name:os.system", "1:4", "RID-FILE-TAG", "name:os.system"),
        (b"a: !secret x", "1:4", "RID-FILE-TAG", "'!secret'"),
        (b"a: !!set {x, y}", "1:4", "RID-FILE-TAG", ":set'"),
        (b"a: &x {b: 1}\nc:\n  <<: *x", "3:3", "RID-FILE-TAG", "keys"),
        (b"a: !!str 5", "1:4", "RID-FILE-TAG", ":str'"),
        (b"a: !!float 5", "1:4", "RID-FILE-TAG", ":float'"),
        (b"? [a, b]\n: 1", "1:3", "RID-FILE-SYNTAX", "key"),
        (b"a: [1, 2", "1:9", "RID-FILE-SYNTAX", "YAML"),
        (b"a: 1\n\tb: 2", "2:1", "RID-FILE-SYNTAX", "YAML"),
        (b"", "1:1", "RID-FILE-EMPTY", ""),
    ],
)
def test_a_yaml_trap_is_refused_with_its_position(
    text: bytes, position: str, code: str, value: str
) -> None:
    with raises_code(ConfigError, code, value) as caught:
        parse_yaml(text, "cell.yaml")
    assert str(caught.value).startswith(f"cell.yaml:{position}: ")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
def test_the_encoding_of_a_file_that_is_not_utf_8_is_named(encoding: str) -> None:
    name = encoding[:6].upper()
    with raises_code(ConfigError, "RID-FILE-TYPE", "cell.yaml: ", name, "UTF-8"):
        parse_yaml("name: ir361\n".encode(encoding), "cell.yaml")
    with raises_code(ConfigError, "RID-FILE-TYPE", name, "UTF-8"):
        parse_json('{"name": "ir361", "runs": []}'.encode(encoding))


def test_an_alias_bomb_is_refused_before_expansion() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [" + ", ".join([f"*a{n - 1}"] * 10) + "]" for n in range(1, 10)]
    with raises_code(ConfigError, "RID-FILE-SIZE", "bomb.yaml:", str(MAX_NODES)):
        parse_yaml("\n".join(lines).encode(), "bomb.yaml")


def test_an_alias_to_itself_is_refused() -> None:
    with raises_code(ConfigError, "RID-FILE-SIZE", "loop.yaml:1:4:", str(MAX_DEPTH)):
        parse_yaml(b"a: &a [*a]", "loop.yaml")


def test_too_deep_nesting_and_too_large_files_are_refused() -> None:
    with raises_code(ConfigError, "RID-FILE-SIZE", "deep.yaml:1:44:", str(MAX_DEPTH)):
        parse_yaml(b"a: " + b"[" * 100 + b"]" * 100, "deep.yaml")
    with raises_code(ConfigError, "RID-FILE-SIZE", "deep.yaml:"):
        parse_yaml(b"[" * 100_000, "deep.yaml")
    with raises_code(ConfigError, "RID-FILE-SIZE", f"{MAX_BYTES + 1} bytes"):
        parse_yaml(b" " * (MAX_BYTES + 1), "large.yaml")


def test_text_that_is_not_utf8_is_refused() -> None:
    with raises_code(ConfigError, "RID-FILE-TYPE", "UTF-8"):
        parse_yaml(b"a: \xff\xfe", "latin.yaml")


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused_with_a_config_error(text: bytes) -> None:
    try:
        tree = parse_yaml(text, "any")
    except ConfigError:
        return
    assert json.loads(tree.json()) == tree.data, "the tree contains other objects than plain data"


_SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**15), 10**15)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), max_size=20)
)


@given(
    st.dictionaries(
        st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True),
        st.recursive(_SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=10),
        min_size=1,
        max_size=6,
    )
)
def test_a_written_tree_is_read_back_equal(data: dict[str, object]) -> None:
    assert parse_yaml(dump_yaml(data, "a comment\n\nof two lines").encode(), "f").data == data


def test_small_floats_survive_the_round_trip() -> None:
    data = {"a": 1e-5, "b": 5e-324, "c": -0.0, "d": 1e22}
    read = parse_yaml(dump_yaml(data).encode(), "f").data
    assert read == data
    assert math.copysign(1.0, read["c"]) == -1.0
