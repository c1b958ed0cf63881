"""`rid-daq payload export`: load data for a controller, read back before they are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.errors import EstimationError
from config.formats.whole_file import write_whole
from identification.payload.controllers.formats import LoadFormat, load_data
from identification.payload.file import read_payload
from identification.payload.verdict import PayloadResult
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite, refuse_output


def export(
    payload: Annotated[
        Path, typer.Argument(metavar="PAYLOAD", help="A payload file of `payload identify`.")
    ],
    to: Annotated[LoadFormat, typer.Option("--to", help="Whose controller it is for.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")
    ],
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Write a payload as a maker's controller wants it, units and frame at the top.

    The flange's frame is the robot file's tool frame. The values are those of a body that can
    exist. Nothing is written without a passed verdict; what was written is read back and compared.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    judged = read_payload(payload)
    refuse_unpassed(judged, payload)
    estimate = judged.estimate
    text = load_data(estimate.body, to, _origin(judged))
    write_whole(output, text.encode())
    console.document(
        {
            "file": str(output),
            "format": to.value,
            "robot": estimate.robot.name,
            "mass_kg": estimate.body.mass_kg,
        }
    )
    console.say(text.rstrip("\n"))
    console.verdict(True, f"Wrote {output}, and read it back the same")
    console.say(
        f"Next: enter it, save what the controller then holds, and compare: rid-daq payload"
        f" read-back {payload} SAVED --from {to.value}"
    )


def refuse_unpassed(judged: PayloadResult, path: Path) -> None:
    """Refuse a payload that did not pass.

    Raises
    ------
    EstimationError
        Its verdict is not passed: a controller with wrong load data stops without need, or does
        not stop when it should.
    """
    if judged.passed:
        return
    failed = "; ".join(line.text for line in judged.checks if not line.passed)
    raise EstimationError(
        f"{path}: the payload did not pass ({failed or 'nothing was checked'}), so no controller"
        " gets it: measure longer or with another motion, or state limits that you can answer for"
        " (payload identify --mass-limit, --centre-limit, --inertia-limit)"
    )


def _origin(judged: PayloadResult) -> tuple[str, ...]:
    estimate = judged.estimate
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    mass, sigma = estimate.reported[0], estimate.sigma[0]
    return (
        f"Payload on {estimate.robot.name} from {', '.join(estimate.run_ids) or 'runs'}{where}.",
        f"Verdict passed. Measured {mass:.4g} kg, 2 sigma {2 * sigma:.2g} kg; written is the",
        "closest body that can exist.",
    )
