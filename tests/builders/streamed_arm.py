"""A simulated arm that follows a stream of points."""

from __future__ import annotations

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.samples import MotionSamples, Phase
from benchmarks.closed_loop import SETTLE_ROWS, plant_at
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.online.online import OnlineFeedforward
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from config.arrays import FloatArray
from config.load import LoadedCell
from drivers.interfaces.servo_axes import Answers
from dynamics.geometry.kinematics import Chain


def stream_motion(
    cell: LoadedCell,
    forward: OnlineFeedforward,
    samples: MotionSamples,
    *,
    start: FloatArray,
    compensated: bool = True,
) -> TrackingError:
    """Move the arm from a pose to a motion's start, stream the motion, and return its errors.

    A commanded speed acts from the next SYNC on. The online feedforward sees positions one cycle
    late; the position loop does not. Speeds and positions are rounded as the drives round them.
    """
    assert cell.plant is not None
    samples = samples.whole()
    ring = PointRing.create(len(start), len(samples))
    ring.write(np.asarray(samples.position))
    ring.end()
    source = PointSource(forward, ring, compensated=compensated)
    source.prepare()
    way = approach(start, samples.position[0], cell.robot, cell.config.cycle_time_s)
    plant = plant_at(cell, cell.plant, start)
    ratio = np.array([abs(joint.gear_ratio) for joint in cell.robot.joints])
    per_rev = np.array([axis.encoder_increments_per_motor_rev for axis in cell.plant.axes])
    counts = ratio * per_rev / (2.0 * np.pi)
    powered, free = np.ones(len(start), dtype=np.bool_), np.zeros(len(start), dtype=np.bool_)
    counts_now = plant.position_counts()
    measured = counts_now / counts
    source.begin(False, measured)
    before = now = sent = np.zeros(len(start))
    wanted, reached, sent_points = [], [], []
    answers = Answers.initial(len(start))
    row = -SETTLE_ROWS - len(way)
    while True:
        answers.position[:], answers.position_counts[:] = measured, counts_now
        source.watch(answers)
        counts_now = plant.position_counts()
        measured = counts_now / counts
        if row < 0:
            at = max(row, -len(way))
            target, ahead = way.position[at], way.velocity[at]
        else:
            point = source.at(row)
            if point is None:
                break
            target, ahead = np.array(point.position), np.array(point.feedforward)
            wanted.append(target)
            reached.append(measured)
            sent_points.append(point.sample_index)
        speed = cell.config.position_gain_per_s * (target - measured) + ahead
        before, now, sent = now, sent, np.rint(speed * counts) / counts
        plant.advance(cell.config.cycle_time_s, before, now, powered, free)
        row += 1
    main = samples.phase[sent_points] == Phase.MAIN
    chain = Chain.from_description(cell.robot)
    return tracking_error(chain, np.array(wanted)[main], np.array(reached)[main])
