"""Output of the simulated amplifier, byte by byte; the driver's parser checks its rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.cell.amplifier_profile import AmplifierProfile
from config.load import load_bundled_or_path
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.stream import AmplifierStream, StreamPiece
from mock_hw.amplifier.amplifier import IDENTITY, SimulatedAmplifier
from mock_hw.amplifier.line_faults import Unit
from mock_hw.amplifier.rows import RowBlock

Array = np.ndarray[Any, np.dtype[Any]]
PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
PC_N = (-7.5,) * 4 + (-3.8,) * 4
NOTHING = np.zeros(8)


class Bench:
    """A simulated amplifier, the charges at its inputs, and the bytes that it sent."""

    def __init__(self, **truth: Any) -> None:
        self.device = SimulatedAmplifier(PROFILE, SimulatedPlate(sensitivity_pc_n=PC_N, **truth), 1)
        self.charges = NOTHING

    def say(self, data: bytes) -> bytes:
        self.device.receive(data, lambda: self.charges)
        return self.sent()

    def sent(self) -> bytes:
        pieces = self.device.take()
        ready = np.concatenate([np.atleast_1d(piece.ready_s) for piece in pieces] or [NOTHING])
        assert (np.diff(ready) >= 0.0).all()
        return b"".join(piece.data for piece in pieces)

    def run(
        self, duration_s: float, forces: object = 0.0, edges_s: tuple[float, ...] = ()
    ) -> bytes:
        self.charges = np.broadcast_to(np.asarray(forces), (8,)) * PC_N
        now_s = self.device.physics.time_s
        end_s = now_s + duration_s
        self.device.apply_loads(end_s, [now_s + 1e-9], [self.charges], edges_s)
        return self.sent()

    def configured(self, form: str) -> None:
        for command in (b"RG1250", b"SE-7.5", b"LP200", b"SR1000", b"SF%d" % (form == "binary")):
            assert self.say(command + b"\r").startswith(b"OK")
        for channel in b"5678":
            assert self.say(b"%c:SE-3.8\r%c:RG5000\r" % (channel, channel)) == b"OK\rOK\r"


def parse_stream(data: bytes, form: str = "binary") -> tuple[StreamPiece, AmplifierStream]:
    stream = AmplifierStream(PROFILE, form, 1000.0)
    return stream.feed(data), stream


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"ID?\r", IDENTITY.encode() + b"\r"),
        (b"RO?\r", b"0\r"),
        (b"RO1\r", b"OK\r"),
        (b"RO1\rRO?\r", b"OK\r1\r"),
        (b"RO1\rRO0\rRO?\r", b"OK\rOK\r0\r"),
        (b"RO2\r", b"E02\r"),
        (b"3:RG2500\r3:RG?\r2:RG?\r", b"OK\r2500\r5000\r"),
        (b"RG1250\rRG?\r", b"OK\r" + b",".join([b"1250"] * 8) + b"\r"),
        (b"3:SE-7.92\r3:SE?\r", b"OK\r-7.92\r"),
        (b"3:SE0\r", b"E03\r"),
        (b"3:SEx\r3:SEnan\r", b"E02\rE02\r"),
        (b"LP300\rLP?\r", b"OK\r300\r"),
        (b"3:LP300\r", b"E04\r"),
        (b"9:RG100\r", b"E04\r"),
        (b"LP1e9\r", b"E03\r"),
        (b"SR0\r", b"E03\r"),
        (b"SR1500\rSR?\r", b"OK\r1500\r"),
        (b"SF1\rSF?\rSF2\r", b"OK\r1\rE02\r"),
        (b"TR1\rTR?\rTRx\r", b"OK\r1\rE02\r"),
        (b"ST?\rSTx\r", b"0\rE02\r"),
        (b"AD?\rAD12\r", b"16\rE06\r"),
        (b"OV?\rID7\r", b"00\rE06\r"),
        (b"VA?\r", b",".join([b"0.000"] * 8) + b"\r"),
        (b"TM?\r", b"00000000\r"),
        (b"ro1\r", b"E01\r"),
        (b"XX1\r", b"E01\r"),
        (b"RO\r", b"E01\r"),
        (b"ID?\n\r\n\nRO?\r\n", IDENTITY.encode() + b"\r0\r"),
        (b"\0\0RO\0?\r", b"0\r"),
        (b"\xff\xfe\x80\r", b"E01\r"),
        (b"ST0\r", b"OK\r"),
    ],
)
def test_commands_and_answers(command: bytes, answer: bytes) -> None:
    assert Bench().say(command) == answer
    bench = Bench()
    assert b"".join(bench.say(command[i : i + 1]) for i in range(len(command))) == answer


def test_changing_a_range_in_operate_clears_the_charge_with_a_note() -> None:
    bench = Bench()
    bench.configured("binary")
    bench.say(b"RO1\r")
    bench.run(0.5, 400.0)
    assert bench.say(b"1:RG1250\r") == b"OK\r", "setting the same range must not clear the charges"
    assert bench.say(b"VA?\r").startswith(b"400.")
    assert bench.say(b"1:RG2500\r") == b"OK,CL\r"
    bench.run(0.5, 400.0)
    forces = [float(value) for value in bench.say(b"VA?\r").split(b",")]
    np.testing.assert_allclose(forces, 0.0, atol=0.2)


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_a_stream_contains_sequence_time_forces_and_status(form: str) -> None:
    bench = Bench(clock_offset_s=0.5)
    bench.configured(form)
    bench.say(b"RO1\r")
    bench.run(0.1, 100.0)
    assert bench.say(b"ST1\r") == b"OK\r"
    data = bench.run(1.0, [100, 200, -100, 50, 400, 300, 200, 100])
    block, stream = parse_stream(data + bench.say(b"ST0\r"), form)
    assert stream.stopped
    assert stream.rest.lstrip(b"\r") == b"OK\r"
    rows = block.rows
    assert rows["sequence"].tolist() == list(range(1000))
    assert rows["ticks"].tolist() == list(range(601_000, 1_601_000, 1000))
    assert (rows["status"] == 1 << 8).all(), 'only the status bit "operating" must be set'
    newtons = rows["counts"][-1] * np.array([1250.0] * 4 + [5000.0] * 4) / 2**15
    np.testing.assert_allclose(newtons, [100, 200, -100, 50, 400, 300, 200, 100], atol=0.1)
    counts = stream.counts
    assert (counts.gaps, counts.bad_frames, counts.garbage_bytes) == (0, 0, 0)
    assert bench.run(0.1) == b""


def test_rows_in_blocks_equal_rows_one_by_one() -> None:
    blocks, single = Bench(noise_v=0.1), Bench(noise_v=0.1)
    for bench in (blocks, single):
        bench.configured("binary")
        bench.say(b"RO1\rST1\r")
    assert blocks.run(0.1, 50.0) == b"".join(single.run(0.001, 50.0) for _ in range(100))


def test_while_streaming_only_stop_time_and_overload_commands_are_accepted() -> None:
    bench = Bench()
    bench.configured("binary")
    bench.say(b"RO1\rST1\r")
    data = bench.run(0.1) + bench.say(b"TM?\r") + bench.run(0.1) + bench.say(b"OV?\rTM?\r")
    block, stream = parse_stream(data)
    assert len(block.rows) == 200
    assert stream.counts.garbage_bytes == 0
    kinds = PROFILE.events
    assert block.events["kind"].tolist() == [kinds.mark, kinds.overload, kinds.mark]
    assert block.events["detail"].tolist() == [0, 0, 1]
    assert block.events["sequence"].tolist() == [100, 200, 200]
    assert block.events["ticks"].tolist() == [100_000, 200_000, 200_000]
    assert bench.say(b"LP100\rID?\r") == b"E05\rE05\r"
    assert bench.say(b"ST1\r") == b"OK\r", "the stream continues"
    assert parse_stream(bench.run(0.01))[0].rows["sequence"][0] == 200


def test_an_overload_is_an_event_and_stays_in_the_status_until_read() -> None:
    bench = Bench()
    bench.configured("binary")
    bench.say(b"RO1\rST1\r")
    forces = np.zeros(8)
    forces[3] = 1300.0
    data = bench.run(0.05) + bench.run(0.05, forces) + bench.run(0.05)
    block, _ = parse_stream(data)
    overloaded = block.rows["status"] & 0xFF
    assert overloaded.tolist() == [0] * 50 + [8] * 100
    (event,) = block.events
    assert (event["kind"], event["detail"], event["sequence"]) == (1, 8, 50)
    bench.say(b"OV?\r")
    assert not (parse_stream(bench.run(0.05))[0].rows["status"] & 0xFF).any()
    bench.say(b"ST0\r")
    bench.run(0.05, forces)
    assert bench.say(b"OV?\r") == b"08\r"
    assert bench.say(b"OV?\r") == b"08\r", "the overload is still present"
    bench.run(0.05)
    assert bench.say(b"OV?\rOV?\r") == b"08\r00\r"


def test_trigger_edges_are_events_between_the_rows_with_their_own_time() -> None:
    bench = Bench(clock_ppm=100.0)
    bench.configured("binary")
    bench.say(b"RO1\rST1\r")
    assert not len(parse_stream(bench.run(0.02, edges_s=(0.0042,)))[0].events)
    bench.say(b"ST0\rTR1\rST1\r")
    block, _ = parse_stream(bench.run(0.02, edges_s=(0.0242, 0.0322)))
    assert block.events["detail"].tolist() == [0, 1]
    assert block.events["ticks"].tolist() == [round(1.0001 * t) for t in (24_200, 32_200)]
    assert block.events["sequence"].tolist() == [4, 12]


def test_the_device_has_the_settings_of_the_cell_file() -> None:
    truth = SimulatedPlate(sensitivity_pc_n=PC_N)
    device = SimulatedAmplifier(PROFILE, truth, 0, bits=12, low_pass_order=4)
    device.receive(b"AD?\r", lambda: NOTHING)
    (answer,) = device.take()
    assert answer.data == b"12\r"
    assert device.physics.settings.low_pass_order == 4


@settings(max_examples=200)
@given(st.lists(st.binary(max_size=400), max_size=6))
def test_random_input_never_disturbs_the_device(noise: list[bytes]) -> None:
    bench = Bench()
    for piece in noise:
        bench.say(piece)
    bench.say(b"\rST0\r")
    assert bench.say(b"ID?\r") == IDENTITY.encode() + b"\r"


def test_output_has_the_time_at_which_it_is_ready() -> None:
    bench = Bench()
    bench.configured("ascii")
    bench.device.receive(b"ST1\r", lambda: NOTHING, 0.25)
    bench.device.apply_loads(0.3)
    answer, rows = bench.device.take()
    assert isinstance(answer, Unit)
    assert isinstance(rows, RowBlock)
    assert answer.ready_s == 0.25
    np.testing.assert_allclose(rows.ready_s, np.arange(1, 301) * 0.001)
    assert len(rows.data) == 300 * rows.size == 300 * PROFILE.row_bytes("ascii")
