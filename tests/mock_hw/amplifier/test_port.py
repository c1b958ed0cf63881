"""Simulated amplifier at a serial port: transmission times, baud rates, and faults.

The bytes come from a pseudo-terminal and are checked by the driver's parser.
"""

from __future__ import annotations

import os
import select
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import PlateConfig
from config.load import load_bundled_or_path, load_cell
from config.simulation.faults import AmplifierFault, FaultScript
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.simulated_arrivals import ArrivalReader, arrivals_path
from drivers.amplifier.stream import AmplifierStream, StreamPiece
from mock_hw.amplifier.port import AmplifierPort
from mock_hw.amplifier.settings import PlateSettings

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
REST = np.array([0.0, 0.0, -900.0, 0.0, 0.0, 0.0])
SET_UP = b"RG5000\rSE-7.5\rLP200\rSR1000\rSF1\rRO1\rST1\r"


@pytest.fixture(scope="module")
def plate() -> PlateConfig:
    plate = load_cell("ir361").config.plate
    assert plate is not None
    return plate


class Bench:
    """A simulated amplifier's port, the computer's end of the line, and a simulated clock."""

    def __init__(self, path: Path, plate: PlateConfig, **options: Any) -> None:
        realtime = options.pop("realtime", False)
        truth = SimulatedPlate(
            sensitivity_pc_n=plate.amplifier.sensitivity_pc_n,
            line_jitter_s=options.pop("jitter", 0.0),
        )
        self.path = path
        self.port = AmplifierPort(
            PlateSettings(plate, PROFILE, truth, path, **options), realtime=realtime
        )
        self.plug()

    def say(self, command: bytes) -> bytes:
        self.computer.write(command)
        self.port.receive(self.port.read(), REST)
        return self.read_new()

    def start(self) -> None:
        assert self.say(SET_UP) == b"OK\r" * 7

    def plug(self, baud_rate: int = 460800) -> None:
        """Open the port at the computer's end."""
        self.computer = serial.Serial(str(self.path), baud_rate, timeout=0.0)
        self._seen = self.port.passed_bytes

    def run(self, duration_s: float, step_s: float = 0.008) -> bytes:
        """Let time pass; return the bytes received meanwhile."""
        received = b""
        for step in range(round(duration_s / step_s)):
            end_s = self.port.time_s + step_s
            self.port.apply_loads(end_s, [end_s], [REST])
            received += self.read_new() if step % 8 == 7 else b""
        return received + self.read_new()

    def read_new(self) -> bytes:
        """Return all bytes received since the last call."""
        data = b""
        while self._seen < self.port.passed_bytes:
            assert select.select([self.computer.fileno()], [], [], 20.0)[0]
            try:
                more = os.read(self.computer.fileno(), 65536)
            except OSError:
                more = b""
            if not more:  # the port was closed: the remaining bytes are lost
                self._seen = self.port.passed_bytes
            self._seen += len(more)
            data += more
        return data

    def close(self) -> None:
        self.computer.close()
        self.port.close()


@pytest.fixture
def make(tmp_path: Path, plate: PlateConfig) -> Iterator[Any]:
    benches: list[Bench] = []

    def one(**options: Any) -> Bench:
        benches.append(Bench(tmp_path / f"port{len(benches)}", plate, **options))
        return benches[-1]

    yield one
    for bench in benches:
        bench.close()
    assert [*tmp_path.iterdir()] == []


def parse_stream(data: bytes) -> tuple[StreamPiece, AmplifierStream]:
    stream = AmplifierStream(PROFILE, "binary", 1000.0)
    return stream.feed(data), stream


def fault_script(*faults: AmplifierFault, seed: int = 0) -> FaultScript:
    return FaultScript(seed=seed, amplifier=faults)


def with_fault(
    make: Any, *faults: AmplifierFault, seed: int = 3
) -> tuple[StreamPiece, AmplifierStream]:
    bench = make(faults=fault_script(*faults, seed=seed))
    bench.start()
    return parse_stream(bench.run(0.4))


