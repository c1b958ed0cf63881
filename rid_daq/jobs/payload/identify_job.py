"""`rid-daq payload identify`: runs with and without a payload to its file and a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from config.ranges import Ranged
from identification.choices import (
    BAND_HZ,
    STANDSTILL_RAD_S,
    BandHz,
    PayloadLimits,
    StandstillRadS,
    TorqueConstantSigma,
)
from identification.model.options import ModelOptions
from identification.payload.equations import Procedure
from identification.payload.file import write_payload
from identification.payload.known import Known
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from rid_daq.jobs.cell_files import estimate_for
from rid_daq.jobs.payload.payload_job import PayloadRequest, payload_from_runs
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.report.sections.verdict import Verdict
from rid_daq.report_page.write import write_result
from rid_daq.runs.flange import compared
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.run_data import RunData, note_output, report_lacks, result_of
from rid_daq.terminal.choices import PAYLOAD
from rid_daq.terminal.console import Console


@dataclass(frozen=True)
class PayloadIdentifyRequest(Ranged):
    """What `rid-daq payload identify` was asked for.

    Attributes
    ----------
    loaded, unloaded : sequence of str
        Runs with the payload, and without it.
    runs : Path
        The folder of the run folders.
    model : Path or None
        The robot without payload; runs without payload are compared with it.
    procedure : Procedure or None
        How robot and payload are told apart; by the model where there is one, else together.
    known : tuple of Known
        What is known otherwise.
    torque_constant_sigma : float or None
        What is not known of each torque constant, as a share; the usual if None.
    limits : PayloadLimits
        How sure the payload must be.
    band_hz, standstill_rad_s : float
        Highest frequency and lowest speed used.
    options : ModelOptions
        The terms of the robot's model where no model is given.
    unfinished : bool
        Whether a run that was never finished will do.
    output : Path or None
        The payload file; that of the first loaded run if None.
    overwrite : bool
        Whether that file may be there already.
    """

    loaded: Sequence[str]
    unloaded: Sequence[str]
    runs: Path
    model: Path | None = None
    procedure: Procedure | None = None
    known: tuple[Known, ...] = ()
    torque_constant_sigma: TorqueConstantSigma | None = None
    limits: PayloadLimits = field(default_factory=PayloadLimits)
    band_hz: BandHz = BAND_HZ
    standstill_rad_s: StandstillRadS = STANDSTILL_RAD_S
    options: ModelOptions = field(default_factory=ModelOptions)
    unfinished: bool = False
    output: Path | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class PayloadIdentified:
    """What was found.

    Attributes
    ----------
    section : PayloadSection
        The payload.
    verdict : Verdict
        Whether it is as sure as was asked for.
    file, report : Path
        Where payload and report are.
    notes : list of str
        What the runs lack.
    fits : bool
        Whether the residual of every axis kept its limit.
    """

    section: PayloadSection
    verdict: Verdict
    file: Path
    report: Path
    notes: list[str]
    fits: bool


def identify_payload_runs(request: PayloadIdentifyRequest, console: Console) -> PayloadIdentified:
    """Identify a payload by runs; write its file and the first loaded run's report.

    Raises
    ------
    ConfigError
        The procedure does not go with the model, or the runs not together.
    DataQualityError, EstimationError
        The data do not show a payload.
    RecordingError
        A run cannot be read, or a file not be written.
    """
    names = [*request.unloaded, *request.loaded]
    folders = find_runs(request.runs, names)
    data = [RunData.load(folder, unfinished=request.unfinished) for folder in folders]
    notes = report_lacks(console, data)
    require_torques(data)
    flags = [False] * len(request.unloaded) + [True] * len(request.loaded)
    robot = None if request.model is None else estimate_for(request.model, data[0].robot)
    procedure = request.procedure or ("together" if robot is None else "model")
    if procedure == "model" and robot is None:
        raise ConfigError(
            "--procedure model needs the robot without payload: --model MODEL",
            code="RID-OPTION-NEEDS",
        )
    if robot is not None and request.options != ModelOptions():
        raise ConfigError(
            "the terms are those of --model: leave --friction-terms and --no-rotors out",
            code="RID-OPTION-EXCLUSIVE",
        )
    how = PayloadOptions(
        procedure=procedure,
        options=request.options,
        robot=robot,
        known=request.known,
        torque_constant_sigma=_torque_constant_sigma(request.torque_constant_sigma, procedure),
    )
    asked = PayloadRequest(how, request.limits, request.band_hz, request.standstill_rad_s)
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
