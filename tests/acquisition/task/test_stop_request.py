"""Stop request (button of the live page, `rid-daq stop`) in the frames on the bus."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.set_points import PlannedMotion
from acquisition.task.states import TaskState
from acquisition.task.stop_orders import StopOrders
from config.load import load_cell
from drivers.cell import open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation

AT_CYCLE = 60
QUICK_STOP, SYNC = "0200", "080"


@pytest.mark.fault(23)
@pytest.mark.slow
def test_every_axis_gets_its_quick_stop_before_the_next_sync(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    loaded = load_cell("ir361")
    assert loaded.plant is not None
    robot, log = loaded.robot, tmp_path / "bus.log"
    motion = FourierMotion(
        kind="fourier",
        robot="ir361",
        period_s=2.0,
        periods=50,
        ramp_s=1.0,
        joints=tuple(
            FourierJoint(joint=name, sine=(0.3,), cosine=(0.0,)) for name in robot.joint_names
        ),
    )
    samples = motion.plan(robot, loaded.config.cycle_time_s)
    control, ring = ControlBlock.create(), Ring.create(3, 4096)
    looks = 0

    def ask_in_mid_motion() -> bool:
        """Request a stop. The task calls this function once a cycle, after its check for stop
        requests.
        """
        nonlocal looks
        looks += control.task.state is TaskState.MOVING
        if looks == AT_CYCLE:
            control.program.request_stop(StopCode.STOP_BUTTON)
        return False

    with (
        SimulatedCell(
            CellSimulation(loaded.config, robot, loaded.plant, realtime=False, seed=1, log=log)
        ) as cell,
        open_cell(cell.cell, robot) as opened,
    ):
        opened.axes.bring_up()
        opened.axes.start()
        reason = CyclicTask(
            opened.axes, opened.clock, cell.cell, robot, ring, control,
            lockstep=True, orders=StopOrders(control, ask_in_mid_motion),
        ).run(PlannedMotion(samples))  # fmt: skip
        assert not cell.axes().enabled.any()
    assert reason is not None
    assert reason.code is StopCode.STOP_BUTTON
    assert control.task.ramp_s is not None
    frames = [line.split()[-1].partition("#") for line in log.read_text().splitlines()]
    set_points = [f"{0x200 + axis.node_id:03X}" for axis in loaded.config.axes]
    first = next(
        i for i, (name, _, data) in enumerate(frames)
        if name == set_points[0] and data.startswith(QUICK_STOP)
    )  # fmt: skip
    stopped = [name for name, _, data in frames[first:] if data.startswith(QUICK_STOP)][:3]
    assert sorted(stopped) == set_points
    before = [name for name, _, _ in frames[:first]]
    last_set_point = len(before) - 1 - before[::-1].index(set_points[-1])
    syncs = before[last_set_point:].count(SYNC)
    between = [name for name, _, _ in frames[first : first + 6]].count(SYNC)
    assert syncs + between <= 1
    measured(
        f"every axis got the quick stop within {syncs + between} SYNC of the request; at rest"
        f" {control.task.ramp_s:.3f} s later"
    )


CHILD = """
import sys
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
over = ControlBlock.create()
over.task.state = TaskState.FINISHED
control = ControlBlock.create()
print("ready", flush=True)
sys.stdin.readline()
print(control.program.stop_code, over.program.stop_code)
"""


def test_another_program_finds_the_running_motion_of_a_process() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CHILD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        program.stdout.readline()
        control = ControlBlock.of_process(program.pid)
        assert control is not None
        control.program.request_stop(StopCode.STOP_COMMAND)
        output, _ = program.communicate("\n", timeout=120.0)
    assert output == f"{int(StopCode.STOP_COMMAND)} 0\n"
    assert ControlBlock.of_process(program.pid) is None
