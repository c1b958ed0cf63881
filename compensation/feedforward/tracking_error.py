"""`TrackingError`: difference of desired and reached positions, of joints and tool (6.4-6.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import DataQualityError
from dynamics.geometry.kinematics import Chain, forward


@dataclass(frozen=True, eq=False)
class TrackingError:
    """Tracking errors of one run, sample by sample.

    Attributes:
        joint: Shape (samples, n). q_d - q [rad or m].
        distance_m: Shape (samples,). |p_d(i) - p(i)| of the tool point at the same instant (6.4).
        wanted_m, reached_m: Shape (samples, 3). Desired and reached path of the tool point in the
            base frame.
    """

    joint: FloatArray
    distance_m: FloatArray
    wanted_m: FloatArray
    reached_m: FloatArray

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None, None), "joint")
        freeze(self, DataQualityError, (len(self.joint),), "distance_m")
        freeze(self, DataQualityError, (len(self.joint), 3), "wanted_m", "reached_m")

    @property
    def mean_m(self) -> float:
        """Mean distance of the tool point, d_mean (6.5) [m]."""
        return float(self.distance_m.mean())

    @property
    def max_m(self) -> float:
        """Largest distance of the tool point, d_max (6.6) [m]."""
        return float(self.distance_m.max())

    @property
    def joint_peak(self) -> FloatArray:
        """Largest error of each joint [rad or m], shape (n,)."""
        return np.asarray(np.abs(self.joint).max(axis=0))


def tracking_error(chain: Chain, wanted: FloatArray, reached: FloatArray) -> TrackingError:
    """Compare desired with reached positions, both of shape (samples, n)."""
    paths = [forward(chain, positions) for positions in (wanted, reached)]
    return TrackingError(
        joint=wanted - reached,
        distance_m=np.asarray(np.linalg.norm(paths[0] - paths[1], axis=1)),
        wanted_m=paths[0],
        reached_m=paths[1],
    )
