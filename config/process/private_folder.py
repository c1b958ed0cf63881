"""`private_folder_problem`: check that no other user can read, write or replace private files."""

from __future__ import annotations

import grp
import os
import pwd
import stat
from pathlib import Path


def private_folder_problem(folder: Path) -> str:
    """Return why another user could access a folder of this user; empty if no other user can.

    Args:
        folder: The folder itself, not a symbolic link to it.

    Raises:
        OSError: The folder cannot be inspected.
    """
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return "is not a folder but a link or a file; remove it"
    if status.st_uid != os.geteuid():
        return f"belongs to {user_name(status.st_uid)}; let its owner or root remove it"
    if status.st_mode & 0o077:
        return f"is open to other users; run 'chmod 700 {folder}'"
    return ""


def changeable_by_others(folder: Path) -> str:
    """Return why another user could replace files in a folder; empty if no other user can.

    Root may own the folder. Any other user must not own it, and must not be able to write to it
    unless its sticky bit is set. A group that belongs to this user alone does not count as another
    user.

    Raises:
        OSError: The folder cannot be inspected.
    """
    status = folder.stat()
    if status.st_uid not in (0, os.geteuid()):
        return f"belongs to {user_name(status.st_uid)}; use a folder of your own"
    if status.st_mode & stat.S_ISVTX:
        return ""
    if _is_writable_by_others(status):
        return f"can be written by other users; run 'chmod go-w {folder}', or 'chmod +t {folder}'"
    return ""


def file_problem(path: Path) -> str:
    """Return why a file in a private folder may come from another user; empty if it cannot.

    Raises:
        OSError: The file or folder cannot be inspected.
    """
    status = path.lstat()
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        return "is neither a file nor a folder; remove it"
    if status.st_uid != os.geteuid():
        return f"belongs to {user_name(status.st_uid)}; remove it"
    if stat.S_ISREG(status.st_mode) and _is_writable_by_others(status):
        return "can be written by other users; they may have changed it: move it away"
    return ""


def user_name(uid: int) -> str:
    """Return a user's name, or the number if the user has no name."""
    try:
        return f"user {pwd.getpwuid(uid).pw_name}"
    except KeyError:
        return f"user {uid}"


def _is_writable_by_others(status: os.stat_result) -> bool:
    foreign_group = status.st_mode & 0o020 and not _is_own_group(status.st_gid)
    return bool(status.st_mode & 0o002 or foreign_group)


def _is_own_group(gid: int) -> bool:
    """Return whether a group is this user's private group, as most systems create it."""
    try:
        user = pwd.getpwuid(os.geteuid())
        group = grp.getgrgid(gid)
    except KeyError:
        return False
    return gid == user.pw_gid and group.gr_name == user.pw_name and not {*group.gr_mem} - {user[0]}
