"""Holding a key for a real cell is refused on each kind of remote terminal that is detected."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import PreflightError
from config.load import load_cell
from rid_daq.app import run
from rid_daq.terminal import keyboard
from rid_daq.terminal.remote_terminal import (
    CODE,
    refuse_remote_terminal,
    remote_terminal_evidence,
)

OF_SSH = {"SSH_CONNECTION": "10.0.0.7 50022 10.0.0.2 22"}


def proc_folder(folder: Path, *tree: tuple[int, str, int]) -> Path:
    """Return a folder like /proc with processes (id, name, parent); our own process is 100."""
    for number, name, parent in tree:
        shown = folder / str(number)
        shown.mkdir()
        (shown / "stat").write_text(f"{number} ({name}) S {parent} 1 1 0 -1 4194560 1 2\n")
    (folder / "self").symlink_to("100")
    (folder / "version").write_text("")
    return folder


LOCAL = [(1, "systemd", 0), (50, "gnome-terminal-", 1), (60, "bash", 50), (100, "python3", 60)]
BY_SSH = [
    (1, "systemd", 0),
    (40, "sshd", 1),
    (50, "sshd-session", 40),
    (60, "bash", 50),
    (90, "sudo", 60),
    (100, "python3", 90),
]
BY_MOSH = [(1, "systemd", 0), (50, "mosh-server", 1), (60, "bash", 50), (100, "python3", 60)]
IN_TMUX = [(1, "systemd", 0), (50, "tmux: server", 1), (60, "bash", 50), (100, "python3", 60)]
FROM_AFAR = [(70, "sshd: anna (x) ", 1), (71, "bash", 70), (72, "tmux: client", 71)]
FROM_HERE = [(80, "foot", 1), (81, "bash", 80), (82, "tmux: client", 81)]


@pytest.mark.promise("held-key-terminal")
@pytest.mark.parametrize(
    ("tree", "environment", "shown"),
    [
        (LOCAL, {}, ""),
        (LOCAL, OF_SSH, "SSH_CONNECTION"),
        (LOCAL, {"SSH_TTY": "/dev/pts/3"}, "SSH_TTY"),
        (LOCAL, {"VNCDESKTOP": "cell4:1"}, "VNCDESKTOP"),
        (BY_SSH, {}, "sshd-session"),
        (BY_MOSH, {}, "mosh-server"),
        (IN_TMUX + FROM_HERE, {}, ""),
        (IN_TMUX + FROM_HERE, OF_SSH, ""),  # started over ssh, attached from this computer
        (IN_TMUX + FROM_AFAR, {}, "sshd: anna (x) "),
        (IN_TMUX + FROM_HERE + FROM_AFAR, {}, "sshd: anna (x) "),
        (IN_TMUX, OF_SSH, "SSH_CONNECTION"),
        (LOCAL + FROM_AFAR, {}, ""),  # of another user
    ],
)
def test_a_remote_terminal_is_detected_by_variables_and_parent_processes(
    tmp_path: Path, tree: list[tuple[int, str, int]], environment: dict[str, str], shown: str
) -> None:
    found = remote_terminal_evidence(environment, proc_folder(tmp_path, *tree))
    assert (shown in found) if shown else (found == "")


def test_a_remote_terminal_is_refused_with_advice_to_use_a_browser(tmp_path: Path) -> None:
    with pytest.raises(PreflightError) as refused:
        refuse_remote_terminal(OF_SSH, proc_folder(tmp_path, *LOCAL))
    assert refused.value.refusal == CODE == "RID-KEY-REMOTE"
    for words in ("rid-daq serve", "ssh -L", "--certificate"):
        assert words in str(refused.value)


def test_a_server_among_the_parents_of_a_real_process_is_found(tmp_path: Path) -> None:
    server = tmp_path / "sshd-session"
    server.symlink_to(sys.executable)
    look = (
        "from pathlib import Path; from rid_daq.terminal import remote_terminal as terminal;"
        "print(terminal.remote_terminal_evidence({}, Path('/proc')))"
    )
    ask = "import subprocess, sys; sys.exit(subprocess.call(sys.argv[1:]))"
    finished = subprocess.run(
        [server, "-c", ask, sys.executable, "-c", look], capture_output=True, text=True, check=True
    )
    assert "sshd-session" in finished.stdout


@pytest.fixture
def real_cell(tmp_path: Path) -> Path:
    for name, content in load_cell("ir361").files.items():
        (tmp_path / name).write_bytes(content)
    cell = tmp_path / "cell.yaml"
    text = cell.read_text().replace("simulated: true\nplant: ir361\n", "")
    text = text.replace("interface: rid_sim, channel: ir361", "interface: socketcan, channel: can9")
    cell.write_text(text.replace("robot: ir361", "robot: robot.yaml"))
    assert not load_cell(str(cell)).config.simulated
    return cell


@pytest.mark.promise("held-key-terminal")
@pytest.mark.parametrize("command", ["jog", "axes"])
def test_jog_and_axis_test_of_a_real_cell_are_refused_before_the_cell_opens(
    real_cell: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(keyboard, "require_keyboard", lambda: None)
    monkeypatch.setenv("SSH_CONNECTION", OF_SSH["SSH_CONNECTION"])
    assert run([command, str(real_cell), "--runs", str(real_cell.parent / "runs")]) == 3
    assert f"[{CODE}]" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["jog", "axes"])
def test_a_simulated_cell_can_be_moved_over_a_remote_terminal(
    command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class ComeSoFarError(Exception):
        pass

    def come_so_far(*_: object, **_more: object) -> None:
        raise ComeSoFarError

    module = {"jog": "jogging", "axes": "axis_tester"}[command]
    monkeypatch.setattr(f"rid_daq.operations.cell.{module}.open_session", come_so_far)
    monkeypatch.setattr(keyboard, "require_keyboard", lambda: None)
    monkeypatch.setenv("SSH_CONNECTION", OF_SSH["SSH_CONNECTION"])
    with pytest.raises(ComeSoFarError):
        run([command, "ir361", "--runs", str(tmp_path)])
