"""`FaultScript`: what is to go wrong in a simulated cell, when, and how often.

A fault begins at a time (`at_s`, since the cell was served), at a cycle (`at_cycle`: SYNCs since
the drives were last commanded to be enabled) or, on the bus, at a frame (`at_frame`: of those that
it concerns, from 1); without any of these, at once. Everything random comes from `seed`.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.ranges import Seed

LONGEST_S: Final = 604_800.0
MOST: Final = 1_000_000_000
"""The latest time, the longest duration [s] and the largest count that a script may say."""

Duration = Annotated[float, Field(gt=0.0, le=LONGEST_S)]
Probability = Annotated[float, Field(gt=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=10_000_000)]
Identifier = Annotated[int, Field(ge=0, le=0x7FF)]
FrameKind = Literal[
    "answer",
    "command",
    "sync",
    "heartbeat",
    "emergency",
    "sdo_request",
    "sdo_answer",
    "master_heartbeat",
    "any",
]


class TimedFault(ConfigModel):
    """When a fault begins."""

    at_s: Annotated[float, Field(ge=0.0, le=LONGEST_S)] | None = None
    at_cycle: Annotated[int, Field(ge=1, le=MOST)] | None = None

    @model_validator(mode="after")
    def _one_beginning(self) -> TimedFault:
        if self.at_s is not None and self.at_cycle is not None:
            raise ValueError("give at_s or at_cycle, not both")
        return self


class FrameFault(TimedFault):
    """What happens to frames on the CAN bus.

    From its beginning on, each frame of this kind (`frames`; those of one drive where `joint` names
    it) is hit with `probability`, until `count` were hit; without `count` one frame is, or, where a
    probability or `lasting` is given, as many as come.

    `drop`: it never arrives. `duplicate`: it comes twice. `delay`: it comes `delay_s` later, and
    holds nothing else up. `reorder`: it comes after the next frame of the same identifier.
    `corrupt`: one bit is flipped (`bit`, or a random one). `wrong_length`: it has `length` bytes.
    `spoof`: another node answers before the drive, with its identifier and data but for
    `position_counts` or `torque_permille`, which it adds.
    """

    kind: Literal["drop", "duplicate", "delay", "reorder", "corrupt", "wrong_length", "spoof"]
    frames: FrameKind = "answer"
    joint: str | None = None
    at_frame: Annotated[int, Field(ge=1, le=MOST)] | None = None
    probability: Probability = 1.0
    count: Count | None = None
    lasting: bool = False
    delay_s: Duration | None = None
    bit: Annotated[int, Field(ge=0, le=63)] | None = None
    length: Annotated[int, Field(ge=0, le=8)] | None = None
    position_counts: Annotated[int, Field(ge=-(2**31), le=2**31 - 1)] = 0
    torque_permille: Annotated[int, Field(ge=-(2**15), le=2**15 - 1)] = 0

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> FrameFault:
        if self.at_frame is not None and (self.at_s, self.at_cycle) != (None, None):
            raise ValueError("give at_frame, at_cycle or at_s, one of them")
        needed = {"delay": ("delay_s", self.delay_s), "wrong_length": ("length", self.length)}
        for kind, (name, value) in needed.items():
            if self.kind == kind and value is None:
                raise ValueError(f"{kind} needs {name}")
            if self.kind != kind and value is not None:
                raise ValueError(f"{name} belongs to {kind}, this is {self.kind}")
        if self.bit is not None and self.kind != "corrupt":
            raise ValueError(f"bit belongs to corrupt, this is {self.kind}")
        adds = bool(self.position_counts or self.torque_permille)
        if adds != (self.kind == "spoof"):
            raise ValueError("spoof, and nothing else, needs position_counts or torque_permille")
        if self.kind == "spoof" and self.frames != "answer":
            raise ValueError("spoof is of answers")
        if self.lasting and self.count is not None:
            raise ValueError("give count or lasting, not both")
        return self

    @property
    def most(self) -> int | None:
        """How many frames are hit; None for as many as come."""
        if self.count is not None:
            return self.count
        return None if self.lasting or self.probability < 1.0 else 1


class StrangeFrames(TimedFault):
    """Frames that nobody in the cell sends: `count` of them, every `period_s`.

    With an identifier below 80h and a period shorter than a frame takes, this is a babbling node
    that keeps everybody else off the bus.
    """

    kind: Literal["strange"]
    identifier: Identifier
    length: Annotated[int, Field(ge=0, le=8)] = 8
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    period_s: Duration = 0.001


class AdapterFault(TimedFault):
    """What happens to the computer's CAN adapter, for `duration_s`.

    `bus_off`: it reports bus-off once, and receives and sends nothing. `unplugged`: it is gone;
    whoever opens it meanwhile is refused. `no_acknowledge`: nobody acknowledges what it sends, so
    that its queue (`queue` frames; the rest is lost) waits and goes out when the time is over.
    """

    kind: Literal["bus_off", "unplugged", "no_acknowledge"]
    duration_s: Duration
    queue: Annotated[int, Field(ge=0, le=1000)] = 10


class HeldUp(TimedFault):
    """The computer is held up: what should go on at a time goes on `duration_s` later.

    `count` wake-ups of the cyclic task in a row are late. In lock-step alone: in real time the
    computer's own clock says when the task wakes.
    """

    kind: Literal["held_up"]
    duration_s: Duration
    count: Count = 1


class DriveFault(TimedFault):
    """What goes wrong in one drive, or (without `joint`) in all.

    For `duration_s`, or for ever: `stuck_encoder` (6064h and the drive's own watch on it stand
    still, the axis goes on), `blocked` (its brake stays closed while it is powered), `reversed` (it
    turns the other way), `ignores_quick_stop` (RPDOs with a quick stop are not taken),
    `heartbeat_stops`, `watch_asleep` (it holds 1016h and 1400h:05 and does not act on them),
    `clock` (its own clock runs `factor` times as fast, or `ppm` millionths faster: every timer that
    it starts from then on, so its heartbeats, its watches, its ramps; how fast it turns is set by
    its command alone),
    `motor_power_lost` (as by an emergency stop: the drive lives, without power),
    `supply_lost` (it is off the bus and boots when the time is over).
    At once: `reset` (it boots), `fault` and `emergency` with `code`; the latter sends `count`
    messages every `period_s` and changes nothing else.
    """

    kind: Literal[
        "reset",
        "fault",
        "emergency",
        "stuck_encoder",
        "blocked",
        "reversed",
        "ignores_quick_stop",
        "heartbeat_stops",
        "watch_asleep",
        "clock",
        "motor_power_lost",
        "supply_lost",
    ]
    joint: str | None = None
    duration_s: Duration | None = None
    code: Annotated[int, Field(ge=1, le=0xFFFF)] = 0x7305
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    period_s: Duration = 0.001
    factor: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    ppm: Annotated[float, Field(gt=-1e6, le=1e9)] | None = None

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> DriveFault:
        if self.kind in ("reset", "fault", "emergency") and self.duration_s is not None:
            raise ValueError(f"{self.kind} has no duration_s: it happens at once")
        given = [name for name in ("factor", "ppm") if getattr(self, name) is not None]
        if self.kind == "clock" and len(given) != 1:
            raise ValueError("clock needs factor or ppm, one of them")
        if self.kind != "clock" and given:
            raise ValueError(f"{given[0]} belongs to clock, this is {self.kind}")
        return self

    @property
    def clock_rate(self) -> float:
        """How many seconds of its own the drive's clock counts in one."""
        return self.factor if self.factor is not None else 1.0 + 1e-6 * (self.ppm or 0.0)


