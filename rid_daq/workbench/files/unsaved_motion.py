"""`UnsavedMotion`: text of a motion file that is not saved yet."""

from __future__ import annotations

from acquisition.motion.motion_file import AnyMotion, parse_motion
from config.load import LoadedCell
from rid_daq.operations.cell_files import refuse_other_robot_motion
from rid_daq.service.records import Record
from rid_daq.service.request_check import refuse_table_outside, require_inside
from rid_daq.service.service import CellService


class UnsavedMotion(Record):
    """Text of a motion file, and the path at which it will be saved."""

    file: str
    text: str

    def motion(self, service: CellService, loaded: LoadedCell) -> AnyMotion:
        """Return the motion.

        Args:
            service: The service, in whose folder the table of the motion must be.
            loaded: Cell that will execute the motion.

        Raises:
            ConfigError: The text is not a motion file or is for another robot, or its table is
                missing, invalid or outside the folder.
        """
        path = require_inside(self.file, service.folder)
        content = self.text.encode()
        refuse_table_outside(path, content, service.folder)
        motion = parse_motion(content, path.name).with_file_data(path.parent)
        refuse_other_robot_motion(path, motion, loaded)
        return motion
