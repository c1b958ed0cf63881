"""A service in this process, without workers; and one as a process, on a simulated cell."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.service.client import ServiceClient
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.sockets import socket_of


@pytest.fixture(scope="session")
def motion() -> str:
    """A short periodic motion of the bundled cell: three periods of 4.8 s."""
    cell = load_cell("ir361")
    options = TwoHarmonicOptions(
        4.8, highest_harmonic=4, limit_fraction=0.35, tries=8, seed=3, periods=3
    )
    return to_yaml(design_two_harmonic(cell.robot, options, cell.config.cycle_time_s))


@pytest.fixture
def service(tmp_path: Path) -> CellService:
    """A service of one simulated cell, whose workers nobody starts."""
    return CellService(tmp_path, [ServedCell("ir361", 20.0)])


@dataclass
class ServedProcess:
    """`rid-daq serve` as a process.

    Attributes
    ----------
    folder : Path
        Its folder.
    process : subprocess.Popen
        It.
    url : str
        The address of its pages, with the secret of its terminal.
    """

    folder: Path
    process: subprocess.Popen[str]
    url: str

    @property
    def client(self) -> ServiceClient:
        return ServiceClient.at(str(socket_of(self.folder)))

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        code = self.process.wait(60)
        if self.process.stdout is not None:
            self.process.stdout.close()
        return code


def serve(folder: Path, *more: str, cell: str = "ir361") -> ServedProcess:
    """Start a service of a bundled cell in a folder, and wait until it answers."""
    with (folder / "serve.log").open("ab") as log:
        process = subprocess.Popen(
            [
                *(sys.executable, "-m", "rid_daq", "serve", cell, "--folder", str(folder)),
                *("--listen", "127.0.0.1:0", "--pace", "20", "--json", *more),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env={**os.environ},
        )
    assert process.stdout is not None
    text = ""
    while not text.endswith("}\n"):
        line = process.stdout.readline()
        assert line, (folder / "serve.log").read_text()
        text += line
    process.stdout.close()
    return ServedProcess(folder, process, str(json.loads(text)["url"]))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[ServedProcess]:
    """A service of a bundled simulated cell, as a process of its own for one test."""
    running = serve(tmp_path)
    yield running
    if running.process.poll() is None:
        running.end()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """The same for the tests of a file that leave it as it was."""
    running = serve(tmp_path_factory.mktemp("served"))
    yield running
    assert running.end() == 0
