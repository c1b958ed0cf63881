"""The axis test of a cell: signed beside the cell file, and good until a file changes."""

from __future__ import annotations

import getpass
import hashlib
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Final

from config.errors import PreflightError
from config.formats.json_file import read_json_file
from config.formats.whole_file import write_whole
from config.load import LoadedCell
from config.model import ConfigModel
from rid_daq.preflight.bus_check import CheckLine, Verdict

LARGEST_FILE_BYTES: Final = 1 << 20
_WHAT: Final = "an axis test of `rid-daq axes`"


class AxisTestRule(Enum):
    """Whether a motion wants the axis test of a cell that is real."""

    REQUIRED = "required"
    WAIVED = "waived"
    HELD = "not needed: a key is held"

    @classmethod
    def unless(cls, waived: bool) -> AxisTestRule:
        """Return that it is required, unless a person waives it."""
        return cls.WAIVED if waived else cls.REQUIRED


class SignedAxis(ConfigModel):
    """An axis whose direction, encoder and gear were found right: by whom, when, in which run."""

    joint: str
    who: str
    when_utc: str
    run: str


class AxisTest(ConfigModel):
    """The axes that were tested with a cell file and a robot file, by those files' SHA-256."""

    cell_sha256: str
    robot_sha256: str
    axes: tuple[SignedAxis, ...] = ()


def axis_test_file(loaded: LoadedCell) -> Path | None:
    """Return where the axis test of a cell is signed; None for a bundled cell, which needs none."""
    return None if loaded.path is None else loaded.path.with_suffix(".axes.json")


def sign_axis(loaded: LoadedCell, joint: str, run: str) -> Path | None:
    """Note that an axis was found right, beside the cell file; return where.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    path = axis_test_file(loaded)
    if path is None:
        return None
    now = datetime.now(UTC).isoformat(timespec="seconds")
    tested = SignedAxis(joint=joint, who=getpass.getuser(), when_utc=now, run=run)
    others = (each for each in _signed(loaded) if each.joint != joint)
    test = AxisTest(**_hashes(loaded), axes=(*others, tested))
    write_whole(path, f"{test.model_dump_json(indent=2)}\n".encode())
    return path


def axis_test_line(loaded: LoadedCell, rule: AxisTestRule) -> CheckLine:
    """Return the preflight's line on the axis test."""
    missing = not loaded.config.simulated and bool(_untested(loaded))
    verdict: Verdict = "shown" if loaded.config.simulated else "ok"
    if missing:
        verdict = "red" if rule is AxisTestRule.REQUIRED else "allowed"
    return CheckLine(
        where="axes",
        what="axis test (direction, encoder, gear) since cell and robot file changed",
        required="" if loaded.config.simulated else "each axis",
        found=_found(loaded),
        verdict=verdict,
        next_action=_advice(loaded) if verdict == "red" else "",
    )


def require_axis_test(loaded: LoadedCell, rule: AxisTestRule) -> str:
    """Refuse to move a real cell whose axes were not tested since a file has changed.

    Returns
    -------
    str
        What the run's manifest says of it; empty for a simulated cell.

    Raises
    ------
    PreflightError
        The test is required, and an axis lacks it.
    """
    if loaded.config.simulated:
        return ""
    untested = _untested(loaded)
    if not untested:
        return _found(loaded)
    if rule is AxisTestRule.REQUIRED:
        raise PreflightError(
            f"cell {loaded.config.name}: the axis test of {', '.join(untested)} is missing, or"
            f" older than cell or robot file: {_advice(loaded)}"
        )
    return f"{rule.value}; missing: {', '.join(untested)}"


def _advice(loaded: LoadedCell) -> str:
    return f"run `rid-daq axes {loaded.path or loaded.config.name}`"


def _found(loaded: LoadedCell) -> str:
    if loaded.config.simulated:
        return "not needed: simulated"
    if untested := _untested(loaded):
        return f"missing: {', '.join(untested)}"
    latest = max(_signed(loaded), key=lambda each: each.when_utc)
    return f"passed, {latest.when_utc}, {latest.who}"


def _untested(loaded: LoadedCell) -> list[str]:
    tested = {each.joint for each in _signed(loaded)}
    return [name for name in loaded.robot.joint_names if name not in tested]


def _signed(loaded: LoadedCell) -> tuple[SignedAxis, ...]:
    """Return the axes that were tested with these very files."""
    path = axis_test_file(loaded)
    if path is None or not path.exists():
        return ()
    test = read_json_file(path, AxisTest, LARGEST_FILE_BYTES, _WHAT)
    hashes = {"cell_sha256": test.cell_sha256, "robot_sha256": test.robot_sha256}
    return test.axes if hashes == _hashes(loaded) else ()


def _hashes(loaded: LoadedCell) -> dict[str, str]:
    return {
        f"{kind}_sha256": hashlib.sha256(loaded.files[f"{kind}.yaml"]).hexdigest()
        for kind in ("cell", "robot")
    }
