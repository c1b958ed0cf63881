"""Refusals of the service, each with the status that a client gets."""

from __future__ import annotations

from http import HTTPStatus

from config import errors
from config.errors import RidDaqError, ServiceError


class NotAllowedError(ServiceError):
    """Who asks may not do this."""


class UnknownError(ServiceError):
    """There is no such cell, job, run or file."""


class NotKnownError(ServiceError):
    """Nobody knows who asks: a token is needed."""


class StoreBusyError(ServiceError):
    """The service's file cannot be read or written now."""


_STATUS: tuple[tuple[type[RidDaqError], HTTPStatus], ...] = (
    (NotKnownError, HTTPStatus.UNAUTHORIZED),
    (NotAllowedError, HTTPStatus.FORBIDDEN),
    (UnknownError, HTTPStatus.NOT_FOUND),
    (StoreBusyError, HTTPStatus.SERVICE_UNAVAILABLE),
    (errors.LockedError, HTTPStatus.CONFLICT),
    (errors.PreflightError, HTTPStatus.CONFLICT),
    (errors.ConfigError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (errors.RecordingError, HTTPStatus.UNPROCESSABLE_ENTITY),  # a damaged run harms itself only
    (errors.DataQualityError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (errors.EstimationError, HTTPStatus.UNPROCESSABLE_ENTITY),
)


def status_of(error: RidDaqError) -> HTTPStatus:
    """Return the status that a client gets for an error."""
    for kind, status in _STATUS:
        if isinstance(error, kind):
            return status
    return HTTPStatus.INTERNAL_SERVER_ERROR
