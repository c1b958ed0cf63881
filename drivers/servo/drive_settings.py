"""Reading and restoring of a drive's settings, over its `SdoPort`, without power."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from config.errors import PreflightError
from config.formats.eds import ElectronicDataSheet
from drivers.canopen.sdo import SdoAbort, abort_text, object_name
from drivers.servo.cia402 import state_of
from drivers.servo.sdo_port import SdoPort, is_missing
from drivers.settings.object_list import (
    COMMUNICATION_SETTINGS,
    PROFILE_SETTINGS,
    STORE,
    STORE_WORD,
    is_record,
    is_setting,
    settings_of,
)
from drivers.settings.restore_order import restore_order
from drivers.settings.saved_drive import Address, SavedDrive

_MOST_SUBINDICES = 64


@dataclass(frozen=True, slots=True)
class RestoredSetting:
    """An object of a drive that differed from its saved value.

    Attributes:
        node_id, address: The drive, and the object.
        saved: The saved value; None if the backup has no value for this object.
        before, after: The drive's value before and after restoring; a text is the reason why it is
            unknown.
        refusal: Reason why the drive refused the saved value; empty if the drive did not refuse it,
            or nothing was written.
    """

    node_id: int
    address: Address
    saved: bytes | None
    before: bytes | str
    after: bytes | str
    refusal: str = ""

    @property
    def name(self) -> str:
        """The object's name."""
        return object_name(*self.address)

    @property
    def restored(self) -> bool:
        """True if the drive now has the saved value."""
        return self.saved is not None and self.after == self.saved


def read_objects(port: SdoPort, indices: Iterable[int]) -> Iterator[tuple[Address, bytes | str]]:
    """Yield the address and the value of every sub-index of some objects.

    For a value that cannot be read, a text with the reason is yielded instead.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    for index in indices:
        value = _read(port, (index, 0))
        if value is None:
            continue
        yield (index, 0), value
        if is_record(index) and isinstance(value, bytes):
            for subindex in range(1, min(int.from_bytes(value, "little"), _MOST_SUBINDICES) + 1):
                value = _read(port, (index, subindex))
                if value is not None:
                    yield (index, subindex), value


def read_drive(port: SdoPort, eds: ElectronicDataSheet | None) -> SavedDrive:
    """Return all settings of a drive: those in its data sheet or, without one, in `object_list`.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    found: Iterable[tuple[Address, bytes | str | None]]
    if eds is None:
        found = read_objects(port, (*COMMUNICATION_SETTINGS, *PROFILE_SETTINGS))
    else:
        found = ((address, _read(port, address)) for address in settings_of(eds))
    values: dict[Address, bytes] = {}
    unknown: dict[Address, str] = {}
    for address, value in found:
        if isinstance(value, bytes):
            values[address] = value
        elif value is not None:
            unknown[address] = value
    return SavedDrive.of(port.node_id, port.identity(), values, unknown)


def refuse_other_drive(port: SdoPort, saved: SavedDrive) -> None:
    """Refuse to write to another drive, or to one that can move its motor.

    Raises:
        PreflightError: The identity of the drive (1018h) differs from the saved one, or the drive
            is powered.
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    differences = saved.identity.differences(port.identity())
    if differences:
        raise PreflightError(
            f"node {port.node_id}: the settings were saved from another drive:"
            f" {', '.join(differences)}; nothing was written. Connect that drive, or set"
            " up the connected drive anew",
            code="RID-DRIVE-OTHER",
        )
    state = state_of(port.read_int(0x6041, 0))
    if state.powered:
        raise PreflightError(
            f"node {port.node_id}: the drive is powered ({state.words}); nothing was written."
            " End the session that controls it, disable the drive, then try again",
            code="RID-DRIVE-POWERED",
        )


def restore_drive(
    port: SdoPort, saved: SavedDrive, *, dry_run: bool
) -> tuple[RestoredSetting, ...]:
    """Write the values that differ from the saved ones, and read them back.

    Args:
        port: The drive; call `refuse_other_drive` first, to ensure that it is the saved one.
        saved: The values to restore.
        dry_run: True to report the differences without writing.

    Returns:
        The objects whose values differed or are unknown. A PDO's mapping entries beyond its number
        of mapped objects have no effect; they are written too, but left out here if the drive does
        not take them. Objects that the backup has no value for are left out if the drive does not
        have them.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    values = {a: value for a, value in saved.values.items() if is_setting(a[0])}
    before = {address: _read_or_missing(port, address) for address in values}
    different = {address for address, value in values.items() if before[address] != value}
    refusals: dict[Address, str] = {}
    if not dry_run:
        for write in restore_order(values, different):
            try:
                port.write(write.index, write.subindex, write.data)
            except SdoAbort as abort:
                refusals[write.index, write.subindex] = abort_text(abort.code)
    after = (
        before if dry_run else {address: _read_or_missing(port, address) for address in different}
    )
    results = [
        RestoredSetting(
            saved.node_id,
            address,
            values[address],
            before[address],
            after[address],
            refusals.get(address, "") if after[address] != values[address] else "",
        )
        for address in different
        if dry_run or after[address] == values[address] or not _is_unused(address, values)
    ]
    results += [
        RestoredSetting(saved.node_id, address, None, why, why)
        for address, why in saved.unknown.items()
        if _read(port, address) is not None
    ]
    return tuple(sorted(results, key=lambda result: result.address))


def store_settings(port: SdoPort) -> None:
    """Make a drive store its settings permanently: 1010h, all parameters (CiA 301, 7.5.2.13).

    Raises:
        PreflightError: The drive refuses to store them.
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    try:
        port.write(*STORE, STORE_WORD)
    except SdoAbort as abort:
        raise PreflightError(
            f"node {port.node_id}: the drive does not store its settings: {abort_text(abort.code)};"
            " store them with the drive's own tool, or they are lost at power off",
            code="RID-DRIVE-SETTINGS",
        ) from abort


def _read(port: SdoPort, address: Address) -> bytes | str | None:
    """Return an object's bytes, or the reason for a failure; None if the drive lacks the object."""
    try:
        return port.read(*address)
    except SdoAbort as abort:
        return None if is_missing(abort) else abort_text(abort.code)


def _read_or_missing(port: SdoPort, address: Address) -> bytes | str:
    value = _read(port, address)
    return "not in this drive" if value is None else value


def _is_unused(address: Address, values: dict[Address, bytes]) -> bool:
    """Return True for a mapping entry beyond the number of the PDO's mapped objects."""
    index, subindex = address
    if not (0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00):
        return False
    return subindex > int.from_bytes(values.get((index, 0), b"\xff"), "little")
