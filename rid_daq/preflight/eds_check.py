"""Lines of the preflight on the drives' data sheets (EDS), before a drive is contacted."""

from __future__ import annotations

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
from config.errors import PreflightError
from config.formats.eds import ElectronicDataSheet
from config.load import LoadedCell, bundled_names, load_bundled_or_path
from drivers.data_sheets.eds_check import EdsFinding, eds_findings
from drivers.data_sheets.eds_fit import fit_eds
from rid_daq.preflight.check_line import CheckLine

MOST_LISTED = 4

_ADVICE = (
    "according to its data sheet this drive cannot be used: name the EDS of this drive and"
    " firmware in eds, or remove eds from the axis if the drive is right and its EDS is wrong"
)


def eds_lines(loaded: LoadedCell) -> list[CheckLine]:
    """Return lines on every data sheet and its SHA-256; an empty list without data sheets."""
    lines = []
    for axis, eds in _eds_files(loaded):
        findings = eds_findings(eds, loaded.config, axis)
        red = _red_findings(findings)
        action = f"{eds.name}: {_remedy(eds, loaded.config, axis)}" if red else ""
        lines.append(
            CheckLine(
                where=_axis_place(axis),
                what="data sheet (EDS)",
                required="contains all objects used",
                found=(f"deviating objects: {len(red)}" if red else "as required")
                + _unreadable_values(eds),
                verdict="red" if red else "ok",
                next_action=action,
                of_drive=True,
            )
        )
        lines += [_finding_line(axis, eds, finding) for finding in findings]
    hashes = {eds.name: eds.sha256 for _, eds in _eds_files(loaded)}
    lines += [
        CheckLine(name, f"SHA-256 of {name}", "", sha256, "shown")
        for name, sha256 in hashes.items()
    ]
    return lines


def _remedy(eds: ElectronicDataSheet, cell: CellConfig, axis: DriveAxis) -> str:
    """Return the remedy for a red data sheet: keys to add to the axis, or another EDS."""
    names = bundled_names("servos")
    profiles = {name: load_bundled_or_path(name, "servos", ServoProfile) for name in names}
    fit = fit_eds(eds, cell, axis, profiles)
    if not fit.accepted:
        return _ADVICE
    keys = ", ".join(f"{key}: {value}" for key, value in fit.keys.items())
    return f"add to the axis, with the right numbers: servo: {{{keys}}}"


def refuse_unfit_eds(loaded: LoadedCell) -> None:
    """Refuse a cell if a data sheet shows that its drive cannot be used.

    Raises:
        PreflightError: A drive cannot be used; the text names the first deviating objects and the
            number of further ones.
    """
    problems = [
        f"{_axis_place(axis)}: {_eds_place(eds, finding)}: {finding.object_name} {finding.name} is"
        f" {finding.found}, required: {finding.required}"
        for axis, eds in _eds_files(loaded)
        for finding in _red_findings(eds_findings(eds, loaded.config, axis))
    ]
    if problems:
        more = f"; and {len(problems) - MOST_LISTED} more" if len(problems) > MOST_LISTED else ""
        raise PreflightError(
            f"{'; '.join(problems[:MOST_LISTED])}{more}. No drive was contacted: {_ADVICE};"
            " `rid-daq check` lists all objects",
            code="RID-EDS-UNFIT",
        )


def _eds_files(loaded: LoadedCell) -> list[tuple[DriveAxis, ElectronicDataSheet]]:
    pairs = zip(loaded.config.axes, loaded.eds_files, strict=bool(loaded.eds_files))
    return [(axis, eds) for axis, eds in pairs if eds is not None]


def _red_findings(findings: tuple[EdsFinding, ...]) -> list[EdsFinding]:
    return [finding for finding in findings if finding.verdict == "red"]


def _axis_place(axis: DriveAxis) -> str:
    return f"{axis.joint}, node {axis.node_id}"


def _unreadable_values(eds: ElectronicDataSheet) -> str:
    """Return a phrase with the lines of unreadable values in a data sheet; empty without any."""
    lines = ", ".join(str(fault.line) for fault in eds.faults[:MOST_LISTED])
    more = ", ..." if len(eds.faults) > MOST_LISTED else ""
    return f"; values that cannot be read in lines {lines}{more}" if lines else ""


def _eds_place(eds: ElectronicDataSheet, finding: EdsFinding) -> str:
    return f"{eds.name}:{finding.line}" if finding.line else eds.name


def _finding_line(axis: DriveAxis, eds: ElectronicDataSheet, finding: EdsFinding) -> CheckLine:
    return CheckLine(
        where=_axis_place(axis),
        what=f"data sheet: {finding.object_name} {finding.name}",
        required=finding.required,
        found=finding.found,
        verdict=finding.verdict,
        next_action=f"see {_eds_place(eds, finding)}" if finding.verdict == "red" else "",
        of_drive=True,
    )
