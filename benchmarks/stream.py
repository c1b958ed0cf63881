"""Processor time of the on-line compensation, compared with a Python program with Pinocchio.

The on-line compensation is a compiled part of the cyclic task. It reads points, checks them,
controls the path speed and computes the presliding state, the model's torque and the commanded
speeds. It is measured for six axes with presliding hysteresis, and also without. For comparison, a
Python program with numpy and Pinocchio's `rnea` does the same: five-point differences, limits,
torque, inverse of the velocity loops, look-ahead. Both follow the same path.

The time is also measured with the largest number of loads that can be possible at the same time
(load changes at signals). The time per load and joint must be below the one that `stream` assumes
when it refuses a path with too many possible loads.

Then the load of one core is measured for three axes at 1 kHz. It includes the compensation, the
position loop, the supervisor, and the exchange with drives that another process simulates. The
frames pass the port of SocketCAN, which the limit applies to. The load with a bus of python-can,
which packs every frame into a message, is printed for comparison.

Run it with ``python -m benchmarks.stream [--quick]``.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from acquisition.motion.load_changes import MOST_CHANGES, LoadChange, LoadChanges
from acquisition.motion.load_signal import LoadSignal
from acquisition.supervision.cycle import Cycle, SetPoint
from acquisition.supervision.held_positions import HeldPositions
from acquisition.supervision.supervisor import Supervisor
from acquisition.task.position_loop import PositionLoop
from benchmarks.cyclic_exchange import (
    LocalSocketCanPort,
    SocketBus,
    bare_cycle,
    driver_cycle,
    play_drives,
)
from benchmarks.short_form import is_short
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.load_kernels import load_arrays, stated_times
from compensation.online.load_signals import LoadSignals
from compensation.online.online import LOAD_TIME_S, REST_RAD_S, OnlineFeedforward
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from config.load import LoadedCell, load_cell
from config.robot.robot import RobotDescription
from drivers.interfaces.servo_axes import Answers
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel

GAIN, INTEGRAL_S, DELAY_S = 500.0, 0.1, 5e-4
LARGEST_SHARE = 0.10
LONGEST_US = 10.0
ROUNDS = 50
Points = NDArray[np.float64]


def with_presliding(robot: RobotDescription) -> RobotDescription:
    """Return a robot with presliding hysteresis in every joint."""
    joints = (
        joint.model_copy(update={"friction": (*joint.friction, "presliding")})
        for joint in robot.joints
    )
    return robot.model_copy(update={"joints": tuple(joints)})


def feedforward_of(cell: LoadedCell) -> OnlineFeedforward:
    """Return model and velocity loops for a robot, with plausible invented values."""
    model = RobotModel.from_description(cell.robot)
    parameters = np.random.default_rng(1).uniform(0.01, 0.02, len(model.parameter_names))
    parameters[33:36] = 5e-4
    loops = [
        VelocityLoop(
            joint_name=name,
            gain=GAIN,
            integral_time_s=INTEGRAL_S,
            delay_s=DELAY_S,
            lag_s=0.0,
            names=("gain",),
            covariance=np.zeros((1, 1)),
            p_value=1.0,
            trials=(),
        )
        for name in cell.robot.joint_names
    ]
    torque = SampleTorque.of(model, parameters, least_smoothing_rad_s=REST_RAD_S)
    return OnlineFeedforward.of(cell.config, cell.robot, torque, loops)


def path_of(cell: LoadedCell, count: int) -> Points:
    """Return a smooth joint path from rest, within all limits."""
    n, time_s = len(cell.robot.joints), np.arange(count)[:, np.newaxis] * cell.config.cycle_time_s
    rise = np.clip(time_s, 0.0, 1.0)
    rise = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    limits = [joint.limits for joint in cell.robot.joints]
    middle = np.array([0.5 * (limit.position_min + limit.position_max) for limit in limits])
    return np.asarray(middle + 0.02 * rise * np.sin((2.0 + 0.3 * np.arange(n)) * time_s))


def stage_of(cell: LoadedCell, points: Points) -> Callable[[int], object]:
    """Return the compiled compensation as a function that returns the set-point of a row."""
    ring = PointRing.create(points.shape[1], len(points))
    ring.write(points)
    source = PointSource(feedforward_of(cell), ring)
    source.prepare()
    source.begin(False, np.zeros(points.shape[1]))
    return source.at


def load_us(cell: LoadedCell, points: Points, rows: int) -> float:
    """Return the processor time per cycle, joint and possible load, if signals may come [us]."""
    n, step_s = points.shape[1], cell.config.cycle_time_s
    signal = LoadSignal(
        joint=cell.robot.joint_names[0],
        bit=0,
        debounce_s=0.0,
        early_s=0.0,
        late_s=0.0,
        missed="unloaded",
        outside="report",
    )
    changes = LoadChanges(
        changes=tuple(
            LoadChange(at_s=float(number), payload="none", ramp_s=0.1, signal=signal)
            for number in range(1, MOST_CHANGES + 1)
        )
    )
    forward = feedforward_of(cell)
    begin_s = np.arange(1.0, MOST_CHANGES + 1.0)
    times_s = stated_times(begin_s, np.full(MOST_CHANGES, 0.1))
    loads = load_arrays((forward.torque,) * (MOST_CHANGES + 1), times_s)
    signals = LoadSignals(changes, cell.robot.joint_names, step_s)
    found: list[float] = []
    for each in (forward, replace(forward, loads=loads, signals=signals)):
        ring = PointRing.create(n, len(points))
        ring.write(points)
        source = PointSource(each, ring)
        source.prepare()
        source.begin(False, np.zeros(n))
        found.append(cpu_us(source.at, rows))
    return float((found[1] - found[0]) / (MOST_CHANGES * n))


def pinocchio_peer(cell: LoadedCell, points: Points) -> Callable[[int], object]:
    """Return a function that does the same as `PointSource.at`, in Python with Pinocchio."""
    n, step_s = points.shape[1], cell.config.cycle_time_s
    model = pin.Model()
    for j in range(n):
        placement = pin.SE3(pin.rpy.rpyToMatrix(0.3 * j, 0.1, 0.0), np.array([0.2, 0.0, 0.1]))
        added = model.addJoint(j, pin.JointModelRZ(), placement, f"joint{j}")
        model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
    model.armature = np.full(n, 5.0)
    data = model.createData()
    limits = [joint.limits for joint in cell.robot.joints]
    low, high = (np.array([getattr(x, f"position_{s}") for x in limits]) for s in ("min", "max"))
    speed, bend, most = (
        np.array([getattr(x, name) for x in limits])
        for name in ("velocity", "acceleration", "torque")
    )
    decay = np.exp(-step_s / INTEGRAL_S)
    share = (1.0 - decay) / (step_s / INTEGRAL_S)
    old, new = share - decay, 1.0 - share
    carried, latest = np.zeros(n), np.zeros(n)
    line: list[tuple[Points, Points, Points]] = []
    late = 2 + int(DELAY_S / step_s)
    fraction = DELAY_S / step_s - int(DELAY_S / step_s)

    def at(row: int) -> object:
        nonlocal carried, latest
        k = row + 2
        a2, a1, q, b1, b2 = points[k - 2 : k + 3]
        v = (8.0 * (b1 - a1) - (b2 - a2)) / (12.0 * step_s)
        a = (16.0 * (b1 + a1) - 30.0 * q - (b2 + a2)) / (12.0 * step_s * step_s)
        good = np.isfinite(q).all() and (q >= low).all() and (q <= high).all()
        good = good and (np.abs(v) <= speed).all() and (np.abs(a) <= bend).all()
        torque = pin.rnea(model, data, q, v, a) + 10.0 * np.tanh(v / REST_RAD_S) + 20.0 * v
        torque = np.clip(torque, -most, most)
        carried = decay * carried + old * latest + new * torque
        latest = torque
        error = np.clip((torque - carried) / GAIN, -0.25 * speed, 0.25 * speed)
        line.append((q, v, v + error if good else v))
        if len(line) <= late + 1:
            return None
        own = line.pop(0)
        wanted = (1.0 - fraction) * line[late - 1][2] + fraction * line[late][2]
        ahead = np.clip(own[1] + (wanted - own[1]), -speed, speed)
        return own[0].tolist(), own[1].tolist(), ahead.tolist()

    return at


def cpu_us(at: Callable[[int], object], rows: int) -> float:
    """Return the processor time per cycle, the lowest average of `ROUNDS` rounds [us].

    The rounds are short, so that other programs do not disturb every round.
    """
    rounds, size = [], rows // ROUNDS
    for part in range(ROUNDS):
        began_s = time.process_time()
        for row in range(part * size, (part + 1) * size):
            at(row)
        rounds.append((time.process_time() - began_s) / size * 1e6)
    return min(rounds)


def share_of_core(cycles: int, *, python_can: bool = False) -> tuple[float, float, float]:
    """Return the load of a core at 1 kHz: three axes with bus, compensation, bare frames.

    The bare frames are the system calls and waits that are left without the driver. The frames pass
    the port of SocketCAN, or a minimal bus of python-can.
    """
    cell = load_cell("ir361")
    cell = LoadedCell(
        cell.config.model_copy(update={"cycle_time_ms": 1}), cell.robot, cell.plant, cell.files
    )
    points = path_of(cell, cycles + 10)
    at = stage_of(cell, points)
    loop = PositionLoop.of_cell(cell.config, cell.robot)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    drives = multiprocessing.get_context("spawn").Process(
        target=play_drives, args=(theirs,), daemon=True
    )
    drives.start()
    theirs.close()
    bus = SocketBus(ours) if python_can else LocalSocketCanPort(ours)
    exchange = driver_cycle(bus)
    positions = HeldPositions(cell.config, cell.robot)
    supervisor = Supervisor(cell.config, cell.robot, positions)
    answers = Answers.initial(3)
    answers.position[:] = points[0]
    supervisor.begin(answers)

    def whole(row: int) -> object:
        target = at(row)
        assert isinstance(target, SetPoint)
        position = target.position
        cycle = Cycle(
            number=row,
            periods=1,
            lateness_s=0.0,
            target=target,
            time_s=0.0,
            exchange_s=0.0,
            received=[True] * 3,
            enabled=[True] * 3,
            fault=[False] * 3,
            position=position,
            torque_nm=[0.0] * 3,
            position_counts=[0] * 3,
            torque_raw=[0] * 3,
            statusword=[0] * 3,
            events=(),
            late_frames=0,
            second_answers=[0] * 3,
        )
        positions.take(cycle)
        cycle.command = loop.velocity_command(position, target.feedforward, position)
        stop = supervisor.judge(cycle)
        assert stop is None, stop
        exchange()
        return None

    bare = bare_cycle(ours)
    value, frames = cpu_us(whole, cycles), cpu_us(lambda _: bare(), cycles)
    bus.shutdown()
    ours.close()
    drives.join(10.0)
    alone = cpu_us(stage_of(cell, points), cycles)
    return value * 1e-3, alone * 1e-3, frames * 1e-3


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = is_short(__doc__)
    rows = 5_000 if quick else 40_000
    cell = load_cell("kr15")
    # The Python program has no coupled wrist.
    cell = replace(cell, robot=cell.robot.model_copy(update={"coupling": None}))
    points = path_of(cell, rows + 10)
    plain, peer = stage_of(cell, points), pinocchio_peer(cell, points)
    stage = stage_of(replace(cell, robot=with_presliding(cell.robot)), points)
    gc.collect()
    gc.freeze()
    gc.disable()
    value, without, theirs = cpu_us(stage, rows), cpu_us(plain, rows), cpu_us(peer, rows)
    one_load = load_us(cell, points, rows)
    cycles = 2_000 if quick else 10_000
    share, alone, frames = share_of_core(cycles)
    foreign = share_of_core(cycles, python_can=True)[0]
    print(f"six axes: {value:.1f} us a cycle, {1e6 / value:.0f} cycles a second")
    print(f"the same without presliding: {without:.1f} us; limit {LONGEST_US:g} us")
    print(f"a possible load: {one_load:.3f} us a joint; limit {1e6 * LOAD_TIME_S:g} us")
    print(f"Pinocchio in Python: {theirs:.1f} us a cycle")
    print(f"three axes at 1 kHz with bus: {share:.1%} of a core, compensation alone {alone:.1%}")
    print(f"the same with a bus of python-can: {foreign:.1%}; bare frames: {frames:.1%} of a core")
    holds = share <= LARGEST_SHARE and value < theirs and value <= LONGEST_US
    holds = holds and one_load <= 1e6 * LOAD_TIME_S
    result = {
        "name": "stream",
        "value": round(value, 2),
        "unit": "us CPU per cycle of six axes with presliding hysteresis",
        "ratios": {
            "limit of 10 us": round(LONGEST_US / value, 2),
            "time with presliding / time without": round(value / without, 2),
            "Pinocchio loop in Python": round(theirs / value, 2),
            "us per possible load and joint": round(one_load, 3),
            "cycles per second": round(1e6 / value),
            "fraction of a core, three axes at 1 kHz with bus": round(share, 4),
            "fraction of a core, three axes at 1 kHz with python-can": round(foreign, 4),
            "fraction of a core, bare frames": round(frames, 4),
            "fraction of a core, compensation alone": round(alone, 4),
        },
        "bar": f"at most {LONGEST_US:g} us, faster than the peer, and at most"
        f" {LARGEST_SHARE:.0%} of a core at 1 kHz",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
