"""`WriteLog`: log of the values that are written to drives by SDO, with the previous values.

Each write is one line. For a real drive, the line is on disk before the write reaches the drive, so
that it survives a crash of the program and a power failure. Lines are JSON: first the identity of a
node's drive, then every object that changes. Commands (6040h) are not settings: a reset of faults
does not log them, and a restore leaves them out.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from config.errors import ConfigError, RecordingError, system_errors
from config.formats.bounded_file import read_file
from config.model import ConfigModel
from config.wrong_value import explain_error
from drivers.canopen.sdo import object_name
from drivers.settings.saved_drive import (
    Address,
    DriveIdentity,
    HexBytes,
    NodeId,
    ObjectName,
    SavedDrive,
    address_of,
)

DRIVE_WRITES = "drive_writes.jsonl"
"""Name of the write log in a run folder."""

_LOG_BYTES = 64 << 20


class DriveLine(ConfigModel):
    """Identity of a node's drive, logged before its first change."""

    kind: Literal["drive"] = "drive"
    node_id: NodeId
    identity: DriveIdentity


class ChangeLine(ConfigModel):
    """A change of an object that is about to be made: by a write, or (`new` is None) by a reset.

    If the old value cannot be read, `old` is None and `why` is the reason.
    """

    kind: Literal["change"] = "change"
    node_id: NodeId
    object: ObjectName
    old: HexBytes | None
    new: HexBytes | None
    why: str = ""


_LINE: TypeAdapter[DriveLine | ChangeLine] = TypeAdapter(
    Annotated[DriveLine | ChangeLine, Field(discriminator="kind")]
)


class WriteLog:
    """Writer of a write log; the first line creates the file.

    Args:
        path: The file; its folder is created too.
        durable: True to wait until each line is on disk. Simulated drives lose their values in a
            power failure of the computer, so that their log need not wait.
    """

    def __init__(self, path: Path, *, durable: bool = True) -> None:
        self.path = path
        self._sync = os.O_DSYNC if durable else 0
        self._nodes: set[int] = set()

    def knows(self, node_id: int) -> bool:
        """Return True if the identity of a node's drive has been logged."""
        return node_id in self._nodes

    def add_drive(self, node_id: int, identity: DriveIdentity) -> None:
        """Log the identity of a node's drive.

        Raises:
            RecordingError: The log cannot be written.
        """
        self._append(DriveLine(node_id=node_id, identity=identity))
        self._nodes.add(node_id)

    def add_change(
        self, node_id: int, address: Address, old: bytes | str, new: bytes | None
    ) -> None:
        """Log a change that is about to be made; a text as `old` is the reason why it is unknown.

        Raises:
            RecordingError: The log cannot be written; the caller must then not write to the drive.
        """
        known = isinstance(old, bytes)
        self._append(
            ChangeLine(
                node_id=node_id,
                object=object_name(*address),
                old=old.hex() if isinstance(old, bytes) else None,
                new=None if new is None else new.hex(),
                why="" if known else str(old),
            )
        )

    def _append(self, line: DriveLine | ChangeLine) -> None:
        text = line.model_dump_json().encode() + b"\n"
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC | self._sync
        first = not self._nodes
        with system_errors(
            RecordingError,
            f"{self.path}: the values written to drives cannot be logged",
            code="RID-FILE-WRITE",
        ):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, flags, 0o644)
            try:
                written = os.write(descriptor, text)
            finally:
                os.close(descriptor)
            if first and self._sync:
                _sync_folder(self.path.parent)
        if written != len(text):
            raise RecordingError(
                f"{self.path}: the values written to drives cannot be logged: the disk is full",
                code="RID-SYSTEM-DISK-FULL",
            )


def _sync_folder(folder: Path) -> None:
    """Ensure that the name of a new file in a folder is on disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read_write_log(path: Path) -> tuple[SavedDrive, ...]:
    """Return the values of every drive from before the first change of each object.

    An incomplete last line is ignored, because the write that belongs to it did not reach the
    drive.

    Raises:
        ConfigError: The file cannot be read, or is not a write log; the message contains the number
            of the wrong line.
    """
    with system_errors(ConfigError, f"{path}: cannot be read", code="RID-FILE-READ"):
        data = read_file(path, _LOG_BYTES, follow_link=False)
    identities: dict[int, DriveIdentity] = {}
    values: dict[int, dict[Address, bytes]] = {}
    unknown: dict[int, dict[Address, str]] = {}
    for number, text in enumerate(data.split(b"\n")[:-1], start=1):
        try:
            line = _LINE.validate_json(text)
        except ValidationError as error:
            first = explain_error(error.errors()[0])
            raise ConfigError(
                f"{path}:{number}: not a line of a write log: {first}",
                code="RID-FILE-VALUE",
            ) from error
        node = line.node_id
        if isinstance(line, DriveLine):
            identities.setdefault(node, line.identity)
            continue
        address = address_of(line.object)
        if address in values.setdefault(node, {}) or address in unknown.setdefault(node, {}):
            continue
        if line.old is None:
            unknown[node][address] = line.why
        else:
            values[node][address] = bytes.fromhex(line.old)
    return tuple(
        SavedDrive.of(node, identity, values.get(node, {}), unknown.get(node, {}))
        for node, identity in identities.items()
    )
