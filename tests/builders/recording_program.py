"""A program that records one motion and reports when it moves, for tests that interrupt it."""

from __future__ import annotations

RECORD = """
import json, sys
from pathlib import Path
from acquisition.session.record import record_motion
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription

def say(progress):
    if progress.phase == Phase.MAIN:
        print("moving", flush=True)

cell, robot, motion, folder = json.loads(sys.argv[1])
cell = CellConfig.model_validate_json(cell)
robot = RobotDescription.model_validate_json(robot)
samples = FourierMotion.model_validate_json(motion).plan(robot, cell.cycle_time_s)
record_motion(cell, robot, samples, RunFolder.open(Path(folder)), on_progress=say)
"""
