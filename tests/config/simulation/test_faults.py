"""Fault scripts: allowed content, and the position of errors in invalid ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import load_cell, load_faults
from config.simulation.faults import FaultScript

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "simulated-cell.md"


def load(tmp_path: Path, text: str) -> FaultScript:
    path = tmp_path / "faults.yaml"
    path.write_text(text)
    return load_faults(path, load_cell("ir361").config)


def test_the_script_in_the_guide_loads(tmp_path: Path) -> None:
    lines = GUIDE.read_text(encoding="utf-8").splitlines()
    first = lines.index("    # faults.yaml")
    last = lines.index("", first)
    script = load(tmp_path, "\n".join(line[4:] for line in lines[first:last]))
    assert len(script.bus) == 3
    assert script.drives[0].code == 0x4310, "the number must be decimal"
    assert script.registers[0].kind == "late"
    assert script.amplifier[0].count == 3
    assert script.drives[2].clock_rate == 0.5
    assert [fault.kind for fault in script.program] == ["kill", "disk_stall"]


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("bus: [{kind: lose}]", "1:8", "unknown kind 'lose'. Allowed: bus_off, corrupt"),
        ("bus:\n  - {kind: drop, joint: axis9}", "2:18", "no joint 'axis9'; it has axis1"),
        ("drives:\n  - {kind: reset, joint: arm}", "2:19", "no joint 'arm'"),
        ("bus: [{kind: delay}]", "1:7", "delay needs delay_s"),
        ("bus: [{kind: drop, length: 3}]", "1:7", "length is for wrong_length only"),
        ("bus: [{kind: drop, bit: 3}]", "1:7", "bit is for corrupt only"),
        ("bus: [{kind: drop, at_s: 1.0, at_cycle: 3}]", "1:7", "at_s and at_cycle are both given"),
        ("bus: [{kind: drop, at_frame: 1, at_cycle: 3}]", "1:7", "only one of at_frame"),
        ("bus: [{kind: drop, count: 1, lasting: true}]", "1:7", "count and lasting"),
        ("drives: [{kind: reset, duration_s: 1.0}]", "1:10", "reset happens at once"),
        ("drives: [{kind: blocked, probability: 1.0}]", "1:26", "unknown key"),
        ("bus: [{kind: drop, probability: 1.5}]", "1:20", "at most 1"),
        ("registers: [{kind: late}, {kind: short}]", "1:1", "two faults for the same request"),
        ("drives: [{kind: clock}]", "1:10", "clock needs either factor or ppm"),
        ("drives: [{kind: clock, factor: 2.0, ppm: 3.0}]", "1:10", "either factor or ppm"),
        ("drives: [{kind: clock, factor: 0.0}]", "1:24", "more than 0"),
        ("drives: [{kind: reset, ppm: 3.0}]", "1:10", "ppm is for clock only, this is reset"),
        ("program: [{kind: crash}]", "1:12", "unknown kind 'crash'. Allowed: disk_error"),
        ("program: [{kind: kill, process: hub}]", "1:24", "'recorder', 'task' or 'program'"),
        ("program: [{kind: kill}]", "1:11", "the key 'process' is missing"),
        ("program: [{kind: freeze, process: task}]", "1:11", "the key 'duration_s' is missing"),
        ("program: [{kind: freeze, process: program, duration_s: 1.0}]", "1:26", "'task'"),
        ("program:\n  - {kind: signal, signal: KILL}", "2:20", "'INT', 'TERM', 'HUP' or 'TSTP'"),
        ("program: [{kind: disk_stall}]", "1:11", "disk_stall needs duration_s"),
        ("program: [{kind: disk_full, duration_s: 1.0}]", "1:11", "until the cell ends"),
        ("program: [{kind: disk_error, after_bytes: -1}]", "1:30", "at least 0"),
        (
            "program: [{kind: disk_stall, duration_s: 1.0, after_bytes: 9}]",
            "1:11",
            "after_bytes is for disk_full and disk_error only",
        ),
        ("seed: -1", "1:1", "at least 0"),
    ],
)
def test_an_error_is_reported_with_its_position(
    tmp_path: Path, text: str, where: str, message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    assert f"faults.yaml:{where}: " in str(caught.value)
    assert message in str(caught.value)


def test_an_unknown_key_is_refused_with_the_keys_of_its_kind(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "bus: [{kind: drop, duration_s: 60.0}]")
    allowed = str(caught.value).partition("Allowed: ")[2].split(", ")
    assert "probability" in allowed
    assert "duration_s" not in allowed
    assert "did you mean" not in str(caught.value)
