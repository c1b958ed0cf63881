"""The output of a command with `--json`."""

from __future__ import annotations

import json
from typing import Any

import pytest


def document(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Return the JSON document on stdout; nothing else may be printed there."""
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found
