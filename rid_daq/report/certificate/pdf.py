"""`certificate_pdf`: the pages of a certificate; the same certificate gives the same bytes."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from fpdf.enums import MethodReturnValue, XPos, YPos

from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from rid_daq.blocks.formats import number, unit
from rid_daq.report.certificate.centre_views import HEIGHT_MM, draw_centre
from rid_daq.report.certificate.certificate import Certificate
from rid_daq.report.certificate.page import (
    GREEN,
    GREY,
    RED,
    SANS,
    SMALL_PT,
    CertificatePage,
)
from rid_daq.report.sections.section import units

NOT_RECORDED: Final = "not recorded"

_UTC: Final = " UTC"
_TITLE: Final = "Payload certificate"
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


def certificate_pdf(certificate: Certificate) -> bytes:
    """Return a certificate as PDF.

    Parameters
    ----------
    certificate : Certificate
        What it says.
    """
    what = "session" if certificate.is_session else "run"
    subject = f"{_TITLE} · {what} {certificate.run_id}"
    page = CertificatePage(subject, certificate.simulated, certificate.dated)
    page.set_title(subject)
    page.set_creator(certificate.written_with)
    page.add_page()
    _head(page, certificate)
    _values(page, certificate)
    _picture(page, certificate)
    _limits(page, certificate)
    _fit(page, certificate)
    _load_data(page, certificate)
    _findings(page, certificate)
    _origin(page, certificate)
    _files(page, certificate)
    _signature(page, certificate)
    return bytes(page.output())


def _head(page: CertificatePage, certificate: Certificate) -> None:
    """Write title, verdict, and who, when and where."""
    verdict = certificate.verdict
    page.text_font("B", 17.0)
    page.cell(0.0, 9.0, _TITLE, new_x=XPos.LMARGIN, new_y=YPos.NEXT)
    if certificate.simulated:
        page.sentence("The cell is simulated: no hardware moved.", colour=RED)
    page.ln(1.5)
    page.set_font(SANS, "B", 13.0)
    page.set_text_color(*(GREEN if verdict.passed else RED))
    page.cell(
        0.0, 7.0, "PASSED" if verdict.passed else "FAILED", new_x=XPos.LMARGIN, new_y=YPos.NEXT
    )
    if not verdict.passed:
        page.sentence(f"Limits not kept: {verdict.headline.partition(': ')[2]}.")
    page.sentence(verdict.sentence)
    page.ln(2.0)
    estimate = certificate.payload.estimate
    what = "Session" if certificate.is_session else "Run"
    page.rows(
        (26, 74),
        [
            (what, f"{certificate.label} ({certificate.run_id})"),
            ("Robot", f"{estimate.robot.name}, {len(estimate.robot.joints)} joints"),
            ("Cell", f"{_or_not(certificate.cell)}{', simulated' * certificate.simulated}"),
            ("Begun, ended", f"{_time(certificate.begun_utc)}, {_time(certificate.ended_utc)}"),
            (
                "Identified",
                NOT_RECORDED
                if certificate.identified_utc is None
                else _time(certificate.identified_utc),
            ),
            ("By", _or_not(certificate.by)),
        ],
    )


def _values(page: CertificatePage, certificate: Certificate) -> None:
    """Write the ten values with their intervals."""
    estimate = certificate.payload.estimate
    known = {quantity.name for quantity in estimate.known}
    page.heading("Mass, centre of gravity, inertia", 70.0)
    rows = []
    for i, (name, of) in enumerate(zip(REPORTED, REPORTED_UNITS, strict=True)):
        factor, shown = (1e3, "mm") if of == "m" else (1.0, unit(of))
        value, interval = "not seen", "–"
        if estimate.seen[i]:
            value, interval = _with_interval(
                factor * float(estimate.reported[i]), 2.0 * factor * float(estimate.sigma[i])
            )
        note = "known otherwise" if name in known else ""
        rows.append((_MEANING.get(name, f"inertia {name}"), value, interval, shown, note))
    page.rows(
        (32, 20, 18, 12, 18), rows, head=("quantity", "value", "± 2σ", "unit", ""), aligned="LRRLL"
    )
    page.ln(1.0)
    page.sentence(_FRAME, SMALL_PT, GREY)
    page.sentence(
        "± 2σ: two standard deviations, by what the fit leaves and by the torque constants as far"
        " as they are known. Not seen: the motion does not show it.",
        SMALL_PT,
        GREY,
    )


def _picture(page: CertificatePage, certificate: Certificate) -> None:
    """Draw the centre of gravity, where all of it is seen."""
    estimate = certificate.payload.estimate
    page.heading("Where the centre of gravity lies", HEIGHT_MM + 14.0)
    if not all(estimate.seen[1:4]):
        page.sentence("Not drawn: the motion does not show all of its coordinates.")
        return
    draw_centre(page, estimate.reported[1:4], 2.0 * estimate.sigma[1:4])
    page.sentence(
        "Circle: the flange's origin. Point: the centre of gravity; bars: ± 2σ.", SMALL_PT, GREY
    )


def _limits(page: CertificatePage, certificate: Certificate) -> None:
    """Write what the verdict was held to."""
    page.heading("Limits of the verdict", 30.0)
    page.rows(
        (58, 15, 17, 10),
        [
            (
                line.text,
                f"{number(line.value, 3)} {line.unit}".strip(),
                f"{line.relation} {number(line.limit, 3)} {line.unit}".strip(),
                "passed" if line.passed else "FAILED",
            )
            for line in certificate.payload.checks
        ],
        head=("what", "reached", "limit", ""),
        aligned="LRRL",
        size_pt=8.0,
    )


def _fit(page: CertificatePage, certificate: Certificate) -> None:
    """Write how well payload and robot explain each axis' torque."""
    estimate = certificate.payload.estimate
    page.heading("How well the recordings are explained", 30.0)
    page.rows(
        (20, 17, 17, 17, 12, 47),
        [
            (
                fit.joint,
                f"{number(fit.residual_nm, 3)} {units(joint)[1]}",
                f"{number(fit.percent, 3)} %",
                "–" if fit.over_noise is None else f"{number(fit.over_noise, 2)} times",
                fit.grade or "–",
                fit.reason,
            )
            for joint, fit in zip(estimate.robot.joints, estimate.fit, strict=True)
        ],
        head=("axis", "residual (RMS)", "of its torque", "over the noise", "fit", "what decides"),
        aligned="LRRRLL",
        size_pt=8.0,
    )


