"""The amplifier's driver against a scripted device on a pseudo-terminal: real bytes, real ports."""

from __future__ import annotations

import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from config.amplifier_profile import AmplifierProfile
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from config.load import load_bundled_or_path
from config.plate import AmplifierConfig
from drivers.amplifier_codec import AmplifierCodec, Answer, LineSplitter, Request, RequestError
from drivers.amplifier_frames import encode_event, encode_row, event_layout, row_layout
from drivers.amplifier_serial import SerialAmplifier, open_amplifier
from drivers.interfaces import PlateRead
from drivers.simulated_arrivals import ArrivalWriter, arrivals_path

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
CODEC = AmplifierCodec(PROFILE)
ENOUGH_S = 20.0
RANGES = (2500.0,) * 4 + (5000.0,) * 4
SENSITIVITIES = (-7.5,) * 4 + (-3.8,) * 4


@dataclass
class Script:
    """What the device is, and how it misbehaves."""

    baud_rate: int = 460800
    form: str = "binary"
    identity: bytes = b"Example,M8,007,1.2"
    values: bytes = b",".join([b"0.5"] * 8)
    overloads: int = 0
    operating: bool = False
    moods: dict[str, Callable[[Request], bytes | None]] = field(default_factory=dict)
    settings: dict[tuple[str, int], str] = field(default_factory=dict)
    heard: list[bytes] = field(default_factory=list)
    rows: bytes = b""
    streaming: bool = False
    noise_before_answers: bytes = b""


class Device(threading.Thread):
    """Serves a script on a pseudo-terminal until it is unplugged."""

    def __init__(self, script: Script) -> None:
        super().__init__(daemon=True)
        self.script = script
        self._ours, theirs = os.openpty()
        tty.setraw(theirs)
        self.address = os.ttyname(theirs)
        self._theirs = theirs  # kept open, so that the port stays while nobody has it
        self._wake, self._woken = os.pipe()
        self._lines = LineSplitter()
        self.start()

    def unplug(self) -> None:
        os.write(self._woken, b"x")
        self.join(ENOUGH_S)
        for descriptor in (self._ours, self._theirs, self._wake, self._woken):
            os.close(descriptor)

    def run(self) -> None:
        while True:
            ready, _, _ = select.select([self._ours, self._wake], [], [])
            if self._wake in ready:
                return
            data = os.read(self._ours, 4096)
            speed = termios.tcgetattr(self._ours)[5]
            if speed != getattr(termios, f"B{self.script.baud_rate}"):
                os.write(self._ours, b"\xf8\x00\x80" * len(data))
                continue
            self._lines.feed(data)
            while (line := self._lines.next_line()) is not None:
                self.script.heard.append(line)
                answer = self._answer(line)
                if answer is not None:
                    os.write(self._ours, answer)

    def _answer(self, line: bytes) -> bytes | None:
        script = self.script
        try:
            request = CODEC.read_request(line)
        except RequestError as error:
            return CODEC.answer(Answer(error=error.number))
        if request.name in script.moods:
            return script.moods[request.name](request)
        answer = self._usual(request)
        return None if answer is None else script.noise_before_answers + CODEC.answer(answer)

    def _usual(self, request: Request) -> Answer | None:
        script = self.script
        if request.name == "stream":
            return self._stream(request)
        if script.streaming:
            return None
        if request.name == "identify":
            return Answer(script.identity.decode("latin-1"))
        if request.name == "operate" and request.value is not None:
            script.operating = request.value == "1"
            return Answer()
        if request.name == "operate":
            return Answer(str(int(script.operating)))
        if request.name == "values":
            return Answer(script.values.decode("latin-1"))
        if request.name == "overload":
            word, script.overloads = script.overloads, 0
            return Answer(f"{word:02X}")
        key = (request.name, request.channel)
        if request.value is None:
            return Answer(script.settings[key])
        changed = script.settings[key] != request.value
        script.settings[key] = request.value
        return Answer(charge_lost=changed and request.name == "range" and script.operating)

    def _stream(self, request: Request) -> Answer | None:
        script = self.script
        if request.value == "1":
            script.streaming = True
            os.write(self._ours, CODEC.answer(Answer()) + script.rows)
            return None
        if script.streaming:
            layout = event_layout(PROFILE, script.form)
            os.write(self._ours, encode_event(layout, PROFILE.events.stopped, 0, 0, 0))
            script.streaming = False
        return Answer()


