"""Refusals of the service, each with the status that a client gets."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Final

from config import errors
from config.errors import RidDaqError, ServiceError

if TYPE_CHECKING:
    import httpx


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

_REFUSALS: Final[dict[str, type[RidDaqError]]] = {
    each.__name__: each for each in (NotAllowedError, NotKnownError, UnknownError)
}


def status_of(error: RidDaqError) -> HTTPStatus:
    """Return the status that a client gets for an error."""
    for kind, status in _STATUS:
        if isinstance(error, kind):
            return status
    return HTTPStatus.INTERNAL_SERVER_ERROR


def refusal_of(answer: httpx.Response) -> RidDaqError:
    """Return the error that an answer names."""
    try:
        told = answer.json()
        name, message = str(told["error"]), str(told["message"])
        code = str(told.get("code", ""))
    except (AttributeError, ValueError, KeyError, TypeError):
        return ServiceError(
            f"the service answers {answer.status_code} {answer.reason_phrase}",
            code="RID-SERVICE-UNREACHABLE",
        )
    named = getattr(errors, name, None)
    if name in _REFUSALS:
        return _REFUSALS[name](message, code=code)
    if isinstance(named, type) and issubclass(named, RidDaqError):
        return named(message, code=code)
    return ServiceError(message, code=code)
