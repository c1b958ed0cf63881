"""Guess of a file's type from its keys or magic bytes, for errors about a wrong type."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from config.formats.yaml_tree import YamlTree

_KEYS: Final = (
    ("a cell file", {"can", "axes", "drive_safety"}),
    ("a robot file", {"kinematics", "joints"}),
    ("a plant file", {"links", "axes"}),
    ("a motion file", {"kind", "robot"}),
    ("an import map file", {"robot", "columns"}),
    ("an import map file", {"robot", "joint_states"}),
    ("a load file", {"bodies", "loads"}),
    ("a load-change file", {"changes"}),
)
_DOCUMENTS: Final = {
    "rid-daq estimate": "a model by `identify`",
    "rid-daq payload": "a payload, as by `payload identify`",
    "rid-daq velocity loops": "velocity loops by `loop`",
    "rid-daq feedforward": "a feedforward by `compensate`",
    "rid-daq result": "the result of a run",
    "rid-daq payload session": "the state of a payload session",
    "rid-daq parameters": "a table of parameters by `export`",
    "rid-daq origins": "the origins of a run's files",
}
_URDF: Final = "a URDF"
_FROM_URDF: Final = "`rid-daq init FOLDER --urdf FILE` (in Python: Robot.from_urdf)"
_BEGINNINGS: Final = (
    ("a recording (MCAP)", rb"\x89MCAP"),
    ("a page (HTML), as reports are", rb"\s*<(!doctype html|html)"),
    (_URDF, rb"\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<robot"),
    ("an XML file", rb"\s*<(\?xml|[a-z][\w:.-]*\s+[\w:.-]+=)"),
    ("a PDF", rb"%PDF"),
    ("an archive (zip), as Excel workbooks are", rb"PK\x03\x04"),
    ("a compressed file (gzip)", rb"\x1f\x8b"),
    ("a database (SQLite), as ROS 2 bags are", rb"SQLite format 3"),
    ("an HDF5 file", rb"\x89HDF"),
    ("a Parquet file", rb"PAR1"),
    ("a MAT file", rb"MATLAB 5\.0 MAT"),
    ("a Feather file (Arrow)", rb"ARROW1|FEA1"),
    ("a pickle of Python", rb"\x80[\x02-\x05]"),
    ("a LabVIEW file (TDMS)", rb"TDSm"),
    ("a single array (NPY; numpy.savez saves arrays with names)", rb"\x93NUMPY"),
)
_WANTED: Final = {
    "CellConfig": "a cell file",
    "RobotDescription": "a robot file",
    "PlantConfig": "a plant file",
    "MotionFile": "a motion file",
    "ImportMap": "an import map file",
    "KnownLoads": "a load file",
    "LoadChanges": "a load-change file",
    "FaultScript": "a fault script file",
    "ServoProfile": "a servo profile file",
    "DriveProfile": "a drive profile file",
    "AmplifierProfile": "an amplifier profile file",
}
_LOOKED_AT: Final = 1 << 16  # bytes


def wrong_kind(tree: YamlTree, wanted: str) -> list[str]:
    """Return a one-line error if a file is of another type than expected; else an empty list.

    Args:
        tree: The file, which failed validation.
        wanted: Name of the model that it was validated against.
    """
    kind = _kind_of(tree.data)
    if kind is None or wanted not in _WANTED or kind == _WANTED[wanted]:
        return []
    made = f", as made by {_FROM_URDF}" if (kind, wanted) == (_URDF, "RobotDescription") else ""
    return [f"{tree.name}: this is {kind}; give {_WANTED[wanted]}{made}"]


def way_from(kind: str) -> str:
    """Return how a URDF becomes a robot file, as the end of an error; empty for other types."""
    return f": make a robot file from it by {_FROM_URDF}" if kind == _URDF else ""


def kind_of_text(data: bytes, *, by_keys: bool = True) -> str | None:
    """Return the probable type of a file that could not be read as expected; None if unknown.

    Args:
        data: The file.
        by_keys: Whether to distinguish YAML files by their keys.
    """
    head = data[:_LOOKED_AT]
    for kind, beginning in _BEGINNINGS:
        if re.match(beginning, head, re.IGNORECASE | re.DOTALL):
            return kind
    found = re.findall(rb'"(kind|schema|format)"\s*:\s*"([ !#-~]{1,80})"', head)
    words: dict[str, str] = {}
    for name, value in found:
        words.setdefault(name.decode(), value.decode())  # later ones belong to parts of the file
    if not by_keys:
        return _kind_of_document(words)
    keys = re.findall(rb"^([A-Za-z_]\w*):", head, re.MULTILINE)
    return _kind_of_document(words) or _kind_of_keys([key.decode() for key in keys])


def _kind_of(data: Any) -> str | None:
    if isinstance(data, str):  # such as XML, which is a text in YAML
        return kind_of_text(data.encode(), by_keys=False)
    if isinstance(data, dict):
        return _kind_of_document(data) or _kind_of_keys(data.keys())
    return None


def _kind_of_document(document: dict[str, Any]) -> str | None:
    """Return the type that a file of this program states; None if it states no known one."""
    found = (document_kind(document.get(key)) for key in ("kind", "schema", "format"))
    return next((kind for kind in found if kind is not None), None)


def document_kind(stated: object) -> str | None:
    """Return the file type that belongs to a stated `kind`, of any version.

    None if it is unknown.
    """
    return _DOCUMENTS.get(re.sub(r" \d+$", "", stated)) if isinstance(stated, str) else None


def _kind_of_keys(keys: Collection[Any]) -> str | None:
    return next((kind for kind, needed in _KEYS if needed <= set(keys)), None)
