from __future__ import annotations

import time
import uuid

import pytest

from config.process.safety_clock import boot_id, safety_now_s


def test_the_safety_clock_is_monotonic_and_includes_suspension() -> None:
    first = safety_now_s()
    assert safety_now_s() >= first
    # the monotonic clock's time plus the time of suspension
    assert first >= time.monotonic() - 1.0


def test_the_safety_clock_is_the_kernels_boot_time_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clocks = {time.CLOCK_BOOTTIME: 5.0, time.CLOCK_MONOTONIC: 3.0, time.CLOCK_REALTIME: 1.0}
    monkeypatch.setattr(time, "clock_gettime", clocks.__getitem__)
    assert safety_now_s() == 5.0


def test_a_boot_of_the_computer_has_one_identifier() -> None:
    assert boot_id() == boot_id()
    assert uuid.UUID(boot_id())