def as_configured(config: AmplifierConfig) -> dict[tuple[str, int], str]:
    settings = {
        ("bits", 0): str(config.bits),
        ("low_pass", 0): f"{config.low_pass_hz:g}",
        ("rate", 0): f"{config.rate_hz:g}",
        ("format", 0): str(int(config.format == "binary")),
        ("trigger", 0): str(int(config.trigger)),
    }
    for channel in range(1, 9):
        settings["range", channel] = f"{config.range_n[channel - 1]:g}"
        settings["sensitivity", channel] = f"{config.sensitivity_pc_n[channel - 1]:g}"
    return settings


def config_for(address: str, script: Script) -> AmplifierConfig:
    return AmplifierConfig(
        address=address,
        baud_rate=460800,
        format="binary" if script.form == "binary" else "ascii",
        rate_hz=500.0,
        low_pass_hz=100.0,
        range_n=RANGES,
        sensitivity_pc_n=SENSITIVITIES,
    )


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers come, however slow the machine; where none does, a test says so."""
    monkeypatch.setattr("drivers.amplifier_serial.ANSWER_TIMEOUT_S", ENOUGH_S)
    monkeypatch.setattr("drivers.amplifier_serial.PROBE_TIMEOUT_S", ENOUGH_S)
    monkeypatch.setattr("drivers.amplifier_serial.BAUD_RATES", ())


@pytest.fixture
def plug() -> Iterator[Callable[[Script], Device]]:
    devices: list[Device] = []

    def plug_in(script: Script) -> Device:
        device = Device(script)
        script.settings = as_configured(config_for(device.address, script)) | script.settings
        devices.append(device)
        return device

    yield plug_in
    for device in devices:
        if device.is_alive():
            device.unplug()


Plug = Callable[[Script], Device]


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


def test_who_answers_is_escaped(plug: Plug) -> None:
    device = plug(Script(identity=b"Example,\x1b[2J"))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        with pytest.raises(ProtocolError, match=r"\\x1b\[2J"):
            amplifier.connect()
        device.script.identity = b"Example,M8,007,1.2"
        assert amplifier.connect() == "Example,M8,007,1.2"


def test_the_transcript_of_a_session(plug: Plug) -> None:
    script = Script(rows=rows("binary", range(3)))
    device = plug(script)
    with open_amplifier(config_for(device.address, script), PROFILE) as amplifier:
        amplifier.connect()
        amplifier.reset()
        amplifier.operate()
        assert amplifier.take_overloads() == (False,) * 8
        amplifier.start()
        read_rows(amplifier, 3)
        amplifier.stop(time.monotonic() + ENOUGH_S)
    assert script.heard == [
        b"ST0", b"ID?", b"RO0", b"RO?", b"RO1", b"RO?", b"OV?", b"ST1", b"ST0",
    ]  # fmt: skip


def test_a_wrong_baud_rate_is_found_and_named(plug: Plug, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier_serial.ANSWER_TIMEOUT_S", 0.02)
    monkeypatch.setattr("drivers.amplifier_serial.BAUD_RATES", (115200, 460800))
    device = plug(Script(baud_rate=115200))
    with (
        open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier,
        pytest.raises(ProtocolError, match="answers at 115200 baud, not at 460800: set plate"),
    ):
        amplifier.connect()


def test_silence_is_named_as_silence(plug: Plug, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier_serial.ANSWER_TIMEOUT_S", 0.02)
    monkeypatch.setattr("drivers.amplifier_serial.PROBE_TIMEOUT_S", 0.01)
    monkeypatch.setattr("drivers.amplifier_serial.BAUD_RATES", (9600, 115200))
    mute = {"identify": lambda request: None, "stream": lambda request: None}
    device = plug(Script(moods=mute))
    with (
        open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier,
        pytest.raises(DeviceTimeoutError, match="nothing answers at any speed; check that"),
    ):
        amplifier.connect()


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_a_stream_left_running_is_ended(plug: Plug, form: str) -> None:
    script = Script(form=form, rows=rows(form, range(20)))
    device = plug(script)
    config = config_for(device.address, script)
    with open_amplifier(config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        amplifier.stop = lambda until_s: ()  # type: ignore[method-assign] # killed, as it were
    assert script.streaming
    with open_amplifier(config, PROFILE) as amplifier:
        assert amplifier.connect().startswith("Example")
    assert not script.streaming


def test_settings_that_agree_are_left_alone(plug: Plug) -> None:
    script = Script(operating=True)
    device = plug(script)
    with open_amplifier(config_for(device.address, script), PROFILE) as amplifier:
        amplifier.connect()
        assert not amplifier.configure()
        assert {setting.verdict for setting in amplifier.settings()} == {"ok"}
        assert len(amplifier.settings()) == 21
    assert not [line for line in script.heard if not line.endswith(b"?") and line != b"ST0"]


def test_a_changed_range_is_set_alone_and_loses_the_charge(plug: Plug) -> None:
    script = Script(operating=True, settings={("range", 3): "500"})
    device = plug(script)
    with open_amplifier(config_for(device.address, script), PROFILE) as amplifier:
        amplifier.connect()
        red = [setting for setting in amplifier.settings() if setting.verdict == "red"]
        assert [(s.name, s.required, s.found) for s in red] == [
            ("range of fy14", "2500 N", "500 N")
        ]
        assert amplifier.configure()
        assert not amplifier.configure()
    assert [line for line in script.heard if b"RG" in line and not line.endswith(b"?")] == [
        b"3:RG2500"
    ]


def test_a_setting_that_does_not_stay_is_an_error(plug: Plug) -> None:
    def stubborn(request: Request) -> bytes:
        return b"OK\r" if request.value is not None else b"30\r"

    device = plug(Script(moods={"low_pass": stubborn}))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        with pytest.raises(ProtocolError, match="low-pass was set to 100 and reads back 30 Hz"):
            amplifier.configure()


def test_the_converter_is_not_set_but_compared(plug: Plug) -> None:
    device = plug(Script(settings={("bits", 0): "12"}))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        with pytest.raises(ProtocolError, match="bits of the converter is 12, the cell file says"):
            amplifier.configure()


def test_a_refused_value_is_named_in_words(plug: Plug) -> None:
    device = plug(Script(moods={"range": lambda request: b"E03\r"}))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        with pytest.raises(ProtocolError, match=r"1:RG\?.*range of fx12.*E03 \(value out of range"):
            amplifier.settings()


def test_overloads_are_read_and_forgotten(plug: Plug) -> None:
    device = plug(Script(overloads=0b1000_0001))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        assert amplifier.take_overloads() == (True, *[False] * 6, True)
        assert not any(amplifier.take_overloads())


def test_forces_are_what_the_device_says(plug: Plug) -> None:
    device = plug(Script(values=b"1.5,-2,0,0,0,0,0,4.9"))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        assert amplifier.forces_n().tolist() == [1.5, -2.0, 0, 0, 0, 0, 0, 4.9]
        for nonsense in (b"1,2,3", b"a,b,c,d,e,f,g,h", b"nan,0,0,0,0,0,0,0"):
            device.script.values = nonsense
            with pytest.raises(ProtocolError, match="asked for eight forces"):
                amplifier.forces_n()


def test_a_device_that_does_not_do_what_it_confirmed(plug: Plug) -> None:
    def confirms(request: Request) -> bytes:
        return b"OK\r" if request.value is not None else b"0\r"

    device = plug(Script(moods={"operate": confirms}))
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        with pytest.raises(ProtocolError, match="did not operate"):
            amplifier.operate()


def test_late_answers_do_not_answer_the_next_question(plug: Plug) -> None:
    device = plug(Script())
    with open_amplifier(config_for(device.address, device.script), PROFILE) as amplifier:
        amplifier.connect()
        os.write(device._ours, b"1\rE03\r")
        until_s = time.monotonic() + ENOUGH_S
        assert select.select([amplifier._link._descriptor], [], [], until_s - time.monotonic())[0]
        assert not amplifier.is_operating()


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_rows_come_with_their_arrival(plug: Plug, form: str) -> None:
    script = Script(form=form, rows=rows(form, range(40)))
    device = plug(script)
    with open_amplifier(config_for(device.address, script), PROFILE) as amplifier:
        amplifier.connect()
        before_s = time.monotonic()
        amplifier.start()
        reads = read_rows(amplifier, 40)
        after_s = time.monotonic()
        with pytest.raises(ProtocolError, match="cannot be asked while rows are streaming"):
            amplifier.forces_n()
        reads += amplifier.stop(time.monotonic() + ENOUGH_S)
        assert amplifier.forces_n().shape == (8,)
    arrivals = np.concatenate([read.arrival_s for read in reads])
    counts = np.concatenate([read.rows for read in reads])["counts"]
    assert counts[:, 0].tolist() == list(range(40))
    assert np.all((arrivals >= before_s) & (arrivals <= after_s))
    assert amplifier.stream_counts.rows == 40


def test_where_time_is_simulated_the_arrivals_are_looked_up(plug: Plug, tmp_path: object) -> None:
    script = Script(rows=rows("binary", range(5)))
    device = plug(script)
    address = f"{tmp_path}/port"
    os.symlink(device.address, address)
    ArrivalWriter(arrivals_path(address)).write(range(5), [0.5 * i for i in range(5)])
    config = config_for(address, script)
    with open_amplifier(config, PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        reads = read_rows(amplifier, 5)
    arrivals = np.concatenate([read.arrival_s for read in reads])
    assert arrivals.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]


def test_an_unplugged_adapter_is_an_error_of_the_line_at_once(plug: Plug) -> None:
    script = Script(rows=rows("binary", range(3)))
    device = plug(script)
    with open_amplifier(config_for(device.address, script), PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        read_rows(amplifier, 3)
        device.unplug()
        with pytest.raises(TransportError, match="check the adapter and its cable"):
            amplifier.read(time.monotonic() + ENOUGH_S)
        with pytest.raises(TransportError):
            amplifier.mark()


def test_plugged_in_again_it_goes_on(plug: Plug) -> None:
    first = plug(Script())
    with open_amplifier(config_for(first.address, first.script), PROFILE) as amplifier:
        amplifier.connect()
        first.unplug()
    second = plug(Script(rows=rows("binary", range(4))))
    with open_amplifier(config_for(second.address, second.script), PROFILE) as amplifier:
        amplifier.connect()
        amplifier.start()
        assert sum(len(read.rows) for read in read_rows(amplifier, 4)) == 4


def test_a_port_that_is_not_there_is_named() -> None:
    with (
        pytest.raises(TransportError, match=r"/dev/ttyNONE.*plate\.amplifier\.address"),
        open_amplifier(config_for("/dev/ttyNONE", Script()), PROFILE),
    ):
        pass
    with (
        pytest.raises(TransportError, match="warp:"),
        open_amplifier(config_for("warp://core", Script()), PROFILE),
    ):
        pass


def test_a_port_belongs_to_one_program(plug: Plug) -> None:
    device = plug(Script())
    config = config_for(device.address, device.script)
    with (
        open_amplifier(config, PROFILE),
        pytest.raises(TransportError, match="no other program has it"),
        open_amplifier(config, PROFILE),
    ):
        pass
