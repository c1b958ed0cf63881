"""Helper processes: each ends within its timeout, and an abnormal end is reported."""

from __future__ import annotations

import os
import signal

import pytest

from acquisition.session.helper_process import HelperProcess, start_all
from config.process.termination import leave_terminal


def end_normally() -> None:
    leave_terminal()


def hang_forever() -> None:
    leave_terminal()
    signal.pause()


def kill_self() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize(
    ("main", "patience_s", "notes"),
    [
        (end_normally, 120.0, []),
        (kill_self, 120.0, ["the helper died (exit code -9); nothing is lost"]),
        (hang_forever, 0.1, ["the helper did not finish and was killed; nothing is lost"]),
    ],
)
def test_an_abnormal_end_is_reported(main: object, patience_s: float, notes: list[str]) -> None:
    helper = HelperProcess(
        "helper",
        main,  # type: ignore[arg-type]
        (),
        patience_s=patience_s,
        loss="nothing is lost",
    )
    start_all([helper])
    assert helper.end() == notes


def test_a_process_that_was_never_started_ends_without_a_note() -> None:
    assert HelperProcess("helper", end_normally, (), patience_s=120.0).end() == []
