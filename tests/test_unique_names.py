"""Each class and public function of the eight packages has a name of its own."""

from __future__ import annotations

import ast
from collections import defaultdict
from typing import Final

from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.syntax_trees import source_files, tree_of

SHARED: Final = {"main", "run", "EstimationOptions", "ModelOptions"}
"""Names that may occur twice: entry points, functions of operations, requests and their results."""
API: Final = ROOT / "rid_daq" / "api"
"""Folder of the Python interface; it may reuse names, because no module of rid-daq imports it."""


def test_no_two_classes_or_public_functions_have_one_name() -> None:
    places = defaultdict(list)
    for path in source_files(*PACKAGES):
        for node in () if path.is_relative_to(API) else tree_of(path).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                places[node.name].append(str(path.relative_to(ROOT)))
    twice = {
        name: files
        for name, files in places.items()
        if len(files) > 1 and name not in SHARED and not name.startswith("_")
    }
    assert twice == {}
