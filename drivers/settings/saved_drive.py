"""`SavedDrive`: stored values of one drive's objects, with the drive's identity."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from config.cell.cell import DeviceIdentity
from config.cell.servo_profile import Unsigned32
from config.formats.json_file import read_json_file
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from drivers.canopen.sdo import object_name

Address = tuple[int, int]
"""Index and sub-index."""

ObjectName = Annotated[str, Field(pattern=r"^[0-9A-F]{4}h:[0-9A-F]{2}$")]
HexBytes = Annotated[str, Field(pattern=r"^([0-9a-f]{2})*$", max_length=1 << 17)]
NodeId = Annotated[int, Field(ge=1, le=127)]

_BACKUP_BYTES = 16 << 20


class DriveIdentity(DeviceIdentity):
    """A drive's answer of 1018h; None for unknown values."""

    serial: Unsigned32 | None = None

    def differences(self, other: DriveIdentity) -> tuple[str, ...]:
        """Return the differences of two drives; only upper 16 bits of revisions are compared."""
        pairs = {
            "vendor": (self.vendor, other.vendor),
            "product": (self.product, other.product),
            "revision": (_upper(self.revision), _upper(other.revision)),
            "serial number": (self.serial, other.serial),
        }
        return tuple(
            f"{name} {theirs:X}h instead of {ours:X}h"
            for name, (ours, theirs) in pairs.items()
            if ours is not None and theirs is not None and ours != theirs
        )


class SavedSetting(ConfigModel):
    """Value of one object, in the byte order of the bus; None with the reason."""

    object: ObjectName
    value: HexBytes | None
    why: str = ""


class SavedDrive(ConfigModel):
    """Values of one drive's objects, by their addresses."""

    node_id: NodeId
    identity: DriveIdentity
    settings: tuple[SavedSetting, ...]

    @classmethod
    def of(
        cls,
        node_id: int,
        identity: DriveIdentity,
        values: dict[Address, bytes],
        unknown: dict[Address, str],
    ) -> SavedDrive:
        """Return the values that were read from a drive, and the reasons for missing ones."""
        held: dict[Address, tuple[str | None, str]] = {
            address: (value.hex(), "") for address, value in values.items()
        }
        held |= {address: (None, why) for address, why in unknown.items()}
        settings = tuple(
            SavedSetting(object=object_name(*address), value=value, why=why)
            for address, (value, why) in sorted(held.items())
        )
        return cls(node_id=node_id, identity=identity, settings=settings)

    @property
    def values(self) -> dict[Address, bytes]:
        """The known values."""
        return {
            address_of(each.object): bytes.fromhex(each.value)
            for each in self.settings
            if each.value is not None
        }

    @property
    def unknown(self) -> dict[Address, str]:
        """The reasons for unknown values."""
        return {address_of(each.object): each.why for each in self.settings if each.value is None}


class DriveBackup(ConfigModel):
    """The file of `rid-daq drives backup`: all drives of a cell."""

    format: Literal[1]
    cell: str
    created_utc: str
    drives: tuple[SavedDrive, ...]

    @classmethod
    def read(cls, path: Path) -> DriveBackup:
        """Read the file.

        Raises:
            ConfigError: It cannot be read, or is not a backup.
        """
        return read_json_file(path, cls, _BACKUP_BYTES, "a backup of `rid-daq drives backup`")

    def write(self, path: Path) -> None:
        """Write the file.

        Raises:
            RecordingError: It cannot be written.
        """
        write_whole(path, self.model_dump_json(indent=1).encode() + b"\n")


def address_of(name: str) -> Address:
    """Return the address of an object's name."""
    index, subindex = name.split("h:")
    return int(index, 16), int(subindex, 16)


def _upper(revision: int | None) -> int | None:
    return None if revision is None else revision >> 16
