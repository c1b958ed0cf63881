"""A service's cell in the Python API: recorded and driven motions, downloads, need of a lease."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.errors import ConfigError, LockedError, RidDaqError
from rid_daq.api import Cell, Model, Motion, Payload, compensate, design, identify
from rid_daq.service.sockets import socket_path_of
from tests.builders.known_model import joint_path, write_path_files
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import serving

pytestmark = pytest.mark.slow

PATH = joint_path([0.0, 0.0, 0.0], [0.2, 0.1, -0.2])


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


def test_a_path_is_driven_with_its_feedforward(service: str, tmp_path: Path) -> None:
    write_path_files(tmp_path, PATH)
    motion = Motion.load(tmp_path / "path.yaml", cell="ir361")
    model, payload = Model.load(tmp_path / "alone.json"), Payload.load(tmp_path / "payload.json")
    ahead = compensate(motion, model, tmp_path / "loops.json", payload=payload)
    with Cell("ir361", service) as cell:
        recording = cell.record(motion, feedforward=ahead)
        uploaded = ("motion-", "feedforward-")
        left = [each.path for each in cell._client.files("ir361").motions]
    assert recording.run.folder.read("feedforward.json") == ahead.content
    assert not [name for name in left if name.startswith(uploaded)]


def test_a_file_of_the_service_is_saved(service: str, tmp_path: Path) -> None:
    motion = Motion.through([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], cell="ir361")
    motion.save(tmp_path / "path.yaml")
    with Cell("ir361", service) as cell:
        cell._client.put_file(tmp_path / "path.yaml", "uploaded.yaml")
        cell.download("uploaded.yaml", tmp_path / "again.yaml")
        with raises_code(ConfigError, "RID-FILE-EXISTS"):
            cell.download("uploaded.yaml", tmp_path / "again.yaml")
        with pytest.raises(RidDaqError) as raised:
            cell.download("none.yaml", tmp_path / "none.yaml")
    assert raised.value.refusal == "RID-FILE-UNKNOWN"
    assert (tmp_path / "again.yaml").read_bytes() == (tmp_path / "path.yaml").read_bytes()


def test_a_cell_that_is_not_leased_is_refused(service: str) -> None:
    closed = Cell("ir361", service)
    with closed:
        assert closed.status.simulated
    motion = Motion.through([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], cell="ir361")
    uses: tuple[Callable[[Cell], object], ...] = (
        lambda cell: cell.run("check"),
        lambda cell: cell.record(motion),
        lambda cell: cell.recording("latest"),
        lambda cell: cell.status,
    )
    for cell, use in itertools.product((Cell("ir361"), closed), uses):
        with raises_code(ConfigError, "RID-API-ARGUMENT"):
            use(cell)
