"""Torque residuals identify the true times although the model's friction law is too simple."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.clock.torque_test import torque_gain
from benchmarks.logged_robots import Arm, Logged, log_motion
from config.arrays import FloatArray


class BendingArm(Arm):
    """Arm with friction that is nonlinear in speed, Stribeck-shaped and load-dependent."""

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        plain = super().torque(q, v, a)
        rigid = plain - self.rotor * a - self.coulomb * np.sign(v) - self.viscous * v
        falling = 0.8 * self.coulomb * np.exp(-np.abs(v) / 0.15)
        bending = self.viscous * (0.8 * np.cbrt(v) - v)
        return np.asarray(plain + np.sign(v) * (falling + 0.09 * np.abs(rigid)) + bending)


def arm_and_recording(kind: str) -> tuple[Arm, Logged]:
    arm = Arm.of(3, 961)
    bending = BendingArm(arm.robot, arm.model, arm.coulomb, arm.viscous, arm.rotor)
    (found,) = log_motion(bending, kind, 12.0, 961, ("stamps jitter by 2.5 ms",))
    return bending, found


@pytest.mark.parametrize("kind", ["sines", "points"])
def test_the_true_times_halve_the_error_of_held_out_torques(kind: str) -> None:
    arm, found = arm_and_recording(kind)
    gain = torque_gain(arm.robot, found.samples, found.true_s, None)
    assert gain is not None
    assert gain[0] > 0.6
    assert gain[0] > 8.0 * gain[1]
