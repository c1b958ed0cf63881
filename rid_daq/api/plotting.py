"""`plot`: figures of recordings, models, validations, motions and payloads."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from config.errors import ConfigError
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.plot import Plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@runtime_checkable
class Shown(Protocol):
    """A result of the API that consists of blocks."""

    def blocks(self) -> Iterable[AnyBlock]:
        """Return the texts, tables and plots of the result."""
        ...


def plot(result: Shown) -> Figure:
    """Return a figure of a result, drawn by matplotlib.

    The figure shows a recording or motion over time, the friction of a model over speed, the
    torques of a validation, the centre of gravity of a payload, or the torques of a retimed path.

    Args:
        result: A result of this API.

    Returns:
        A figure: a notebook shows it, and its `savefig` writes it.

    Raises:
        ConfigError: The result has no plot (RID-API-ARGUMENT).
    """
    given: object = result  # a notebook has no type checker
    blocks = given.blocks() if isinstance(given, Shown) else ()
    found = next((each for each in blocks if isinstance(each, Plot)), None)
    if found is None:
        raise ConfigError(
            f"{type(result).__name__}: this result has no plot; give a Recording, Motion or Model,"
            " a Validation of one recording, or a Payload whose centre of gravity is known",
            code="RID-API-ARGUMENT",
        )
    # Imported late, because this module imports two plot libraries.
    from rid_daq.report_page.drawings.plot import matplotlib_figure

    return matplotlib_figure(found)
