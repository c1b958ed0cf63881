"""Fixtures: a scripted amplifier on a pseudo-terminal, with real bytes and real ports."""

from __future__ import annotations

import os
import select
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import AmplifierConfig
from config.load import load_bundled_or_path
from drivers.amplifier.codec import (
    AmplifierCodec,
    AmplifierCommand,
    AmplifierReply,
    LineSplitter,
    RequestError,
)
from drivers.amplifier.frames import encode_event, event_layout

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
CODEC = AmplifierCodec(PROFILE)
ENOUGH_S = 120.0
RANGES = (2500.0,) * 4 + (5000.0,) * 4
SENSITIVITIES = (-7.5,) * 4 + (-3.8,) * 4


@dataclass
class Script:
    """Identity, settings and faults of the scripted device, and the lines that it received."""

    baud_rate: int = 460800
    form: str = "binary"
    identity: bytes = b"Example,M8,007,1.2"
    values: bytes = b",".join([b"0.5"] * 8)
    overloads: int = 0
    operating: bool = False
    moods: dict[str, Callable[[AmplifierCommand], bytes | None]] = field(default_factory=dict)
    settings: dict[tuple[str, int], str] = field(default_factory=dict)
    received_lines: list[bytes] = field(default_factory=list)
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
        self._theirs = theirs  # kept open so that the port exists without a client
        self._wake, self._woken = os.pipe()
        self._lines = LineSplitter()
        self.config = config_for(self.address, script)
        script.settings = as_configured(self.config) | script.settings
        self.start()

    def say(self, data: bytes) -> None:
        os.write(self._ours, data)

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
                self.script.received_lines.append(line)
                answer = self._answer(line)
                if answer is not None:
                    os.write(self._ours, answer)

    def _answer(self, line: bytes) -> bytes | None:
        script = self.script
        try:
            request = CODEC.read_request(line)
        except RequestError as error:
            return CODEC.answer(AmplifierReply(error=error.number))
        if request.name in script.moods:
            return script.moods[request.name](request)
        answer = self._usual(request)
        return None if answer is None else script.noise_before_answers + CODEC.answer(answer)

    def _usual(self, request: AmplifierCommand) -> AmplifierReply | None:
        script = self.script
        if request.name == "stream":
            return self._stream(request)
        if script.streaming:
            return None
        if request.name == "identify":
            return AmplifierReply(script.identity.decode("latin-1"))
        if request.name == "operate" and request.value is not None:
            script.operating = request.value == "1"
            return AmplifierReply()
        if request.name == "operate":
            return AmplifierReply(str(int(script.operating)))
        if request.name == "values":
            return AmplifierReply(script.values.decode("latin-1"))
        if request.name == "overload":
            word, script.overloads = script.overloads, 0
            return AmplifierReply(f"{word:02X}")
        key = (request.name, request.channel)
        if request.value is None:
            return AmplifierReply(script.settings[key])
        changed = script.settings[key] != request.value
        script.settings[key] = request.value
        return AmplifierReply(charge_lost=changed and request.name == "range" and script.operating)

    def _stream(self, request: AmplifierCommand) -> AmplifierReply | None:
        script = self.script
        if request.value == "1":
            script.streaming = True
            os.write(self._ours, CODEC.answer(AmplifierReply()) + script.rows)
            return None
        if script.streaming:
            layout = event_layout(PROFILE, script.form)
            os.write(self._ours, encode_event(layout, PROFILE.events.stopped, 0, 0, 0))
            script.streaming = False
        return AmplifierReply()


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
    """Set long timeouts for a slow computer, and probe no other baud rates.

    Tests of missing answers set their own timeouts.
    """
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", ENOUGH_S)
    monkeypatch.setattr("drivers.amplifier.dialogue.PROBE_TIMEOUT_S", ENOUGH_S)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", ())


@pytest.fixture
def plug() -> Iterator[Callable[..., Device]]:
    """Return a function that plugs in a device; its arguments are the script's fields."""
    devices: list[Device] = []

    def plug_in(**fields: Any) -> Device:
        devices.append(Device(Script(**fields)))
        return devices[-1]

    yield plug_in
    for device in devices:
        if device.is_alive():
            device.unplug()
