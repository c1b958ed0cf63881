"""The API's schema is frozen, and incompatible changes are detected."""

from __future__ import annotations

import copy
import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest

REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "reference"


@pytest.fixture(scope="module")
def api() -> ModuleType:
    spec = importlib.util.spec_from_file_location("api", REFERENCE / "api.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_frozen_document_equals_the_schema_of_the_code(api: ModuleType) -> None:
    frozen = (REFERENCE / "openapi.json").read_text(encoding="utf-8")
    assert api.openapi() == frozen, "run: .venv/bin/python docs/reference/api.py"


def test_incompatible_changes_of_the_schema_are_named(api: ModuleType) -> None:
    before = json.loads((REFERENCE / "openapi.json").read_text(encoding="utf-8"))
    assert api.breaks(before, before) == []
    after = copy.deepcopy(before)
    del after["paths"]["/api/v1/jobs"]
    del after["paths"]["/api/v1/cells/{cell}/lease"]["put"]
    after["components"]["schemas"]["Request-record"]["required"].append("label")
    del after["components"]["schemas"]["Job"]["properties"]["reason"]
    after["components"]["schemas"]["JobKind"]["enum"].remove("record")
    assert set(api.breaks(before, after)) == {
        "/api/v1/jobs: is gone",
        "put /api/v1/cells/{cell}/lease: is gone",
        "Request-record.label: is asked for",
        "Job.reason: is gone",
        "JobKind: record is gone",
    }


def test_additions_to_the_schema_are_compatible(api: ModuleType) -> None:
    before = json.loads((REFERENCE / "openapi.json").read_text(encoding="utf-8"))
    after = copy.deepcopy(before)
    after["paths"]["/api/v1/more"] = {"get": {}}
    after["components"]["schemas"]["Job"]["properties"]["more"] = {"type": "string"}
    after["components"]["schemas"]["Job"]["required"].append("more")
    after["components"]["schemas"]["Request-record"]["properties"]["more"] = {"type": "string"}
    assert api.breaks(before, after) == []
