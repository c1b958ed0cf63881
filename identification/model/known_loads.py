"""`KnownLoads`: bodies of known mass that a robot carried in some runs, on any of its links.

A body that is fixed to link j adds its ten parameters to those of the link (thesis, equation 5.6).
The base parameters of a run with bodies are therefore beta + K theta, in which K is the matrix of
the base parameters (`BaseParameters.combination`) and theta contains the bodies. Subtracting the
regressor times K theta from the measured values leaves the equations of the robot alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from config.arrays import FloatArray
from config.errors import ConfigError, EstimationError
from config.load import load_bundled_or_path
from config.model import ConfigModel
from config.plausible import PhysicalFile, Plausible
from config.quantities import NonNegative
from config.robot.robot import RobotDescription
from config.simulation.plant import MountedBody
from dynamics.model.cad import about_origin
from dynamics.model.robot_model import RobotModel
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.model.base_parameters import BaseParameters


class KnownBody(MountedBody):
    """A body whose parameters are known, such as a weighed disc.

    Attributes:
        link: Number of the link that carries the body; 1 is the link that the first joint moves.
        mass_kg: Mass.
        mass_sigma_kg: Standard deviation of the mass.
        centre_m: Centre of gravity in the frame of the link.
        inertia_kg_m2: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity, in the axes of that
            frame.
    """

    link: Annotated[int, Field(ge=1)]
    mass_sigma_kg: Annotated[NonNegative, Plausible(0.0, 100.0, "kg")] = 0.0

    @model_validator(mode="after")
    def _check_sigma(self) -> Self:
        if self.mass_sigma_kg >= self.mass_kg:
            raise ValueError(
                f"mass_sigma_kg is {self.mass_sigma_kg:g} kg for a mass of {self.mass_kg:g} kg, so"
                " the mass is not known; give the scale's standard deviation in kg"
            )
        return self

    @property
    def parameters(self) -> FloatArray:
        """The ten parameters about the origin of the link's frame, shape (10,)."""
        xx, yy, zz, xy, xz, yz = self.inertia_kg_m2
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return about_origin(self.mass_kg, self.centre_m, inertia)


class LoadedRun(ConfigModel):
    """A run with bodies.

    Attributes:
        run: Id or label of the run.
        bodies: Names of the bodies that the robot carried in this run.
    """

    run: str
    bodies: Annotated[tuple[str, ...], Field(min_length=1)]


class CarriedBodies(PhysicalFile):
    """Known bodies that a robot carries.

    Attributes:
        bodies: The bodies, by their names.
    """

    bodies: Annotated[dict[str, KnownBody], Field(min_length=1)]


class KnownLoads(PhysicalFile):
    """Known bodies, and the runs in which the robot carried them.

    Attributes:
        bodies: The bodies, by their names.
        loads: The runs with bodies; the robot carried none in the other runs.
    """

    bodies: Annotated[dict[str, KnownBody], Field(min_length=1)]
    loads: Annotated[tuple[LoadedRun, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        for loaded in self.loads:
            for name in loaded.bodies:
                if name not in self.bodies:
                    raise ValueError(
                        f"run {loaded.run!r} carries {name!r}, which is not one of the bodies"
                        f" {', '.join(self.bodies)}: add it to `bodies`"
                    )
            if len(set(loaded.bodies)) < len(loaded.bodies):
                raise ValueError(f"run {loaded.run!r} names a body twice: list each body once")
        return self


def read_known_loads(path: Path, robot: RobotDescription) -> KnownLoads:
    """Return the known loads in a file.

    Args:
        path: The file (YAML).
        robot: Robot that carried the bodies.

    Raises:
        ConfigError: The file is missing or invalid, or a body is on a link that the robot does not
            have.
    """
    loads = load_bundled_or_path(str(path), "loads", KnownLoads)
    refuse_missing_link(path, loads.bodies, robot)
    return loads


Bodies = Mapping[str, KnownBody]
"""The known bodies that a robot carried in one run, by their names."""


def refuse_missing_link(path: Path, bodies: Bodies, robot: RobotDescription) -> None:
    """Refuse bodies on a link that the robot does not have.

    Args:
        path: File of the bodies, for messages.
        bodies: The bodies.
        robot: The robot.

    Raises:
        ConfigError: The robot has fewer links.
    """
    links = len(robot.joints)
    for name, body in bodies.items():
        if body.link > links:
            raise ConfigError(
                f"{path}: body {name!r} is on link {body.link}, but robot {robot.name} has"
                f" {links} links: give a link from 1 to {links}",
                code="RID-FILE-VALUE",
            )


def known_values(model: RobotModel, base: BaseParameters, runs: Sequence[Bodies]) -> FloatArray:
    """Return the contribution of each run's bodies to the base parameters, shape (runs, b).

    Args:
        model: The robot.
        base: Its base parameters.
        runs: The bodies of each run.

    Raises:
        EstimationError: A friction term or a gear loss of the model depends on the load.
    """
    if any(runs) and model.transmission.losses:
        raise EstimationError(
            "runs with known loads need friction that does not depend on the load: remove the"
            " friction term `load` and the gear efficiencies from the model",
            code="RID-MODEL-LOAD-FRICTION",
        )
    found = np.zeros((len(runs), len(base)))
    for row, bodies in zip(found, runs, strict=True):
        row[:] = values_of_bodies(model, base, bodies)
    return found


def values_of_bodies(model: RobotModel, base: BaseParameters, bodies: Bodies) -> FloatArray:
    """Return the contribution of bodies to the base parameters, shape (b,)."""
    standard = np.zeros(len(model.parameter_names))
    links = standard[model.parameter_groups["rigid_body"]]
    for body in bodies.values():
        first = PARAMETERS_PER_LINK * (body.link - 1)
        links[first : first + PARAMETERS_PER_LINK] += body.parameters
    return base.from_standard(standard)


def load_findings(
    loads: Mapping[str, Bodies], run_ids: Sequence[str], is_searched: bool
) -> list[str]:
    """Return the known bodies of each run, as sentences.

    Args:
        loads: The bodies, by the ids of the runs that carried some.
        run_ids: All runs of an estimate.
        is_searched: True if one of the runs was empty, so that mistakes could be searched for.
    """
    findings = []
    for run_id in run_ids:
        if bodies := loads.get(run_id):
            words = (
                f"{name} ({own.mass_kg:g} kg, link {own.link})" for name, own in bodies.items()
            )
            findings.append(f"Run {run_id} carried {', '.join(words)}.")
    if findings and not is_searched:
        findings.append(
            "No run was empty, so mistakes of wiring, units and files were not searched for."
        )
    return findings
