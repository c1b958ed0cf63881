"""What a command told with `--json`."""

from __future__ import annotations

import json
from typing import Any

import pytest


def document(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Return the document that was printed, and nothing beside it."""
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found
