"""`Validation`: predicted torque of a recording, compared with its measured torque."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from config.arrays import BoolArray, FloatArray
from config.robot.robot import RobotDescription
from rid_daq.api.console import text_of
from rid_daq.blocks.block import AnyBlock, Verdict
from rid_daq.operations.identify.torque_verdict import TorqueVerdict
from rid_daq.report.section_blocks.curves import torque_plot
from rid_daq.report.section_blocks.validation import run_errors_table, validation_blocks
from rid_daq.report.sections.curves import TorqueCurves
from rid_daq.report.sections.validation import RunErrors


@dataclass(frozen=True, eq=False)
class Validation:
    """Error of the torques that a model predicts for a recording not used to identify it.

    Only samples of moving joints count, because friction at standstill is stiction. `print` shows
    the errors joint by joint, their likely causes, and the verdict.

    Attributes:
        judged: Result of the operation `validate`.
        robot: The robot.
        runs: Errors of each recording, if several were judged together.
    """

    judged: TorqueVerdict
    robot: RobotDescription
    runs: tuple[RunErrors, ...] = ()

    @property
    def passed(self) -> bool:
        """False if a torque error, or a value of the base wrench, is above its limit."""
        return self.judged.verdict.passed is not False

    @property
    def relative_error_percent(self) -> FloatArray:
        """Shape (joints,). RMS error over RMS torque [%]."""
        return self.judged.validation.relative_percent

    @property
    def rms_error_nm(self) -> FloatArray:
        """Shape (joints,). RMS of measured minus predicted torque [N m or N]."""
        return self.judged.validation.rms_nm

    @property
    def time_s(self) -> FloatArray:
        """Shape (samples,). Times of the torques [s]."""
        return self.judged.validation.time_s

    @property
    def measured_nm(self) -> FloatArray:
        """Shape (samples, joints). Measured torques, low-passed [N m or N]."""
        return self.judged.validation.measured_nm

    @property
    def predicted_nm(self) -> FloatArray:
        """Shape (samples, joints). Predicted torques, low-passed [N m or N]."""
        return self.judged.validation.predicted_nm

    @property
    def counted(self) -> BoolArray:
        """Shape (samples, joints). True for samples that enter the error."""
        return self.judged.validation.counted

    @property
    def findings(self) -> tuple[str, ...]:
        """Likely causes of the errors; one sentence each."""
        return self.judged.section.diagnosis or ()

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the errors, their likely causes, a plot or table, and the verdict.

        The plot shows the torques of one recording over time. Several recordings have a table of
        their errors instead.
        """
        yield from validation_blocks(self.judged.section)
        if self.runs:
            yield run_errors_table(self.runs)
        else:
            yield torque_plot(TorqueCurves.of(self.judged.validation, self.robot))
        yield Verdict(passed=self.judged.verdict.passed, text=self.judged.verdict.headline)

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return str(self)
