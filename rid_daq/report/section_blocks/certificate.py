"""Texts and tables of a payload's certificate: the certified values, and the evidence for them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cell, Cells, Heading, Interval, Table, Text, table
from rid_daq.blocks.formats import number, unit
from rid_daq.report.certificate import Certificate
from rid_daq.report.section_blocks.centre_of_gravity import CentreOfGravity, centre_plot
from rid_daq.robot_view import robot_pictures

NOT_RECORDED: Final = "not recorded"
_MEANING: Final = {
    "m": "mass m",
    "cx": "centre of gravity cx",
    "cy": "centre of gravity cy",
    "cz": "centre of gravity cz",
}
_FRAME: Final = (
    "Frame: the flange, which is the tool frame of the robot file. The centre of gravity is"
    " relative to its origin. The inertia is about the centre of gravity, along the flange's"
    " axes, as elements of the matrix (Ixy = −∫ x y dm)."
)


def certified_values(certificate: Certificate) -> Iterator[AnyBlock]:
    """Yield identity and values, which the person on the certificate signs."""
    if certificate.simulated:
        yield Text(text="The cell is simulated: no hardware moved.")
    yield _facts(_identity(certificate))
    yield Heading(text="Mass, centre of gravity, inertia")
    yield _values(certificate)
    yield Text(text=_FRAME, is_note=True)
    yield Text(
        text="± 2σ: two standard deviations, computed from the residuals of the fit and from the"
        " assumed uncertainty of the torque constants. Not identified: the motion does not"
        " determine the value.",
        is_note=True,
    )


def certificate_evidence(certificate: Certificate) -> Iterator[AnyBlock]:
    """Yield the payload's drawings, fit, load data, origin and files."""
    if sum(certificate.payload.estimate.is_determined[1:4]) > 1:
        yield centre_plot(CentreOfGravity.of(certificate.payload.estimate))
    if all(certificate.payload.estimate.is_determined[1:4]):
        x, y, z = certificate.payload.estimate.reported[1:4].tolist()
        yield robot_pictures.flange_picture(certificate.payload.estimate.robot, (x, y, z))
    yield Heading(text="Fit of each axis")
    yield _fit(certificate)
    yield Heading(text="Load data for a controller")
    yield from _load_data(certificate)
    yield Heading(text="Method")
    yield Text(text=certificate.how)
    for finding in certificate.findings:
        yield Text(text=finding)
    yield Heading(text="Runs")
    yield _runs(certificate)
    yield Heading(text="Serial numbers")
    yield _facts(certificate.devices)
    yield Heading(text="Software")
    yield _facts(
        [
            (
                "Recorded with",
                ", ".join(f"{name} {each}" for name, each in certificate.folder.software.items()),
            ),
            ("Identified with", certificate.identified_with),
            ("Certificate by", certificate.written_with),
        ]
    )
    yield Heading(text="Files")
    yield from _files(certificate)


def _facts(rows: Sequence[tuple[str, str | None]]) -> Table:
    return table(rows, Cells("", lambda row: row[0]), Cells("", lambda row: row[1] or NOT_RECORDED))


def _identity(certificate: Certificate) -> list[tuple[str, str | None]]:
    estimate, cell = certificate.payload.estimate, certificate.cell
    folder = certificate.folder
    identified = certificate.identified_utc
    return [
        (
            "Session" if certificate.is_session else "Run",
            f"{folder.label} ({folder.run_id})",
        ),
        ("Robot", f"{estimate.robot.name}, {len(estimate.robot.joints)} joints"),
        ("Cell", None if cell is None else f"{cell.name}{', simulated' * certificate.simulated}"),
        ("Begun", _time(folder.created_utc)),
        ("Ended", _time(folder.finished_utc or folder.created_utc)),
        ("Identified", None if identified is None else _time(identified)),
        ("By", certificate.by),
    ]


