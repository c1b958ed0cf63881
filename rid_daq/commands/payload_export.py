"""`rid-daq payload export`: load data for a controller, read back before they are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identification.payload.controllers.formats import LoadFormat
from rid_daq.jobs.payload.load_data_job import PayloadExportRequest, export_payload
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
    exported = export_payload(PayloadExportRequest(payload, to, output))
    console.document(
        {
            "file": str(output),
            "format": to.value,
            "robot": exported.estimate.robot.name,
            "mass_kg": exported.estimate.body.mass_kg,
        }
    )
    console.say(exported.text.rstrip("\n"))
    console.verdict(True, f"Wrote {output}, and read it back the same")
    console.say(
        f"Next: enter it, save what the controller then holds, and compare: rid-daq payload"
        f" read-back {payload} SAVED --from {to.value}"
    )
