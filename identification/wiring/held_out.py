"""`held_out_share`: residual torque on parts of a recording that were not used for the fit.

The parameters of a wrong robot can follow the torques of the fitted parts, but not of other parts.
A recording is divided into fifths of its motion, and each is predicted from the others. For a right
model, except for friction, the held-out residual is about as large as the fitted one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.model.robot_model import regressor
from identification.model.base_parameters import base_parameters
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import FEWEST_ROWS, RIDGE, plain_model, rows_used

PARTS: Final = 5
GROWN: Final = 1.3


def held_out_share(signals: WiredSignals) -> FloatArray:
    """Return each joint's residual on held-out parts of the motion, relative to its torque.

    The model is simple: rigid bodies, rotors, Coulomb and viscous friction, an offset.

    Args:
        signals: Motion and torques.

    Returns:
        Shape (n,). RMS residual over RMS torque; zero if it is hardly larger than on the fitted
        parts, and for joints at rest.
    """
    model = plain_model(signals)
    columns = base_parameters(model).columns(regressor(model, *signals.joints()))
    size = np.sqrt(np.mean(np.square(signals.torque_nm), axis=0))
    used = rows_used(signals) & (size > 0.0)
    used &= used.sum(axis=0) >= FEWEST_ROWS
    if not used.any():
        return np.zeros(len(size))
    scaled = columns / np.where(size > 0.0, size, 1.0)[:, np.newaxis]
    torque = signals.torque_nm / np.where(size > 0.0, size, 1.0)
    equations = _Equations(scaled, torque, used)
    whole = equations.products(np.ones(len(torque), dtype=np.bool_))
    fitted = torque - scaled @ equations.solve(*whole)
    left = np.zeros_like(torque)
    for predicted, out in _parts(signals):
        without = (every - own for every, own in zip(whole, equations.products(out), strict=True))
        values = equations.solve(*without)
        left[predicted] = torque[predicted] - scaled[predicted] @ values
    inside, outside = (_rms(each, used) for each in (fitted, left))
    return np.where(outside >= GROWN * inside, outside, 0.0)


class _Equations:
    """Torque equations of all joints, from which the normal equations of some rows are computed."""

    def __init__(self, columns: FloatArray, torque: FloatArray, used: BoolArray) -> None:
        self._columns, self._torque, self._used = columns, torque, used

    def products(self, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return A^T A and A^T y of some rows, for all joints together."""
        pick = self._used & rows[:, np.newaxis]
        matrix, rhs = self._columns[pick], self._torque[pick]
        return matrix.T @ matrix, matrix.T @ rhs

    def solve(self, gram: FloatArray, rhs: FloatArray) -> FloatArray:
        """Return the least-squares parameters."""
        scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        scaled = gram / scale / scale[:, np.newaxis] + RIDGE * np.eye(len(scale))
        factor = cho_factor(scaled, check_finite=False)
        return np.asarray(cho_solve(factor, rhs / scale, check_finite=False) / scale)


def _parts(signals: WiredSignals) -> list[tuple[IntArray, BoolArray]]:
    """Return for each part the rows that are predicted, and the rows that are left out of the fit.

    A part is an interval of time. Together with it, all other rows with similar positions and
    velocities are left out of the fit. Otherwise a part could be predicted from a repetition of its
    motion.
    """
    moving = signals.moving
    parts = (signals.position[:, moving], signals.velocity[:, moving])
    states = np.hstack([part / np.maximum(part.std(axis=0), 1e-12) for part in parts])
    steps = np.linalg.norm(np.diff(states, axis=0), axis=1)
    near = float(np.median(steps))
    rows = len(states)
    open_, found = np.ones(rows, dtype=np.bool_), []
    while open_.any():
        out, row = np.zeros(rows, dtype=np.bool_), int(np.argmax(open_))
        while row < rows and PARTS * np.sum(out) < rows:
            out |= np.linalg.norm(states - states[row], axis=1) <= near
            row += 1
        found.append((np.flatnonzero(out & open_), out))
        open_ &= ~out
    return found


def _rms(residual: FloatArray, used: BoolArray) -> FloatArray:
    power = np.sum(np.square(residual), axis=0, where=used)
    return np.asarray(np.sqrt(power / np.maximum(used.sum(axis=0), 1)))
