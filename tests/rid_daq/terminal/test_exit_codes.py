from __future__ import annotations

import signal

import pytest

from acquisition.supervision.stop_reason import StopCode
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (StopCode.FOLLOWING_ERROR, 5),
        (StopCode.TORQUE_LIMIT, 5),
        (StopCode.STUCK_ENCODER, 5),
        (StopCode.EMERGENCY, 5),
        (StopCode.LATE_CYCLE, 5),
        (StopCode.MISSED_FRAMES, 4),
        (StopCode.HEARTBEAT_LOST, 4),
        (StopCode.DRIVE_RESTARTED, 4),
        (StopCode.BUS, 4),
        (StopCode.RECORDER, 7),
        (StopCode.PLATE_LINE, 4),
        (StopCode.PLATE_OVERLOAD, 6),
    ],
)
def test_a_stop_has_the_exit_code_of_its_kind(code: StopCode, expected: int) -> None:
    assert exit_code_of_stop(code, None) == expected


@pytest.mark.parametrize(
    ("number", "expected"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 143)]
)
def test_a_signal_has_the_exit_code_of_its_number(number: signal.Signals, expected: int) -> None:
    assert exit_code_of_stop(StopCode.INTERRUPTED, number) == expected


def test_no_stop_has_exit_code_0() -> None:
    codes = {exit_code_of_stop(code, None) for code in StopCode}
    assert not codes & {ExitCode.DONE, ExitCode.VERDICT_FAILED, ExitCode.USAGE}
