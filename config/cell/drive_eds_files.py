"""The electronic data sheets that a cell file names, read with the cell."""

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
        folder: Where it lies: relative paths begin there.
        kept: The same folder where it is a run's, with copies of the files by the names returned
            here.

    Returns:
        One EDS an axis, None where it names none; the files' bytes by the names that a run folder
        keeps them under; and where each of them lies.

    Raises:
        ConfigError: A file cannot be read, or is no data sheet; the message has file and line.
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
            files[name] = _bytes(path, f"{tree.where(('axes', number, 'eds'))}: axes.{number}.eds")
            known[axis.eds] = parse_eds(files[name], str(path))
            paths.append(path)
        eds_files.append(known[axis.eds])
    return tuple(eds_files), files, tuple(paths)


def with_identities(cell: CellConfig, eds_files: EdsFiles) -> CellConfig:
    """Return the cell with each drive's identity by its EDS, where it says nothing of it."""
    axes = []
    for axis, eds in zip(cell.axes, eds_files, strict=True):
        if eds is None or axis.identity is not None:
            axes.append(axis)
            continue
        axes.append(axis.model_copy(update={"identity": DeviceIdentity.taken(eds)}))
    return cell.model_copy(update={"axes": tuple(axes)})


def _bytes(path: Path, where: str) -> bytes:
    """Return an EDS's bytes."""
    try:
        return read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(
            f"{where}: {path}: cannot read: {error.strerror}; a path is relative to the cell file",
            code="RID-FILE-READ",
        ) from None
