"""Which kind of file one is, by its keys: what is said where another kind was wanted."""

from __future__ import annotations

from config.formats.yaml_tree import YamlTree

_KEYS = {
    "a cell": {"can", "axes", "drive_safety"},
    "a robot": {"kinematics", "joints"},
    "a plant": {"links", "axes"},
    "a motion": {"kind", "robot"},
}
_WANTED = {
    "CellConfig": "a cell",
    "RobotDescription": "a robot",
    "PlantConfig": "a plant",
    "MotionFile": "a motion",
    "ImportMap": "an import map",
    "FaultScript": "a fault script",
    "ServoProfile": "a servo profile",
    "DriveProfile": "a drive profile",
    "AmplifierProfile": "an amplifier profile",
}


def wrong_kind(tree: YamlTree, wanted: str) -> list[str]:
    """Return the one line that says that a file is of another kind than wanted; else none.

    Parameters
    ----------
    tree
        The file, which is not what was wanted.
    wanted
        The name of the model that it was read as.
    """
    keys = tree.data.keys() if isinstance(tree.data, dict) else set()
    kind = next((kind for kind, needed in _KEYS.items() if needed <= keys), None)
    if kind is None or wanted not in _WANTED or kind == _WANTED[wanted]:
        return []
    return [f"{tree.name}: this is {kind} file; {_WANTED[wanted]} file is wanted here"]
