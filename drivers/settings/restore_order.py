"""Order of writes that a drive accepts when its settings are restored."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from drivers.canopen.pdo import INVALID, RPDO_COMMUNICATION, RPDO_MAPPING, ObjectWrite
from drivers.settings.saved_drive import Address

_TO_MAPPING = RPDO_MAPPING - RPDO_COMMUNICATION


def restore_order(
    values: Mapping[Address, bytes], different: Collection[Address]
) -> Iterator[ObjectWrite]:
    """Yield the writes that restore `values` for the objects in `different`.

    A PDO that differs is made invalid first. If its mapping differs, the number of mapped objects
    is set to 0 and the whole mapping is written. The identifier is written last, which makes the
    PDO valid again (CiA 301, 7.5.2.34 and 7.5.2.36).
    """
    records = {record for index, _ in different if (record := pdo_of(index)) is not None}
    for index, subindex in sorted(different):
        if pdo_of(index) is None:
            yield ObjectWrite(index, subindex, values[index, subindex])
    for record in sorted(records):
        yield from _pdo(record, values, different)


def pdo_of(index: int) -> int | None:
    """Return the communication record of the PDO that contains an object; None without a PDO."""
    if not 0x1400 <= index < 0x1C00:
        return None
    return index - _TO_MAPPING if index & _TO_MAPPING else index


def _pdo(
    record: int, values: Mapping[Address, bytes], different: Collection[Address]
) -> Iterator[ObjectWrite]:
    cob_id = values.get((record, 1))
    if cob_id is not None:
        off = int.from_bytes(cob_id, "little") | INVALID
        yield ObjectWrite(record, 1, off.to_bytes(4, "little"))
    mapping = record + _TO_MAPPING
    mapped = sorted(address for address in values if address[0] == mapping)
    if any(address in different for address in mapped):
        yield ObjectWrite(mapping, 0, b"\0")
        for address in mapped:
            if address[1]:
                yield ObjectWrite(*address, values[address])
        if (mapping, 0) in values:
            yield ObjectWrite(mapping, 0, values[mapping, 0])
    for address in sorted(different):
        if address[0] == record and address[1] != 1:
            yield ObjectWrite(*address, values[address])
    if cob_id is not None:
        yield ObjectWrite(record, 1, cob_id)
