"""`Payload`: mass, centre of gravity and inertia of a payload; `identify_payload` estimates it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from config.arrays import FloatArray
from config.errors import ConfigError
from identification.choices import REPORTED, LoadFormat
from identification.payload.body import REPORTED_UNITS
from identification.payload.file import read_payload, write_payload
from identification.payload.verdict import PayloadResult
from rid_daq.api.arguments import (
    as_mapping,
    as_path,
    plain,
    require,
    require_each,
    with_options,
)
from rid_daq.api.console import text_of
from rid_daq.api.model import Model
from rid_daq.api.parameter import Parameter
from rid_daq.api.recording import Recording, named_recordings
from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.cell_files import refuse_other_robot, refuse_rejected_model
from rid_daq.operations.payload.load_data import load_text
from rid_daq.operations.payload.payload_estimate import estimate_payload, gear_findings
from rid_daq.operations.payload.payload_from_files import payload_request_of
from rid_daq.operations.payload.payload_identify import PayloadIdentifyRequest
from rid_daq.report.section_blocks.payload import payload_blocks
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.runs import made_file
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.output_file import refuse_output


@dataclass(frozen=True, eq=False)
class Payload:
    """A payload with 95 % intervals and the verdict on it, in the frame of the flange.

    `print` shows both.

    Attributes:
        result: Result of the operation `payload identify`.
        section: The same numbers, as in reports and JSON documents.
    """

    result: PayloadResult
    section: PayloadSection

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the payload of a file that `save` or `rid-daq payload` wrote.

        Raises:
            ConfigError: The file cannot be read, is not a payload file, or was edited.
        """
        result = read_payload(as_path("path", path))
        return cls(result, PayloadSection.of(result, None))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the payload file (JSON).

        Args:
            path: The file.
            overwrite: Replace an existing payload file.

        Raises:
            ConfigError: The file exists already (RID-OUTPUT-EXISTS), or is not a payload file.
            RecordingError: The file cannot be written.
        """
        path = as_path("path", path)
        refuse_output(path, overwrite, made_file.PAYLOAD)
        write_payload(path, self.result)

    @property
    def passed(self) -> bool:
        """True if every criterion of the verdict holds (docs/guide/payload.md)."""
        return self.result.passed

    @property
    def mass_kg(self) -> float:
        """Mass [kg]; NaN if the motion does not determine it."""
        return float(self.result.estimate.reported[0])

    @property
    def centre_m(self) -> FloatArray:
        """Shape (3,). Centre of gravity from the flange's origin [m]; NaN if undetermined."""
        return self.result.estimate.reported[1:4]

    @property
    def inertia_kg_m2(self) -> FloatArray:
        """Shape (3, 3). Inertia about the centre of gravity, physically consistent [kg m²]."""
        return self.result.estimate.body.inertia_kg_m2

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass, centre and inertia with intervals; the inertia is about the centre of gravity."""
        estimate = self.result.estimate
        return tuple(
            Parameter(name, name, unit, float(value), float(sigma), seen)
            for name, unit, value, sigma, seen in zip(
                REPORTED,
                REPORTED_UNITS,
                estimate.reported,
                estimate.sigma,
                estimate.is_determined,
                strict=True,
            )
        )

    def load_data(self, controller: str) -> str:
        """Return the load data in the format of a robot's controller, read back and compared.

        Args:
            controller: kuka, abb, fanuc, ur, ur-ros2, franka, staubli or urdf.

        Raises:
            ConfigError: There is no such controller (RID-REQUEST-INVALID).
            EstimationError: The payload did not pass, or its values are physically impossible.
        """
        if controller not in set(LoadFormat):
            raise ConfigError(
                f"controller {controller!r}: give one of {', '.join(LoadFormat)}",
                code="RID-REQUEST-INVALID",
            )
        name = Path(f"payload on {self.result.estimate.robot.name}")
        return load_text(name, self.result, LoadFormat(controller))[0]

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the payload and the verdict."""
        verdict = payload_verdict(self.result)
        yield from payload_blocks(self.section)
        yield Verdict(passed=verdict.passed, text=verdict.headline)
        yield Text(text=verdict.sentence)

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return str(self)


def identify_payload(
    loaded: Recording | Sequence[Recording],
    unloaded: Recording | Sequence[Recording] = (),
    *,
    model: Model | None = None,
    known: Mapping[str, tuple[float, float]] | None = None,
    options: Mapping[str, object] | None = None,
) -> Payload:
    """Identify a payload from recordings with it, and from recordings or a model without it.

    By default, robot and payload are estimated at once if no model is given: the payload adds ten
    columns to Y in tau = Y(q, v, a) beta (docs/theory.md 11). With a model, its torques are
    subtracted. Friction is estimated separately for every recording.

    Args:
        loaded: Recordings with the payload.
        unloaded: Recordings without the payload; not needed if a model is given.
        model: Model of the robot without payload.
        known: Quantities known from other measurements: value and standard deviation by name (m,
            cx, cy, cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz) [kg, m, kg m²], such as {"m": (2.805, 0.005)}.
        options: Further fields of the request `payload identify`, such as {"procedure": "apart"}.

    Raises:
        ConfigError: The recordings are of different robots (RID-ROBOT-OTHER), or an option is
            invalid.
        DataQualityError, EstimationError: The recordings do not determine a payload; or the model
            has `Model.problems` (RID-MODEL-MISFIT; `despite_misfit` in `options` accepts it).
    """
    groups = [
        require_each("unloaded", unloaded, Recording),
        require_each("loaded", loaded, Recording),
    ]
    names = [[each.run.folder.run_id for each in group] for group in groups]
    quantities = []
    for name, pair in as_mapping("known", known).items():
        if not isinstance(pair, Sequence) or len(pair) != 2:
            raise ConfigError(
                f"known: {name}: {plain(pair)!r}; give value and standard deviation, such as"
                " (2.805, 0.005), or (2.805, 0.0) for an exact value",
                code="RID-API-ARGUMENT",
            )
        quantities.append({"name": name, "value": pair[0], "sigma": pair[1]})
    request = PayloadIdentifyRequest.of(
        with_options({"unloaded": names[0], "loaded": names[1], "known": quantities}, options),
        shown="identify_payload",
    )
    stated = tuple(each.known() for each in request.known)
    recordings = [each for group in groups for each in group]
    data = [each.run for each in recordings]
    flags = [carried for carried, group in enumerate(groups) for _ in group]
    require_torques(data)
    robot = None
    if model is not None:
        robot = require("model", model, Model).estimate
        refuse_other_robot(Path("the model"), robot.robot, data[0].robot)
        misfit = request.despite_misfit
        refuse_rejected_model(robot, "the model", despite_misfit=misfit)
    asked = payload_request_of(request, robot, stated)
    with named_recordings(recordings):
        result, repeats = estimate_payload(data, list(map(bool, flags)), asked)
    return Payload(result, PayloadSection.of(result, repeats, gear_findings(data, asked)))
