"""`refuse_remote_terminal`: no key of a real cell is held over a network that cannot answer back.

A terminal sends a key's repeats and nothing else. Over a network they come late, in bursts or
without an end: a real cell is therefore jogged from a terminal of this computer, or
in a browser, which answers challenges.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from config.errors import PreflightError

CODE: Final = "RID-KEY-REMOTE"

_VARIABLES: Final = ("SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY", "VNCDESKTOP", "XRDP_SESSION")
"""Set by servers that let somebody in from elsewhere."""

_SERVERS: Final = (
    *("sshd", "dropbear", "mosh-server", "etserver", "etterminal", "tailscaled", "teleport"),
    *("telnetd", "in.telnetd", "in.rlogind", "in.rshd", "ttyd", "gotty", "shellinaboxd", "tmate"),
    *("wetty", "cockpit-bridge", "jupyter-lab", "jupyter-noteboo", "code-server"),
    *("Xvnc", "Xtigervnc", "x11vnc", "xrdp", "xrdp-sesman", "xrdp-chansrv"),
)
"""Names of programs that give somebody elsewhere a terminal of this computer."""

_MULTIPLEXERS: Final = ("tmux: server", "screen", "zellij", "dtach", "abduco", "byobu")
_CLIENTS: Final = ("tmux: client", "screen", "zellij", "dtach", "abduco")


def refuse_remote_terminal(
    environment: Mapping[str, str] = os.environ, proc: Path = Path("/proc")
) -> None:
    """Refuse to hold keys of a real cell if the terminal is reached over a network.

    Args:
        environment: The variables of this process.
        proc: Where the kernel shows processes.

    Raises:
        PreflightError: It is, as far as variables, processes above this one and those that are
            attached to a terminal multiplexer show.
    """
    why = remote_terminal(environment, proc)
    if why:
        raise PreflightError(
            f"this terminal is remote ({why}): a slow or broken link could hold the key of a real"
            " robot after it was let go. Hold the buttons of a browser instead: run `rid-daq serve"
            " CELL` on this computer, forward its port from yours (`ssh -L 8642:127.0.0.1:8642"
            " HOST`) or serve with TLS (`--listen 0.0.0.0:8642 --certificate FILE`), and open the"
            " page Cell. A terminal of this computer itself will do too",
            code=CODE,
        )


def remote_terminal(environment: Mapping[str, str], proc: Path) -> str:
    """Return what shows that the terminal is reached over a network; empty if nothing does."""
    above = list(_above(proc, _own_id(proc)))
    for name in above:
        if _is_server(name):
            return f"{name} runs above this program"
    if any(name in _MULTIPLEXERS for name in above):
        clients = list(_attached(proc))
        for client in clients:
            for name in _above(proc, client):
                if _is_server(name):
                    return f"{name} runs above a client of the terminal multiplexer"
        if clients:  # the variables are those of whoever began the multiplexer
            return ""
    found = next((each for each in _VARIABLES if environment.get(each)), "")
    return f"{found} is set" if found else ""


def _is_server(name: str) -> bool:
    return name in _SERVERS or name.startswith("sshd")


def _own_id(proc: Path) -> int:
    return int((proc / "self").readlink().name)


def _above(proc: Path, process: int) -> Iterator[str]:
    """Yield the names of the processes above one, the nearest first."""
    while process > 1:
        name, process = _name_and_parent(proc, process)
        if process == 0:
            return
        name, _ = _name_and_parent(proc, process)
        yield name


def _attached(proc: Path) -> Iterator[int]:
    """Yield the processes that are attached to a terminal multiplexer of this computer."""
    for folder in proc.iterdir():
        if folder.name.isdecimal():
            name, _ = _name_and_parent(proc, int(folder.name))
            if name in _CLIENTS:
                yield int(folder.name)


def _name_and_parent(proc: Path, process: int) -> tuple[str, int]:
    """Return a process's name and its parent's id; nothing and 0 if it has ended.

    Note:
        proc_pid_stat(5): the name stands in brackets and may contain some.
    """
    try:
        text = (proc / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "", 0
    head, _, rest = text.rpartition(")")
    return head.partition("(")[2], int(rest.split()[1])
