"""`Model`: an identified robot: parameters with intervals, torques, files, other programs."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from compensation.operating_temperature import at_operating_temperature
from config.arrays import FloatArray
from config.errors import ConfigError
from dynamics.model.memory import with_presliding_history
from dynamics.model.robot_model import torque
from identification.estimation.estimate import (
    Estimate,
    base_regressor,
    predict,
    refuse_external_model,
    refuse_other_positions,
)
from identification.estimation.file import write_estimate
from identification.export.description import mjcf, pinocchio_model
from identification.export.description import urdf as description_urdf
from identification.export.model import ExportModel
from identification.friction.curve import friction_columns
from rid_daq.api.arguments import (
    ARGUMENT,
    as_motion,
    as_numbers,
    as_path,
    as_samples,
    require,
    require_stated_payload,
)
from rid_daq.api.console import text_of
from rid_daq.api.curves import curves_plot
from rid_daq.api.parameter import Parameter
from rid_daq.api.robot import Robot
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.plot import Axis
from rid_daq.operations.identify.export import ExportRequest
from rid_daq.operations.identify.exported_files import exported_parameters, updated_urdf
from rid_daq.operations.stated_payload import model_with_payload, state_payload
from rid_daq.report.section_blocks.estimate import estimate_blocks, fit_blocks, fit_verdict
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_model import read_model
from rid_daq.terminal.choices import DEFAULT_RUNS, NO_PAYLOAD, PAYLOAD_OF_MODEL, Format

if TYPE_CHECKING:
    from rid_daq.api.payload import Payload

FRICTION_SPEEDS = 201


@dataclass(frozen=True, eq=False)
class Model:
    """The inverse dynamics of a robot, tau = Y(q, v, a) beta, identified from recordings.

    beta are the base parameters: the combinations of inertia, friction, springs and rotors that
    torques determine. Torques are those of the actuators at the link side; without a coupled wrist
    they are the torques of the joints. Arrays have the shape (samples, joints), or (joints,) for
    one sample. Friction with presliding is computed along the samples in their order; in one
    sample, joints that move slide. `print` shows parameters, the fit of each joint, and findings.

    Attributes:
        estimate: The identified parameters, as the operations use them.
        section: The numbers that reports and JSON documents contain, and the findings.
    """

    estimate: Estimate
    section: EstimateSection

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the model of a file that `save` or `rid-daq identify` wrote.

        Raises:
            ConfigError: The file cannot be read or is not a model.
            RecordingError: The file is in another run's folder, or files of the run have changed.
        """
        estimate = read_model(as_path("path", path))
        return cls(estimate, EstimateSection.of(estimate))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the model file (JSON). It contains the robot, but no findings.

        Args:
            path: The file.
            overwrite: Replace an existing model file.

        Raises:
            ConfigError: The file exists already (RID-OUTPUT-EXISTS) or is not a model.
            RecordingError: The file cannot be written.
        """
        path = as_path("path", path)
        refuse_output(path, overwrite, made_file.MODEL)
        write_estimate(path, self.estimate)

    @property
    def robot(self) -> Robot:
        """The robot, with the friction terms that were identified."""
        return Robot(self.estimate.robot)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The b base parameters, then the nonlinear parameters of friction."""
        return tuple(
            Parameter(each.name, each.words, each.unit, each.value, each.std, not each.not_shown)
            for each in self.section.parameters
        )

    @property
    def values(self) -> FloatArray:
        """Shape (b,). Values of the base parameters, in the order of `parameters`."""
        return self.estimate.values

    @property
    def sigma(self) -> FloatArray:
        """Shape (b,). Standard deviations of the base parameters."""
        return self.estimate.sigma

    @property
    def residual_percent(self) -> FloatArray:
        """Shape (joints,). RMS residual of the fit over RMS torque [%]; NaN if unknown."""
        return np.array([np.nan if f.percent is None else f.percent for f in self.estimate.fit])

    @property
    def problems(self) -> tuple[str, ...]:
        """Reasons not to use the model, one sentence each; empty if none was found.

        They name joints with unexplained torque, impossible values, and mistakes in wiring, units
        or files. Exports, `compensate`, `retime`, `design` and `identify_payload` refuse such a
        model, except with `despite_misfit`.
        """
        return self.estimate.objections

    @property
    def findings(self) -> tuple[str, ...]:
        """Findings: weak parameters, physical consistency, terms that would improve the fit."""
        return self.section.findings or ()

    def inverse_dynamics(
        self,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike,
        acceleration: npt.ArrayLike,
    ) -> FloatArray:
        """Return the torques of a motion, friction included: tau = Y(q, v, a) beta.

        With elastic gears (`identify --gears`), the motion is that of the links; `print` shows by
        how much their torques differed from those of the motors in the identification.

        Args:
            position, velocity, acceleration: Shape (samples, joints) or (joints,). The motion [rad
                or m, and per s, per s²].

        Returns:
            The same shape. Torques [N m or N].

        Raises:
            ConfigError, EstimationError: An array does not fit, or positions are far beyond the
                limits (RID-API-ARGUMENT); a joint that did not move is at another position; the
                model is external, depends on temperature or contains a payload.
        """
        refuse_external_model(self.estimate)
        if np.ndim(position) == 1:
            return np.asarray(self.regressor(position, velocity, acceleration) @ self.values)
        require_stated_payload(self.estimate)
        q, v, a = as_motion(self.estimate.robot, position, velocity, acceleration)
        return predict(self.estimate, q, v, a)

    def regressor(
        self,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike,
        acceleration: npt.ArrayLike,
    ) -> FloatArray:
        """Return Y of tau = Y beta, so that Y @ model.values are the torques.

        Args:
            position, velocity, acceleration: As for `inverse_dynamics`.

        Returns:
            Shape (samples, joints, b) or (joints, b). N m or N per unit of each base parameter.

        Raises:
            ConfigError, EstimationError: As for `inverse_dynamics`.
        """
        require_stated_payload(self.estimate)
        q, v, a = as_motion(self.estimate.robot, position, velocity, acceleration)
        refuse_other_positions(self.estimate, q)
        is_path = np.ndim(position) > 1
        conditions = with_presliding_history(self.estimate.model, q) if is_path else None
        found = base_regressor(self.estimate, q, v, a, conditions)
        return found.reshape(*np.shape(position), len(self.values))

    def mass_matrix(self, position: npt.ArrayLike) -> FloatArray:
        """Return the mass matrix M of tau = M(q) a + ..., rotors included.

        Weakly determined parameters can make it indefinite. `to_pinocchio` uses the closest
        physically consistent ones, with which it is positive definite.

        Args:
            position: Shape (samples, joints) or (joints,). Positions [rad or m].

        Returns:
            Shape (samples, joints, joints) or (joints, joints) [kg m², kg m or kg].

        Raises:
            ConfigError, EstimationError: An array does not fit (RID-API-ARGUMENT), or the model
                contains a payload (`with_payload`).
        """
        require_stated_payload(self.estimate)
        (q,) = as_motion(self.estimate.robot, position)
        own = self.estimate.model
        bare = replace(self.estimate.options, friction=False, nonlinear=None)
        model = bare.build(self.estimate.robot)
        values = dict(zip(own.parameter_names, self.estimate.standard_values, strict=True))
        theta = np.array([values[name] for name in model.parameter_names])
        rest = np.zeros_like(q)
        gravity = torque(model, q, rest, rest, theta)
        columns = [
            torque(model, q, rest, rest + unit, theta) - gravity for unit in np.eye(q.shape[1])
        ]
        return np.stack(columns, axis=-1).reshape(*np.shape(position), q.shape[1])

    def friction(self, velocity: npt.ArrayLike) -> FloatArray:
        """Return the torque of friction of each joint at steady speeds, offsets included.

        Friction that depends on the load is computed without load.

        Args:
            velocity: Shape (samples, joints) or (joints,). Velocities of the actuators, link side
                [rad/s or m/s].

        Returns:
            The same shape. Torques [N m or N]; zero without friction in the model.

        Raises:
            ConfigError, EstimationError: An array does not fit (RID-API-ARGUMENT).
        """
        (v,) = as_samples(self.estimate.robot, velocity)
        model = self.estimate.model
        if "friction" not in model.parameter_groups:
            return np.zeros(np.shape(velocity))
        values = self.estimate.standard_values[model.parameter_groups["friction"]]
        columns = [friction_columns(model, j, v[:, j]) @ values for j in range(v.shape[1])]
        return np.stack(columns, axis=-1).reshape(np.shape(velocity))

    def at_temperature(
        self, temperature: str | float, velocity: npt.ArrayLike | None = None
    ) -> Self:
        """Return the model at a temperature, if its friction depends on temperature.

        Args:
            temperature: Temperature of the joints [°C], such as 40 or "40,35,30"; with computed
                warming also `cold` (long rest) or `warm` (many repetitions of the motion).
            velocity: Shape (samples, joints). Velocities of the motion, for `warm` [rad/s or m/s].

        Raises:
            ConfigError: The friction does not depend on temperature (RID-OPTION-NO-EFFECT), or the
                temperature does not fit the model (RID-MODEL-TEMPERATURE).
        """
        motion = None if velocity is None else as_numbers("velocity", velocity)
        found = at_operating_temperature(self.estimate, str(temperature), motion).estimate
        return replace(self, estimate=found, section=EstimateSection.of(found))

    def with_payload(self, payload: Payload | str) -> Self:
        """Return the model of the robot with a payload, whose torques and intervals include it.

        Args:
            payload: An identified payload, `model` (the model's own payload), or `none` (no
                payload).

        Raises:
            ConfigError, EstimationError: `payload` is `model`, but the model contains no payload;
                or the payload is of another robot, failed its verdict, or is not fully determined.
        """
        from rid_daq.api.payload import Payload

        if isinstance(payload, Payload):
            found = model_with_payload(self.estimate, payload.result, Path("the payload"))
        elif isinstance(payload, str) and payload in (NO_PAYLOAD, PAYLOAD_OF_MODEL):
            found = state_payload(self.estimate, "the model", payload, DEFAULT_RUNS).estimate
        else:
            raise ConfigError(
                f"payload {payload!r}: give a Payload, 'model' or 'none'", code=ARGUMENT
            )
        return replace(self, estimate=found, section=EstimateSection.of(found))

    def to_urdf(
        self,
        urdf: str | Path | None = None,
        *,
        tip: str | None = None,
        despite_misfit: bool = False,
    ) -> str:
        """Return a URDF of the robot with the closest physically consistent parameters.

        A comment in the URDF lists the properties of the model that a URDF cannot express.

        Args:
            urdf: Your URDF of the robot, in UTF-8. The result is this file with the identified
                inertias and friction; everything else stays. Without it, the result has the frames
                and names of the model.
            tip: Link behind the arm's last joint, if `urdf` has several equal arms.
            despite_misfit: Accept what RID-MODEL-MISFIT and RID-MODEL-INCONSISTENT refuse.

        Raises:
            ConfigError: `urdf` cannot be read, or its axes are not those of the robot
                (RID-URDF-KINEMATICS).
            EstimationError: A joint did not move (RID-MODEL-STILL); the model does not explain its
                data (RID-MODEL-MISFIT), or no physically consistent one does
                (RID-MODEL-INCONSISTENT); or links of `urdf` do not fit (RID-EXPORT-FIXED-LINKS).
        """
        if urdf is None and tip is not None:
            raise ConfigError(
                "tip: has no effect without urdf; leave it out", code="RID-OPTION-NO-EFFECT"
            )
        if urdf is None:
            return description_urdf(self._export_model(Format.URDF, despite_misfit))
        if tip is not None:
            require("tip", tip, str)
        request = self._request(Format.URDF, despite_misfit).model_copy(update={"tip": tip})
        data = updated_urdf(request, as_path("urdf", urdf), self.estimate)[2].data
        try:
            return data.decode()
        except UnicodeDecodeError:
            raise ConfigError(
                f"{urdf}: the file is not UTF-8; save it in UTF-8, or use rid-daq export",
                code="RID-FILE-TYPE",
            ) from None

    def to_pinocchio(self, *, despite_misfit: bool = False) -> Any:
        """Return the robot as a `pinocchio.Model`, with armatures, friction and damping.

        Args:
            despite_misfit: As for `to_urdf`.

        Raises:
            EstimationError: As for `to_urdf` without a file.
        """
        names: dict[str, Any] = {}
        source = pinocchio_model(self._export_model(Format.PINOCCHIO, despite_misfit))
        exec(compile(source, "pinocchio_model.py", "exec"), names)  # `export` writes this source
        return names["build_model"]()

    def to_mujoco(self, *, despite_misfit: bool = False) -> Any:
        """Return the robot as a `mujoco.MjModel`, with armatures, friction, damping and gravity.

        Args:
            despite_misfit: As for `to_urdf`.

        Raises:
            ConfigError: MuJoCo is not installed (RID-INSTALL-LIBRARY).
            EstimationError: As for `to_urdf` without a file.
        """
        try:
            mujoco: Any = importlib.import_module("mujoco")
        except ImportError:
            raise ConfigError(
                "to_mujoco needs MuJoCo, which is not installed: `pip install mujoco`",
                code="RID-INSTALL-LIBRARY",
            ) from None
        return mujoco.MjModel.from_xml_string(mjcf(self._export_model(Format.MJCF, despite_misfit)))

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield fit, parameters, findings and verdict, and the friction over speed."""
        yield from estimate_blocks(self.section)
        if not any(axis.reason for axis in self.section.axes):
            yield from fit_blocks(self.section)
        yield fit_verdict(self.section)
        limits = [joint.limits.velocity for joint in self.robot.description.joints]
        share = np.linspace(-1.0, 1.0, FRICTION_SPEEDS)
        parts = ((Axis("friction", "N m or N"), self.friction(np.outer(share, limits))),)
        yield curves_plot(self.robot.joint_names, Axis("speed / limit"), share, parts)

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return f"Model({self.estimate.robot.name}, {len(self.values)} base parameters)"

    def _export_model(self, form: Format, despite_misfit: bool) -> ExportModel:
        return exported_parameters(self._request(form, despite_misfit), self.estimate)[0]

    def _request(self, form: Format, despite_misfit: bool) -> ExportRequest:
        return ExportRequest(
            what=f"model of {self.estimate.robot.name}",
            to=form,
            output=Path(form.value),
            despite_misfit=despite_misfit,
        )
