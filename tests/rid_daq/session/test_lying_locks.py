"""Locks with false content: `rid-daq stop` relies on the kernel and still stops every session.

A real process holds each false lock. The unrelated processes that the locks name must still
run afterwards: no signal was sent to them.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import stat
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.cell.cell import CellConfig
from config.errors import LockedError
from config.load import load_cell
from config.process import file_locks
from rid_daq.app import run
from rid_daq.session.running_sessions import ProcessIdentity, RunningSession, running_sessions
from rid_daq.session.session import hold_cell
from tests.builders.people import LIAR, ME, PERSON, STRANGER, People, is_alive, reports_alive
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

COLLEAGUE, NEXT = 64001, 64002
needs_root = pytest.mark.skipif(ME != 0, reason="only root can act as two other users")


@pytest.fixture
def people() -> Iterator[People]:
    with contextlib.ExitStack() as stack:
        yield People(stack)


@pytest.fixture
def locks(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A separate folder for locks that all users can write to, like /run/lock."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        os.chmod(folder, 0o777 | stat.S_ISVTX)
        monkeypatch.setenv("RID_DAQ_LOCKS", folder)
        yield Path(folder)


@pytest.fixture
def cell() -> CellConfig:
    cell = load_cell("ir361").config
    bus = cell.can.model_copy(update={"interface": "socketcan", "channel": "can0"})
    return cell.model_copy(update={"can": bus})


def false_locks(innocent: int) -> dict[str, tuple[str, str]]:
    """Return false lock files: for each name, the kind of file (text, folder, ...) and its text."""
    identity = ProcessIdentity.of(innocent)
    assert identity is not None
    texts = {
        "innocent": f"process {innocent}: rid-daq record\ncell ir361\n",
        "innocent_started": f"started {identity.started}: rid-daq record\ncell ir361\n",
        "zero": "process 0: rid-daq record\ncell ir361\n",
        "minus": "process -1: rid-daq record\ncell ir361\n",
        "twenty": "process 12345678901234567890: rid-daq record\ncell ir361\n",
        "twenty_started": "started 12345678901234567890: rid-daq record\ncell ir361\n",
        "ours": f"process {os.getpid()}: rid-daq record\ncell ir361\n",
        "one": "process 1: rid-daq record\ncell ir361\n",
        "garbage": "\x00\xff\x1b[2J" * 500,
        "empty": "",
    }
    kinds = {kind: (kind, "") for kind in ("folder", "fifo", "link", "closed")}
    return kinds | {name: ("file", text) for name, text in texts.items()}


def hold_false_locks(people: People, locks: Path, innocent: int) -> list[subprocess.Popen[str]]:
    """Hold every false lock file, once as the lock of a bus and once as the file of a session."""
    liars = [
        people.start(LIAR, locks / file, kind, text.encode("latin-1").hex())
        for name, (kind, text) in false_locks(innocent).items()
        for file in (f"rid-daq-{name}.lock", f"rid-daq-{name}.{ME}.session")
    ]
    assert all(reports_alive(liar) for liar in liars)
    return liars


@pytest.mark.fault(40)
def test_false_locks_neither_signal_a_stranger_nor_prevent_a_stop(
    people: People,
    locks: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    innocent = people.start(STRANGER)
    liars = hold_false_locks(people, locks, innocent.pid)
    (locks / "rid-daq-left-over.0.session").write_text("process 1: rid-daq\ncell x\n")
    session = people.session()
    assert run(["stop", "--json"]) == 4, "a lock holder that is not a session is reported"
    result = json.loads(capsys.readouterr().out)["sessions"]
    assert session.wait(120.0) == 143
    strangers = [innocent, *liars]
    assert all(is_alive(stranger) for stranger in strangers)
    stopped = [entry for entry in result if entry["stopped"]]
    assert [(entry["process"], entry["cell"]) for entry in stopped] == [(session.pid, "ir361")]
    left_alone = [entry for entry in result if not entry["stopped"]]
    assert {entry["process"] for entry in left_alone} <= {liar.pid for liar in liars}
    assert len(left_alone) == len(false_locks(innocent.pid)) - 1 - (ME != 0), (
        "a link cannot be locked"
    )
    assert all("not stopped; `ps -fp" in entry["text"] for entry in left_alone)
    measured(
        f"{len(liars)} false locks: 0 signals to {len(strangers)} unrelated processes, the session"
        " is stopped"
    )


@pytest.mark.fault(40)
@needs_root
def test_stop_by_root_ignores_a_lock_forged_by_another_user(
    people: People, locks: Path, measured: Callable[[str], None]
) -> None:
    innocent = people.start(STRANGER)
    identity = ProcessIdentity.of(innocent.pid)
    assert identity is not None
    forge = f"""
