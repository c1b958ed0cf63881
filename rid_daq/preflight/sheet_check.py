"""What the preflight has to say of the drives' electronic data sheets, before a drive is asked."""

from __future__ import annotations

from config.cell.cell import DriveAxis
from config.errors import PreflightError
from config.formats.eds import ElectronicDataSheet
from config.load import LoadedCell
from drivers.servo.eds_check import SheetFinding, sheet_findings
from rid_daq.preflight.bus_check import CheckLine

MOST_TOLD = 4

_ADVICE = (
    "by its data sheet this drive cannot do what it is needed for: name the sheet of this drive and"
    " firmware in eds, or leave eds out of the axis if the drive is right and its sheet is wrong"
)


def sheet_lines(loaded: LoadedCell) -> list[CheckLine]:
    """Return every data sheet with its SHA-256, and what is wrong with it; nothing without any."""
    lines = []
    for axis, sheet in _sheets(loaded):
        findings = sheet_findings(sheet, loaded.config, axis)
        red = _red(findings)
        lines.append(
            CheckLine(
                where=_where(axis),
                what="data sheet (EDS)",
                required="has what is used",
                found=(f"lacks {len(red)} of it" if red else "as required") + _unread(sheet),
                verdict="red" if red else "ok",
                next_action=f"{sheet.name}: {_ADVICE}" if red else "",
                of_drive=True,
            )
        )
        lines += [_line(axis, sheet, finding) for finding in findings]
    hashes = {sheet.name: sheet.sha256 for _, sheet in _sheets(loaded)}
    lines += [
        CheckLine(name, f"SHA-256 of {name}", "", sha256, "shown")
        for name, sha256 in hashes.items()
    ]
    return lines


def refuse_unfit_sheets(loaded: LoadedCell) -> None:
    """Refuse a cell whose data sheets say that a drive cannot do what it is needed for.

    Raises
    ------
    PreflightError
        Naming the first objects, and how many more there are.
    """
    told = [
        f"{_where(axis)}: {_place(sheet, finding)}: {finding.object_name} {finding.name} is"
        f" {finding.found}, required: {finding.required}"
        for axis, sheet in _sheets(loaded)
        for finding in _red(sheet_findings(sheet, loaded.config, axis))
    ]
    if told:
        more = f"; and {len(told) - MOST_TOLD} more" if len(told) > MOST_TOLD else ""
        raise PreflightError(
            f"{'; '.join(told[:MOST_TOLD])}{more}. Nothing was asked of the drives: {_ADVICE};"
            " `rid-daq check` lists all"
        )


def _sheets(loaded: LoadedCell) -> list[tuple[DriveAxis, ElectronicDataSheet]]:
    pairs = zip(loaded.config.axes, loaded.sheets, strict=bool(loaded.sheets))
    return [(axis, sheet) for axis, sheet in pairs if sheet is not None]


def _red(findings: tuple[SheetFinding, ...]) -> list[SheetFinding]:
    return [finding for finding in findings if finding.verdict == "red"]


def _where(axis: DriveAxis) -> str:
    return f"{axis.joint}, node {axis.node_id}"


def _unread(sheet: ElectronicDataSheet) -> str:
    """Say how many values of objects that are not used cannot be read."""
    lines = ", ".join(str(fault.line) for fault in sheet.faults[:MOST_TOLD])
    more = ", ..." if len(sheet.faults) > MOST_TOLD else ""
    return f"; values that cannot be read in lines {lines}{more}" if lines else ""


def _place(sheet: ElectronicDataSheet, finding: SheetFinding) -> str:
    return f"{sheet.name}:{finding.line}" if finding.line else sheet.name


def _line(axis: DriveAxis, sheet: ElectronicDataSheet, finding: SheetFinding) -> CheckLine:
    return CheckLine(
        where=_where(axis),
        what=f"data sheet: {finding.object_name} {finding.name}",
        required=finding.required,
        found=finding.found,
        verdict=finding.verdict,
        next_action=f"see {_place(sheet, finding)}" if finding.verdict == "red" else "",
        of_drive=True,
    )