def _load_data(page: CertificatePage, certificate: Certificate) -> None:
    """Write what a controller is given."""
    estimate = certificate.payload.estimate
    page.heading("Load data for a controller", 40.0)
    if not certificate.payload.passed or not certificate.is_whole:
        page.sentence("None: the verdict is not passed.")
        return
    body = estimate.body
    moments, axes = body.principal
    rows = []
    for name, of, value in zip(REPORTED, REPORTED_UNITS, body.reported.tolist(), strict=True):
        factor, shown = (1e3, "mm") if of == "m" else (1.0, unit(of))
        rows.append((_MEANING.get(name, f"inertia {name}"), number(factor * value, 6), shown))
    for moment, axis in zip(moments.tolist(), axes.T.tolist(), strict=True):
        direction = ", ".join(_signed(f"{x:.4f}") for x in axis)
        rows.append((f"principal moment about ({direction})", number(moment, 6), unit("kg m^2")))
    page.rows((56, 24, 20), rows, head=("quantity", "value", "unit"), aligned="LRL")
    page.ln(1.0)
    robot = estimate.robot
    offset = ", ".join(number(1e3 * value, 6) for value in robot.tool_offset_m)
    turn = ", ".join(number(math.degrees(value), 6) for value in robot.tool_rpy_rad)
    page.sentence(
        "The closest body that can exist, as `payload export` writes it. "
        f"{_FRAME} The flange in the frame of the last link: offset ({offset}) mm; roll, pitch,"
        f" yaw ({turn})°.",
        SMALL_PT,
        GREY,
    )