def test_a_healthy_line_transmits_every_row(make: Any) -> None:
    bench = make()
    assert bench.say(b"ID?\r").startswith(b"rid-daq,")
    bench.start()
    assert bench.port.watches
    assert bench.port.works
    block, stream = parse_stream(bench.run(0.4))
    assert block.rows["sequence"].tolist() == list(range(400))
    assert stream.counts.garbage_bytes == stream.counts.bad_frames == 0
    assert abs(block.rows["counts"]).max() == 0, "the force at the command operate must be the zero"


def test_a_row_arrives_after_its_time_on_the_line(make: Any) -> None:
    bench = make()
    bench.start()
    rows = parse_stream(bench.run(0.2))[0].rows
    with ArrivalReader(arrivals_path(str(bench.path))) as arrivals:
        arrived_s = arrivals.time_s(rows["sequence"])
    np.testing.assert_allclose(arrived_s - rows["ticks"] * 1e-6, 28 * 10 / 460800, atol=1e-6)


def test_arrivals_do_not_depend_on_time_steps_or_time_requests(make: Any) -> None:
    one, two = make(jitter=0.005), make(jitter=0.005)
    for bench in (one, two):
        bench.start()
    one_rows = parse_stream(one.run(0.24))[0].rows
    data = two.run(0.12, 0.003)
    two.say(b"")
    data += two.say(b"TM?\r") + two.run(0.12, 0.012)
    two_rows = parse_stream(data)[0].rows
    assert (one_rows == two_rows).all()
    with (
        ArrivalReader(arrivals_path(str(one.path))) as first,
        ArrivalReader(arrivals_path(str(two.path))) as second,
    ):
        sequence = one_rows["sequence"]
        assert (first.time_s(sequence) == second.time_s(sequence)).all()


def test_in_real_time_bytes_are_withheld_until_their_arrival(make: Any) -> None:
    bench = make(realtime=True)
    assert not arrivals_path(str(bench.path)).exists()
    assert bench.say(b"RO?\r") == b"", "no answer yet: its two bytes take 43 us"
    assert bench.port.next_s < 0.002
    bench.port.advance(0.0005)
    assert bench.read_new() == b"0\r"
    bench.computer.write(b"RO?\r")
    bench.port.receive(bench.port.read(), REST, 0.5)
    bench.port.advance(0.50001)
    assert bench.read_new() == b""
    bench.port.advance(0.6)
    assert bench.read_new() == b"0\r"
    assert bench.port.next_s == np.inf


def test_another_baud_rate_gives_garbage_in_both_directions(make: Any) -> None:
    bench = make()
    bench.computer.baudrate = 9600
    assert b"rid-daq" not in bench.say(b"ID?\r\r\r")
    bench.computer.baudrate = 460800
    bench.say(b"\r")
    bench.start()
    bench.computer.baudrate = 115200
    data = bench.run(0.2)
    assert len(data) == 200 * 28
    assert len(parse_stream(data)[0].rows) == 0
    bench.computer.baudrate = 460800
    assert len(parse_stream(bench.run(0.2))[0].rows) == 200


def test_an_amplifier_with_another_setting_answers_at_its_own_rate(make: Any) -> None:
    bench = make(baud_rate=115200)
    assert bench.say(b"RO?\r") != b"0\r"
    bench.computer.baudrate = 115200
    bench.say(b"\r")
    assert bench.say(b"RO?\r") == b"0\r"


@pytest.mark.parametrize("kind", ["garbage", "nuls"])
def test_garbage_between_rows_loses_no_row(make: Any, kind: Any) -> None:
    block, stream = with_fault(make, AmplifierFault(kind=kind, row=100, count=5000))
    assert block.rows["sequence"].tolist() == list(range(400))
    assert stream.counts.garbage_bytes == 5000


