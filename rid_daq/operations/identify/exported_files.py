"""`export_file`: write an identified model or a run's recording for other programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.recording.files import RecordingFormat, encode_recording
from acquisition.recording.table import recording_table
from acquisition.runs.catalogue import find_file_or_run
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, EstimationError
from config.formats.bounded_file import read_file
from config.formats.whole_file import write_whole
from config.formats.xml_tree import MAX_BYTES
from identification.consistency.closest_robot import NominalLinks, find_closest
from identification.estimation.estimate import Estimate
from identification.export.description import mjcf, pinocchio_model, sdf, urdf
from identification.export.function import c_function, python_function
from identification.export.kdl import kdl_notes, kdl_parameters, rest_of_model
from identification.export.model import ExportModel
from identification.export.table import csv_table, json_table
from identification.export.urdf_update import UpdatedUrdf, UrdfUpdate
from identification.model.still_joints import refuse_unmoved_joints
from rid_daq.operations.cell_files import refuse_rejected_model
from rid_daq.operations.identify.export import (
    ENDINGS,
    ExportedModel,
    ExportedRecording,
    ExportRequest,
)
from rid_daq.operations.identify.exported_torques import ExportedTorques, exported_torques
from rid_daq.operations.identify.updated_urdf import UpdatedUrdfSection
from rid_daq.operations.rigid_gears import rigid_gears_notes
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import RunData, all_defects
from rid_daq.runs.run_model import read_model
from rid_daq.terminal.choices import MODEL, Format

RECORDINGS: Final = tuple(Format(form.value) for form in RecordingFormat)
TABLES: Final[dict[Format, Callable[[Estimate, ExportModel | None], str]]] = {
    Format.CSV: csv_table,
    Format.JSON: json_table,
}
FUNCTIONS: Final[dict[Format, Callable[[ExportModel], str]]] = {
    Format.C: c_function,
    Format.PYTHON: python_function,
}
DESCRIPTIONS: Final[dict[Format, Callable[[ExportModel], str]]] = {
    Format.URDF: urdf,
    Format.SDF: sdf,
    Format.MJCF: mjcf,
    Format.PINOCCHIO: pinocchio_model,
}
WITH_ARMATURES: Final = (Format.MJCF, Format.PINOCCHIO)
NEED_NO_LINKS: Final = (*FUNCTIONS, *TABLES)
MOST_SIGMAS: Final = 3.0


def export_file(request: ExportRequest) -> ExportedModel | ExportedRecording:
    """Write the model or the recording that a request names.

    Raises:
        ConfigError: The file exists, or an option has no effect on this export.
        RidDaqError: As raised by `export_model` and `export_recording`.
    """
    refuse_output(request.output, request.overwrite, made_file.EXPORT)
    _refuse_own_input(request)
    _refuse_ending(request)
    found = find_file_or_run(request.runs, request.what)
    if isinstance(found, Path):
        _refuse_without_effect(request, ("unfinished",), "with a model file")
        if request.to not in (Format.URDF, Format.KDL):
            _refuse_without_effect(request, ("urdf",), f"with --to {request.to.value}")
        return export_model(request)
    names = ("as_identified", "despite_misfit", "urdf", "tip")
    _refuse_without_effect(request, names, "with a recording")
    return export_recording(request, found)


def _refuse_own_input(request: ExportRequest) -> None:
    """Refuse an output that would replace the model or the URDF from which it is made."""
    for source in (Path(request.what), request.urdf):
        if source is None or not source.is_file() or not request.output.exists():
            continue
        if request.output.samefile(source):
            raise ConfigError(
                f"{request.output}: the export is made from this file: give another name",
                code="RID-OPTION-EXCLUSIVE",
            )


def _refuse_ending(request: ExportRequest) -> None:
    """Refuse an output whose ending is that of another format, such as a table named .urdf."""
    own = ENDINGS[request.to]
    ending = request.output.suffix.lower()
    if ending not in own and any(ending in endings for endings in ENDINGS.values()):
        raise ConfigError(
            f"{request.output}: {ending} is the ending of another format than --to"
            f" {request.to.value}: name the file *{' or *'.join(own)}",
            code="RID-OUTPUT-ENDING",
        )


def _refuse_without_effect(request: ExportRequest, names: tuple[str, ...], because: str) -> None:
    for name in names:
        if getattr(request, name):
            raise ConfigError(
                f"--{name.replace('_', '-')}: has no effect {because}; leave it out",
                code="RID-OPTION-NO-EFFECT",
            )


def export_model(request: ExportRequest) -> ExportedModel:
    """Write an identified model.

    Raises:
        ConfigError: The format is not for models, or not for parameters as identified; or the model
            or the URDF cannot be used.
        EstimationError: The model does not explain its own data, no physically consistent
            parameters explain them, or the format cannot express the model.
        RecordingError: The file cannot be written, or the model is in a damaged run.
    """
    to, as_identified = request.to, request.as_identified
    if to not in NEED_NO_LINKS and to not in DESCRIPTIONS and to is not Format.KDL:
        raise ConfigError(
            f"--to {to.value} is a format for recordings, but {request.what} is a model file",
            code="RID-EXPORT-FORMAT",
        )
    if as_identified and to not in NEED_NO_LINKS:
        raise ConfigError(
            f"--as-identified works only with {', '.join(NEED_NO_LINKS)}: {to.value} describes"
            " single links, but the identified parameters are sums over several links",
            code="RID-EXPORT-LINKS",
        )
    estimate = read_model(Path(request.what))
    rigid = rigid_gears_notes(
        Path(request.what),
        estimate,
        "the file describes rigid gears: its torques hold for the motion of the links",
    )
    written = _write_model(request, estimate)
    return replace(written, notes=(*written.notes, *rigid))


def _write_model(request: ExportRequest, estimate: Estimate) -> ExportedModel:
    to, as_identified = request.to, request.as_identified
    if to is Format.KDL:
        return export_kdl(request, estimate)
    if request.urdf is not None:
        return update_urdf(request, request.urdf, estimate)
    chosen, sentence = exported_parameters(request, estimate)
    if to in TABLES:
        text = TABLES[to](estimate, None if as_identified else chosen)
    else:
        text = (FUNCTIONS | DESCRIPTIONS)[to](chosen)
    torques: tuple[ExportedTorques, ...] = ()
    if to in DESCRIPTIONS:
        joints = estimate.robot.joint_names
        torques = exported_torques(estimate, chosen, joints, has_armatures=to in WITH_ARMATURES)
    write_whole(request.output, text.encode())
    return ExportedModel(request, estimate.robot.name, sentence, chosen.test, torques)


def exported_parameters(
    request: ExportRequest, estimate: Estimate, nominal: NominalLinks | None = None
) -> tuple[ExportModel, str]:
    """Return the parameters of a model for an export, and their origin as a sentence.

    Args:
        request: Options of the export; `what` names the model in messages.
        estimate: The model.
        nominal: Links whose values are used if the model does not determine them; those of the
            robot file if not given.

    Raises:
        ConfigError: --despite-misfit has no effect.
        EstimationError: A joint did not move, `identify` rejected the model, or no physically
            consistent parameters explain the data.
    """
    if not request.as_identified:
        refuse_unmoved_joints(estimate.still, request.what)
    refuse_rejected_model(estimate, request.what, despite_misfit=request.despite_misfit)
    if request.as_identified:
        if not estimate.objections:
            _refuse_without_effect(
                request, ("despite_misfit",), "with --as-identified if the model was not rejected"
            )
        return ExportModel.from_estimate(
            estimate
        ), "The file contains the parameters as identified."
    found = find_closest(estimate, nominal)
    if not (found.test.is_consistent or request.despite_misfit):
        as_they_are = request.to in NEED_NO_LINKS
        also = ", write the identified parameters (--as-identified)" if as_they_are else ""
        raise EstimationError(
            f"{found.sentence} The model lacks an effect, or the intervals are too narrow: compare"
            f" models and measure with another motion{also}, or export it nevertheless"
            " (--despite-misfit)",
            code="RID-MODEL-INCONSISTENT",
        )
    return ExportModel.from_closest_robot(found), found.sentence


def update_urdf(request: ExportRequest, path: Path, estimate: Estimate) -> ExportedModel:
    """Write a user's URDF with the identified inertias and friction.

    Raises:
        ConfigError, EstimationError: As raised by `updated_urdf`.
        RecordingError: The file cannot be written.
    """
    chosen, sentence, updated = updated_urdf(request, path, estimate)
    section = UpdatedUrdfSection.of(estimate, chosen, updated)
    torques = exported_torques(estimate, chosen, updated.joint_names, has_armatures=False)
    write_whole(request.output, updated.data)
    return ExportedModel(request, estimate.robot.name, sentence, chosen.test, torques, section)


def updated_urdf(
    request: ExportRequest, path: Path, estimate: Estimate
) -> tuple[ExportModel, str, UpdatedUrdf]:
    """Return the written parameters, their origin as a sentence, and the updated file.

    Raises:
        ConfigError: The URDF cannot be read, does not contain the identified robot, or was updated
            by an earlier export.
        EstimationError: As raised by `exported_parameters`; or links that keep their values do not
            fit into the identified bodies.
    """
    update = UrdfUpdate(_read(path), str(path), ExportModel.from_estimate(estimate), request.tip)
    if update.is_updated:
        raise ConfigError(
            f"{path}: an earlier export updated this file, so its inertias are not those of your"
            " drawing: give the original file",
            code="RID-URDF-UPDATED",
        )
    chosen, sentence = exported_parameters(request, estimate, update.nominal)
    if not request.despite_misfit:
        _require_room(update, estimate, chosen)
    return chosen, sentence, update.with_model(chosen)


def export_kdl(request: ExportRequest, estimate: Estimate) -> ExportedModel:
    """Write the parameters of ROS 2's inverse dynamics solver for a URDF of the robot.

    Raises:
        ConfigError: No URDF is given, it cannot be read, or it does not contain the robot.
        EstimationError: As raised by `exported_parameters`.
        RecordingError: The file cannot be written.
    """
    if request.urdf is None:
        raise ConfigError(
            "--to kdl needs --urdf: the URDF that the solver gets as robot_description, as written"
            " by `rid-daq export --to urdf`",
            code="RID-OPTION-NEEDS",
        )
    path, identified = request.urdf, ExportModel.from_estimate(estimate)
    update = UrdfUpdate(_read(path), str(path), identified, request.tip)
    chosen, sentence = exported_parameters(request, estimate, update.nominal)
    rest, sigmas = rest_of_model(estimate, chosen, update.bodies.stated)
    notes = tuple(kdl_notes(rest, update.bodies.matched))
    if sigmas > MOST_SIGMAS:
        notes = (
            f"the inertias in {path} differ from the identified ones by {sigmas:.3g} σ: update the"
            f" file first with `rid-daq export --to urdf --urdf {path}`, and give the updated file",
            *notes,
        )
    write_whole(request.output, kdl_parameters(rest, update.bodies.matched, notes).encode())
    return ExportedModel(request, estimate.robot.name, sentence, chosen.test, notes=notes)


def _read(path: Path) -> bytes:
    try:
        return read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(
            f"{path}: the file cannot be read: {error.strerror}", code="RID-FILE-READ"
        ) from None


def _require_room(update: UrdfUpdate, estimate: Estimate, chosen: ExportModel) -> None:
    """Refuse parameters that are too far from the best ones because links keep their values.

    Raises:
        EstimationError: The unchanged links change a base parameter by more than three standard
            deviations.
    """
    unchanged = update.nominal.unchanged
    if not np.any(unchanged):
        return
    free = find_closest(estimate, replace(update.nominal, unchanged=np.zeros_like(unchanged)))
    moved = estimate.base.from_standard(chosen.parameters) - free.base_values
    sigmas = np.abs(moved) / estimate.sigma
    worst = int(np.argmax(sigmas))
    if sigmas[worst] > MOST_SIGMAS:
        names = sorted({name for each in update.unchanged_links for name in each})
        raise EstimationError(
            f"{update.file}: links {', '.join(names)} keep their <inertial>, which does not fit"
            f" the estimate: the base parameter {estimate.base.names[worst]} would change by"
            f" {sigmas[worst]:.3g} standard deviations (at most {MOST_SIGMAS:g}). Correct"
            " <inertial> of these links in the URDF, or export nevertheless (--despite-misfit)",
            code="RID-EXPORT-FIXED-LINKS",
        )


def export_recording(request: ExportRequest, folder: RunFolder) -> ExportedRecording:
    """Write all recorded rows of a run.

    Raises:
        ConfigError: The format is for models, or needs a library that is not installed.
        RidDaqError: The run cannot be used, or the file cannot be written.
    """
    to = request.to
    if to not in RECORDINGS:
        model = folder.path / MODEL
        raise ConfigError(
            f"--to {to.value} is a format for models: give a model file"
            + (f", as {model}" if model.exists() else " of `rid-daq identify`"),
            code="RID-EXPORT-FORMAT",
        )
    data = RunData.load(folder, unfinished=request.unfinished, changing_load=True)
    notes = all_defects([data])
    table = recording_table(data.recording, data.robot)
    write_whole(request.output, encode_recording(table, RecordingFormat(to.value)))
    return ExportedRecording(request, data, table, notes)
