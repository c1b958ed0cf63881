"""Load data in the format of each controller, with the right units, axes and order.

Every format is a pair of functions, body to text and text to body, so that a written text can be
read back and compared. Inertia is about the centre of gravity, and positions are relative to the
flange (the robot file's tool frame). Each text states its units and its frame at its top.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError, EstimationError
from identification.choices import LoadFormat
from identification.payload.body import PayloadBody
from identification.payload.controllers.by_elements import (
    from_fanuc,
    from_franka,
    from_staubli,
    from_ur,
    from_ur_ros2,
    from_urdf,
    to_fanuc,
    to_franka,
    to_staubli,
    to_ur,
    to_ur_ros2,
    to_urdf,
)
from identification.payload.controllers.by_principal_axes import (
    from_abb,
    from_kuka,
    to_abb,
    to_kuka,
)
from identification.payload.controllers.text import Digits, number_writer

PRECISION: Final = 1e-8
FEWEST_DIGITS: Final = 3
MOST_DIGITS: Final = 12
MOST_ROUNDING: Final = 5e-4
LARGEST_TEXT: Final = 1_000_000


@dataclass(frozen=True)
class _Codec:
    """Writer and reader of one format; `whole_inertia` is True if it has products of inertia."""

    write: Callable[[PayloadBody, tuple[str, ...], Digits], str]
    read: Callable[[str], PayloadBody]
    whole_inertia: bool = True


def load_data(
    body: PayloadBody, to: LoadFormat, origin: tuple[str, ...] = (), sure: float = 0.0
) -> str:
    """Return a payload in a maker's format, with only as many digits as are known.

    Args:
        body: The payload, relative to the flange.
        to: The format.
        origin: Lines on the origin of the values; control characters are removed.
        sure: Largest allowed `deviation` of the text from the body, from `rounding`; with 0, all
            digits are written.

    Raises:
        EstimationError: The body is not physically consistent, or the controller would refuse it.
    """
    if not body.is_consistent:
        raise EstimationError(
            "no body can have this mass and inertia: the principal moments must be positive, and"
            " none may exceed the sum of the other two; the load data are not written",
            code="RID-PAYLOAD-IMPOSSIBLE",
        )
    lines = tuple("".join(c for c in line if c.isprintable()) for line in origin)
    worst = math.inf
    for count in range(FEWEST_DIGITS if sure > PRECISION else MOST_DIGITS, MOST_DIGITS + 1):
        text = _CODECS[to].write(body, lines, number_writer(count))
        try:
            found = read_load_data(text, to)
        except ConfigError:  # with so few digits the text is not valid
            continue
        worst = deviation(body, found, to)
        if worst <= max(sure, PRECISION) and (found.is_consistent or count == MOST_DIGITS):
            return text
    raise EstimationError(
        f"load data written for {to.value} differ by {worst:.1e} when read back: the text is"
        " discarded",
        code="RID-INTERNAL-ERROR",
    )


def rounding(body: PayloadBody, sigma: FloatArray) -> float:
    """Return the largest allowed `deviation` of a text from a body.

    The limit is a twentieth of the interval of the most accurate value, and at most half of the
    tolerance of `read-back`.

    Args:
        body: The payload.
        sigma: Shape (10,). Standard deviations of `REPORTED`; 0 for values that were known before.
    """
    sizes = np.array(
        [
            body.mass_kg,
            *[max(float(np.linalg.norm(body.centre_m)), 1e-3)] * 3,
            *[float(np.linalg.eigvalsh(body.inertia_kg_m2)[-1])] * 6,
        ]
    )
    shares = 2.0 * sigma / sizes
    known = shares[shares > 0.0]
    return min(0.05 * float(known.min()), MOST_ROUNDING) if known.size else 0.0


_UNREADABLE: Final = (
    ValueError,
    KeyError,
    TypeError,
    IndexError,
    OverflowError,
    RecursionError,
    EstimationError,
)


def read_load_data(text: str, form: LoadFormat) -> PayloadBody:
    """Return the payload in a text of a maker's format.

    Raises:
        ConfigError: The text is not in this format.
    """
    if len(text) > LARGEST_TEXT:
        raise ConfigError(
            "the text is too large for load data: use a file of `payload export`",
            code="RID-FILE-SIZE",
        )
    try:
        return _CODECS[form].read(text)
    except _UNREADABLE as error:
        raise ConfigError(
            f"not load data of the format {form.value}: {error}", code="RID-LOAD-DATA-FORMAT"
        ) from None


def deviation(wanted: PayloadBody, found: PayloadBody, form: LoadFormat) -> float:
    """Return the largest difference of two payloads, relative to the size of the first one.

    Mass is relative to the mass, the centre to its distance (at least 1 mm), inertia to the largest
    principal moment. Products of inertia are compared if the format has them.
    """
    reach = max(float(np.linalg.norm(wanted.centre_m)), 1e-3)
    moment = float(np.linalg.eigvalsh(wanted.inertia_kg_m2)[-1])
    inertia = np.abs(found.inertia_kg_m2 - wanted.inertia_kg_m2) / moment
    if not _CODECS[form].whole_inertia:
        inertia = np.diagonal(inertia)
    return float(
        max(
            abs(found.mass_kg / wanted.mass_kg - 1.0),
            np.max(np.abs(found.centre_m - wanted.centre_m)) / reach,
            np.max(inertia),
        )
    )


_CODECS: Final[dict[LoadFormat, _Codec]] = {
    LoadFormat.KUKA: _Codec(to_kuka, from_kuka),
    LoadFormat.ABB: _Codec(to_abb, from_abb),
    LoadFormat.FANUC: _Codec(to_fanuc, from_fanuc, whole_inertia=False),
    LoadFormat.UR: _Codec(to_ur, from_ur),
    LoadFormat.UR_ROS2: _Codec(to_ur_ros2, from_ur_ros2),
    LoadFormat.FRANKA: _Codec(to_franka, from_franka),
    LoadFormat.STAUBLI: _Codec(to_staubli, from_staubli),
    LoadFormat.URDF: _Codec(to_urdf, from_urdf),
}
