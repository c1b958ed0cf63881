"""The output of `ip` for a SocketCAN interface is compared with the cell file before any motion."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from config.load import load_cell
from drivers.ports.can_interface import CanInterface, read_interface
from rid_daq.preflight.bus_check import interface_lines

CELL = load_cell("ir361").config.model_copy(
    update={"can": load_cell("ir361").config.can.model_copy(update={"interface": "socketcan"})}
)


def answer(state: str = "ERROR-ACTIVE", restart_ms: int = 0, bitrate: int = 1_000_000) -> str:
    """Return what `ip -json -details link show dev can0` prints for an adapter."""
    data: dict[str, Any] = {
        "ctrlmode": ["BERR-REPORTING"],
        "state": state,
        "berr_counter": {"tx": 0, "rx": 0},
        "restart_ms": restart_ms,
        "bittiming": {"bitrate": bitrate, "sample_point": "0.750", "tq": 50},
        "clock": 80000000,
    }
    flags = ["NOARP", "ECHO"] if state == "STOPPED" else ["NOARP", "UP", "LOWER_UP", "ECHO"]
    link = {"ifname": "can0", "flags": flags, "linkinfo": {"info_kind": "can", "info_data": data}}
    return json.dumps([link])


def red_properties(interface: CanInterface | None) -> list[str]:
    return [line.what for line in interface_lines(CELL, interface) if line.verdict == "red"]


def test_an_interface_with_the_settings_of_the_cell_file_is_ok() -> None:
    assert red_properties(CanInterface.parse(answer())) == []


@pytest.mark.parametrize("state", ["ERROR-WARNING", "ERROR-PASSIVE", "BUS-OFF", "STOPPED"])
def test_every_state_except_error_active_is_red(state: str) -> None:
    assert red_properties(CanInterface.parse(answer(state))) == ["state"]


def test_another_bit_rate_and_an_automatic_restart_are_red() -> None:
    found = CanInterface.parse(answer(bitrate=500_000, restart_ms=100))
    assert red_properties(found) == ["bit rate", "restart after bus-off (restart-ms)"]


def test_properties_that_a_virtual_interface_lacks_are_shown() -> None:
    link = {"ifname": "vcan0", "flags": ["NOARP", "UP"], "linkinfo": {"info_kind": "vcan"}}
    found = CanInterface.parse(json.dumps([link]))
    assert found == CanInterface(up=True)
    assert red_properties(found) == []


@pytest.mark.parametrize("text", ["", "{}", "[]", "[1]", "[{}, {}]", '[{"linkinfo": 3}]', "nan"])
def test_an_unreadable_answer_is_red(text: str) -> None:
    assert CanInterface.parse(text) is None
    assert red_properties(None) == ["interface"]


def test_the_kernels_settings_are_read_with_ip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "ip"
    wanted = "-json -details link show dev can0"
    program.write_text(f'#!/bin/sh\n[ "$*" = "{wanted}" ] && echo \'{answer()}\'\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert read_interface("can0") == CanInterface(True, "ERROR-ACTIVE", 1_000_000, 0)
    assert read_interface("can1") is None
    assert read_interface("with\0null") is None
    monkeypatch.setenv("PATH", str(tmp_path / "nowhere"))
    assert read_interface("can0") is None
