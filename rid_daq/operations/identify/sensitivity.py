"""`sensitivity`: effect of errors in the robot's parameters on a payload estimate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from config.plausible import Plausible
from config.ranges import Seed
from identification.choices import REPORTED, Share
from rid_daq.blocks.block import AnyBlock, Cells, Table, Text, table
from rid_daq.blocks.formats import number
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import FILES, CellName, DespiteMisfitOfModel, Option, Overwrite
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.sensitivity.cases import SensitivityRow
    from rid_daq.operations.payload.payload_sensitivity import Sensitivity

MONTE_CARLO: Final = "Monte Carlo"
_NO_DECIMAL: Final = 100.0  # percent


class SensitivityRequest(Request):
    """Compute the effect of errors in the robot's parameters on a payload estimate.

    The errors are of torque constants, links, rotors, coupling or gears. Each row simulates a robot
    that differs in one property from the assumed one, estimates the payload with the assumed robot,
    and gives the error in percent of the true value. The last column is the error of the torque
    that the estimate predicts on another motion. With --draws, noise and errors of the robot's
    parameters are drawn at random, on all cores or on a Dask cluster.
    """

    cell: CellName = "kr15"
    payload: Annotated[
        str,
        Field(
            description="Payload: a name in the plant file of the simulated cell, or a file that"
            " `payload identify` wrote."
        ),
        Option(metavar="PAYLOAD"),
    ] = "medium"
    against: Annotated[
        Literal["model", "difference"] | None,
        Field(
            description="Torques to subtract before the estimate: those of a model of the unloaded"
            " robot (model), or of a run without the payload (difference). If not set: difference"
            " for errors of torque constants, model for the other cases."
        ),
    ] = None
    model: Annotated[
        Path | None,
        Field(description="Model file of `identify`, for a robot that is not simulated."),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfitOfModel = False
    motion: Annotated[
        Path | None,
        Field(
            description="Motion file of a periodic motion; if not set, a motion with harmonics 1"
            " and 20 of a period of 30 s."
        ),
        Option(metavar="MOTION", file="input"),
    ] = None
    share_percent: Annotated[
        Share,
        Field(
            ge=0.001,
            le=90.0,
            description="Relative error of the assumed torque constants and link parameters.",
        ),
        Option(flag="share", unit="%"),
    ] = 10.0
    bias_nm: Annotated[
        float,
        Plausible(1e-2, 1e4, "N m"),
        Field(
            description="Constant torque error of axis 3, for the row 'torque bias' of the table."
        ),
        Option(flag="bias", unit="N m"),
    ] = -12.0
    draws: Annotated[
        int,
        Field(
            ge=0,
            le=10_000_000,
            description="Number of random draws of noise and parameter errors; 0 for none.",
        ),
        Option(group=MONTE_CARLO),
    ] = 0
    doubt_torque_percent: Annotated[
        Share,
        Field(description="Standard deviation of each torque constant, for the draws."),
        Option(group=MONTE_CARLO, flag="doubt-torque-constants", unit="%", needs="draws"),
    ] = 0.0
    doubt_links_percent: Annotated[
        Share,
        Field(description="Standard deviation of each link parameter, for the draws."),
        Option(group=MONTE_CARLO, flag="doubt-links", unit="%", needs="draws"),
    ] = 0.0
    doubt_rotors_percent: Annotated[
        Share,
        Field(description="Standard deviation of each rotor inertia, for the draws."),
        Option(group=MONTE_CARLO, flag="doubt-rotors", unit="%", needs="draws"),
    ] = 0.0
    seed: Annotated[
        Seed,
        Field(description="Random seed of the draws."),
        Option(group=MONTE_CARLO, needs="draws"),
    ] = 0
    scheduler: Annotated[
        str | None,
        Field(
            description="Address of a Dask scheduler that computes the draws, such as"
            " tcp://host:8786 (default: this computer)."
        ),
        Option(metavar="ADDRESS", group=FILES, needs="draws"),
    ] = None
    output: Annotated[
        Path | None,
        Field(description="File to which the table is written (CSV)."),
        Option(short="o", metavar="CSV", group=FILES, file="output", endings=(".csv",)),
    ] = None
    overwrite: Overwrite = False


@dataclass(frozen=True)
class SensitivityResult:
    """Errors of a payload estimate.

    Attributes:
        found: The table, and the random draws if requested.
    """

    request: SensitivityRequest
    found: Sensitivity

    def document(self) -> dict[str, object]:
        """Return the errors as numbers."""
        import numpy as np

        problem, drawn = self.found.problem, self.found.drawn
        document: dict[str, object] = {
            "robot": problem.robot.name,
            "parameters": list(REPORTED),
            "truth": problem.payload.reported.tolist(),
            "rows": [
                {
                    "number": row.case.number,
                    "case": row.case.words,
                    "against": row.against,
                    "percent": list(row.percent),
                    "torque_percent": list(row.torque_percent),
                }
                for row in self.found.rows
            ],
        }
        if drawn is not None:
            values = drawn.values
            document["monte_carlo"] = {
                "draws": len(values),
                "mean": values.mean(axis=0).tolist(),
                "std": values.std(axis=0, ddof=1).tolist(),
                "percentiles": {
                    str(p): np.percentile(values, p, axis=0).tolist() for p in (2.5, 50, 97.5)
                },
            }
        return document

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the errors of each case, the file name, and the results of the draws."""
        yield Text(
            text="Error of the estimate in percent of the true value; inertia about the centre"
            " of gravity. Before the estimate, a model of the unloaded robot or a run"
            " without the payload is subtracted. The column torque is the torque error on a"
            " motion that was not used for the estimate, of the axis with the largest error."
        )
        yield self._case_table()
        if self.request.output is not None:
            yield Text(text=f"Table: {self.request.output}")
        if self.found.drawn is not None:
            yield Text(
                text=f"{len(self.found.drawn.values)} random draws of noise and parameter errors:"
            )
            yield self._draw_table()

    def _case_table(self) -> Table:
        from identification.sensitivity.cases import DIFFERENCE

        return table(
            self.found.rows,
            Cells("", lambda row: row.case.number),
            Cells("wrong", lambda row: row.case.words),
            Cells("subtracted", lambda row: "a run" if row.against == DIFFERENCE else "a model"),
            *(_percent_column(name, i) for i, name in enumerate(REPORTED)),
            Cells("torque", lambda row: _percent_text(row.worst_torque_percent)),
            key=3,
        )

    def _draw_table(self) -> Table:
        from identification.payload.body import REPORTED_UNITS

        drawn = self.found.drawn
        assert drawn is not None
        spread = 2.0 * drawn.values.std(axis=0, ddof=1)
        true = self.found.problem.payload.reported
        return table(
            range(len(REPORTED)),
            Cells("parameter", lambda i: REPORTED[i]),
            Cells("unit", lambda i: REPORTED_UNITS[i]),
            Cells("true", lambda i: float(true[i])),
            Cells("error of the mean", lambda i: number(float(drawn.off_percent[i]), 2), "%"),
            Cells("scatter (2σ)", lambda i: float(spread[i]), digits=2),
        )


def _percent_column(name: str, i: int) -> Cells[SensitivityRow]:
    return Cells(name, lambda row: "–" if (p := row.percent[i]) is None else _percent_text(p))


def _percent_text(value: float) -> str:
    """Format an error [%]; values below 100 get a decimal."""
    return f"{round(value, 1) + 0.0:.1f}" if abs(value) < _NO_DECIMAL else f"{value:.0f}"


def run(request: SensitivityRequest, context: Context) -> SensitivityResult:
    """Compute the table and the draws, and write the table."""
    from rid_daq.operations.payload.payload_sensitivity import payload_sensitivity

    return SensitivityResult(request, payload_sensitivity(request, context))


OPERATION: Final = Operation(
    name="sensitivity",
    label="Compute the sensitivity of a payload",
    request=SensitivityRequest,
    run=run,
    examples=(
        "sensitivity kr15 --payload medium --output sensitivity.csv",
        "sensitivity kr15 --draws 1000 --doubt-links 5 --json",
    ),
    module="rid_daq.operations.payload.payload_sensitivity",
)
