"""Modules and kernels of processes; `forked_processes` imports this module in its server."""

from __future__ import annotations

from acquisition.session.cycle_recorder import run_recorder as run_recorder
from acquisition.session.drive_monitor import run_monitor as run_monitor
from acquisition.session.frame_recorder import run_frame_recorder as run_frame_recorder
from acquisition.session.plate_recorder import run_plate_recorder as run_plate_recorder
from acquisition.task.process import run_cyclic_task as run_cyclic_task
from compensation.online.point_server import run_point_server as run_point_server
from config.load import load_cell
from mock_hw.drives_process import serve_drives as serve_drives
from mock_hw.plant.tracker import Tracker as Tracker
from mock_hw.plate_service import PlateService as PlateService
from mock_hw.rack import DriveRack
from mock_hw.rack_loop import LONGEST_WAIT_S
from rid_daq.live.live_process import run_live_page as run_live_page
from tests.builders.forked_processes import ForkedProcess as ForkedProcess

_cell = load_cell("ir361")
assert _cell.plant is not None
DriveRack(_cell.config, _cell.robot, _cell.plant, 1).advance(LONGEST_WAIT_S)
