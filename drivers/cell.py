"""`Cell`: the opened devices. Leaving its `with` stops and disables, whatever happened."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from config.cell.cell import CellConfig
from config.errors import DeviceFaultError, DriverError, RidDaqError
from config.robot.robot import RobotDescription
from drivers.ports.can_link import CanLink, open_can
from drivers.ports.clock import Clock
from drivers.servo.axes import CanServoAxes
from drivers.settings.write_log import WriteLog


class Cell:
    """The devices of one cell, open.

    Attributes:
        config: The cell file.
        axes: The robot's drives.
        link: Their bus.
        clock: The time that every deadline of this cell is in.
    """

    def __init__(
        self,
        config: CellConfig,
        robot: RobotDescription,
        link: CanLink,
        write_log: WriteLog | None = None,
        *,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self.config = config
        self.axes = CanServoAxes(link, config, robot, write_log, stopped=stopped)
        self.clock: Clock = link.clock
        self.link = link

    def __enter__(self) -> Cell:
        """Return the cell itself."""
        return self

    def __exit__(self, _kind: object, error: BaseException | None, *_: object) -> None:
        """Quick stop, disable voltage, NMT pre-operational, close the bus: each one in any case.

        What goes wrong on the way is added as a note to the error that is under way; it is raised
        only when there is none.
        """
        troubles: list[RidDaqError] = []
        with ExitStack() as leaving:
            leaving.callback(_attempt, self.link.close, troubles)
            leaving.callback(_attempt, self._disable, troubles)
            leaving.callback(_attempt, self._halt, troubles)
        if not troubles:
            return
        if error is None:
            raise troubles[0]
        for trouble in troubles:
            error.add_note(f"while leaving the cell: {trouble}")

    def _halt(self) -> None:
        if not self.axes.halt():
            raise DeviceFaultError(
                "an axis was not seen at rest in time after the quick stop; use the emergency stop",
                code="RID-DRIVE-NOT-STOPPED",
            )

    def _disable(self) -> None:
        unconfirmed = self.axes.disable()
        if unconfirmed:
            raise DeviceFaultError(
                f"without confirmation that power is off: {', '.join(unconfirmed)}; make sure of it"
                " before entering the cell",
                code="RID-DRIVE-NOT-STOPPED",
            )


def open_cell(
    cell: CellConfig,
    robot: RobotDescription,
    write_log: WriteLog | None = None,
    *,
    stopped: Callable[[], bool] = lambda: False,
) -> Cell:
    """Open the devices of a cell; nothing is sent to them yet (`CanServoAxes.bring_up`).

    Args:
        cell, robot: The cell and its robot.
        write_log: Where what is written to the drives is kept, with what was there.
        stopped: Whether a stop was ordered; see `CanServoAxes`.

    Raises:
        ConfigError: Cell and robot do not fit, or the bus would be overloaded.
        TransportError: A bus cannot be opened.
    """
    link = open_can(cell.can)
    try:
        return Cell(cell, robot, link, write_log, stopped=stopped)
    except BaseException:
        link.close()
        raise


def _attempt(action: Callable[[], None], troubles: list[RidDaqError]) -> None:
    """Do one step of leaving; keep what goes wrong, so that the next step is done too."""
    try:
        action()
    except RidDaqError as error:
        troubles.append(error)
    except Exception as error:
        troubles.append(DriverError(f"{type(error).__name__}: {error}", code="RID-INTERNAL-ERROR"))
