"""Driver of the amplifier with a scripted device: requests, settings, ports."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Any

import pytest

from config.cell.amplifier_profile import AmplifierProfile
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from config.load import load_bundled_or_path
from drivers.amplifier.amplifier import SerialAmplifier, open_amplifier
from drivers.amplifier.codec import AmplifierCommand
from tests.builders.raised_codes import raises_code

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
ENOUGH_S = 120.0
Plug = Callable[..., Any]


def test_control_characters_in_the_identity_are_escaped(plug: Plug) -> None:
    device = plug(identity=b"Example,\x1b[2J")
    with open_amplifier(device.config, PROFILE) as amplifier:
        with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER", "\\x1b[2J"):
            amplifier.connect()
        device.script.identity = b"Example,M8,007,1.2"
        assert amplifier.connect() == "Example,M8,007,1.2"


def test_a_wrong_baud_rate_is_found_and_named(plug: Plug, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 0.02)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", (115200, 460800))
    device = plug(baud_rate=115200)
    with (
        open_amplifier(device.config, PROFILE) as amplifier,
        raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "115200", "460800"),
    ):
        amplifier.connect()


def test_a_silent_device_is_reported_as_silent(plug: Plug, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 0.02)
    monkeypatch.setattr("drivers.amplifier.dialogue.PROBE_TIMEOUT_S", 0.01)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", (9600, 115200))
    mute = {"identify": lambda request: None, "stream": lambda request: None}
    device = plug(moods=mute)
    with (
        open_amplifier(device.config, PROFILE) as amplifier,
        raises_code(DeviceTimeoutError, "RID-AMPLIFIER-SILENT"),
    ):
        amplifier.connect()


def test_settings_that_agree_are_not_written(plug: Plug) -> None:
    device = plug(operating=True)
    script = device.script
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        assert not amplifier.configure()
        assert {setting.verdict for setting in amplifier.settings()} == {"ok"}
        assert len(amplifier.settings()) == 21
    assert not [
        line for line in script.received_lines if not line.endswith(b"?") and line != b"ST0"
    ]


def test_a_changed_range_is_written_alone_and_clears_the_charge(plug: Plug) -> None:
    device = plug(operating=True, settings={("range", 3): "500"})
    script = device.script
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        red = [setting for setting in amplifier.settings() if setting.verdict == "red"]
        assert [(s.name, s.required, s.found) for s in red] == [
            ("range of fy14", "2500 N", "500 N")
        ]
        assert amplifier.configure()
        assert not amplifier.configure()
    assert [
        line for line in script.received_lines if b"RG" in line and not line.endswith(b"?")
    ] == [b"3:RG2500"]


def test_a_setting_that_is_not_kept_is_an_error(plug: Plug) -> None:
    def stubborn(request: AmplifierCommand) -> bytes:
        return b"OK\r" if request.value is not None else b"30\r"

    device = plug(moods={"low_pass": stubborn})
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "100", "30"):
            amplifier.configure()


def test_the_converter_setting_is_compared_and_not_written(plug: Plug) -> None:
    device = plug(settings={("bits", 0): "12"})
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "12"):
            amplifier.configure()


def test_a_refused_value_is_reported_with_channel_and_code(plug: Plug) -> None:
    device = plug(moods={"range": lambda request: b"E03\r"})
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER", "1:RG?", "fx12", "E03"):
            amplifier.settings()


def test_reading_overloads_clears_them(plug: Plug) -> None:
    device = plug(overloads=0b1000_0001)
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        assert amplifier.take_overloads() == (True, *[False] * 6, True)
        assert not any(amplifier.take_overloads())


def test_forces_are_the_values_of_the_device(plug: Plug) -> None:
    device = plug(values=b"1.5,-2,0,0,0,0,0,4.9")
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        assert amplifier.forces_n().tolist() == [1.5, -2.0, 0, 0, 0, 0, 0, 4.9]
        for nonsense in (b"1,2,3", b"a,b,c,d,e,f,g,h", b"nan,0,0,0,0,0,0,0"):
            device.script.values = nonsense
            with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER"):
                amplifier.forces_n()


def test_a_confirmed_command_without_effect_is_an_error(plug: Plug) -> None:
    def confirm(request: AmplifierCommand) -> bytes:
        return b"OK\r" if request.value is not None else b"0\r"

    device = plug(moods={"operate": confirm})
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER"):
            amplifier.operate()


@pytest.mark.parametrize(
    ("name", "answer", "ask"),
    [
        ("operate", b"2\r", SerialAmplifier.is_operating),
        ("overload", b"1FF\r", SerialAmplifier.take_overloads),
        ("overload", b"none\r", SerialAmplifier.take_overloads),
    ],
)
def test_an_answer_outside_the_profile_is_an_error(
    name: str, answer: bytes, ask: Callable[[SerialAmplifier], object], plug: Plug
) -> None:
    device = plug(moods={name: lambda request: answer})
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER"):
            ask(amplifier)


def test_late_answers_are_not_used_for_the_next_request(plug: Plug) -> None:
    device = plug()
    with open_amplifier(device.config, PROFILE) as amplifier:
        amplifier.connect()
        device.say(b"1\rE03\r")
        until_s = time.monotonic() + ENOUGH_S
        assert select.select([amplifier._link._descriptor], [], [], until_s - time.monotonic())[0]
        assert not amplifier.is_operating()


def test_a_late_confirmation_is_not_used_as_identity(plug: Plug) -> None:
    device = plug(moods={"identify": lambda request: b"OK\rExample,M8,007,1.2\r"})
    with open_amplifier(device.config, PROFILE) as amplifier:
        assert amplifier.connect() == "Example,M8,007,1.2"


def test_a_missing_port_is_an_error_with_its_name(plug: Plug) -> None:
    with (
        raises_code(TransportError, "RID-SERIAL-OPEN", "/dev/ttyNONE", "plate.amplifier.address"),
        open_amplifier(plug().config.model_copy(update={"address": "/dev/ttyNONE"}), PROFILE),
    ):
        pass
    with (
        raises_code(TransportError, "RID-SERIAL-OPEN", "warp:"),
        open_amplifier(plug().config.model_copy(update={"address": "warp://core"}), PROFILE),
    ):
        pass


def test_a_port_is_used_by_one_program_only(plug: Plug) -> None:
    device = plug()
    config = device.config
    with (
        open_amplifier(config, PROFILE),
        raises_code(TransportError, "RID-SERIAL-OPEN"),
        open_amplifier(config, PROFILE),
    ):
        pass
