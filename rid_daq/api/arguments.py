"""Check the arguments of the public functions, so that every refusal is a `RidDaqError`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ValidationError

from config.arrays import FloatArray
from config.errors import ConfigError, EstimationError
from config.robot.robot import RobotDescription
from config.wrong_value import explain_error
from identification.estimation.estimate import Estimate
from identification.payload.carried import contains_payload

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)

ARGUMENT = "RID-API-ARGUMENT"
MOST_NAME_BYTES = 255
"""Longest name of a file on the usual file systems."""


def require(name: str, value: object, kind: type[T]) -> T:
    """Return an argument of the expected type.

    Raises:
        ConfigError: It has another type.
    """
    if not isinstance(value, kind):
        raise _wrong_kind(name, value, f"a {kind.__name__}")
    return value


def _wrong_kind(name: str, value: object, expected: str) -> ConfigError:
    return ConfigError(
        f"{name}: {type(value).__name__} {str(value)[:40]!a}; give {expected}", code=ARGUMENT
    )


def require_each(name: str, value: T | Iterable[T], kind: type[T]) -> list[T]:
    """Return one object, or several, as a list.

    Raises:
        ConfigError: One of them has another type.
    """
    if isinstance(value, kind):
        return [value]
    if isinstance(value, str) or not isinstance(value, Iterable):
        require(name, value, kind)
        raise AssertionError("unreachable")
    return [require(f"{name}[{number}]", each, kind) for number, each in enumerate(value)]


def as_path(name: str, value: object) -> Path:
    """Return a path.

    Raises:
        ConfigError: It is neither a text nor a path, or no file can have this name.
    """
    path = Path(value) if isinstance(value, str) else require(name, value, Path)
    try:
        is_name = "\0" not in str(path) and all(
            len(os.fsencode(part)) <= MOST_NAME_BYTES for part in path.parts
        )
    except UnicodeEncodeError:
        is_name = False
    if not is_name:
        raise ConfigError(f"{name}: no file can have the name {str(path)[:40]!a}", code=ARGUMENT)
    return path


def as_paths(name: str, values: object) -> tuple[Path, ...]:
    """Return several paths.

    Raises:
        ConfigError: It is not a list or tuple of paths.
    """
    return tuple(as_path(f"{name}[{i}]", each) for i, each in enumerate(_several(name, values)))


def as_texts(name: str, values: object) -> tuple[str, ...]:
    """Return several texts.

    Raises:
        ConfigError: It is not a list or tuple of texts.
    """
    return tuple(
        require(f"{name}[{i}]", each, str) for i, each in enumerate(_several(name, values))
    )


def _several(name: str, values: object) -> Sequence[object]:
    if not isinstance(values, list | tuple):
        raise _wrong_kind(name, values, "a list")
    return values


def as_mapping(name: str, values: object) -> Mapping[str, Any]:
    """Return a mapping; None counts as empty.

    Raises:
        ConfigError: It is neither a mapping nor None, or a key is not a text.
    """
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise _wrong_kind(name, values, "a mapping of fields")
    for key in values:
        require(f"{name}: key", key, str)
    return values


def require_callable(name: str, value: object) -> None:
    """Raise an error if an optional function is given and cannot be called.

    Raises:
        ConfigError: It is neither None nor callable.
    """
    if value is not None and not callable(value):
        raise _wrong_kind(name, value, "a function")


def as_numbers(name: str, values: npt.ArrayLike, *, finite: bool = True) -> FloatArray:
    """Return an argument as an array of real numbers.

    Args:
        name: Name of the argument.
        values: The argument; masked values count as NaN.
        finite: False if the caller treats NaN itself, such as damaged rows of a recording.

    Raises:
        ConfigError: The values are not real numbers, are ragged, or are not finite.
    """
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    try:
        found = np.asarray(values)
    except ValueError:
        raise ConfigError(f"{name}: rows of different lengths; give a table", code=ARGUMENT) from (
            None
        )
    if found.dtype.kind not in "iuf":
        how = " such as (t - t[0]) / numpy.timedelta64(1, 's')" if found.dtype.kind in "mM" else ""
        raise ConfigError(
            f"{name}: values of type {found.dtype}; give real numbers{how}", code=ARGUMENT
        )
    if finite and not np.isfinite(found).all():
        place = tuple(np.argwhere(~np.isfinite(found))[0].tolist())
        where = f"[{', '.join(map(str, place))}]" if place else ""
        raise ConfigError(
            f"{name}{where}: {found[place]} is not a finite number; give finite values only",
            code=ARGUMENT,
        )
    return found.astype(np.float64)


def as_samples(robot: RobotDescription, *arrays: npt.ArrayLike) -> list[FloatArray]:
    """Return arrays with one row per sample; a single sample becomes one row.

    Raises:
        ConfigError, EstimationError: An array does not contain finite numbers, or its shape is not
            (samples, joints) or (joints,), the same for all.
    """
    names, found = robot.joint_names, []
    for each in arrays:
        table = as_numbers("array", each)
        if (
            table.shape != np.shape(arrays[0])
            or table.shape[-1:] != (len(names),)
            or table.ndim > 2
        ):
            raise EstimationError(
                f"array of shape {table.shape}: give (samples, {len(names)}) or ({len(names)},),"
                f" the same shape for all arrays; the joints are {', '.join(names)}",
                code=ARGUMENT,
            )
        found.append(np.atleast_2d(table))
    return found


def as_motion(
    robot: RobotDescription, position: npt.ArrayLike, *others: npt.ArrayLike
) -> list[FloatArray]:
    """Return positions, and arrays of the same shape, with one row per sample.

    Raises:
        ConfigError, EstimationError: As for `as_samples`; or a position is beyond a limit by more
            than the joint's range.
    """
    found = as_samples(robot, position, *others)
    refuse_far_positions(robot, found[0])
    return found


def refuse_far_positions(
    robot: RobotDescription, position: FloatArray, most_rows: float = 0.0
) -> None:
    """Refuse positions that are probably in another unit, such as degrees, or have another zero.

    Args:
        robot: The robot that has the positions.
        position: Shape (samples, joints). Positions; NaN is ignored.
        most_rows: Fraction of the rows that may be far beyond a limit, because they are damaged.

    Raises:
        ConfigError: More than `most_rows` of a joint's positions are beyond a limit by more than
            the joint's range.
    """
    for joint, values in zip(robot.joints, position.T, strict=True):
        low, high = joint.limits.position_min, joint.limits.position_max
        far = values[(values < 2.0 * low - high) | (values > 2.0 * high - low)]
        if len(far) > most_rows * len(values):
            raise ConfigError(
                f"position of {joint.name}: {far[0]:.4g} {joint.unit} is far beyond its limits,"
                f" {low:.4g} and {high:.4g} {joint.unit}; give positions in {joint.unit}, from the"
                " zero of the robot description",
                code=ARGUMENT,
            )


def plain(value: object) -> Any:
    """Return a value with numpy's numbers and arrays, also inside containers, as plain numbers."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return type(value)([plain(each) for each in value])
    return value


