"""Stopping the cyclic exchange, on scripted drives."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest

from config.errors import DriverError, SafetyStop, TransportError
from drivers.canopen.nmt import NmtState
from drivers.servo.cia402 import PowerState
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


class TestStopping:
    def test_a_lost_axis_ends_the_motion_of_all(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.cycle((0.5, 0.5, 0.5))
        bench.drives[1].state = PowerState.SWITCH_ON_DISABLED
        bench.bus.sent.clear()
        assert not bench.cycle((0.5, 0.5, 0.5))
        for node in (1, 2, 3):
            assert bench.commands(node) == [(0x0002, 0)]
        bench.drives[1].state = PowerState.OPERATION_ENABLED
        assert not bench.cycle((0.5, 0.5, 0.5)), "power that returns moves nothing"
        with raises_code(DriverError, "RID-INTERNAL-ERROR"):
            axes.enable()

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e6])
    def test_a_set_point_out_of_range_is_never_sent(self, bench: Bench, value: float) -> None:
        bench.enabled()
        bench.bus.sent.clear()
        with raises_code(SafetyStop, "RID-INTERNAL-ERROR"):
            bench.cycle((0.1, 0.1, value))
        for node in (1, 2, 3):
            assert bench.commands(node) == [(0x0002, 0)]

    def test_a_quick_stop_is_one_raw_frame_per_axis(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.bus.sent.clear()
        axes.quick_stop()
        assert [frame.cob_id for _, frame in bench.bus.sent] == [0x201, 0x202, 0x203]
        assert not axes.command(np.full(3, 0.5)), "although no drive has confirmed the stop"
        assert not bench.cycle((0.5, 0.5, 0.5))

    def test_a_quick_stop_is_sent_to_every_axis_even_on_a_failing_bus(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        axes = bench.enabled()
        send, tried = bench.bus.send, []

        def failing(message: Any, timeout: float | None = None) -> None:
            tried.append(message.arbitration_id)
            if message.arbitration_id == 0x201:
                raise can.CanOperationError("no buffer space")
            send(message)

        monkeypatch.setattr(bench.bus, "send", failing)
        with raises_code(TransportError, "RID-CAN-LOST"):
            axes.quick_stop()
        assert tried == [0x201, 0x202, 0x203]

    def test_halt_waits_until_the_drives_have_stopped(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.cycle((0.5, 0.5, 0.5))
        assert axes.halt()
        assert all(drive.state is PowerState.SWITCH_ON_DISABLED for drive in bench.drives)
        assert all(drive.velocity == 0 for drive in bench.drives)

    def test_halt_accepts_drives_that_stay_in_quick_stop(self, bench: Bench) -> None:
        axes = bench.enabled()
        for drive in bench.drives:
            drive.quick_stop_syncs = 10**6
        bench.cycle((0.5, 0.5, 0.5))
        assert axes.halt(), "they are at rest with power: 605Ah = 5 or 6"

    def test_halt_ends_its_wait_for_a_silent_drive(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.drives[0].answers_sync = False
        began_s = bench.bus.now_s
        assert not axes.halt()
        assert bench.bus.now_s - began_s < 2.0 / 10.0 + 0.5 + 0.02

    def test_halt_and_disable_send_no_sdo(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.bus.sent.clear()
        axes.halt()
        axes.disable()
        assert not any(0x600 <= frame.cob_id < 0x680 for _, frame in bench.bus.sent)

    def test_disable_removes_power_and_then_ends_the_exchange(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.bus.sent.clear()
        assert axes.disable() == ()
        assert all(drive.state is PowerState.SWITCH_ON_DISABLED for drive in bench.drives)
        assert {word for word, _ in bench.commands(1)} == {0x0000}
        assert bench.bus.sent_to(0x000) == [
            b"\x80\x01", b"\x80\x02", b"\x80\x03", b"\x82\x01", b"\x82\x02", b"\x82\x03",
        ]  # fmt: skip
        assert bench.drives[0].nmt is NmtState.PRE_OPERATIONAL

    def test_a_drive_that_does_not_confirm_keeps_its_heartbeat_monitoring(
        self, bench: Bench
    ) -> None:
        axes = bench.enabled()
        bench.drives[1].answers_sync = False
        bench.bus.sent.clear()
        assert axes.disable() == ("shoulder",)
        assert bench.bus.sent_to(0x000) == [b"\x80\x01", b"\x80\x02", b"\x80\x03"]

    def test_after_disabling_the_drives_can_be_enabled_again(self, bench: Bench) -> None:
        bench.enabled().disable()
        assert bench.axes.disable() == ()
        bench.enabled()
        assert bench.cycle((0.1, 0.0, 0.0))
