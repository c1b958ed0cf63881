"""Signed record of a cell's axis test, valid until the cell file or robot file changes.

The record is in the state folder of this user account. Clients of a service have no access to this
folder; they can change the record only by an axis test. The entry of each axis has a signature,
made with a secret of this account on this computer. The signature covers the cell, the hashes of
its files, the person and the time. A record that was copied, edited or made by another account is
therefore invalid.
"""

from __future__ import annotations

import getpass
import hashlib
import hmac
import json
import socket
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Final

from config.errors import PreflightError, RecordingError, system_errors
from config.formats.json_file import read_json_file
from config.formats.whole_file import write_whole
from config.load import LoadedCell
from config.model import ConfigModel
from config.process.own_state import own_secret, own_state_folder
from rid_daq.preflight.check_line import CheckLine, Verdict

LARGEST_FILE_BYTES: Final = 1 << 20
AXIS_TEST: Final = "axis test (direction, encoder, gear) since cell and robot file changed"
"""Name of the preflight's line on the axis test."""

UNTESTED: Final = "RID-AXIS-TEST-MISSING"

_WHAT: Final = "an axis test of `rid-daq axes`"
_SECRET: Final = "axis-test.key"


class AxisTestRule(Enum):
    """Rule on the axis test before a motion of a real cell: required, waived, or not needed."""

    REQUIRED = "required"
    WAIVED = "waived"
    HELD = "not needed: the robot moves only while a key or button is held"


class SignedAxis(ConfigModel):
    """Axis that has passed its test: person, time, run and signature."""

    joint: str
    who: str
    when_utc: str
    run: str
    signature: str = ""


class AxisTest(ConfigModel):
    """Axes of a cell that have passed the axis test, and the SHA-256 of the files used in it."""

    cell: str
    cell_sha256: str
    robot_sha256: str
    axes: tuple[SignedAxis, ...] = ()

    def signature_of(self, axis: SignedAxis) -> str:
        """Return the signature that this account on this computer gives to an axis of this test."""
        bound = {"cell": self.cell, "cell_sha256": self.cell_sha256}
        bound |= {"robot_sha256": self.robot_sha256, "computer": _computer_id()}
        text = json.dumps(axis.model_dump(exclude={"signature"}) | bound, sort_keys=True)
        return hmac.new(own_secret(_SECRET), text.encode(), "sha256").hexdigest()

    def is_signed(self, axis: SignedAxis) -> bool:
        """Return True if this account has signed this axis on this computer."""
        return hmac.compare_digest(axis.signature.encode(), self.signature_of(axis).encode())


def axis_test_file(loaded: LoadedCell) -> Path | None:
    """Return the file with the axis test of a cell; None for a bundled cell, which needs no test.

    Raises:
        RecordingError: The state folder of this account cannot be used.
    """
    if loaded.path is None:
        return None
    blank = _test_without_axes(loaded)
    both = hashlib.sha256(f"{blank.cell_sha256} {blank.robot_sha256}".encode()).hexdigest()
    return own_state_folder() / "axis-tests" / f"{both}.json"


def sign_axis(loaded: LoadedCell, joint: str, run: str, who: str = "") -> Path | None:
    """Record that an axis has passed; return the file, or None for a bundled cell.

    Args:
        loaded: The cell as it was tested.
        joint: Joint of the axis.
        run: Id of the test's run.
        who: Person who performed the test; the user of this process if empty.

    Raises:
        ConfigError, RecordingError: The record cannot be read or written.
    """
    path = axis_test_file(loaded)
    if path is None:
        return None
    now = datetime.now(UTC).isoformat(timespec="seconds")
    test = _test_without_axes(loaded)
    axis = SignedAxis(joint=joint, who=who or getpass.getuser(), when_utc=now, run=run)
    axis = axis.model_copy(update={"signature": test.signature_of(axis)})
    others = (each for each in _valid_axes(loaded) if each.joint != joint)
    test = test.model_copy(update={"axes": (*others, axis)})
    with system_errors(
        RecordingError, f"{path.parent}: cannot make this folder", code="RID-FILE-WRITE"
    ):
        path.parent.mkdir(exist_ok=True, mode=0o700)
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
        what=AXIS_TEST,
        required="" if loaded.config.simulated else "each axis",
        found=_test_result(loaded),
        verdict=verdict,
        next_action=_remedy(loaded) if verdict == "red" else "",
        code=UNTESTED if verdict == "red" else "",
    )


def require_axis_test(loaded: LoadedCell, rule: AxisTestRule) -> str:
    """Refuse to move a real cell if an axis has not passed since a file changed.

    Returns:
        Sentence for the run's manifest; empty for a simulated cell.

    Raises:
        PreflightError: The test is required, and an axis has not passed.
        ConfigError, RecordingError: The record cannot be read.
    """
    if loaded.config.simulated:
        return ""
    untested = _untested(loaded)
    if not untested:
        return _test_result(loaded)
    if rule is AxisTestRule.REQUIRED:
        raise PreflightError(
            f"cell {loaded.config.name}: the axis test of {', '.join(untested)} is missing, or is"
            f" older than the cell file or robot file: {_remedy(loaded)}",
            code=UNTESTED,
        )
    return f"{rule.value}; missing: {', '.join(untested)}"


def _remedy(loaded: LoadedCell) -> str:
    return f"run `rid-daq axes {loaded.path or loaded.config.name}`"


def _test_result(loaded: LoadedCell) -> str:
    if loaded.config.simulated:
        return "not needed: simulated"
    if untested := _untested(loaded):
        return f"missing: {', '.join(untested)}"
    latest = max(_valid_axes(loaded), key=lambda each: each.when_utc)
    return f"passed, {latest.when_utc}, {latest.who}"


def _untested(loaded: LoadedCell) -> list[str]:
    tested = {each.joint for each in _valid_axes(loaded)}
    return [name for name in loaded.robot.joint_names if name not in tested]


def _valid_axes(loaded: LoadedCell) -> tuple[SignedAxis, ...]:
    """Return the axes that this account has tested on this computer with these files."""
    path = axis_test_file(loaded)
    if path is None or not path.exists():
        return ()
    test = read_json_file(path, AxisTest, LARGEST_FILE_BYTES, _WHAT)
    if test.model_copy(update={"axes": ()}) != _test_without_axes(loaded):
        return ()
    return tuple(each for each in test.axes if test.is_signed(each))


def _test_without_axes(loaded: LoadedCell) -> AxisTest:
    """Return an empty axis test with the hashes of a cell's present files."""
    cell, robot = (
        hashlib.sha256(loaded.files[f"{kind}.yaml"]).hexdigest() for kind in ("cell", "robot")
    )
    return AxisTest(cell=loaded.config.name, cell_sha256=cell, robot_sha256=robot)


def _computer_id() -> str:
    """Return an id of this computer, because several computers can share the account's folder."""
    try:
        return Path("/etc/machine-id").read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return socket.gethostname()
