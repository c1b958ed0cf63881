"""Driver of the amplifier with a scripted device: its stream of rows."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from config.cell.amplifier_profile import AmplifierProfile
from config.errors import ProtocolError, TransportError
from config.load import load_bundled_or_path
from drivers.amplifier.amplifier import SerialAmplifier, open_amplifier
from drivers.amplifier.frames import encode_row, row_layout
from drivers.amplifier.simulated_arrivals import ArrivalWriter, arrivals_path
from drivers.interfaces.force_plate import PlateRead
from tests.builders.raised_codes import raises_code

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
ENOUGH_S = 120.0
Plug = Callable[..., Any]


def rows(form: str, numbers: range) -> bytes:
    layout = row_layout(PROFILE, form)
    return b"".join(encode_row(layout, i, 2000 * i, 0x100, [i] * 8) for i in numbers)


def read_rows(amplifier: SerialAmplifier, count: int) -> list[PlateRead]:
    reads: list[PlateRead] = []
    until_s = time.monotonic() + ENOUGH_S
    while sum(len(read.rows) for read in reads) < count:
        assert time.monotonic() < until_s
        reads.append(amplifier.read(until_s))
    return reads


def test_a_session_sends_the_transcripts_commands(plug: Plug) -> None:
    device = plug(rows=rows("binary", range(3)))
    script = device.script
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.reset()
        amplifier.operate()
        assert amplifier.take_overloads() == (False,) * 8
        amplifier.start()
        read_rows(amplifier, 3)
        amplifier.stop(time.monotonic() + ENOUGH_S)
    assert script.received_lines == [
        b"ST0", b"ID?", b"RO0", b"RO?", b"RO1", b"RO?", b"OV?", b"ST1", b"ST0",
    ]  # fmt: skip


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_a_stream_left_running_is_stopped_first(plug: Plug, form: str) -> None:
    device = plug(form=form, rows=rows(form, range(20)))
    script = device.script
    config = device.config
    with open_amplifier(config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        amplifier.stop = lambda until_s: ()  # type: ignore[method-assign] # as if the program were killed
    assert script.streaming
    with open_amplifier(config, PROFILE) as amplifier:
        assert amplifier.connect().startswith("Example")
    assert not script.streaming


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_rows_have_their_arrival_time(plug: Plug, form: str) -> None:
    device = plug(form=form, rows=rows(form, range(40)))
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        before_s = time.monotonic()
        amplifier.start()
        reads = read_rows(amplifier, 40)
        after_s = time.monotonic()
        with raises_code(ProtocolError, "RID-INTERNAL-ERROR"):
            amplifier.forces_n()
        reads += amplifier.stop(time.monotonic() + ENOUGH_S)
        assert amplifier.forces_n().shape == (8,)
    arrivals = np.concatenate([read.arrival_s for read in reads])
    counts = np.concatenate([read.rows for read in reads])["counts"]
    assert counts[:, 0].tolist() == list(range(40))
    assert np.all((arrivals >= before_s) & (arrivals <= after_s))
    assert amplifier.stream_counts.rows == 40


def test_each_row_has_the_arrival_time_of_its_last_byte(plug: Plug) -> None:
    device = plug(rows=rows("binary", range(2)))
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        until_s = time.monotonic() + ENOUGH_S
        while amplifier._piece_ends[-1:] != [2 * 28]:
            assert amplifier.gather(until_s)
        between_s = time.monotonic()
        more = rows("binary", range(2, 5))
        device.say(more[:30])
        while amplifier._piece_ends[-1] != 2 * 28 + 30:
            assert amplifier.gather(until_s)
        later_s = time.monotonic()
        device.say(more[30:])
        while amplifier._piece_ends[-1] != 5 * 28:
            assert amplifier.gather(until_s)
        arrivals = amplifier.read(time.monotonic()).arrival_s
    assert np.all(arrivals[:2] <= between_s)
    assert between_s <= arrivals[2] <= later_s
    assert np.all(arrivals[3:] >= later_s)


def test_in_simulated_time_arrivals_are_looked_up(plug: Plug, tmp_path: object) -> None:
    device = plug(rows=rows("binary", range(5)))
    address = f"{tmp_path}/port"
    os.symlink(device.address, address)
    ArrivalWriter(arrivals_path(address)).write(range(5), [0.5 * i for i in range(5)])
    config = device.config.model_copy(update={"address": address})
    with open_amplifier(config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        reads = read_rows(amplifier, 5)
    arrivals = np.concatenate([read.arrival_s for read in reads])
    assert arrivals.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]


def test_an_unplugged_adapter_is_an_error_of_the_line_at_once(plug: Plug) -> None:
    device = plug(rows=rows("binary", range(3)))
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        read_rows(amplifier, 3)
        device.unplug()
        with raises_code(TransportError, "RID-SERIAL-LOST"):
            amplifier.read(time.monotonic() + ENOUGH_S)
        with pytest.raises(TransportError):
            amplifier.mark()


def test_after_a_replug_rows_are_read_again(plug: Plug) -> None:
    first = plug()
    with open_amplifier(first.config, PROFILE) as amplifier:
        amplifier.connect()
        first.unplug()
    second = plug(rows=rows("binary", range(4)))
    with open_amplifier(second.config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        assert sum(len(read.rows) for read in read_rows(amplifier, 4)) == 4
