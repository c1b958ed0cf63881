"""A live page does not change a motion, even if the page dies (row 22 of docs/faults.md)."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import MotionContext, record_motion
from acquisition.task.states import TaskProgress
from config.load import LoadedCell, load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.live.live_page import LivePage, live_page
from rid_daq.requests.cell_options import Live
from tests.builders.console_blocks import assert_shown

pytestmark = pytest.mark.slow

CLIENTS = 1000


class Crowd:
    """Many clients of the page that send no complete request, or never read the answer."""

    def __init__(self, page: LivePage) -> None:
        self.lines: list[socket.socket] = []
        self._page = page
        self.killed = False

    def __call__(self, progress: TaskProgress) -> None:
        """Connect all clients when the motion starts; kill the page near its end."""
        if not self.lines and progress.phase >= Phase.RUN_IN:
            access = self._page.access
            hanging = (
                f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{access.port}\r\n"
                f"Authorization: Bearer {access.token}\r\n\r\n"
            )
            for number in range(CLIENTS):
                line = socket.socket()
                line.setblocking(False)
                line.connect_ex(("127.0.0.1", access.port))
                self.lines.append(line)
                if number < 20:
                    line.setblocking(True)
                    line.sendall(hanging.encode())
        if not self.killed and progress.phase >= Phase.RUN_OUT:
            self.killed = True
            for process in multiprocessing.active_children():
                if process.name == "rid-daq live page" and process.pid is not None:
                    os.kill(process.pid, signal.SIGKILL)

    def disconnect(self) -> None:
        for line in self.lines:
            line.close()


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def samples(loaded: LoadedCell) -> MotionSamples:
    joints = tuple(
        FourierJoint(joint=name, sine=(0.2,), cosine=(0.1,)) for name in loaded.robot.joint_names
    )
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=8, ramp_s=1.0, joints=joints
    )
    return motion.plan(loaded.robot, loaded.config.cycle_time_s)


Record = Callable[[SimulatedCell], RecordOutcome]


def record_on_new_cell(loaded: LoadedCell, record: Record) -> tuple[RecordOutcome, np.ndarray]:
    """Record on a new simulated cell in lock-step; return the outcome and the rows."""
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1)
    ) as simulated:
        outcome = record(simulated)
    assert outcome.complete
    return outcome, read_journal(outcome.path).rows


@pytest.mark.fault(22)
def test_many_clients_and_a_killed_page_do_not_change_the_recording(
    loaded: LoadedCell, samples: MotionSamples, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    def record_without_page(simulated: SimulatedCell) -> RecordOutcome:
        folder = RunFolder.create(tmp_path / "runs", "plain")
        return record_motion(simulated.cell, loaded.robot, samples, folder)

    def record_with_page(simulated: SimulatedCell) -> RecordOutcome:
        folder = RunFolder.create(tmp_path / "runs", "watched")
        with live_page(Live(wanted=True, listen="127.0.0.1:0")) as page:
            assert page is not None
            crowd = Crowd(page)
            outcome = record_motion(
                simulated.cell,
                loaded.robot,
                samples,
                folder,
                on_progress=crowd,
                context=MotionContext(page.observer("test", samples, simulated.cell, loaded.robot)),
            )
            crowd.disconnect()
        assert len(crowd.lines) == CLIENTS
        assert crowd.killed
        return outcome

    alone, rows = record_on_new_cell(loaded, record_without_page)
    beside, rows_beside = record_on_new_cell(loaded, record_with_page)
    assert alone.notes == ()
    assert [note for note in beside.notes if "live page died" in note]
    assert rows.tobytes() == rows_beside.tobytes()
    measured(
        f"{len(rows)} rows are bit-identical although {CLIENTS} clients connect (20 of which hang)"
        " and the page is killed"
    )


def test_record_prints_the_address_of_the_page_and_closes_it_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = tmp_path / "motion.yaml"
    motion.write_text(
        "kind: fourier\nrobot: ir361\nperiod_s: 2.0\nperiods: 2\nramp_s: 1.0\njoints:\n"
        + "".join(f"  - {{joint: axis{i}, sine: [0.2], cosine: [0.1]}}\n" for i in (1, 2, 3))
    )
    command = ["record", "ir361", str(motion), "--runs", str(tmp_path / "runs")]
    assert run([*command, "--live", "--listen", "127.0.0.1:0"]) == 0
    output = capsys.readouterr().err
    assert_shown("watch-and-stop", "rid-daq record ir361 excitation.yaml --live", output)
    found = re.search(r"Live page: http://127\.0\.0\.1:(\d+)/\?t=[\w-]{40,}\n", output)
    assert found is not None
    with socket.socket() as line:
        assert line.connect_ex(("127.0.0.1", int(found[1]))) != 0


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--live", "--listen", "0.0.0.0:8642"], "needs --token FILE and --certificate FILE"),
        (["--listen", "127.0.0.1:1"], "without --live"),
        (["--live", "--listen", "nowhere"], "give an IP address and a port"),
    ],
)
def test_a_live_page_that_is_not_allowed_is_refused_before_the_start(
    options: list[str], problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = tmp_path / "motion.yaml"
    motion.write_text("kind: multipoint\nrobot: ir361\npoints: 2\nseed: 1\n")
    runs = tmp_path / "runs"
    assert run(["record", "ir361", str(motion), "--runs", str(runs), *options]) == 2
    assert problem in capsys.readouterr().err
    assert not runs.exists()


def test_a_port_in_use_is_a_usage_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion = tmp_path / "motion.yaml"
    motion.write_text("kind: multipoint\nrobot: ir361\npoints: 2\nseed: 1\n")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listen = f"127.0.0.1:{listener.getsockname()[1]}"
        assert run(["record", "ir361", str(motion), "--live", "--listen", listen]) == 2
    assert "RID-LISTEN-ADDRESS" in capsys.readouterr().err
