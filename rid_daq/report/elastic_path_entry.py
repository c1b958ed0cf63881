"""`ElasticPathSection`: a path on elastic gears, without and with correction of the deflection."""

from __future__ import annotations

from rid_daq.report.sections.section import Numbers, Section
from rid_daq.report.tool_error_entries import ToolDeflection


class ElasticRun(Section):
    """Errors of the tool in one run.

    Attributes:
        estimated: Errors estimated from the encoders, the model and the stiffness.
        measured_mean_m: Mean distance from the path that a laser tracker measured [m]. Its clock
            and frame are fitted to the path, so a shift or rotation of the whole path is not
            visible.
        measured_max_m: Largest distance that the tracker measured [m].
        motor_mean_m: Mean distance at the motor encoders [m].
    """

    estimated: ToolDeflection
    measured_mean_m: float
    measured_max_m: float
    motor_mean_m: float


class ElasticPathSection(Section):
    """Path errors at the tool for two runs of one path.

    Attributes:
        sentence: Description of the path.
        largest_deflection: Largest deflection of each gear that the corrected motion contains [rad
            or m].
        rigid: Run with the feedforward of rigid gears.
        corrected: Run with corrected deflection.
    """

    sentence: str
    largest_deflection: Numbers
    rigid: ElasticRun
    corrected: ElasticRun

    @property
    def estimated_m(self) -> tuple[float, float]:
        """Estimated mean error of the tool without and with correction [m]."""
        before, after = self.rigid.estimated.tool_mean_m, self.corrected.estimated.tool_mean_m
        assert before is not None
        assert after is not None
        return before, after

    @property
    def measured_m(self) -> tuple[float, float]:
        """Measured mean error of the tool without and with correction [m]."""
        return self.rigid.measured_mean_m, self.corrected.measured_mean_m

    @property
    def words(self) -> str:
        """The errors of the tool as sentences."""
        estimated, measured = (
            f"{1e3 * before:.3f} mm before, {1e3 * after:.3f} mm after"
            for before, after in (self.estimated_m, self.measured_m)
        )
        return (
            f"{self.sentence} Elastic gears: mean distance of the tool, estimated, {estimated}"
            f" correction of the deflection; measured by a laser tracker whose frame is fitted to"
            f" the path, {measured}."
        )
