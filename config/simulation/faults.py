"""`FaultScript`: the faults of a simulated cell, with their time and number.

All random numbers come from `seed`. A fault of the bus, a drive or the program begins at once, or
when one of these keys says:
- `at_s`: time since the start of the cell.
- `at_cycle`: number of SYNCs since the drives were last commanded to be enabled.
- `at_frame`, on the bus: number of the frame, from 1, among those that the fault concerns.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.ranges import Seed
from config.simulation.timed_fault import LONGEST_S, MOST, Count, Duration, TimedFault

Probability = Annotated[float, Field(gt=0.0, le=1.0)]
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


class FrameFault(TimedFault):
    """A fault of frames on the CAN bus.

    From the start of the fault on, each frame of the kind is affected with `probability`, until
    `count` frames have been affected. Without `count` one frame is affected; with `lasting` or a
    probability below 1 there is no end.

    Attributes:
        kind: `drop`: the frame never arrives. `duplicate`: it comes twice. `delay`: it comes
            `delay_s` later and delays no other frame. `reorder`: it comes after the next frame of
            the same identifier. `corrupt`: one bit is flipped. `wrong_length`: it has `length`
            bytes. `spoof`: another node answers before the drive, with its identifier and changed
            data.
        frames: Kind of the frames. `answer` is a drive's TPDO 1, `command` its RPDO 1.
        joint: Joint of the drive whose frames are affected; without it, the frames of all drives.
        at_frame: Number of the first frame of this kind that is affected.
        probability: Probability with which each frame is affected.
        count: Number of frames that are affected.
        lasting: True if every frame is affected from the start on.
        delay_s: Delay of `delay` [s].
        bit: Flipped bit of `corrupt`; without it, a random one.
        length: Number of bytes of `wrong_length`.
        position_counts: Amount that `spoof` adds to the position.
        torque_permille: Amount that `spoof` adds to the torque.
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
    def _check_keys(self) -> FrameFault:
        if self.at_frame is not None and (self.at_s, self.at_cycle) != (None, None):
            raise ValueError("only one of at_frame, at_cycle and at_s is allowed")
        needed = {"delay": ("delay_s", self.delay_s), "wrong_length": ("length", self.length)}
        for kind, (name, value) in needed.items():
            if self.kind == kind and value is None:
                raise ValueError(f"{kind} needs {name}")
            if self.kind != kind and value is not None:
                raise ValueError(f"{name} is for {kind} only, this is {self.kind}; remove it")
        if self.bit is not None and self.kind != "corrupt":
            raise ValueError(f"bit is for corrupt only, this is {self.kind}; remove it")
        adds = bool(self.position_counts or self.torque_permille)
        if adds != (self.kind == "spoof"):
            raise ValueError("spoof, and no other kind, needs position_counts or torque_permille")
        if self.kind == "spoof" and self.frames != "answer":
            raise ValueError(f"spoof needs frames: answer, not {self.frames}")
        if self.lasting and self.count is not None:
            raise ValueError("count and lasting are both given; remove one")
        return self

    @property
    def most(self) -> int | None:
        """Number of frames that are affected; None for no limit."""
        if self.count is not None:
            return self.count
        return None if self.lasting or self.probability < 1.0 else 1


class StrangeFrames(TimedFault):
    """Frames that no node of the cell sends.

    With an identifier below 80h and a period shorter than a frame takes, this is a babbling node
    that blocks the bus for all others.

    Attributes:
        kind: Kind of fault.
        identifier: Identifier of the frames.
        length: Number of data bytes of a frame.
        count: Number of frames.
        period_s: Time from one frame to the next [s].
    """

    kind: Literal["strange"]
    identifier: Identifier
    length: Annotated[int, Field(ge=0, le=8)] = 8
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    period_s: Duration = 0.001


class AdapterFault(TimedFault):
    """A fault of the computer's CAN adapter.

    Attributes:
        kind: `bus_off`: the adapter reports bus-off once, and receives and sends nothing.
            `unplugged`: it is removed and cannot be opened. `no_acknowledge`: it receives nothing,
            and no node acknowledges its frames; they wait in its queue and are sent after the
            fault.
        duration_s: Duration of the fault.
        queue: Number of frames that wait at `no_acknowledge`; further ones are lost.
    """

    kind: Literal["bus_off", "unplugged", "no_acknowledge"]
    duration_s: Duration
    queue: Annotated[int, Field(ge=0, le=1000)] = 10


