"""`payload certificate`: write the certificate of a payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field, StringConstraints

from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, Option, Overwrite, RunsFolder
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import CERTIFICATE

if TYPE_CHECKING:
    from rid_daq.report.certificate import Certificate


class PayloadCertificateRequest(Request):
    """Write a payload's certificate: values with intervals, verdict and limits, origin, SHA-256.

    All listed files are compared with their SHA-256 first. A failed verdict is certified as failed;
    an unfinished session is refused. The same session gives the same page with the same options and
    version of rid-daq.
    """

    session: Annotated[
        str,
        Field(description="Payload session, or a run with a payload of `payload identify`."),
        Option(positional=True, metavar="SESSION"),
    ]
    output: Annotated[
        Path | None,
        Field(
            description=f"File to write (.html or .pdf); {CERTIFICATE} of the session if not set. A"
            " page (.html) is always written; PDF is printed from it and needs an installed"
            " Chromium."
        ),
        Option(short="o", metavar="FILE", group=FILES, file="output", endings=(".pdf", ".html")),
    ] = None
    by: Annotated[
        Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]
        | None,
        Field(description="Person responsible for the certificate."),
        Option(metavar="NAME"),
    ] = None
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS

    @property
    def is_page(self) -> bool:
        """True if `output` names a page (.html)."""
        return self.output is not None and self.output.suffix == ".html"


class CertificateDocument(TypedDict):
    """A written certificate."""

    file: str
    run: str
    simulated: bool
    verdict: object


@dataclass(frozen=True)
class PayloadCertificateResult:
    """A certificate that was written.

    Attributes:
        certificate: Contents of the certificate.
    """

    certificate: Certificate
    file: Path

    def document(self) -> CertificateDocument:
        """Return file, run and verdict."""
        return {
            "file": str(self.file),
            "run": self.certificate.folder.run_id,
            "simulated": self.certificate.simulated,
            "verdict": self.certificate.verdict,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the certified verdict, and the file name."""
        if self.certificate.simulated:
            yield Text(text="The cell is simulated; every page of the certificate states this.")
        yield Text(text=f"Certified verdict: {self.certificate.verdict.headline}")
        yield Verdict(passed=True, text=f"Wrote {self.file}")


def run(request: PayloadCertificateRequest, _context: Context) -> PayloadCertificateResult:
    """Write the certificate."""
    from rid_daq.operations.payload.certified_session import write_certificate

    return PayloadCertificateResult(*write_certificate(request))


OPERATION: Final = Operation(
    name="payload certificate",
    label="Write a certificate",
    request=PayloadCertificateRequest,
    run=run,
    examples=(
        "payload certificate latest --by Smith",
        "payload certificate gripper --output gripper.pdf --json",
    ),
    module="rid_daq.operations.payload.certified_session",
)