def _findings(page: CertificatePage, certificate: Certificate) -> None:
    """Write how the payload was found, and what a person should know."""
    page.heading("How it was found")
    page.sentence(certificate.how)
    for finding in certificate.findings:
        page.ln(0.8)
        page.sentence(f"• {finding}")


def _origin(page: CertificatePage, certificate: Certificate) -> None:
    """Write runs, devices and software."""
    page.heading("Runs", 30.0)
    identified = set(certificate.payload.estimate.run_ids)
    page.rows(
        (12, 28, 12, 19, 19, 10),
        [
            (
                run.step or run.label,
                run.run_id,
                "yes" if run.run_id in identified else "no",
                _time(run.created_utc).removesuffix(_UTC),
                _time(run.finished_utc).removesuffix(_UTC),
                run.status,
            )
            for run in certificate.runs
        ],
        head=("step" if certificate.is_session else "label", "run", "estimated from", "begun [UTC]",
              "ended [UTC]", "status"),
        size_pt=7.0, mono=(1,),
    )  # fmt: skip
    page.heading("Serial numbers")
    page.rows(
        (50, 50), [(device.name, _or_not(device.serial)) for device in certificate.devices],
        size_pt=SMALL_PT,
    )  # fmt: skip
    page.heading("Software")
    versions = ", ".join(f"{name} {version}" for name, version in certificate.software)
    page.rows(
        (26, 74),
        [
            ("Recorded with", versions or NOT_RECORDED),
            ("Identified with", certificate.identified_with),
            ("Certificate by", certificate.written_with),
        ],
        size_pt=SMALL_PT,
    )


def _files(page: CertificatePage, certificate: Certificate) -> None:
    """Write SHA-256 of the files."""
    page.heading("Files", 40.0)
    page.sentence(
        "Each file's SHA-256 was the one below, as in its run's manifest.json, when this"
        " certificate was written."
    )
    if certificate.payload.estimate.procedure == "model":
        page.sentence("Name and SHA-256 of the model of the unloaded robot: not recorded.")
    page.ln(1.0)
    page.rows(
        (26, 18, 56),
        [(file.run_id, file.name, file.sha256) for file in certificate.files],
        head=("run", "file", "SHA-256"),
        size_pt=6.5,
        mono=(0, 2),
    )


def _signature(page: CertificatePage, certificate: Certificate) -> None:
    """Write the line to sign on, and what was left out of texts."""
    if page.lacks_characters:
        page.ln(2.0)
        page.sentence(
            "[U+…]: a character that the font of these pages does not have, by its Unicode number.",
            SMALL_PT,
            GREY,
        )
    width = 0.5 * (page.epw - 12.0)
    name = "Name, signature" if certificate.by is None else f"Signature: {certificate.by}"
    page.text_font(size_pt=SMALL_PT)
    height = page.multi_cell(
        width, 3.6, page.plain(name), dry_run=True, output=MethodReturnValue.HEIGHT
    )
    assert isinstance(height, float)
    if page.will_page_break(18.0 + height):
        page.add_page()
    page.ln(16.0)
    y = page.get_y()
    page.set_draw_color(0, 0, 0)
    page.set_line_width(0.2)
    for left, text in ((page.l_margin, "Place, date"), (page.l_margin + width + 12.0, name)):
        page.line(left, y, left + width, y)
        page.set_xy(left, y + 1.0)
        page.text_font(size_pt=SMALL_PT)
        page.multi_cell(width, 3.6, page.plain(text), align="L")


def _with_interval(value: float, two_sigma: float) -> tuple[str, str]:
    """Return a value to two digits of its interval, and the interval; held where that is zero."""
    if two_sigma == 0.0:
        return number(value, 6), "held"
    places = int(np.clip(1 - math.floor(math.log10(two_sigma)), 0, 9))
    return _signed(f"{value:.{places}f}"), f"{two_sigma:.{places}f}"


def _signed(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")


def _or_not(text: str | None) -> str:
    return text or NOT_RECORDED


def _time(stamp: str) -> str:
    return f"{stamp[:19].replace('T', ' ')}{_UTC}"
