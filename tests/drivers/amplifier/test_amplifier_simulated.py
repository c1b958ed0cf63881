"""The amplifier's driver with the simulated amplifier.

Driver and simulation share only the profile.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from config.errors import ProtocolError
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.amplifier import open_amplifier
from tests.builders.raised_codes import raises_code

Serve = Callable[..., Any]


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 20.0)
    monkeypatch.setattr("drivers.amplifier.dialogue.PROBE_TIMEOUT_S", 20.0)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", ())


def test_every_setting_is_written_and_read_back(serve_amplifier: Serve) -> None:
    served = serve_amplifier(format="ascii", low_pass_hz=150.0, trigger=True, rate_hz=300.0)
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        assert amplifier.connect().startswith("rid-daq,simulated")
        assert not amplifier.configure()
        assert {setting.verdict for setting in amplifier.settings()} == {"ok"}


def test_a_wrong_baud_rate_is_found_and_named_by_the_simulated_device(
    serve_amplifier: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 0.02)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", (230400, 460800))
    served = serve_amplifier(speed=230400)
    with (
        open_amplifier(served.plate.amplifier, served.profile) as amplifier,
        raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "230400", "460800"),
    ):
        amplifier.connect()


def test_operate_shifts_the_zero_and_reset_removes_the_shift(serve_amplifier: Serve) -> None:
    truth = SimulatedPlate(sensitivity_pc_n=(-7.5,) * 4 + (-3.8,) * 4, zero_jump_pc=(75.0,) * 8)
    served = serve_amplifier(truth=truth)
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.configure()
        amplifier.reset()
        assert not amplifier.is_operating()
        assert np.abs(amplifier.forces_n()).max() < 0.5
        amplifier.operate()
        assert amplifier.is_operating()
        amplifier.start()
        served.stream_s = 0.2
        row_count = 0
        until_s = time.monotonic() + 120.0
        while row_count < 200:
            row_count += len(amplifier.read(until_s).rows)
        amplifier.stop(until_s)
        assert np.abs(amplifier.forces_n() + 10.0 * np.array([1.0] * 4 + [75 / 38] * 4)).max() < 1.0


def test_a_range_changed_during_operation_clears_the_charge(serve_amplifier: Serve) -> None:
    served = serve_amplifier()
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.configure()
        amplifier.reset()
        amplifier.operate()
        assert not amplifier.configure()
    other = served.plate.amplifier.model_copy(
        update={"range_n": (2500.0, *served.plate.amplifier.range_n[1:])}
    )
    with open_amplifier(other, served.profile) as amplifier:
        amplifier.connect()
        assert amplifier.configure()


def test_a_converter_unknown_to_the_cell_file_is_refused(serve_amplifier: Serve) -> None:
    served = serve_amplifier(bits=14)
    other = served.plate.amplifier.model_copy(update={"bits": 16})
    with open_amplifier(other, served.profile) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "14"):
            amplifier.configure()


def test_a_mark_is_answered_within_the_stream(serve_amplifier: Serve) -> None:
    served = serve_amplifier()
    served.stream_s = 0.1
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.configure()
        amplifier.operate()
        amplifier.start()
        amplifier.mark()
        reads = [*amplifier.stop(time.monotonic() + 120.0)]
    events = np.concatenate([read.events for read in reads])
    kinds = served.profile.events
    assert events["kind"].tolist() == [kinds.mark, kinds.stopped]
    assert amplifier.stream_counts.bad_frames == 0
