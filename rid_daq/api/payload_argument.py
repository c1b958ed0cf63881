"""`to_request_payload`: the payload of a request, from an argument of a public function."""

from __future__ import annotations

from pathlib import Path

from config.errors import ConfigError
from rid_daq.api.arguments import ARGUMENT, require_stated_payload
from rid_daq.api.model import Model
from rid_daq.api.payload import Payload
from rid_daq.api.temporary_files import PAYLOAD
from rid_daq.terminal.choices import NO_PAYLOAD, PAYLOAD_OF_MODEL


def to_request_payload(payload: Payload | str | None, model: Model, folder: Path) -> str | None:
    """Return the field `payload` of a request; write an identified payload into a folder.

    Args:
        payload: An identified payload, `model` (the model's own payload), `none`, or None if
            nothing is stated.
        model: The identified robot.
        folder: Folder of the request's files.

    Raises:
        ConfigError: The argument is none of these.
        EstimationError: The model contains a payload, but nothing states what the robot carries.
    """
    if isinstance(payload, Payload):
        payload.save(folder / PAYLOAD)
        return str(folder / PAYLOAD)
    if payload is None:
        require_stated_payload(model.estimate)
    elif not isinstance(payload, str) or payload not in (NO_PAYLOAD, PAYLOAD_OF_MODEL):
        raise ConfigError(f"payload {payload!r}: give a Payload, 'model' or 'none'", code=ARGUMENT)
    return payload
