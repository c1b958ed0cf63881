"""A recording in pieces gives the same condensed equations as the whole recording."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from acquisition.signals import splines
from config import arrays, column_file
from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel, torque
from identification.equations import parallel_filter, time_domain
from identification.equations.time_domain import time_blocks, time_runs
from identification.model.base_parameters import base_parameters
from identification.model.torque_columns import torque_structure
from identification.regression.least_squares import Triangle
from tests.builders.presliding_arm import arm

EXACT = 1e-12
STEP_S = 0.002
ROWS = 6000
BAND_HZ = 10.0
STANDSTILL_RAD_S = 0.02


def recording() -> Recording:
    """Return a recording with jitter of its stamps and a gap."""
    random = np.random.default_rng(4)
    time_s = STEP_S * (np.arange(ROWS) + random.uniform(-0.2, 0.2, ROWS))
    time_s[2 * ROWS // 3 :] += 0.5
    omega = 2.0 * np.pi * random.uniform(0.2, 1.0, 3)
    q = np.sin(np.outer(time_s, omega))
    v = omega * np.cos(np.outer(time_s, omega))
    model = RobotModel.from_description(arm())
    values = random.uniform(0.5, 1.0, len(model.parameter_names))
    return Recording(
        joint_names=arm().joint_names,
        time_s=time_s,
        position=q + 1e-6 * random.normal(size=q.shape),
        torque_nm=torque(model, q, v, -(omega**2) * q, values),
        valid=np.ones(ROWS, dtype=np.bool_),
        phase=np.full(ROWS, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(ROWS, -1, dtype=np.int64),
        source="import",
    )


def condensed() -> list[FloatArray]:
    """Return the normal equations of each joint, right-hand side included."""
    model = RobotModel.from_description(arm())
    base = base_parameters(model)
    signals = [smooth_nonperiodic(recording(), BAND_HZ)]
    structure = torque_structure(model, base, False)
    triangles = [Triangle.empty(len(base), columns) for columns in structure]
    for block in time_blocks(model, base, time_runs(model, signals, [False]), STANDSTILL_RAD_S):
        rows = np.arange(len(block.rhs))
        for j, columns in enumerate(structure):
            triangles[j] = triangles[j].add(*block.of_joint(j, rows, columns))
    return [np.asarray(triangle.factor.T @ triangle.factor) for triangle in triangles]


def test_pieces_give_the_condensed_equations_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (arrays, column_file, parallel_filter):
        monkeypatch.setattr(module, "PIECE_ROWS", 2 * ROWS)
    monkeypatch.setattr(splines, "_PIECE_ROWS", 2 * ROWS)
    monkeypatch.setattr(time_domain, "BLOCK_ROWS", 2 * ROWS)
    whole = condensed()
    for module in (arrays, column_file, parallel_filter):
        monkeypatch.setattr(module, "PIECE_ROWS", 333)
    monkeypatch.setattr(column_file, "MEMORY_BYTES", 0)
    monkeypatch.setattr(splines, "_PIECE_ROWS", 500)
    monkeypatch.setattr(time_domain, "BLOCK_ROWS", 600)  # a multiple of the stride
    for piecewise, expected in zip(condensed(), whole, strict=True):
        size = np.sqrt(np.diagonal(expected))
        scale = np.outer(size, size)
        assert np.abs((piecewise - expected) / np.where(scale > 0.0, scale, 1.0)).max() < EXACT
