"""`identify_payload_runs`: runs with and without a payload to its file and a report."""

from __future__ import annotations

from dataclasses import replace

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from rid_daq.operations.cell_files import estimate_for
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_from_runs
from rid_daq.operations.payload.payload_identify import PayloadIdentifyRequest
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.runs import made_file
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import RunData, every_lack, result_of


def identify_payload_runs(request: PayloadIdentifyRequest) -> IdentifiedPayload:
    """Identify a payload by runs; write its file and the first loaded run's report.

    Raises:
        ConfigError: The procedure does not go with the model, or the runs not together.
        DataQualityError, EstimationError: The data do not show a payload.
        RecordingError: A run cannot be read, or a file not be written.
    """
    refuse_output(request.output, request.overwrite, made_file.PAYLOAD)
    names = [*request.unloaded, *request.loaded]
    folders = find_runs(request.runs, names)
    data = [RunData.load(folder, unfinished=request.unfinished) for folder in folders]
    notes = every_lack(data)
    require_torques(data)
    flags = [False] * len(request.unloaded) + [True] * len(request.loaded)
    robot = None if request.model is None else estimate_for(request.model, data[0].robot)
    asked = asked_payload(request, robot)
    first = data[flags.index(True)]
    result = result_of(first, notes).updated(title=f"Payload on {first.robot.name}")
    folder, output = first.folder, request.output
    found = payload_from_runs(data, flags, asked, folder=folder, result=result, output=output)
    return replace(found, notes=tuple(notes))


def asked_payload(request: PayloadIdentifyRequest, robot: Estimate | None) -> PayloadRequest:
    """Return how a payload is estimated.

    Args:
        request: What is asked for.
        robot: The robot without payload, if it is known.

    Raises:
        ConfigError: The procedure does not go with the model, or a known quantity is not possible.
    """
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
    sigma = 0.0 if procedure == "apart" else TORQUE_CONSTANT_SIGMA
    if request.torque_constant_sigma is not None:
        sigma = request.torque_constant_sigma
    how = PayloadOptions(
        procedure=procedure,
        options=options,
        robot=robot,
        known=tuple(each.known() for each in request.known),
        torque_constant_sigma=sigma,
    )
    return PayloadRequest(how, request.limits.limits(), request.band_hz, request.standstill_rad_s)
