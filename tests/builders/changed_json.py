"""JSON documents with one changed value."""

from __future__ import annotations

import copy
import json
from typing import Any

from hypothesis import strategies as st

NASTY = (
    "NaN", "-Infinity", "1e999", "1e308", "9" * 5000, "-1", "0", "true", "null", '""', "[]", "{}",
    '"\\ud800"', '"$\\\\frac{"', '"\\u0000\\u202e"', "[" * 90 + "]" * 90,
    '{"a": 1, "a": 2}', "[[1.0], 2]",
)  # fmt: skip
MARK = "changed here"


def places(document: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of every value; of a list, only of its first and last item."""
    found = [path]
    if isinstance(document, dict):
        children = list(document.items())
    elif isinstance(document, list):
        ends = sorted({0, len(document) - 1}) if document else []
        children = [(k, document[k]) for k in ends]
    else:
        return found
    return found + [place for key, child in children for place in places(child, (*path, key))]


def change(document: Any, path: tuple[Any, ...], nasty: str | None) -> bytes:
    """Return a JSON document with one value replaced by the JSON text `nasty`.

    If `nasty` is None, the value is removed.
    """
    tree = copy.deepcopy(document)
    parent = tree
    for key in path[:-1]:
        parent = parent[key]
    if nasty is None:
        del parent[path[-1]]
    else:
        parent[path[-1]] = MARK
    return json.dumps(tree).replace(f'"{MARK}"', nasty or "").encode()


def changes(document: Any) -> st.SearchStrategy[bytes]:
    """Return a strategy for a document with one value changed or removed."""
    where, what = st.sampled_from(places(document)[1:]), st.sampled_from((None, *NASTY))
    return st.builds(lambda path, nasty: change(document, path, nasty), where, what)