class TaskDelay(TimedFault):
    """A stalled computer: the cyclic task wakes up late.

    This works in lock-step only; in real time the computer's own clock wakes the task.

    Attributes:
        kind: Kind of fault.
        duration_s: Delay of each wake-up.
        count: Number of consecutive wake-ups.
    """

    kind: Literal["held_up"]
    duration_s: Duration
    count: Count = 1


class DriveFault(TimedFault):
    """A fault of one drive, or of all.

    Attributes:
        kind: These faults last for `duration_s`, or without end. `stuck_encoder`: 6064h, and the
            value that the drive itself supervises, stop changing while the axis moves. `blocked`:
            the brake stays closed while the drive is powered. `reversed`: the axis turns the other
            way. `ignores_quick_stop`: RPDOs with a quick stop are ignored. `heartbeat_stops`: the
            drive sends no heartbeat. `watch_asleep`: the drive stores 1016h and 1400h:05 but does
            not act on them. `clock`: the drive's own clock runs at another speed. This affects
            every timer that the drive starts from then on (heartbeats, watches, ramps), but not the
            axis's speed, which only the command determines. `motor_power_lost`: the motor loses its
            power, as by an emergency stop; the electronics run on. `supply_lost`: the drive is off
            the bus, and boots after `duration_s`. At once: `reset` (the drive boots), `fault` (it
            detects an internal fault), `emergency` (it sends messages that change nothing else).
        joint: The drive's joint; without it, all drives.
        duration_s: Duration of the fault.
        code: Error code of `fault` and `emergency`.
        count: Number of messages of `emergency`.
        period_s: Time from one message of `emergency` to the next [s].
        factor: Speed of `clock` relative to real time; give this or `ppm`.
        ppm: Error of the speed of `clock` relative to real time [10⁻⁶]; positive if it runs fast.
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
    def _check_keys(self) -> DriveFault:
        if self.kind in ("reset", "fault", "emergency") and self.duration_s is not None:
            raise ValueError(f"{self.kind} happens at once; remove duration_s")
        given = [name for name in ("factor", "ppm") if getattr(self, name) is not None]
        if self.kind == "clock" and len(given) != 1:
            raise ValueError("clock needs either factor or ppm")
        if self.kind != "clock" and given:
            raise ValueError(f"{given[0]} is for clock only, this is {self.kind}; remove it")
        return self

    @property
    def clock_rate(self) -> float:
        """Speed of the drive's clock relative to real time."""
        return self.factor if self.factor is not None else 1.0 + 1e-6 * (self.ppm or 0.0)


class ProcessKill(TimedFault):
    """A process is killed (SIGKILL).

    Attributes:
        kind: Kind of fault.
        process: The recorder, the cyclic task, or the program itself.
    """

    kind: Literal["kill"]
    process: Literal["recorder", "task", "program"]


class ProcessFreeze(TimedFault):
    """A process is suspended by SIGSTOP, and continued by SIGCONT.

    In simulated time this does not disturb the task, because its bus is suspended too; in real time
    it acts like a stalled computer.

    Attributes:
        kind: Kind of fault.
        process: The recorder, or the cyclic task.
        duration_s: Duration by the computer's clock.
    """

    kind: Literal["freeze"]
    process: Literal["recorder", "task"]
    duration_s: Duration


class ProgramSignal(TimedFault):
    """A signal is sent to the program itself.

    Attributes:
        kind: Kind of fault.
        signal: `TSTP` is what Ctrl-Z sends: it suspends the program if nothing moves.
        count: Number of signals.
        period_s: Time from one signal to the next, on the program's clock [s].
    """

    kind: Literal["signal"]
    signal: Literal["INT", "TERM", "HUP", "TSTP"]
    count: Annotated[int, Field(ge=1, le=1000)] = 1
    period_s: Duration = 0.02


