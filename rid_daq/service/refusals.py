"""Errors of the service's refusals, and their HTTP status codes."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Final

from config import errors
from config.errors import RidDaqError, ServiceError

if TYPE_CHECKING:
    import httpx


class NotAllowedError(ServiceError):
    """The caller's role does not allow the request."""


class UnknownError(ServiceError):
    """The service has no such cell, job, run or file."""


class FileChangedError(ServiceError):
    """A file is not in the version that the caller wants to replace."""


class NotKnownError(ServiceError):
    """The sender is unknown: the request needs a token."""


class StoreBusyError(ServiceError):
    """The service's database cannot be read or written now."""


_STATUS: tuple[tuple[type[RidDaqError], HTTPStatus], ...] = (
    (NotKnownError, HTTPStatus.UNAUTHORIZED),
    (NotAllowedError, HTTPStatus.FORBIDDEN),
    (UnknownError, HTTPStatus.NOT_FOUND),
    (FileChangedError, HTTPStatus.PRECONDITION_FAILED),
    (StoreBusyError, HTTPStatus.SERVICE_UNAVAILABLE),
    (errors.LockedError, HTTPStatus.CONFLICT),
    (errors.PreflightError, HTTPStatus.CONFLICT),
    (errors.ConfigError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (
        errors.RecordingError,
        HTTPStatus.UNPROCESSABLE_ENTITY,
    ),  # a damaged run does not affect the rest of the service
    (errors.DataQualityError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (errors.EstimationError, HTTPStatus.UNPROCESSABLE_ENTITY),
)

_REFUSALS: Final[dict[str, type[RidDaqError]]] = {
    each.__name__: each for each in (FileChangedError, NotAllowedError, NotKnownError, UnknownError)
}


def http_status(error: RidDaqError) -> HTTPStatus:
    """Return the HTTP status code of an error."""
    for kind, status in _STATUS:
        if isinstance(error, kind):
            return status
    return HTTPStatus.INTERNAL_SERVER_ERROR


def error_from_answer(answer: httpx.Response) -> RidDaqError:
    """Return the error that an answer of the service describes."""
    try:
        document = answer.json()
        name, message = str(document["error"]), str(document["message"])
        code = str(document.get("code", ""))
    except (AttributeError, ValueError, KeyError, TypeError):
        return ServiceError(
            f"the service answered with status {answer.status_code} {answer.reason_phrase}",
            code="RID-SERVICE-UNREACHABLE",
        )
    named = getattr(errors, name, None)
    if name in _REFUSALS:
        return _REFUSALS[name](message, code=code)
    if isinstance(named, type) and issubclass(named, RidDaqError):
        return named(message, code=code)
    return ServiceError(message, code=code)
