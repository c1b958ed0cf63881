"""`Cell`: the open devices of a cell; the end of its `with` block stops and disables the drives."""

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
    """The open devices of one cell.

    Attributes:
        config: The cell file.
        axes: The robot's drives.
        link: The CAN bus of the drives.
        clock: Clock to which all deadlines of this cell refer.
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
        """Stop and disable the drives, then close the bus; every step runs, even after a failure.

        The steps are: quick stop, disable voltage with NMT pre-operational, close the bus. If the
        `with` block raised an error, the failures of the steps are added to it as notes. Otherwise
        the first failure is raised.
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
                "an axis did not reach standstill in time after the quick stop; use the emergency"
                " stop",
                code="RID-DRIVE-NOT-STOPPED",
            )

    def _disable(self) -> None:
        unconfirmed = self.axes.disable()
        if unconfirmed:
            raise DeviceFaultError(
                f"power off is not confirmed: {', '.join(unconfirmed)}; make sure that the power is"
                " off before you enter the cell",
                code="RID-DRIVE-NOT-STOPPED",
            )


def open_cell(
    cell: CellConfig,
    robot: RobotDescription,
    write_log: WriteLog | None = None,
    *,
    stopped: Callable[[], bool] = lambda: False,
) -> Cell:
    """Open the devices of a cell; send nothing to them (`CanServoAxes.bring_up` begins).

    Args:
        cell, robot: The cell and its robot.
        write_log: Log of the values that are written by SDO, with the previous values.
        stopped: Returns True once a stop was ordered; see `CanServoAxes`.

    Raises:
        ConfigError: Cell and robot do not fit, or the bus would be overloaded.
        TransportError: The bus cannot be opened.
    """
    link = open_can(cell.can)
    try:
        return Cell(cell, robot, link, write_log, stopped=stopped)
    except BaseException:
        link.close()
        raise


def _attempt(action: Callable[[], None], troubles: list[RidDaqError]) -> None:
    """Run one step of closing the cell; store its error, so that the next step also runs."""
    try:
        action()
    except RidDaqError as error:
        troubles.append(error)
    except Exception as error:
        troubles.append(DriverError(f"{type(error).__name__}: {error}", code="RID-INTERNAL-ERROR"))