def _values(certificate: Certificate) -> Table:
    estimate = certificate.payload.estimate
    known = {quantity.name for quantity in estimate.known}

    def shown(i: int, factor: float) -> Cell:
        if not estimate.is_determined[i]:
            return "not identified"
        value, reach = factor * float(estimate.reported[i]), 2.0 * factor * float(estimate.sigma[i])
        return Interval(value=value, reach=reach) if reach else f"{number(value, 6)} (fixed)"

    return table(
        range(len(REPORTED)),
        Cells("quantity", lambda i: _meaning(REPORTED[i])),
        Cells("value ± 2σ", lambda i: shown(i, 1e3 if REPORTED_UNITS[i] == "m" else 1.0)),
        Cells("unit", lambda i: _shown_unit(REPORTED_UNITS[i])),
        Cells("", lambda i: "stated by the user" if REPORTED[i] in known else ""),
    )


def _fit(certificate: Certificate) -> Table:
    estimate = certificate.payload.estimate
    return table(
        zip(estimate.robot.joints, estimate.fit, strict=True),
        Cells("axis", lambda each: each[1].joint),
        Cells("unit", lambda each: each[0].torque_unit),
        Cells("residual (RMS)", lambda each: each[1].residual_nm, digits=3),
        Cells("residual / torque", lambda each: each[1].percent, "%", 3),
        Cells("residual / noise", lambda each: each[1].over_noise, digits=2),
        Cells("fit", lambda each: each[1].grade or "–"),
        Cells("reason", lambda each: each[1].reason),
        failed=lambda each: each[1].grade is Grade.BAD,
    )


def _load_data(certificate: Certificate) -> Iterator[AnyBlock]:
    estimate = certificate.payload.estimate
    if not certificate.payload.passed or not certificate.is_whole:
        yield Text(text="No load data: the payload has not passed the verdict.")
        return
    moments, axes = estimate.body.principal
    rows: list[tuple[Cell, ...]] = []
    values = estimate.body.reported.tolist()
    for name, of, value in zip(REPORTED, REPORTED_UNITS, values, strict=True):
        factor = 1e3 if of == "m" else 1.0
        rows.append((_meaning(name), factor * value, _shown_unit(of)))
    for moment, axis in zip(moments.tolist(), axes.T.tolist(), strict=True):
        direction = ", ".join(f"{x:.4f}".replace("-", "\N{MINUS SIGN}") for x in axis)
        rows.append((f"principal moment about ({direction})", moment, unit("kg m^2")))
    yield table(
        rows,
        Cells("quantity", lambda row: row[0]),
        Cells("value", lambda row: row[1], digits=6),
        Cells("unit", lambda row: row[2]),
    )
    robot = estimate.robot
    offset = ", ".join(number(1e3 * value, 6) for value in robot.tool_offset_m)
    turn = ", ".join(number(math.degrees(value), 6) for value in robot.tool_rpy_rad)
    yield Text(
        text="Values of the closest physically consistent body, as `payload export` writes them."
        f" {_FRAME} The flange in the frame of the last link: offset ({offset}) mm; roll,"
        f" pitch, yaw ({turn})°.",
        is_note=True,
    )


def _runs(certificate: Certificate) -> Table:
    identified = set(certificate.payload.estimate.run_ids)
    return table(
        certificate.runs,
        Cells("step" if certificate.is_session else "label", lambda of: of[0] or of[1].label),
        Cells("run", lambda of: of[1].run_id),
        Cells("used for the estimate", lambda of: "yes" if of[1].run_id in identified else "no"),
        Cells("begun", lambda of: _time(of[1].created_utc)),
        Cells("ended", lambda of: _time(of[1].finished_utc or "")),
        Cells("status", lambda of: of[1].status),
        key=2,
    )


def _files(certificate: Certificate) -> Iterator[AnyBlock]:
    yield Text(
        text="When this certificate was written, each file had the SHA-256 in this table, which"
        " is also in manifest.json of its run."
    )
    if certificate.payload.estimate.procedure == "model":
        yield Text(text="Name and SHA-256 of the model of the robot are not recorded.")
    yield table(
        certificate.files,
        Cells("run", lambda file: file[0]),
        Cells("file", lambda file: file[1]),
        Cells("SHA-256", lambda file: file[2]),
        key=2,
    )


def _meaning(name: str) -> str:
    return _MEANING.get(name, f"inertia {name}")


def _shown_unit(of: str) -> str:
    return "mm" if of == "m" else unit(of)


def _time(stamp: str) -> str:
    return f"{stamp[:19].replace('T', ' ')} UTC"