import fcntl
forged = open({str(locks)!r} + "/rid-daq-forged.0.session", "w")
print("started {identity.started}: rid-daq\\ncell ir361", file=forged, flush=True)
fcntl.flock(forged, fcntl.LOCK_EX)
"""
    session = people.session(forge, user=COLLEAGUE)
    code, sessions = people.stop(user=0)
    assert session.wait(120.0) == 143, "only the colleague's own session ends"
    assert is_alive(innocent)
    ends = {(entry["process"], entry["stopped"]) for entry in sessions}
    assert (session.pid, True) in ends
    left_alone = (
        session.pid,
        False,
    ) in ends  # the forged session, unless its owner has already ended
    assert len(ends) == 1 + left_alone
    assert code == (4 if left_alone else 0)
    measured("another user's forged lock: `stop` by root signals only a process of that user")


@pytest.mark.fault(40)
def test_a_process_id_that_was_reused_is_not_signalled(
    people: People,
    locks: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    measured: Callable[[str], None],
) -> None:
    session, stranger = people.session(), people.start(STRANGER)
    (ours,) = running_sessions()
    kernel = Path("/proc/locks").read_text()
    assert f" {session.pid} " in kernel
    later = tmp_path / "locks"
    later.write_text(kernel.replace(f" {session.pid} ", f" {stranger.pid} "))
    monkeypatch.setattr(file_locks, "LOCKS", later)
    (entry,) = running_sessions()
    assert entry.pid == stranger.pid
    assert entry.refusal is not None
    ours.terminate()
    entry.terminate()
    assert run(["stop"]) == 4
    assert is_alive(stranger)
    assert session.poll() is None
    measured("a process id that was reused: detected by the process's start time")


@pytest.mark.parametrize("moment", ["before the check", "after the check"])
def test_a_session_that_ends_during_the_stop_is_not_an_error(
    people: People,
    locks: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    moment: str,
) -> None:
    session = people.session()
    opened, sent = os.pidfd_open, signal.pidfd_send_signal

    def end() -> None:
        session.kill()
        session.wait(120.0)

    def open_late(pid: int) -> int:
        descriptor = opened(pid)
        end()
        return descriptor

    def send_late(descriptor: int, number: int) -> None:
        end()
        sent(descriptor, number)

    if moment == "before the check":
        monkeypatch.setattr(os, "pidfd_open", open_late)
    else:
        monkeypatch.setattr(signal, "pidfd_send_signal", send_late)
    assert run(["stop"]) == 0


MEMORY = """
import ctypes, fcntl
from acquisition.task.control_block import ControlBlock
memory = os.memfd_create(ControlBlock.LABEL, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
os.write(memory, b"\\x7f" * ctypes.sizeof(ControlBlock.WORDS))
"""
SEALED = MEMORY + "fcntl.fcntl(memory, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK)"


@pytest.mark.parametrize(("memory", "code"), [(MEMORY, 0), (SEALED, 4)], ids=["open", "sealed"])
def test_a_session_with_invalid_shared_memory_is_ended_by_a_signal(
    people: People,
    locks: Path,
    capsys: pytest.CaptureFixture[str],
    memory: str,
    code: int,
) -> None:
    session = people.session(memory)
    assert run(["stop"]) == code
    assert session.wait(120.0) == 143
    output = capsys.readouterr().out
    assert ("the axes could not be observed" in output) == bool(code)


def test_an_error_with_one_session_does_not_prevent_stopping_others(
    people: People,
    locks: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    session = people.session()
    broken = RunningSession(Path("x"), 17, "rid-daq record", "other")
    terminate = RunningSession.terminate

    def fail(this: RunningSession) -> None:
        if this is broken:
            raise RuntimeError("the sky fell")
        terminate(this)

    monkeypatch.setattr(RunningSession, "terminate", fail)
    found = [broken, *running_sessions()]
    name = "rid_daq.session.running_sessions.running_sessions"
    monkeypatch.setattr(name, lambda _cell=None: found)
    assert run(["stop", "--all", "--json"]) == 4
    assert session.wait(120.0) == 143
    stopped = json.loads(capsys.readouterr().out)["sessions"]
    assert [each["stopped"] for each in stopped] == [False, True]


def test_stop_does_not_end_its_own_program(
    locks: Path, cell: CellConfig, capsys: pytest.CaptureFixture[str]
) -> None:
    with hold_cell(cell):
        assert run(["stop"]) == 4


@pytest.mark.fault(41)
@needs_root
def test_a_lock_left_by_another_user_belongs_to_the_new_session(
    people: People, locks: Path, measured: Callable[[str], None]
) -> None:
    dead = people.session(user=COLLEAGUE)
    dead.kill()
    dead.wait(120.0)
    left = {path.stat().st_uid for path in locks.iterdir()}
    assert left == {COLLEAGUE}, "the lock files of a killed session remain"
    session = people.session(user=NEXT)
    code, sessions = people.stop(user=COLLEAGUE)
    assert code == 4
    assert [entry["text"] for entry in sessions] == [
        "belongs to another user; only that user or root can stop it from here"
    ]
    code, sessions = people.stop(user=NEXT)
    assert code == 0
    assert [(entry["process"], entry["stopped"]) for entry in sessions] == [(session.pid, True)]
    assert session.wait(120.0) == 143
    again = people.session(user=COLLEAGUE)
    assert people.stop(user=0)[0] == 0, "root stops the sessions of all users"
    assert again.wait(120.0) == 143
    measured(
        "the lock of a killed session: taken over by another user; only this user and root can stop"
        " the new session"
    )


@pytest.mark.fault(41)
@needs_root
def test_a_lock_file_owned_by_another_user_is_explained(
    people: People, locks: Path, cell: CellConfig, measured: Callable[[str], None]
) -> None:
    with hold_cell(cell):
        (lock,) = locks.glob("*.lock")
        (ours,) = locks.glob("*.session")
    script = f"""
from pathlib import Path
theirs = Path({str(ours.with_name(ours.name.replace(".0.", f".{NEXT}.")))!r})
theirs.touch()
"""
    blocker = people.session(script, user=COLLEAGUE)
    with raises_code(LockedError, "RID-CELL-BUSY", f"process {blocker.pid}"), hold_cell(cell):
        pass
    blocker.kill()
    blocker.wait(120.0)
    refused = people.start(PERSON.replace("with hold_cell(cell):", TELL), NEXT, "hold")
    output, _ = refused.communicate(timeout=120.0)
    assert f".{NEXT}.session: cannot be written: Operation not permitted." in output
    assert "ask its owner or root to remove it" in output
    lock.chmod(0)
    refused = people.start(PERSON.replace("with hold_cell(cell):", TELL), NEXT, "hold")
    output, _ = refused.communicate(timeout=120.0)
    assert "cannot open the lock file: Permission denied; its owner or root can remove it" in output
    measured("a lock file that cannot be taken over: exit code 7, the message refers to its owner")


TELL = """
from config.errors import RecordingError
try:
    hold_cell(cell).__enter__()
except RecordingError as error:
    sys.exit(print(error))
if True:
"""


def test_a_lock_missing_in_the_kernel_table_is_explained(
    locks: Path, cell: CellConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "empty").touch()
    with hold_cell(cell):
        monkeypatch.setattr(file_locks, "LOCKS", tmp_path / "empty")
        with raises_code(LockedError, "RID-CELL-BUSY", "container"), hold_cell(cell):
            pass
