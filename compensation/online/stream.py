"""Streaming: a path from a planned motion, an iterator or another program, compensated on line."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.samples import MotionSamples
from acquisition.session.outcome import RecordOutcome
from acquisition.task.set_points import SetPointSource
from compensation.online.online import OnlineFeedforward
from compensation.online.patience import BUFFER_S, CLIENT_PATIENCE_S
from compensation.online.point_feed import PointFeed, PointGate, wait_for_points
from compensation.online.point_ring import PointRing
from compensation.online.point_server import PointServer, PointService
from compensation.online.point_source import PointSource, buffer_points, compile_stage
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError, DeviceTimeoutError, PreflightError, TransportError
from config.ranges import BufferS, PatienceS, Ranged

Record = Callable[[SetPointSource], RecordOutcome]


@dataclass(frozen=True)
class StreamSettings(Ranged):
    """Options of a streamed path.

    Attributes:
        compensated: False for plain velocity feedforward.
        buffer_s: Length of the path that is read ahead [s].
        patience_s: Time to wait for the first points [s].
    """

    compensated: bool = True
    buffer_s: BufferS = BUFFER_S
    patience_s: PatienceS = CLIENT_PATIENCE_S


def stream_motion(
    cell: CellConfig,
    feedforward: OnlineFeedforward,
    samples: MotionSamples,
    record: Record,
    options: StreamSettings | None = None,
) -> RecordOutcome:
    """Stream a planned motion's positions; its phases and periods are kept.

    Args:
        cell: The cell, with cycle time and workspace.
        feedforward: Model, velocity loops and limits.
        record: Function that drives and records a source: `record_motion` with its other arguments.
        options: Options of the stream.

    Raises:
        ConfigError: The motion has another cycle time than the cell.
        PreflightError: The motion comes too close to a body; nothing was moved.
        RidDaqError: Any other error of `record_motion`.
    """
    options, samples = options or StreamSettings(), samples.whole()
    if samples.sample_period_s != cell.cycle_time_s:
        raise ConfigError(
            f"the motion has a row every {samples.sample_period_s * 1000.0:g} ms, the cell's"
            f" cycle takes {cell.cycle_time_ms} ms: plan the motion for this cell",
            code="RID-MOTION-CYCLE",
        )
    gate = PointGate(cell, feedforward.robot)
    gate.check(samples.position)
    compile_stage(feedforward)
    ring = PointRing.create(len(samples.joint_names), len(samples))
    ring.write(samples.position)
    ring.end()
    return record(
        PointSource(
            feedforward,
            ring,
            compensated=options.compensated,
            phase=samples.phase,
            samples_per_period=samples.samples_per_period,
            buffer_s=options.buffer_s,
        )
    )


def stream_points(
    cell: CellConfig,
    feedforward: OnlineFeedforward,
    points: Iterable[FloatArray],
    record: Record,
    options: StreamSettings | None = None,
) -> RecordOutcome:
    """Stream the points of an iterator, one or several at a time; each cycle uses one point.

    The iterator runs in a thread of this process. It must yield more points whenever the ring has
    room. When the iterator ends, the path ends. If the iterator raises an error or is too slow, the
    robot stops on the path.

    Args:
        cell: The cell, with cycle time and workspace.
        feedforward: Model, velocity loops and limits.
        points: Joint positions, shape (joints,) or (any, joints) [rad or m], from rest to rest.
        record: Function that drives and records a source: `record_motion` with its other arguments.
        options: Options of the stream.

    Raises:
        ConfigError: The iterator fails before the first point, or the buffer is too long.
        RidDaqError: Any other error of `record_motion`.
    """
    options = options or StreamSettings()
    ring = _ring(cell, feedforward, options)
    gate = PointGate(cell, feedforward.robot)
    with PointFeed(ring, gate, points) as thread:
        thread.wait(ring.capacity, options.patience_s)
        return _record(feedforward, ring, record, options)


def stream_socket(
    cell: CellConfig,
    feedforward: OnlineFeedforward,
    path: Path,
    record: Record,
    options: StreamSettings | None = None,
    on_listening: Callable[[], None] = lambda: None,
) -> RecordOutcome:
    """Stream the points that another program sends to a socket.

    Args:
        cell: The cell, with cycle time and workspace.
        feedforward: Model, velocity loops and limits.
        path: Path of the socket, in a folder of the user.
        record: Function that drives and records a source: `record_motion` with its other arguments.
        options: Options of the stream.
        on_listening: Called once clients can connect.

    Raises:
        TransportError: The socket cannot be made.
        DeviceTimeoutError: No client sends points in time.
        RidDaqError: Any other error of `record_motion`.
    """
    options = options or StreamSettings()
    ring = _ring(cell, feedforward, options)
    buffer = buffer_points(options.buffer_s, cell.cycle_time_s)
    service = PointService(cell, feedforward.robot, buffer)
    with PointServer(path, ring, service) as server:
        on_listening()
        arrived = wait_for_points(ring, ring.capacity, options.patience_s, lambda: server.dead)
        server.watch()
        if ring.written == 0:
            if not arrived and not ring.failure:
                raise DeviceTimeoutError(
                    f"{path}: no client sent points within {options.patience_s:g} s; nothing was"
                    " moved",
                    code="RID-STREAM-CLIENT",
                )
            raise TransportError(
                f"{path}: {ring.failure or 'no points arrived'}; nothing was moved",
                code="RID-STREAM-CLIENT",
            )
        return _record(feedforward, ring, record, options)


def _ring(cell: CellConfig, feedforward: OnlineFeedforward, options: StreamSettings) -> PointRing:
    compile_stage(feedforward)
    joints = len(feedforward.robot.joints)
    return PointRing.create(joints, buffer_points(options.buffer_s, cell.cycle_time_s) // 2)


def _record(
    feedforward: OnlineFeedforward, ring: PointRing, record: Record, options: StreamSettings
) -> RecordOutcome:
    source = PointSource(
        feedforward, ring, compensated=options.compensated, buffer_s=options.buffer_s
    )
    try:
        outcome = record(source)
    except (ConfigError, PreflightError) as error:
        ring.conclude(str(error))
        raise
    ring.conclude("" if outcome.stop is None else outcome.stop.text)
    return outcome