class ProcessKilled(TimedFault):
    """A process is killed (SIGKILL): the recorder, the cyclic task, or the program itself."""

    kind: Literal["kill"]
    process: Literal["recorder", "task", "program"]


class ProcessFrozen(TimedFault):
    """A process stands still: SIGSTOP, and SIGCONT `duration_s` later by the computer's clock.

    With simulated time that is no fault of the task, whose bus stands still meanwhile; in real time
    it is a computer that is held up.
    """

    kind: Literal["freeze"]
    process: Literal["recorder", "task"]
    duration_s: Duration


class ProgramSignalled(TimedFault):
    """A signal is sent to the program itself, `count` times, `period_s` of its clock apart.

    `TSTP` is what Ctrl-Z sends: where nothing moves it suspends the program.
    """

    kind: Literal["signal"]
    signal: Literal["INT", "TERM", "HUP", "TSTP"]
    count: Annotated[int, Field(ge=1, le=1000)] = 1
    period_s: Duration = 0.02


class DiskFault(TimedFault):
    """What happens to the disk under the recorder, by means of the operating system.

    `disk_error`: the recording cannot grow by more than `after_bytes`; the write beyond fails with
    EFBIG (the recorder's limit on file sizes), which the program answers as it does EIO.
    `disk_full`: the file system of the runs is filled but for `after_bytes`, and further writes
    fail with ENOSPC; only a small file system of its own is filled, anything else is refused.
    `disk_stall`: the recorder stands still for `duration_s`, as in a write that does not return (it
    is stopped from outside, as `freeze` does: no disk is slowed down).
    """

    kind: Literal["disk_full", "disk_error", "disk_stall"]
    after_bytes: Annotated[int, Field(ge=0, le=2**50)] = 0
    duration_s: Duration | None = None

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> DiskFault:
        stalls = self.kind == "disk_stall"
        if stalls and self.duration_s is None:
            raise ValueError("disk_stall needs duration_s")
        if stalls and self.after_bytes:
            raise ValueError("after_bytes belongs to disk_full and disk_error, this is disk_stall")
        if not stalls and self.duration_s is not None:
            raise ValueError(f"{self.kind} has no duration_s: it lasts until the cell has ended")
        return self


