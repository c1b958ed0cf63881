"""`state_payload`: the model of a robot with the payload that a request states."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import find_file_or_run
from config.errors import ConfigError, EstimationError, LimitError
from config.formats.approved_files import sha256_of
from config.formats.json_file import read_content
from config.formats.yaml_tree import parse_yaml
from config.load import validate
from identification.estimation.estimate import Estimate
from identification.model.known_loads import CarriedBodies, refuse_missing_link
from identification.payload.carried import (
    carry,
    carry_bodies,
    carry_own,
    contains_payload,
    without_payload,
)
from identification.payload.file import LARGEST_FILE_BYTES, payload_content, refuse_failed
from identification.payload.rating import refuse_heavier
from identification.payload.verdict import PayloadResult
from rid_daq.operations.cell_files import refuse_other_robot
from rid_daq.terminal.choices import NO_PAYLOAD, PAYLOAD, PAYLOAD_OF_MODEL

YAML: Final = (".yaml", ".yml")
_BODIES: Final = b'{"carried": '
"""Start of the content of known bodies; a payload file does not begin with it."""


@dataclass(frozen=True)
class LoadedModel:
    """Model of a robot with its payload.

    Attributes:
        estimate: Robot and payload as one model: the payload is part of the last link, known bodies
            are parts of their links.
        statement: The payload as the request states it; empty if the request states none.
        content: Bytes of the payload file, or the known bodies as JSON; empty without a file.
    """

    estimate: Estimate
    statement: str = ""
    content: bytes = b""

    @property
    def origin(self) -> str:
        """Name of the payload for output files: the SHA-256 of its file, or `statement`."""
        return sha256_of(self.content) if self.content else self.statement


def state_payload(
    estimate: Estimate, model: Path | str, payload: str | None, runs: Path
) -> LoadedModel:
    """Return the model of a robot with the payload that a request states.

    Args:
        estimate: The model.
        model: Name of the model, for messages.
        payload: A payload file, a file of known bodies, a run or session with a payload, `model`,
            `none`, or None if the request states nothing.
        runs: Folder of the run folders.

    Raises:
        ConfigError: The model contains a payload but the request states none, the request states
            the model's payload but the model contains none, or the payload is of another robot,
            invalid or not found.
        LimitError: The payload is too heavy for the robot.
        RecordingError: The payload's run cannot be read.
        EstimationError: The payload failed its verdict, or its motion did not determine all its
            parameters.
    """
    if payload is None:
        if contains_payload(estimate):
            raise ConfigError(
                f"{model}: the model contains a payload, but nothing states what the robot"
                " carries: give --payload model for this payload, --payload none for the robot"
                " alone, or another payload",
                code="RID-PAYLOAD-UNSTATED",
            )
        return LoadedModel(estimate)
    if payload == PAYLOAD_OF_MODEL:
        try:
            return LoadedModel(carry_own(estimate), payload)
        except ConfigError as error:
            raise ConfigError(f"{model}: {error}", code=error.refusal) from None
    if payload == NO_PAYLOAD:
        return LoadedModel(without_payload(estimate), payload)
    found = find_file_or_run(runs, payload, having=(PAYLOAD,))
    if isinstance(found, Path):
        path, content = found, load_content(found)
    else:
        path, content = found.file(PAYLOAD), found.read(PAYLOAD)
    return LoadedModel(model_with_content(estimate, content, path), payload, content)


def load_content(path: Path) -> bytes:
    """Return the bytes of a valid payload file, or the known bodies of a YAML file as JSON.

    Args:
        path: A payload file of `payload identify`, or a YAML file with the key `bodies`.

    Raises:
        ConfigError: The file is missing or invalid.
    """
    content = read_content(path, LARGEST_FILE_BYTES)
    if path.suffix in YAML:
        carried = validate(parse_yaml(content, str(path)), CarriedBodies)
        return _BODIES + carried.model_dump_json().encode() + b"}"
    payload_content(content, path)
    return content


def model_with_content(estimate: Estimate, content: bytes, path: Path) -> Estimate:
    """Return the model of a robot with the payload or the bodies of `load_content`.

    Args:
        estimate: The model; a payload in it is replaced.
        content: The payload or the bodies.
        path: Name of the file, for messages.

    Raises:
        ConfigError: The content is invalid, belongs to another robot, or names a missing link.
        EstimationError: As raised by `state_payload`.
        LimitError: The bodies on the last link are heavier than the robot's largest payload.
    """
    if not content.startswith(_BODIES):
        return model_with_payload(estimate, payload_content(content, path), path)
    carried = CarriedBodies.model_validate_json(content[len(_BODIES) : -1])
    refuse_missing_link(path, carried.bodies, estimate.robot)
    last = len(estimate.robot.joints)
    at_flange_kg = sum(each.mass_kg for each in carried.bodies.values() if each.link == last)
    try:
        refuse_heavier(estimate.robot, at_flange_kg)
    except LimitError as error:
        raise LimitError(f"{path}: {error}", code=error.refusal) from None
    return carry_bodies(estimate, carried.bodies)


def payload_words(payload: str | None) -> str:
    """Return a phrase on a model's payload, such as " without payload"; empty if none is stated.

    Args:
        payload: The request's statement, as in `state_payload`.
    """
    if payload is None:
        return ""
    phrases = {NO_PAYLOAD: " without payload", PAYLOAD_OF_MODEL: " with its payload"}
    return phrases.get(payload, f" with the payload {payload}")


def model_with_payload(estimate: Estimate, judged: PayloadResult, path: Path) -> Estimate:
    """Return the model of a robot with a payload that passed its verdict.

    Args:
        estimate: The model; a payload in it is replaced.
        judged: The payload with its verdict.
        path: Name of the payload, for messages.

    Raises:
        ConfigError, EstimationError: As raised by `state_payload`.
    """
    refuse_failed(path, judged, "no torque can be computed with it")
    refuse_other_robot(path, judged.estimate.robot, estimate.robot)
    try:
        return carry(estimate, judged.estimate)
    except EstimationError as error:
        raise EstimationError(f"{path}: {error}", code=error.refusal) from None


def payload_file(runs: Path, reference: str) -> Path:
    """Return a payload file by its path, or the payload file of a session or run.

    Raises:
        ConfigError, RecordingError: As raised by `find_file_or_run`.
    """
    found = find_file_or_run(runs, reference, having=(PAYLOAD,))
    return found if isinstance(found, Path) else found.file(PAYLOAD)
