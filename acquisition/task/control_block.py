"""`ControlBlock`: shared memory for the state of a motion's processes."""

from __future__ import annotations

import ctypes

from acquisition.motion.samples import Phase
from acquisition.task.helper_words import MonitorWords, RecorderWords
from acquisition.task.program_words import ProgramWords
from acquisition.task.shared_block import SharedBlock
from acquisition.task.shared_memory import SharedMemory
from acquisition.task.states import TaskProgress, TaskState
from acquisition.task.task_words import TaskWords


class _Words(ctypes.Structure):
    _fields_ = (
        ("program", ProgramWords),
        ("task", TaskWords),
        ("recorder", RecorderWords),
        ("monitor", MonitorWords),
    )


class ControlBlock(SharedBlock):
    """Shared memory of a motion's processes; each part has one writer.

    Attributes:
        program, task, recorder, monitor: Fields that the process of this name writes.
    """

    LABEL = "rid-daq-control-3"
    WORDS = _Words

    def __init__(self, memory: SharedMemory) -> None:
        super().__init__(memory)
        self.program: ProgramWords = self._words.program
        self.task: TaskWords = self._words.task
        self.recorder: RecorderWords = self._words.recorder
        self.monitor: MonitorWords = self._words.monitor

    @classmethod
    def create(cls) -> ControlBlock:
        """Return the block of a motion that has not begun."""
        block = super().create()
        block.task.set_progress(-1, Phase.APPROACH, 0)
        return block

    @classmethod
    def of_process(cls, pid: int) -> ControlBlock | None:
        """Return the control block of the motion that a process runs now; None without a motion.

        Raises:
            PermissionError: The process belongs to another user.
        """
        return next((each for each in cls.all_of_process(pid) if not each.task_gone), None)

    @property
    def task_gone(self) -> bool:
        """True if the task has ended, as reported by the task or the program."""
        return self.task.state is TaskState.FINISHED or self.program.task_gone

    @property
    def progress(self) -> TaskProgress:
        """Progress of the task."""
        return TaskProgress(
            state=self.task.state,
            phase=self.task.phase,
            sample_index=self.task.sample_index,
            cycles=self.task.cycles,
            temperature_k=self.monitor.temperatures(self.program.monitored),
        )
