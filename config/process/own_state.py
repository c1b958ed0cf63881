"""`own_state_folder`, `own_secret`: private state of this user account on this computer."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from pathlib import Path
from typing import Final

from config.errors import RecordingError, system_errors

SECRET_BYTES: Final = 32
FOREIGN: Final = "RID-STATE-FOREIGN"


def own_state_folder() -> Path:
    """Return this account's folder for the program's state; create it if missing.

    The folder is ``$XDG_STATE_HOME/rid-daq``, or ``~/.local/state/rid-daq``.

    Raises:
        RecordingError: The folder cannot be created, or another account owns it or can write to it.
    """
    stated = os.environ.get("XDG_STATE_HOME", "")
    home = Path(stated) if Path(stated).is_absolute() else Path("~/.local/state").expanduser()
    folder = home / "rid-daq"
    with system_errors(RecordingError, f"{folder}: cannot be created", code="RID-FILE-ACCESS"):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        _require_own(folder, os.stat(folder), forbidden=0o022)
    return folder


def own_secret(name: str) -> bytes:
    """Return a secret of this account; create it if missing.

    Args:
        name: The name of its file in `own_state_folder`.

    Raises:
        RecordingError: The secret cannot be read or created, has a wrong length, or another account
            owns it or can read it.
    """
    path = own_state_folder() / name
    with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-ACCESS"):
        if not path.exists():
            _create_secret(path)
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        with open(descriptor, "rb") as file:
            _require_own(path, os.fstat(descriptor), forbidden=0o077)
            secret = file.read(SECRET_BYTES + 1)
    if len(secret) != SECRET_BYTES:
        raise RecordingError(
            f"{path}: is not a secret of rid-daq; move it away, and a new one is created",
            code="RID-STATE-DAMAGED",
        )
    return secret


def _create_secret(path: Path) -> None:
    """Create a complete secret file, unless another process has just created it."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        with open(os.open(temporary, flags, 0o600), "wb") as file:
            file.write(secrets.token_bytes(SECRET_BYTES))
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(FileExistsError):
            os.link(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _require_own(path: Path, status: os.stat_result, forbidden: int) -> None:
    rights = "own, read and write" if forbidden & 0o044 else "own and write"
    if status.st_uid != os.geteuid() or stat.S_IMODE(status.st_mode) & forbidden:
        raise RecordingError(
            f"{path}: belongs to user {status.st_uid} with mode {stat.S_IMODE(status.st_mode):03o};"
            f" only user {os.geteuid()} may {rights} it. Find out who made it, then"
            " move it away or correct owner and mode",
            code=FOREIGN,
        )
