"""`EdsFileFit`: the cell file keys with which the drive of a data sheet can be used."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.eds import ElectronicDataSheet, parse_eds
from config.formats.eds_text import MAX_BYTES
from config.load import bundled_names, load_bundled_or_path, load_cell
from drivers.data_sheets.eds_fit import EdsFit, fit_eds


@dataclass(frozen=True)
class EdsFileFit:
    """A data sheet and the drive profile that fits it.

    Attributes:
        eds: The data sheet.
        fit: The profile, its keys, and the objects that the drive lacks.
    """

    eds: ElectronicDataSheet
    fit: EdsFit

    @property
    def identity(self) -> dict[str, int]:
        """Vendor and product number that the data sheet states.

        The drive has them in object 1018h.
        """
        known = {"vendor": self.eds.vendor, "product": self.eds.product}
        return {name: value for name, value in known.items() if value is not None}


def fit_eds_file(path: Path, cell: str) -> EdsFileFit:
    """Return the profile that fits a data sheet.

    Args:
        path: An EDS or DCF file.
        cell: A bundled name or a cell file. Its first axis defines which objects a drive must have.

    Raises:
        ConfigError: A file cannot be read.
    """
    try:
        content = read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read: {error.strerror}", code="RID-FILE-READ"
        ) from None
    eds = parse_eds(content, path.name)
    names = bundled_names("servos")
    profiles = {name: load_bundled_or_path(name, "servos", ServoProfile) for name in names}
    config = load_cell(cell).config
    return EdsFileFit(eds, fit_eds(eds, config, config.axes[0], profiles))
