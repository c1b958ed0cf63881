"""`SavedDrive`: saved values of one drive's objects, with the drive's identity."""

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
"""Index and sub-index of an object."""

ObjectName = Annotated[str, Field(pattern=r"^[0-9A-F]{4}h:[0-9A-F]{2}$")]
HexBytes = Annotated[str, Field(pattern=r"^([0-9a-f]{2})*$", max_length=1 << 17)]
NodeId = Annotated[int, Field(ge=1, le=127)]

_BACKUP_BYTES = 16 << 20


class DriveIdentity(DeviceIdentity):
    """Identity of a drive, from its object 1018h; None for unknown values."""

    serial: Unsigned32 | None = None

    def differences(self, other: DriveIdentity) -> tuple[str, ...]:
        """Return the differences in words; of the revisions, only the upper 16 bits count."""
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
    """Saved value of one object, in the byte order of the bus; None if unknown because of `why`."""

    object: ObjectName
    value: HexBytes | None
    why: str = ""


class SavedDrive(ConfigModel):
    """Saved values of one drive's objects."""

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
        """Return a drive with saved values, and with the reasons for the unknown values."""
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
        """The known values, by address."""
        return {
            address_of(each.object): bytes.fromhex(each.value)
            for each in self.settings
            if each.value is not None
        }

    @property
    def unknown(self) -> dict[Address, str]:
        """The reasons for unknown values, by address."""
        return {address_of(each.object): each.why for each in self.settings if each.value is None}


class DriveBackup(ConfigModel):
    """Content of the file that `rid-daq drives backup` writes: all drives of a cell."""

    format: Literal[1]
    cell: str
    created_utc: str
    drives: tuple[SavedDrive, ...]

    @classmethod
    def read(cls, path: Path) -> DriveBackup:
        """Read the file.

        Raises:
            ConfigError: The file cannot be read, or is not a backup.
        """
        return read_json_file(path, cls, _BACKUP_BYTES, "a backup of `rid-daq drives backup`")

    def write(self, path: Path) -> None:
        """Write the file.

        Raises:
            RecordingError: The file cannot be written.
        """
        write_whole(path, self.model_dump_json(indent=1).encode() + b"\n")


def address_of(name: str) -> Address:
    """Return index and sub-index in an object's name, such as ``6085h:00``."""
    index, subindex = name.split("h:")
    return int(index, 16), int(subindex, 16)


def _upper(revision: int | None) -> int | None:
    return None if revision is None else revision >> 16
