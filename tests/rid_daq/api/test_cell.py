"""A cell of a service from Python: its state, a job, a recorded motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from config.errors import ConfigError, LockedError, RidDaqError
from rid_daq.api import Cell, design, identify
from rid_daq.service.sockets import socket_path_of
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import serving

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Return the socket of a service of the bundled simulated arm."""
    folder: Path = tmp_path_factory.mktemp("served")
    with serving(folder) as running:
        yield str(socket_path_of(running.folder))


def test_a_motion_is_recorded_and_identified(service: str) -> None:
    options = {"excitation": {"method": "two-harmonic", "tries": 8, "limit_fraction": 0.4}}
    motion = design("ir361", period_s=4.8, periods=3, options=options)
    fractions: list[float] = []
    with Cell("ir361", service) as cell:
        assert cell.status.simulated
        assert cell.run("check")
        recording = cell.record(motion, progress=lambda _step, done, _total: fractions.append(done))
        with pytest.raises(LockedError), Cell("ir361", service):
            pass
        with pytest.raises(RidDaqError):
            cell.run("identify", {"names": ["none"]})
    assert fractions
    assert recording.is_periodic
    assert identify(recording, diagnose=False).problems == ()


def test_a_job_on_a_cell_that_is_not_leased_is_refused() -> None:
    with raises_code(ConfigError, "RID-API-ARGUMENT"):
        Cell("ir361").run("check")