class RegisterFault(ConfigModel):
    """What goes wrong with a Modbus request, counted from 0 (`at_request`), or with all (left out).

    `exception` answers with `code`; `late` with the answer to the request before.
    """

    kind: Literal["silent", "late", "short", "wrong_unit", "garbage", "exception"]
    at_request: Annotated[int, Field(ge=0, le=MOST)] | None = None
    code: Annotated[int, Field(ge=1, le=255)] = 4


class AmplifierFault(ConfigModel):
    """What goes wrong on the amplifier's line, or in it, at a row counted from 0.

    `garbage` and `nuls`: `count` random or zero bytes come before the row. `lost_bytes`: `count`
    bytes of the row, in one piece, never arrive. `torn_row`: the row ends in the middle, `gap`: it
    never arrives, `bad_checksum`: one bit of it is flipped; `count` rows in a row. `stall`: nothing
    arrives for `duration_s`, then everything at once. `unplug`: the port is gone for `duration_s`,
    with all that was sent meanwhile; then there is a new one. `overload`: `channel` (0 to 7) feels
    twice its range for `duration_s`. `drift`: it drifts by `count` N/s more for `duration_s`, and
    keeps that. Durations are on the cell's clock.
    """

    kind: Literal[
        "garbage",
        "nuls",
        "lost_bytes",
        "torn_row",
        "gap",
        "bad_checksum",
        "stall",
        "unplug",
        "overload",
        "drift",
    ]
    row: Annotated[int, Field(ge=0, le=MOST)]
    count: Count = 1
    duration_s: Annotated[float, Field(ge=0.0, le=LONGEST_S)] = 0.0
    channel: Annotated[int, Field(ge=0, le=7)] = 0


BusFault = Annotated[
    FrameFault | StrangeFrames | AdapterFault | HeldUp,
    Field(discriminator="kind"),
]


ProgramFault = Annotated[
    ProcessKilled | ProcessFrozen | ProgramSignalled | DiskFault,
    Field(discriminator="kind"),
]


class FaultScript(ConfigModel):
    """What goes wrong in a simulated cell: on its bus, in its drives, on its other lines.

    `program` is what the operating system does to the program that works with a cell which it
    serves itself (`record --faults`); `rid-daq mock` has no such program and refuses it.
    """

    seed: Seed = 0
    bus: tuple[BusFault, ...] = ()
    drives: tuple[DriveFault, ...] = ()
    registers: tuple[RegisterFault, ...] = ()
    amplifier: tuple[AmplifierFault, ...] = ()
    program: tuple[ProgramFault, ...] = ()

    @model_validator(mode="after")
    def _requests_differ(self) -> FaultScript:
        requests = [fault.at_request for fault in self.registers]
        if len(set(requests)) != len(requests):
            raise ValueError("registers: two faults at the same request, or two for all requests")
        codes = {fault.code for fault in self.registers if fault.kind == "exception"}
        if len(codes) > 1:
            raise ValueError("registers: all exceptions of one script have the same code")
        return self

    @property
    def joints(self) -> frozenset[str]:
        """The joints that are named."""
        faults = (*self.bus, *self.drives)
        return frozenset(filter(None, (getattr(fault, "joint", None) for fault in faults)))


NO_SCRIPT = FaultScript()