@pytest.mark.parametrize("kind", ["lost_bytes", "torn_row", "bad_checksum"])
@pytest.mark.parametrize("seed", range(8))
def test_a_damaged_row_loses_at_most_one_more(make: Any, kind: Any, seed: int) -> None:
    block, _ = with_fault(
        make, AmplifierFault(kind=kind, row=100, count=3 if kind == "lost_bytes" else 1), seed=seed
    )
    missing = set(range(400)) - set(block.rows["sequence"].tolist())
    assert 100 in missing
    assert missing <= {100, 101}


def test_a_gap_has_the_stated_length(make: Any) -> None:
    block, stream = with_fault(make, AmplifierFault(kind="gap", row=100, count=7))
    assert (np.diff(block.rows["sequence"]) > 1).sum() == 1
    assert len(block.rows) == 393
    assert (stream.counts.gaps, stream.counts.rows_lost) == (1, 7)


def test_a_stall_delays_rows_and_loses_none(make: Any) -> None:
    bench = make(faults=fault_script(AmplifierFault(kind="stall", row=100, duration_s=0.1)))
    bench.start()
    rows = parse_stream(bench.run(0.4))[0].rows
    assert len(rows) == 400
    with ArrivalReader(arrivals_path(str(bench.path))) as arrivals:
        late_s = arrivals.time_s(rows["sequence"]) - rows["ticks"] * 1e-6
    assert late_s[99] < 0.001
    assert late_s[100] == pytest.approx(0.1, abs=1e-6)
    assert (np.diff(late_s[100:200]) < 0.0).all()
    assert late_s[205] < 0.001


def test_an_unplugged_amplifier_continues_and_returns_at_its_path(make: Any) -> None:
    bench = make(faults=fault_script(AmplifierFault(kind="unplug", row=100, duration_s=0.1)))
    bench.start()
    before = parse_stream(bench.run(0.15))[0].rows
    assert 64 <= len(before) <= 100, "bytes that were not read before the unplugging are lost"
    assert not bench.path.exists()
    bench.run(0.072)
    bench.computer.close()
    bench.plug()
    after = parse_stream(bench.run(0.1))[0].rows
    assert len(after) >= 90
    assert after["sequence"][0] > 200


def test_an_overload_lasts_and_is_flagged(make: Any) -> None:
    faults = FaultScript(
        amplifier=(AmplifierFault(kind="overload", row=100, duration_s=0.05, channel=6),)
    )
    bench = make(faults=faults)
    bench.start()
    block, _ = parse_stream(bench.run(0.4))
    full = block.rows["counts"][:, 6] == 2**15 - 1
    flagged = (block.rows["status"] & 1 << 6) != 0
    assert 30 <= full.sum() <= 60
    assert flagged[full].all()
    assert not flagged[:100].any()
    assert PROFILE.events.overload in block.events["kind"]


def test_a_line_slower_than_the_rows_reports_the_lost_rows(make: Any) -> None:
    bench = make(baud_rate=115200)
    bench.computer.baudrate = 115200
    bench.say(b"\r")
    bench.start()
    rows, stream = parse_stream(bench.run(4.0, 0.1))
    assert stream.counts.rows_lost > 1000
    kinds = rows.events["kind"] == PROFILE.events.overrun
    assert rows.events["detail"][kinds].sum() >= 0.8 * stream.counts.rows_lost
    assert (rows.rows["status"] & 1 << PROFILE.status_bits.overrun).any()


def test_faults_are_reproducible(make: Any) -> None:
    faults = FaultScript(
        seed=9,
        amplifier=(
            AmplifierFault(kind="garbage", row=20, count=33),
            AmplifierFault(kind="bad_checksum", row=50, count=4),
        ),
    )
    outputs = []
    for _ in range(2):
        bench = make(faults=faults)
        bench.start()
        outputs.append(bench.run(0.2))
    assert outputs[0] == outputs[1]
