"""Reports of the commands: drawings are left out, except in tests that read them."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module", autouse=True)
def _plain_reports(plain_reports: pytest.MonkeyPatch) -> None:
    """Leave out plots and pictures; see `plain_reports`."""