class DiskFault(TimedFault):
    """A fault of the recorder's disk, produced by means of the operating system.

    Attributes:
        kind: `disk_error`: the recording cannot grow by more than `after_bytes`; further writes
            fail with EFBIG (the recorder's limit on file sizes), which the program handles as it
            does EIO. `disk_full`: the file system of the runs is filled except for `after_bytes`,
            and further writes fail with ENOSPC. Only a small separate file system is filled; any
            other is refused. `disk_stall`: the recorder is suspended for `duration_s`, as in a
            write that does not return.
        after_bytes: Number of bytes that can still be written before `disk_error` or `disk_full`.
        duration_s: Duration of `disk_stall` [s].
    """

    kind: Literal["disk_full", "disk_error", "disk_stall"]
    after_bytes: Annotated[int, Field(ge=0, le=2**50)] = 0
    duration_s: Duration | None = None

    @model_validator(mode="after")
    def _check_keys(self) -> DiskFault:
        stalls = self.kind == "disk_stall"
        if stalls and self.duration_s is None:
            raise ValueError("disk_stall needs duration_s")
        if stalls and self.after_bytes:
            raise ValueError("after_bytes is for disk_full and disk_error only; remove it")
        if not stalls and self.duration_s is not None:
            raise ValueError(f"{self.kind} lasts until the cell ends; remove duration_s")
        return self


class RegisterFault(ConfigModel):
    """A fault of a Modbus request.

    Attributes:
        kind: `silent`: there is no answer. `late`: the answer comes before that to the next
            request. `short`: the answer lacks one register. `wrong_unit`: another unit's number is
            in the answer. `garbage`: each byte of the answer is changed. `exception`: the answer is
            the exception `code`.
        at_request: Number of the request, from 0; without it, all requests.
        code: Exception code.
    """

    kind: Literal["silent", "late", "short", "wrong_unit", "garbage", "exception"]
    at_request: Annotated[int, Field(ge=0, le=MOST)] | None = None
    code: Annotated[int, Field(ge=1, le=255)] = 4


class AmplifierFault(ConfigModel):
    """A fault of the amplifier or its line.

    Attributes:
        kind: `garbage`, `nuls`: `count` random or zero bytes come before the row. `lost_bytes`:
            `count` consecutive bytes of the row never arrive. `torn_row`: `count` consecutive rows
            end in the middle. `gap`: `count` rows never arrive. `bad_checksum`: `count` rows have a
            flipped bit. `stall`: nothing arrives for `duration_s`, then everything at once.
            `unplug`: the port is gone for `duration_s`, and all that was sent meanwhile is lost;
            then there is a new port. `overload`: a channel gets twice its range for `duration_s`.
            `drift`: the drift grows by `count` N/s for `duration_s`; the accumulated offset stays.
            `reset`: the amplifier goes into reset, as after a failure of its supply.
        row: Number of the row at which the fault begins, from 0.
        count: Number of bytes or rows of the fault; for `drift`, the growth of the drift [N/s].
        duration_s: Duration of the fault on the cell's clock [s].
        channel: Channel that `overload` or `drift` affects, from 0.
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
        "reset",
    ]
    row: Annotated[int, Field(ge=0, le=MOST)]
    count: Count = 1
    duration_s: Annotated[float, Field(ge=0.0, le=LONGEST_S)] = 0.0
    channel: Annotated[int, Field(ge=0, le=7)] = 0


BusFault = Annotated[
    FrameFault | StrangeFrames | AdapterFault | TaskDelay, Field(discriminator="kind")
]
ProgramFault = Annotated[
    ProcessKill | ProcessFreeze | ProgramSignal | DiskFault, Field(discriminator="kind")
]


class FaultScript(ConfigModel):
    """The faults of a simulated cell.

    Attributes:
        seed: Random seed of the faults.
        bus: Faults of frames, of the adapter and of the computer.
        drives: Faults of drives.
        registers: Faults of Modbus requests.
        amplifier: Faults of the force plate's amplifier.
        program: Faults that the operating system causes in a program that starts the cell itself
            (`record --faults`); `rid-daq mock` has no such program and refuses them.
    """

    seed: Seed = 0
    bus: tuple[BusFault, ...] = ()
    drives: tuple[DriveFault, ...] = ()
    registers: tuple[RegisterFault, ...] = ()
    amplifier: tuple[AmplifierFault, ...] = ()
    program: tuple[ProgramFault, ...] = ()

    @model_validator(mode="after")
    def _check_requests(self) -> FaultScript:
        requests = [fault.at_request for fault in self.registers]
        if len(set(requests)) != len(requests):
            raise ValueError("registers has two faults for the same request or for all; remove one")
        codes = {fault.code for fault in self.registers if fault.kind == "exception"}
        if len(codes) > 1:
            raise ValueError("registers has exceptions with different codes; use one code")
        return self

    @property
    def joints(self) -> frozenset[str]:
        """The joints that the script names."""
        faults = (*self.bus, *self.drives)
        return frozenset(filter(None, (getattr(fault, "joint", None) for fault in faults)))


NO_SCRIPT = FaultScript()
