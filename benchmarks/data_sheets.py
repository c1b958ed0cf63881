"""Fraction of servo drives whose EDS or DCF file (data sheet) rid-daq accepts.

`python -m benchmarks.data_sheets --eds DIR` compares every EDS and DCF file of a servo drive
(CiA 402) below a folder with the requirements of rid-daq. A drive is accepted with a bundled
profile, or with at most ten lines in the cell file, which are printed. Otherwise it is refused; the
reason, its relevance for safety and the missing objects are printed.

Other files are counted separately, by their content: another device; a device without torque and
current that does not call itself a servo drive (a stepper); a device without any
manufacturer-specific object (a sample, or a simulated drive).

The figure `sheets` counts each file, but identical files once. The figure `drives` counts files
with the same vendor, product and verdict once. If the `canopen` package is installed, its reading
of each file is compared with that of rid-daq. The last line is JSON.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.formats.eds import ElectronicDataSheet, parse_eds
from config.formats.eds_object import EdsObject
from config.load import bundled_names, load_bundled_or_path, load_cell
from drivers.data_sheets.eds_fit import EdsFit, fit_eds, torque_objects

SERVO_DRIVE = 402
WORDS: Final = ((0x6040, 0), (0x6041, 0))
"""Controlword and statusword; a CiA 402 drive has both, for any value of its object 1000h."""
MANUFACTURER_INDICES: Final = range(0x2000, 0x6000)
TORQUES: Final = (0x6077, 0x6078)
TYPE_BIT, SEVERAL = 1 << 17, 0xFF
"""Values in object 1000h: the bit of a servo drive, and the drive type of a module with several
axes."""

Kind = Literal["servo drive", "other device", "stepper or without torque", "sample or simulated"]


@dataclass(frozen=True)
class EdsFile:
    """A data sheet, its lines for the cell file, and its differences from the package `canopen`."""

    path: Path
    eds: ElectronicDataSheet
    fit: EdsFit
    differences: tuple[str, ...]

    def as_json(self) -> dict[str, object]:
        """Return the entry for the last line."""
        return {
            "file": str(self.path),
            "base": self.fit.base,
            "lines": len(self.fit.lines),
            "accepted": self.fit.accepted,
            "lacks": {
                finding.object_name: "safety" if self.fit.protects(finding) else "no safety"
                for finding in self.fit.findings
            },
            "concerns_safety": self.fit.concerns_safety,
            "reason": self.fit.reason,
        }

    @property
    def drive(self) -> tuple[object, ...]:
        """Key of the drive: manufacturer, product and verdict."""
        lacks = tuple(finding.object_name for finding in self.fit.findings)
        maker = self.eds.vendor or self.eds.vendor_name
        return (maker, self.eds.product or self.eds.product_name, self.fit.base, lacks)


def kind_of(eds: ElectronicDataSheet) -> Kind:
    """Return the kind of device that a data sheet describes.

    Bits 16 to 23 of object 1000h are the type of drive (CiA 402-1), but a data sheet need not state
    their default. Without it, a drive with an object for torque or current is a servo drive.
    """
    default = _device_type(eds)
    drive = default is None or default & 0xFFFF in (0, SERVO_DRIVE)
    words = all(eds.get(*address) is not None for address in WORDS)
    if not (words and (drive or eds.get(0x6060, 0) is not None)):
        return "other device"
    if not any(item.index in MANUFACTURER_INDICES for item in eds.objects):
        return "sample or simulated"
    torque = any(item.index in TORQUES for item in eds.objects) or bool(torque_objects(eds))
    several = default is not None and default >> 16 & SEVERAL == SEVERAL
    servo = default is not None and default & TYPE_BIT != 0 and not several
    return "servo drive" if torque or servo else "stepper or without torque"


def _device_type(eds: ElectronicDataSheet) -> int | None:
    kind = eds.get(0x1000, 0)
    content = None if kind is None or kind.default is None else kind.default.content
    return content if isinstance(content, int) else None


def eds_files(folder: Path) -> Iterator[tuple[Path, ElectronicDataSheet | str]]:
    """Yield every data sheet below a folder, or the error of an unreadable one."""
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in (".eds", ".dcf") and path.is_file():
            try:
                yield path, parse_eds(path.read_bytes(), path.name)
            except ConfigError as error:
                yield path, str(error)


def differences(path: Path, eds: ElectronicDataSheet) -> tuple[str, ...]:
    """Return the objects that `canopen` reads with another type or default."""
    import canopen.objectdictionary

    try:
        other = canopen.objectdictionary.import_od(str(path), node_id=1)
    except Exception as error:  # canopen passes on errors of any type
        return (f"canopen cannot read it: {error}",)
    return tuple(
        f"{item.index:04X}h:{item.subindex:02X} {words}"
        for item in eds.objects
        for words in _differs(item, _of(other, item))
    )


def _of(other: Any, item: EdsObject) -> Any:
    """Return an object as the package `canopen` read it, or None."""
    try:
        found = other[item.index]
        return found[item.subindex] if hasattr(found, "subindices") else found
    except KeyError:
        return None


def _differs(item: EdsObject, other: Any) -> Iterator[str]:
    if other is None:
        yield "is not read by canopen"
        return
    if item.data_type is not None and getattr(other, "data_type", None) != item.data_type:
        yield f"has type {item.data_type}, canopen: {getattr(other, 'data_type', None)}"
    content = None if item.default is None else item.default.of_node(1)
    theirs = getattr(other, "default", None)
    if isinstance(content, int) and theirs != content:
        yield f"is {content}, canopen: {theirs}"


def main() -> None:
    """Read the sheets of a folder and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--eds", type=Path, required=True, help="folder with EDS and DCF files")
    parser.add_argument("--json", action="store_true", help="print the last line only")
    options = parser.parse_args()
    cell = load_cell("ir361").config
    profiles = {
        name: load_bundled_or_path(name, "servos", ServoProfile) for name in bundled_names("servos")
    }
    judged = importlib.util.find_spec("canopen") is not None
    found: list[EdsFile] = []
    unread: list[str] = []
    seen: set[str] = set()
    others: dict[str, list[str]] = {kind: [] for kind in get_args(Kind)[1:]}
    copies = 0
    for path, eds in eds_files(options.eds):
        if isinstance(eds, str):
            unread.append(eds)
        elif eds.sha256 in seen:
            copies += 1
        elif (kind := kind_of(eds)) == "servo drive":
            fit = fit_eds(eds, cell, cell.axes[0], profiles)
            differ = differences(path, eds) if judged else ()
            found.append(EdsFile(path.relative_to(options.eds), eds, fit, differ))
        else:
            others[kind].append(str(path.relative_to(options.eds)))
        seen.update(() if isinstance(eds, str) else (eds.sha256,))
    if not options.json:
        for file in found:
            _print(file)
        for name_of, names in others.items():
            for name in names if name_of != "other device" else ():
                print(f"{name_of}: {name}")
        for text in unread:
            print(f"not read: {text}")
    accepted = [file for file in found if file.fit.accepted]
    refused = [file for file in found if not file.fit.accepted]
    safety = [file for file in refused if file.fit.concerns_safety]
    drives = {file.drive for file in found}
    drives_accepted = {file.drive for file in accepted}
    print(
        json.dumps(
            {
                "sheets": len(found),
                "accepted": len(accepted),
                "accepted_share": len(accepted) / max(1, len(found)),
                "drives": len(drives),
                "drives_accepted": len(drives_accepted),
                "drives_accepted_share": len(drives_accepted) / max(1, len(drives)),
                "with_bundled_profile": sum(file.fit.base is not None for file in accepted),
                "most_lines": max((len(file.fit.lines) for file in accepted), default=0),
                "refused_for_safety": len(safety),
                "refused_otherwise": len(refused) - len(safety),
                "refused": [
                    {
                        "file": str(file.path),
                        "reason": file.fit.reason,
                        "concerns_safety": file.fit.concerns_safety,
                    }
                    for file in refused
                ],
                "copies": copies,
                "unreadable": len(unread),
                "no_servo_drives": {kind: len(names) for kind, names in others.items()},
                "canopen_differs": sum(len(file.differences) for file in found),
                "each": [file.as_json() for file in found],
            }
        )
    )


def _print(file: EdsFile) -> None:
    fit = file.fit
    verdict = "accepted" if fit.accepted else "refused"
    profile = fit.base or "CiA 402"
    print(f"{verdict:9} {profile:16} {len(fit.lines):2} lines  {file.path}")
    if not fit.accepted:
        concerns = "safety" if fit.concerns_safety else "no safety"
        print(f"{'':10}refused ({concerns}): {fit.reason}")
    for line in fit.lines:
        print(f"{'':29}{line}")
    for finding in fit.findings:
        safety = " (safety)" if fit.protects(finding) else " (no safety)"
        print(f"{'':10}{finding.object_name} {finding.name}: {finding.found}{safety}")
    for words in file.differences[:3]:
        print(f"{'':10}{words}")


if __name__ == "__main__":
    main()
