"""`DriveRegisters`: values in the simulated drives' registers: nameplate data and temperatures."""

from __future__ import annotations

from collections.abc import Mapping

from config.cell.cell import CellConfig
from config.cell.drive_profile import Quantity
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from drivers.modbus.codec import encode
from mock_hw.plant.snapshot import SnapshotReader
from mock_hw.registers.server import RegisterSettings


class DriveRegisters:
    """Values in the registers of a simulated cell's drives.

    A drive stores the torque constant on its motor's nameplate, which is valid at the reference
    temperature.

    Args:
        cell: The cell.
        robot: Description of the robot.
        plant: True parameters of the robot.
        settings: Settings with the register profile, and the unit number of each drive.
        snapshots: Source of the motors' temperatures.
    """

    def __init__(
        self,
        cell: CellConfig,
        robot: RobotDescription,
        plant: PlantConfig,
        settings: RegisterSettings,
        snapshots: SnapshotReader,
    ) -> None:
        self._profile = settings.profile
        self._snapshots = snapshots
        self._axis_of: dict[int, int] = {}
        self._plates: list[dict[Quantity, float]] = []
        self._start_s = snapshots.read().time_s
        joints = {joint.name: number for number, joint in enumerate(robot.joints)}
        for axis, unit in zip(cell.axes, settings.monitor.units, strict=True):
            self._axis_of[unit] = joints[axis.joint]
        for joint, simulated in zip(robot.joints, plant.axes, strict=True):
            constant = joint.torque_constant_nm_per_a or 1.0
            motor = constant / abs(joint.gear_ratio)
            rated = simulated.rated_motor_torque_nm
            self._plates.append(
                {
                    "torque_constant_nm_per_a": motor,
                    "torque_constant_per_k": joint.torque_constant_per_k,
                    "reference_temperature_k": joint.reference_temperature_k,
                    "rated_torque_nm": rated,
                    "rated_current_a": rated / motor,
                    "rotor_inertia_kg_m2": simulated.rotor_inertia_kg_m2,
                }
            )

    def __call__(self, unit: int) -> Mapping[int, int] | None:
        """Return a unit's registers by address; None if there is no such drive."""
        axis = self._axis_of.get(unit)
        if axis is None:
            return None
        snapshot = self._snapshots.read()
        values: dict[Quantity, float] = {
            **self._plates[axis],
            "motor_temperature_k": float(snapshot.temperature_k[axis]),
            "operating_time_s": max(0.0, snapshot.time_s - self._start_s),
        }
        return encode(self._profile, values)
