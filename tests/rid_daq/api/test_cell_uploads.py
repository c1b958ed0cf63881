"""Files that `Cell.record` uploads: a failure to delete them hides neither recording nor error."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from config.errors import ConfigError, RidDaqError, ServiceError
from rid_daq.api import Cell, Motion, Recording

RUN = "01M8MYCY82DH9GKKMXPKRZWFVD"


class Client:
    """Client of a service that accepts files and does not delete them."""

    def put_file(self, _path: Path, _name: str) -> str:
        return "version"

    def delete_file(self, name: str, _version: str) -> None:
        raise ServiceError(f"{name} is in use", code="RID-FILE-CHANGED")


class Leased:
    """Leased cell that records a run, or fails with an error."""

    def __init__(self, error: RidDaqError | None = None) -> None:
        self.error = error

    def run(self, *_arguments: object, **_options: object) -> Any:
        if self.error is not None:
            raise self.error
        return SimpleNamespace(
            job=SimpleNamespace(run=RUN, reason=""), ended=SimpleNamespace(error=None)
        )


@pytest.fixture
def motion() -> Motion:
    return Motion.through([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], cell="ir361")


def leased_cell(leased: Leased) -> Cell:
    cell = Cell("ir361")
    cell._open = cast(Any, (Client(), leased))
    return cell


def test_a_recording_is_kept_with_a_note_on_each_file_that_remains(
    motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Recording(cast(Any, None), notes=("a finding",))
    monkeypatch.setattr(Cell, "recording", lambda _cell, _run: found)
    recording = leased_cell(Leased()).record(motion)
    first, second = recording.notes
    assert first == "a finding"
    assert second.startswith("motion-")


def test_an_error_of_the_motion_gets_a_note_on_each_file_that_remains(motion: Motion) -> None:
    stopped = ConfigError("the motion is too fast", code="RID-MOTION-LIMIT")
    with pytest.raises(ConfigError) as raised:
        leased_cell(Leased(stopped)).record(motion)
    assert raised.value is stopped
    (note,) = stopped.__notes__
    assert note.startswith("motion-")
