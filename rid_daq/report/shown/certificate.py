"""`certificate_blocks`: what the certificate of a payload says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cell, Column, Heading, Interval, Table, Text
from rid_daq.blocks.formats import number, unit
from rid_daq.report.certificate import Certificate
from rid_daq.report.sections.section import units
from rid_daq.report.shown.centre_of_gravity import CentreOfGravity, centre_plot

NOT_RECORDED: Final = "not recorded"
_MEANING: Final = {
    "m": "mass m",
    "cx": "centre of gravity cx",
    "cy": "centre of gravity cy",
    "cz": "centre of gravity cz",
}
_FRAME: Final = (
    "Frame: the flange, which is the tool frame of the robot file. Centre of gravity from its"
    " origin; inertia about the centre of gravity, along the flange's axes, as elements of the"
    " matrix (Ixy = −∫ x y dm)."
)


def certificate_blocks(certificate: Certificate) -> Iterator[AnyBlock]:
    """Yield identity, values, limits, fit, load data, origin and files.

    Args:
        certificate: Its contents.
    """
    if certificate.simulated:
        yield Text(text="The cell is simulated: no hardware moved.")
    yield _facts(_identity(certificate))
    yield Heading(text="Mass, centre of gravity, inertia")
    yield _values(certificate)
    yield Text(text=_FRAME, is_note=True)
    yield Text(
        text="± 2σ: two standard deviations, by what the fit leaves and by the torque constants as"
        " far as they are known. Not seen: the motion does not show it.",
        is_note=True,
    )
    if sum(certificate.payload.estimate.seen[1:4]) > 1:
        yield centre_plot(CentreOfGravity.of(certificate.payload.estimate))
    yield Heading(text="Fit of each axis")
    yield _fit(certificate)
    yield Heading(text="Load data for a controller")
    yield from _load_data(certificate)
    yield Heading(text="How it was found")
    yield Text(text=certificate.how)
    for finding in certificate.findings:
        yield Text(text=finding)
    yield Heading(text="Runs")
    yield _runs(certificate)
    yield Heading(text="Serial numbers")
    yield _facts([(device.name, device.serial) for device in certificate.devices])
    yield Heading(text="Software")
    yield _facts(
        [
            ("Recorded with", ", ".join(f"{name} {each}" for name, each in certificate.software)),
            ("Identified with", certificate.identified_with),
            ("Certificate by", certificate.written_with),
        ]
    )
    yield Heading(text="Files")
    yield from _files(certificate)


def _facts(rows: list[tuple[str, str | None]]) -> Table:
    return Table(
        columns=(Column(title="", is_text=True), Column(title="", is_text=True)),
        rows=tuple((name, text or NOT_RECORDED) for name, text in rows),
    )


def _identity(certificate: Certificate) -> list[tuple[str, str | None]]:
    estimate, cell = certificate.payload.estimate, certificate.cell
    identified = certificate.identified_utc
    return [
        (
            "Session" if certificate.is_session else "Run",
            f"{certificate.label} ({certificate.run_id})",
        ),
        ("Robot", f"{estimate.robot.name}, {len(estimate.robot.joints)} joints"),
        ("Cell", None if cell is None else f"{cell.name}{', simulated' * certificate.simulated}"),
        ("Begun", _time(certificate.begun_utc)),
        ("Ended", _time(certificate.ended_utc)),
        ("Identified", None if identified is None else _time(identified)),
        ("By", certificate.by),
    ]


def _values(certificate: Certificate) -> Table:
    estimate = certificate.payload.estimate
    known = {quantity.name for quantity in estimate.known}

    def shown(i: int, factor: float) -> Cell:
        if not estimate.seen[i]:
            return "not seen"
        value, reach = factor * float(estimate.reported[i]), 2.0 * factor * float(estimate.sigma[i])
        return Interval(value=value, reach=reach) if reach else f"{number(value, 6)} (held)"

    return Table(
        columns=(
            Column(title="quantity", is_text=True),
            Column(title="value ± 2σ"),
            Column(title="unit", is_text=True),
            Column(title="", is_text=True),
        ),
        rows=tuple(
            (
                _MEANING.get(name, f"inertia {name}"),
                shown(i, 1e3 if of == "m" else 1.0),
                _shown_unit(of),
                "known otherwise" if name in known else "",
            )
            for i, (name, of) in enumerate(zip(REPORTED, REPORTED_UNITS, strict=True))
        ),
    )


def _fit(certificate: Certificate) -> Table:
    estimate = certificate.payload.estimate
    return Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="residual (RMS)", digits=3),
            Column(title="of its torque", unit="%", digits=3),
            Column(title="times the noise", digits=2),
            Column(title="fit", is_text=True),
            Column(title="reason", is_text=True),
        ),
        rows=tuple(
            (
                fit.joint,
                units(joint)[1],
                fit.residual_nm,
                fit.percent,
                fit.over_noise,
                fit.grade or "–",
                fit.reason,
            )
            for joint, fit in zip(estimate.robot.joints, estimate.fit, strict=True)
        ),
        failed=tuple(fit.grade is Grade.BAD for fit in estimate.fit),
    )


def _load_data(certificate: Certificate) -> Iterator[AnyBlock]:
    """Yield what a controller is given."""
    estimate = certificate.payload.estimate
    if not certificate.payload.passed or not certificate.is_whole:
        yield Text(text="None: the verdict is not passed.")
        return
    moments, axes = estimate.body.principal
    rows: list[tuple[Cell, ...]] = []
    values = estimate.body.reported.tolist()
    for name, of, value in zip(REPORTED, REPORTED_UNITS, values, strict=True):
        factor = 1e3 if of == "m" else 1.0
        rows.append((_MEANING.get(name, f"inertia {name}"), factor * value, _shown_unit(of)))
    for moment, axis in zip(moments.tolist(), axes.T.tolist(), strict=True):
        direction = ", ".join(f"{x:.4f}".replace("-", "\N{MINUS SIGN}") for x in axis)
        rows.append((f"principal moment about ({direction})", moment, unit("kg m^2")))
    yield Table(
        columns=(
            Column(title="quantity", is_text=True),
            Column(title="value", digits=6),
            Column(title="unit", is_text=True),
        ),
        rows=tuple(rows),
    )
    robot = estimate.robot
    offset = ", ".join(number(1e3 * value, 6) for value in robot.tool_offset_m)
    turn = ", ".join(number(math.degrees(value), 6) for value in robot.tool_rpy_rad)
    yield Text(
        text=f"The closest physically consistent body, as `payload export` writes it. {_FRAME} The"
        f" flange in the frame of the last link: offset ({offset}) mm; roll, pitch, yaw ({turn})°.",
        is_note=True,
    )


def _runs(certificate: Certificate) -> Table:
    identified = set(certificate.payload.estimate.run_ids)
    names = ("step" if certificate.is_session else "label", "run", "used for the estimate")
    return Table(
        columns=tuple(
            Column(title=title, is_text=True) for title in (*names, "begun", "ended", "status")
        ),
        rows=tuple(
            (
                run.step or run.label,
                run.run_id,
                "yes" if run.run_id in identified else "no",
                _time(run.created_utc),
                _time(run.finished_utc),
                run.status,
            )
            for run in certificate.runs
        ),
        key=2,
    )


def _files(certificate: Certificate) -> Iterator[AnyBlock]:
    yield Text(
        text="When this certificate was written, the SHA-256 of each file was the one below, as in"
        " manifest.json of its run."
    )
    if certificate.payload.estimate.procedure == "model":
        yield Text(text="Name and SHA-256 of the model of the unloaded robot: not recorded.")
    yield Table(
        columns=(
            Column(title="run", is_text=True),
            Column(title="file", is_text=True),
            Column(title="SHA-256", is_text=True),
        ),
        rows=tuple((file.run_id, file.name, file.sha256) for file in certificate.files),
        key=2,
    )


def _shown_unit(of: str) -> str:
    return "mm" if of == "m" else unit(of)


def _time(stamp: str) -> str:
    return f"{stamp[:19].replace('T', ' ')} UTC"
