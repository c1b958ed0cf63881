"""`identify_payload_runs`: runs with and without a payload to its file and a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.model.options import ModelOptions
from identification.payload.equations import Procedure
from identification.payload.file import write_payload
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from rid_daq.operations.cell_files import estimate_for
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_from_runs
from rid_daq.operations.payload.payload_identify import PayloadIdentifyRequest
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs import made_file
from rid_daq.runs.flange import compared
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import RunData, every_lack, note_output, result_of
from rid_daq.terminal.choices import PAYLOAD


@dataclass(frozen=True)
class PayloadIdentified:
    """What was found.

    Attributes:
        section: The payload.
        verdict: Whether it is as sure as was asked for.
        file, report: Where payload and report are.
        notes: What the runs lack.
        fits: Whether the residual of every axis kept its limit.
    """

    section: PayloadSection
    verdict: VerdictSection
    file: Path
    report: Path
    notes: list[str]
    fits: bool


def identify_payload_runs(request: PayloadIdentifyRequest) -> PayloadIdentified:
    """Identify a payload by runs; write its file and the first loaded run's report.

    Raises:
        ConfigError: The procedure does not go with the model, or the runs not together.
        DataQualityError, EstimationError: The data do not show a payload.
        RecordingError: A run cannot be read, or a file not be written.
    """
    refuse_output(request.output, request.overwrite, made_file.PAYLOAD)
    known = tuple(each.known() for each in request.known)
    names = [*request.unloaded, *request.loaded]
    folders = find_runs(request.runs, names)
    data = [RunData.load(folder, unfinished=request.unfinished) for folder in folders]
    notes = every_lack(data)
    require_torques(data)
    flags = [False] * len(request.unloaded) + [True] * len(request.loaded)
    robot = None if request.model is None else estimate_for(request.model, data[0].robot)
    procedure = request.procedure or ("together" if robot is None else "model")
    if procedure == "model" and robot is None:
        raise ConfigError(
            "--procedure model needs the robot without payload: --model MODEL",
            code="RID-OPTION-NEEDS",
        )
    options = request.options.options()
    if robot is not None and options != ModelOptions():
        raise ConfigError(
            "the terms are those of --model: leave --friction-terms and --no-rotors out",
            code="RID-OPTION-EXCLUSIVE",
        )
    how = PayloadOptions(
        procedure=procedure,
        options=options,
        robot=robot,
        known=known,
        torque_constant_sigma=_torque_constant_sigma(request.torque_constant_sigma, procedure),
    )
    asked = PayloadRequest(how, request.limits.limits(), request.band_hz, request.standstill_rad_s)
    payload, repeats = payload_from_runs(data, flags, asked)
    first = data[flags.index(True)]
    output = request.output or first.folder.file(PAYLOAD)
    write_payload(output, payload)
    note_output(first.folder, output)
    section = PayloadSection.of(payload, repeats, compared(data, flags, payload))
    verdict = payload_verdict(payload)
    result = result_of(first, notes).updated(
        title=f"Payload on {first.robot.name}", payload=section, verdict=verdict
    )
    report = write_result(first.folder, result)
    return PayloadIdentified(section, verdict, output, report, notes, payload.fits)


def _torque_constant_sigma(asked: float | None, procedure: Procedure) -> float:
    if asked is not None:
        return asked
    return 0.0 if procedure == "apart" else TORQUE_CONSTANT_SIGMA
