"""`refuse_remote_terminal`: refuses held keys of a real cell on a terminal behind a network.

A terminal reports only the repeats of a key. Over a network they can arrive late, in bursts or
without an end. A real cell is therefore jogged from a local terminal, or in a browser, which
answers challenges.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from config.errors import PreflightError

CODE: Final = "RID-KEY-REMOTE"

_VARIABLES: Final = ("SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY", "VNCDESKTOP", "XRDP_SESSION")
"""Environment variables that remote login servers set."""

_SERVERS: Final = (
    *("sshd", "dropbear", "mosh-server", "etserver", "etterminal", "tailscaled", "teleport"),
    *("telnetd", "in.telnetd", "in.rlogind", "in.rshd", "ttyd", "gotty", "shellinaboxd", "tmate"),
    *("wetty", "cockpit-bridge", "jupyter-lab", "jupyter-noteboo", "code-server"),
    *("Xvnc", "Xtigervnc", "x11vnc", "xrdp", "xrdp-sesman", "xrdp-chansrv"),
)
"""Names of programs that provide remote terminals and desktops."""

_MULTIPLEXERS: Final = ("tmux: server", "screen", "zellij", "dtach", "abduco", "byobu")
_CLIENTS: Final = ("tmux: client", "screen", "zellij", "dtach", "abduco")


def refuse_remote_terminal(
    environment: Mapping[str, str] = os.environ, proc: Path = Path("/proc")
) -> None:
    """Refuse held keys for a real cell if the terminal is reached over a network.

    The check uses environment variables, the parent processes, and the clients of a terminal
    multiplexer.

    Args:
        environment: Environment variables of this process.
        proc: Folder in which the kernel lists processes.

    Raises:
        PreflightError: The terminal is reached over a network.
    """
    why = remote_terminal_evidence(environment, proc)
    if why:
        raise PreflightError(
            f"this terminal is remote ({why}): over a slow or broken link, the key of a real"
            " robot could count as held after its release. Use the buttons of a browser instead:"
            " run `rid-daq serve CELL` on the robot's computer, forward its port (`ssh -L"
            " 8642:127.0.0.1:8642 HOST`) or serve with TLS (`--listen 0.0.0.0:8642 --certificate"
            " FILE`), and open the page Cell. You can also use a terminal on the robot's"
            " computer",
            code=CODE,
        )


def remote_terminal_evidence(environment: Mapping[str, str], proc: Path) -> str:
    """Return the evidence that the terminal is reached over a network; empty without evidence."""
    above = list(_ancestor_names(proc, _own_id(proc)))
    for name in above:
        if _is_server(name):
            return f"{name} is a parent process of this program"
    if any(name in _MULTIPLEXERS for name in above):
        clients = list(_multiplexer_clients(proc))
        for client in clients:
            for name in _ancestor_names(proc, client):
                if _is_server(name):
                    return f"{name} is a parent process of a client of the terminal multiplexer"
        if clients:  # the variables are those of the user who started the multiplexer
            return ""
    found = next((each for each in _VARIABLES if environment.get(each)), "")
    return f"the environment variable {found} is set" if found else ""


def _is_server(name: str) -> bool:
    return name in _SERVERS or name.startswith("sshd")


def _own_id(proc: Path) -> int:
    return int((proc / "self").readlink().name)


def _ancestor_names(proc: Path, process: int) -> Iterator[str]:
    """Yield the names of the ancestors of a process, the nearest first."""
    while process > 1:
        name, process = _name_and_parent(proc, process)
        if process == 0:
            return
        name, _ = _name_and_parent(proc, process)
        yield name


def _multiplexer_clients(proc: Path) -> Iterator[int]:
    """Yield the process ids of the clients of a terminal multiplexer."""
    for folder in proc.iterdir():
        if folder.name.isdecimal():
            name, _ = _name_and_parent(proc, int(folder.name))
            if name in _CLIENTS:
                yield int(folder.name)


def _name_and_parent(proc: Path, process: int) -> tuple[str, int]:
    """Return a process's name and its parent's id; an empty name and 0 if it has ended.

    Note:
        proc_pid_stat(5): the name is in parentheses and may contain parentheses.
    """
    try:
        text = (proc / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "", 0
    head, _, rest = text.rpartition(")")
    return head.partition("(")[2], int(rest.split()[1])
