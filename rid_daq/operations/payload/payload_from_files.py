"""`identify_payload_runs`: identify a payload from runs; write its file and a report."""

from __future__ import annotations

from dataclasses import replace

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.payload.file import write_payload
from identification.payload.known import KnownPayloadValue
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from rid_daq.operations.cell_files import read_torque_model, rejection_notes
from rid_daq.operations.payload.payload_estimate import (
    PayloadRequest,
    estimate_payload,
    gear_findings,
    report_payload,
)
from rid_daq.operations.payload.payload_identify import PayloadIdentifyRequest
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.runs import made_file
from rid_daq.runs.flange import compare_with_truth
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import RunData, all_defects, result_of
from rid_daq.terminal.choices import PAYLOAD
from rid_daq.terminal.context import Context, working


def identify_payload_runs(request: PayloadIdentifyRequest, context: Context) -> IdentifiedPayload:
    """Identify a payload from runs; write its file, and a report into the first run with it.

    Args:
        request: The request.
        context: Shows the present step.

    Raises:
        ConfigError: The procedure does not fit the model, or the runs do not belong together.
        DataQualityError, EstimationError: The data do not determine a payload.
        RecordingError, LockedError: A run cannot be read, or a file cannot be written.
    """
    refuse_output(request.output, request.overwrite, made_file.PAYLOAD)
    known = tuple(each.known() for each in request.known)
    names = [*request.unloaded, *request.loaded]
    folders = find_runs(request.runs, names)
    with working(context, "Reading the runs"):
        data = [RunData.load(folder, unfinished=request.unfinished) for folder in folders]
    notes = all_defects(data)
    require_torques(data)
    flags = [False] * len(request.unloaded) + [True] * len(request.loaded)
    robot = None
    if request.model is not None:
        misfit = request.despite_misfit
        robot = read_torque_model(request.model, data[0].robot, despite_misfit=misfit)[0]
        notes += rejection_notes(request.model, robot)
    asked = payload_request_of(request, robot, known)
    first = data[flags.index(True)]
    result = result_of(first, notes).with_sections(title=f"Payload on {first.robot.name}")
    with working(context, "Estimating the payload"):
        payload, repeats = estimate_payload(data, flags, asked)
    path = request.output or first.folder.file(PAYLOAD)
    write_payload(path, payload)
    findings = [*compare_with_truth(data, flags, payload), *gear_findings(data, asked)]
    found = report_payload(
        payload, repeats, path, folder=first.folder, result=result, findings=findings
    )
    return replace(found, notes=tuple(notes))


def payload_request_of(
    request: PayloadIdentifyRequest, robot: Estimate | None, known: tuple[KnownPayloadValue, ...]
) -> PayloadRequest:
    """Return the options of a payload estimate from a request.

    Args:
        request: The request.
        robot: Model of the robot without payload; None if unknown.
        known: The known quantities in the request.

    Raises:
        ConfigError: The procedure needs a model, or the model already defines the terms.
    """
    procedure = request.procedure or ("together" if robot is None else "model")
    if procedure == "model" and robot is None:
        raise ConfigError(
            "--procedure model needs a model of the robot without payload: --model MODEL",
            code="RID-OPTION-NEEDS",
        )
    options = request.options.options()
    if robot is not None and options != ModelOptions():
        raise ConfigError(
            "the model of --model defines the terms: leave --friction-terms and --no-rotors out",
            code="RID-OPTION-EXCLUSIVE",
        )
    sigma = 0.0 if procedure == "apart" else TORQUE_CONSTANT_SIGMA
    if request.torque_constant_sigma is not None:
        sigma = request.torque_constant_sigma
    how = PayloadOptions(
        procedure=procedure,
        options=options,
        robot=robot,
        known=known,
        torque_constant_sigma=sigma,
    )
    return PayloadRequest(how, request.limits.limits(), request.band_hz, request.standstill_rad_s)