def validated(kind: type[M], values: Mapping[str, Any]) -> M:
    """Return a model of a file from arguments.

    Raises:
        ConfigError: A value is not allowed; the text names it.
    """
    try:
        return kind(**values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        first["input"] = plain(first["input"])
        raise ConfigError(f"{where}: {explain_error(first)}", code=ARGUMENT) from None


def with_options(own: Mapping[str, Any], options: object) -> dict[str, Any]:
    """Return the fields of a request: a function's own arguments and further `options`.

    Raises:
        ConfigError: `options` is not a mapping, or has a field that an argument determines.
    """
    options = as_mapping("options", options)
    twice = [each for each in options if each in own]
    if twice:
        raise ConfigError(
            f"options: {', '.join(twice)}: this function determines the field itself; use its"
            " arguments instead",
            code=ARGUMENT,
        )
    return {**own, **plain(options)}


def require_stated_payload(estimate: Estimate) -> None:
    """Refuse a model that contains a payload, because nothing states what the robot carries.

    Raises:
        EstimationError: The model contains a payload.
    """
    if contains_payload(estimate):
        raise EstimationError(
            "the model contains a payload: use model.with_payload('model') for the robot with"
            " it, or model.with_payload('none') for the robot alone",
            code="RID-PAYLOAD-UNSTATED",
        )
