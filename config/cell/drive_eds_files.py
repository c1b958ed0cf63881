"""Reader of the electronic data sheets that a cell file names."""

from __future__ import annotations

from pathlib import Path

from config.cell.cell import CellConfig, DeviceIdentity
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.eds import ElectronicDataSheet, parse_eds
from config.formats.eds_text import MAX_BYTES
from config.formats.yaml_tree import YamlTree

EdsFiles = tuple[ElectronicDataSheet | None, ...]


def read_eds_files(
    tree: YamlTree, cell: CellConfig, folder: Path | None, kept: Path | None
) -> tuple[EdsFiles, dict[str, bytes], tuple[Path, ...]]:
    """Read the data sheets of a cell's axes, each file once.

    Args:
        tree, cell: The cell file.
        folder: Folder of the cell file, the base of relative paths.
        kept: Folder of the cell file if it is a run folder, otherwise None. A run folder contains
            copies of the data sheets, under the names that this function returns.

    Returns:
        One EDS per axis, None for an axis without one; the files' bytes by the names under which a
        run folder stores them; and the paths of the files.

    Raises:
        ConfigError: A file cannot be read, or is not a data sheet; the message has file and line.
    """
    eds_files: list[ElectronicDataSheet | None] = []
    known: dict[str, ElectronicDataSheet] = {}
    files: dict[str, bytes] = {}
    paths = []
    for number, axis in enumerate(cell.axes):
        if axis.eds is None:
            eds_files.append(None)
            continue
        if axis.eds not in known:
            suffix = ".dcf" if axis.eds.lower().endswith(".dcf") else ".eds"
            name = f"drive{len(known) + 1}{suffix}"
            path = Path(axis.eds).expanduser()
            if folder is not None and not path.is_absolute():
                path = folder / path
            if kept is not None and (kept / name).is_file():
                path = kept / name
            files[name] = _read_bytes(
                path, f"{tree.where(('axes', number, 'eds'))}: axes.{number}.eds"
            )
            known[axis.eds] = parse_eds(files[name], str(path))
            paths.append(path)
        eds_files.append(known[axis.eds])
    return tuple(eds_files), files, tuple(paths)


def with_identities(cell: CellConfig, eds_files: EdsFiles) -> CellConfig:
    """Return the cell with drive identities from the EDS, for axes that do not state their own."""
    axes = []
    for axis, eds in zip(cell.axes, eds_files, strict=True):
        if eds is None or axis.identity is not None:
            axes.append(axis)
            continue
        axes.append(axis.model_copy(update={"identity": DeviceIdentity.from_attributes(eds)}))
    return cell.model_copy(update={"axes": tuple(axes)})


def _read_bytes(path: Path, where: str) -> bytes:
    try:
        return read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(
            f"{where}: {path}: cannot read: {error.strerror}; a path is relative to the cell file",
            code="RID-FILE-READ",
        ) from None
