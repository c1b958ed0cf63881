"""A force plate under the bundled arm that never saw the estimators: Pinocchio's reaction forces.

The plate has eight noisy channels with an offset and a drift each, a low-pass, and an amplifier
whose clock is not the bus's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import CubicSpline

from acquisition.clocks import clock_from_arrivals
from acquisition.excitation import FourierTrajectory
from acquisition.force_plate import PlateGeometry
from acquisition.reaction import reaction_of
from acquisition.recording import Recording
from config.load import LoadedCell
from config.motion import FourierMotion
from config.plate import AmplifierConfig, PlateConfig
from mock_hw.rigid_bodies import build_rigid_bodies

Vector = NDArray[np.float64]

STEP_S = 0.0005

PLATE = PlateConfig(
    a_m=0.120,
    b_m=0.200,
    az0_m=-0.054,
    position_m=(0.02, -0.01, 0.03),
    rotation_rad=(0.0, 0.0, 0.4),
    amplifier=AmplifierConfig(
        address="nowhere",
        baud_rate=460_800,
        rate_hz=960.0,
        low_pass_hz=100.0,
        range_n=(1250.0,) * 4 + (5000.0,) * 4,
        sensitivity_pc_n=(-7.5,) * 4 + (-3.8,) * 4,
    ),
)


def base_wrench(cell: LoadedCell, q: Vector, v: Vector, a: Vector) -> Vector:
    """Return what the base exerts on links and rotors, about the base frame's origin."""
    assert cell.plant is not None
    bodies = build_rigid_bodies(cell.robot, cell.plant.without_unmodelled())
    model, data = bodies.model, bodies.model.createData()
    gear = bodies.coupling().T
    wrench = np.zeros((len(q), 6))
    on_base = [i for i in range(1, model.njoints) if model.parents[i] == 0]
    for row, (qf, vf, af) in enumerate(zip(q @ gear, v @ gear, a @ gear, strict=True)):
        pin.rnea(model, data, qf, vf, af)
        for i in on_base:
            wrench[row] += data.liMi[i].act(data.f[i]).vector
    return wrench


@dataclass(frozen=True)
class SimulatedPlate:
    """What a plate and its amplifier do to the wrench; noise is that of one row of a channel."""

    config: PlateConfig = PLATE
    noise_n: float = 0.5
    offset_n: float = 0.0
    drift_n_s: float = 0.0
    clock_ppm: float = 100.0
    clock_offset_s: float = 0.003
    jitter_s: float = 0.005
    delay_s: float = 0.0
    overloaded: tuple[int, ...] = ()

    def weigh(
        self, cell: LoadedCell, motion: FourierMotion, recording: Recording, seed: int = 0
    ) -> Recording:
        """Return a recording of whole periods with what the plate measured of them."""
        assert recording.sample_period_s is not None
        trajectory = FourierTrajectory.from_motion(motion, cell.robot, recording.sample_period_s)
        at = np.arange(0.0, motion.period_s - STEP_S / 2.0, STEP_S)
        wrench = base_wrench(
            cell,
            trajectory.position(at),
            trajectory.velocity(at),
            trajectory.acceleration(at),
        )
        channels = PlateGeometry.from_config(self.config).channels(wrench)
        amplifier = self.config.amplifier
        b, a = signal.butter(
            amplifier.low_pass_order, 2.0 * np.pi * amplifier.low_pass_hz, analog=True
        )
        omega = 2.0 * np.pi * np.fft.rfftfreq(len(at), STEP_S)
        response = signal.freqs(b, a, omega)[1] * np.exp(-1j * omega * self.delay_s)
        passed = np.fft.irfft(np.fft.rfft(channels, axis=0) * response[:, None], len(at), axis=0)
        curve = CubicSpline(
            np.append(at, motion.period_s), np.vstack([passed, passed[:1]]), bc_type="periodic"
        )
        random = np.random.default_rng(1000 + seed)
        duration_s = recording.time_s[-1] - recording.time_s[0]
        rows = int((duration_s + 1.0) * amplifier.rate_hz)
        device = np.arange(rows) / amplifier.rate_hz
        true = -0.5 + device * (1.0 + 1e-6 * self.clock_ppm) + self.clock_offset_s
        readings = curve(np.mod(true, motion.period_s))
        readings += self.noise_n * random.standard_normal(readings.shape)
        readings += self.offset_n * random.uniform(-1.0, 1.0, 8)
        readings += self.drift_n_s * random.uniform(-1.0, 1.0, 8) * true[:, None]
        valid = np.ones(readings.shape, dtype=np.bool_)
        valid[:, list(self.overloaded)] = False
        readings[:, list(self.overloaded)] = 1250.0
        arrival = np.maximum.accumulate(true + self.jitter_s * random.uniform(size=rows))
        clock = clock_from_arrivals(device, recording.time_s[0] + arrival)
        reaction = reaction_of(self.config, clock, device, readings, valid, recording.time_s)
        return replace(recording, reaction=reaction)
