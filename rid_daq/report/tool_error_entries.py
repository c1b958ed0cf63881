"""Path errors at the tool: estimated (`ToolDeflection`), and measured (`ToolSideSize`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rid_daq.report.sections.section import Section

if TYPE_CHECKING:
    from compensation.feedforward.deflection import Deflection
    from compensation.feedforward.tool_side import ToolSideError


class ToolDeflection(Section):
    """Estimated deflection at the tool point, from the gears whose stiffness is known.

    Attributes:
        rms_m: RMS deflection over the motion [m].
        max_m: Largest deflection over the motion [m].
        tool_mean_m: Mean distance of the tool from its path, estimated from encoders and
            deflection [m]; left out if the desired path is not known.
        tool_max_m: Largest distance of the tool from its path, estimated from encoders and
            deflection [m]; left out if the desired path is not known.
    """

    rms_m: float
    max_m: float
    tool_mean_m: float | None = None
    tool_max_m: float | None = None

    @classmethod
    def of(cls, bent: Deflection) -> ToolDeflection:
        """Return the size of a deflection and of the tool's error."""
        off = bent.tool_error_m
        mean, most = (None, None) if off is None else (float(off.mean()), float(off.max()))
        return cls(rms_m=bent.rms_m, max_m=bent.max_m, tool_mean_m=mean, tool_max_m=most)


class ToolSideSize(Section):
    """Path errors of one run at the tool, measured by an external instrument.

    Attributes:
        run: Id of the run.
        file: Name of the tracker file.
        rows: Number of measured points in the motion's main part.
        share: Share of the main part that the instrument measured.
        mean_m: Mean distance of the measured from the desired point [m].
        max_m: Largest distance [m].
        motor_mean_m: Mean distance at the motor encoders [m].
        clock_offset_s: Time of the instrument minus time of the run [s].
        clock_ppm: Rate of the instrument's clock relative to the run's, minus 1 [1e-6].
        residual_m: RMS distance between the measured path and that by the motor encoders [m].
    """

    run: str
    file: str
    rows: int
    share: float = 1.0
    mean_m: float
    max_m: float
    motor_mean_m: float
    clock_offset_s: float
    clock_ppm: float
    residual_m: float

    @classmethod
    def of(cls, error: ToolSideError, *, run: str, file: str, motor_mean_m: float) -> ToolSideSize:
        """Return the size of a run's errors at the tool."""
        clock = error.alignment
        return cls(
            run=run,
            file=file,
            rows=len(error.time_s),
            share=error.share,
            mean_m=error.mean_m,
            max_m=error.max_m,
            motor_mean_m=motor_mean_m,
            clock_offset_s=clock.offset_s,
            clock_ppm=1e6 * clock.rate,
            residual_m=clock.residual_m,
        )
