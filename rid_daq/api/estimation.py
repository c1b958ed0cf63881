"""`identify`: a model from recordings; `validate`: a model compared with another recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from config.errors import ConfigError
from rid_daq.api.arguments import (
    as_mapping,
    as_numbers,
    as_texts,
    require,
    require_callable,
    require_each,
    with_options,
)
from rid_daq.api.console import ProgressCallback, SilentConsole
from rid_daq.api.model import Model
from rid_daq.api.recording import Recording, named_recordings
from rid_daq.api.robot import Robot
from rid_daq.api.validation import Validation
from rid_daq.operations.identify.identified_robot import identify_robot
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.operations.identify.torque_verdict import validate_recording, validate_together
from rid_daq.operations.identify.validate import ValidateRequest
from rid_daq.operations.stated_payload import state_payload


def identify(
    recordings: Recording | Sequence[Recording],
    *,
    robot: Robot | str | Path | None = None,
    choose: bool = False,
    friction: Sequence[str] | None = None,
    diagnose: bool = True,
    options: Mapping[str, object] | None = None,
    progress: ProgressCallback | None = None,
) -> Model:
    """Estimate the base parameters of a robot, with intervals, from one or more recordings.

    Solves tau = Y(q, v, a) beta by weighted least squares (maximum likelihood, docs/theory.md 9.1):
    periodic recordings are averaged and used on their harmonics, others are low-passed without
    phase shift and used in the time domain. Intervals are cluster-robust, so that they cover
    model error as well as noise.

    Check `Model.problems` before you use the model: it names joints whose torque the model does not
    explain, and mistakes in wiring, units and files.

    Args:
        recordings: One or more recordings; either all are periodic, or all are not.
        robot: The robot, its bundled name, or the path of a robot file; by default that of the
            recordings.
        choose: Choose the friction terms of each joint by cross-validation.
        friction: Friction terms of every joint, such as coulomb, viscous, offset, stribeck; by
            default those of the robot file.
        diagnose: Search for mistakes of wiring, units and files, which takes most of the time.
        options: Further fields of the request `identify` (docs/reference/openapi.json), such as
            {"cross_check": True} or {"how": {"options": {"band_hz": 15.0}}}.
        progress: Called with the step, the amount done, and the total.

    Raises:
        ConfigError: The recordings are of different robots (RID-ROBOT-OTHER), only some recordings
            are periodic (RID-RUN-KINDS-MIXED), or an option is invalid (RID-REQUEST-INVALID).
        DataQualityError, EstimationError: The recordings do not determine the parameters.
    """
    recordings = require_each("recordings", recordings, Recording)
    require_callable("progress", progress)
    if not recordings:
        raise ConfigError("identify needs a recording: give at least one", code="RID-API-ARGUMENT")
    if robot is not None:
        recordings = [each.with_robot(robot) for each in recordings]
    asked: dict[str, object] = {
        "names": [each.run.folder.run_id for each in recordings],
        "choose": choose,
        "diagnose": diagnose,
    }
    asked = with_options(asked, options)
    if friction is not None:
        asked["how"] = _with_friction(asked.get("how"), as_texts("friction", friction))
    request = IdentifyRequest.of(asked, shown="identify")
    console = SilentConsole(callback=progress)
    with named_recordings(recordings):
        found = identify_robot(request, tuple(each.run for each in recordings), console)
    return Model(found.estimate, found.section)


def validate(
    model: Model,
    recording: Recording | Sequence[Recording],
    *,
    limits_percent: float | Sequence[float] | None = None,
    options: Mapping[str, object] | None = None,
) -> Validation:
    """Predict the torques of a recording with a model and judge the error, joint by joint.

    Args:
        model: The model.
        recording: A recording of the same robot that was not used for the identification. Several
            recordings are judged together; `Validation.runs` has the errors of each.
        limits_percent: Largest RMS error relative to the RMS torque, one value or one per joint
            [%]; by default `validation_limits_percent` of the recording's cell file, or else 30,
            combined with the noise (root of the sum of squares).
        options: Further fields of the request `validate`, such as {"band_hz": 15.0}.

    Raises:
        ConfigError: The recording is of another robot (RID-ROBOT-OTHER); a limit is invalid; the
            cells of the recordings state different limits (RID-OPTION-NEEDS); or the model contains
            a payload (RID-PAYLOAD-UNSTATED), see `Model.with_payload`.
        DataQualityError: The model was identified from rows of this recording
            (RID-VALIDATE-SAME-RUN), a torque was not measured (RID-RUN-NO-TORQUE), or the robot
            moves for less than 5 s in all recordings together (RID-RUN-STILL).
    """
    require("model", model, Model)
    recordings = require_each("recording", recording, Recording)
    runs = [each.run for each in recordings]
    if not runs:
        raise ConfigError("give at least one recording", code="RID-API-ARGUMENT")
    asked: dict[str, object] = {
        "model": Path("the model"),
        "run": runs[0].folder.run_id,
    }
    asked = with_options(asked, options)
    if limits_percent is not None:
        limits = np.atleast_1d(as_numbers("limits_percent", limits_percent))
        if limits.ndim > 1 or not (limits > 0.0).all():
            raise ConfigError(
                f"limits_percent: {limits.tolist()} %; give positive numbers, one or one per joint",
                code="RID-API-ARGUMENT",
            )
        asked["limits"] = ",".join(f"{each:.12g}" for each in limits)
    request = ValidateRequest.of(asked, shown="validate")
    estimate = state_payload(model.estimate, request.model, request.payload, request.runs).estimate
    with named_recordings(recordings):
        if len(runs) == 1:
            return Validation(validate_recording(request, estimate, runs[0]), runs[0].robot)
        of_runs, judged = validate_together(request, estimate, runs)
    return Validation(judged, runs[0].robot, of_runs)


def _with_friction(how: object, terms: Sequence[str]) -> dict[str, object]:
    """Return the request field `how` with these friction terms."""
    how = as_mapping("options.how", how)
    options = as_mapping("options.how.options", how.get("options"))
    model = as_mapping("options.how.options.model", options.get("model"))
    if "friction_terms" in model:
        raise ConfigError(
            "friction: options give friction_terms too; leave one of them out",
            code="RID-API-ARGUMENT",
        )
    return {**how, "options": {**options, "model": {**model, "friction_terms": tuple(terms)}}}
